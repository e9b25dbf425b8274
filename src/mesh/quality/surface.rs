//! Distance between the outer surface of a mesh and the border of the labelled voxels.

use crate::geometry::Frame;
use crate::image::{LabelMap, Mask};
use crate::mesh::closest_point::closest_on_triangle;
use crate::mesh::isosurface::KUHN;
use crate::mesh::{ClosestPoint, TetMesh, TriMesh};
use nalgebra::Point3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Distances between two surfaces, both ways, mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SurfaceDistance {
    /// Mean.
    pub mean_mm: f64,
    /// 95th percentile.
    pub percentile_95_mm: f64,
    /// Largest.
    pub max_mm: f64,
}

/// Points measured from each side, about.
const SAMPLES: usize = 20_000;

/// Between the outer surface of `mesh` and the border of the labelled voxels (all but 0 and `without`), from points
/// spread over each to the nearest of the other. The border is that of [`isosurface`](crate::mesh::isosurface) half way
/// between labelled and other voxels; what lies outside the map is not labelled. `None` when no voxel is.
pub fn surface_distance<F: Frame>(mesh: &TetMesh, map: &LabelMap<F>, without: &[u8]) -> Option<SurfaceDistance> {
    let border = Border { labelled: map.map(|l| l != 0 && !without.contains(&l)) };
    let (outer, _) = TriMesh::from_facets(mesh.nodes_mm(), &mesh.boundary_facets(|_| true));
    let tree = ClosestPoint::new(&outer)?;
    let points = border.points();
    if points.is_empty() {
        return None;
    }
    let mut distances: Vec<f64> = points.par_iter().map(|p| tree.find((*p).into()).distance_mm).collect();
    let back: Vec<f64> = spread(&outer).par_iter().map(|p| border.distance_mm(p)).collect();
    distances.extend(back);
    let mean_mm = distances.iter().sum::<f64>() / distances.len() as f64;
    distances.sort_unstable_by(f64::total_cmp);
    let percentile_95_mm = distances[(distances.len() - 1) * 95 / 100];
    Some(SurfaceDistance { mean_mm, percentile_95_mm, max_mm: distances[distances.len() - 1] })
}

/// The border of a mask, never built as a whole: a brain's has a million triangles, of which a few thousand are near.
struct Border<F: Frame> {
    labelled: Mask<F>,
}

impl<F: Frame> Border<F> {
    fn at(&self, voxel: [isize; 3]) -> bool {
        self.labelled.get(voxel[0], voxel[1], voxel[2]).unwrap_or(false)
    }

    fn mm(&self, voxel: [f64; 3]) -> Point3<f64> {
        self.labelled.grid.position(voxel.into()).mm
    }

    /// Midpoints between labelled and other neighbours, in mm: about [`SAMPLES`] of them, evenly along the list.
    fn points(&self) -> Vec<Point3<f64>> {
        let grid = &self.labelled.grid;
        let mut pairs = Vec::new();
        for (n, _) in self.labelled.data.iter().enumerate().filter(|(_, l)| **l) {
            let voxel = grid.voxel(n).map(|c| c as isize);
            for axis in 0..3 {
                for step in [-1, 1] {
                    let mut next = voxel;
                    next[axis] += step;
                    if !self.at(next) {
                        pairs.push((n, axis, step));
                    }
                }
            }
        }
        let stride = pairs.len().div_ceil(SAMPLES).max(1);
        let middle = |&(n, axis, step): &(usize, usize, isize)| {
            let mut voxel = grid.voxel(n).map(|c| c as f64);
            voxel[axis] += 0.5 * step as f64;
            self.mm(voxel)
        };
        pairs.iter().step_by(stride).map(middle).collect()
    }

    /// Distance from a point to the border: the cells around it are searched in growing shells.
    fn distance_mm(&self, p: &Point3<f64>) -> f64 {
        let grid = &self.labelled.grid;
        let at = grid.voxel_from_mm().transform_point(p);
        let home: [isize; 3] = std::array::from_fn(|a| at[a].floor() as isize);
        let spacing = grid.spacing_mm().into_iter().fold(f64::MAX, f64::min);
        let far = (0..3).map(|a| home[a].unsigned_abs() + grid.dims[a]).max().unwrap_or(0) as isize;
        let mut best = f64::MAX;
        for shell in 0..=far {
            // The cells of this shell are no nearer than this.
            if best <= (shell - 1) as f64 * spacing {
                break;
            }
            for k in -shell..=shell {
                for j in -shell..=shell {
                    let wall = k.abs() == shell || j.abs() == shell;
                    let step = if wall || shell == 0 { 1 } else { 2 * shell as usize };
                    for i in (-shell..=shell).step_by(step) {
                        best = best.min(self.distance_in_cell(p, [home[0] + i, home[1] + j, home[2] + k]));
                    }
                }
            }
        }
        best
    }

