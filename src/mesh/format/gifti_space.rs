//! Where a GIFTI surface's coordinates lie: in the scanner's frame, or in one that a matrix of the file leads there from.
//!
//! FreeSurfer keeps its surfaces about the middle of its own volume and writes the way to the scanner's frame beside them, in newer
//! versions as the format's matrix, in older ones in words of its own alone.

const SCANNER: &str = "NIFTI_XFORM_SCANNER_ANAT";
/// FreeSurfer's words for the middle of its volume in the scanner's frame, mm.
const MIDDLE: [&str; 3] = ["VolGeomC_R", "VolGeomC_A", "VolGeomC_S"];

/// Which frame a surface's coordinates are in, in GIFTI's words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// A scan's own frame.
    Scanner,
    /// That of another scan or of some other truth, which the file does not name.
    Aligned,
    /// MNI 152.
    Mni152,
    /// Talairach's by its word, which Connectome Workbench and FreeSurfer also write of surfaces in the scanner's frame.
    Talairach,
}

impl Space {
    /// The frame by the code of a NIfTI header (qform_code, sform_code); the scanner's for a code that says no other.
    pub fn of_nifti_code(code: i32) -> Self {
        match code {
            2 => Self::Aligned,
            3 => Self::Talairach,
            4 => Self::Mni152,
            _ => Self::Scanner,
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Scanner => "NIFTI_XFORM_SCANNER_ANAT",
            Self::Aligned => "NIFTI_XFORM_ALIGNED_ANAT",
            Self::Mni152 => "NIFTI_XFORM_MNI_152",
            Self::Talairach => "NIFTI_XFORM_TALAIRACH",
        }
    }

    /// The frame by its name in a file; `None` for a word that names no known one.
    fn named(word: &str) -> Option<Self> {
        [Self::Scanner, Self::Aligned, Self::Mni152, Self::Talairach]
            .into_iter()
            .find(|space| space.name() == word.trim())
    }
}

/// A `CoordinateSystemTransformMatrix` as it stands in the file.
#[derive(Default)]
pub(super) struct Transform {
    pub data_space: String,
    pub transformed_space: String,
    pub matrix: String,
}

/// Takes coordinates to the scanner's frame where the file says the way there; returns the frame that it says they are in then.
///
/// # Errors
/// A matrix that is none; coordinates about FreeSurfer's middle with nothing but its words to say so, since other programs leave
/// those words where they have taken the coordinates on.
pub(super) fn to_scanner(
    nodes_mm: &mut [[f64; 3]],
    transforms: &[Transform],
    about: &[(String, String)],
) -> Result<Option<Space>, String> {
    if transforms.iter().any(|t| t.data_space.trim() == SCANNER) {
        return Ok(Some(Space::Scanner));
    }
    if let Some(there) = transforms.iter().find(|t| t.transformed_space.trim() == SCANNER) {
        let m =
            rows_of(&there.matrix).ok_or("its matrix to the scanner's frame does not hold sixteen finite numbers")?;
        for p in nodes_mm {
            *p = std::array::from_fn(|r| m[r][0] * p[0] + m[r][1] * p[1] + m[r][2] * p[2] + m[r][3]);
        }
        return Ok(Some(Space::Scanner));
    }
    let value = |key: &&str| about.iter().find(|(name, _)| name == key).and_then(|(_, v)| v.trim().parse::<f64>().ok());
    if MIDDLE.iter().filter_map(value).any(|c| c.abs() > 1e-3) {
        return Err("FreeSurfer wrote it about the middle of its volume, and whether it has been taken to the scanner's frame since \
                    the file does not say; write it with `mris_convert --to-scanner`"
            .to_owned());
    }
    // Of the data alone: FreeSurfer writes the way to Talairach's space into files about the middle of its volume.
    Ok(transforms.iter().find_map(|t| Space::named(&t.data_space)))
}

fn rows_of(matrix: &str) -> Option<[[f64; 4]; 4]> {
    let numbers: Vec<f64> = matrix.split_ascii_whitespace().map(|word| word.parse().ok()).collect::<Option<_>>()?;
    let rows: [[f64; 4]; 4] = numbers.as_chunks::<4>().0.try_into().ok()?;
    (numbers.len() == 16 && numbers.iter().all(|x| x.is_finite())).then_some(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(data: &str, transformed: &str, matrix: &str, about: &[(&str, &str)]) -> Result<[f64; 3], String> {
        let transform = Transform {
            data_space: data.to_owned(),
            transformed_space: transformed.to_owned(),
            matrix: matrix.to_owned(),
        };
        let about: Vec<_> = about.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
        let mut nodes = [[1.0, 2.0, 3.0]];
        to_scanner(&mut nodes, &[transform], &about).map(|_| nodes[0])
    }

    #[test]
    fn a_matrix_to_the_scanner_is_followed_and_one_from_it_is_not() {
        let unknown = "NIFTI_XFORM_UNKNOWN";
        let matrix = "0 -1 0 10\n1 0 0 20\n0 0 1 5\n0 0 0 1";
        assert_eq!(moved(unknown, SCANNER, matrix, &[]), Ok([8.0, 21.0, 8.0]));
        assert_eq!(moved(SCANNER, unknown, matrix, &[("VolGeomC_R", "4.0")]), Ok([1.0, 2.0, 3.0]));
        assert_eq!(moved(unknown, unknown, matrix, &[]), Ok([1.0, 2.0, 3.0]));
        assert!(moved(unknown, SCANNER, "1 0 0", &[]).unwrap_err().contains("sixteen"));
    }

    #[test]
    fn the_frame_of_the_data_is_told_and_not_the_one_that_a_matrix_leads_to() {
        let told = |data: &str, transformed: &str| {
            let (data_space, transformed_space) = (format!("{data}\n"), transformed.to_owned());
            to_scanner(&mut [], &[Transform { data_space, transformed_space, matrix: String::new() }], &[]).unwrap()
        };
        let (mni, talairach) = ("NIFTI_XFORM_MNI_152", "NIFTI_XFORM_TALAIRACH");
        assert_eq!(told(mni, mni), Some(Space::Mni152));
        assert_eq!(told(talairach, talairach), Some(Space::Talairach));
        assert_eq!(told("NIFTI_XFORM_ALIGNED_ANAT", talairach), Some(Space::Aligned));
        assert_eq!(told(SCANNER, talairach), Some(Space::Scanner));
        assert_eq!(told("NIFTI_XFORM_UNKNOWN", talairach), None);
    }

    #[test]
    fn a_middle_in_words_alone_is_refused() {
        let words = [("VolGeomC_R", "-3.5"), ("VolGeomC_A", "0"), ("VolGeomC_S", "12")];
        let said = moved("NIFTI_XFORM_UNKNOWN", "NIFTI_XFORM_UNKNOWN", "", &words).unwrap_err();
        assert!(said.contains("mris_convert --to-scanner"), "{said}");
        assert!(moved("", "", "", &[("VolGeomC_R", "0"), ("VolGeomC_A", "0")]).is_ok());
    }
}
