//! The mesh with the resected tissue and without it: one numbering for the page, whichever is stepped.

use crate::mesh::TetMesh;

/// Rounds in which the put-back tissue's nodes take the mean of their neighbours: news goes one cell a round, and a resection is
/// some ten cells across.
const ROUNDS: usize = 60;

/// The whole mesh, and what is left of it once the resected tissue is out.
pub(super) struct Parts {
    whole: TetMesh,
    label: Option<u8>,
    rest: Option<Rest>,
}

/// The mesh without the resected tissue.
struct Rest {
    mesh: TetMesh,
    /// Node of the whole mesh of every node.
    whole_of: Vec<u32>,
}

impl Parts {
    /// Of a mesh whose resected tissue has this label, if any.
    pub fn new(whole: TetMesh, label: Option<u8>) -> Self {
        let rest = label.filter(|label| whole.labels().contains(label)).and_then(|label| {
            let (left, first) = whole.restricted(|l| l != label)?;
            // What hangs on by an edge or a corner alone is held by nothing once its neighbours are out.
            let (mesh, second) = left.largest_face_connected_part()?;
            Some(Rest { mesh, whole_of: second.into_iter().map(|n| first[n as usize]).collect() })
        });
        Self { whole, label, rest }
    }

    /// The whole mesh.
    pub fn whole(&self) -> &TetMesh {
        &self.whole
    }

    /// The mesh to step: whole, or without the resected tissue; `None` where there is no such tissue.
    pub fn mesh(&self, removed: bool) -> Option<&TetMesh> {
        if removed { self.rest.as_ref().map(|rest| &rest.mesh) } else { Some(&self.whole) }
    }

    /// The label of the resected tissue, where there is any.
    pub fn label(&self) -> Option<u8> {
        self.label.filter(|_| self.rest.is_some())
    }

    /// Node of the whole mesh.
    pub fn whole_of(&self, removed: bool, node: u32) -> u32 {
        self.left(removed).map_or(node, |rest| rest.whole_of[node as usize])
    }

    /// Node of the mesh that is stepped; `None` for one that is out.
    pub fn stepped_of(&self, removed: bool, node: u32) -> Option<u32> {
        // Nodes keep their order when some are left out.
        self.left(removed).map_or(Some(node), |rest| rest.whole_of.binary_search(&node).ok().map(|n| n as u32))
    }

    fn left(&self, removed: bool) -> Option<&Rest> {
        self.rest.as_ref().filter(|_| removed)
    }

    /// Vectors at the nodes of the whole mesh; those that are out have none.
    pub fn on_whole(&self, removed: bool, of_nodes: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
        let Some(rest) = self.left(removed) else { return of_nodes };
        let mut all = vec![[0.0; 3]; self.whole.nodes_mm().len()];
        rest.whole_of.iter().zip(of_nodes).for_each(|(&n, u)| all[n as usize] = u);
        all
    }

    /// Displacements (mm) of the mesh to step from those of the whole one, in which the tissue was out if `was_removed`: tissue
    /// that is put back goes along with what is around it.
    pub fn carried(&self, was_removed: bool, removed: bool, mut whole_mm: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
        match (&self.rest, was_removed, removed) {
            (Some(rest), _, true) => rest.whole_of.iter().map(|&n| whole_mm[n as usize]).collect(),
            (Some(rest), true, false) => {
                self.fill(rest, &mut whole_mm);
                whole_mm
            }
            _ => whole_mm,
        }
    }

    /// A harmonic continuation by Jacobi's method over the edges.
    fn fill(&self, rest: &Rest, of_nodes: &mut [[f64; 3]]) {
        let mut known = vec![false; of_nodes.len()];
        rest.whole_of.iter().for_each(|&n| known[n as usize] = true);
        for _ in 0..ROUNDS {
            let mut sums = vec![[0.0; 4]; of_nodes.len()];
            for tet in self.whole.tets().iter().filter(|tet| tet.iter().any(|&n| !known[n as usize])) {
                for a in tet.map(|n| n as usize).into_iter().filter(|&a| !known[a]) {
                    for b in tet.map(|n| n as usize).into_iter().filter(|&b| b != a) {
                        (0..3).for_each(|i| sums[a][i] += of_nodes[b][i]);
                        sums[a][3] += 1.0;
                    }
                }
            }
            for (value, sum) in of_nodes.iter_mut().zip(sums).filter(|(_, sum)| sum[3] > 0.0) {
                *value = [0, 1, 2].map(|i| sum[i] / sum[3]);
            }
        }
    }
}
