//! Three tissues with mixed voxels between them, a bias field and a Markov field by expectation maximisation.
//!
//! Van Leemput et al., "Automated model-based tissue classification of MR images of the brain", IEEE TMI 18(10), 1999;
//! Zhang, Brady, Smith, "Segmentation of brain MR images through a hidden Markov random field model", IEEE TMI 20(1), 2001.

use super::appearance::{Appearance, CLASSES, CSF, GREY, Seen, WHITE};
use super::bias::{LogBias, LogRatio};
use super::priors::AtlasPriors;
use crate::geometry::Mni;
use crate::image::{Mask, Volume};
use rayon::prelude::*;

const CHUNK: usize = 8192;
/// Iterations of the Markov field on all voxels once means and bias are known from fewer.
const LAST_ITERATIONS: usize = 5;
/// The carried template's ventricles are believed to be full of fluid this far inside their walls.
const VENTRICLE_DEPTH_MM: f32 = 2.0;
/// Fewer voxels than this say nothing of fluid.
const LEAST_FLUID: usize = 50;
/// How much of the way from the ventricles' fluid to grey matter CSF's mean may lie: sulci are never quite full. A small
/// child's brain fills its skull; with hardly any CSF to be seen the class would turn to the darker half of the cortex.
const BRIGHTER: f64 = 0.3;
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
    /// Expected share of CSF, grey, white in each of them.
    pub contents: Vec<[f32; CLASSES]>,
    /// Mean intensity of voxels full of one tissue, after the bias is taken out.
    pub means: [f64; CLASSES],
    /// Standard deviation of the same.
    pub deviations: [f64; CLASSES],
    pub bias: LogBias,
}

impl Mixture {
    /// Intensity of a voxel that is half CSF and half grey matter.
    pub fn csf_grey_border(&self) -> f64 {
        0.5 * (self.means[CSF] + self.means[GREY])
    }

    /// Intensity of a voxel that is half grey and half white matter.
    pub fn grey_white_border(&self) -> f64 {
        0.5 * (self.means[GREY] + self.means[WHITE])
    }
}

