//! Draws as a mean and a few modes: small enough to keep in a case, and what a prediction is judged by afterwards.
//!
//! Draws are read from a smooth surface over a few unknowns, so they lie near a space of few dimensions. Its axes are the
//! principal components of the weighed draws (the snapshot method: Sirovich, Quarterly of Applied Mathematics 45, 1987).

use super::place::Found;
use super::spread::Draws;
use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

/// One draw by its coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DrawnState {
    /// How the brain was supported: `fixed` or `sliding`.
    pub supports: String,
    /// Its number among the draws of these supports, from 0: the same number is the same patient, whatever is taken.
    pub number: usize,
    /// What it counts.
    pub weight: f64,
    /// Tissue that moves by more than the threshold, cc.
    pub over_threshold_cc: f64,
    /// One number for each mode.
    pub coordinates: Vec<f64>,
}

/// A mean state, modes, and every draw's coordinates among them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Modes {
    /// The mean displacement of every node, mm.
    pub mean_mm: Vec<[f64; 3]>,
    /// Displacement of every node where a coordinate is 1, mm; over the draws a coordinate has variance 1.
    pub modes_mm: Vec<Vec<[f64; 3]>>,
    /// The draws.
    pub draws: Vec<DrawnState>,
}

/// What modes may leave out, mm, root mean square over nodes and draws: less than a file of displacements is read to.
const LEFT_OUT_MM: f64 = 2e-3;
/// More would not be a few.
const MOST: usize = 64;
/// Displacements are kept to this part of a mm: what is known, and it packs well.
const PARTS: f64 = 1024.0;

impl Modes {
    /// The modes of draws around their mean (mm). `named` says for every draw how the brain was supported, its number and
    /// its volume over the threshold.
    pub fn of(draws: &Draws, mean_mm: &[[f64; 3]], named: &[(String, usize, f64)]) -> Self {
        let count = draws.len();
        let all: f64 = draws.iter().map(|(weight, _)| weight).sum::<f64>().max(f64::MIN_POSITIVE);
        let root: Vec<f64> = draws.iter().map(|(weight, _)| (weight / all).sqrt()).collect();
        let rows: Vec<Vec<f64>> = (0..count)
            .into_par_iter()
            .map(|i| (0..=i).map(|j| root[i] * root[j] * product(&draws[i].1, &draws[j].1, mean_mm)).collect())
            .collect();
        let gram = DMatrix::from_fn(count, count, |i, j| rows[i.max(j)][i.min(j)]);
        let eigen = SymmetricEigen::new(gram);
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]).then(a.cmp(&b)));
        let allowed = LEFT_OUT_MM * LEFT_OUT_MM * mean_mm.len() as f64;
        let mut left: f64 = eigen.eigenvalues.iter().map(|v| v.max(0.0)).sum();
        let mut kept = Vec::new();
        for &mode in order.iter().take(MOST) {
            if left <= allowed {
                break;
            }
            left -= eigen.eigenvalues[mode].max(0.0);
            kept.push(mode);
        }
        // An axis has no sign: the first draw that tells has a coordinate above 0.
        let signed = |mode: usize, i: usize| {
            let axis = eigen.eigenvectors.column(mode);
            let sign = axis.iter().find(|v| v.abs() > 1e-6).map_or(1.0, |v| v.signum());
            sign * axis[i]
        };
        let part = |x: f64| (x * PARTS).round() / PARTS + 0.0;
        let modes_mm = kept
            .par_iter()
            .map(|&mode| {
                // Draw by draw: each lies in one piece of memory.
                let mut sum = vec![[0.0; 3]; mean_mm.len()];
                for (i, (_, u)) in draws.iter().enumerate() {
                    let share = root[i] * signed(mode, i);
                    for ((sum, u), mean) in sum.iter_mut().zip(u).zip(mean_mm) {
                        (0..3).for_each(|a| sum[a] += share * (u[a] - mean[a]));
                    }
                }
                sum.into_iter().map(|u| u.map(part)).collect()
            })
            .collect();
        let drawn = |(i, (supports, number, over_threshold_cc)): (usize, &(String, usize, f64))| DrawnState {
            supports: supports.clone(),
            number: *number,
            weight: draws[i].0,
            over_threshold_cc: *over_threshold_cc,
            coordinates: kept.iter().map(|&mode| signed(mode, i) / root[i].max(f64::MIN_POSITIVE)).collect(),
        };
        Self { mean_mm: mean_mm.to_vec(), modes_mm, draws: named.iter().enumerate().map(drawn).collect() }
    }

    /// Every draw's displacement at a place, with its weight, mm.
    pub fn at(&self, place: &Found) -> Vec<(f64, [f64; 3])> {
        let mean = place.at(&self.mean_mm);
        let modes: Vec<[f64; 3]> = self.modes_mm.iter().map(|mode| place.at(mode)).collect();
        let of = |draw: &DrawnState| {
            let moved = |a: usize| mean[a] + modes.iter().zip(&draw.coordinates).map(|(m, c)| c * m[a]).sum::<f64>();
            (draw.weight, [0, 1, 2].map(moved))
        };
        self.draws.iter().map(of).collect()
    }
}

