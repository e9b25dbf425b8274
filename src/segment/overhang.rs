//! Brain beyond the carried template's surface: the mark of a template that came out too small, and a larger start.
//!
//! Where the start is too small, or brain lies where the mean head has bone (a small child's thin skull), the deformable fit
//! settles on the wrong side of the cortex.

use super::priors::AtlasPriors;
use crate::geometry::{AffineTransform, Mni};
use crate::image::distance::signed_distance_mm;
use crate::image::{Mask, Volume};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// The layer outside the carried surface that is looked at, mm: beyond what a good fit misses, short of where brain is no
/// longer looked for.
const LAYER_MM: std::ops::Range<f32> = 2.0..4.5;
/// Above this height in the template's frame, mm, fluid and the vault lie in that layer; below also bone, nerves and vessels
/// of the base, which say nothing.
const VAULT_MM: f64 = 10.0;
/// One voxel in so many of the surface is enough for twelve unknowns.
const STRIDE: usize = 7;
/// Standard deviation of a stretch or shear before anything is seen, and of one distance to the surface, mm; distances of
/// neighbours are alike, all together are worth so many.
const STRETCH: f64 = 0.1;
const DISTANCE_MM: f64 = 2.0;
const DISTANCES: f64 = 200.0;

/// A part of the vault is told of when this much of its layer disagrees with the template: more than half of it.
const MOST: f64 = 0.5;
/// A part that has less of the layer than this says nothing.
const LEAST_SHARE: f64 = 0.04;

/// A part of the vault and how much of the layer looked at disagrees there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub name: VaultPart,
    pub share: f64,
}

/// A layer beside the carried surface under the vault, told against the brain found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layer {
    /// How much of it disagrees, 0 to 1.
    pub share: f64,
    /// The part where most of it does, when that is most of the part.
    pub worst: Option<Place>,
}

/// How much of the layer outside the carried surface was found to be brain under the vault.
pub(super) fn beyond(brain: &Mask<Mni>, known: &Mask<Mni>, priors: &AtlasPriors) -> Layer {
    layer(brain, known, priors, |mm| LAYER_MM.contains(&mm), true)
}

/// How much of the layer as far inside the carried surface was not.
pub(super) fn short(brain: &Mask<Mni>, known: &Mask<Mni>, priors: &AtlasPriors) -> Layer {
    layer(brain, known, priors, |mm| LAYER_MM.contains(&-mm), false)
}

fn layer(
    brain: &Mask<Mni>,
    known: &Mask<Mni>,
    priors: &AtlasPriors,
    within: impl Fn(f32) -> bool,
    told: bool,
) -> Layer {
    let mut parts = [[0usize; 2]; PARTS.len()];
    let grid = &brain.grid;
    for n in 0..brain.data.len() {
        if !known.data[n] || !within(priors.brain_mm.data[n]) {
            continue;
        }
        let p = grid.position(grid.voxel(n).map(|v| v as f64).into()).mm;
        if p.z > VAULT_MM {
            let [all, disagrees] = &mut parts[part(p.coords)];
            *all += 1;
            *disagrees += usize::from(brain.data[n] == told);
        }
    }
    let share = |[all, disagrees]: [usize; 2]| disagrees as f64 / all.max(1) as f64;
    let whole = parts.iter().fold([0, 0], |sum, part| [sum[0] + part[0], sum[1] + part[1]]);
    let large = |part: &[usize; 2]| part[0] as f64 >= LEAST_SHARE * whole[0] as f64;
    let places = PARTS.into_iter().zip(parts).filter(|(_, part)| large(part));
    let worst =
        places.map(|(name, part)| Place { name, share: share(part) }).max_by(|a, b| a.share.total_cmp(&b.share));
    Layer { share: share(whole), worst: worst.filter(|place| place.share > MOST) }
}

/// A part of the vault, by planes of the template's frame, where the head lies rigidly: for naming.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs, reason = "their names")]
pub enum VaultPart {
    LeftForehead,
    RightForehead,
    LeftSide,
    RightSide,
    LeftCrown,
    RightCrown,
    LeftBack,
    RightBack,
}

const PARTS: [VaultPart; 8] = [
    VaultPart::LeftForehead,
    VaultPart::RightForehead,
    VaultPart::LeftSide,
    VaultPart::RightSide,
    VaultPart::LeftCrown,
    VaultPart::RightCrown,
    VaultPart::LeftBack,
    VaultPart::RightBack,
];

impl std::fmt::Display for VaultPart {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::LeftForehead => "left forehead",
            Self::RightForehead => "right forehead",
            Self::LeftSide => "left side",
            Self::RightSide => "right side",
            Self::LeftCrown => "left crown",
            Self::RightCrown => "right crown",
            Self::LeftBack => "left back",
            Self::RightBack => "right back",
        })
    }
}

fn part(p: Vector3<f64>) -> usize {
    const FOREHEAD_MM: f64 = 15.0;
    const BACK_MM: f64 = -60.0;
    const CROWN_MM: f64 = 45.0;
    let which = match p {
        p if p.y > FOREHEAD_MM => 0,
        p if p.z > CROWN_MM => 4,
        p if p.y < BACK_MM => 6,
        _ => 2,
    };
    which + usize::from(p.x > 0.0)
}

