//! How much of each part of the brain is expected to be labelled right: from what the segmentation knows of itself.

use super::label;
use super::mixture::Mixture;
use super::priors::AtlasPriors;
use super::region::Region;
use crate::geometry::{Mni, Position};
use crate::image::{LabelMap, Mask, Volume};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One voxel in so many along each axis is looked at: a region still has thousands.
const STRIDE: usize = 3;
/// Outlines of brain found and of the carried template that lie nearer to each other than this agree, mm: the misfit that is
/// left everywhere.
const APART_MM: f32 = 2.0;
/// A region with fewer voxels than this in the scan says nothing.
const FEW: usize = 100;

/// What speaks for the labels of a part of the brain, over what the scan shows of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RegionEvidence {
    /// The part.
    pub region: Region,
    /// How much of a voxel is the tissue that it is labelled as, on average, 0 to 1 (the mixture's expectation).
    pub content: f64,
    /// How probable the carried template holds that tissue there, on average, 0 to 1.
    pub expected: f64,
    /// Share of the part where brain was found 2 mm and more outside the carried template or not found as far inside, 0 to 1.
    pub astray: f64,
    /// Distance of the means of white and grey matter over their mean standard deviation, after the bias is taken out; of the
    /// whole brain where the part has hardly any of one of them. The mixture smooths noise away and believes the result.
    pub separation: f64,
}

/// What is kept of a looked-at voxel of the brain.
pub(super) struct Seen {
    /// Place in memory.
    n: u32,
    /// How much of its label it holds.
    content: f32,
    /// Intensity without the bias.
    even: f32,
}

/// Every looked-at voxel of the brain, by the labels as they are in the end.
pub(super) fn seen(
    model: &Mixture,
    labels: &LabelMap<Mni>,
    even: &Volume<f32, Mni>,
    priors: &AtlasPriors,
) -> Vec<Seen> {
    let looked_at = |n: u32| labels.grid.voxel(n as usize).iter().all(|v| v % STRIDE == 0);
    let of = |(&n, p): (&u32, &[f32; 3])| {
        let at = n as usize;
        let content = match labels.data[at] {
            // In the nuclei place tells grey from white matter.
            label::GREY_MATTER if priors.deep_grey.data[at] > 0.5 => p[1] + p[2],
            label::GREY_MATTER => p[1],
            label::WHITE_MATTER => p[2],
            label::CSF | label::VENTRICLE => p[0],
            _ => 0.0,
        };
        Seen { n, content, even: even.data[at] }
    };
    model.voxels.iter().zip(&model.contents).filter(|(n, _)| looked_at(**n)).map(of).collect()
}

/// White from grey matter, over their mean deviation; `None` with hardly any of one of them.
fn separation<'a>(of: impl Iterator<Item = &'a Seen>, labels: &LabelMap<Mni>) -> Option<f64> {
    let mut sums = [[0.0f64; 3]; 2];
    for Seen { n, even, .. } in of {
        let which = match labels.data[*n as usize] {
            label::GREY_MATTER => 0,
            label::WHITE_MATTER => 1,
            _ => continue,
        };
        let x = f64::from(*even);
        for (sum, term) in sums[which].iter_mut().zip([1.0, x, x * x]) {
            *sum += term;
        }
    }
    if sums.iter().any(|[count, ..]| *count < FEW as f64) {
        return None;
    }
    let [grey, white] = sums.map(|[count, sum, squares]| {
        let mean = sum / count;
        (mean, (squares / count - mean * mean).max(0.0).sqrt())
    });
    let spread = 0.5 * (grey.1 + white.1);
    (spread > 0.0).then(|| (white.0 - grey.0) / spread)
}

