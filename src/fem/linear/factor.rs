//! The tangent multiplied out and factored, LL^T by faer on a nested-dissection ordering.

use super::super::element::Rings;
use super::super::sparse::BlockPattern;
use super::dissection::nested_dissection;
use super::system::Tangent;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::Perm;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};
use std::sync::Arc;

/// Where the entries of a tangent go in the factor, and in which order it is eliminated: found once per model.
pub(in super::super) struct Symbolic {
    /// All couplings, those through nodal averages included.
    pattern: BlockPattern,
    /// Scalar compressed columns of the lower triangle.
    column_start: Vec<usize>,
    rows: Vec<usize>,
    cholesky: SymbolicCholesky<usize>,
}

/// A factor LL^T.
pub(super) struct Factor {
    symbolic: Arc<Symbolic>,
    values: Vec<f64>,
    memory: MemBuffer,
    work: Vec<f64>,
}

/// The pattern with every two rows coupled that share a group.
fn with_rings(pattern: &BlockPattern, rings: Option<&Rings>) -> BlockPattern {
    let (mut row_start, mut columns, mut diagonal) = (vec![0], Vec::new(), Vec::new());
    let mut seen = vec![u32::MAX; pattern.rows()];
    for row in 0..pattern.rows() {
        let from = columns.len();
        let mut add = |m: u32| {
            if seen[m as usize] != row as u32 {
                seen[m as usize] = row as u32;
                columns.push(m);
            }
        };
        pattern.columns[pattern.row_start[row]..pattern.row_start[row + 1]].iter().for_each(|&m| add(m));
        if let Some(rings) = rings {
            for &g in &rings.groups[rings.group_start[row]..rings.group_start[row + 1]] {
                let range = rings.row_start[g as usize]..rings.row_start[g as usize + 1];
                rings.rows[range].iter().for_each(|&m| add(m));
            }
        }
        columns[from..].sort_unstable();
        diagonal.push((from + columns[from..].partition_point(|&m| (m as usize) < row)) as u32);
        row_start.push(columns.len());
    }
    BlockPattern { row_start, columns, diagonal }
}

