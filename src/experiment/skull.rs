//! The inside of the skull, and the fluid that has drained from it.

use super::setting::{SettingError, first_broken};
use crate::geometry::{Frame, Position, SmoothField};
use crate::image::distance::signed_distance_mm;
use crate::image::gaussian::gaussian;
use crate::image::{LabelMap, Mask};
use crate::segment::{inside_of_cortex, label};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where the inside of the skull is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SkullFrom {
    /// `gap_mm` outside the cortex everywhere.
    #[default]
    Cortex,
    /// Where the segmentation sees brain and cerebrospinal fluid end, and `gap_mm` farther.
    Scan,
}

/// The skull of `supports = "sliding"`; the table `[resection.skull]` of the settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SkullSettings {
    /// Where its inside is.
    pub from: SkullFrom,
    /// Room between cortex and bone, mm: see `from`. A layer of fluid of about a millimetre where the brain is thickest in
    /// the skull.
    pub gap_mm: f64,
    /// How well an estimate knows that room: standard deviation of its logarithm; 0 for exactly. The fluid over the cortex
    /// differs between heads and places by more than a factor of two, and by a third between lying on the back and on the
    /// face (Rice et al., "Subject position affects EEG magnitudes", NeuroImage 64, 2013).
    pub gap_log_sd: f64,
    /// The bone is open this far around the cavity, mm; 0 where the flap is back in its place.
    pub opening_mm: f64,
    /// Sulci and fissures up to twice this width are no way for the bone to follow, mm.
    pub closing_mm: f64,
    /// The brain is held this far above its lowest node, mm: the cut brainstem.
    pub brainstem_cut_mm: f64,
}

impl Default for SkullSettings {
    fn default() -> Self {
        Self {
            from: SkullFrom::default(),
            gap_mm: 1.0,
            gap_log_sd: 0.5,
            opening_mm: 0.0,
            closing_mm: 4.0,
            brainstem_cut_mm: 3.0,
        }
    }
}

impl SkullSettings {
    /// Refuses what no skull can be.
    ///
    /// # Errors
    /// The first setting out of its range.
    pub fn check(&self) -> Result<(), SettingError> {
        let length = |x: f64| (0.0..=50.0).contains(&x);
        first_broken(&[
            ("gap_mm", &self.gap_mm, length(self.gap_mm), "0 to 50 mm"),
            ("gap_log_sd", &self.gap_log_sd, (0.0..=3.0).contains(&self.gap_log_sd), "0 to 3"),
            ("opening_mm", &self.opening_mm, length(self.opening_mm), "0 to 50 mm"),
            ("closing_mm", &self.closing_mm, length(self.closing_mm), "0 to 50 mm"),
            ("brainstem_cut_mm", &self.brainstem_cut_mm, length(self.brainstem_cut_mm), "0 to 50 mm"),
        ])
    }

    /// What lies inside the skull, by the labels of the pre-operative scan.
    pub fn inside<F: Frame>(&self, labels: &LabelMap<F>) -> Mask<F> {
        match self.from {
            SkullFrom::Cortex => inside_of_cortex(labels, self.closing_mm),
            SkullFrom::Scan => labels.map(|l| l != label::BACKGROUND),
        }
    }

    /// The smooth distance to the skull, positive inside, by the labels of the pre-operative scan.
    pub fn distance<F: Frame>(&self, labels: &LabelMap<F>) -> Option<SmoothField> {
        smooth_distance(&self.inside(labels))
    }
}

/// Standard deviation of the smoothing of a distance to voxels, mm: the bone does not follow gyri, nor steps of voxels.
const SMOOTHING_MM: f64 = 3.0;
/// Spacing of the smooth distance, mm, about.
const SPACING_MM: f64 = 3.0;