    /// Distance to the border inside one cell between eight voxel centres.
    fn distance_in_cell(&self, p: &Point3<f64>, cell: [isize; 3]) -> f64 {
        let corner =
            |c: usize| [cell[0] + (c & 1) as isize, cell[1] + (c >> 1 & 1) as isize, cell[2] + (c >> 2) as isize];
        let inside: [bool; 8] = std::array::from_fn(|c| self.at(corner(c)));
        let mut best = f64::MAX;
        if inside.iter().all(|&i| i == inside[0]) {
            return best;
        }
        let middle = |a: usize, b: usize| {
            let (a, b) = (corner(a), corner(b));
            self.mm(std::array::from_fn(|x| 0.5 * (a[x] + b[x]) as f64))
        };
        for tet in KUHN {
            let (within, without): (Vec<usize>, Vec<usize>) = tet.iter().partition(|&&c| inside[c]);
            let ring = match (within.as_slice(), without.as_slice()) {
                (&[a], &[b, c, d]) | (&[b, c, d], &[a]) => vec![middle(a, b), middle(a, c), middle(a, d)],
                (&[a, b], &[c, d]) => vec![middle(a, c), middle(a, d), middle(b, d), middle(b, c)],
                _ => continue,
            };
            for n in 1..ring.len() - 1 {
                let triangle = [ring[0], ring[n], ring[n + 1]];
                best = best.min((closest_on_triangle(*p, &triangle) - p).norm());
            }
        }
        best
    }
}

/// [`SAMPLES`] points at equal steps of area along the list of triangles, low-discrepancy within each.
fn spread(surface: &TriMesh) -> Vec<Point3<f64>> {
    let step = surface.area_mm2() / SAMPLES as f64;
    let mut points = Vec::with_capacity(SAMPLES + 1);
    let mut due = 0.5 * step;
    for (t, corners) in surface.triangles.iter().enumerate() {
        let area = surface.area_vector_mm2(t).norm();
        while due < area {
            let n = points.len() as f64;
            // The plane's golden sequence (Roberts 2018), folded into the triangle.
            let (mut u, mut v) = ((n * 0.754877666246693).fract(), (n * 0.569840290998053).fract());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let [a, b, c] = corners.map(|n| Point3::from(surface.nodes_mm[n as usize]));
            points.push(a + (b - a) * u + (c - a) * v);
            due += step;
        }
        due -= area;
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;
    use crate::mesh::isosurface;

    fn cube_of_side(side: f64) -> TetMesh {
        let h = side / 2.0;
        let nodes = (0..8u32).map(|n| [n & 1, n >> 1 & 1, n >> 2].map(|c| f64::from(c) * side - h)).collect();
        let tets = vec![[0, 1, 3, 7], [0, 5, 1, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 6, 4, 7]];
        TetMesh::new(nodes, tets, vec![2; 6]).unwrap()
    }

    #[test]
    fn a_cube_a_millimetre_larger_all_around_is_a_millimetre_away() {
        let grid = Grid::<Mni>::axis_aligned([26; 3], [1.0; 3], [-12.5; 3]);
        let inside = |n: usize| grid.voxel(n).iter().all(|&c| (3..23).contains(&c));
        let map = LabelMap::from_data(grid, (0..grid.len()).map(|n| 2 * u8::from(inside(n))).collect());
        let same = surface_distance(&cube_of_side(20.0), &map, &[]).unwrap();
        assert!(same.mean_mm < 0.03, "{same:?}");
        let larger = surface_distance(&cube_of_side(22.0), &map, &[]).unwrap();
        assert!((larger.mean_mm - 1.0).abs() < 0.05 && (larger.percentile_95_mm - 1.0).abs() < 0.5, "{larger:?}");
        assert_eq!(surface_distance(&cube_of_side(20.0), &map, &[2]), None);
    }

    #[test]
    fn the_border_found_cell_by_cell_is_the_isosurface() {
        let grid = Grid::<Mni>::axis_aligned([14, 12, 10], [1.0, 0.8, 2.0], [3.0, -4.0, 1.0]);
        let inside = |n: usize| grid.voxel(n).iter().map(|c| c * c).sum::<usize>() % 7 < 4;
        let labelled = Mask::from_data(grid, (0..grid.len()).map(inside).collect());
        let whole = ClosestPoint::new(&isosurface(&labelled.map(|l| 2.0 * f32::from(l)), 1.0)).unwrap();
        let border = Border { labelled };
        for n in 0..200 {
            let p = [n * 7 % 31, n * 11 % 29, n * 13 % 37].map(f64::from);
            let p = Point3::new(p[0] - 6.0, p[1] - 12.0, p[2] - 7.0);
            let (found, wanted) = (border.distance_mm(&p), whole.find(p.into()).distance_mm);
            assert!((found - wanted).abs() < 1e-6, "{found} {wanted} at {p}");
        }
    }
}
