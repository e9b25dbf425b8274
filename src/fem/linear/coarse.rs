//! A coarse correction for conjugate gradients: the rigid motions of pieces of the body.
//!
//! A diagonal preconditioner passes on news from node to node, so the iterations grow with the nodes along the body.
//! Here the rows are cut into pieces of equal size (medians along the longest axis), Z holds the six rigid motions of
//! every piece, and Z (Z^T K Z)^-1 Z^T is added to the preconditioner (Nicolaides, "Deflation of conjugate gradients",
//! SIAM J. Numer. Anal. 24, 1987; rigid motions as in smoothed aggregation, Vanek, Mandel and Brezina, 1996). Z^T K Z is as
//! sparse as K and factored as sparsely, so that the pieces can grow in number with the rows. K changes little from one Newton
//! iteration to the next: the factor of the first is kept, but for bodies before walls, whose part alone is taken anew.

use super::super::reduce::{by_rows, by_tasks};
use super::super::sparse::{BlockMatrix, BlockPattern};
use super::factor::{Factor, Symbolic};
use super::operator::{Lanes, Real, dot};
use super::system::Tangent;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Rows of a piece: smaller ones save iterations, larger ones make each cheaper (docs/evidence/choices.md).
const PIECE: usize = 220;

/// What the correction needs to know of the rows.
pub(in super::super) struct Rows {
    /// Places of their nodes, m.
    pub positions: Vec<[f64; 3]>,
    /// Components held on rows that are otherwise free.
    pub held: Option<Arc<Vec<[bool; 3]>>>,
    /// The tangent changes from one iteration to the next by far more than the body's does: a wall pushes or does not. Then
    /// the walls' part of the correction is made anew for every tangent.
    pub change: bool,
}

/// The rows by pieces.
struct Pieces {
    /// Rows of every piece.
    start: Vec<usize>,
    rows: Vec<u32>,
    piece: Vec<u32>,
    /// Place of every row relative to its piece's centre, in units of the piece's size.
    place: Vec<[f32; 3]>,
    /// Components held on rows that are otherwise free: no motion of a piece moves them.
    held: Option<Arc<Vec<[bool; 3]>>>,
    /// Centres of the pieces, m.
    centre: Vec<[f64; 3]>,
}

/// The correction, ready to be applied.
pub(super) struct Coarse {
    pieces: Pieces,
    /// Z^T K Z of the body without its walls.
    body: Coupling,
    /// Of Z^T K Z, two block rows a piece: translations and rotations.
    factor: Factor,
    /// Force and moment on every piece, and its motion.
    loads: Vec<[f64; 3]>,
    motion: Vec<[f64; 3]>,
}

/// Blocks of Z^T K Z by the pieces of row and column, column-major.
type Coupling = BTreeMap<(u32, u32), [[f64; 6]; 6]>;

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

/// The blocks as a matrix, two block rows a piece.
fn matrix(coupling: &Coupling, pieces: usize) -> BlockMatrix {
    let mut pattern = BlockPattern { row_start: vec![0], columns: Vec::new(), diagonal: Vec::new() };
    let mut blocks = Vec::new();
    for own in 0..pieces as u32 {
        for half in 0..2 {
            for (&(_, of), block) in coupling.range((own, 0)..=(own, u32::MAX)) {
                for other in 0..2 {
                    if (own, half) == (of, other) {
                        pattern.diagonal.push(pattern.columns.len() as u32);
                    }
                    pattern.columns.push(2 * of + other as u32);
                    blocks.push(std::array::from_fn(|n| block[3 * other + n / 3][3 * half + n % 3]));
                }
            }
            pattern.row_start.push(pattern.columns.len());
        }
    }
    BlockMatrix { pattern: Arc::new(pattern), blocks }
}

impl Coarse {
    /// `None` for a small system, which needs none, and for a tangent that is not positive definite.
    pub(super) fn new(tangent: &Tangent, at: &Rows) -> Option<Self> {
        let count = at.positions.len() / PIECE;
        if count < 8 {
            return None;
        }
        let pieces = Pieces::new(at, count);
        let coupling = pieces.coupling(tangent);
        let matrix = matrix(&coupling, count);
        let centres: Vec<[f64; 3]> = pieces.centre.iter().flat_map(|&c| [c, c]).collect();
        let symbolic = Arc::new(Symbolic::new(&matrix.pattern, None, &centres)?);
        let factor = Factor::new(&symbolic, &Tangent { matrix, nodal: None, walls: Vec::new() })?;
        let zero = vec![[0.0; 3]; 2 * count];
        let body = pieces.with_walls(coupling, -1.0, tangent);
        Some(Self { pieces, body, factor, loads: zero.clone(), motion: zero })
    }