/// Fits the mixture to the voxels of `region`; `None` when there are fewer than 1000 or the classes collapse.
///
/// From a mixture `begun` on fewer voxels its bias is kept and few iterations are needed. The deep nuclei say nothing of what
/// grey matter looks like: they have an intensity of their own.
pub(super) fn fit_mixture(
    t1: &Volume<f32, Mni>,
    region: &Mask<Mni>,
    priors: &AtlasPriors,
    settings: &MixtureSettings,
    begun: Option<&Mixture>,
) -> Option<Mixture> {
    let grid = t1.grid;
    let on_stride = |n: usize| settings.stride == 1 || grid.voxel(n).iter().all(|&x| x % settings.stride == 0);
    let within = |n: &u32| region.data[*n as usize] && on_stride(*n as usize);
    let voxels: Vec<u32> = (0..grid.len() as u32).into_par_iter().filter(within).collect();
    if voxels.len() < 1000 {
        return None;
    }
    let places: Vec<[usize; 3]> = voxels.par_iter().map(|&n| grid.voxel(n as usize)).collect();
    let raw: Vec<f32> = voxels.par_iter().map(|&n| t1.data[n as usize]).collect();
    let believed: Vec<[f32; CLASSES]> =
        voxels.par_iter().map(|&n| prior_at(priors, n as usize, settings.disbelief)).collect();
    let neighbours = if settings.neighbour_weight > 0.0 && settings.stride == 1 {
        neighbour_slots(grid.dims, &voxels)
    } else {
        Vec::new()
    };

    let typical: Vec<bool> = voxels.par_iter().map(|&n| priors.deep_grey.data[n as usize] < 0.25).collect();
    let (mut means, mut deviations) = begun.map_or_else(|| start(&raw, &believed), |b| (b.means, b.deviations));
    let mut bias = begun.map_or_else(|| LogBias::flat(grid.dims), |b| b.bias.clone());
    let mut corrected: Vec<f32> = if begun.is_some() {
        (raw.par_iter().zip(&places)).map(|(&x, &v)| (f64::from(x) * (-bias.at(v)).exp()) as f32).collect()
    } else {
        raw.clone()
    };
    let in_ventricle = |n: &usize| priors.ventricle_mm.data[voxels[*n] as usize] < -VENTRICLE_DEPTH_MM;
    let fluid: Vec<usize> = (0..voxels.len()).into_par_iter().filter(in_ventricle).collect();
    let mut contents = believed.clone();
    let iterations = if begun.is_some() { settings.iterations.min(LAST_ITERATIONS) } else { settings.iterations };
    for iteration in 0..iterations {
        let before = means;
        let smoothing =
            !neighbours.is_empty() && iteration >= if begun.is_some() { 1 } else { settings.bias_starts_at };
        let previous = contents.clone();
        let appearance = Appearance::new(&means, &deviations);
        let seen = |n: usize| {
            let field = if smoothing {
                neighbour_field(&neighbours[n], &previous, settings.neighbour_weight)
            } else {
                [1.0; CLASSES]
            };
            appearance.seen(corrected[n], &believed[n], &field)
        };
        let parts: Vec<Moments> = contents
            .par_chunks_mut(CHUNK)
            .enumerate()
            .map(|(chunk, out)| {
                let mut sums = Moments::default();
                for (i, out) in out.iter_mut().enumerate() {
                    let n = chunk * CHUNK + i;
                    let Seen { pure, content } = seen(n);
                    *out = content.map(|p| p as f32);
                    if typical[n] {
                        sums.add(f64::from(corrected[n]), &pure);
                    }
                }
                sums
            })
            .collect();
        (means, deviations) = Moments::total(&parts);
        if let Some(fluid) = median(fluid.iter().map(|&n| corrected[n])) {
            means[CSF] = means[CSF].min(fluid + BRIGHTER * (means[GREY] - fluid).max(0.0));
        }
        if !(means[CSF] < means[GREY] && means[GREY] < means[WHITE]) {
            return None;
        }
        if begun.is_none() && settings.bias_order > 0 && iteration + 1 >= settings.bias_starts_at {
            let pure = |n: usize| if typical[n] { seen(n).pure } else { [0.0; CLASSES] };
            let observations = log_ratios(&places, &raw, pure, &means, &deviations);
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
    Some(Mixture { voxels, contents, means, deviations, bias })
}

/// The middle of values, when there are enough.
fn median(values: impl Iterator<Item = f32>) -> Option<f64> {
    let mut values: Vec<f32> = values.collect();
    if values.len() < LEAST_FLUID {
        return None;
    }
    let middle = values.len() / 2;
    Some(f64::from(*values.select_nth_unstable_by(middle, f32::total_cmp).1))
}

fn prior_at(priors: &AtlasPriors, n: usize, disbelief: f64) -> [f32; CLASSES] {
    let deep = f64::from(priors.deep_grey.data[n]).clamp(0.0, 1.0);
    let mut p = [0, 1, 2].map(|k| f64::from(priors.tissue[k].data[n]).max(0.0));
    let white_to_grey = deep * p[WHITE];
    (p[GREY], p[WHITE]) = (p[GREY] + white_to_grey, p[WHITE] - white_to_grey);
    let sum: f64 = p.iter().sum();
    let disbelief = disbelief * (1.0 - deep);
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

/// exp(weight * sum of the neighbours' contents) for half a voxel: mean field of a Potts model.
#[inline]
fn neighbour_field(slots: &[u32; 6], contents: &[[f32; CLASSES]], weight: f64) -> [f64; CLASSES] {
    let mut sum = [0.0f64; CLASSES];
    for &slot in slots.iter().filter(|&&s| s != NONE) {
        for k in 0..CLASSES {
            sum[k] += f64::from(contents[slot as usize][k]);
        }
    }
    sum.map(|s| (0.5 * weight * s).exp())
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

/// Weight, weighted sum and weighted sum of squares of the intensities of each pure class.
#[derive(Clone, Copy, Default)]
struct Moments([[f64; 3]; CLASSES]);

impl Moments {
    #[inline]
    fn add(&mut self, x: f64, pure: &[f64; CLASSES]) {
        for k in 0..CLASSES {
            self.0[k][0] += pure[k];
            self.0[k][1] += pure[k] * x;
            self.0[k][2] += pure[k] * x * x;
        }
    }

    /// Means and standard deviations of all parts, summed in their order.
    fn total(parts: &[Self]) -> ([f64; CLASSES], [f64; CLASSES]) {
        let mut sums = [[0.0; 3]; CLASSES];
        for part in parts {
            for k in 0..CLASSES {
                for m in 0..3 {
                    sums[k][m] += part.0[k][m];
                }
            }
        }
        let means = sums.map(|s| s[1] / s[0].max(1e-9));
        let variance: Vec<f64> =
            (0..CLASSES).map(|k| (sums[k][2] / sums[k][0].max(1e-9) - means[k] * means[k]).max(0.0)).collect();
        // Grey and white share the scanner's noise; what differs is the deep nuclei, which the wide class would
        // otherwise claim from the narrow one. Each is drawn half-way to their common variance.
        let pooled = (sums[GREY][0] * variance[GREY] + sums[WHITE][0] * variance[WHITE])
            / (sums[GREY][0] + sums[WHITE][0]).max(1e-9);
        let floor = (0.02 * (means[WHITE] - means[CSF])).max(1e-6);
        let deviation = |k: usize| {
            let v = if k == CSF { variance[k] } else { 0.5 * (variance[k] + pooled) };
            v.sqrt().max(floor)
        };
        (means, [deviation(CSF), deviation(GREY), deviation(WHITE)])
    }
}

/// What grey and white matter say of the gain; `pure` gives a voxel's probability of being full of each tissue. CSF is
/// left out: its intensity is mostly that of what it holds (choroid plexus, vessels, flow).
fn log_ratios(
    places: &[[usize; 3]],
    raw: &[f32],
    pure: impl Fn(usize) -> [f64; CLASSES] + Sync,
    means: &[f64; CLASSES],
    deviations: &[f64; CLASSES],
) -> Vec<LogRatio> {
    // Some hundred thousand observations are plenty for 19 unknowns.
    let step = 1 + places.len() / 150_000;
    (0..places.len().div_ceil(step))
        .into_par_iter()
        .filter_map(|n| {
            let n = n * step;
            let value = f64::from(raw[n]);
            if value <= 0.0 {
                return None;
            }
            let (mut weight, mut sum) = (0.0, 0.0);
            let pure = pure(n);
            for k in [GREY, WHITE] {
                // Variance of a logarithm: (sd / mean)^2.
                let w = pure[k] * (means[k] / deviations[k]).powi(2);
                weight += w;
                sum += w * (value / means[k]).ln();
            }
            (weight > 1e-6).then(|| LogRatio { voxel: places[n], log_gain: sum / weight, weight })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;
    use crate::image::gaussian::gaussian_along_axes;

    /// Folds: sulci of CSF two voxels wide, cortex of four, white matter of six; blurred across, with noise.
    #[test]
    fn sulci_too_narrow_to_be_full_of_csf_leave_the_means_and_the_cortex_where_they_are() {
        const MEANS: [f32; CLASSES] = [40.0, 120.0, 180.0];
        let grid = Grid::<Mni>::axis_aligned([64, 24, 24], [1.0; 3], [0.0; 3]);
        let tissue = |n: usize| match grid.voxel(n)[0] % 16 {
            0..2 => CSF,
            6..12 => WHITE,
            _ => GREY,
        };
        let share = |k: usize| {
            let full = Volume::from_data(grid, (0..grid.len()).map(|n| f32::from(u8::from(tissue(n) == k))).collect());
            gaussian_along_axes(&full, [0.8, 0.0, 0.0])
        };
        let shares = [share(CSF), share(GREY), share(WHITE)];
        let noise = |n: usize| (n as u32).wrapping_mul(2_654_435_761) as f32 / u32::MAX as f32 - 0.5;
        let t1 = Volume::from_data(
            grid,
            (0..grid.len())
                .map(|n| 20.0 * noise(n) + (0..CLASSES).map(|k| MEANS[k] * shares[k].data[n]).sum::<f32>())
                .collect(),
        );
        let far = Volume::filled(grid, 0f32);
        let priors = AtlasPriors {
            brain_mm: far.clone(),
            tissue: shares.each_ref().map(|s| gaussian_along_axes(s, [3.0, 0.0, 0.0])),
            ventricle_mm: far.clone(),
            deep_grey: far.clone(),
            cistern_mm: far.clone(),
            cerebellum: far,
        };
        let settings = MixtureSettings {
            iterations: 30,
            bias_order: 0,
            bias_starts_at: 5,
            neighbour_weight: 0.25,
            disbelief: 0.3,
            stride: 1,
        };
        let found = fit_mixture(&t1, &t1.map(|_| true), &priors, &settings, None).unwrap();
        // The sulci are three quarters full at most, so CSF cannot come out quite as dark as it is.
        for (k, tolerance) in [(CSF, 20.0), (GREY, 6.0), (WHITE, 6.0)] {
            assert!((found.means[k] - f64::from(MEANS[k])).abs() < tolerance, "{:?}", found.means);
        }
        let grey = Mask::from_data(grid, found.contents.iter().map(|p| p[GREY] > p[CSF].max(p[WHITE])).collect());
        let truth = Mask::from_data(grid, (0..grid.len()).map(|n| tissue(n) == GREY).collect());
        assert!(grey.dice(&truth) > 0.95, "{}", grey.dice(&truth));
    }
}
