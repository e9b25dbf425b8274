//! What is to be taken out, in any of the ways it may be said, as a mask in the scan's grid.

use super::error::{PredictError, WorkflowError};
use super::inputs::read_mask_of;
use super::user_file::{read_input, shown};
use super::warning::{Warning, says_talairach};
use crate::experiment::predict::{PlannedError, ellipsoid_mask};
use crate::geometry::{Native, Pre, RigidTransform};
use crate::image::nifti::{self, ReadOptions};
use crate::image::{Grid, Mask};
use crate::mesh::{OpenSurface, TriMesh};
use crate::overlay::Drawing;
use crate::segment::native::mask_on;
use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

/// What is to be taken out.
#[derive(Clone, Debug, PartialEq)]
pub enum PlannedResection {
    /// A mask in the scan's grid.
    Mask(PathBuf),
    /// A closed surface in the scanner's frame (mm, RAS+): STL, GIFTI or PLY.
    Surface(PathBuf),
    /// Numbers of the label map that is given of the scan.
    Label(Vec<u32>),
    /// An ellipsoid along the axes of the scanner's frame: centre and half axes, mm.
    Ellipsoid([f64; 6]),
}

/// More of a plan than this outside the scan: it was drawn on another.
const MOST_BESIDE: f64 = 0.5;
/// Less is what a surface loses between voxels.
const NOTED_BESIDE: f64 = 0.1;
/// Smaller bodies lose more than that to their rim, mm3.
const LARGE_ENOUGH_MM3: f64 = 1000.0;

impl PlannedResection {
    /// Plans as they were written: files first, then labels, then ellipsoids; one at least.
    ///
    /// # Errors
    /// [`PredictError::NoPlan`], and one that cannot be read.
    pub fn all(files: &[PathBuf], labels: &[String], ellipsoids: &[String]) -> Result<Vec<Self>, WorkflowError> {
        let files = files.iter().map(|path| Ok(Self::file(path.clone())));
        let labels = labels.iter().map(|text| Self::label(text));
        let ellipsoids = ellipsoids.iter().map(|text| Self::ellipsoid(text));
        let plans = files.chain(labels).chain(ellipsoids).collect::<Result<Vec<_>, PredictError>>()?;
        if plans.is_empty() { Err(PredictError::NoPlan.into()) } else { Ok(plans) }
    }

    /// A file: a surface by the end of its name, else a mask.
    pub fn file(path: PathBuf) -> Self {
        if Drawing::knows(&shown(&path)) { Self::Surface(path) } else { Self::Mask(path) }
    }

