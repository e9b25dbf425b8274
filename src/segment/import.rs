//! A label map of another tool, carried to hgm's numbers once its anatomy makes sense.

use crate::anatomy::{
    LabelCount, LabelError, LabelTable, Recognised, Side, Structure, Tissue, built_in, label, recognise,
};
use crate::geometry::Frame;
use crate::image::components::fill_holes;
use crate::image::distance::distance_mm;
use crate::image::morphology::close;
use crate::image::{LabelMap, Volume};
use rayon::prelude::*;
use std::collections::BTreeMap;
use thiserror::Error;

/// A label map in hgm's numbers, and what it was.
#[derive(Clone, Debug)]
pub struct ImportedLabels<F: Frame> {
    /// hgm's numbers on the file's own grid.
    pub labels: LabelMap<F>,
    /// The table that was recognised.
    pub table: String,
    /// Which files hold such numbers.
    pub files: &'static str,
    /// Volumes by tissue, in the order of hgm's numbers; what does not occur is left out.
    pub volumes_cc: Vec<(Tissue, f64)>,
    /// Numbers that occur.
    pub structures: usize,
    /// The map's tool labels the cerebellum by itself, and this map has none.
    pub without_cerebellum: bool,
}

/// Why a label map is not believed.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ImportError {
    /// Its numbers are not those of a table.
    #[error(transparent)]
    Numbers(#[from] LabelError),
    /// Left lies on the right.
    #[error(
        "read as {table}, left and right are exchanged: its left structures lie {apart_mm:.0} mm to the right of its right \
         ones; the file's orientation is wrong, or the numbers are another tool's"
    )]
    Mirrored {
        /// The table.
        table: String,
        /// Distance between the two centres along left-right.
        apart_mm: f64,
    },
    /// A tumour's map, not a brain's.
    #[error(
        "it labels {cc:.0} cc with {} alone: that is a map of a tumour (BraTS: 1 core, 2 oedema, 3 or 4 enhancing tumour), where a \
         map of the whole brain is asked for; give the brain's labels with the tumour drawn into them under numbers of its own: 6 \
         (tumour) and 7 (oedema) in a map that `hgm segment` has made; with another tool's map a table of all its numbers says which is \
         the tumour's",
        listed(codes)
    )]
    Tumour {
        /// Its numbers.
        codes: Vec<u32>,
        /// All it labels.
        cc: f64,
    },
    /// One hemisphere is not there.
    #[error(
        "read as {table}, its {missing} hemisphere is missing: {missing_cc:.0} cc of tissue to {other_cc:.0} cc on the other side; \
         give the map of the whole brain, as the tool wrote it"
    )]
    OneSided {
        /// The table.
        table: String,
        /// `left` or `right`.
        missing: &'static str,
        /// Tissue of that side.
        missing_cc: f64,
        /// Tissue of the other.
        other_cc: f64,
    },
    /// The tissues do not lie as in a brain.
    #[error(
        "read as {table}, it is no brain: {what}; check that the map is whole and that the numbers are those of this tool"
    )]
    NoBrain {
        /// The table.
        table: String,
        /// What is wrong with it.
        what: String,
    },
}

/// Recognises the numbers of a map (among `chosen` tables where there is a choice) and carries them to hgm's.
///
/// # Errors
/// [`ImportError`] for numbers no table has, and for a map whose tissues do not lie as in a brain.
pub fn import_labels<F: Frame>(
    codes: &Volume<u32, F>,
    chosen: Option<&[&LabelTable]>,
) -> Result<ImportedLabels<F>, ImportError> {
    let counts = counts(codes);
    let cc_of = |voxels: usize| voxels as f64 * codes.grid.voxel_volume_mm3() / 1000.0;
    // What a table of the user's own says of such numbers counts.
    if chosen.is_none_or(|tables| tables.iter().all(|table| table.name == "hgm"))
        && let Some(tumour) = tumour_alone(&counts, cc_of)
    {
        return Err(tumour);
    }
    let Recognised { table, found } = recognise(&counts, chosen)
        .map_err(|why| half_of_a_known_map(&counts, chosen, cc_of).unwrap_or_else(|| why.into()))?;
    let labels = codes.map(|code| table.structure(code).map_or(label::BACKGROUND, |s| s.tissue.label()));
    let name = || table.name.clone();
    if let Some(apart_mm) = sides_exchanged_mm(codes, table) {
        return Err(ImportError::Mirrored { table: name(), apart_mm });
    }
    if let Some(one_sided) = one_sided(table, &found, cc_of) {
        return Err(one_sided);
    }
    if let Some(what) = no_brain(&labels) {
        return Err(ImportError::NoBrain { table: name(), what });
    }
    let mut volumes: BTreeMap<Tissue, f64> = BTreeMap::new();
    for &(structure, voxels) in &found {
        *volumes.entry(structure.tissue).or_default() += cc_of(voxels);
    }
    volumes.remove(&Tissue::Outside);
    let volumes_cc = volumes.into_iter().collect();
    let cerebellum = |s: &Structure| s.tissue != Tissue::Outside && s.name.to_ascii_lowercase().contains("cerebell");
    let without_cerebellum =
        table.structures.iter().any(cerebellum) && !found.iter().any(|(structure, _)| cerebellum(structure));
    let structures = found.len();
    Ok(ImportedLabels { labels, table: name(), files: table.files, volumes_cc, structures, without_cerebellum })
}

