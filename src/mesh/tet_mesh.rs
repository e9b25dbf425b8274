//! A labelled tetrahedral mesh with named sets, valid by construction.

use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use thiserror::Error;

/// The four faces of a tetrahedron as local corners, each seen counter-clockwise from outside.
pub const TET_FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// The part of every cell that each label fills, by label.
pub type Fractions = BTreeMap<u8, Vec<f64>>;

/// How far the fractions of a cell may sum beside one: what six digits in a file lose.
const SUM_TOLERANCE: f64 = 1e-5;

/// Linear tetrahedra, mm, RAS+. Every tet has positive volume, every index is valid, every coordinate finite.
///
/// ```
/// use hgm::mesh::TetMesh;
/// let nodes = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// assert!(TetMesh::new(nodes.clone(), vec![[0, 1, 2, 3]], vec![2]).is_ok());
/// assert!(TetMesh::new(nodes, vec![[0, 2, 1, 3]], vec![2]).is_err()); // inverted
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct TetMesh {
    nodes_mm: Vec<[f64; 3]>,
    tets: Vec<[u32; 4]>,
    labels: Vec<u8>,
    fractions: Fractions,
    /// Named node sets, node numbers ascending.
    pub node_sets: BTreeMap<String, Vec<u32>>,
    /// Named facet sets: triangles by node numbers, outward where the facet has an outside.
    pub facet_sets: BTreeMap<String, Vec<[u32; 3]>>,
}

/// Why nodes and tets are not a mesh.
#[derive(Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum MeshError {
    #[error("the mesh has no tetrahedra; export the volume cells too")]
    Empty,
    #[error("{labels} labels for {tets} tetrahedra: one each is needed")]
    LabelCount { tets: usize, labels: usize },
    #[error("node {node} (counted from 0) has a coordinate that is not a finite number; repair the mesh")]
    NotFinite { node: usize },
    #[error(
        "tetrahedron {tet} (counted from 0) names node {node}, but there are only {nodes} nodes; write the file again"
    )]
    NoSuchNode { tet: usize, node: u32, nodes: usize },
    #[error("tetrahedron {tet} has volume {volume_mm3:e} mm3: inverted or flat; reorder its nodes or repair the mesh")]
    NotPositive { tet: usize, volume_mm3: f64 },
    #[error("{found} fractions of label {label} for {tets} tetrahedra: one each is needed")]
    FractionCount { label: u8, tets: usize, found: usize },
    #[error(
        "the fractions of tetrahedron {tet} (counted from 0) are not parts of one whole: each is 0 to 1 and together they make 1, but they \
         make {sum}; mesh it again, or take the arrays `fraction:` out of the file"
    )]
    Fractions { tet: usize, sum: f64 },
    #[error("set `{set}` names node {node}, but there are only {nodes} nodes")]
    SetNode { set: String, node: u32, nodes: usize },
}