/// The evidence of every part of which the scan shows enough; all on the priors' grid.
pub(super) fn evidence(
    seen: &[Seen],
    labels: &LabelMap<Mni>,
    known: &Mask<Mni>,
    priors: &AtlasPriors,
    template_from_patient: impl Fn(Position<Mni>) -> Position<Mni> + Sync,
) -> Vec<RegionEvidence> {
    let grid = priors.brain_mm.grid;
    let prior = |n: usize| match labels.data[n] {
        label::GREY_MATTER => priors.tissue[1].data[n],
        label::WHITE_MATTER => priors.tissue[2].data[n],
        _ => priors.tissue[0].data[n],
    };
    // Brain found, with its content; then what was expected and not found.
    let found = seen.par_iter().map(|seen| (seen.n as usize, Some(seen)));
    let missed = (0..grid.dims[2]).into_par_iter().step_by(STRIDE).flat_map_iter(|k| {
        let rows = (0..grid.dims[1]).step_by(STRIDE);
        rows.flat_map(move |j| (0..grid.dims[0]).step_by(STRIDE).map(move |i| grid.index(i, j, k)))
            .filter(|&n| priors.brain_mm.data[n] < 0.0 && known.data[n] && labels.data[n] == label::BACKGROUND)
            .map(|n| (n, None))
    });
    let judged: Vec<(Region, Option<&Seen>, f32, bool)> = found
        .chain(missed)
        .map(|(n, seen)| {
            let mm = priors.brain_mm.data[n];
            let astray = if seen.is_some() { mm > APART_MM } else { mm < -APART_MM };
            (Region::at(template_from_patient(grid.centre(grid.voxel(n)))), seen, prior(n), astray)
        })
        .collect();
    let whole = separation(seen.iter(), labels).unwrap_or(0.0);
    let of = |region: Region| {
        let own = || judged.iter().filter(move |s| s.0 == region);
        let [mut all, mut brain, mut content, mut expected, mut astray] = [0.0f64; 5];
        for &(_, held, prior, beside) in own() {
            all += 1.0;
            astray += f64::from(u8::from(beside));
            if let Some(held) = held {
                brain += 1.0;
                content += f64::from(held.content);
                expected += f64::from(prior);
            }
        }
        let [content, expected] = [content, expected].map(|sum| sum / f64::max(brain, 1.0));
        let separation = separation(own().filter_map(|s| s.1), labels).unwrap_or(whole);
        (brain >= FEW as f64).then_some(RegionEvidence { region, content, expected, astray: astray / all, separation })
    };
    Region::ALL.into_iter().filter_map(of).collect()
}

/// A part of which fewer labels are expected to be right is told of, percent.
pub(super) const UNSURE_PERCENT: f64 = 75.0;

/// Weights of one, the logit of the content, the template's expectation, what is astray and the logarithm of the separation in the
/// logit of the share that is right, fitted to heads with known labels (docs/evidence/choices.md).
const WEIGHTS: [f64; 5] = [-5.0, 0.6, 5.0, -3.0, 1.5];

impl RegionEvidence {
    /// Share of the part's labels that are expected to be right, 0 to 1.
    pub fn confidence(&self) -> f64 {
        let content = self.content.clamp(0.01, 0.99);
        let terms = [1.0, (content / (1.0 - content)).ln(), self.expected, self.astray, self.separation.max(0.1).ln()];
        let logit: f64 = WEIGHTS.iter().zip(terms).map(|(weight, term)| weight * term).sum();
        1.0 / (1.0 + (-logit).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_speaks_for_the_labels_makes_them_surer_and_an_outline_astray_less_sure() {
        let plain = RegionEvidence {
            region: Region::LeftFrontal,
            content: 0.88,
            expected: 0.62,
            astray: 0.01,
            separation: 3.0,
        };
        let less = [
            RegionEvidence { content: 0.8, ..plain },
            RegionEvidence { expected: 0.55, ..plain },
            RegionEvidence { astray: 0.1, ..plain },
            RegionEvidence { separation: 2.0, ..plain },
        ];
        for evidence in less {
            assert!(evidence.confidence() < plain.confidence(), "{evidence:?}");
        }
        for content in [0.0, 1.0] {
            let sure = RegionEvidence { content, ..plain }.confidence();
            assert!(sure > 0.0 && sure < 1.0);
        }
    }

    #[test]
    fn separation_is_the_distance_of_the_means_in_deviations() {
        let grid = crate::image::Grid::<Mni>::axis_aligned([40, 10, 10], [1.0; 3], [0.0; 3]);
        let labels =
            Volume::from_fn(grid, |n| if grid.voxel(n)[0] < 20 { label::GREY_MATTER } else { label::WHITE_MATTER });
        let spread = |n: usize| if n % 2 == 0 { 5.0f32 } else { -5.0 };
        let of = |white: f32| -> Vec<Seen> {
            let value = |n: usize| spread(n) + if labels.data[n] == label::GREY_MATTER { 60.0 } else { white };
            (0..grid.len()).map(|n| Seen { n: n as u32, content: 1.0, even: value(n) }).collect()
        };
        for white in [70.0, 100.0] {
            let found = separation(of(white).iter(), &labels).unwrap();
            assert!((found - f64::from(white - 60.0) / 5.0).abs() < 1e-6, "{found}");
        }
        let few = of(100.0);
        assert_eq!(separation(few.iter().take(50), &labels), None);
    }
}
