//! What a case has to be seen beside its body: target surfaces, the scan, what is known of the displacement.

use super::case::Case;
use super::error::WorkflowError;
use crate::geometry::{Mni, Position};
use crate::image::Volume;
use crate::image::nifti::{self, ReadOptions};
use crate::layout;
use crate::mesh::format::{Field, gifti, vtu};
use crate::mesh::{TetMesh, TriMesh};

/// Voxels of the scan that is shown, mm: what a graphics card of today draws at once.
const VOXEL_MM: f64 = 1.0;
/// Share of the scan's voxels at which its black and white lie.
const WINDOW: [f64; 2] = [0.01, 0.995];

/// A scan in whole numbers of eight bits on a grid along the axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Middle of the first voxel, mm.
    pub origin_mm: [f64; 3],
    /// Edge of a voxel, mm.
    pub voxel_mm: f64,
    /// Black to white, x fastest.
    pub values: Vec<u8>,
}

/// What can be shown beside a body; nothing of a mesh without a case.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sights {
    /// Surfaces that the later scan shows, by boundary set.
    pub targets: Vec<(String, TriMesh)>,
    /// A phantom's known displacement of every node, mm.
    pub truth_mm: Option<Vec<[f64; 3]>>,
    /// Standard deviation of the displacement of every node by the case's estimate, mm.
    pub estimate_sd_mm: Option<Vec<f64>>,
    /// The scan before the operation, around the mesh.
    pub scan: Option<Scan>,
}

impl Sights {
    /// Of a case with this mesh; what the case does not hold is not shown.
    ///
    /// # Errors
    /// A file that is there and damaged.
    pub(super) fn of(case: &Case, mesh: &TetMesh) -> Result<Self, WorkflowError> {
        let field = |file: &str, name: &str| -> Result<Option<Field>, WorkflowError> {
            if !case.path(file).exists() {
                return Ok(None);
            }
            Ok(vtu::decode(&case.read(file)?, file)?.point_field(name).cloned())
        };
        let of_mesh = |count: usize| count == mesh.nodes_mm().len();
        let truth = field(layout::REFERENCE_STATE, "displacement")?.and_then(|f| f.vectors());
        let sd = field(layout::ESTIMATE_STATE, "displacement_sd")?.filter(|f| f.components == 1).map(|f| f.values);
        Ok(Self {
            targets: targets(case)?,
            truth_mm: truth.filter(|truth| of_mesh(truth.len())),
            estimate_sd_mm: sd.filter(|sd| of_mesh(sd.len())),
            scan: scan(case, mesh)?,
        })
    }
}

fn targets(case: &Case) -> Result<Vec<(String, TriMesh)>, WorkflowError> {
    let family = layout::REFERENCE_SURFACE;
    let mut sets: Vec<String> = Vec::new();
    for entry in std::fs::read_dir(case.path(family.folder())).into_iter().flatten().flatten() {
        let file = format!("{}/{}", family.folder(), entry.file_name().to_string_lossy());
        sets.extend(family.member(&file).map(str::to_owned));
    }
    sets.sort_unstable();
    let surface = |set: String| {
        let file = family.of(&set);
        let surface = gifti::decode_surface(&case.read(&file)?, &file)?;
        Ok((set, surface))
    };
    sets.into_iter().map(surface).collect()
}

fn scan(case: &Case, mesh: &TetMesh) -> Result<Option<Scan>, WorkflowError> {
    if !case.path(layout::PRE_T1).exists() {
        return Ok(None);
    }
    let t1 = nifti::decode(&case.read(layout::PRE_T1)?, layout::PRE_T1, &ReadOptions::default())?;
    Ok(Some(Scan::around(&t1.volume.relabelled(), mesh.nodes_mm())))
}

impl Scan {
    /// The part of a scan around points, from black to white.
    fn around(t1: &Volume<f32, Mni>, points_mm: &[[f64; 3]]) -> Self {
        let end =
            |pick: fn(f64, f64) -> f64, from: f64| [0, 1, 2].map(|i| points_mm.iter().map(|p| p[i]).fold(from, pick));
        let (low, high) = (end(f64::min, f64::INFINITY), end(f64::max, f64::NEG_INFINITY));
        let dims = [0, 1, 2].map(|i| ((high[i] - low[i]) / VOXEL_MM).ceil().max(1.0) as usize + 1);
        let at = |n: usize| {
            let voxel = [n % dims[0], n / dims[0] % dims[1], n / dims[0] / dims[1]];
            let p = [0, 1, 2].map(|i| low[i] + VOXEL_MM * voxel[i] as f64);
            t1.trilinear(Position::new(p[0], p[1], p[2])).unwrap_or(0.0)
        };
        let shown: Vec<f32> = (0..dims.iter().product()).map(at).collect();
        let mut sorted = shown.clone();
        sorted.sort_unstable_by(f32::total_cmp);
        let [black, white] = WINDOW.map(|share| sorted[((sorted.len() - 1) as f64 * share) as usize]);
        let grey = |v: f32| (255.0 * (v - black) / (white - black).max(f32::MIN_POSITIVE)).clamp(0.0, 255.0) as u8;
        Self { dims, origin_mm: low, voxel_mm: VOXEL_MM, values: shown.into_iter().map(grey).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    #[test]
    fn a_scan_is_cut_to_the_points_and_runs_from_black_to_white() {
        let grid = Grid::axis_aligned([20, 20, 20], [2.0; 3], [-10.0; 3]);
        // Brighter along x.
        let t1 = Volume::from_fn(grid, |n| grid.voxel(n)[0] as f32);
        let scan = Scan::around(&t1, &[[0.0, 1.0, 2.0], [9.0, 5.0, 4.0]]);
        assert_eq!((scan.dims, scan.origin_mm), ([10, 5, 3], [0.0, 1.0, 2.0]));
        assert_eq!(scan.values.len(), 150);
        assert_eq!((scan.values[0], scan.values[9]), (0, 255));
        let step = |n: usize| i32::from(scan.values[n + 1]) - i32::from(scan.values[n]);
        assert!((0..9).all(|n| (step(n) - 28).abs() <= 1), "{:?}", &scan.values[..10]);
    }
}
