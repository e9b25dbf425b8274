//! A coarse correction for conjugate gradients: the rigid motions of pieces of the body.
//!
//! A diagonal preconditioner passes on news from node to node, so the iterations grow with the nodes along the body.
//! Here the rows are cut into pieces of equal size (medians along the longest axis), Z holds the six rigid motions of
//! every piece, and Z (Z^T K Z)^-1 Z^T is added to the preconditioner (Nicolaides, "Deflation of conjugate gradients",
//! SIAM J. Numer. Anal. 24, 1987; rigid motions as in smoothed aggregation, Vanek, Mandel and Brezina, 1996). K changes
//! little from one Newton iteration to the next: the matrix of the first is kept.

use super::Tangent;
use super::operator::{Lanes, Real, by_rows};
use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, Side};
use std::sync::Arc;

/// Least rows of a piece, and most pieces for every row along the body: the dense inverse of six numbers a piece then
/// stays cheaper than a product with K.
const PIECE: usize = 110;
const PIECES_ALONG: f64 = 4.3;

/// What the correction needs to know of the rows.
pub(in super::super) struct Rows {
    /// Places of their nodes, m.
    pub positions: Vec<[f64; 3]>,
    /// Components held on rows that are otherwise free.
    pub held: Option<Arc<Vec<[bool; 3]>>>,
}

/// The correction, ready to be applied.
pub(super) struct Coarse {
    /// Rows of every piece.
    start: Vec<usize>,
    rows: Vec<u32>,
    piece: Vec<u32>,
    /// Place of every row relative to its piece's centre, in units of the piece's size.
    place: Vec<[f32; 3]>,
    /// Components held on rows that are otherwise free: no motion of a piece moves them.
    held: Option<Arc<Vec<[bool; 3]>>>,
    /// (Z^T K Z)^-1, row after row.
    inverse: Vec<f32>,
}

/// Rows cut into `parts` of equal size.
fn cut(rows: &mut [u32], parts: usize, positions: &[[f64; 3]], start: &mut Vec<usize>) {
    if parts == 1 || rows.len() < 2 {
        start.push(start[start.len() - 1] + rows.len());
        return;
    }
    let extent = |axis: usize| {
        let x = || rows.iter().map(|&r| positions[r as usize][axis]);
        x().fold(f64::MIN, f64::max) - x().fold(f64::MAX, f64::min)
    };
    let axis = (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).unwrap_or(0);
    rows.sort_by(|&a, &b| positions[a as usize][axis].total_cmp(&positions[b as usize][axis]).then(a.cmp(&b)));
    let (low, high) = rows.split_at_mut(rows.len() * (parts / 2) / parts);
    cut(low, parts / 2, positions, start);
    cut(high, parts - parts / 2, positions, start);
}

/// Columns of K Z for one block: three translations, three rotations e_j x d.
fn times_rigid(block: &[f64; 9], d: [f64; 3], sum: &mut [[f64; 3]; 6]) {
    for r in 0..3 {
        let k = [block[r], block[r + 3], block[r + 6]];
        for c in 0..3 {
            sum[c][r] += k[c];
        }
        sum[3][r] += k[2] * d[1] - k[1] * d[2];
        sum[4][r] += k[0] * d[2] - k[2] * d[0];
        sum[5][r] += k[1] * d[0] - k[0] * d[1];
    }
}

/// Z^T of one row: force and moment.
fn wrench(d: [f64; 3], f: [f64; 3]) -> [f64; 6] {
    [f[0], f[1], f[2], d[1] * f[2] - d[2] * f[1], d[2] * f[0] - d[0] * f[2], d[0] * f[1] - d[1] * f[0]]
}

impl Coarse {
    /// `None` for a small system, which needs none, and for a tangent that is not positive definite.
    pub(super) fn new(tangent: &Tangent, at: &Rows) -> Option<Self> {
        let positions = &at.positions;
        let pieces = (positions.len() / PIECE).min((PIECES_ALONG * (positions.len() as f64).cbrt()) as usize);
        if pieces < 8 {
            return None;
        }
        let mut rows: Vec<u32> = (0..positions.len() as u32).collect();
        let mut start = vec![0];
        cut(&mut rows, pieces, positions, &mut start);
        let (mut piece, mut place) = (vec![0u32; rows.len()], vec![[0.0f32; 3]; rows.len()]);
        for p in 0..pieces {
            let own = &mut rows[start[p]..start[p + 1]];
            own.sort_unstable();
            let n = own.len() as f64;
            let centre = [0, 1, 2].map(|i| own.iter().map(|&r| positions[r as usize][i]).sum::<f64>() / n);
            let offset = |r: u32| [0, 1, 2].map(|i| positions[r as usize][i] - centre[i]);
            let square: f64 = own.iter().map(|&r| offset(r).iter().map(|x| x * x).sum::<f64>()).sum();
            let size = (square / n).sqrt().max(f64::MIN_POSITIVE);
            for &r in own.iter() {
                piece[r as usize] = p as u32;
                place[r as usize] = offset(r).map(|x| (x / size) as f32);
            }
        }
        let mut coarse = Self { start, rows, piece, place, held: at.held.clone(), inverse: Vec::new() };
        let matrix = coarse.matrix(tangent);
        let inverse = matrix.llt(Side::Lower).ok()?.inverse();
        let n = 6 * pieces;
        coarse.inverse = (0..n * n).map(|at| inverse[(at / n, at % n)] as f32).collect();
        coarse.inverse.iter().all(|v| v.is_finite()).then_some(coarse)
    }

    fn is_held(&self, row: usize) -> [bool; 3] {
        self.held.as_ref().map_or([false; 3], |h| h[row])
    }

