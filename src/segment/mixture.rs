//! Three tissues, a bias field and a Markov field by expectation maximisation.
//!
//! Van Leemput et al., "Automated model-based tissue classification of MR images of the brain", IEEE TMI 18(10), 1999;
//! Zhang, Brady, Smith, "Segmentation of brain MR images through a hidden Markov random field model", IEEE TMI 20(1), 2001.

use super::bias::{LogBias, LogRatio};
use super::priors::AtlasPriors;
use crate::geometry::Mni;
use crate::image::{Mask, Volume};
use rayon::prelude::*;

/// CSF, grey matter, white matter.
pub(super) const CLASSES: usize = 3;
const CSF: usize = 0;
const GREY: usize = 1;
const WHITE: usize = 2;
const CHUNK: usize = 8192;
/// No voxel: marks neighbours outside the region.
const NONE: u32 = u32::MAX;

/// How the mixture is fitted.
#[derive(Clone, Copy, Debug)]
pub(super) struct MixtureSettings {
    pub iterations: usize,
    pub bias_order: usize,
    pub bias_starts_at: usize,
    /// Weight of one of the six neighbours in the Markov field; 0 switches it off.
    pub neighbour_weight: f64,
    /// Share of the prior that does not believe the template.
    pub disbelief: f64,
    /// Every how many voxels along each axis are used (1: all).
    pub stride: usize,
}

/// The fitted tissues of a region.
#[derive(Clone, Debug)]
pub(super) struct Mixture {
    /// Positions in memory of the region's voxels.
    pub voxels: Vec<u32>,
    /// Probabilities of CSF, grey, white in each of them.
    pub probabilities: Vec<[f32; CLASSES]>,
    /// Mean intensity of each class after the bias is taken out.
    pub means: [f64; CLASSES],
    /// Standard deviation of each class.
    pub deviations: [f64; CLASSES],
    pub bias: LogBias,
}

impl Mixture {
    /// Intensity at which CSF and grey matter are equally far in their standard deviations.
    pub fn csf_grey_border(&self) -> f64 {
        border(self.means[CSF], self.deviations[CSF], self.means[GREY], self.deviations[GREY])
    }
}

fn border(a: f64, sd_a: f64, b: f64, sd_b: f64) -> f64 {
    (a * sd_b + b * sd_a) / (sd_a + sd_b)
}

/// Fits the mixture to the voxels of `region`; `None` when there are fewer than 1000 or the classes collapse.
pub(super) fn fit_mixture(
    t1: &Volume<f32, Mni>,
    region: &Mask<Mni>,
    priors: &AtlasPriors,
    settings: &MixtureSettings,
) -> Option<Mixture> {
    let grid = t1.grid;
    let on_stride = |n: usize| settings.stride == 1 || grid.voxel(n).iter().all(|&x| x % settings.stride == 0);
    let voxels: Vec<u32> = (0..grid.len()).filter(|&n| region.data[n] && on_stride(n)).map(|n| n as u32).collect();
    if voxels.len() < 1000 {
        return None;
    }
    let places: Vec<[usize; 3]> = voxels.iter().map(|&n| grid.voxel(n as usize)).collect();
    let raw: Vec<f32> = voxels.iter().map(|&n| t1.data[n as usize]).collect();
    let believed: Vec<[f32; CLASSES]> =
        voxels.iter().map(|&n| prior_at(priors, n as usize, settings.disbelief)).collect();
    let neighbours = if settings.neighbour_weight > 0.0 && settings.stride == 1 {
        neighbour_slots(grid.dims, &voxels)
    } else {
        Vec::new()
    };

    let (mut means, mut deviations) = start(&raw, &believed);
    let mut bias = LogBias::flat(grid.dims);
    let mut corrected = raw.clone();
    let mut probabilities = believed.clone();
    for iteration in 0..settings.iterations {
        let before = means;
        let smoothing = !neighbours.is_empty() && iteration >= settings.bias_starts_at;
        let previous = probabilities.clone();
        probabilities.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
            for (i, p) in out.iter_mut().enumerate() {
                let n = chunk * CHUNK + i;
                let field = if smoothing {
                    neighbour_field(&neighbours[n], &previous, settings.neighbour_weight)
                } else {
                    [1.0; CLASSES]
                };
                *p = posterior(f64::from(corrected[n]), &believed[n], field, &means, &deviations);
            }
        });
        (means, deviations) = moments(&corrected, &probabilities);
        if !(means[CSF] < means[GREY] && means[GREY] < means[WHITE]) {
            return None;
        }
        if settings.bias_order > 0 && iteration + 1 >= settings.bias_starts_at {
            let observations = log_ratios(&places, &raw, &probabilities, &means, &deviations);
            bias = LogBias::fit(grid.dims, settings.bias_order, &observations, &places);
            corrected.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
                for (i, value) in out.iter_mut().enumerate() {
                    let n = chunk * CHUNK + i;
                    *value = (f64::from(raw[n]) * (-bias.at(places[n])).exp()) as f32;
                }
            });
        }
        let moved = (0..CLASSES).map(|k| (means[k] - before[k]).abs()).fold(0.0, f64::max);
        if iteration > settings.bias_starts_at + 4 && moved < 1e-3 * (means[WHITE] - means[CSF]) {
            break;
        }
    }
    Some(Mixture { voxels, probabilities, means, deviations, bias })
}