impl TetMesh {
    /// A mesh from nodes (mm), tets (right-handed: det[x1-x0, x2-x0, x3-x0] > 0) and one label per tet.
    ///
    /// # Errors
    /// [`MeshError`] names the first offending node or tet.
    pub fn new(nodes_mm: Vec<[f64; 3]>, tets: Vec<[u32; 4]>, labels: Vec<u8>) -> Result<Self, MeshError> {
        if tets.is_empty() {
            return Err(MeshError::Empty);
        }
        if tets.len() != labels.len() {
            return Err(MeshError::LabelCount { tets: tets.len(), labels: labels.len() });
        }
        if let Some(node) = nodes_mm.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            return Err(MeshError::NotFinite { node });
        }
        for (t, tet) in tets.iter().enumerate() {
            if let Some(&node) = tet.iter().find(|&&n| n as usize >= nodes_mm.len()) {
                return Err(MeshError::NoSuchNode { tet: t, node, nodes: nodes_mm.len() });
            }
            let volume_mm3 = signed_volume(&nodes_mm, tet);
            if volume_mm3 <= 0.0 {
                return Err(MeshError::NotPositive { tet: t, volume_mm3 });
            }
        }
        let (fractions, node_sets, facet_sets) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
        Ok(Self { nodes_mm, tets, labels, fractions, node_sets, facet_sets })
    }

    /// Node coordinates in mm.
    pub fn nodes_mm(&self) -> &[[f64; 3]] {
        &self.nodes_mm
    }

    /// Node numbers of every tetrahedron.
    pub fn tets(&self) -> &[[u32; 4]] {
        &self.tets
    }

    /// One label per tetrahedron (see `segment::label`).
    pub fn labels(&self) -> &[u8] {
        &self.labels
    }

    /// What lies within the cells, where that is known; else empty, and every cell is of its label alone. `hgm simulate` takes a cell
    /// for the mix of it.
    pub fn fractions(&self) -> &Fractions {
        &self.fractions
    }

    /// Says what lies within the cells.
    ///
    /// # Errors
    /// [`MeshError::FractionCount`] and [`MeshError::Fractions`].
    pub fn set_fractions(&mut self, fractions: Fractions) -> Result<(), MeshError> {
        let tets = self.tets.len();
        if let Some((&label, of)) = fractions.iter().find(|(_, of)| of.len() != tets) {
            return Err(MeshError::FractionCount { label, tets, found: of.len() });
        }
        for tet in 0..if fractions.is_empty() { 0 } else { tets } {
            let sum: f64 = fractions.values().map(|of| of[tet]).sum();
            let parts = fractions.values().all(|of| (0.0..=1.0).contains(&of[tet]));
            if !parts || (sum - 1.0).abs() > SUM_TOLERANCE {
                return Err(MeshError::Fractions { tet, sum });
            }
        }
        self.fractions = fractions;
        Ok(())
    }

    /// The same mesh, every cell of its label alone.
    #[must_use]
    pub fn without_fractions(self) -> Self {
        Self { fractions: Fractions::new(), ..self }
    }

    /// Volume of one tetrahedron in mm3.
    pub fn volume_mm3(&self, tet: usize) -> f64 {
        signed_volume(&self.nodes_mm, &self.tets[tet])
    }

    /// The same mesh with its nodes moved, mm.
    ///
    /// # Errors
    /// [`MeshError`] where that turns a tetrahedron inside out.
    pub fn moved(self, to_mm: impl Fn([f64; 3]) -> [f64; 3]) -> Result<Self, MeshError> {
        let nodes_mm = self.nodes_mm.iter().map(|p| to_mm(*p)).collect();
        let moved = Self::new(nodes_mm, self.tets, self.labels)?;
        let Self { fractions, node_sets, facet_sets, .. } = self;
        Ok(Self { fractions, node_sets, facet_sets, ..moved })
    }

    /// Adds or replaces a node set; the numbers are sorted and made unique.
    ///
    /// # Errors
    /// [`MeshError::SetNode`] for a node that is not there.
    pub fn set_nodes(&mut self, name: &str, mut nodes: Vec<u32>) -> Result<(), MeshError> {
        nodes.sort_unstable();
        nodes.dedup();
        if let Some(&node) = nodes.last().filter(|&&n| n as usize >= self.nodes_mm.len()) {
            return Err(MeshError::SetNode { set: name.to_owned(), node, nodes: self.nodes_mm.len() });
        }
        self.node_sets.insert(name.to_owned(), nodes);
        Ok(())
    }

    /// The facets that belong to exactly one tetrahedron among those `keep` accepts (by label): the outer surface
    /// of that part, outward, in order of tetrahedron.
    pub fn boundary_facets(&self, keep: impl Fn(u8) -> bool) -> Vec<[u32; 3]> {
        let mut faces: Vec<([u32; 3], u32)> = Vec::new();
        for (t, tet) in self.tets.iter().enumerate().filter(|(t, _)| keep(self.labels[*t])) {
            for (f, face) in TET_FACES.iter().enumerate() {
                let mut key = face.map(|c| tet[c]);
                key.sort_unstable();
                faces.push((key, (4 * t + f) as u32));
            }
        }
        faces.sort_unstable();
        let single = |n: usize| {
            (n == 0 || faces[n - 1].0 != faces[n].0) && (n + 1 == faces.len() || faces[n + 1].0 != faces[n].0)
        };
        let mut outer: Vec<u32> = (0..faces.len()).filter(|&n| single(n)).map(|n| faces[n].1).collect();
        outer.sort_unstable();
        outer.into_iter().map(|id| TET_FACES[id as usize % 4].map(|c| self.tets[id as usize / 4][c])).collect()
    }

    /// The part of the mesh whose labels `keep` accepts, nodes renumbered in order, sets restricted (a facet stays
    /// when all its nodes stay). `None` when nothing is left. Also returns, for every new node, its old number.
    pub fn restricted(&self, keep: impl Fn(u8) -> bool) -> Option<(Self, Vec<u32>)> {
        self.part(|t| keep(self.labels[t]))
    }

    /// The largest part whose tetrahedra hang together through faces, as [`TetMesh::restricted`] returns it. What hangs
    /// on by an edge or a corner alone can turn about it without effort: no equilibrium would hold it.
    pub fn largest_face_connected_part(&self) -> Option<(Self, Vec<u32>)> {
        let mut faces: Vec<([u32; 3], u32)> = Vec::with_capacity(4 * self.tets.len());
        for (t, tet) in self.tets.iter().enumerate() {
            for face in TET_FACES {
                let mut key = face.map(|c| tet[c]);
                key.sort_unstable();
                faces.push((key, t as u32));
            }
        }
        faces.sort_unstable();
        let mut root: Vec<u32> = (0..self.tets.len() as u32).collect();
        for pair in faces.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
            let (a, b) = (root_of(&mut root, pair[0].1), root_of(&mut root, pair[1].1));
            root[a.max(b) as usize] = a.min(b);
        }
        let mut count = vec![0usize; self.tets.len()];
        for t in 0..self.tets.len() as u32 {
            count[root_of(&mut root, t) as usize] += 1;
        }
        // The first of equals, so that the answer does not depend on how ties are broken.
        let most = count.iter().copied().max()?;
        let largest = count.iter().position(|&c| c == most)? as u32;
        let belongs: Vec<bool> = (0..self.tets.len() as u32).map(|t| root_of(&mut root, t) == largest).collect();
        self.part(|t| belongs[t])
    }

    fn part(&self, keep: impl Fn(usize) -> bool) -> Option<(Self, Vec<u32>)> {
        let kept: Vec<usize> = (0..self.tets.len()).filter(|&t| keep(t)).collect();
        let mut new_number = vec![u32::MAX; self.nodes_mm.len()];
        for &t in &kept {
            for n in self.tets[t] {
                new_number[n as usize] = 0;
            }
        }
        let mut old_number = Vec::new();
        for (old, new) in new_number.iter_mut().enumerate().filter(|(_, new)| **new == 0) {
            *new = old_number.len() as u32;
            old_number.push(old as u32);
        }
        let number = |n: u32| Some(new_number[n as usize]).filter(|&n| n != u32::MAX);
        let nodes = old_number.iter().map(|&n| self.nodes_mm[n as usize]).collect();
        let tets = kept.iter().map(|&t| self.tets[t].map(|n| new_number[n as usize])).collect();
        let mut part = Self::new(nodes, tets, kept.iter().map(|&t| self.labels[t]).collect()).ok()?;
        for (&label, of) in &self.fractions {
            let of: Vec<f64> = kept.iter().map(|&t| of[t]).collect();
            // A label of the part is told of, be it that none of it lies in any cell.
            if of.iter().any(|f| *f > 0.0) || part.labels.contains(&label) {
                part.fractions.insert(label, of);
            }
        }
        for (name, set) in &self.node_sets {
            part.node_sets.insert(name.clone(), set.iter().filter_map(|&n| number(n)).collect());
        }
        for (name, set) in &self.facet_sets {
            let facet = |f: &[u32; 3]| Some([number(f[0])?, number(f[1])?, number(f[2])?]);
            part.facet_sets.insert(name.clone(), set.iter().filter_map(facet).collect());
        }
        Some((part, old_number))
    }
}

