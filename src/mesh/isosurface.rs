//! The surface where a scalar image crosses a level.

use super::TriMesh;
use crate::geometry::Frame;
use crate::image::Volume;
use nalgebra::Point3;
use std::collections::HashMap;

/// The six tetrahedra of a cube around its main diagonal (Kuhn): neighbouring cubes agree on shared faces, so the
/// surface has no cracks and no edge with more than two triangles. Corner number = i + 2 j + 4 k.
pub(super) const KUHN: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];

/// The surface `image = level` by marching tetrahedra (Doi and Koide, IEICE Trans. E74, 1991), outward where the
/// image falls below the level, in mm. Outside the grid the image counts as below the level, so it is always closed.
///
/// ```
/// use hgm::{geometry::Mni, image::{Grid, Volume}, mesh::isosurface};
/// let grid = Grid::<Mni>::axis_aligned([3, 3, 3], [1.0; 3], [0.0; 3]);
/// let mut dot = Volume::filled(grid, 0.0f32);
/// dot.data[grid.index(1, 1, 1)] = 1.0;
/// let surface = isosurface(&dot, 0.5);
/// assert!(surface.enclosed_volume_mm3() > 0.0); // outward
/// ```
pub fn isosurface<F: Frame>(image: &Volume<f32, F>, level: f32) -> TriMesh {
    let [nx, ny, nz] = image.grid.dims;
    // A mirrored grid (LAS, say) would turn every triangle inside out.
    let mirrored = image.grid.mm_from_voxel.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
    let value = |p: [isize; 3]| image.get(p[0], p[1], p[2]).filter(|v| v.is_finite()).map_or(-1.0, |v| v - level);
    let id =
        |p: [isize; 3]| (p[0] + 1) as u64 + (nx as u64 + 2) * ((p[1] + 1) as u64 + (ny as u64 + 2) * (p[2] + 1) as u64);
    let mut numbers: HashMap<(u64, u64), u32> = HashMap::new();
    let mut surface = TriMesh::default();
    let above = above_with_a_border(image, level);
    for k in -1..nz as isize {
        for j in -1..ny as isize {
            let row = |up: usize| {
                let (j, k) = ((j + 1) as usize + (up & 1), (k + 1) as usize + (up >> 1));
                &above[(nx + 2) * (j + (ny + 2) * k)..][..nx + 2]
            };
            let rows = [row(0), row(1), row(2), row(3)];
            for i in -1..nx as isize {
                // Most cubes lie on one side.
                let at = (i + 1) as usize;
                let inside: u8 = rows.iter().map(|row| row[at] + row[at + 1]).sum();
                if inside == 0 || inside == 8 {
                    continue;
                }
                let corners: [[isize; 3]; 8] =
                    std::array::from_fn(|c| [i + (c & 1) as isize, j + (c >> 1 & 1) as isize, k + (c >> 2) as isize]);
                let values = corners.map(value);
                for tet in KUHN {
                    let (within, without): (Vec<usize>, Vec<usize>) = tet.iter().partition(|&&c| values[c] >= 0.0);
                    let mut node = |a: usize, b: usize| {
                        let (a, b) = if a < b { (a, b) } else { (b, a) };
                        *numbers.entry((id(corners[a]), id(corners[b]))).or_insert_with(|| {
                            let t = f64::from(values[a] / (values[a] - values[b])).clamp(1e-3, 1.0 - 1e-3);
                            let voxel = |axis: usize| {
                                corners[a][axis] as f64 + t * (corners[b][axis] - corners[a][axis]) as f64
                            };
                            let p = image.grid.position(Point3::new(voxel(0), voxel(1), voxel(2)));
                            surface.nodes_mm.push([p.mm.x, p.mm.y, p.mm.z]);
                            surface.nodes_mm.len() as u32 - 1
                        })
                    };
                    let ring: Vec<u32> = match (within.as_slice(), without.as_slice()) {
                        (&[a], &[b, c, d]) | (&[b, c, d], &[a]) => vec![node(a, b), node(a, c), node(a, d)],
                        (&[a, b], &[c, d]) => vec![node(a, c), node(a, d), node(b, d), node(b, c)],
                        _ => continue,
                    };
                    // Outward: from the inside corners to the outside ones, in voxel space.
                    let centre = |set: &[usize]| {
                        let sum =
                            set.iter().fold([0.0; 3], |s, &c| std::array::from_fn(|a| s[a] + corners[c][a] as f64));
                        nalgebra::Vector3::from(sum.map(|x| x / set.len() as f64))
                    };
                    let outward = centre(&without) - centre(&within);
                    let at = |n: u32| {
                        image.grid.voxel_from_mm().transform_point(&Point3::from(surface.nodes_mm[n as usize]))
                    };
                    for t in 1..ring.len() - 1 {
                        let normal = (at(ring[t]) - at(ring[0])).cross(&(at(ring[t + 1]) - at(ring[0])));
                        let flip = (normal.dot(&outward) < 0.0) != mirrored;
                        let (b, c) = if flip { (ring[t + 1], ring[t]) } else { (ring[t], ring[t + 1]) };
                        surface.triangles.push([ring[0], b, c]);
                    }
                }
            }
        }
    }
    surface
}