/// Less tissue than this is no brain's, cc; the largest tumours with their oedema stay below.
const LEAST_TISSUE_CC: f64 = 300.0;

/// A map of a few small numbers and too little for a brain: as BraTS numbers the parts of a tumour.
fn tumour_alone(counts: &[LabelCount], cc_of: impl Fn(usize) -> f64) -> Option<ImportError> {
    let inside: Vec<&LabelCount> = counts.iter().filter(|c| c.code != 0 && c.voxels > 0).collect();
    let cc = cc_of(inside.iter().map(|c| c.voxels).sum());
    let of_tumour = inside.len() > 1 && inside.iter().all(|c| c.code <= 4) && cc < LEAST_TISSUE_CC;
    of_tumour.then(|| ImportError::Tumour { codes: inside.iter().map(|c| c.code).collect(), cc })
}

fn listed(codes: &[u32]) -> String {
    codes.iter().map(u32::to_string).collect::<Vec<_>>().join(", ")
}

/// A map of nothing but some tool's numbers, with those of one side missing.
fn half_of_a_known_map(
    counts: &[LabelCount],
    chosen: Option<&[&LabelTable]>,
    cc_of: impl Fn(usize) -> f64 + Copy,
) -> Option<ImportError> {
    let all: Vec<&LabelTable> = built_in().iter().collect();
    chosen.unwrap_or(&all).iter().find_map(|table| {
        let inside = counts.iter().filter(|c| c.code != 0);
        let found: Vec<(&Structure, usize)> =
            inside.map(|c| Some((table.structure(c.code)?, c.voxels))).collect::<Option<_>>()?;
        one_sided(table, &found, cc_of)
    })
}

/// Whether a map whose tool tells the sides apart has hardly anything on one of them. After a hemisphere was taken out the
/// brainstem, the cerebellum and what was left of the nuclei are still labelled on that side.
fn one_sided(table: &LabelTable, found: &[(&Structure, usize)], cc_of: impl Fn(usize) -> f64) -> Option<ImportError> {
    /// Of the other side's tissue: half of what a lesion of a whole lobe leaves.
    const LEAST: f64 = 0.4;
    let tissue = |s: &Structure| matches!(s.tissue, Tissue::Grey | Tissue::White | Tissue::Tumour | Tissue::Oedema);
    let of_side = |side: Side| {
        let own = found.iter().filter(|(s, _)| tissue(s) && s.side() == Some(side));
        cc_of(own.map(|(_, voxels)| voxels).sum())
    };
    let (left, right) = (of_side(Side::Left), of_side(Side::Right));
    let (missing, missing_cc, other_cc) = if left < right { ("left", left, right) } else { ("right", right, left) };
    // A map that tells the sides of a few structures alone says nothing.
    let told = other_cc >= LEAST_TISSUE_CC / 2.0 && missing_cc < LEAST * other_cc;
    told.then(|| ImportError::OneSided { table: table.name.clone(), missing, missing_cc, other_cc })
}

fn counts<F: Frame>(codes: &Volume<u32, F>) -> Vec<LabelCount> {
    let slice = (codes.grid.dims[0] * codes.grid.dims[1]).max(1);
    let of_slice = |slice: &[u32]| {
        let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
        for &code in slice {
            *counts.entry(code).or_default() += 1;
        }
        counts
    };
    let join = |mut a: BTreeMap<u32, usize>, b: BTreeMap<u32, usize>| {
        for (code, voxels) in b {
            *a.entry(code).or_default() += voxels;
        }
        a
    };
    let counts = codes.data.par_chunks(slice).map(of_slice).reduce(BTreeMap::new, join);
    counts.into_iter().map(|(code, voxels)| LabelCount { code, voxels }).collect()
}

