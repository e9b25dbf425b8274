//! The tangent packed for the iteration: single or double precision, four lanes per node.

use super::super::element::{NodalTangent, Rings};
use super::super::reduce::by_rows;
use super::super::sparse::BlockPattern;
use super::system::Tangent;
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

/// A 3-vector in four lanes; what the last one holds means nothing: setting it would cost the compiler its vectors.
pub(super) type Lanes<T> = [T; 4];

/// The packed tangent.
pub(super) struct Operator<T> {
    pattern: Arc<BlockPattern>,
    /// Column-major blocks, nine after nine, and one value more: a column is read as four lanes.
    packed: Vec<T>,
    nodal: Option<PackedNodal<T>>,
}

/// The nodes' part: gradients and moduli of every group, and the stresses of the product under way.
struct PackedNodal<T> {
    rings: Arc<Rings>,
    held: Option<Arc<Vec<[bool; 3]>>>,
    gradients: Vec<Lanes<T>>,
    gradients_of_row: Vec<Lanes<T>>,
    /// Nine columns of three lanes each.
    moduli: Vec<[[Lanes<T>; 3]; 9]>,
    stresses: Vec<[Lanes<T>; 3]>,
}

impl<T: Real> PackedNodal<T> {
    fn new(tangent: &NodalTangent) -> Self {
        let zero = [T::default(); 4];
        Self {
            rings: Arc::clone(&tangent.rings),
            held: tangent.held.clone(),
            gradients: tangent.rings.gradients.iter().map(lanes).collect(),
            gradients_of_row: tangent.rings.gradients_of_row.iter().map(lanes).collect(),
            moduli: vec![[[zero; 3]; 9]; tangent.moduli.len()],
            stresses: vec![[zero; 3]; tangent.moduli.len()],
        }
    }

    fn take_up(&mut self, tangent: &NodalTangent) {
        let column = |column: &[f64; 9]| -> [Lanes<T>; 3] {
            std::array::from_fn(|c| lanes(&[column[3 * c], column[3 * c + 1], column[3 * c + 2]]))
        };
        by_rows(&mut self.moduli, |first, moduli| {
            for (out, m) in moduli.iter_mut().zip(&tangent.moduli[first..]) {
                *out = std::array::from_fn(|k| column(&m.as_chunks::<9>().0[k]));
            }
            []
        });
    }

    /// Stress of every group for the displacements p.
    fn stretch(&mut self, p: &[Lanes<T>]) {
        let (rings, gradients, moduli) = (&*self.rings, &self.gradients, &self.moduli);
        by_rows(&mut self.stresses, |first, stresses| {
            for (g, out) in (first..).zip(stresses) {
                let range = rings.row_start[g]..rings.row_start[g + 1];
                let h = displacement_gradient(&rings.rows[range.clone()], &gradients[range], p);
                *out = stress(&moduli[g], &h);
            }
            []
        });
    }

    /// Force on a row.
    #[inline(always)]
    fn add_force(&self, row: usize, sum: &mut Lanes<T>) {
        let range = self.rings.group_start[row]..self.rings.group_start[row + 1];
        let force = force(&self.rings.groups[range.clone()], &self.gradients_of_row[range], &self.stresses);
        let held = self.held.as_ref().map_or([false; 3], |h| h[row]);
        (0..3).filter(|&i| !held[i]).for_each(|i| sum[i] += force[i]);
    }
}

/// a . b in double precision, as far as the shorter one goes.
pub(super) fn dot<T: Real>(a: &[Lanes<T>], b: &[Lanes<T>]) -> f64 {
    let mut sum = [0.0; 4];
    for (x, y) in a.iter().zip(b) {
        for lane in 0..4 {
            sum[lane] += x[lane].wide() * y[lane].wide();
        }
    }
    sum[0] + sum[1] + sum[2]
}

fn lanes<T: Real>(v: &[f64; 3]) -> Lanes<T> {
    [T::of(v[0]), T::of(v[1]), T::of(v[2]), T::default()]
}

#[inline(always)]
fn add_scaled<T: Real>(sum: &mut Lanes<T>, column: &[T], factor: T) {
    for lane in 0..4 {
        sum[lane] += column[lane] * factor;
    }
}