    /// An ellipsoid as `x,y,z,rx,ry,rz`.
    ///
    /// # Errors
    /// [`PredictError::Ellipsoid`] for anything else.
    pub fn ellipsoid(text: &str) -> Result<Self, PredictError> {
        let wrong = || PredictError::Ellipsoid { given: text.to_owned() };
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|x| x.trim().parse()).collect();
        let six: [f64; 6] = numbers.map_err(|_| wrong())?.try_into().map_err(|_| wrong())?;
        let kept = six.iter().all(|x| x.is_finite()) && six[3..].iter().all(|r| *r > 0.0);
        if kept { Ok(Self::Ellipsoid(six)) } else { Err(wrong()) }
    }

    /// Labels as `1010` or `1010,1011`.
    ///
    /// # Errors
    /// [`PredictError::Label`] for anything else.
    pub fn label(text: &str) -> Result<Self, PredictError> {
        let wrong = || PredictError::Label { given: text.to_owned() };
        let numbers: Result<Vec<u32>, _> = text.split(',').map(|x| x.trim().parse()).collect();
        let numbers = numbers.map_err(|_| wrong())?;
        // 0 is what is no part of anything.
        if numbers.contains(&0) { Err(wrong()) } else { Ok(Self::Label(numbers)) }
    }

    /// Its file, where it is one.
    pub(super) fn path(&self) -> Option<&Path> {
        match self {
            Self::Mask(path) | Self::Surface(path) => Some(path),
            Self::Label(_) | Self::Ellipsoid(_) => None,
        }
    }

    /// What it is, without any name of the user's.
    pub fn kind(&self) -> String {
        match self {
            Self::Mask(_) => "mask".to_owned(),
            Self::Surface(_) => "surface".to_owned(),
            Self::Label(_) => self.to_string(),
            Self::Ellipsoid(_) => "ellipsoid".to_owned(),
        }
    }

    /// The voxels of the scan that are to be taken; what is odd about them is added to the warnings.
    ///
    /// # Errors
    /// A file that cannot be used, or a plan that lies outside the scan.
    pub(super) fn mask(
        &self,
        grid: &Grid<Pre>,
        dseg: Option<&Path>,
        options: &ReadOptions,
        warnings: &mut Vec<Warning>,
    ) -> Result<Mask<Pre>, WorkflowError> {
        let plan = self.to_string();
        let (mask, volume_mm3) = match self {
            Self::Mask(path) if is_other_surface(path) => {
                return Err(PredictError::OtherSurface { file: shown(path) }.into());
            }
            Self::Mask(path) => {
                let mask: Mask<Pre> = read_mask_of(path, &grid.relabelled(), options, warnings)?.relabelled();
                if mask.count() == 0 {
                    return Err(PredictError::Plan(PlannedError::Empty { plan }).into());
                }
                return Ok(mask);
            }
            Self::Label(labels) => {
                let file = dseg.ok_or(PredictError::NoLabelMap { plan })?;
                return labelled(file, labels, grid, options);
            }
            Self::Surface(path) => {
                let file = || shown(path);
                let drawing = Drawing::decode(&read_input(path)?, &file())?;
                drawing.check_of_scanner(&file())?;
                warnings.extend(says_talairach(&drawing, &plan));
                let surface = drawing.surface(&file())?;
                let surface = surface.ok_or_else(|| PredictError::NoSurface { file: file() })?;
                let refused = |source| PredictError::OpenSurface { file: file(), source };
                (surface.enclosed(grid).map_err(refused)?, volume_mm3(&surface).map_err(refused)?)
            }
            Self::Ellipsoid([x, y, z, rx, ry, rz]) => {
                let volume_mm3 = 4.0 / 3.0 * std::f64::consts::PI * rx * ry * rz;
                (ellipsoid_mask(grid, [*x, *y, *z], [*rx, *ry, *rz]), volume_mm3)
            }
        };
        let within_mm3 = mask.count() as f64 * grid.voxel_volume_mm3();
        let beside = 1.0 - within_mm3 / volume_mm3.max(f64::MIN_POSITIVE);
        if within_mm3 == 0.0 {
            return Err(PredictError::NoVoxel { plan }.into());
        }
        if volume_mm3 > LARGE_ENOUGH_MM3 && beside > NOTED_BESIDE {
            let percent = 100.0 * beside;
            if beside > MOST_BESIDE {
                return Err(PredictError::BesideScan { plan, percent }.into());
            }
            warnings.push(Warning::PlanBesideScan { plan, percent });
        }
        Ok(mask)
    }
}

/// Whether a file's name says that it is a surface of a kind that is not read.
fn is_other_surface(path: &Path) -> bool {
    let others = ["vtp", "vtu", "obj", "off", "wrl", "x3d", "3mf", "glb", "gltf", "dae", "mz3", "fbx"];
    path.extension().is_some_and(|end| others.iter().any(|other| end.eq_ignore_ascii_case(other)))
}

/// Volume of what a surface encloses, by the same rule as its voxels: parts that overlap count once, whichever way their triangles
/// are turned.
fn volume_mm3(surface: &TriMesh) -> Result<f64, OpenSurface> {
    /// Voxels along the longest side.
    const ACROSS: f64 = 100.0;
    let end = |axis: usize, of: fn(f64, f64) -> f64| surface.nodes_mm.iter().map(|x| x[axis]).reduce(of).unwrap_or(0.0);
    let (low, high) = ([0, 1, 2].map(|a| end(a, f64::min)), [0, 1, 2].map(|a| end(a, f64::max)));
    let longest = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
    let spacing_mm = (longest / ACROSS).max(f64::MIN_POSITIVE);
    let dims = [0, 1, 2].map(|a| ((high[a] - low[a]) / spacing_mm).ceil() as usize + 2);
    let grid = Grid::<Pre>::axis_aligned(dims, [spacing_mm; 3], low.map(|x| x - 0.5 * spacing_mm));
    Ok(surface.enclosed(&grid)?.count() as f64 * grid.voxel_volume_mm3())
}

