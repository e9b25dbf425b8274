//! The border of grey and white matter on the scan's own grid.
//!
//! Labels are found on the working grid and carried back to the scan's. On the way there intensities are interpolated, on the
//! way back labels outvote each other: thin blades of white matter and narrow folds of cortex are lost. Where grey and white
//! matter meet, the scan's own voxel says which of the two fills more of it.

use super::appearance::{GREY, WHITE};
use super::label::{GREY_MATTER, WHITE_MATTER};
use super::mixture::Mixture;
use super::priors::AtlasPriors;
use crate::geometry::{Frame, Mni, RigidTransform};
use crate::image::pieces::each_piece;
use crate::image::{LabelMap, Volume};
use nalgebra::{Matrix4, Point3};

/// A voxel turns only where it lies beyond the border by this many standard deviations: less may be noise, and the label carried
/// back knows the neighbours.
const BEYOND: f64 = 0.5;
/// Probability of a deep nucleus from which on intensity says nothing, as in the mixture.
const NUCLEUS: f32 = 0.25;

/// Grey or white matter by the scan's intensity wherever a voxel of one has a face in common with a voxel of the other. The
/// deep nuclei, told by place alone, stay, and the cerebellum's folia; so does everything where the scan's voxels are those of the working grid.
pub(super) fn with_the_scans_border<F: Frame>(
    labels: LabelMap<F>,
    t1: &Volume<f32, F>,
    mni_from_t1: &RigidTransform<F, Mni>,
    model: &Mixture,
    priors: &AtlasPriors,
) -> LabelMap<F> {
    let (grid, working) = (labels.grid, priors.deep_grey.grid);
    let to_working = working.voxel_from_mm() * mni_from_t1.to_matrix() * grid.mm_from_voxel;
    let steps = Matrix4::new_translation(&to_working.fixed_view::<3, 1>(0, 3).map(f64::round));
    if (to_working - steps).amax() < 1e-3 {
        return labels;
    }
    let border = model.grey_white_border();
    let doubtful = BEYOND * model.deviations[GREY].min(model.deviations[WHITE]);
    let [nx, ny, _] = grid.dims;
    let stride = [1, nx, nx * ny];
    let mut out = labels.clone();
    each_piece(&mut out.data, nx * ny, &|first, plane| {
        let k = first / (nx * ny);
        for (o, label) in plane.iter_mut().enumerate() {
            let other = match *label {
                GREY_MATTER => WHITE_MATTER,
                WHITE_MATTER => GREY_MATTER,
                _ => continue,
            };
            let (voxel, n) = ([o % nx, o / nx, k], o + k * nx * ny);
            let meets = |a: usize| {
                (voxel[a] > 0 && labels.data[n - stride[a]] == other)
                    || (voxel[a] + 1 < grid.dims[a] && labels.data[n + stride[a]] == other)
            };
            if !(0..3).any(meets) {
                continue;
            }
            let p = to_working.transform_point(&Point3::from(voxel.map(|v| v as f64)));
            let at = [p.x, p.y, p.z].map(f64::round);
            if (0..3).any(|a| !(at[a] >= 0.0 && at[a] < working.dims[a] as f64)) {
                continue;
            }
            let at = at.map(|x| x as usize);
            let place = |map: &Volume<f32, Mni>| map.at(at[0], at[1], at[2]);
            if place(&priors.deep_grey) > NUCLEUS || place(&priors.cerebellum) > 0.5 {
                continue;
            }
            let value = f64::from(t1.data[n]) * (-model.bias.at(at)).exp();
            if (value - border).abs() > doubtful {
                *label = if value > border { WHITE_MATTER } else { GREY_MATTER };
            }
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Position, Pre};
    use crate::image::resample::{Interpolation, resample};
    use crate::image::{Grid, VoxelBox};
    use crate::segment::bias::LogBias;
    use crate::segment::native::labels_on;
    use nalgebra::Vector3;

    const DIM: f32 = 100.0;
    const BRIGHT: f32 = 160.0;

    fn model(grid: &Grid<Mni>) -> Mixture {
        Mixture {
            voxels: Vec::new(),
            contents: Vec::new(),
            means: [30.0, f64::from(DIM), f64::from(BRIGHT)],
            deviations: [8.0; 3],
            bias: LogBias::flat(grid.dims),
        }
    }

    fn priors(grid: &Grid<Mni>, nucleus: impl Fn(Position<Mni>) -> bool + Sync + Send) -> AtlasPriors {
        let nothing = Volume::filled(*grid, 0f32);
        let deep = |n: usize| {
            let p = grid.centre(grid.voxel(n));
            f32::from(u8::from(nucleus(p)))
        };
        AtlasPriors {
            brain_mm: nothing.clone(),
            tissue: [nothing.clone(), nothing.clone(), nothing.clone()],
            ventricle_mm: nothing.clone(),
            cistern_mm: nothing.clone(),
            deep_grey: Volume::from_fn(*grid, deep),
            cerebellum: nothing.clone(),
        }
    }

    /// Folds a few voxels wide, seen by a scan that lies askew on the working grid.
    fn folds() -> (Volume<f32, Pre>, LabelMap<Pre>, RigidTransform<Pre, Mni>) {
        let grid = Grid::<Pre>::axis_aligned([48; 3], [1.0; 3], [-23.5; 3]);
        let pose = RigidTransform::about(Point3::origin(), Vector3::new(0.3, -0.2, 0.25), Vector3::new(0.4, 0.3, -0.2));
        let place = |n: usize| grid.voxel(n).map(|v| v as f64 - 23.5);
        // The share of white matter in a voxel, by the place of its centre in a fold of 2.4 mm of either tissue.
        let share = |n: usize| {
            let [x, y, z] = place(n);
            let phase = (0.9 * x + 0.35 * y + 0.25 * z).rem_euclid(4.8);
            (0.5 + phase.min(2.4 - phase).max(phase - 4.8)).clamp(0.0, 1.0) as f32
        };
        let scan = Volume::from_fn(grid, |n| DIM + share(n) * (BRIGHT - DIM));
        let truth = Volume::from_fn(grid, |n| if share(n) > 0.5 { WHITE_MATTER } else { GREY_MATTER });
        (scan, truth, pose)
    }

    /// The labels of a scan, found on the working grid by the same border and carried back.
    fn carried_back(scan: &Volume<f32, Pre>, pose: &RigidTransform<Pre, Mni>, grid: &Grid<Mni>) -> LabelMap<Pre> {
        let there = resample(scan, grid, &pose.inverse().to_affine(), Interpolation::CubicBSpline, 0.0).volume;
        let border = 0.5 * (DIM + BRIGHT);
        labels_on(&there.map(|x| if x > border { WHITE_MATTER } else { GREY_MATTER }), &scan.grid, pose)
    }

    #[test]
    fn folds_lost_between_grids_come_back() {
        let (scan, truth, pose) = folds();
        let working = Grid::<Mni>::axis_aligned([80; 3], [1.0; 3], [-39.5; 3]);
        let carried = carried_back(&scan, &pose, &working);
        let found =
            with_the_scans_border(carried.clone(), &scan, &pose, &model(&working), &priors(&working, |_| false));
        // Voxels that are not half and half.
        let clear = |n: usize| (scan.data[n] - 0.5 * (DIM + BRIGHT)).abs() > 5.0;
        let wrong = |labels: &LabelMap<Pre>| {
            (0..truth.data.len()).filter(|&n| clear(n) && labels.data[n] != truth.data[n]).count()
        };
        assert!(wrong(&found) * 5 < wrong(&carried), "{} of {}", wrong(&found), wrong(&carried));
    }

    #[test]
    fn half_a_deviation_of_noise_turns_no_voxel() {
        let (scan, truth, pose) = folds();
        let working = Grid::<Mni>::axis_aligned([80; 3], [1.0; 3], [-39.5; 3]);
        let border = 0.5 * (DIM + BRIGHT);
        let with =
            |step: f32| {
                let scan = Volume::from_fn(scan.grid, |n| {
                    if truth.data[n] == WHITE_MATTER { border - step } else { border + step }
                });
                with_the_scans_border(truth.clone(), &scan, &pose, &model(&working), &priors(&working, |_| false))
            };
        assert_eq!(with(3.5), truth);
        assert_ne!(with(4.5), truth);
    }

    #[test]
    fn a_nucleus_as_bright_as_white_matter_stays_grey() {
        let grid = Grid::<Pre>::axis_aligned([40; 3], [1.0; 3], [-19.5; 3]);
        let working = Grid::<Mni>::axis_aligned([40; 3], [1.0; 3], [-19.5; 3]);
        let pose = RigidTransform::about(Point3::origin(), Vector3::new(0.1, 0.0, 0.0), Vector3::zeros());
        let scan = Volume::filled(grid, BRIGHT);
        let inside = |p: Position<Mni>| p.mm.coords.norm() < 10.0;
        let labels = Volume::from_fn(grid, |n| {
            let p = grid.centre(grid.voxel(n));
            if p.mm.coords.norm() < 8.0 { GREY_MATTER } else { WHITE_MATTER }
        });
        let with = |priors: &AtlasPriors| with_the_scans_border(labels.clone(), &scan, &pose, &model(&working), priors);
        assert_eq!(with(&priors(&working, inside)), labels);
        assert_ne!(with(&priors(&working, |_| false)), labels);
    }

    #[test]
    fn a_scan_on_the_working_grid_keeps_its_labels() {
        let (scan, truth, _) = folds();
        let working: Grid<Mni> = scan.grid.relabelled();
        let turned = truth.map(|l| if l == WHITE_MATTER { GREY_MATTER } else { WHITE_MATTER });
        let still = RigidTransform::identity();
        let found =
            with_the_scans_border(turned.clone(), &scan, &still, &model(&working), &priors(&working, |_| false));
        assert_eq!(found, turned);
        // A part of it has the same voxels.
        let part = working.cropped(&VoxelBox { first: [3, 1, 0], end: [40, 48, 45] });
        assert_eq!(
            with_the_scans_border(turned.clone(), &scan, &still, &model(&part), &priors(&part, |_| false)),
            turned
        );
    }
}
