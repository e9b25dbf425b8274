//! What the mesh does to the estimate, from a coarser mesh of the same body.
//!
//! The displacement of a mesh of edge h is off by about c h^p. Two meshes give c (Richardson, Philosophical Transactions A
//! 226, 1927), and the estimate's own linearisation what that does to the parameters. Stiffness jumps at tissue borders that
//! the mesh follows in steps, so p is taken to be 1: a smooth body's 2 would promise too much.

use crate::mesh::TetMesh;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rayon::prelude::*;

/// Displacement (mm) of a mesh at places (mm): interpolated where a tetrahedron holds the place, the nearest node's elsewhere.
pub fn at_places(mesh: &TetMesh, displacement_mm: &[[f64; 3]], places_mm: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let node = |n: u32| Vector3::from(mesh.nodes_mm()[n as usize]);
    let value = |n: u32| Vector3::from(displacement_mm[n as usize]);
    let at = |place: &[f64; 3]| -> [f64; 3] {
        let x = Vector3::from(*place);
        for tet in mesh.tets() {
            let corners = tet.map(node);
            // A place outside the corners' box is in no tetrahedron.
            let apart = |a: usize| corners.iter().all(|c| c[a] < x[a]) || corners.iter().all(|c| c[a] > x[a]);
            if (0..3).any(apart) {
                continue;
            }
            let edges = [1, 2, 3].map(|k| corners[k] - corners[0]);
            let Some(inverse) = Matrix3::from_columns(&edges).try_inverse() else { continue };
            let b = inverse * (x - corners[0]);
            let weight = [1.0 - b.sum(), b.x, b.y, b.z];
            if weight.iter().all(|w| *w >= -1e-9) {
                return (0..4).map(|k| value(tet[k]) * weight[k]).sum::<Vector3<f64>>().into();
            }
        }
        let nearer = |best: u32, n: u32| if (node(n) - x).norm() < (node(best) - x).norm() { n } else { best };
        value((0..mesh.nodes_mm().len() as u32).fold(0, nearer)).into()
    };
    places_mm.par_iter().map(at).collect()
}

/// How many times the difference between the two meshes the finer one is off: 1 / (ratio of the edges - 1).
pub fn left_of_difference(fine: &TetMesh, coarse: &TetMesh) -> f64 {
    let ratio = (fine.tets().len() as f64 / coarse.tets().len().max(1) as f64).cbrt();
    1.0 / (ratio - 1.0).max(0.1)
}

/// The change of the first `own` parameters that makes up for a change of the model's displacement, in the linearised
/// problem: residuals are independent and of standard deviation 1. `None` where that problem has no solution in numbers: no
/// change found is not a change of nothing.
pub fn made_up_by(
    jacobian: &DMatrix<f64>,
    precision: &DMatrix<f64>,
    change: &DVector<f64>,
    own: usize,
) -> Option<Vec<f64>> {
    let hessian = jacobian.transpose() * jacobian + precision;
    let step = hessian.cholesky()?.solve(&(jacobian.transpose() * change));
    step.iter().all(|s| s.is_finite()).then(|| step.as_slice()[..own].to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;

    #[test]
    fn a_linear_displacement_is_the_same_on_either_mesh() {
        let linear = |x: &[f64; 3]| [0.1 * x[0] - 0.3 * x[1], 0.2 * x[2], 1.0 + 0.05 * x[0]];
        let mesh = block(3);
        let u: Vec<[f64; 3]> = mesh.nodes_mm().iter().map(linear).collect();
        let places = [[4.0, 7.0, 11.0], [0.0, 0.0, 0.0], [29.0, 13.0, 1.0]];
        for (found, place) in at_places(&mesh, &u, &places).iter().zip(&places) {
            assert!((0..3).all(|a| (found[a] - linear(place)[a]).abs() < 1e-12), "{found:?}");
        }
    }

    #[test]
    fn a_change_along_a_parameter_is_made_up_for_by_it_alone() {
        let jacobian = DMatrix::from_fn(40, 3, |r, c| f64::from(((r * (c + 2) + c) % 7) as u32) - 2.5);
        let change = jacobian.column(1) * 0.2;
        let made = made_up_by(&jacobian, &DMatrix::zeros(3, 3), &change, 2).unwrap();
        assert!(made[0].abs() < 1e-12 && (made[1] - 0.2).abs() < 1e-12, "{made:?}");
    }

    #[test]
    fn a_change_that_cannot_be_solved_for_is_not_taken_for_none() {
        let (change, none) = (DVector::from_element(6, 0.2), DMatrix::zeros(6, 2));
        assert_eq!(made_up_by(&none, &DMatrix::zeros(2, 2), &change, 2), None);
        assert_eq!(made_up_by(&none, &DMatrix::identity(2, 2), &change, 2), Some(vec![0.0; 2]));
        assert_eq!(made_up_by(&none, &DMatrix::identity(2, 2), &(change * f64::NAN), 2), None);
    }
}
