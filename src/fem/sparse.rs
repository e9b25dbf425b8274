//! Symmetric sparse matrices of 3 x 3 blocks over the free nodes, on a pattern that is built once per model.

use super::order::Graph;
use rayon::prelude::*;
use std::sync::Arc;

/// A 3 x 3 block, column-major.
pub(super) type Block = [f64; 9];

/// No position: the row or the column is held.
pub(super) const HELD: u32 = u32::MAX;

/// Rows of blocks in compressed form; columns ascend within a row and the diagonal is always there.
#[derive(Debug)]
pub(super) struct BlockPattern {
    pub row_start: Vec<usize>,
    pub columns: Vec<u32>,
    pub diagonal: Vec<u32>,
}

impl BlockPattern {
    /// The pattern of the free nodes of a graph; `row_of` gives every node its row, or [`HELD`], ascending.
    pub(super) fn new(graph: &Graph, row_of: &[u32]) -> Self {
        let (mut row_start, mut columns, mut diagonal) = (vec![0], Vec::new(), Vec::new());
        for node in (0..graph.len()).filter(|&n| row_of[n] != HELD) {
            let from = columns.len();
            columns.push(row_of[node]);
            columns.extend(graph.of(node).iter().map(|&m| row_of[m as usize]).filter(|&r| r != HELD));
            columns[from..].sort_unstable();
            let own = columns[from..].binary_search(&row_of[node]).unwrap_or(0);
            diagonal.push((from + own) as u32);
            row_start.push(columns.len());
        }
        Self { row_start, columns, diagonal }
    }

    pub(super) fn rows(&self) -> usize {
        self.diagonal.len()
    }

    /// Where block (row, column) is stored, or [`HELD`].
    pub(super) fn position(&self, row: u32, column: u32) -> u32 {
        if row == HELD || column == HELD {
            return HELD;
        }
        let from = self.row_start[row as usize];
        let found = self.columns[from..self.row_start[row as usize + 1]].binary_search(&column);
        found.map_or(HELD, |at| (from + at) as u32)
    }
}

/// Values on a pattern.
#[derive(Clone, Debug)]
pub(super) struct BlockMatrix {
    pub pattern: Arc<BlockPattern>,
    pub blocks: Vec<Block>,
}

impl BlockMatrix {
    pub(super) fn zero(pattern: Arc<BlockPattern>) -> Self {
        let blocks = vec![[0.0; 9]; pattern.columns.len()];
        Self { pattern, blocks }
    }

    /// y = A x, each row summed in the order of its columns whatever the threads.
    pub(super) fn product(&self, x: &[[f64; 3]], y: &mut [[f64; 3]]) {
        let pattern = &*self.pattern;
        y.par_iter_mut().with_min_len(2048).enumerate().for_each(|(row, out)| {
            let range = pattern.row_start[row]..pattern.row_start[row + 1];
            let mut sum = [0.0; 3];
            for (block, &column) in self.blocks[range.clone()].iter().zip(&pattern.columns[range]) {
                let p = x[column as usize];
                for c in 0..3 {
                    for r in 0..3 {
                        sum[r] += block[3 * c + r] * p[c];
                    }
                }
            }
            *out = sum;
        });
    }

    /// Holds single components: their rows and columns become those of a scaled identity (Baraff and Witkin's filter
    /// written into the matrix). `held[row]` says which components of a row are held.
    pub(super) fn hold_components(&mut self, held: &[[bool; 3]]) {
        let pattern = Arc::clone(&self.pattern);
        for row in 0..pattern.rows() {
            for at in pattern.row_start[row]..pattern.row_start[row + 1] {
                let column = pattern.columns[at] as usize;
                for c in 0..3 {
                    for r in 0..3 {
                        let on_diagonal = row == column && r == c;
                        if (held[row][r] || held[column][c]) && !on_diagonal {
                            self.blocks[at][3 * c + r] = 0.0;
                        }
                    }
                }
            }
        }
    }
}
