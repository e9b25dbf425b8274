//! How good a scan is for what is done with it: noise, ghosts, field of view, shading, voxels.
//!
//! Measures of MRIQC's kind (Esteban et al., "MRIQC: advancing the automatic prediction of image quality in MRI from unseen
//! sites", PLoS ONE 12(9), 2017), read from the scan as it is, on its own grid, with the labels that the segmentation has found.
//! None of them changes when all intensities are scaled.

mod air;
mod block;
mod contrast;
mod coverage;
mod focus;
mod gain;

pub use air::Air;

use super::confidence::{RegionEvidence, unsure_below_percent};
use super::posed_scan::PosedScan;
use super::region::Region;
use super::warning::SegmentWarning;
use crate::geometry::{Frame, Mni};
use crate::image::LabelMap;
use crate::register::deformable::DisplacementField;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The measures of one scan. One that cannot be told is absent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScanQuality {
    /// Distance of the means of white and grey matter over the root of the sum of the variances of white matter, grey matter and
    /// air, after the coil's gain is taken out (contrast to noise, Magnotta and Friedman 2006); higher is better.
    #[serde(default)]
    pub contrast_to_noise: Option<f64>,
    /// Mean over standard deviation of white matter away from its border, after the coil's gain is taken out; higher is better.
    #[serde(default)]
    pub white_signal_to_noise: Option<f64>,
    /// Entropy of the intensities over the largest that there can be, 0 to 1 (entropy focus criterion, Atkinson et al. 1997):
    /// ghosts and blur of motion raise it. Absent where the air is not seen.
    #[serde(default)]
    pub entropy_focus: Option<f64>,
    /// Share of the air above the skull's base that is brighter than noise and hangs together, percent (Mortamet et al. 2009, QI1):
    /// ghosts of motion, wrapping, spikes. Absent where the air is not seen.
    #[serde(default)]
    pub air_artefact_percent: Option<f64>,
    /// What the air can tell.
    pub air: Air,
    /// Share of the template's brain, carried onto the patient, that the field of view covers, percent; lost slices count as outside.
    pub coverage_percent: f64,
    /// How many times as bright the brightest part of white matter is as the darkest (98th to 2nd percentile of the coil's gain
    /// over some centimetres); 1 is even.
    #[serde(default)]
    pub gain_times: Option<f64>,
    /// Edges of a voxel along its axes i, j, k, mm.
    pub voxel_mm: [f64; 3],
    /// Longest over shortest edge of a voxel; 1 is a cube.
    pub anisotropy: f64,
    /// Mean local correlation of the fitted template with the scan over the brain, -1 to 1, where the template was fitted to it.
    #[serde(default)]
    pub template_correlation: Option<f64>,
    /// The parts of the brain by name.
    #[serde(default)]
    pub regions: Vec<RegionQuality>,
}

/// How far a part of the brain can be relied on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RegionQuality {
    /// The part.
    pub region: Region,
    /// Share of it that lies outside the field of view, percent; lost slices count as outside.
    pub outside_percent: f64,
    /// Share of its labelled voxels that are expected to be right, percent, by what such evidence came with on heads with known
    /// labels. Absent where labels were given, nothing was fitted to the scan, or hardly any of the part is seen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confidence_percent: Option<f64>,
}

/// A part with as much of it outside is told of, percent: a slice of 3 mm off a lobe's end.
const OUTSIDE_PERCENT: f64 = 5.0;

impl ScanQuality {
    /// What a reader should know of single parts of the brain.
    pub fn of_regions(&self) -> Vec<SegmentWarning> {
        let outside = self.regions.iter().filter(|r| r.outside_percent >= OUTSIDE_PERCENT);
        let mut parts: Vec<(Region, f64)> = outside.map(|r| (r.region, r.outside_percent)).collect();
        let unsure = |r: &RegionQuality| {
            Some((r.region, r.confidence_percent.filter(|stated| *stated < unsure_below_percent(r.region))?))
        };
        let mut doubtful: Vec<(Region, f64)> = self.regions.iter().filter_map(unsure).collect();
        // The worst first.
        parts.sort_by(|a, b| b.1.total_cmp(&a.1));
        doubtful.sort_by(|a, b| a.1.total_cmp(&b.1));
        let outside = (!parts.is_empty()).then_some(SegmentWarning::RegionsOutside { parts });
        let unsure = (!doubtful.is_empty()).then_some(SegmentWarning::UnsureRegions { parts: doubtful });
        outside.into_iter().chain(unsure).collect()
    }

    /// The largest share of any part that lies outside, percent.
    pub fn most_outside_percent(&self) -> Option<f64> {
        self.regions.iter().map(|r| r.outside_percent).reduce(f64::max)
    }

    /// The confidence of the least sure part, percent.
    pub fn least_confidence_percent(&self) -> Option<f64> {
        self.regions.iter().filter_map(|r| r.confidence_percent).reduce(f64::min)
    }
}

/// The measures of a case's scans; a prediction has none after the operation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScanQualities {
    /// The scan before the operation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pre: Option<ScanQuality>,
    /// The scan after it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub post: Option<ScanQuality>,
}

/// Measures a scan with its labels (on its own grid) and what speaks for them (nothing, where they were given); `template_from_patient` maps the MNI frame reached rigidly to the template.
pub fn scan_quality<F: Frame>(
    scan: &PosedScan<'_, F>,
    (labels, evidence): (&LabelMap<F>, &[RegionEvidence]),
    template_from_patient: &DisplacementField<Mni>,
    template_correlation: Option<f64>,
) -> ScanQuality {
    let (t1, blocks) = (scan.t1, block::Blocks::of(&scan.t1.grid));
    let gain = gain::white_gain(t1, labels, &blocks);
    let white = gain.as_ref().map_or(0.0, |gain| gain.mean);
    let seen = air::seen(scan, labels, &blocks, white);
    let tissue = gain.as_ref().map(|gain| contrast::tissues(t1, labels, gain, &blocks));
    let air_deviation = seen.noise.as_ref().map_or(0.0, |noise| noise.deviation);
    let told = seen.air == Air::Seen;
    let voxel_mm = t1.grid.spacing_mm();
    let [shortest, longest] =
        [voxel_mm.iter().fold(f64::INFINITY, |a, b| a.min(*b)), voxel_mm.iter().fold(0.0, |a, b| b.max(a))];
    let covered = coverage::coverage(scan, template_from_patient);
    let regions = Region::ALL.into_iter().zip(covered.outside_percent).map(|(region, outside_percent)| {
        let own = evidence.iter().find(|own| own.region == region);
        RegionQuality { region, outside_percent, confidence_percent: own.map(|own| 100.0 * own.confidence()) }
    });
    ScanQuality {
        contrast_to_noise: tissue.as_ref().and_then(|t| t.contrast_to_noise(air_deviation)),
        white_signal_to_noise: tissue.as_ref().and_then(contrast::Tissues::white_signal_to_noise),
        entropy_focus: told.then(|| focus::entropy_focus(t1)).flatten(),
        air_artefact_percent: seen.noise.map(|noise| noise.artefact_percent),
        air: seen.air,
        coverage_percent: covered.percent,
        gain_times: gain.map(|gain| gain.times),
        voxel_mm,
        anisotropy: longest / shortest,
        template_correlation,
        regions: regions.collect(),
    }
}

#[cfg(test)]
mod tests;
