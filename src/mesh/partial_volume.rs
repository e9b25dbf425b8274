//! What lies within the cells of a mesh, by the voxels of the label map that it was made from.
//!
//! The cells of a mesh follow the borders of tissues as far as their size allows; a gyrus thinner than a cell, or a border that
//! cuts through one, is in the voxels alone. A cell is divided into parts of equal volume, and each takes the label of the voxel
//! that its centre lies in.

use super::tet_mesh::{Fractions, TetMesh};
use crate::geometry::{Frame, Position};
use crate::image::LabelMap;
use crate::segment::label::is_tissue;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Parts that a cell is divided into for each voxel's volume in it: twice along every axis, since a border that crosses a voxel's
/// width is known no better than the voxel anyway.
const PARTS_OF_A_VOXEL: f64 = 8.0;

/// The most parts along an edge: beyond it a cell holds so many voxels that their number itself is the average.
const MOST_ALONG_AN_EDGE: usize = 16;

/// The part of every cell that each tissue of the mesh fills, by the voxels of `map`. Only tissue counts, and only what some cell of the
/// mesh is labelled: fluid at the rim of a cell of tissue belongs to the shape of the body, which the mesh's surface gives,
/// and does not thin it. A cell that is no tissue, or in which no voxel is, is of its own label alone.
pub fn tissue_fractions<F: Frame>(mesh: &TetMesh, map: &LabelMap<F>) -> Fractions {
    let mut labels = mesh.labels().to_vec();
    labels.sort_unstable();
    labels.dedup();
    let place_of: [Option<usize>; 256] = std::array::from_fn(|l| labels.binary_search(&(l as u8)).ok());
    let counted: [Option<usize>; 256] = std::array::from_fn(|l| place_of[l].filter(|_| is_tissue(l as u8)));
    let voxel_mm3 = map.grid.voxel_volume_mm3();
    let of_cell = |t: usize| -> Vec<f64> {
        let own = mesh.labels()[t];
        let mut parts = vec![0u32; labels.len()];
        if is_tissue(own) {
            let wanted = (PARTS_OF_A_VOXEL * mesh.volume_mm3(t) / voxel_mm3).cbrt().ceil();
            let along = (wanted as usize).clamp(1, MOST_ALONG_AN_EDGE);
            let corners = mesh.tets()[t].map(|n| {
                let [x, y, z] = mesh.nodes_mm()[n as usize];
                map.grid.voxel_at(Position::new(x, y, z)).coords
            });
            each_part(along, |weights| {
                let at: Vector3<f64> = (0..4).map(|c| corners[c] * weights[c]).sum();
                if let Some(place) = label_at(map, at).and_then(|l| counted[usize::from(l)]) {
                    parts[place] += 1;
                }
            });
        }
        let all: u32 = parts.iter().sum();
        if all == 0 {
            parts[place_of[usize::from(own)].unwrap_or(0)] = 1;
        }
        let all = f64::from(all.max(1));
        parts.into_iter().map(|part| f64::from(part) / all).collect()
    };
    let cells: Vec<Vec<f64>> = (0..mesh.tets().len()).into_par_iter().with_min_len(256).map(of_cell).collect();
    let of_label = |place: usize| cells.iter().map(|cell| cell[place]).collect();
    labels.iter().enumerate().map(|(place, &label)| (label, of_label(place))).collect()
}

/// The label of the voxel that a place lies in, by fractional voxel index.
fn label_at<F: Frame>(map: &LabelMap<F>, at: Vector3<f64>) -> Option<u8> {
    let nearest = at.map(f64::round);
    let inside = (0..3).all(|a| nearest[a] >= 0.0 && nearest[a] < map.grid.dims[a] as f64);
    inside.then(|| map.data[map.grid.index(nearest[0] as usize, nearest[1] as usize, nearest[2] as usize)])
}