/// The product of two draws' differences from the mean.
fn product(a: &[[f64; 3]], b: &[[f64; 3]], mean: &[[f64; 3]]) -> f64 {
    let of_node = |((a, b), m): ((&[f64; 3], &[f64; 3]), &[f64; 3])| {
        (a[0] - m[0]) * (b[0] - m[0]) + (a[1] - m[1]) * (b[1] - m[1]) + (a[2] - m[2]) * (b[2] - m[2])
    };
    a.iter().zip(b).zip(mean).map(of_node).sum()
}

#[cfg(test)]
mod tests {
    use super::super::low_discrepancy::normals;
    use super::super::spread::spread;
    use super::*;

    /// Draws of 40 nodes over three unknowns, one of them squared.
    fn draws() -> Vec<(f64, Vec<[f64; 3]>)> {
        let of = |n: usize| {
            let z = normals(n, 0, 3);
            let node = |k: usize| {
                let x = k as f64 / 40.0;
                [1.0 + z[0] * x, z[1] * (1.0 - x) + 0.3 * z[0] * z[0], 2.0 * z[2] * x * x]
            };
            (if n.is_multiple_of(2) { 0.01 } else { 0.03 }, (0..40).map(node).collect())
        };
        (0..64).map(of).collect()
    }

    fn modes_of(draws: &Draws) -> Modes {
        let named: Vec<(String, usize, f64)> = (0..draws.len()).map(|n| ("fixed".to_owned(), n, n as f64)).collect();
        Modes::of(draws, &spread(draws, 40, 2.0).mean_mm, &named)
    }

    #[test]
    fn draws_of_three_unknowns_come_back_from_a_handful_of_modes() {
        let draws = draws();
        let modes = modes_of(&draws);
        assert!((3..=5).contains(&modes.modes_mm.len()), "{}", modes.modes_mm.len());
        for node in [0u32, 17, 39] {
            let place = Found { nodes: [node; 4], weights: [0.25; 4], outside_mm: 0.0 };
            for ((weight, read), (own, drawn)) in modes.at(&place).iter().zip(&draws) {
                assert_eq!(weight, own);
                let off = (0..3).map(|a| (read[a] - drawn[node as usize][a]).abs()).fold(0.0, f64::max);
                assert!(off < 0.02, "{off}");
            }
        }
    }

    #[test]
    fn coordinates_have_variance_one_and_hang_together_in_no_pair() {
        let modes = modes_of(&draws());
        let all: f64 = modes.draws.iter().map(|d| d.weight).sum();
        let covariance = |a: usize, b: usize| {
            modes.draws.iter().map(|d| d.weight / all * d.coordinates[a] * d.coordinates[b]).sum::<f64>()
        };
        for a in 0..modes.modes_mm.len() {
            for b in 0..=a {
                assert!((covariance(a, b) - f64::from(u8::from(a == b))).abs() < 1e-6, "{a} {b}");
            }
        }
    }
}
