//! How much of each part of the brain is expected to be labelled right: by how far grey and white matter lie apart there.
//!
//! What the mixture believes of its own labels says little: its Markov field smooths noise away and trusts the result. How far the two
//! tissues lie apart once they are labelled tells noise, shading that was not taken out, and tissues in each other's place
//! (docs/evidence/choices.md).

use super::label;
use super::region::Region;
use crate::geometry::{Mni, Position};
use crate::image::{LabelMap, Volume};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One voxel in so many along each axis is looked at: a region still has thousands.
const STRIDE: usize = 3;
/// With fewer looked-at voxels of grey or of white matter than this a part says nothing by itself.
const FEW: f64 = 100.0;
/// A part of which fewer labels are expected to be right is told of, percent: of the parts of which less was stated most had fewer
/// right indeed.
const UNSURE_PERCENT: f64 = 75.0;
/// So much below the usual it must be, too: in the brainstem grey and white matter are hard to tell in any scan.
const BELOW_USUAL_PERCENT: f64 = 10.0;

/// What a reader is told of when less is stated of a part, percent.
pub(super) fn unsure_below_percent(region: Region) -> f64 {
    UNSURE_PERCENT.min(100.0 * usual(region).1 - BELOW_USUAL_PERCENT)
}

/// What speaks for the labels of a part of the brain that the scan shows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RegionEvidence {
    /// The part.
    pub region: Region,
    /// Distance of the means of white and grey matter over their mean standard deviation, after the bias is taken out.
    pub separation: f64,
    /// How many times the usual one that is over the whole brain (geometric mean of the parts, deep nuclei left out).
    pub whole_over_usual: f64,
}

/// A voxel of tissue: where it lies, whether it is white, how bright it is.
struct Seen {
    region: Region,
    white: bool,
    even: f64,
}

/// White from grey matter, over their mean deviation; `None` with hardly any of one of them.
fn separation<'a>(of: impl Iterator<Item = &'a Seen>) -> Option<f64> {
    let mut sums = [[0.0f64; 3]; 2];
    for &Seen { white, even, .. } in of {
        for (sum, term) in sums[usize::from(white)].iter_mut().zip([1.0, even, even * even]) {
            *sum += term;
        }
    }
    if sums.iter().any(|[count, ..]| *count < FEW) {
        return None;
    }
    let [grey, white] = sums.map(|[count, sum, squares]| {
        let mean = sum / count;
        (mean, (squares / count - mean * mean).max(0.0).sqrt())
    });
    let spread = 0.5 * (grey.1 + white.1);
    (spread > 0.0).then(|| (white.0 - grey.0) / spread)
}

/// The evidence of every part of which the scan shows enough: of its labels and its intensities without the bias.
pub(super) fn evidence(
    labels: &LabelMap<Mni>,
    even: &Volume<f32, Mni>,
    template_from_patient: impl Fn(Position<Mni>) -> Position<Mni> + Sync,
) -> Vec<RegionEvidence> {
    let grid = labels.grid;
    let seen_at = |n: usize| {
        let white = match labels.data[n] {
            label::GREY_MATTER => false,
            label::WHITE_MATTER => true,
            _ => return None,
        };
        let region = Region::at(template_from_patient(grid.centre(grid.voxel(n))));
        Some(Seen { region, white, even: f64::from(even.data[n]) })
    };
    let of_slice = |k: usize| -> Vec<Seen> {
        let rows = (0..grid.dims[1]).step_by(STRIDE);
        let places = rows.flat_map(|j| (0..grid.dims[0]).step_by(STRIDE).map(move |i| grid.index(i, j, k)));
        places.filter_map(seen_at).collect()
    };
    let seen: Vec<Vec<Seen>> = (0..grid.dims[2]).into_par_iter().step_by(STRIDE).map(of_slice).collect();
    let of = |region: Region| {
        let own = seen.iter().flatten().filter(|seen| seen.region == region);
        Some((region, separation(own)?))
    };
    let parts: Vec<(Region, f64)> = Region::ALL.into_iter().filter_map(of).collect();
    let plain = parts.iter().filter(|(region, _)| !matches!(region, Region::LeftDeep | Region::RightDeep));
    let logs: Vec<f64> = plain.map(|&(region, separation)| times_usual(region, separation).ln()).collect();
    let whole_over_usual = (logs.iter().sum::<f64>() / logs.len().max(1) as f64).exp();
    parts.into_iter().map(|(region, separation)| RegionEvidence { region, separation, whole_over_usual }).collect()
}

