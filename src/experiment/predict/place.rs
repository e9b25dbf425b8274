//! Where in the mesh a point lies.

use crate::mesh::TetMesh;
use nalgebra::{Matrix3, Vector3};

/// A point by the nodes around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// The corners of its tetrahedron, or the nearest node four times.
    pub nodes: [u32; 4],
    /// Their weights.
    pub weights: [f64; 4],
    /// Distance to the mesh's nearest node, mm; 0 inside a tetrahedron.
    pub outside_mm: f64,
}

impl Found {
    /// A nodal vector at the point.
    pub fn at(&self, values: &[[f64; 3]]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (n, w) in self.nodes.iter().zip(self.weights) {
            (0..3).for_each(|i| sum[i] += w * values[*n as usize][i]);
        }
        sum
    }
}

/// Finds points in a mesh.
#[derive(Clone, Copy, Debug)]
pub struct Locator<'a>(pub &'a TetMesh);

impl Locator<'_> {
    /// The first tetrahedron that holds the point (mm), else the nearest node.
    pub fn find(&self, x_mm: [f64; 3]) -> Found {
        let nodes = self.0.nodes_mm();
        let x = Vector3::from(x_mm);
        for tet in self.0.tets() {
            let corner = tet.map(|n| Vector3::from(nodes[n as usize]));
            let low = |a: usize| corner.iter().map(|c| c[a]).fold(f64::INFINITY, f64::min);
            let high = |a: usize| corner.iter().map(|c| c[a]).fold(f64::NEG_INFINITY, f64::max);
            if (0..3).any(|a| x[a] < low(a) - 1e-9 || x[a] > high(a) + 1e-9) {
                continue;
            }
            let edges = Matrix3::from_columns(&[corner[1] - corner[0], corner[2] - corner[0], corner[3] - corner[0]]);
            let Some(inverse) = edges.try_inverse() else { continue };
            let b = inverse * (x - corner[0]);
            let weights = [1.0 - b.sum(), b.x, b.y, b.z];
            if weights.iter().all(|w| *w >= -1e-9) {
                return Found { nodes: *tet, weights, outside_mm: 0.0 };
            }
        }
        let distance = |n: usize| (Vector3::from(nodes[n]) - x).norm_squared();
        let nearest = (0..nodes.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap_or(0);
        Found { nodes: [nearest as u32; 4], weights: [0.25; 4], outside_mm: distance(nearest).sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;

    #[test]
    fn a_linear_field_is_exact_inside_and_the_nearest_nodes_outside() {
        let mesh = block(4);
        let values: Vec<[f64; 3]> = mesh.nodes_mm().iter().map(|x| [x[0] + 2.0 * x[1], x[2], 1.0]).collect();
        let middle =
            [0, 1, 2].map(|a| mesh.nodes_mm().iter().map(|x| x[a]).sum::<f64>() / mesh.nodes_mm().len() as f64);
        let x = [middle[0] + 1.3, middle[1] - 0.7, middle[2] + 2.1];
        let found = Locator(&mesh).find(x);
        let at = found.at(&values);
        assert!(found.outside_mm == 0.0 && (at[0] - x[0] - 2.0 * x[1]).abs() < 1e-9 && (at[1] - x[2]).abs() < 1e-9);
        let far = Locator(&mesh).find([1000.0, 0.0, 0.0]);
        assert!(far.outside_mm > 500.0 && (far.at(&values)[2] - 1.0).abs() < 1e-12);
    }
}
