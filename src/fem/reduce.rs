//! Sums whose rounding does not depend on the number of threads: fixed chunks, added in order.

use rayon::prelude::*;

/// Rows per partial sum; a constant, so that every machine adds in the same order.
pub(super) const CHUNK: usize = 1024;

/// Sum of `term(range)` over fixed chunks of 0..n.
pub(super) fn chunked(n: usize, term: impl Fn(std::ops::Range<usize>) -> f64 + Sync) -> f64 {
    let range = |chunk: usize| chunk * CHUNK..n.min((chunk + 1) * CHUNK);
    if n <= 4 * CHUNK || rayon::current_num_threads() == 1 {
        return (0..n.div_ceil(CHUNK)).map(|c| term(range(c))).sum();
    }
    let parts: Vec<f64> = (0..n.div_ceil(CHUNK)).into_par_iter().map(|c| term(range(c))).collect();
    parts.iter().sum()
}

/// a . b over 3-vectors.
pub(super) fn dot(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    chunked(a.len(), |range| {
        a[range.clone()].iter().zip(&b[range]).map(|(x, y)| x[0] * y[0] + x[1] * y[1] + x[2] * y[2]).sum()
    })
}

/// Euclidean norm.
pub(super) fn norm(a: &[[f64; 3]]) -> f64 {
    dot(a, a).sqrt()
}
