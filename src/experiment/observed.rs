//! What the post-operative scan shows: surfaces that parts of the deformed mesh should lie on.

use super::rmse::{SurfaceDistance, closest_distances_mm, root_mean_square, symmetric_distance};
use crate::geometry::Mni;
use crate::image::Mask;
use crate::image::gaussian::gaussian;
use crate::mesh::{ClosestPoint, TetMesh, TriMesh, isosurface};
use std::collections::BTreeMap;
use thiserror::Error;

/// Node sets of the mesh with the surface each should lie on, by set name (`ventricle`, `margin`).
#[derive(Clone, Debug)]
pub struct ObservedSurfaces {
    surfaces: BTreeMap<String, (TriMesh, ClosestPoint)>,
}

/// An observed surface cannot be used.
#[derive(Debug, Error, PartialEq)]
pub enum ObservedError {
    /// The mask behind it is empty.
    #[error("the mask is empty, so the set `{set}` has no surface to be compared with; give a mask of your own")]
    EmptySurface {
        /// The set.
        set: String,
    },
    /// The mesh has no such nodes.
    #[error("no node of the mesh is in the set `{set}`; look at the masks, and give your own")]
    EmptySet {
        /// The set.
        set: String,
    },
}

/// Errors of one deformed (or rest) mesh against the observed surfaces.
#[derive(Clone, Debug)]
pub struct SurfaceErrors {
    /// RMSE per set over its nodes, closest-point correspondence as published, mm.
    pub rmse_mm: BTreeMap<String, f64>,
    /// Distance per node of the mesh, mm; zero where the node is on no observed set.
    pub node_error_mm: Vec<f64>,
    /// Whether the node is on an observed set.
    pub node_observed: Vec<bool>,
    /// The symmetric distance per set, mesh surface against observed surface.
    pub symmetric: BTreeMap<String, SurfaceDistance>,
}

/// The boundary of a mask as a smooth closed surface: a Gaussian of half a voxel takes the stairs off and hardly
/// moves a wall (it shrinks a ball of radius R by sigma^2/R).
pub fn mask_surface(mask: &Mask<Mni>) -> TriMesh {
    let [x, y, z] = mask.grid.spacing_mm();
    let smooth = gaussian(&mask.map(|inside| if inside { 1.0 } else { 0.0 }), 0.5 * x.max(y).max(z));
    isosurface(&smooth, 0.5)
}

/// What mesh, segmentation and registration make of a brain that has not moved, root mean square in mm: how far the mesh's
/// sets lie from the pre-operative surfaces they follow (`own`), and how much further the brain's surface lies from nodes that
/// cannot have moved (`still`) on one scan than on the other (`brains`). The two are independent; `None` where there is
/// nothing to be measured.
pub fn error_at_rest_mm(
    mesh: &TetMesh,
    own: &BTreeMap<String, TriMesh>,
    still: &str,
    brains: [&TriMesh; 2],
) -> Option<f64> {
    let away = |set: &str, surface: &TriMesh| {
        let tree = ClosestPoint::new(surface)?;
        let points: Vec<[f64; 3]> = mesh.node_sets.get(set)?.iter().map(|&n| mesh.nodes_mm()[n as usize]).collect();
        Some(closest_distances_mm(&points, &tree))
    };
    let of_mesh: Vec<f64> = own.iter().filter_map(|(set, surface)| away(set, surface)).flatten().collect();
    let [before, after] = [away(still, brains[0])?, away(still, brains[1])?];
    let of_scans: Vec<f64> = before.iter().zip(&after).map(|(b, a)| a - b).collect();
    Some(root_mean_square(&of_mesh)?.hypot(root_mean_square(&of_scans)?))
}

impl ObservedSurfaces {
    /// Pairs of set name and observed surface; every surface must have triangles and every set nodes in `mesh`.
    ///
    /// # Errors
    /// [`ObservedError`] names the set.
    pub fn new(mesh: &TetMesh, surfaces: BTreeMap<String, TriMesh>) -> Result<Self, ObservedError> {
        let mut prepared = BTreeMap::new();
        for (set, surface) in surfaces {
            if mesh.node_sets.get(&set).is_none_or(Vec::is_empty) {
                return Err(ObservedError::EmptySet { set });
            }
            let Some(tree) = ClosestPoint::new(&surface) else {
                return Err(ObservedError::EmptySurface { set });
            };
            prepared.insert(set, (surface, tree));
        }
        Ok(Self { surfaces: prepared })
    }

    /// The observed surfaces by set name.
    pub fn surfaces(&self) -> impl Iterator<Item = (&str, &TriMesh, &ClosestPoint)> {
        self.surfaces.iter().map(|(set, (surface, tree))| (set.as_str(), surface, tree))
    }

    /// Errors of the mesh displaced by `displacement_mm` (one vector per node; zeros for rest).
    pub fn errors(&self, mesh: &TetMesh, displacement_mm: &[[f64; 3]]) -> SurfaceErrors {
        let moved: Vec<[f64; 3]> =
            mesh.nodes_mm().iter().zip(displacement_mm).map(|(x, u)| [x[0] + u[0], x[1] + u[1], x[2] + u[2]]).collect();
        let mut errors = SurfaceErrors {
            rmse_mm: BTreeMap::new(),
            node_error_mm: vec![0.0; moved.len()],
            node_observed: vec![false; moved.len()],
            symmetric: BTreeMap::new(),
        };
        for (set, (surface, tree)) in &self.surfaces {
            let nodes = &mesh.node_sets[set];
            let points: Vec<[f64; 3]> = nodes.iter().map(|&n| moved[n as usize]).collect();
            let distances = closest_distances_mm(&points, tree);
            for (&n, &d) in nodes.iter().zip(&distances) {
                let n = n as usize;
                // A node on two sets (where margin and ventricle meet) keeps its smaller error.
                errors.node_error_mm[n] = if errors.node_observed[n] { errors.node_error_mm[n].min(d) } else { d };
                errors.node_observed[n] = true;
            }
            if let Some(rmse) = root_mean_square(&distances) {
                errors.rmse_mm.insert(set.clone(), rmse);
            }
            if let Some(facets) = mesh.facet_sets.get(set) {
                let (part, _) = TriMesh::from_facets(&moved, facets);
                if let Some(distance) = symmetric_distance(&part, surface) {
                    errors.symmetric.insert(set.clone(), distance);
                }
            }
        }
        errors
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;

    /// A square sheet at height z over the block's base.
    fn sheet(z: f64) -> TriMesh {
        let corner = |x: f64, y: f64| [x, y, z];
        let nodes_mm = vec![corner(-50.0, -50.0), corner(90.0, -50.0), corner(90.0, 90.0), corner(-50.0, 90.0)];
        TriMesh { nodes_mm, triangles: vec![[0, 1, 2], [0, 2, 3]] }
    }

    #[test]
    fn the_error_at_rest_is_what_mesh_and_scans_are_off_together() {
        let mesh = block(3);
        // The upper face lies .3 mm from the surface it follows; the brain's surface .4 mm further off on the other scan.
        let own = BTreeMap::from([("superior".to_owned(), sheet(30.3))]);
        let brains = [&sheet(-1.0), &sheet(-1.4)];
        let error = error_at_rest_mm(&mesh, &own, "base", brains).unwrap();
        assert!((error - 0.5).abs() < 1e-12, "{error}");
        assert_eq!(error_at_rest_mm(&mesh, &own, "falx", brains), None);
    }
}