    /// Z^T K Z.
    fn matrix(&self, tangent: &Tangent) -> Mat<f64> {
        let pieces = self.start.len() - 1;
        let mut matrix = Mat::<f64>::zeros(6 * pieces, 6 * pieces);
        let place = |row: usize| self.place[row].map(f64::from);
        let pattern = &tangent.matrix.pattern;
        // K Z of the row under way, by piece of the column.
        let mut sums: Vec<(u32, [[f64; 3]; 6])> = Vec::new();
        for row in 0..pattern.rows() {
            sums.clear();
            for at in pattern.row_start[row]..pattern.row_start[row + 1] {
                let column = pattern.columns[at] as usize;
                let of = self.piece[column];
                let found = sums.iter().position(|s| s.0 == of).unwrap_or_else(|| {
                    sums.push((of, [[0.0; 3]; 6]));
                    sums.len() - 1
                });
                times_rigid(&tangent.matrix.blocks[at], place(column), &mut sums[found].1);
            }
            let own = 6 * self.piece[row] as usize;
            for (of, sum) in &sums {
                for (c, column) in sum.iter().enumerate() {
                    let mut force = *column;
                    (0..3).filter(|&i| self.is_held(row)[i]).for_each(|i| force[i] = 0.0);
                    for (r, w) in wrench(place(row), force).into_iter().enumerate() {
                        matrix[(own + r, 6 * *of as usize + c)] += w;
                    }
                }
            }
        }
        if let Some(nodal) = &tangent.nodal {
            let rings = &*nodal.rings;
            // B Z of the group under way, by piece: nine strains for each of the six motions.
            let mut strains: Vec<(u32, [[f64; 9]; 6])> = Vec::new();
            for (g, moduli) in nodal.moduli.iter().enumerate() {
                strains.clear();
                for at in rings.row_start[g]..rings.row_start[g + 1] {
                    let (row, b) = (rings.rows[at] as usize, rings.gradients[at]);
                    let held = self.is_held(row);
                    let of = self.piece[row];
                    let found = strains.iter().position(|s| s.0 == of).unwrap_or_else(|| {
                        strains.push((of, [[0.0; 9]; 6]));
                        strains.len() - 1
                    });
                    for r in (0..3).filter(|&r| !held[r]) {
                        let mut unit = [0.0; 3];
                        unit[r] = 1.0;
                        for (motion, size) in strains[found].1.iter_mut().zip(wrench(place(row), unit)) {
                            (0..3).for_each(|c| motion[r + 3 * c] += size * b[c]);
                        }
                    }
                }
                for (of, columns) in &strains {
                    for (c, strain) in columns.iter().enumerate() {
                        let mut stress = [0.0; 9];
                        for (column, s) in moduli.as_chunks::<9>().0.iter().zip(strain) {
                            (0..9).for_each(|i| stress[i] += column[i] * s);
                        }
                        for (other, rows) in &strains {
                            for (r, row) in rows.iter().enumerate() {
                                let work: f64 = row.iter().zip(&stress).map(|(a, b)| a * b).sum();
                                matrix[(6 * *other as usize + r, 6 * *of as usize + c)] += work;
                            }
                        }
                    }
                }
            }
        }
        matrix
    }

    /// z += Z (Z^T K Z)^-1 Z^T r.
    pub(super) fn add<T: Real>(&self, r: &[Lanes<T>], z: &mut [Lanes<T>]) {
        let pieces = self.start.len() - 1;
        let mut loads = vec![[0.0f32; 6]; pieces];
        by_rows(&mut loads, |first, loads| {
            for (p, load) in (first..).zip(loads) {
                for &row in &self.rows[self.start[p]..self.start[p + 1]] {
                    let (f, d) = (r[row as usize], self.place[row as usize]);
                    let f = [f[0].wide() as f32, f[1].wide() as f32, f[2].wide() as f32];
                    let moment = [d[1] * f[2] - d[2] * f[1], d[2] * f[0] - d[0] * f[2], d[0] * f[1] - d[1] * f[0]];
                    for i in 0..3 {
                        load[i] += f[i];
                        load[i + 3] += moment[i];
                    }
                }
            }
        });
        let n = 6 * pieces;
        let loads = loads.as_flattened();
        let mut motion = vec![0.0f32; n];
        by_rows(&mut motion, |first, motion| {
            for (row, out) in (first..).zip(motion) {
                // Eight partial sums, so that the loop runs in vector registers.
                let mut sums = [0.0f32; 8];
                let line = &self.inverse[row * n..(row + 1) * n];
                let (wide, rest) = line.as_chunks::<8>();
                let (wide_loads, rest_loads) = loads.as_chunks::<8>();
                for (a, b) in wide.iter().zip(wide_loads) {
                    (0..8).for_each(|i| sums[i] += a[i] * b[i]);
                }
                *out = sums.iter().sum::<f32>() + rest.iter().zip(rest_loads).map(|(a, b)| a * b).sum::<f32>();
            }
        });
        let motion = motion.as_chunks::<6>().0;
        by_rows(z, |first, rows| {
            for (row, out) in (first..).zip(rows) {
                let (m, d) = (&motion[self.piece[row] as usize], self.place[row]);
                let turned = [m[4] * d[2] - m[5] * d[1], m[5] * d[0] - m[3] * d[2], m[3] * d[1] - m[4] * d[0]];
                let held = self.is_held(row);
                for i in (0..3).filter(|&i| !held[i]) {
                    out[i] += T::of(f64::from(m[i] + turned[i]));
                }
            }
        });
    }
}
