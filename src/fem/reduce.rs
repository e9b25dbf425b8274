//! Work in tasks of rows, and sums whose rounding does not depend on the number of threads: the tasks follow from the
//! number of rows alone and are added in order.
//!
//! Each has one loop for every caller: woven into rayon's own code it would be compiled anew for every one of them.

use rayon::prelude::*;
use std::ops::Range;

/// Most rows of a task.
pub(super) const CHUNK: usize = 1024;

/// Rows of a task: a sixteenth of all, which a few threads share evenly, unless that is too little for a task to be
/// worth it or more than a cache holds.
fn rows_of_task(n: usize) -> usize {
    n.div_ceil(16).clamp(64, CHUNK)
}

/// Sum of `term(range)` over the tasks of 0..n.
pub(super) fn chunked(n: usize, term: impl Fn(Range<usize>) -> f64 + Sync) -> f64 {
    sum_of_tasks(n, &term)
}

fn sum_of_tasks(n: usize, term: &(dyn Fn(Range<usize>) -> f64 + Sync)) -> f64 {
    let rows = rows_of_task(n);
    let range = |task: usize| task * rows..n.min((task + 1) * rows);
    if n <= 4 * CHUNK || rayon::current_num_threads() == 1 {
        return (0..n.div_ceil(rows)).map(|task| term(range(task))).sum();
    }
    let parts: Vec<f64> = (0..n.div_ceil(rows)).into_par_iter().map(|task| term(range(task))).collect();
    parts.iter().sum()
}

/// Runs `f(first row, rows)` over the tasks of a slice, on threads when there are any; what they return is added.
pub(super) fn by_rows<A: Send, const N: usize>(
    rows: &mut [A],
    f: impl Fn(usize, &mut [A]) -> [f64; N] + Sync,
) -> [f64; N] {
    by_tasks(rows_of_task(rows.len()), rows, f)
}

/// The same with so many rows a task, for rows that are more than a few numbers.
pub(super) fn by_tasks<A: Send, const N: usize>(
    rows_of_task: usize,
    rows: &mut [A],
    f: impl Fn(usize, &mut [A]) -> [f64; N] + Sync,
) -> [f64; N] {
    // A vector of nothing takes no memory.
    pairs(rows_of_task, rows, &mut vec![(); rows.len()], &|first, rows, _| f(first, rows))
}

/// [`by_rows`] over two slices of equal length.
pub(super) fn by_row_pairs<A: Send, B: Send, const N: usize>(
    a: &mut [A],
    b: &mut [B],
    f: impl Fn(usize, &mut [A], &mut [B]) -> [f64; N] + Sync,
) -> [f64; N] {
    pairs(rows_of_task(a.len()), a, b, &f)
}

/// What is done with a task's rows of two slices, given their first row.
type PairOfRows<'a, A, B, const N: usize> = dyn Fn(usize, &mut [A], &mut [B]) -> [f64; N] + Sync + 'a;

fn pairs<A: Send, B: Send, const N: usize>(
    rows: usize,
    a: &mut [A],
    b: &mut [B],
    f: &PairOfRows<'_, A, B, N>,
) -> [f64; N] {
    let add = |sum: [f64; N], part: [f64; N]| std::array::from_fn(|i| sum[i] + part[i]);
    if a.len() <= rows || rayon::current_num_threads() == 1 {
        let tasks = a.chunks_mut(rows).zip(b.chunks_mut(rows)).enumerate();
        return tasks.map(|(task, (a, b))| f(task * rows, a, b)).fold([0.0; N], add);
    }
    let tasks = a.par_chunks_mut(rows).zip(b.par_chunks_mut(rows)).enumerate();
    let parts: Vec<[f64; N]> = tasks.map(|(task, (a, b))| f(task * rows, a, b)).collect();
    parts.into_iter().fold([0.0; N], add)
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