    /// The correction for another tangent of the same body, whose pieces and order of elimination are the same; `None` as for
    /// [`Self::new`].
    pub(super) fn renewed(self, tangent: &Tangent) -> Option<Self> {
        let body = self.pieces.with_walls(self.pieces.coupling(tangent), -1.0, tangent);
        Self { body, ..self }.before_walls(tangent)
    }

    /// The correction with the walls of this tangent, the body as it was; `None` as for [`Self::new`].
    pub(super) fn before_walls(self, tangent: &Tangent) -> Option<Self> {
        let coupling = self.pieces.with_walls(self.body.clone(), 1.0, tangent);
        let matrix = matrix(&coupling, self.pieces.centre.len());
        let factor = Factor::new(self.factor.symbolic(), &Tangent { matrix, nodal: None, walls: Vec::new() })?;
        Some(Self { factor, ..self })
    }
}

impl Pieces {
    fn new(at: &Rows, count: usize) -> Self {
        let positions = &at.positions;
        let mut rows: Vec<u32> = (0..positions.len() as u32).collect();
        let mut start = vec![0];
        cut(&mut rows, count, positions, &mut start);
        let (mut piece, mut place) = (vec![0u32; rows.len()], vec![[0.0f32; 3]; rows.len()]);
        let mut centre = Vec::with_capacity(count);
        for p in 0..count {
            let own = &mut rows[start[p]..start[p + 1]];
            own.sort_unstable();
            let n = own.len() as f64;
            let middle = [0, 1, 2].map(|i| own.iter().map(|&r| positions[r as usize][i]).sum::<f64>() / n);
            let offset = |r: u32| [0, 1, 2].map(|i| positions[r as usize][i] - middle[i]);
            let square: f64 = own.iter().map(|&r| offset(r).iter().map(|x| x * x).sum::<f64>()).sum();
            let size = (square / n).sqrt().max(f64::MIN_POSITIVE);
            for &r in own.iter() {
                piece[r as usize] = p as u32;
                place[r as usize] = offset(r).map(|x| (x / size) as f32);
            }
            centre.push(middle);
        }
        Self { start, rows, piece, place, held: at.held.clone(), centre }
    }

    fn is_held(&self, row: usize) -> [bool; 3] {
        self.held.as_ref().map_or([false; 3], |h| h[row])
    }

    /// Adds what the columns of K Z on a row are to its piece.
    fn add_wrenches(&self, row: usize, columns: &[[f64; 3]; 6], factor: f64, block: &mut [[f64; 6]; 6]) {
        for (c, column) in columns.iter().enumerate() {
            let mut force = *column;
            (0..3).filter(|&i| self.is_held(row)[i]).for_each(|i| force[i] = 0.0);
            for (r, w) in wrench(self.place[row].map(f64::from), force).into_iter().enumerate() {
                block[c][r] += factor * w;
            }
        }
    }

    /// Z^T K Z with a tangent's walls added so many times.
    fn with_walls(&self, mut coupling: Coupling, factor: f64, tangent: &Tangent) -> Coupling {
        for (row, block) in &tangent.walls {
            let row = *row as usize;
            let mut sum = [[0.0; 3]; 6];
            times_rigid(block, self.place[row].map(f64::from), &mut sum);
            let own = coupling.entry((self.piece[row], self.piece[row])).or_default();
            self.add_wrenches(row, &sum, factor, own);
        }
        coupling
    }

    /// Z^T K Z.
    fn coupling(&self, tangent: &Tangent) -> Coupling {
        let mut coupling = Coupling::new();
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
            for (of, sum) in &sums {
                let block = coupling.entry((self.piece[row], *of)).or_default();
                self.add_wrenches(row, sum, 1.0, block);
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
                            let block = coupling.entry((*other, *of)).or_default();
                            for (r, row) in rows.iter().enumerate() {
                                block[c][r] += row.iter().zip(&stress).map(|(a, b)| a * b).sum::<f64>();
                            }
                        }
                    }
                }
            }
        }
        coupling
    }
}