// What follows is apart from what else happens to a row, so that the compiler keeps four lanes together, and has several sums:
// additions to one would wait for each other.

/// Gradient of the displacement of a group's nodes.
#[inline(never)]
fn displacement_gradient<T: Real>(rows: &[u32], gradients: &[Lanes<T>], p: &[Lanes<T>]) -> [Lanes<T>; 3] {
    let mut h = [[T::default(); 4]; 3];
    for (&row, b) in rows.iter().zip(gradients) {
        let x = &p[row as usize];
        for c in 0..3 {
            add_scaled(&mut h[c], x, b[c]);
        }
    }
    h
}

/// Stress of a group.
#[inline(never)]
fn stress<T: Real>(moduli: &[[Lanes<T>; 3]; 9], h: &[Lanes<T>; 3]) -> [Lanes<T>; 3] {
    let mut stress = [[T::default(); 4]; 3];
    for (k, column) in moduli.iter().enumerate() {
        for c in 0..3 {
            add_scaled(&mut stress[c], &column[c], h[k / 3][k % 3]);
        }
    }
    stress
}

/// Force of a row's groups on it.
#[inline(never)]
fn force<T: Real>(groups: &[u32], gradients: &[Lanes<T>], stresses: &[[Lanes<T>; 3]]) -> Lanes<T> {
    let mut sums = [[T::default(); 4]; 3];
    for (&g, b) in groups.iter().zip(gradients) {
        let stress = &stresses[g as usize];
        for c in 0..3 {
            add_scaled(&mut sums[c], &stress[c], b[c]);
        }
    }
    std::array::from_fn(|lane| sums[0][lane] + sums[1][lane] + sums[2][lane])
}

/// Blocks of one row times the entries of their columns.
#[inline(never)]
fn row_product<T: Real>(values: &[T], columns: &[u32], p: &[Lanes<T>]) -> Lanes<T> {
    let mut sums = [[T::default(); 4]; 3];
    for (k, &column) in columns.iter().enumerate() {
        let x = &p[column as usize];
        let block = &values[9 * k..9 * k + 10];
        add_scaled(&mut sums[0], &block[0..4], x[0]);
        add_scaled(&mut sums[1], &block[3..7], x[1]);
        add_scaled(&mut sums[2], &block[6..10], x[2]);
    }
    std::array::from_fn(|lane| sums[0][lane] + sums[1][lane] + sums[2][lane])
}

impl<T: Real> Operator<T> {
    pub(super) fn new(tangent: &Tangent) -> Self {
        let packed = vec![T::default(); 9 * tangent.matrix.blocks.len() + 1];
        let nodal = tangent.nodal.as_ref().map(PackedNodal::new);
        let mut operator = Self { pattern: Arc::clone(&tangent.matrix.pattern), packed, nodal };
        operator.take_up(tangent);
        operator
    }

    /// Another tangent of the same model.
    pub(super) fn take_up(&mut self, tangent: &Tangent) {
        by_rows(self.packed.as_chunks_mut::<9>().0, |first, blocks| {
            for (out, block) in blocks.iter_mut().zip(&tangent.matrix.blocks[first..]) {
                *out = block.map(T::of);
            }
            []
        });
        if let (Some(own), Some(nodal)) = (&mut self.nodal, &tangent.nodal) {
            own.take_up(nodal);
        }
    }

    pub(super) fn rows(&self) -> usize {
        self.pattern.rows()
    }

    /// y = A p; returns p . y.
    pub(super) fn apply(&mut self, p: &[Lanes<T>], y: &mut [Lanes<T>]) -> f64 {
        let (pattern, packed) = (&*self.pattern, &self.packed);
        if let Some(nodal) = &mut self.nodal {
            nodal.stretch(p);
        }
        let nodal = self.nodal.as_ref();
        let [curvature] = by_rows(y, |first, rows| {
            for (row, out) in (first..).zip(rows.iter_mut()) {
                let range = pattern.row_start[row]..pattern.row_start[row + 1];
                let values = &packed[9 * range.start..=9 * range.end];
                let mut sum = row_product(values, &pattern.columns[range], p);
                if let Some(nodal) = nodal {
                    nodal.add_force(row, &mut sum);
                }
                *out = sum;
            }
            [dot(&p[first..], rows)]
        });
        curvature
    }
}