fn prior_at(priors: &AtlasPriors, n: usize, disbelief: f64) -> [f32; CLASSES] {
    let p = [0, 1, 2].map(|k| f64::from(priors.tissue[k].data[n]).max(0.0));
    let sum: f64 = p.iter().sum();
    p.map(|p| {
        let template = if sum > 1e-3 { p / sum } else { 1.0 / CLASSES as f64 };
        ((1.0 - disbelief) * template + disbelief / CLASSES as f64) as f32
    })
}

/// First means and deviations: the moments under the template's probabilities, spread to the data's percentiles so that
/// a blurred prior cannot start all classes at one value.
fn start(values: &[f32], believed: &[[f32; CLASSES]]) -> ([f64; CLASSES], [f64; CLASSES]) {
    let mut sorted: Vec<f32> = values.iter().copied().step_by(1 + values.len() / 200_000).collect();
    sorted.sort_by(f32::total_cmp);
    let share = |k: usize| believed.iter().map(|p| f64::from(p[k])).sum::<f64>() / believed.len() as f64;
    let at = |q: f64| f64::from(sorted[((sorted.len() - 1) as f64 * q.clamp(0.0, 1.0)) as usize]);
    let (csf, grey) = (share(CSF), share(GREY));
    // The middle of each class when the classes fill the histogram in order.
    let means = [at(0.5 * csf), at(csf + 0.5 * grey), at(csf + grey + 0.5 * (1.0 - csf - grey))];
    let spread = ((means[WHITE] - means[CSF]) / 4.0).max(1e-6);
    (means, [spread; CLASSES])
}

#[inline]
fn posterior(
    value: f64,
    believed: &[f32; CLASSES],
    field: [f64; CLASSES],
    means: &[f64; CLASSES],
    deviations: &[f64; CLASSES],
) -> [f32; CLASSES] {
    let mut p = [0.0; CLASSES];
    for k in 0..CLASSES {
        // Darker than CSF is CSF (or air), brighter than white matter is white matter (or a vessel): the outer classes
        // are flat beyond their means.
        let z = (value - means[k]) / deviations[k];
        let z = if (k == CSF && z < 0.0) || (k == WHITE && z > 0.0) { 0.0 } else { z };
        p[k] = f64::from(believed[k]) * field[k] * (-0.5 * z * z).exp() / deviations[k] + 1e-12;
    }
    let sum: f64 = p.iter().sum();
    p.map(|p| (p / sum) as f32)
}

/// exp(weight * sum of the neighbours' probabilities): mean field of a Potts model.
#[inline]
fn neighbour_field(slots: &[u32; 6], probabilities: &[[f32; CLASSES]], weight: f64) -> [f64; CLASSES] {
    let mut sum = [0.0f64; CLASSES];
    for &slot in slots.iter().filter(|&&s| s != NONE) {
        for k in 0..CLASSES {
            sum[k] += f64::from(probabilities[slot as usize][k]);
        }
    }
    sum.map(|s| (weight * s).exp())
}

