//! How far the body's outline may be off, and what that does to its displacement.
//!
//! A brain that slides on the skull has nothing but its outline to lean on: labels wider by about a millimetre made grey matter a
//! fifth stiffer and white matter an eighth softer (docs/evidence/estimate.md). A segmentation is good to about half of that, so
//! the outline is estimated along with the moduli: out or in by one amount everywhere, and by amounts that change from side to
//! side. What they do is found on a coarse mesh of the body, moved so far and solved again.

use super::body::{Body, Observation};
use super::mesh_error::at_places;
use super::unknown::Unknown;
use super::{LogPrior, Scale};
use crate::fem::Scenario;
use crate::mesh::{ClosestPoint, TetMesh, TriMesh};
use crate::tag::{MARGIN, VENTRICLE};
use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;

/// How they move: everywhere by the same, or by what changes along an axis of the frame.
const NAMES: [&str; 4] = ["everywhere", "from left to right", "from back to front", "from below to above"];

/// How many they are.
pub const OUTLINE: usize = NAMES.len();

/// The amounts, mm: everywhere, and on top of that at the right, front and upper end.
pub type OutlineAmounts = [f64; OUTLINE];

/// How often a step is halved at most where a mesh does not bear it.
const HALVINGS: i32 = 8;

/// Tissue deeper than this stays where it is, mm.
const DEPTH_MM: f64 = 10.0;

/// A body whose outline is not known exactly.
pub struct Outline<'a> {
    /// A coarse mesh of it, with its supports.
    pub mesh: &'a TetMesh,
    /// Loads, supports, solver.
    pub template: &'a Scenario,
    /// What is estimated of it.
    pub unknowns: &'a [Unknown],
    /// Poisson's ratio of every tissue.
    pub poisson_ratio: f64,
    /// Standard deviation of each of the amounts, mm: of the outline everywhere, or at either end of an axis.
    pub sd_mm: f64,
}

impl Outline<'_> {
    /// What is known of the amounts beforehand, in mm.
    pub fn priors(&self) -> impl Iterator<Item = LogPrior> {
        let sd = Some(self.sd_mm);
        NAMES.into_iter().map(move |name| LogPrior {
            name: format!("outline of the brain, mm farther out {name}"),
            mean: 0.0,
            sd,
            scale: Scale::Plain,
            correlation: Vec::new(),
            average: None,
        })
    }

    /// Displacement of the places per mm of each amount, three rows a place, at these parameters; `None` where the body has no
    /// equilibrium there, before or after, or its outline cannot be moved.
    pub fn columns_mm(&self, parameters: &[f64], places_mm: &[[f64; 3]]) -> Option<DMatrix<f64>> {
        let at = |mesh: &TetMesh| -> Option<Vec<[f64; 3]>> {
            let nothing = Observation::Nodes(Vec::new());
            let mut body = Body::new(mesh, self.template, self.unknowns.to_vec(), self.poisson_ratio, nothing).ok()?;
            let found = body.equilibrium(parameters).ok()?;
            Some(at_places(mesh, &found.displacement_mm, places_mm))
        };
        let surface = Surface::new(self.mesh)?;
        let mut bodies = vec![(self.mesh.clone(), 0.0)];
        bodies.extend((0..OUTLINE).map(|k| self.moved(&surface, k)).collect::<Option<Vec<_>>>()?);
        let found: Vec<_> = bodies.par_iter().map(|(mesh, _)| at(mesh)).collect::<Option<_>>()?;
        Some(DMatrix::from_fn(3 * places_mm.len(), OUTLINE, |row, k| {
            let of = |n: usize| found[n][row / 3][row % 3];
            (of(k + 1) - of(0)) / bodies[k + 1].1
        }))
    }

    /// The mesh with its outline moved by an amount, and by how much of it, mm: by one standard deviation, or by less where that
    /// would turn a tetrahedron inside out.
    fn moved(&self, surface: &Surface, amount: usize) -> Option<(TetMesh, f64)> {
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        for x in self.mesh.nodes_mm() {
            (low, high) = (low.inf(&Vector3::from(*x)), high.sup(&Vector3::from(*x)));
        }
        let share = |x: Vector3<f64>| match amount.checked_sub(1) {
            None => 1.0,
            Some(axis) => 2.0 * (x[axis] - low[axis]) / (high[axis] - low[axis]) - 1.0,
        };
        let mut steps_mm = (0..HALVINGS).map(|n| self.sd_mm * 0.5f64.powi(n));
        steps_mm.find_map(|step_mm| Some((surface.moved(self.mesh, |x| step_mm * share(x))?, step_mm)))
    }
}