impl Symbolic {
    /// `positions` are those of the rows' nodes. `None` when the factor would not fit into memory.
    pub(in super::super) fn new(pattern: &BlockPattern, rings: Option<&Rings>, positions: &[[f64; 3]]) -> Option<Self> {
        let pattern = with_rings(pattern, rings);
        let order = nested_dissection(&pattern, positions);
        let n = 3 * pattern.rows();
        let forward: Vec<usize> = order.iter().flat_map(|&row| [0, 1, 2].map(|i| 3 * row as usize + i)).collect();
        let mut inverse = vec![0; n];
        forward.iter().enumerate().for_each(|(new, &old)| inverse[old] = new);
        let permutation = Perm::new_checked(forward.into(), inverse.into(), n);
        let (mut column_start, mut rows) = (vec![0], Vec::new());
        for block in 0..pattern.rows() {
            for c in 0..3 {
                rows.extend((c..3).map(|r| 3 * block + r));
                for &below in &pattern.columns[pattern.diagonal[block] as usize + 1..pattern.row_start[block + 1]] {
                    rows.extend((0..3).map(|r| 3 * below as usize + r));
                }
                column_start.push(rows.len());
            }
        }
        let matrix = SymbolicSparseColMatRef::new_checked(n, n, &column_start, None, &rows);
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::AUTO,
            ..CholeskySymbolicParams::default()
        };
        let ordering = SymmetricOrdering::Custom(permutation.as_ref());
        let cholesky = factorize_symbolic_cholesky(matrix, Side::Lower, ordering, params).ok()?;
        Some(Self { pattern, column_start, rows, cholesky })
    }

    /// The lower triangle, column by column.
    fn values(&self, tangent: &Tangent) -> Vec<f64> {
        let mut values = vec![0.0; self.rows.len()];
        // Of block column j the scalar column c starts with 3 - c entries of the diagonal block.
        let place = |column: usize, nth_below: usize, r: usize, c: usize| {
            let start = self.column_start[3 * column + c];
            if nth_below == 0 { start + r - c } else { start + 3 - c + 3 * (nth_below - 1) + r }
        };
        let matrix = &tangent.matrix;
        for column in 0..matrix.pattern.rows() {
            let diagonal = self.pattern.diagonal[column] as usize;
            let below = &self.pattern.columns[diagonal..self.pattern.row_start[column + 1]];
            // Row j of the symmetric matrix right of the diagonal is column j below it, transposed.
            for at in matrix.pattern.diagonal[column] as usize..matrix.pattern.row_start[column + 1] {
                let nth = below.partition_point(|&m| m < matrix.pattern.columns[at]);
                for c in 0..3 {
                    for r in (if nth == 0 { c } else { 0 })..3 {
                        values[place(column, nth, r, c)] += matrix.blocks[at][3 * r + c];
                    }
                }
            }
        }
        let Some(nodal) = &tangent.nodal else { return values };
        let rings = &*nodal.rings;
        let held = |row: usize| nodal.held.as_ref().map_or([false; 3], |h| h[row]);
        for (g, moduli) in nodal.moduli.iter().enumerate() {
            let range = rings.row_start[g]..rings.row_start[g + 1];
            for j in range.clone() {
                let (column, bj) = (rings.rows[j] as usize, rings.gradients[j]);
                let below =
                    &self.pattern.columns[self.pattern.diagonal[column] as usize..self.pattern.row_start[column + 1]];
                // moduli . b_j: three columns of nine.
                let mut half = [[0.0; 9]; 3];
                for (k, half) in half.iter_mut().enumerate() {
                    for d in 0..3 {
                        let from = 9 * (k + 3 * d);
                        (0..9).for_each(|i| half[i] += bj[d] * moduli[from + i]);
                    }
                }
                // Rows of a group ascend, so what follows j lies below it.
                for i in j..range.end {
                    let (row, bi) = (rings.rows[i] as usize, rings.gradients[i]);
                    let nth = below.partition_point(|&m| (m as usize) < row);
                    for c in (0..3).filter(|&c| row == column || !held(column)[c]) {
                        for r in (if nth == 0 { c } else { 0 })..3 {
                            if (held(row)[r] || held(column)[c]) && !(row == column && r == c) {
                                continue;
                            }
                            let entry = bi[0] * half[c][r] + bi[1] * half[c][r + 3] + bi[2] * half[c][r + 6];
                            values[place(column, nth, r, c)] += entry;
                        }
                    }
                }
            }
        }
        values
    }
}

impl Factor {
    /// Its order and pattern.
    pub(super) fn symbolic(&self) -> &Arc<Symbolic> {
        &self.symbolic
    }

    /// `None` when the tangent is not positive definite. One thread, so that the bytes do not depend on their number.
    pub(super) fn new(symbolic: &Arc<Symbolic>, tangent: &Tangent) -> Option<Self> {
        let n = 3 * symbolic.pattern.rows();
        let entries = symbolic.values(tangent);
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &symbolic.column_start, None, &symbolic.rows);
        let matrix = SparseColMatRef::new(pattern, &entries);
        let mut values = vec![0.0; symbolic.cholesky.len_val()];
        let request = symbolic.cholesky.factorize_numeric_llt_scratch::<f64>(Par::Seq, faer::Spec::default());
        let mut memory = MemBuffer::try_new(request).ok()?;
        let done = symbolic.cholesky.factorize_numeric_llt(
            &mut values,
            matrix,
            Side::Lower,
            faer::linalg::cholesky::llt::factor::LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            faer::Spec::default(),
        );
        done.ok()?;
        let memory = MemBuffer::try_new(symbolic.cholesky.solve_in_place_scratch::<f64>(1, Par::Seq)).ok()?;
        Some(Self { symbolic: Arc::clone(symbolic), values, memory, work: vec![0.0; n] })
    }

    /// x = (LL^T)^-1 b.
    pub(super) fn solve(&mut self, b: &[[f64; 3]], x: &mut [[f64; 3]]) {
        self.work.copy_from_slice(b.as_flattened());
        let n = self.work.len();
        let rhs = MatMut::from_column_major_slice_mut(&mut self.work, n, 1);
        LltRef::new(&self.symbolic.cholesky, &self.values).solve_in_place_with_conj(
            Conj::No,
            rhs,
            Par::Seq,
            MemStack::new(&mut self.memory),
        );
        x.as_flattened_mut().copy_from_slice(&self.work);
    }
}
