//! Which walls a scenario means, and the mesh that they need: sheets are cut open.

use super::settings::{Contact, Support, Wall};
use crate::fem::FemError;
use crate::fem::scenario::Scenario;
use crate::mesh::{TET_FACES, TetMesh};
use std::borrow::Cow;
use std::collections::BTreeMap;

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
                let cut = body.cut_along(set, &facets);
                self.check_nothing_floats(&cut, set)?;
                body = Cow::Owned(cut);
            }
        }
        Ok(body)
    }

    /// What a cut leaves without a facet to the rest must be held by itself: an edge or a corner holds nothing.
    fn check_nothing_floats(&self, cut: &TetMesh, set: &str) -> Result<(), FemError> {
        let moved = self.prescribed.iter().map(|p| &p.set);
        let holding: Vec<&String> = self.held().chain(moved).chain(self.tethers.iter().map(|t| &t.set)).collect();
        let mut held: Vec<u32> = Vec::new();
        for set in &holding {
            held.extend(cut.node_sets.get(*set).into_iter().flatten());
            held.extend(cut.facet_sets.get(*set).into_iter().flatten().flatten());
        }
        held.sort_unstable();
        let pieces = cut.pieces_beside(&[]);
        let mut at_sheet: Vec<u32> = cut.facet_sets.get(set).map(|f| f.as_flattened().to_vec()).unwrap_or_default();
        at_sheet.sort_unstable();
        // A piece by its first cell: how many cells, whether held, whether the sheet bounds it.
        let mut found: BTreeMap<u32, (usize, bool, bool)> = BTreeMap::new();
        for (tet, piece) in cut.tets().iter().zip(&pieces) {
            let (cells, is_held, beside) = found.entry(*piece).or_default();
            *cells += 1;
            *is_held |= tet.iter().any(|n| held.binary_search(n).is_ok());
            *beside |= tet.iter().filter(|n| at_sheet.binary_search(n).is_ok()).count() >= 3;
        }
        // A body that nothing holds anywhere is refused for that; a wall before all of it holds no piece of it.
        let any_held = found.values().any(|piece| piece.1);
        match found.iter().find(|(_, (_, held, beside))| any_held && *beside && !held) {
            Some((cell, (cells, ..))) => {
                Err(FemError::Floats { set: set.to_owned(), cells: *cells, cell: *cell as usize })
            }
            None => Ok(()),
        }
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
    let whole: Vec<[u32; 3]> = facets.iter().map(|f| f.0).collect();
    let outside = facets.iter().filter(|f| !f.1).map(|f| f.0);
    let sheet: Vec<[u32; 3]> = mesh.without_crumbs(&whole).into_iter().chain(outside).collect();
    // A sheet has no inside: a tetrahedron with all its facets in the set is one of a slab, and so is a set of which much would
    // have to be left uncut.
    let inside = cell_inside(mesh, &sheet);
    let size = |facets: &[[u32; 3]]| -> f64 { facets.iter().map(|&f| mesh.area_vector_mm2(f).norm()).sum() };
    let slab = || if size(&sheet) < (1.0 - MOST_UNCUT) * size(&whole) { cell_inside(mesh, &whole) } else { None };
    match inside.or_else(slab) {
        Some(cell) => Err(FemError::NoSheet { set: set.to_owned(), cell }),
        None => Ok(sheet),
    }
}

/// The part of a sheet's area that may be left uncut for the sake of crumbs at its folds; of a slab every cell would keep one of its four
/// facets, a quarter of them all.
const MOST_UNCUT: f64 = 0.2;

/// A tetrahedron all of whose facets are of the sheet.
fn cell_inside(mesh: &TetMesh, sheet: &[[u32; 3]]) -> Option<usize> {
    let sorted = |mut facet: [u32; 3]| {
        facet.sort_unstable();
        facet
    };
    let mut sheet: Vec<[u32; 3]> = sheet.iter().copied().map(sorted).collect();
    sheet.sort_unstable();
    let of_sheet = |tet: &[u32; 4], face: [usize; 3]| sheet.binary_search(&sorted(face.map(|c| tet[c]))).is_ok();
    mesh.tets().iter().position(|tet| TET_FACES.iter().all(|face| of_sheet(tet, *face)))
}