/// The voxels of a label map that have these numbers, on the scan's grid.
fn labelled(path: &Path, labels: &[u32], grid: &Grid<Pre>, options: &ReadOptions) -> Result<Mask<Pre>, WorkflowError> {
    /// Numbers that a message lists.
    const LISTED: usize = 12;
    let (codes, _) = nifti::decode_codes(&read_input(path)?, &shown(path), options)?;
    let held: BTreeSet<u32> = codes.data.iter().copied().filter(|&code| code > 0).collect();
    if let Some(missing) = labels.iter().find(|&label| !held.contains(label)) {
        let more = held.len().saturating_sub(LISTED);
        let listed = held.iter().take(LISTED).map(u32::to_string);
        let holds = listed.chain((more > 0).then(|| format!("and {more} others"))).collect();
        let plan = PlannedResection::Label(vec![*missing]).to_string();
        return Err(PredictError::NoSuchLabel { file: shown(path), plan, holds }.into());
    }
    let mask: Mask<Native> = codes.map(|code| labels.contains(&code));
    let on_scan: Mask<Pre> = if mask.grid.coincides(&grid.relabelled(), 1e-3) {
        mask.relabelled()
    } else {
        mask_on(&mask.relabelled::<Pre>(), grid, &RigidTransform::identity())
    };
    if on_scan.count() == 0 {
        let plan = PlannedResection::Label(labels.to_vec()).to_string();
        return Err(PredictError::NoVoxel { plan }.into());
    }
    Ok(on_scan)
}

impl fmt::Display for PlannedResection {
    /// Its name for messages: the file's without its folder.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mask(path) | Self::Surface(path) => f.write_str(&shown(path)),
            Self::Label(labels) => {
                let numbers: Vec<String> = labels.iter().map(u32::to_string).collect();
                write!(f, "label {}", numbers.join(","))
            }
            Self::Ellipsoid([x, y, z, ..]) => write!(f, "the ellipsoid at ({x}, {y}, {z}) mm"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Volume;
    use crate::image::nifti::{encode_i16, encode_mask};
    use crate::mesh::TriMesh;
    use crate::mesh::format::{gifti, stl};

    fn grid() -> Grid<Pre> {
        Grid::axis_aligned([40, 40, 40], [1.0; 3], [-20.0, -20.0, -20.0])
    }

    /// A box around a point (mm); `open` leaves a triangle out.
    fn block(centre: [f64; 3], half: f64, open: bool) -> Vec<u8> {
        let node = |n: usize| [0, 1, 2].map(|a| centre[a] + if n >> a & 1 == 0 { -half } else { half });
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).skip(usize::from(open));
        stl::encode(&TriMesh { nodes_mm: (0..8).map(node).collect(), triangles: triangles.collect() })
    }

