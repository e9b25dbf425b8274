//! Pieces of a body that hang on to the rest by an edge or a corner: they would turn about it without effort.

use super::sharing::Sharing;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// A piece that can turn about what it hangs by.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Hinged {
    /// How many cells it has.
    pub cells: usize,
    /// The first of them.
    pub cell: usize,
    /// All its nodes.
    pub nodes: Vec<u32>,
}

/// Of a line this part of its length is no more than rounding.
const STRAIGHT: f64 = 1e-6;

/// The pieces, whose cells hang together through whole facets, that turn about a line or a point: what they share with a piece that
/// does not, and what of them is held, lies on one line. A piece that shares nodes with no other is none of these, and neither is one
/// that shares a whole rim, or facets that are divided otherwise on its side: three nodes that are not on a line keep it from turning.
pub(super) fn hinged(sharing: &Sharing, held: &[[bool; 3]], nodes_m: impl Fn(u32) -> [f64; 3]) -> Vec<Hinged> {
    let roots = sharing.mesh.pieces_beside(&[]);
    if roots.iter().all(|root| *root == 0) {
        return Vec::new();
    }
    let mut pieces: BTreeMap<u32, Hinged> = BTreeMap::new();
    for (cell, root) in roots.iter().enumerate() {
        let piece = pieces.entry(*root).or_insert_with(|| Hinged { cells: 0, cell, nodes: Vec::new() });
        piece.cells += 1;
        piece.nodes.extend(sharing.of_tet(cell).into_iter().map(|(node, _)| node));
    }
    let mut pieces: Vec<Hinged> = pieces.into_values().collect();
    let mut of_node = vec![Vec::new(); sharing.nodes()];
    for (n, piece) in pieces.iter_mut().enumerate() {
        piece.nodes.sort_unstable();
        piece.nodes.dedup();
        piece.nodes.iter().for_each(|node| of_node[*node as usize].push(n));
    }
    let shared = |node: &u32| of_node[*node as usize].len() > 1;
    let is_held = |node: &u32| held[*node as usize] != [false; 3];
    // How well what it alone has is held is the scenario's affair.
    let own = |piece: &Hinged| {
        piece.nodes.iter().any(|node| is_held(node) && !shared(node)) || !piece.nodes.iter().any(shared)
    };
    let mut stands: Vec<bool> = pieces.iter().map(own).collect();
    loop {
        let beside = |n: usize, node: &u32| of_node[*node as usize].iter().any(|&other| other != n && stands[other]);
        let kept = |n: usize| {
            let by = pieces[n].nodes.iter().filter(|node| is_held(node) || beside(n, node));
            !on_a_line(&by.map(|node| nodes_m(*node)).collect::<Vec<_>>())
        };
        let more: Vec<usize> = (0..pieces.len()).filter(|&n| !stands[n] && kept(n)).collect();
        if more.is_empty() {
            break;
        }
        for n in more {
            stands[n] = true;
        }
    }
    pieces.into_iter().zip(stands).filter(|(_, stands)| !stands).map(|(piece, _)| piece).collect()
}

/// Whether places lie on one line, or are fewer than three.
fn on_a_line(places: &[[f64; 3]]) -> bool {
    let [first, others @ ..] = places else { return true };
    let ways = || others.iter().map(|place| Vector3::from(*place) - Vector3::from(*first));
    let Some(along) = ways().max_by(|a, b| a.norm().total_cmp(&b.norm())) else { return true };
    let farthest = ways().map(|way| along.cross(&way).norm()).fold(0.0, f64::max);
    farthest <= STRAIGHT * along.norm_squared()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TetMesh;

    const NONE: [usize; 0] = [];

    /// The first cells of the pieces that turn.
    fn hinged_of(nodes: &[[f64; 3]], tets: &[[u32; 4]], held: &[u32]) -> Vec<usize> {
        let mesh = TetMesh::new(nodes.to_vec(), tets.to_vec(), vec![2; tets.len()]).unwrap();
        let mut of_nodes = vec![[false; 3]; nodes.len()];
        for &n in held {
            of_nodes[n as usize] = [true; 3];
        }
        let sharing = Sharing { mesh: &mesh, quadratic: None, lumped: false };
        hinged(&sharing, &of_nodes, |n| nodes[n as usize]).into_iter().map(|piece| piece.cell).collect()
    }

    #[test]
    fn a_cell_is_kept_by_a_facet_and_turns_about_an_edge_or_a_corner() {
        let [o, x, y, z] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let first = [0, 1, 2, 3];
        let facet = [1.0, 1.0, 1.0];
        assert_eq!(hinged_of(&[o, x, y, z, facet], &[first, [1, 2, 3, 4]], &[0, 1, 2]), NONE);
        // Along the edge from o to x, on the other side.
        let edge = [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
        let beside = [o, x, y, z, edge[0], edge[1]];
        let second = [0, 1, 4, 5];
        assert_eq!(hinged_of(&beside, &[first, second], &[0, 2, 3]), [1]);
        // Of its own it is held, if by one node only; on the edge that it hangs by it is not.
        assert_eq!(hinged_of(&beside, &[first, second], &[0, 2, 3, 5]), NONE);
        assert_eq!(hinged_of(&beside, &[first, second], &[0, 1, 2, 3]), [1]);
        // A corner, and a chain of two edges.
        let corner = [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
        let upon = [o, x, y, z, corner[0], corner[1], corner[2]];
        assert_eq!(hinged_of(&upon, &[first, [0, 5, 4, 6]], &[1, 2, 3]), [1]);
        let third = [[-1.0, -1.0, 0.0], [-1.0, -1.0, -1.0]];
        let chain = [o, x, y, z, edge[0], edge[1], third[0], third[1]];
        assert_eq!(hinged_of(&chain, &[first, second, [5, 4, 6, 7]], &[0, 2, 3]), [1, 2]);
        assert_eq!(hinged_of(&chain, &[first, second, [5, 4, 6, 7]], &[0, 2, 3, 6, 7]), NONE);
    }

    #[test]
    fn a_facet_that_is_divided_otherwise_on_either_side_keeps_what_is_behind_it() {
        // A square of two triangles below, and of the two others above.
        let square = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let nodes = [&square[..], &[[0.5, 0.5, -1.0], [0.5, 0.5, 1.0]]].concat();
        let tets = [[0, 2, 1, 4], [0, 3, 2, 4], [0, 1, 3, 5], [1, 2, 3, 5]];
        assert_eq!(hinged_of(&nodes, &tets, &[4]), NONE);
    }

    #[test]
    fn places_are_on_a_line_or_not_whatever_their_scale_and_order() {
        let line = [[0.1, 0.2, 0.3], [0.2, 0.4, 0.6], [0.7, 1.4, 2.1]];
        for scale in [1e-3, 1.0, 1e3] {
            let scaled = |places: &[[f64; 3]]| places.iter().map(|x| x.map(|v| scale * v)).collect::<Vec<_>>();
            assert!(on_a_line(&scaled(&line)) && on_a_line(&scaled(&line[..2])) && on_a_line(&[]));
            assert!(!on_a_line(&scaled(&[line[0], line[1], [0.5, 0.5, 0.5]])));
            assert!(!on_a_line(&scaled(&[line[0], [0.5, 0.5, 0.5], line[2]])));
        }
    }
}