/// How far the left structures lie to the right of the right ones, where they do.
fn sides_exchanged_mm<F: Frame>(codes: &Volume<u32, F>, table: &LabelTable) -> Option<f64> {
    let mut sums = [[0.0, 0.0]; 2];
    let mut side_of: BTreeMap<u32, Option<usize>> = BTreeMap::new();
    let x_of = codes.grid.mm_from_voxel.row(0).into_owned();
    for (n, &code) in codes.data.iter().enumerate().filter(|(_, code)| **code != 0) {
        let side = *side_of
            .entry(code)
            .or_insert_with(|| table.structure(code).and_then(Structure::side).map(|s| usize::from(s == Side::Right)));
        let Some(side) = side else { continue };
        let v = codes.grid.voxel(n).map(|v| v as f64);
        let x_mm = x_of[0] * v[0] + x_of[1] * v[1] + x_of[2] * v[2] + x_of[3];
        sums[side][0] += x_mm;
        sums[side][1] += 1.0;
    }
    if sums.iter().any(|s| s[1] == 0.0) {
        return None;
    }
    let apart_mm = sums[0][0] / sums[0][1] - sums[1][0] / sums[1][1];
    (apart_mm > 0.0).then_some(apart_mm)
}

/// What is wrong with a map as a brain, in words.
///
/// The limits are wide: children, old age and lesions pass; a tissue taken for another, a skull taken for a brain and half
/// a map do not.
fn no_brain<F: Frame>(labels: &LabelMap<F>) -> Option<String> {
    let cc = |l: u8| labels.data.iter().filter(|&&x| x == l).count() as f64 * labels.grid.voxel_volume_mm3() / 1000.0;
    let (grey, white, ventricle) = (cc(label::GREY_MATTER), cc(label::WHITE_MATTER), cc(label::VENTRICLE));
    let tissue = grey + white + cc(label::TUMOUR) + cc(label::OEDEMA) + cc(label::RESECTED);
    if !(LEAST_TISSUE_CC..=2200.0).contains(&tissue) {
        return Some(format!("grey and white matter are {tissue:.0} cc together, a brain has 300 to 2200"));
    }
    if !(0.4..=4.0).contains(&(grey / white)) {
        return Some(format!(
            "there are {grey:.0} cc of grey matter to {white:.0} cc of white, a brain has 0.4 to 4 times"
        ));
    }
    if ventricle > 0.4 * tissue {
        return Some(format!("the ventricles are {ventricle:.0} cc of {tissue:.0} cc of tissue"));
    }
    // Ventricles lie inside. Grey matter lies around white matter: more of it borders fluid and skull.
    let [grey_open, white_open, ventricle_open] = [label::GREY_MATTER, label::WHITE_MATTER, label::VENTRICLE]
        .map(|l| open_share(labels, l, if l == label::VENTRICLE { 0 } else { label::CSF }));
    if ventricle > 1.0 && ventricle_open > 0.35 {
        return Some("its ventricles lie at the surface of the brain".to_owned());
    }
    if ventricle > 1.0 {
        let [fluid_mm, ventricle_mm] = depths_mm(labels, [label::CSF, label::VENTRICLE]);
        if ventricle_mm < SHALLOW_MM {
            return Some(format!(
                "half of what it calls ventricles lies less than {ventricle_mm:.0} mm below the brain's surface: that is fluid of the sulci"
            ));
        }
        if cc(label::CSF) > OUTER_CSF_CC && fluid_mm > ventricle_mm {
            return Some("its fluid outside the ventricles lies deeper than its ventricles do".to_owned());
        }
    }
    if white_open > grey_open {
        return Some("its white matter lies at the surface more than its grey matter does".to_owned());
    }
    None
}

/// Fluid of this much is not the fourth ventricle alone, cc: sulci and cisterns are drawn.
const OUTER_CSF_CC: f64 = 30.0;

/// Ventricles lie deeper than this, by their median, mm: 31 to 55 in eight maps (FreeSurfer's, SynthSeg's, GIF's, hgm's own);
/// fluid of the sulci 6, with the ventricles 9.
const SHALLOW_MM: f32 = 15.0;
/// Gaps narrower than twice this are part of the head: sulci, and what FreeSurfer leaves to the background around its ventricles, mm.
const GAP_MM: f64 = 5.0;

