//! Jacobi preconditioners: the inverse of the diagonal, entry by entry or 3 x 3 block by block.

use super::operator::{Lanes, Real};
use super::system::Tangent;
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Inverse diagonal blocks, column-major in four lanes.
pub(super) struct BlockJacobi<T> {
    inverse: Vec<[Lanes<T>; 3]>,
}

impl<T: Real> BlockJacobi<T> {
    /// With `blocks` false only the diagonal entries are used.
    pub(super) fn new(tangent: &Tangent, blocks: bool) -> Self {
        let inverse = tangent
            .diagonal_blocks()
            .into_par_iter()
            .with_min_len(256)
            .map(|block| {
                let block = Matrix3::from_column_slice(&block);
                let diagonal =
                    || Matrix3::from_diagonal(&block.diagonal().map(|d| if d > 0.0 { 1.0 / d } else { 1.0 }));
                // An indefinite diagonal block (a tangent that is not positive definite) would break the iteration.
                let inverse = if blocks && block.cholesky().is_some() {
                    block.try_inverse().unwrap_or_else(diagonal)
                } else {
                    diagonal()
                };
                std::array::from_fn(|c| {
                    std::array::from_fn(|r| if r < 3 { T::of(inverse[(r, c)]) } else { T::default() })
                })
            })
            .collect();
        Self { inverse }
    }

    /// z = D^-1 r of the rows from `first` on.
    pub(super) fn apply(&self, first: usize, r: &[Lanes<T>], z: &mut [Lanes<T>]) {
        for ((d, r), out) in self.inverse[first..].iter().zip(r).zip(z) {
            for lane in 0..4 {
                out[lane] = d[0][lane] * r[0] + d[1][lane] * r[1] + d[2][lane] * r[2];
            }
        }
    }
}
