//! The voxels that a closed surface encloses.

use super::TriMesh;
use crate::geometry::{Frame, Position};
use crate::image::{Grid, Mask};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use thiserror::Error;

/// A surface with a rim encloses nothing.
#[derive(Clone, Debug, PartialEq, Error)]
#[error(
    "the surface is open: {edges} edges have a triangle on one side alone, one of them at ({:.1}, {:.1}, {:.1}) mm",
    at_mm[0], at_mm[1], at_mm[2]
)]
pub struct OpenSurface {
    /// Edges of its rims.
    pub edges: usize,
    /// The middle of one of them.
    pub at_mm: [f64; 3],
}

/// Corners closer than this are one, mm: formats without shared corners (STL) repeat them.
const SAME_MM: f64 = 1e-4;
/// Rays pass this part of a voxel beside the centres, so that none runs along an edge; different along either axis.
const BESIDE: [f64; 2] = [1.370_6e-5, 2.230_7e-5];

impl TriMesh {
    /// The same surface with corners that coincide made one, without triangles that have no area by that.
    fn welded(&self) -> Self {
        let mut known: BTreeMap<[i64; 3], u32> = BTreeMap::new();
        let mut nodes_mm = Vec::new();
        let number: Vec<u32> = self
            .nodes_mm
            .iter()
            .map(|x| {
                *known.entry(x.map(|x| (x / SAME_MM).round() as i64)).or_insert_with(|| {
                    nodes_mm.push(*x);
                    nodes_mm.len() as u32 - 1
                })
            })
            .collect();
        let triangles = self.triangles.iter().map(|t| t.map(|n| number[n as usize]));
        let triangles = triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect();
        Self { nodes_mm, triangles }
    }

    /// The voxels of a grid whose centre the surface encloses; parts that overlap are one body.
    ///
    /// # Errors
    /// [`OpenSurface`] where it has a rim.
    pub fn enclosed<F: Frame>(&self, grid: &Grid<F>) -> Result<Mask<F>, OpenSurface> {
        let surface = self.welded();
        let turned = surface.closed()?;
        let voxel = |x: &[f64; 3]| Vector3::from(grid.voxel_at(Position::new(x[0], x[1], x[2])).coords);
        let nodes: Vec<Vector3<f64>> = surface.nodes_mm.iter().map(voxel).collect();
        let [nx, ny, nz] = grid.dims;
        // Where rays along the first axis cross the surface, and in which sense.
        let mut crossings: Vec<Vec<(f64, i32)>> = vec![Vec::new(); ny * nz];
        for triangle in &surface.triangles {
            let corner = triangle.map(|n| nodes[n as usize]);
            let between = |a: usize, most: usize| {
                let low = corner.iter().map(|c| c[a]).fold(f64::INFINITY, f64::min);
                let high = corner.iter().map(|c| c[a]).fold(f64::NEG_INFINITY, f64::max);
                let from = (low - 1.0).ceil().max(0.0) as usize;
                from..((high + 1.0).floor().max(-1.0) + 1.0).min(most as f64) as usize
            };
            for k in between(2, nz) {
                for j in between(1, ny) {
                    let ray = [j as f64 + BESIDE[0], k as f64 + BESIDE[1]];
                    if let Some((at, sense)) = crossing(triangle, &corner, ray) {
                        crossings[j + ny * k].push((at, sense));
                    }
                }
            }
        }
        let mut inside = vec![false; grid.len()];
        for (column, crossed) in crossings.iter_mut().enumerate().filter(|(_, c)| !c.is_empty()) {
            crossed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let (mut winding, mut next) = (0, 0);
            for i in 0..nx {
                while next < crossed.len() && crossed[next].0 <= i as f64 {
                    winding += crossed[next].1;
                    next += 1;
                }
                // Triangles that are not turned alike say nothing but how often the ray has crossed.
                let within = if turned { winding != 0 } else { next % 2 == 1 };
                inside[grid.index(i, column % ny, column / ny)] = within;
            }
        }
        Ok(Mask::from_fn(*grid, |n| inside[n]))
    }

    /// Whether all triangles are turned alike.
    fn closed(&self) -> Result<bool, OpenSurface> {
        let mut edges: BTreeMap<[u32; 2], (usize, i32)> = BTreeMap::new();
        for [a, b, c] in &self.triangles {
            for [from, to] in [[a, b], [b, c], [c, a]] {
                let edge = edges.entry([*from.min(to), *from.max(to)]).or_default();
                edge.0 += 1;
                edge.1 += if from < to { 1 } else { -1 };
            }
        }
        let open: Vec<&[u32; 2]> =
            edges.iter().filter(|(_, (count, _))| count % 2 == 1).map(|(edge, _)| edge).collect();
        if let Some(edge) = open.first() {
            let [a, b] = edge.map(|n| self.nodes_mm[n as usize]);
            return Err(OpenSurface { edges: open.len(), at_mm: [0, 1, 2].map(|n| 0.5 * (a[n] + b[n])) });
        }
        Ok(edges.values().all(|(_, sense)| *sense == 0))
    }
}

