//! How large the tets shall be, where.

use crate::mesh::label_field::LabelField;
use crate::mesh::optimise::Point;

/// Target edge length in mm on a coarse grid over the box of a `LabelField`, trilinear between, x fastest.
#[derive(Clone, Debug)]
pub(crate) struct EdgeField {
    pub dims: [usize; 3],
    pub spacing_mm: [f64; 3],
    pub edge_mm: Vec<f32>,
}

impl EdgeField {
    /// The same edge everywhere.
    pub fn uniform(edge_mm: f64) -> Self {
        Self { dims: [1; 3], spacing_mm: [1.0; 3], edge_mm: vec![edge_mm as f32] }
    }
}

/// Points on the interfaces: up to `per_part` on the border of every connected part of every field, so that no part is
/// missed.
pub(crate) fn interface_seeds(field: &LabelField, per_part: usize) -> Vec<Point> {
    let [nx, ny, nz] = field.dims();
    let largest = field.largest();
    let spacing = field.spacing_mm();
    let mut seen = vec![false; largest.len()];
    let mut seeds = Vec::new();
    let (mut part, mut border) = (Vec::new(), Vec::new());
    for start in 0..largest.len() {
        if seen[start] || largest[start] == 0 {
            continue;
        }
        seen[start] = true;
        part.push(start);
        border.clear();
        while let Some(v) = part.pop() {
            let c = [v % nx, v / nx % ny, v / (nx * ny)];
            let steps = [(1, c[0], nx, 0), (nx, c[1], ny, 1), (nx * ny, c[2], nz, 2)];
            for (stride, at, n, axis) in steps {
                for (go, next, sign) in [(at > 0, v.wrapping_sub(stride), -1.0), (at + 1 < n, v + stride, 1.0)] {
                    if !go {
                        continue;
                    }
                    if largest[next] != largest[v] {
                        border.push((v, axis, sign));
                    } else if !seen[next] {
                        seen[next] = true;
                        part.push(next);
                    }
                }
            }
        }
        border.sort_by_key(|b| b.0);
        let count = per_part.min(border.len());
        for n in 0..count {
            let (v, axis, sign) = border[n * border.len() / count];
            let c = [v % nx, v / nx % ny, v / (nx * ny)];
            let p = Point::from(std::array::from_fn::<f64, 3, _>(|a| c[a] as f64 * spacing[a]));
            let mut step = Point::zeros();
            step[axis] = sign * spacing[axis];
            let (mut near, mut far) = (0.0, 1.0);
            for _ in 0..12 {
                let middle = 0.5 * (near + far);
                if field.field_at(&(p + step * middle)) == largest[v] {
                    near = middle;
                } else {
                    far = middle;
                }
            }
            seeds.push(p + step * (0.5 * (near + far)));
        }
    }
    seeds
}