/// The outline of a body: what it ends at, walls of a ventricle or a cavity apart.
struct Surface {
    outside: TriMesh,
    tree: ClosestPoint,
    /// Outward, one a node of the outside.
    normals: Vec<Vector3<f64>>,
}

impl Surface {
    /// `None` for a body without an outside.
    fn new(mesh: &TetMesh) -> Option<Self> {
        let facets = mesh.outside_without(&[VENTRICLE, MARGIN]);
        let (outside, nodes) = TriMesh::from_facets(mesh.nodes_mm(), &facets);
        let normals = mesh.node_normals_mm2(&facets);
        let normals = nodes.into_iter().map(|n| normals[n as usize].normalize()).collect();
        Some(Self { tree: ClosestPoint::new(&outside)?, outside, normals })
    }

    /// The mesh with its outline moved outwards by so many mm, what lies below it by less the deeper it lies; `None` where that
    /// turns a tetrahedron inside out.
    fn moved(&self, mesh: &TetMesh, by_mm: impl Fn(Vector3<f64>) -> f64) -> Option<TetMesh> {
        let corner = |n: u32| Vector3::from(self.outside.nodes_mm[n as usize]);
        let to = |x: [f64; 3]| -> [f64; 3] {
            let hit = self.tree.find(x);
            let share = 1.0 - hit.distance_mm / DEPTH_MM;
            if share <= 0.0 {
                return x;
            }
            // From corner to corner the normal turns smoothly.
            let near = |n: u32| 1.0 / ((corner(n) - hit.point_mm.coords).norm() + 1e-9);
            let corners = self.outside.triangles[hit.triangle as usize];
            let normal: Vector3<f64> = corners.iter().map(|&n| self.normals[n as usize] * near(n)).sum();
            let out = normal.try_normalize(1e-12).unwrap_or_else(Vector3::zeros);
            (Vector3::from(x) + out * (share * by_mm(hit.point_mm.coords))).into()
        };
        mesh.clone().moved(to).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;

    fn volume_mm3(mesh: &TetMesh) -> f64 {
        (0..mesh.tets().len()).map(|t| mesh.volume_mm3(t)).sum()
    }

    fn moved(mesh: &TetMesh, by_mm: f64) -> TetMesh {
        Surface::new(mesh).unwrap().moved(mesh, |_| by_mm).unwrap()
    }

    #[test]
    fn an_outline_moved_out_encloses_what_it_has_swept() {
        let mesh = block(8);
        let step = 0.1;
        let area: f64 = {
            let (surface, _) = TriMesh::from_facets(mesh.nodes_mm(), &mesh.boundary_facets(|_| true));
            let at = |n: u32| Vector3::from(surface.nodes_mm[n as usize]);
            surface.triangles.iter().map(|t| 0.5 * (at(t[1]) - at(t[0])).cross(&(at(t[2]) - at(t[0]))).norm()).sum()
        };
        let swept = volume_mm3(&moved(&mesh, step)) - volume_mm3(&mesh);
        // Edges and corners move along their mean normals: less than the faces beside them.
        assert!((0.75..1.0).contains(&(swept / (area * step))), "{swept} of {}", area * step);
        let back = volume_mm3(&moved(&mesh, -step)) - volume_mm3(&mesh);
        assert!((swept + back).abs() < 0.05 * swept, "{swept} {back}");
        // The middle of the block lies deeper than the outline reaches.
        let moved = moved(&mesh, step);
        let deep =
            mesh.nodes_mm().iter().zip(moved.nodes_mm()).filter(|(a, _)| a.iter().all(|x| (12.0..28.0).contains(x)));
        assert!(deep.clone().count() > 0 && deep.into_iter().all(|(a, b)| a == b));
    }

    #[test]
    fn the_wall_of_a_ventricle_is_no_outline() {
        let mut mesh = block(4);
        let floor: Vec<[u32; 3]> = mesh
            .boundary_facets(|_| true)
            .into_iter()
            .filter(|facet| facet.iter().all(|&n| mesh.nodes_mm()[n as usize][2] < 1e-9))
            .collect();
        assert!(!floor.is_empty());
        mesh.facet_sets.insert(VENTRICLE.to_owned(), floor);
        let moved = moved(&mesh, 0.5);
        let change = |n: usize| mesh.nodes_mm()[n][2] - moved.nodes_mm()[n][2];
        let inner =
            |n: usize| mesh.nodes_mm()[n][2] < 1e-9 && (0..2).all(|a| (12.0..28.0).contains(&mesh.nodes_mm()[n][a]));
        let floor: Vec<usize> = (0..mesh.nodes_mm().len()).filter(|&n| inner(n)).collect();
        assert!(!floor.is_empty() && floor.into_iter().all(|n| change(n).abs() < 1e-12));
    }
}