/// The first of what has been joined with `t`.
pub(super) fn root_of(root: &mut [u32], mut t: u32) -> u32 {
    while root[t as usize] != t {
        root[t as usize] = root[root[t as usize] as usize];
        t = root[t as usize];
    }
    t
}

fn signed_volume(nodes: &[[f64; 3]], tet: &[u32; 4]) -> f64 {
    let x = tet.map(|n| Vector3::from(nodes[n as usize]));
    Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]).determinant() / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_tets() -> TetMesh {
        let nodes = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]];
        TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4]], vec![2, 3]).unwrap()
    }

    #[test]
    fn outer_facets_point_outward_and_enclose_the_volume() {
        let mesh = two_tets();
        let facets = mesh.boundary_facets(|_| true);
        assert_eq!(facets.len(), 6);
        let enclosed: f64 = facets
            .iter()
            .map(|f| {
                let [a, b, c] = f.map(|n| Vector3::from(mesh.nodes_mm()[n as usize]));
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum();
        assert!((enclosed - mesh.volume_mm3(0) - mesh.volume_mm3(1)).abs() < 1e-14);
    }

    #[test]
    fn restriction_keeps_coordinates_and_sets() {
        let mut mesh = two_tets();
        mesh.set_nodes("tip", vec![4, 0]).unwrap();
        let (part, old) = mesh.restricted(|label| label == 3).unwrap();
        assert_eq!((part.tets().len(), old.as_slice()), (1, [1, 2, 3, 4].as_slice()));
        assert_eq!(part.node_sets["tip"], [3]);
        assert!(mesh.restricted(|_| false).is_none());
    }

    #[test]
    fn fractions_follow_their_cells_and_must_make_one() {
        let mut mesh = two_tets();
        let with = |grey: [f64; 2], white: [f64; 2]| Fractions::from([(2, grey.to_vec()), (3, white.to_vec())]);
        mesh.set_fractions(with([1.0, 0.25], [0.0, 0.75])).unwrap();
        assert_eq!(
            mesh.restricted(|label| label == 3).unwrap().0.fractions(),
            &Fractions::from([(2, vec![0.25]), (3, vec![0.75])])
        );
        assert_eq!(mesh.restricted(|label| label == 2).unwrap().0.fractions(), &Fractions::from([(2, vec![1.0])]));
        let mut other = mesh.clone();
        other.set_fractions(with([0.0, 0.25], [1.0, 0.75])).unwrap();
        assert!(other.restricted(|label| label == 2).unwrap().0.fractions().contains_key(&2));
        assert_eq!(mesh.clone().moved(|p| p).unwrap(), mesh);
        assert_eq!(mesh.cut_along("sheet", &[[1, 2, 3]]).fractions(), mesh.fractions());
        for wrong in [with([1.0, 0.25], [0.0, 0.7]), with([1.0, 1.5], [0.0, -0.5]), with([f64::NAN, 0.0], [0.0, 1.0])] {
            assert!(matches!(mesh.set_fractions(wrong), Err(MeshError::Fractions { .. })));
        }
        let short = Fractions::from([(2, vec![1.0])]);
        assert_eq!(mesh.set_fractions(short), Err(MeshError::FractionCount { label: 2, tets: 2, found: 1 }));
        assert_eq!(mesh.clone().without_fractions(), two_tets());
    }

    #[test]
    fn what_hangs_on_by_an_edge_is_no_part_of_the_body() {
        let mut nodes = two_tets().nodes_mm().to_vec();
        nodes.extend([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]);
        // The third tet shares only the edge 0-3 with the first.
        let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4], [0, 5, 6, 3]], vec![2, 2, 2]).unwrap();
        let (part, old) = mesh.largest_face_connected_part().unwrap();
        assert_eq!((part.tets().len(), old.len()), (2, 5));
    }

    #[test]
    fn invalid_meshes_are_refused_by_name() {
        let nodes = two_tets().nodes_mm().to_vec();
        let refuse = |tets, labels| TetMesh::new(nodes.clone(), tets, labels).unwrap_err();
        assert_eq!(refuse(vec![], vec![]), MeshError::Empty);
        assert!(matches!(refuse(vec![[0, 1, 2, 9]], vec![1]), MeshError::NoSuchNode { tet: 0, node: 9, nodes: 5 }));
        assert!(matches!(refuse(vec![[0, 2, 1, 3]], vec![1]), MeshError::NotPositive { tet: 0, .. }));
        assert!(matches!(refuse(vec![[0, 1, 1, 3]], vec![1]), MeshError::NotPositive { tet: 0, .. }));
        assert!(matches!(refuse(vec![[0, 1, 2, 3]], vec![]), MeshError::LabelCount { .. }));
    }
}
