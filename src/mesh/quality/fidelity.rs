//! How well a labelled mesh fills the label map that it was made of.

use crate::geometry::Frame;
use crate::image::LabelMap;
use crate::mesh::TetMesh;
use nalgebra::{Matrix3, Point3, Vector3};
use serde::{Deserialize, Serialize};

/// One label of a mesh against the same label of its map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LabelFidelity {
    /// The label.
    pub label: u8,
    /// Volume of its tets, mm3.
    pub volume_mm3: f64,
    /// Volume of its voxels, mm3.
    pub map_volume_mm3: f64,
    /// Volume of tets minus volume of voxels, percent of the latter.
    pub volume_error_percent: f64,
    /// Dice overlap of the voxels with the label and the voxel centres inside tets of the label.
    pub dice: f64,
}

/// All labels of a mesh against its map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fidelity {
    /// In order of label.
    pub labels: Vec<LabelFidelity>,
}

impl Fidelity {
    /// The figures of one label.
    pub fn label(&self, label: u8) -> Option<&LabelFidelity> {
        self.labels.iter().find(|l| l.label == label)
    }
}

/// Compares every nonzero label of `map` (those in `without` count as outside) with the tets of that label.
pub fn fidelity<F: Frame>(mesh: &TetMesh, map: &LabelMap<F>, without: &[u8]) -> Fidelity {
    let filled = fill(mesh, map);
    let (mut voxels, mut covered, mut both) = ([0usize; 256], [0usize; 256], [0usize; 256]);
    for (&wanted, &got) in map.data.iter().zip(&filled) {
        let wanted = if without.contains(&wanted) { 0 } else { wanted };
        voxels[wanted as usize] += 1;
        covered[got as usize] += 1;
        both[got as usize] += usize::from(got == wanted);
    }
    let mut volume_mm3 = [0.0; 256];
    for (t, &label) in mesh.labels().iter().enumerate() {
        volume_mm3[label as usize] += mesh.volume_mm3(t);
    }
    let labels = (1..=255u8).filter(|&l| voxels[l as usize] > 0).map(|label| {
        let l = label as usize;
        let map_volume_mm3 = voxels[l] as f64 * map.grid.voxel_volume_mm3();
        LabelFidelity {
            label,
            volume_mm3: volume_mm3[l],
            map_volume_mm3,
            volume_error_percent: 100.0 * (volume_mm3[l] / map_volume_mm3 - 1.0),
            dice: 2.0 * both[l] as f64 / (voxels[l] + covered[l]) as f64,
        }
    });
    Fidelity { labels: labels.collect() }
}

/// The label of the tet at every voxel centre; 0 outside the mesh. A centre on a shared face belongs to the first tet.
fn fill<F: Frame>(mesh: &TetMesh, map: &LabelMap<F>) -> Vec<u8> {
    let to_voxel = map.grid.voxel_from_mm();
    let nodes: Vec<Vector3<f64>> =
        mesh.nodes_mm().iter().map(|p| to_voxel.transform_point(&Point3::from(*p)).coords).collect();
    let mut filled = vec![0u8; map.data.len()];
    for (tet, &label) in mesh.tets().iter().zip(mesh.labels()) {
        let x = tet.map(|n| nodes[n as usize]);
        let Some(inverse) = Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]).try_inverse() else {
            continue;
        };
        let mut range = [[0usize; 2]; 3];
        for a in 0..3 {
            let low = x.iter().map(|p| p[a]).fold(f64::MAX, f64::min).ceil().max(0.0) as usize;
            let high = x.iter().map(|p| p[a]).fold(f64::MIN, f64::max).floor() + 1.0;
            range[a] = [low, (high.max(0.0) as usize).min(map.grid.dims[a])];
        }
        for k in range[2][0]..range[2][1] {
            for j in range[1][0]..range[1][1] {
                let start = inverse * (Vector3::new(0.0, j as f64, k as f64) - x[0]);
                let step = inverse.column(0);
                for i in range[0][0]..range[0][1] {
                    let share: Vector3<f64> = start + step * i as f64;
                    // A hair of slack closes the seams that rounding opens between neighbours.
                    if share.min() >= -1e-9 && share.sum() <= 1.0 + 1e-9 {
                        let voxel = &mut filled[map.grid.index(i, j, k)];
                        if *voxel == 0 {
                            *voxel = label;
                        }
                    }
                }
            }
        }
    }
    filled
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;

    /// A box of 6 x 4 x 4 mm cut at x = 0 into labels 2 and 3, as Kuhn tets, and its map at 0.5 mm.
    fn halves() -> (TetMesh, LabelMap<Mni>) {
        let (mut nodes, mut tets, mut labels) = (Vec::new(), Vec::new(), Vec::new());
        for (side, label) in [(-3.0, 2u8), (0.0, 3u8)] {
            let first = nodes.len() as u32;
            for n in 0..8u32 {
                let [i, j, k] = [n & 1, n >> 1 & 1, n >> 2].map(f64::from);
                nodes.push([side + 3.0 * i, 4.0 * j - 2.0, 4.0 * k - 2.0]);
            }
            let orders = [[1, 2, 4], [2, 4, 1], [4, 1, 2], [2, 1, 4], [1, 4, 2], [4, 2, 1]];
            for (n, [a, b, _]) in orders.into_iter().enumerate() {
                let mut tet = [0, a, a + b, 7];
                if n >= 3 {
                    tet.swap(1, 2);
                }
                tets.push(tet.map(|v| v + first));
                labels.push(label);
            }
        }
        let mesh = TetMesh::new(nodes, tets, labels).unwrap();
        let grid = Grid::axis_aligned([16, 12, 12], [0.5; 3], [-3.75, -2.75, -2.75]);
        let data = (0..grid.len())
            .map(|n| {
                let p = grid.position(grid.voxel(n).map(|c| c as f64).into()).mm;
                let inside = p.x.abs() < 3.0 && p.y.abs() < 2.0 && p.z.abs() < 2.0;
                if inside { 2 + u8::from(p.x > 0.0) } else { 0 }
            })
            .collect();
        (mesh, LabelMap::from_data(grid, data))
    }

    #[test]
    fn a_mesh_that_fills_its_map_has_dice_one_and_no_volume_error() {
        let (mesh, map) = halves();
        for label in fidelity(&mesh, &map, &[]).labels {
            assert!((label.dice - 1.0).abs() < 1e-12 && label.volume_error_percent.abs() < 1e-9, "{label:?}");
        }
    }

    #[test]
    fn swapped_labels_and_missing_tets_show() {
        let (mesh, map) = halves();
        let swapped =
            TetMesh::new(mesh.nodes_mm().to_vec(), mesh.tets().to_vec(), mesh.labels().iter().map(|l| 5 - l).collect());
        assert_eq!(fidelity(&swapped.unwrap(), &map, &[]).label(2).unwrap().dice, 0.0);
        let (half, _) = mesh.restricted(|l| l == 3).unwrap();
        let figures = fidelity(&half, &map, &[]);
        assert_eq!((figures.label(2).unwrap().volume_error_percent, figures.label(2).unwrap().dice), (-100.0, 0.0));
        assert!(figures.label(3).unwrap().dice > 0.999);
        assert!(fidelity(&half, &map, &[2]).label(2).is_none());
    }
}