/// Where a ray along the first axis crosses a triangle, and from which side.
fn crossing(numbers: &[u32; 3], corner: &[Vector3<f64>; 3], ray: [f64; 2]) -> Option<(f64, i32)> {
    // From the smaller number to the larger: the triangle on the other side of the edge comes to the same number.
    let side = |a: usize, b: usize| {
        let (from, to, sign) = if numbers[a] < numbers[b] { (a, b, 1.0) } else { (b, a, -1.0) };
        let (from, to) = (corner[from], corner[to]);
        sign * ((to.y - from.y) * (ray[1] - from.z) - (to.z - from.z) * (ray[0] - from.y))
    };
    let weights = [side(1, 2), side(2, 0), side(0, 1)];
    let sense = if weights.iter().all(|w| *w > 0.0) {
        1
    } else if weights.iter().all(|w| *w < 0.0) {
        -1
    } else {
        return None;
    };
    let all: f64 = weights.iter().sum();
    Some(((0..3).map(|n| weights[n] / all * corner[n].x).sum(), sense))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use nalgebra::{Matrix4, Rotation3};

    /// A box from `low` to `high`, mm.
    fn block(low: [f64; 3], high: [f64; 3]) -> TriMesh {
        let node = |n: usize| [0, 1, 2].map(|a| if n >> a & 1 == 0 { low[a] } else { high[a] });
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        TriMesh { nodes_mm: (0..8).map(node).collect(), triangles }
    }

    fn both(a: &TriMesh, b: &TriMesh) -> TriMesh {
        let shift = a.nodes_mm.len() as u32;
        let mut all = a.clone();
        all.nodes_mm.extend(&b.nodes_mm);
        all.triangles.extend(b.triangles.iter().map(|t| t.map(|n| n + shift)));
        all
    }

    fn grid() -> Grid<Pre> {
        Grid::axis_aligned([30, 28, 26], [1.0; 3], [-3.0, -2.0, -1.0])
    }

    /// As an STL holds it: no corner shared.
    fn loose(surface: &TriMesh) -> TriMesh {
        let nodes_mm = surface.triangles.iter().flatten().map(|&n| surface.nodes_mm[n as usize]).collect();
        let triangles = (0..surface.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        TriMesh { nodes_mm, triangles }
    }

    #[test]
    fn a_box_encloses_the_voxels_whose_centres_lie_in_it_however_it_is_written() {
        let solid = block([1.5, 2.5, 3.5], [11.5, 8.5, 7.5]);
        let mut inward = solid.clone();
        inward.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        let mut mixed = solid.clone();
        mixed.triangles[3].swap(0, 1);
        let expected = Mask::from_fn(grid(), |n| {
            let p = grid().centre(grid().voxel(n)).mm;
            (1.5..11.5).contains(&p.x) && (2.5..8.5).contains(&p.y) && (3.5..7.5).contains(&p.z)
        });
        assert_eq!(expected.count(), 10 * 6 * 4);
        for (name, surface) in [("solid", &solid), ("inward", &inward), ("mixed", &mixed), ("loose", &loose(&solid))] {
            assert!(surface.enclosed(&grid()).unwrap() == expected, "{name}");
        }
    }

    #[test]
    fn faces_through_voxel_centres_leave_no_hole_and_overlapping_parts_are_one_body() {
        let on_centres = block([2.0; 3], [12.0; 3]).enclosed(&grid()).unwrap();
        assert!((10usize.pow(3)..=11usize.pow(3)).contains(&on_centres.count()), "{}", on_centres.count());
        let overlapping = both(&block([1.5; 3], [9.5; 3]), &block([5.5; 3], [13.5; 3])).enclosed(&grid()).unwrap();
        assert_eq!(overlapping.count(), 2 * 8usize.pow(3) - 4usize.pow(3));
    }

    #[test]
    fn on_a_turned_grid_the_volume_is_the_surfaces_own() {
        let turn = Rotation3::from_euler_angles(0.3, -0.5, 0.8).to_homogeneous();
        let spacing = Matrix4::new_nonuniform_scaling(&Vector3::new(0.7, 0.9, 1.1));
        let mut affine = turn * spacing;
        // The middle of the grid lies in the middle of the box.
        let middle = affine.transform_vector(&Vector3::new(35.0, 35.0, 30.0));
        affine.fixed_view_mut::<3, 1>(0, 3).copy_from(&(Vector3::new(2.5, 2.5, -0.5) - middle));
        let grid = Grid::<Pre>::new([70, 70, 60], affine).unwrap();
        let solid = block([-4.0, -3.0, -6.0], [9.0, 8.0, 5.0]);
        let found = solid.enclosed(&grid).unwrap().count() as f64 * grid.voxel_volume_mm3();
        assert!((found / solid.enclosed_volume_mm3() - 1.0).abs() < 0.02, "{found}");
    }

    #[test]
    fn a_surface_with_a_hole_is_refused_with_the_place() {
        let mut open = block([1.5; 3], [9.5; 3]);
        open.triangles.pop();
        let refused = loose(&open).enclosed(&grid()).unwrap_err();
        assert_eq!(refused.edges, 3);
        assert!(refused.to_string().contains("open: 3 edges") && refused.at_mm[0] > 5.0, "{refused}");
    }
}
