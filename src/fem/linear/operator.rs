//! The tangent packed for the iteration: single or double precision, four lanes per node.

use super::super::sparse::BlockPattern;
use super::Tangent;
use rayon::prelude::*;
use std::sync::Arc;

/// Arithmetic of an iteration.
pub(super) trait Real:
    Copy
    + Send
    + Sync
    + Default
    + std::ops::Add<Output = Self>
    + std::ops::Sub<Output = Self>
    + std::ops::Mul<Output = Self>
    + std::ops::AddAssign
{
    fn of(value: f64) -> Self;
    fn wide(self) -> f64;
}

impl Real for f32 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as Self
    }
    #[inline(always)]
    fn wide(self) -> f64 {
        f64::from(self)
    }
}

impl Real for f64 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn wide(self) -> f64 {
        self
    }
}

/// A 3-vector in four lanes; the last one is zero.
pub(super) type Lanes<T> = [T; 4];

/// Rows per task: small enough to share, large enough to be worth a thread.
const ROWS: usize = 1024;

/// The packed tangent.
pub(super) struct Operator<T> {
    pattern: Arc<BlockPattern>,
    /// Column-major blocks, nine after nine, and one value more: a column is read as four lanes.
    packed: Vec<T>,
    dilation: Option<PackedDilation<T>>,
}

struct PackedDilation<T> {
    row_start: Vec<usize>,
    rows: Vec<u32>,
    values: Vec<Lanes<T>>,
    /// Square root of weights is not taken: weights may be negative.
    weights: Vec<T>,
    group_start: Vec<usize>,
    group_positions: Vec<(u32, u32)>,
    inner: Vec<T>,
}

/// Runs `f(first row, rows)` over slices, on threads when there are any.
pub(super) fn by_rows<A: Send>(out: &mut [A], f: impl Fn(usize, &mut [A]) + Sync) {
    if rayon::current_num_threads() == 1 || out.len() <= ROWS {
        f(0, out);
    } else {
        out.par_chunks_mut(ROWS).enumerate().for_each(|(chunk, rows)| f(chunk * ROWS, rows));
    }
}

#[inline(always)]
fn add_scaled<T: Real>(sum: &mut Lanes<T>, column: &[T], factor: T) {
    for lane in 0..4 {
        sum[lane] += column[lane] * factor;
    }
}

impl<T: Real> Operator<T> {
    pub(super) fn new(tangent: &Tangent) -> Self {
        let mut packed: Vec<T> = Vec::with_capacity(9 * tangent.matrix.blocks.len() + 1);
        packed.extend(tangent.matrix.blocks.iter().flatten().map(|&v| T::of(v)));
        packed.push(T::default());
        let dilation = tangent.dilation.as_ref().map(|d| PackedDilation {
            row_start: d.row_start.clone(),
            rows: d.rows.clone(),
            values: d.values.iter().map(|v| [T::of(v[0]), T::of(v[1]), T::of(v[2]), T::default()]).collect(),
            weights: d.weights.iter().map(|&w| T::of(w)).collect(),
            group_start: d.group_start.clone(),
            group_positions: d.group_positions.clone(),
            inner: vec![T::default(); d.weights.len()],
        });
        Self { pattern: Arc::clone(&tangent.matrix.pattern), packed, dilation }
    }

    pub(super) fn rows(&self) -> usize {
        self.pattern.rows()
    }

    /// y = A p.
    pub(super) fn apply(&mut self, p: &[Lanes<T>], y: &mut [Lanes<T>]) {
        let (pattern, packed) = (&*self.pattern, &self.packed);
        if let Some(d) = &mut self.dilation {
            let (row_start, rows, values, weights) = (&d.row_start, &d.rows, &d.values, &d.weights);
            by_rows(&mut d.inner, |first, inner| {
                for (g, out) in (first..).zip(inner) {
                    let range = row_start[g]..row_start[g + 1];
                    let mut sum = [T::default(); 4];
                    for (&row, v) in rows[range.clone()].iter().zip(&values[range]) {
                        let x = &p[row as usize];
                        for lane in 0..4 {
                            sum[lane] += v[lane] * x[lane];
                        }
                    }
                    *out = (sum[0] + sum[1] + sum[2]) * weights[g];
                }
            });
        }
        let dilation = self.dilation.as_ref();
        by_rows(y, |first, rows| {
            for (row, out) in (first..).zip(rows) {
                let range = pattern.row_start[row]..pattern.row_start[row + 1];
                let values = &packed[9 * range.start..=9 * range.end];
                let mut sum = [T::default(); 4];
                for (k, &column) in pattern.columns[range].iter().enumerate() {
                    let x = &p[column as usize];
                    let block = &values[9 * k..9 * k + 10];
                    add_scaled(&mut sum, &block[0..4], x[0]);
                    add_scaled(&mut sum, &block[3..7], x[1]);
                    add_scaled(&mut sum, &block[6..10], x[2]);
                }
                if let Some(d) = dilation {
                    for &(g, at) in &d.group_positions[d.group_start[row]..d.group_start[row + 1]] {
                        add_scaled(&mut sum, &d.values[at as usize], d.inner[g as usize]);
                    }
                }
                // The fourth lane held the neighbour block's first entry.
                sum[3] = T::default();
                *out = sum;
            }
        });
    }
}