/// Barycentric coordinates of the centres of `along`^3 parts of equal volume.
///
/// The tetrahedron 1 >= x >= y >= z >= 0 is one of the six that a cube falls into along its diagonal (Kuhn, IBM J. Res. Dev. 4, 1960); a grid of
/// small cubes falls into the same six each, and those within it have the same volume.
fn each_part(along: usize, mut with: impl FnMut([f64; 4])) {
    const CENTRES: [[f64; 3]; 6] = [
        [0.75, 0.5, 0.25],
        [0.75, 0.25, 0.5],
        [0.5, 0.75, 0.25],
        [0.25, 0.75, 0.5],
        [0.5, 0.25, 0.75],
        [0.25, 0.5, 0.75],
    ];
    let size = along as f64;
    for i in 0..along {
        for j in 0..=i {
            for k in 0..=j {
                for [a, b, c] in CENTRES {
                    let (x, y, z) = ((i as f64 + a) / size, (j as f64 + b) / size, (k as f64 + c) / size);
                    if x > y && y > z {
                        with([1.0 - x, x - y, y - z, z]);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;

    #[test]
    fn parts_of_a_cell_are_as_many_as_asked_for_and_their_centres_average_to_its_own() {
        for along in [1, 2, 3, 7] {
            let (mut count, mut sum) = (0usize, [0.0; 4]);
            each_part(along, |weights| {
                count += 1;
                assert!(weights.iter().all(|w| *w > 0.0) && (weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                (0..4).for_each(|c| sum[c] += weights[c]);
            });
            assert_eq!(count, along.pow(3));
            assert!(sum.iter().all(|s| (s / count as f64 - 0.25).abs() < 1e-12), "{sum:?}");
        }
    }

    /// Grey with fluid outside, white beyond the plane x = `border_mm`.
    fn half(border_mm: f64) -> LabelMap<Mni> {
        let grid = Grid::axis_aligned([30, 20, 20], [0.5; 3], [0.0; 3]);
        LabelMap::from_fn(grid, |n| {
            let [i, j, k] = grid.voxel(n);
            let inner = j > 1 && k > 1 && j < 18 && k < 18;
            if !inner {
                1
            } else if 0.5 * i as f64 > border_mm {
                3
            } else {
                2
            }
        })
    }

    /// One cell of each of grey and white, which the plane x = 4.25 mm cuts.
    fn two_cells() -> TetMesh {
        let nodes = vec![[2.0, 2.0, 2.0], [6.5, 2.0, 2.0], [2.0, 6.5, 2.0], [2.0, 2.0, 6.5], [6.5, 6.5, 6.5]];
        TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4]], vec![2, 3]).unwrap()
    }

    #[test]
    fn fractions_are_the_volumes_that_a_plane_cuts_off_and_sum_to_one() {
        // Voxels end halfway between their centres: the border lies at 4.25 mm, the middle of the first cell's edge along x.
        let fractions = tissue_fractions(&two_cells(), &half(4.0));
        assert_eq!(fractions.keys().copied().collect::<Vec<_>>(), [2, 3]);
        for (grey, white) in fractions[&2].iter().zip(&fractions[&3]) {
            assert!((grey + white - 1.0).abs() < 1e-12);
        }
        assert!((fractions[&3][0] - 0.125).abs() < 0.01, "{fractions:?}");
    }

    #[test]
    fn fluid_does_not_thin_a_cell_and_what_no_cell_is_labelled_does_not_count() {
        let map = half(4.0);
        let fluid_for_white = map.map(|l| if l == 3 { 1 } else { l });
        assert_eq!(tissue_fractions(&two_cells(), &fluid_for_white)[&2][0], 1.0);
        let tumour_for_white = map.map(|l| if l == 3 { 6 } else { l });
        assert_eq!(tissue_fractions(&two_cells(), &tumour_for_white)[&2][0], 1.0);
        // Where there is no tissue at all, a cell keeps its own label.
        let fluid = map.map(|_| 1);
        let fractions = tissue_fractions(&two_cells(), &fluid);
        assert_eq!((&fractions[&2][..], &fractions[&3][..]), (&[1.0, 0.0][..], &[0.0, 1.0][..]));
    }
}