/// How deep labels lie in the head, by the medians of their distances to the outside, mm; 0 for one that is not there.
fn depths_mm<F: Frame, const N: usize>(labels: &LabelMap<F>, of: [u8; N]) -> [f32; N] {
    let labelled = labels.map(|l| l != label::BACKGROUND);
    let Some(around) = labelled.bounding_box() else { return [0.0; N] };
    let around = around.grown(&labels.grid, GAP_MM + 2.0);
    let head = fill_holes(&close(&labelled.cropped(&around), GAP_MM));
    let (labels, depth) = (labels.cropped(&around), distance_mm(&head.map(|x| !x)));
    let median = |l: u8| {
        let mut own: Vec<f32> = (0..depth.data.len()).filter(|&n| labels.data[n] == l).map(|n| depth.data[n]).collect();
        let middle = own.len() / 2;
        if own.is_empty() { 0.0 } else { *own.select_nth_unstable_by(middle, f32::total_cmp).1 }
    };
    of.map(median)
}

/// The share of a label's faces to other labels that look at the background or at `also`.
fn open_share<F: Frame>(labels: &LabelMap<F>, of: u8, also: u8) -> f64 {
    let [nx, ny, _] = labels.grid.dims;
    let (mut open, mut all) = (0u64, 0u64);
    let mut face = |a: u8, b: u8| {
        if a == of && b != of {
            all += 1;
            open += u64::from(b == label::BACKGROUND || b == also);
        }
    };
    for n in 0..labels.data.len() {
        let [i, j, _] = labels.grid.voxel(n);
        let here = labels.data[n];
        let steps = [(i + 1 < nx, 1), (j + 1 < ny, nx), (n + nx * ny < labels.data.len(), nx * ny)];
        for (_, step) in steps.into_iter().filter(|s| s.0) {
            let there = labels.data[n + step];
            face(here, there);
            face(there, here);
        }
    }
    open as f64 / all.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::named;
    use crate::geometry::Native;
    use crate::image::Grid;

    /// Two half balls of white matter in a shell of cortex with a ventricle and fluid around, in FreeSurfer's numbers.
    fn aseg(flip: f64) -> Volume<u32, Native> {
        let grid = Grid::axis_aligned([80; 3], [2.0; 3], [-79.0; 3]);
        Volume::from_fn(grid, |n| {
            let p = grid.voxel(n).map(|v| 2.0 * v as f64 - 79.0);
            let r = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
            let left = flip * p[0] < 0.0;
            let side = |l: u32, r: u32| if left { l } else { r };
            match r {
                r if r < 15.0 => side(4, 43),
                r if r < 50.0 => side(2, 41),
                r if r < 62.0 => side(3, 42),
                r if r < 66.0 => 24,
                _ => 0,
            }
        })
    }

    fn refused(codes: &Volume<u32, Native>, table: &str) -> String {
        import_labels(codes, Some(&named(table))).unwrap_err().to_string()
    }

    #[test]
    fn tissues_come_out_in_hgms_numbers() {
        let found = import_labels(&aseg(1.0), None).unwrap();
        assert_eq!((found.table.as_str(), found.structures), ("freesurfer", 7));
        assert_eq!(found.labels.at(40, 40, 40), label::VENTRICLE);
        assert_eq!(found.labels.at(40, 40, 60), label::WHITE_MATTER);
        assert_eq!(found.labels.at(40, 40, 68), label::GREY_MATTER);
        assert_eq!(found.labels.at(40, 40, 72), label::CSF);
        let volume: f64 = found.volumes_cc.iter().map(|v| v.1).sum();
        assert!((volume - 1204.0).abs() < 20.0, "{volume}");
    }

    #[test]
    fn a_mirrored_map_and_tissues_in_each_others_place_are_refused() {
        assert!(refused(&aseg(-1.0), "freesurfer").contains("left and right are exchanged"));
        let swapped = aseg(1.0).map(|c| [2, 3, 41, 42].iter().position(|x| *x == c).map_or(c, |n| [3, 2, 42, 41][n]));
        assert!(refused(&swapped, "freesurfer").contains("white matter lies at the surface"));
        let map = aseg(1.0);
        let inside_out = Volume::from_fn(map.grid, |n| match map.data[n] {
            4 | 43 => 24,
            24 if map.grid.voxel(n)[0] < 40 => 4,
            24 => 43,
            c => c,
        });
        assert!(refused(&inside_out, "freesurfer").contains("ventricles lie at the surface"));
        let radius_mm =
            |n: usize| map.grid.voxel(n).iter().map(|&v| (2.0 * v as f64 - 79.0).powi(2)).sum::<f64>().sqrt();
        let sulci = Volume::from_fn(map.grid, |n| match (radius_mm(n), map.data[n]) {
            (r, 3) if (52.0..55.0).contains(&r) => 4,
            (r, 42) if (52.0..55.0).contains(&r) => 43,
            (_, 4) => 2,
            (_, 43) => 41,
            (_, own) => own,
        });
        assert!(
            refused(&sulci, "freesurfer").contains("that is fluid of the sulci"),
            "{}",
            refused(&sulci, "freesurfer")
        );
        // FreeSurfer leaves a gap to the background here and there around the ventricles.
        let gap = Volume::from_fn(map.grid, |n| {
            let [i, j, _] = map.grid.voxel(n);
            if i >= 40 && j >= 40 && (15.0..18.0).contains(&radius_mm(n)) { 0 } else { map.data[n] }
        });
        assert_eq!(import_labels(&gap, None).map(|found| found.table), Ok("freesurfer".to_owned()));
        let half = aseg(1.0).map(|c| if c == 2 || c == 41 { 0 } else { c });
        assert!(refused(&half, "freesurfer").contains("missing"));
    }

    #[test]
    fn a_tumours_map_is_called_one_and_so_is_half_a_brain_or_one_without_its_cerebellum() {
        let grid = Grid::axis_aligned([80; 3], [2.0; 3], [-79.0; 3]);
        let tumour = |codes: [u32; 3]| -> Volume<u32, Native> {
            Volume::from_fn(grid, |n| {
                let r = grid.voxel(n).map(|v| (2.0 * v as f64 - 79.0).powi(2)).iter().sum::<f64>().sqrt();
                [(12.0, codes[0]), (16.0, codes[1]), (28.0, codes[2])]
                    .iter()
                    .find(|(end, _)| r < *end)
                    .map_or(0, |p| p.1)
            })
        };
        for codes in [[1, 4, 2], [1, 3, 2], [4, 1, 1]] {
            let said = import_labels(&tumour(codes), None).unwrap_err().to_string();
            assert!(said.contains("map of a tumour") && said.contains("92 cc"), "{said}");
            assert!(refused(&tumour(codes), "hgm").contains("map of a tumour"));
        }
        // Enough tissue for a brain is one, or refused as what it is.
        let large =
            Volume::from_data(Grid::<Native>::axis_aligned([80; 3], [4.0; 3], [-158.0; 3]), tumour([1, 3, 2]).data);
        assert!(!matches!(import_labels(&large, None), Err(ImportError::Tumour { .. })));

        let left_alone = aseg(1.0).map(|c| if (41..=43).contains(&c) { 0 } else { c });
        for said in [refused(&left_alone, "freesurfer"), import_labels(&left_alone, None).unwrap_err().to_string()] {
            assert!(said.contains("its right hemisphere is missing"), "{said}");
        }
        let mut scrap = aseg(1.0);
        let mut kept = 0;
        for code in &mut scrap.data {
            if [41, 42].contains(code) {
                kept += 1;
                if kept > 3000 * if *code == 41 { 1 } else { 2 } {
                    *code = 0;
                }
            }
        }
        assert!(
            refused(&scrap, "freesurfer").contains("its right hemisphere is missing"),
            "{}",
            refused(&scrap, "freesurfer")
        );

        assert!(import_labels(&aseg(1.0), None).unwrap().without_cerebellum);
        let whole = aseg(1.0);
        let low = Volume::from_fn(whole.grid, |n| {
            let [i, _, k] = whole.grid.voxel(n);
            match whole.data[n] {
                3 | 42 if k < 20 => {
                    if i < 40 {
                        8
                    } else {
                        47
                    }
                }
                own => own,
            }
        });
        assert!(!import_labels(&low, None).unwrap().without_cerebellum);
    }

    #[test]
    fn a_map_of_three_tissues_in_another_order_is_refused() {
        let own = aseg(1.0).map(|c| [0, 3, 2, 4, 1][[0, 2, 3, 4, 24].iter().position(|x| *x == c % 39).unwrap_or(0)]);
        assert_eq!(import_labels(&own, None).unwrap().table, "hgm");
        // SPM and SimNIBS count from the inside or from grey matter: 1 white, 2 grey, 3 fluid; 1 grey, 2 white, 3 fluid.
        for order in [[0, 3, 2, 1, 4], [0, 3, 1, 2, 4]] {
            let other = own.map(|c| order[c as usize]);
            assert!(refused(&other, "hgm").contains("no brain"));
        }
    }
}