/// The affine movement that takes the carried surface nearest to that of the brain found, along its normals.
pub(super) fn onto_the_brain(brain: &Mask<Mni>, priors: &AtlasPriors) -> AffineTransform<Mni, Mni> {
    let grid = brain.grid;
    let signed = signed_distance_mm(brain);
    let surface: Vec<usize> =
        (0..grid.len()).filter(|&n| priors.brain_mm.data[n].abs() < 0.5).step_by(STRIDE).collect();
    let place = |n: usize| grid.position(grid.voxel(n).map(|v| v as f64).into()).mm;
    let middle = surface.iter().map(|&n| place(n).coords).sum::<Vector3<f64>>() / surface.len().max(1) as f64;
    let mut normal = DMatrix::<f64>::zeros(12, 12);
    let mut right = DVector::<f64>::zeros(12);
    for &n in &surface {
        let Some(direction) = outward(&priors.brain_mm, n) else { continue };
        let arm = place(n).coords - middle;
        let row = DVector::from_fn(12, |p, _| if p < 3 { direction[p] } else { direction[p / 3 - 1] * arm[p % 3] });
        right.axpy(-f64::from(signed.data[n]), &row, 1.0);
        normal.ger(1.0, &row, &row, 1.0);
    }
    // What the distances are worth together, against a stretch of one standard deviation.
    let ridge = surface.len() as f64 / DISTANCES * (DISTANCE_MM / STRETCH).powi(2);
    for p in 0..12 {
        normal[(p, p)] += if p < 3 { 1e-9 } else { ridge };
    }
    let Some(found) = normal.cholesky().map(|c| c.solve(&right)) else { return AffineTransform::identity() };
    let linear = Matrix3::from_fn(|r, c| f64::from(u8::from(r == c)) + found[3 + 3 * r + c]);
    let shift = Vector3::new(found[0], found[1], found[2]);
    AffineTransform::from_parts(linear, middle + shift - linear * middle)
}

/// The direction in which the distance grows.
fn outward(distance: &Volume<f32, Mni>, n: usize) -> Option<Vector3<f64>> {
    let [i, j, k] = distance.grid.voxel(n).map(|v| v as isize);
    let along = |d: [isize; 3]| {
        let at = |sign: isize| distance.get(i + sign * d[0], j + sign * d[1], k + sign * d[2]).map(f64::from);
        Some(at(1)? - at(-1)?)
    };
    Vector3::new(along([1, 0, 0])?, along([0, 1, 0])?, along([0, 0, 1])?).try_normalize(1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    fn ball(radius_mm: [f64; 3], centre: [f64; 3]) -> (Mask<Mni>, AtlasPriors) {
        let grid = Grid::<Mni>::axis_aligned([61, 61, 61], [1.0; 3], [-30.0; 3]);
        let inside = Mask::from_fn(grid, |n| {
            let p = grid.voxel(n).map(|v| v as f64 - 30.0);
            (0..3).map(|a| ((p[a] - centre[a]) / radius_mm[a]).powi(2)).sum::<f64>() < 1.0
        });
        let nothing = Volume::filled(grid, 0f32);
        // As carried by interpolation: any value, not the steps of a distance between voxels.
        let away = Volume::from_fn(grid, |n| {
            let p = grid.voxel(n).map(|v| v as f64 - 30.0);
            let length = (0..3).map(|a| ((p[a] - centre[a]) / radius_mm[a]).powi(2)).sum::<f64>().sqrt();
            ((length - 1.0) * radius_mm[0]) as f32
        });
        let priors = AtlasPriors {
            brain_mm: away,
            tissue: [nothing.clone(), nothing.clone(), nothing.clone()],
            ventricle_mm: nothing.clone(),
            cistern_mm: nothing.clone(),
            deep_grey: nothing.clone(),
            cerebellum: nothing,
        };
        (inside, priors)
    }

    #[test]
    fn a_surface_inside_the_brain_is_taken_out_to_it() {
        let (brain, _) = ball([24.0, 24.0, 26.0], [0.0, 0.0, 1.0]);
        let (_, small) = ball([20.0; 3], [0.0; 3]);
        let everywhere = brain.map(|_| true);
        let outside = beyond(&brain, &everywhere, &small);
        assert!(outside.share > 0.8 && outside.worst.is_some_and(|w| w.share >= outside.share), "{outside:?}");
        let shorn = Volume::from_fn(brain.grid, |n| brain.data[n] && brain.grid.voxel(n)[0] >= 24);
        let cut = short(&shorn, &everywhere, &ball([24.0, 24.0, 26.0], [0.0, 0.0, 1.0]).1);
        assert!(cut.worst.is_some_and(|w| w.name == VaultPart::LeftSide) && cut.share < 0.5, "{cut:?}");
        let larger = onto_the_brain(&brain, &small);
        for (axis, radius, middle) in [(0, 24.0, 0.0), (1, 24.0, 0.0), (2, 26.0, 1.0)] {
            let [low, high] = [-1.0, 1.0].map(|sign| {
                let mut tip = [0.0; 3];
                tip[axis] = sign * 20.0;
                larger.apply(crate::geometry::Position::new(tip[0], tip[1], tip[2])).mm[axis]
            });
            // The prior of the stretch holds a little back.
            assert!(
                (0.5 * (high - low) - radius).abs() < 1.5 && (0.5 * (high + low) - middle).abs() < 0.6,
                "{low} {high}"
            );
        }
        let (same, fitting) = ball([24.0, 24.0, 26.0], [0.0, 0.0, 1.0]);
        let (outside, inside) = (beyond(&same, &everywhere, &fitting), short(&same, &everywhere, &fitting));
        assert!(outside.share < 0.05 && inside.share < 0.05, "{outside:?} {inside:?}");
        assert_eq!((outside.worst, inside.worst), (None, None));
    }
}