/// The distance to the border of a mask, positive inside, as a field that is twice differentiable. The grid's axes are taken
/// as those of the frame, which they are in the MNI frame; `None` where they are not, or the mask is empty or full.
pub fn smooth_distance<F: Frame>(inside: &Mask<F>) -> Option<SmoothField> {
    let grid = inside.grid;
    let signed = signed_distance_mm(inside);
    if signed.data.iter().any(|d| !d.is_finite()) {
        return None;
    }
    let smooth = gaussian(&signed, SMOOTHING_MM);
    let place = |voxel: [usize; 3]| grid.position(voxel.map(|v| v as f64).into()).mm;
    let (first, next) = (place([0; 3]), [place([1, 0, 0]), place([0, 1, 0]), place([0, 0, 1])]);
    let mut spacing_mm = [0.0; 3];
    for axis in 0..3 {
        let step = next[axis] - first;
        let across = (0..3).filter(|&i| i != axis).map(|i| step[i].abs()).fold(0.0, f64::max);
        if step[axis] <= 0.0 || across > 1e-6 * step[axis] {
            return None;
        }
        spacing_mm[axis] = step[axis];
    }
    let every = spacing_mm.map(|h| (SPACING_MM / h).round().max(1.0) as usize);
    let size: [usize; 3] = std::array::from_fn(|a| grid.dims[a].div_ceil(every[a]));
    let mut samples = Vec::with_capacity(size.iter().product());
    for k in 0..size[2] {
        for j in 0..size[1] {
            for i in 0..size[0] {
                samples.push(-smooth.data[grid.index(i * every[0], j * every[1], k * every[2])]);
            }
        }
    }
    let spacing_mm = std::array::from_fn(|a| spacing_mm[a] * every[a] as f64);
    SmoothField::new(first.into(), spacing_mm, size, samples)
}

/// The level (mm against gravity, from the origin) to which fluid of `labels` is left when this part of it has drained: what
/// lies highest goes first.
pub fn level_when_drained<F: Frame>(labels: &LabelMap<F>, gravity: [f64; 3], drained: f64) -> Option<f64> {
    heights_of_fluid(labels, gravity).map(|heights| level_of(&heights, drained))
}

/// Steps of the table of levels.
const LEVELS: usize = 32;

/// The same when 0, 1/n, 2/n ... 1 of it has drained.
pub fn levels_when_drained<F: Frame>(labels: &LabelMap<F>, gravity: [f64; 3]) -> Option<Vec<f64>> {
    let heights = heights_of_fluid(labels, gravity)?;
    Some((0..=LEVELS).map(|n| level_of(&heights, n as f64 / LEVELS as f64)).collect())
}

fn is_fluid(l: u8) -> bool {
    l == label::CSF || l == label::VENTRICLE
}

/// Places of the voxels of some labels with their heights against gravity (mm from the origin).
fn heights<F: Frame>(labels: &LabelMap<F>, gravity: [f64; 3], of: fn(u8) -> bool) -> Vec<(f64, Position<F>)> {
    let strength = gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
    (0..labels.data.len())
        .filter(|&n| of(labels.data[n]))
        .map(|n| {
            let p = labels.grid.position(labels.grid.voxel(n).map(|v| v as f64).into());
            (-(0..3).map(|a| p.mm[a] * gravity[a]).sum::<f64>() / strength, p)
        })
        .collect()
}

/// Heights of the fluid's voxels against gravity, the lowest first, mm; `None` without fluid or gravity.
fn heights_of_fluid<F: Frame>(labels: &LabelMap<F>, gravity: [f64; 3]) -> Option<Vec<f64>> {
    let mut heights: Vec<f64> = heights(labels, gravity, is_fluid).into_iter().map(|(height, _)| height).collect();
    if heights.is_empty() || gravity == [0.0; 3] {
        return None;
    }
    heights.sort_unstable_by(f64::total_cmp);
    Some(heights)
}

/// A brain along gravity, heights in mm against it from the origin.
#[derive(Clone, Debug)]
pub struct Depths<F: Frame> {
    /// The brain's highest point.
    pub top_mm: f64,
    /// Its lowest.
    pub lowest_mm: f64,
    /// Where the highest is.
    pub top_at: Position<F>,
    /// Every voxel of fluid.
    pub fluid_mm: Vec<f64>,
}

