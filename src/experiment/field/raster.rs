//! What the nodes of a mesh say at the voxels of a grid.

use crate::geometry::Frame;
use crate::image::Grid;
use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

/// Numbers at the voxels of a grid, i fastest.
#[derive(Clone, Debug)]
pub struct InTetrahedra<const N: usize> {
    /// Whether a voxel's centre lies in a tetrahedron.
    pub inside: Vec<bool>,
    /// The numbers there; 0 elsewhere.
    pub values: Vec<[f32; N]>,
}

impl<const N: usize> InTetrahedra<N> {
    /// The numbers of a voxel in a tetrahedron.
    pub fn at(&self, voxel: usize) -> Option<[f32; N]> {
        self.inside[voxel].then(|| self.values[voxel])
    }
}

/// `N` numbers of every node at the voxels whose centre lies in a tetrahedron, by the linear shape functions. Where
/// tetrahedra touch, the first in the list speaks.
pub fn in_tetrahedra<const N: usize, F: Frame>(
    tets: &[[u32; 4]],
    nodes_mm: &[[f64; 3]],
    values: &[[f64; N]],
    grid: &Grid<F>,
) -> InTetrahedra<N> {
    let (inside, values) = of_voxels(tets, nodes_mm, grid, [0f32; N], |t, weight| {
        let tet = tets[t as usize];
        std::array::from_fn(|c| tet.iter().zip(weight).map(|(&n, w)| w * values[n as usize][c]).sum::<f64>() as f32)
    });
    InTetrahedra { inside, values }
}

/// What `at` says, by the tetrahedron's number and the weights of its corners, at the voxels whose centre lies in one; `none`
/// elsewhere. Where tetrahedra touch, the first in the list speaks.
pub fn of_voxels<T: Copy + Send + Sync, F: Frame>(
    tets: &[[u32; 4]],
    nodes_mm: &[[f64; 3]],
    grid: &Grid<F>,
    none: T,
    at: impl Fn(u32, [f64; 4]) -> T + Sync,
) -> (Vec<bool>, Vec<T>) {
    let voxels: Vec<Point3<f64>> =
        nodes_mm.par_iter().map(|x| grid.voxel_from_mm().transform_point(&Point3::from(*x))).collect();
    let [nx, ny, nz] = grid.dims;
    let reach = |tet: &[u32; 4], axis: usize, size: usize| {
        let along = tet.map(|n| voxels[n as usize][axis]);
        let low = along.iter().copied().fold(f64::INFINITY, f64::min).ceil().max(0.0);
        let high = along.iter().copied().fold(f64::NEG_INFINITY, f64::max).floor();
        low as usize..((high + 1.0).max(0.0) as usize).min(size)
    };
    let mut of_plane: Vec<Vec<u32>> = vec![Vec::new(); nz];
    for (t, tet) in tets.iter().enumerate() {
        for k in reach(tet, 2, nz) {
            of_plane[k].push(t as u32);
        }
    }
    let (mut inside, mut found) = (vec![false; grid.len()], vec![none; grid.len()]);
    let plane = (nx * ny).max(1);
    let planes = inside.par_chunks_mut(plane).zip(found.par_chunks_mut(plane)).zip(&of_plane);
    planes.enumerate().for_each(|(k, ((inside, found), list))| {
        for &t in list {
            let tet = &tets[t as usize];
            let x = tet.map(|n| voxels[n as usize].coords);
            let edges = Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]);
            // A flat tetrahedron holds no voxel.
            let Some(barycentric) = edges.try_inverse() else { continue };
            for j in reach(tet, 1, ny) {
                for i in reach(tet, 0, nx) {
                    let place = i + nx * j;
                    if inside[place] {
                        continue;
                    }
                    let b = barycentric * (Vector3::new(i as f64, j as f64, k as f64) - x[0]);
                    let weight = [1.0 - b.sum(), b.x, b.y, b.z];
                    if weight.iter().all(|&w| w >= -1e-9) {
                        inside[place] = true;
                        found[place] = at(t, weight);
                    }
                }
            }
        }
    });
    (inside, found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;
    use crate::geometry::Mni;
    use nalgebra::{Matrix4, UnitQuaternion};

    #[test]
    fn a_linear_function_is_exact_on_a_turned_mirrored_grid_and_nothing_is_said_outside() {
        let mesh = block(3);
        let linear = |x: [f64; 3]| [0.1 * x[0] - 0.2 * x[2] + 1.0, x[1]];
        let values: Vec<[f64; 2]> = mesh.nodes_mm().iter().map(|x| linear(*x)).collect();
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.2, -0.3, 0.4)).to_homogeneous();
        // The grid's middle at the block's.
        let affine = Matrix4::new_translation(&Vector3::new(15.0, 14.0, 16.0))
            * turn
            * Matrix4::new_nonuniform_scaling(&Vector3::new(-3.0, 3.0, 3.0))
            * Matrix4::new_translation(&Vector3::new(-22.0, -22.0, -22.0));
        let grid = Grid::<Mni>::new([45; 3], affine).unwrap();
        let found = in_tetrahedra(mesh.tets(), mesh.nodes_mm(), &values, &grid);
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for x in mesh.nodes_mm() {
            for a in 0..3 {
                (low[a], high[a]) = (low[a].min(x[a]), high[a].max(x[a]));
            }
        }
        let mut inside = 0;
        for n in 0..grid.len() {
            let value = found.at(n);
            let p = grid.centre(grid.voxel(n)).mm;
            let deep = (0..3).all(|a| p[a] > low[a] + 1e-6 && p[a] < high[a] - 1e-6);
            let out = (0..3).any(|a| p[a] < low[a] - 1e-6 || p[a] > high[a] + 1e-6);
            assert!(value.is_some() || !deep, "{p}");
            assert!(value.is_none() || !out, "{p}");
            if let Some(value) = value {
                inside += 1;
                let expected = linear([p.x, p.y, p.z]);
                assert!((0..2).all(|c| (f64::from(value[c]) - expected[c]).abs() < 1e-4));
            }
        }
        assert!(inside > 100);
    }
}
