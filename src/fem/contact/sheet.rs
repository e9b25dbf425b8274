//! Which walls a scenario means, and the mesh that they need: sheets are cut open.

use super::settings::{Contact, Support, Wall};
use crate::fem::FemError;
use crate::fem::scenario::Scenario;
use crate::mesh::TetMesh;
use std::borrow::Cow;

/// The scenario's walls: its own, and one for every set that slides.
pub(in crate::fem) fn all_contacts(scenario: &Scenario) -> Vec<Contact> {
    let sliding = scenario.supports.iter().filter(|(_, support)| **support == Support::Sliding);
    // A sheet cut open is a surface like any other.
    let own = sliding.map(|(set, _)| Contact::new(set, Wall::OwnSurface, 0.0));
    scenario.contact.iter().cloned().chain(own).collect()
}

impl Scenario {
    /// The mesh as the supports need it: cut open along sheets that slide, new nodes behind the mesh's own. A mesh that
    /// is cut already, or needs no cut, comes back as it is. Outcomes are numbered by it.
    ///
    /// # Errors
    /// [`FemError::UnknownSet`], and [`FemError::NoSheet`] for a set that cannot be cut along.
    pub fn body<'a>(&self, mesh: &'a TetMesh) -> Result<Cow<'a, TetMesh>, FemError> {
        let mut body = Cow::Borrowed(mesh);
        let sheets = self.contact.iter().filter(|c| matches!(c.wall, Wall::Sheet)).map(|c| &c.set);
        let sliding = self.supports.iter().filter(|(_, s)| **s == Support::Sliding).map(|(set, _)| set);
        for set in sheets.chain(sliding) {
            let facets = sheet_of(&body, set)?;
            if !facets.is_empty() {
                body = Cow::Owned(body.cut_along(set, &facets));
            }
        }
        Ok(body)
    }
}

/// The facets of a set that lie between two tetrahedra, when they are most of it.
fn sheet_of(mesh: &TetMesh, set: &str) -> Result<Vec<[u32; 3]>, FemError> {
    let sorted = |mut facet: [u32; 3]| {
        facet.sort_unstable();
        facet
    };
    let facets: Vec<([u32; 3], bool)> = match (mesh.facet_sets.get(set), mesh.node_sets.get(set)) {
        (Some(facets), _) => {
            let mut wanted: Vec<[u32; 3]> = facets.iter().copied().map(sorted).collect();
            wanted.sort_unstable();
            let found = mesh.facets().into_iter().filter(|f| wanted.binary_search(&sorted(f.0)).is_ok());
            found.map(|(facet, _, other)| (facet, other.is_some())).collect()
        }
        (None, Some(nodes)) => {
            let inside = |n: &u32| nodes.binary_search(n).is_ok();
            let found = mesh.facets().into_iter().filter(|f| f.0.iter().all(inside));
            found.map(|(facet, _, other)| (facet, other.is_some())).collect()
        }
        (None, None) => return Err(FemError::unknown_set(mesh, set)),
    };
    let area = |within: bool| -> f64 {
        facets.iter().filter(|f| f.1 == within).map(|f| mesh.area_vector_mm2(f.0).norm()).sum()
    };
    if area(true) <= area(false) {
        return Ok(Vec::new());
    }
    // A sheet has no inside: a tetrahedron with all its nodes in the set is one of a slab.
    let mut nodes: Vec<u32> = facets.iter().flat_map(|f| f.0).collect();
    nodes.sort_unstable();
    match mesh.tets().iter().position(|tet| tet.iter().all(|n| nodes.binary_search(n).is_ok())) {
        Some(cell) => Err(FemError::NoSheet { set: set.to_owned(), cell }),
        None => Ok(facets.into_iter().map(|f| f.0).collect()),
    }
}