impl Coarse {
    /// z += Z (Z^T K Z)^-1 Z^T r; returns r . z.
    pub(super) fn add<T: Real>(&mut self, r: &[Lanes<T>], z: &mut [Lanes<T>]) -> f64 {
        let Self { pieces, factor, loads, motion, .. } = self;
        by_tasks(1, loads.as_chunks_mut::<2>().0, |first, loads| {
            for (p, load) in (first..).zip(loads) {
                *load = [[0.0; 3]; 2];
                for &row in &pieces.rows[pieces.start[p]..pieces.start[p + 1]] {
                    let f = &r[row as usize];
                    let w = wrench(pieces.place[row as usize].map(f64::from), [f[0].wide(), f[1].wide(), f[2].wide()]);
                    for i in 0..3 {
                        load[0][i] += w[i];
                        load[1][i] += w[i + 3];
                    }
                }
            }
            []
        });
        factor.solve(loads, motion);
        let motion = motion.as_chunks::<2>().0;
        let [product] = by_rows(z, |first, rows| {
            for (row, out) in (first..).zip(rows.iter_mut()) {
                let ([shift, turn], d) = (&motion[pieces.piece[row] as usize], pieces.place[row].map(f64::from));
                let turned =
                    [turn[1] * d[2] - turn[2] * d[1], turn[2] * d[0] - turn[0] * d[2], turn[0] * d[1] - turn[1] * d[0]];
                let held = pieces.is_held(row);
                for i in (0..3).filter(|&i| !held[i]) {
                    out[i] += T::of(shift[i] + turned[i]);
                }
            }
            [dot(&r[first..], rows)]
        });
        product
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_taken_anew_are_a_correction_made_anew_where_the_body_is_the_same() {
        // A chain of 2000 rows in space, each tied to the next one.
        let rows = 2000_usize;
        let (mut pattern, mut body) =
            (BlockPattern { row_start: vec![0], columns: Vec::new(), diagonal: Vec::new() }, Vec::new());
        let diagonal = |x: f64| std::array::from_fn(|n| if n % 4 == 0 { x } else { 0.0 });
        for row in 0..rows {
            for column in [row.wrapping_sub(1), row, row + 1].into_iter().filter(|&c| c < rows) {
                if column == row {
                    pattern.diagonal.push(pattern.columns.len() as u32);
                }
                pattern.columns.push(column as u32);
                body.push(diagonal(if column == row { 2.1 } else { -1.0 }));
            }
            pattern.row_start.push(pattern.columns.len());
        }
        let pattern = Arc::new(pattern);
        let before = |pushed: &dyn Fn(usize) -> f64| {
            let mut matrix = BlockMatrix { pattern: Arc::clone(&pattern), blocks: body.clone() };
            let mut walls = Vec::new();
            for row in (0..rows).filter(|&row| pushed(row) > 0.0) {
                let mut block = diagonal(0.0);
                block[4] = pushed(row);
                matrix.blocks[pattern.diagonal[row] as usize][4] += pushed(row);
                walls.push((row as u32, block));
            }
            Tangent { matrix, nodal: None, walls }
        };
        let place = |row: usize| [row as f64, (row as f64 * 0.37).sin() * 20.0, (row as f64 * 0.21).cos() * 30.0];
        let at = Rows { positions: (0..rows).map(place).collect(), held: None, change: true };
        let first = before(&|row| if row % 3 == 0 { 40.0 } else { 0.0 });
        let second = before(&|row| if row > 900 { 90.0 } else { 0.0 });
        let residual: Vec<Lanes<f64>> = (0..rows).map(|row| [(row as f64).sin(), 1.0, -0.5, 0.0]).collect();
        let corrected = |coarse: Option<Coarse>| {
            let mut z = vec![[0.0; 4]; rows];
            coarse.unwrap().add(&residual, &mut z);
            z
        };
        let size = |z: &[Lanes<f64>]| dot(z, z).sqrt();
        let apart = |a: &[Lanes<f64>], b: &[Lanes<f64>]| {
            size(&a.iter().zip(b).map(|(a, b)| std::array::from_fn(|i| a[i] - b[i])).collect::<Vec<_>>())
        };
        let old = corrected(Coarse::new(&first, &at));
        let whole = corrected(Coarse::new(&second, &at));
        let walls = corrected(Coarse::new(&first, &at).unwrap().before_walls(&second));
        let renewed = corrected(Coarse::new(&first, &at).unwrap().renewed(&second));
        assert!(apart(&walls, &whole) < 1e-9 * size(&whole) && apart(&renewed, &whole) < 1e-9 * size(&whole));
        assert!(apart(&old, &whole) > 0.1 * size(&whole), "the walls make a difference");
    }
}