/// The brain of `labels` along gravity: what is neither fluid nor outside. `None` where there is none, or no gravity.
pub fn depths<F: Frame>(labels: &LabelMap<F>, gravity: [f64; 3]) -> Option<Depths<F>> {
    let brain = heights(labels, gravity, |l| l != label::BACKGROUND && !is_fluid(l));
    let by_height = |a: &&(f64, Position<F>), b: &&(f64, Position<F>)| a.0.total_cmp(&b.0);
    let ((top_mm, top_at), (lowest_mm, _)) = (*brain.iter().max_by(by_height)?, *brain.iter().min_by(by_height)?);
    let fluid_mm = heights(labels, gravity, is_fluid).into_iter().map(|(height, _)| height).collect();
    (gravity != [0.0; 3]).then_some(Depths { top_mm, lowest_mm, top_at, fluid_mm })
}

fn level_of(heights: &[f64], drained: f64) -> f64 {
    let place = (1.0 - drained.clamp(0.0, 1.0)) * (heights.len() - 1) as f64;
    let (low, part) = (place.floor() as usize, place.fract());
    heights[low] + part * (heights[(low + 1).min(heights.len() - 1)] - heights[low])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;

    fn ball(radius_mm: f64) -> LabelMap<Mni> {
        let grid = Grid::<Mni>::axis_aligned([61, 61, 61], [1.0; 3], [-30.0; 3]);
        let inside = |n: usize| {
            let square: f64 = grid.voxel(n).iter().map(|&v| (v as f64 - 30.0).powi(2)).sum();
            if square <= radius_mm * radius_mm { label::GREY_MATTER } else { label::BACKGROUND }
        };
        LabelMap::from_data(grid, (0..grid.len()).map(inside).collect())
    }

    #[test]
    fn the_distance_to_a_ball_is_smooth_and_right() {
        let field = SkullSettings::default().distance(&ball(20.0)).unwrap();
        for direction in [[1.0, 0.0, 0.0], [0.6, 0.0, 0.8], [0.577, 0.577, 0.577]] {
            for r in [14.0, 17.0, 20.0, 22.0] {
                let at = field.at(direction.map(|d| d * r));
                // A Gaussian makes r + s^2 / r of a distance r in space. Voxels and the grid of 3 mm add up to .51 mm and
                // .07 of slope, as reckoned with scipy's distance transform and cubic splines.
                let rounded = SMOOTHING_MM * SMOOTHING_MM / r;
                assert!((at.value - (20.0 - r - rounded)).abs() < 0.75, "{r}: {}", at.value);
                let slope: f64 = (0..3).map(|i| at.gradient[i] * direction[i]).sum();
                assert!((slope + 1.0 - rounded / r).abs() < 0.08, "{r}: {slope}");
            }
        }
        let nothing = ball(20.0).map(|_| label::BACKGROUND);
        assert!(SkullSettings::default().distance(&nothing).is_none());
    }

    #[test]
    fn the_level_falls_as_fluid_drains() {
        let mut labels = ball(20.0);
        labels.data.iter_mut().filter(|l| **l != label::BACKGROUND).for_each(|l| *l = label::CSF);
        let level = |drained| level_when_drained(&labels, [0.0, -9.81, 0.0], drained).unwrap();
        assert_eq!([level(0.0), level(1.0)], [20.0, -20.0]);
        let table = levels_when_drained(&labels, [0.0, -9.81, 0.0]).unwrap();
        assert_eq!([table[0], table[8], table[32]], [0.0, 0.25, 1.0].map(level));
        // Half of a ball lies above its middle; the part above a height falls smoothly.
        assert!(level(0.5).abs() <= 0.5 && level(0.1) > level(0.2));
        assert_eq!(level_when_drained(&ball(20.0), [0.0, 0.0, -9.81], 0.5), None);
    }
}