fn neighbour_slots(dims: [usize; 3], voxels: &[u32]) -> Vec<[u32; 6]> {
    let [nx, ny, nz] = dims;
    let mut slot = vec![NONE; nx * ny * nz];
    for (n, &v) in voxels.iter().enumerate() {
        slot[v as usize] = n as u32;
    }
    voxels
        .par_iter()
        .map(|&v| {
            let v = v as usize;
            let (i, j, k) = (v % nx, v / nx % ny, v / (nx * ny));
            let at = |inside: bool, w: usize| if inside { slot[w] } else { NONE };
            [
                at(i > 0, v.wrapping_sub(1)),
                at(i + 1 < nx, v + 1),
                at(j > 0, v.wrapping_sub(nx)),
                at(j + 1 < ny, v + nx),
                at(k > 0, v.wrapping_sub(nx * ny)),
                at(k + 1 < nz, v + nx * ny),
            ]
        })
        .collect()
}

fn moments(values: &[f32], probabilities: &[[f32; CLASSES]]) -> ([f64; CLASSES], [f64; CLASSES]) {
    let parts: Vec<[[f64; 3]; CLASSES]> = values
        .par_chunks(CHUNK)
        .zip(probabilities.par_chunks(CHUNK))
        .map(|(values, probabilities)| {
            let mut sums = [[0.0; 3]; CLASSES];
            for (&x, p) in values.iter().zip(probabilities) {
                let x = f64::from(x);
                for k in 0..CLASSES {
                    let w = f64::from(p[k]);
                    sums[k][0] += w;
                    sums[k][1] += w * x;
                    sums[k][2] += w * x * x;
                }
            }
            sums
        })
        .collect();
    let mut sums = [[0.0; 3]; CLASSES];
    for part in &parts {
        for k in 0..CLASSES {
            for m in 0..3 {
                sums[k][m] += part[k][m];
            }
        }
    }
    let means = sums.map(|s| s[1] / s[0].max(1e-9));
    let variance: Vec<f64> =
        (0..CLASSES).map(|k| (sums[k][2] / sums[k][0].max(1e-9) - means[k] * means[k]).max(0.0)).collect();
    // Grey and white share the scanner's noise; what differs is partial volume and the deep nuclei, which the wide
    // class would otherwise claim from the narrow one. Each is drawn half-way to their common variance.
    let pooled = (sums[GREY][0] * variance[GREY] + sums[WHITE][0] * variance[WHITE])
        / (sums[GREY][0] + sums[WHITE][0]).max(1e-9);
    let floor = (0.02 * (means[WHITE] - means[CSF])).max(1e-6);
    let deviation = |k: usize| {
        let v = if k == CSF { variance[k] } else { 0.5 * (variance[k] + pooled) };
        v.sqrt().max(floor)
    };
    (means, [deviation(CSF), deviation(GREY), deviation(WHITE)])
}

/// What grey and white matter say of the gain. CSF is left out: its partial volumes look like a low gain.
fn log_ratios(
    places: &[[usize; 3]],
    raw: &[f32],
    probabilities: &[[f32; CLASSES]],
    means: &[f64; CLASSES],
    deviations: &[f64; CLASSES],
) -> Vec<LogRatio> {
    // Some hundred thousand observations are plenty for 19 unknowns.
    let step = 1 + places.len() / 150_000;
    (0..places.len())
        .step_by(step)
        .filter_map(|n| {
            let value = f64::from(raw[n]);
            if value <= 0.0 {
                return None;
            }
            let (mut weight, mut sum) = (0.0, 0.0);
            for k in [GREY, WHITE] {
                // Variance of a logarithm: (sd / mean)^2.
                let w = f64::from(probabilities[n][k]) * (means[k] / deviations[k]).powi(2);
                weight += w;
                sum += w * (value / means[k]).ln();
            }
            (weight > 1e-6).then(|| LogRatio { voxel: places[n], log_ratio: sum / weight, weight })
        })
        .collect()
}
