//! Two scans of one head, each through a coil of its own.
//!
//! Mutual information takes a slow change of brightness for anatomy: between scans of two coils, or of one acquisition with and
//! without the scanner's normalisation, the best pose is off by tenths of a millimetre, and where a brain has sagged within a skull
//! that has not moved it follows the brain more than it has to (docs/evidence/choices.md). So the pose that the scans have as they
//! come is found again without either coil's gain.

use super::pyramid::reduced_to;
use super::rigid::refine_rigid;
use super::whole_head::{divided_by, not_air};
use super::{RegisterError, RigidFit, RigidMasks, RigidSettings, register_rigid, without_gain};
use crate::geometry::{Frame, Native, RigidTransform};
use crate::image::Volume;
use crate::image::gaussian::gaussian;

/// The ratio of two scans of one head changes no faster than this, mm (standard deviation of a Gaussian): wider than what moves
/// between the scans, narrower than what a single scan's own gain is told by.
const RATIO_MM: f64 = 15.0;

/// Finds the rigid motion that takes one scan of a head onto another one, whatever the coils: [`register_rigid`] over the whole
/// head, then its finest step once more without the scans' gains. Quality and warnings are those of the scans as they come.
///
/// # Errors
/// As [`register_rigid`].
pub fn register_two_scans<M: Frame, F: Frame>(
    moving: &Volume<f32, M>,
    fixed: &Volume<f32, F>,
    settings: &RigidSettings,
) -> Result<RigidFit<M, F>, RegisterError> {
    let found = register_rigid(moving, fixed, RigidMasks::default(), settings)?;
    let start: RigidTransform<Native, Native> = found.fixed_from_moving.relabelled();
    let (moving, fixed): (Volume<f32, Native>, Volume<f32, Native>) =
        (moving.clone().relabelled(), fixed.clone().relabelled());
    let (moving, fixed) = rayon::join(|| without_gain(&moving), || without_gain(&fixed));
    let moving = on_the_gain_of(&fixed, &moving, &start).unwrap_or(moving);
    let pose = refine_rigid(&moving, &fixed, &start, settings)?;
    Ok(RigidFit { fixed_from_moving: pose.relabelled(), ..found })
}

/// The moving scan as bright as the fixed one wherever both show a head, on average over [`RATIO_MM`]; `None` of two contrasts, whose
/// ratio is no gain.
fn on_the_gain_of(
    fixed: &Volume<f32, Native>,
    moving: &Volume<f32, Native>,
    fixed_from_moving: &RigidTransform<Native, Native>,
) -> Option<Volume<f32, Native>> {
    /// Spacing that is fine enough for a ratio this smooth, mm.
    const SPACING_MM: f64 = 4.0;
    /// What stands for both where there is no head nearby, as a share of a head's mean.
    const FLOOR: f32 = 0.002;
    /// Two scans of one contrast correlate by more than this once their gains are out, other contrasts by less.
    const ONE_CONTRAST: f64 = 0.4;
    let (there, here) = (reduced_to(fixed, SPACING_MM), reduced_to(moving, SPACING_MM));
    let (in_there, in_here) = (not_air(&there), not_air(&here));
    let opposite = |n: usize| fixed_from_moving.apply(here.grid.centre(here.grid.voxel(n)));
    let both = Volume::from_fn(here.grid, |n| in_here.data[n] && in_there.nearest(opposite(n)) == Some(true));
    let facing = Volume::from_fn(here.grid, |n| there.trilinear(opposite(n)).unwrap_or_default());
    let inside = (0..both.data.len()).filter(|&n| both.data[n]).map(|n| [here.data[n], facing.data[n]].map(f64::from));
    if correlation(inside) < ONE_CONTRAST {
        return None;
    }
    let mean = |value: &(dyn Fn(usize) -> f32 + Sync)| {
        let inside = Volume::from_fn(here.grid, |n| if both.data[n] { value(n) } else { 0.0 });
        gaussian(&inside, RATIO_MM).map(|x| x + FLOOR)
    };
    let ours = mean(&|n| here.data[n]);
    let theirs = mean(&|n| facing.data[n]);
    Some(divided_by(moving, &Volume::from_fn(here.grid, |n| ours.data[n] / theirs.data[n])))
}

/// Of pairs of values; zero where one of them does not change.
fn correlation(pairs: impl Iterator<Item = [f64; 2]>) -> f64 {
    let [mut count, mut x, mut y, mut xx, mut xy, mut yy] = [0.0; 6];
    for [a, b] in pairs {
        (count, x, y, xx, xy, yy) = (count + 1.0, x + a, y + b, xx + a * a, xy + a * b, yy + b * b);
    }
    let spread = (count * xx - x * x) * (count * yy - y * y);
    if spread > 0.0 { (count * xy - x * y) / spread.sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;
    use nalgebra::{Matrix4, Vector3};

    /// A gain that changes evenly comes out of the image that is nothing else, oblique or not.
    #[test]
    fn a_gain_read_on_a_coarser_grid_is_divided_out() {
        let oblique = Matrix4::new_rotation(Vector3::new(0.3, -0.2, 0.5))
            * Matrix4::new_nonuniform_scaling(&Vector3::new(1.0, 1.2, 2.0));
        let grid = Grid::<Native>::new([48, 40, 24], oblique).unwrap();
        let image = Volume::from_voxels(grid, |[i, j, k]| 10.0 + 0.2 * i as f32 - 0.1 * j as f32 + 0.3 * k as f32);
        let flat = divided_by(&image, &reduced_to(&image, 4.0));
        for (n, x) in flat.data.iter().enumerate() {
            let voxel = grid.voxel(n);
            if (0..3).all(|a| (8..grid.dims[a] - 8).contains(&voxel[a])) {
                assert!((x - 1.0).abs() < 1e-4, "{voxel:?} {x}");
            }
        }
    }
}