    /// A surface that says it lies in MNI space.
    fn of_mni() -> Vec<u8> {
        let solid = TriMesh { nodes_mm: vec![[0.0; 3], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]], triangles: vec![[0, 1, 2]] };
        gifti::encode_surface(&solid, gifti::Space::Mni152, "lesion")
    }

    fn mask_of(plan: &PlannedResection, dseg: Option<&Path>, warnings: &mut Vec<Warning>) -> Result<Mask<Pre>, String> {
        plan.mask(&grid(), dseg, &ReadOptions::default(), warnings).map_err(|e| e.to_string())
    }

    #[test]
    fn an_ellipsoid_is_six_numbers_with_sizes_and_a_label_is_whole_and_above_0() {
        let six = PlannedResection::ellipsoid("10,-20,30,5,6,7").unwrap();
        assert_eq!(six, PlannedResection::Ellipsoid([10.0, -20.0, 30.0, 5.0, 6.0, 7.0]));
        for wrong in ["", "1,2,3", "1,2,3,4,5,0", "1,2,3,4,5,-1", "1,2,nan,4,5,6", "a,b,c,d,e,f", "1,2,3,4,5,6,7"] {
            assert!(PlannedResection::ellipsoid(wrong).unwrap_err().to_string().contains("x,y,z,rx,ry,rz"), "{wrong}");
        }
        assert_eq!(PlannedResection::label("7, 9").unwrap(), PlannedResection::Label(vec![7, 9]));
        for wrong in ["", "0", "7,0", "-3", "1.5", "tumour"] {
            assert!(PlannedResection::label(wrong).unwrap_err().to_string().contains("whole numbers"), "{wrong}");
        }
    }

    #[test]
    fn one_box_is_one_mask_as_surface_label_and_mask() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("plan.stl"), block([2.3, -3.3, 4.3], 5.5, false)).unwrap();
        let plan = PlannedResection::file(at("plan.stl"));
        assert!(matches!(plan, PlannedResection::Surface(_)));
        let mut warnings = Vec::new();
        let surface = mask_of(&plan, None, &mut warnings).unwrap();
        assert_eq!((surface.count(), warnings.len()), (11usize.pow(3), 0));
        let codes: Volume<i16, Pre> = surface.map(|inside| if inside { 1010 } else { 3 });
        std::fs::write(at("dseg.nii"), encode_i16(&codes)).unwrap();
        std::fs::write(at("mask.nii"), encode_mask(&surface)).unwrap();
        let label = PlannedResection::Label(vec![1010]);
        assert!(mask_of(&label, Some(&at("dseg.nii")), &mut warnings).unwrap() == surface);
        let mask = PlannedResection::file(at("mask.nii"));
        assert!(mask_of(&mask, None, &mut warnings).unwrap() == surface);
        assert_eq!([plan.kind(), label.kind(), mask.kind()], ["surface", "label 1010", "mask"].map(str::to_owned));
    }

    #[test]
    fn what_cannot_be_a_plan_is_refused_with_file_and_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let codes = Volume::from_fn(grid(), |n| (n % 3) as i16);
        let files: [(&str, Vec<u8>); 8] = [
            ("open.stl", block([0.0; 3], 5.5, true)),
            ("far.stl", block([500.0; 3], 5.5, false)),
            ("half.stl", block([-20.0, 0.0, -20.0], 9.0, false)),
            ("points.csv", b"x,y,z\n1,2,3\n".to_vec()),
            ("mni.surf.gii", of_mni()),
            ("cut.stl", block([0.0; 3], 5.5, false)[..200].to_vec()),
            ("empty.nii", encode_mask(&Mask::filled(grid(), false))),
            ("dseg.nii", encode_i16(&codes)),
        ];
        for (name, bytes) in &files {
            std::fs::write(at(name), bytes).unwrap();
        }
        let dseg = at("dseg.nii");
        let file = |name: &str| PlannedResection::file(at(name));
        let sphere = |centre: f64, half: f64| PlannedResection::Ellipsoid([centre, centre, centre, half, half, half]);
        let label = |number: u32| PlannedResection::Label(vec![number]);
        let cases: [(PlannedResection, Option<&Path>, &[&str]); 12] = [
            (file("open.stl"), None, &["open.stl", "open: 3 edges", "Close Holes"]),
            (file("far.stl"), None, &["far.stl", "is empty", "RAS+"]),
            (file("half.stl"), None, &["half.stl", "outside the scan", "RAS+"]),
            (file("points.csv"), None, &["points.csv", "without triangles", ".surf.gii"]),
            (file("mni.surf.gii"), None, &["mni.surf.gii", "MNI_152", "before it was taken there"]),
            (file("cut.stl"), None, &["cut.stl", "cut short"]),
            (file("empty.nii"), None, &["empty.nii", "is empty"]),
            (file("none.stl"), None, &["none.stl"]),
            (sphere(9000.0, 5.0), None, &["the ellipsoid", "is empty", "RAS+"]),
            (sphere(20.0, 15.0), None, &["outside the scan"]),
            (label(7), None, &["label 7", "no label map"]),
            (label(7), Some(&dseg), &["dseg.nii", "label 7", "holds 1, 2"]),
        ];
        for (plan, dseg, words) in cases {
            let said = mask_of(&plan, dseg, &mut Vec::new()).unwrap_err();
            assert!(words.iter().all(|w| said.contains(w)) && !said.contains('\n'), "{plan}: {said}");
        }
        let mut warnings = Vec::new();
        let partly = sphere(11.0, 13.0);
        assert!(
            mask_of(&partly, None, &mut warnings).is_ok() && matches!(warnings[..], [Warning::PlanBesideScan { .. }])
        );
    }
}