/// 1 where the image is not below the level, voxel by voxel with one of zeros all round.
fn above_with_a_border<F: Frame>(image: &Volume<f32, F>, level: f32) -> Vec<u8> {
    let [nx, ny, nz] = image.grid.dims;
    let mut above = vec![0; (nx + 2) * (ny + 2) * (nz + 2)];
    for (row, data) in image.data.chunks_exact(nx.max(1)).enumerate() {
        let (j, k) = (row % ny, row / ny);
        let out = &mut above[1 + (nx + 2) * (j + 1 + (ny + 2) * (k + 1))..][..nx];
        out.iter_mut().zip(data).for_each(|(out, v)| *out = u8::from(v.is_finite() && v - level >= 0.0));
    }
    above
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use crate::image::Grid;
    use nalgebra::{Matrix4, Vector3};
    use std::collections::BTreeMap;

    fn ball(grid: Grid<Pre>, radius: f64) -> TriMesh {
        let data = (0..grid.len()).map(|n| {
            let [i, j, k] = grid.voxel(n);
            (radius - grid.position(Point3::new(i as f64, j as f64, k as f64)).mm.coords.norm()) as f32
        });
        isosurface(&Volume::from_data(grid, data.collect()), 0.0)
    }

    fn every_edge_has_two_triangles(surface: &TriMesh) -> bool {
        let mut edges = BTreeMap::new();
        for t in &surface.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *edges.entry((a.min(b), a.max(b))).or_insert(0) += if a < b { 1 } else { -1 };
            }
        }
        // Each edge once in either direction: closed and consistently turned.
        edges.values().all(|&sum| sum == 0)
    }

    #[test]
    fn a_ball_has_its_volume_and_is_closed_and_outward() {
        let grid = Grid::axis_aligned([30, 30, 30], [1.0; 3], [-14.6; 3]);
        let surface = ball(grid, 10.0);
        let exact = 4.0 / 3.0 * std::f64::consts::PI * 1000.0;
        assert!((surface.enclosed_volume_mm3() / exact - 1.0).abs() < 0.01);
        assert!(every_edge_has_two_triangles(&surface));
    }

    #[test]
    fn a_mirrored_grid_and_a_cut_ball_are_still_closed_and_outward() {
        let mirror = Matrix4::new_translation(&Vector3::new(14.0, -14.0, -5.0))
            * Matrix4::new_nonuniform_scaling(&Vector3::new(-1.0, 1.0, 1.0));
        let surface = ball(Grid::new([29, 29, 20], mirror).unwrap(), 10.0);
        assert!(surface.enclosed_volume_mm3() > 2000.0);
        assert!(every_edge_has_two_triangles(&surface));
    }
}