/// Separation and share that is right of a good scan.
fn usual(region: Region) -> (f64, f64) {
    match region {
        Region::LeftFrontal | Region::RightFrontal => (3.85, 0.897),
        Region::LeftTemporal | Region::RightTemporal => (3.95, 0.899),
        Region::LeftParietal | Region::RightParietal => (3.84, 0.902),
        Region::LeftOccipital | Region::RightOccipital => (3.41, 0.875),
        Region::LeftDeep | Region::RightDeep => (2.11, 0.840),
        Region::Cerebellum => (3.20, 0.873),
        Region::Brainstem => (2.80, 0.738),
    }
}

fn times_usual(region: Region, separation: f64) -> f64 {
    // Tissues in each other's place have a separation below zero.
    (separation / usual(region).0).max(0.05)
}

/// What the logarithms of a part's separation and of the whole brain's, over the usual, do to the logit of the share that is right.
const WEIGHTS: [f64; 2] = [0.79, 2.77];

impl RegionEvidence {
    /// Share of the part's labels that are expected to be right, 0 to 1.
    pub fn confidence(&self) -> f64 {
        let share = usual(self.region).1;
        let own = WEIGHTS[0] * times_usual(self.region, self.separation).ln();
        let logit = (share / (1.0 - share)).ln() + own + WEIGHTS[1] * self.whole_over_usual.max(0.05).ln();
        1.0 / (1.0 + (-logit).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    /// Grey and white matter of these brightnesses in layers over the template's brain, with this much noise.
    fn layers(white: f32, noise: f32) -> (LabelMap<Mni>, Volume<f32, Mni>) {
        let grid = Grid::<Mni>::axis_aligned([80, 100, 80], [2.0; 3], [-79.0, -118.0, -70.0]);
        let labels = Volume::from_fn(grid, |n| {
            if (grid.voxel(n)[2] / 6).is_multiple_of(2) { label::GREY_MATTER } else { label::WHITE_MATTER }
        });
        let even = Volume::from_fn(grid, |n| {
            let plain = if labels.data[n] == label::GREY_MATTER { 100.0 } else { white };
            let [i, j, k] = grid.voxel(n);
            plain + if (i / STRIDE + j / STRIDE + k / STRIDE).is_multiple_of(2) { noise } else { -noise }
        });
        (labels, even)
    }

    #[test]
    fn separation_is_the_distance_of_the_means_in_deviations_in_every_part() {
        let (labels, even) = layers(150.0, 20.0);
        let found = evidence(&labels, &even, |p| p);
        assert_eq!(found.len(), Region::ALL.len());
        for part in found {
            assert!((part.separation - 2.5).abs() < 0.1, "{part:?}");
        }
    }

    #[test]
    fn tissues_less_apart_are_less_sure_and_every_confidence_is_a_share() {
        let of = |white: f32, noise: f32| {
            let (labels, even) = layers(white, noise);
            evidence(&labels, &even, |p| p)
        };
        let scans = [of(150.0, 8.0), of(150.0, 20.0), of(120.0, 20.0), of(80.0, 20.0)];
        for pair in scans.windows(2) {
            for (better, worse) in pair[0].iter().zip(&pair[1]) {
                let [better, worse] = [better, worse].map(RegionEvidence::confidence);
                assert!((0.0..=1.0).contains(&better) && worse < better, "{better} {worse}");
            }
        }
    }

    #[test]
    fn a_part_without_one_of_the_tissues_says_nothing() {
        let (labels, even) = layers(150.0, 20.0);
        let alone = labels.map(|_| label::GREY_MATTER);
        assert_eq!(evidence(&alone, &even, |p| p), []);
    }
}
