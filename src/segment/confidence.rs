//! How much of each part of the brain is expected to be labelled right: from what the segmentation knows of itself.

use super::label;
use super::mixture::Mixture;
use super::priors::AtlasPriors;
use super::region::Region;
use crate::geometry::{Mni, Position};
use crate::image::{LabelMap, Mask};
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
}

/// How much of its label every looked-at voxel of the brain holds: place in memory and share.
pub(super) type Contents = Vec<(u32, f32)>;

/// [`Contents`] of the labels as they are in the end.
pub(super) fn contents(model: &Mixture, labels: &LabelMap<Mni>, priors: &AtlasPriors) -> Contents {
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
        (n, content)
    };
    model.voxels.iter().zip(&model.contents).filter(|(n, _)| looked_at(**n)).map(of).collect()
}

/// The evidence of every part of which the scan shows enough; all on the priors' grid.
pub(super) fn evidence(
    contents: &Contents,
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
    let found = contents.par_iter().map(|&(n, content)| (n as usize, Some(content)));
    let missed = (0..grid.dims[2]).into_par_iter().step_by(STRIDE).flat_map_iter(|k| {
        let rows = (0..grid.dims[1]).step_by(STRIDE);
        rows.flat_map(move |j| (0..grid.dims[0]).step_by(STRIDE).map(move |i| grid.index(i, j, k)))
            .filter(|&n| priors.brain_mm.data[n] < 0.0 && known.data[n] && labels.data[n] == label::BACKGROUND)
            .map(|n| (n, None))
    });
    let seen: Vec<(Region, Option<f32>, f32, bool)> = found
        .chain(missed)
        .map(|(n, content)| {
            let mm = priors.brain_mm.data[n];
            let astray = if content.is_some() { mm > APART_MM } else { mm < -APART_MM };
            (Region::at(template_from_patient(grid.centre(grid.voxel(n)))), content, prior(n), astray)
        })
        .collect();
    let of = |region: Region| {
        let own = seen.iter().filter(|s| s.0 == region);
        let [mut all, mut brain, mut content, mut expected, mut astray] = [0.0f64; 5];
        for &(_, held, prior, beside) in own {
            all += 1.0;
            astray += f64::from(u8::from(beside));
            if let Some(held) = held {
                brain += 1.0;
                content += f64::from(held);
                expected += f64::from(prior);
            }
        }
        let [content, expected] = [content, expected].map(|sum| sum / f64::max(brain, 1.0));
        (brain >= FEW as f64).then_some(RegionEvidence { region, content, expected, astray: astray / all })
    };
    Region::ALL.into_iter().filter_map(of).collect()
}

/// A part of which fewer labels are expected to be right is told of, percent.
pub(super) const UNSURE_PERCENT: f64 = 75.0;

impl RegionEvidence {
    /// Share of the part's labels that are expected to be right, 0 to 1.
    pub fn confidence(&self) -> f64 {
        self.content
    }
}
