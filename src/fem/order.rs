//! Reverse Cuthill-McKee numbering: neighbours in the mesh become neighbours in memory.
//!
//! Source: George and Liu, "Computer Solution of Large Sparse Positive Definite Systems", 1981, ch. 4.

use super::portion::Portion;

/// Adjacency of nodes in compressed rows, without the diagonal, ascending.
pub(super) struct Graph {
    pub start: Vec<usize>,
    pub neighbours: Vec<u32>,
}

impl Graph {
    /// Nodes are neighbours when an element holds both.
    pub(super) fn of_elements<const K: usize>(nodes: usize, elements: &[[u32; K]]) -> Self {
        let mut incident_start = vec![0usize; nodes + 1];
        for n in elements.iter().flatten() {
            incident_start[*n as usize + 1] += 1;
        }
        for n in 0..nodes {
            incident_start[n + 1] += incident_start[n];
        }
        let mut incident = vec![0u32; incident_start[nodes]];
        let mut fill = incident_start.clone();
        for (e, element) in elements.iter().enumerate() {
            for n in element {
                incident[fill[*n as usize]] = e as u32;
                fill[*n as usize] += 1;
            }
        }
        let mut start = Vec::with_capacity(nodes + 1);
        start.push(0);
        let mut neighbours = Vec::new();
        let mut seen = vec![u32::MAX; nodes];
        for n in 0..nodes {
            let from = neighbours.len();
            seen[n] = n as u32;
            for &e in &incident[incident_start[n]..incident_start[n + 1]] {
                for &m in &elements[e as usize] {
                    if seen[m as usize] != n as u32 {
                        seen[m as usize] = n as u32;
                        neighbours.push(m);
                    }
                }
            }
            neighbours[from..].sort_unstable();
            start.push(neighbours.len());
        }
        Self { start, neighbours }
    }

    pub(super) fn of(&self, node: usize) -> &[u32] {
        &self.neighbours[self.start[node]..self.start[node + 1]]
    }

    pub(super) fn len(&self) -> usize {
        self.start.len() - 1
    }
}

/// Breadth-first levels from `root` over nodes not yet numbered; returns the visit order and the depth.
fn level_structure(graph: &Graph, root: u32, numbered: &[bool], stamp: &mut [u32], mark: u32) -> (Vec<u32>, usize) {
    let mut visit = vec![root];
    stamp[root as usize] = mark;
    let (mut from, mut depth) = (0, 0);
    while from < visit.len() {
        let to = visit.len();
        for at in from..to {
            for &m in graph.of(visit[at] as usize) {
                if stamp[m as usize] != mark && !numbered[m as usize] {
                    stamp[m as usize] = mark;
                    visit.push(m);
                }
            }
        }
        from = to;
        depth += 1;
    }
    (visit, depth)
}

/// Old node number at every new position.
pub(super) fn reverse_cuthill_mckee(graph: &Graph) -> Vec<u32> {
    let nodes = graph.len();
    let degree = |n: u32| graph.of(n as usize).len();
    let mut numbered = vec![false; nodes];
    let mut stamp = vec![0u32; nodes];
    let mut mark = 0;
    let mut order: Vec<u32> = Vec::with_capacity(nodes);
    for seed in 0..nodes {
        if numbered[seed] {
            continue;
        }
        // A pseudo-peripheral root: walk to the far end until the depth stops growing.
        let (mut root, mut depth) = (seed as u32, 0);
        loop {
            mark += 1;
            let (visit, found) = level_structure(graph, root, &numbered, &mut stamp, mark);
            if found <= depth {
                break;
            }
            depth = found;
            root = *visit.last().unwrap_or(&root);
        }
        let mut head = order.len();
        order.push(root);
        numbered[root as usize] = true;
        while head < order.len() {
            let from = order.len();
            for &m in graph.of(order[head] as usize) {
                if !numbered[m as usize] {
                    numbered[m as usize] = true;
                    order.push(m);
                }
            }
            order[from..].sort_by_key(|&m| (degree(m), m));
            head += 1;
        }
    }
    order.reverse();
    order
}

/// A graph in new numbers.
pub(super) fn renumbered(graph: &Graph, order: &[u32], number: &[u32]) -> Graph {
    let (mut start, mut neighbours) = (vec![0], Vec::with_capacity(graph.neighbours.len()));
    for &old in order {
        neighbours.extend(graph.of(old as usize).iter().map(|&m| number[m as usize]));
        start.push(neighbours.len());
    }
    Graph { start, neighbours }
}

/// Elements in solver numbers, one for each portion of a cell, ordered by their first node so that neighbours in the list share
/// memory.
pub(super) fn sorted<const K: usize>(
    tets: &[[u32; K]],
    number: &[u32],
    portions: &[Portion],
) -> (Vec<[u32; K]>, Vec<Portion>) {
    let renumbered = |portion: &Portion| tets[portion.cell as usize].map(|n| number[n as usize]);
    let mut sorted = portions.to_vec();
    sorted.sort_by_cached_key(|portion| (renumbered(portion).iter().copied().min(), portion.cell, portion.material));
    (sorted.iter().map(renumbered).collect(), sorted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_a_permutation_even_of_a_mesh_in_two_pieces() {
        let graph = Graph::of_elements(9, &[[0, 7, 2, 4], [4, 2, 8, 7], [1, 3, 5, 6]]);
        let mut order = reverse_cuthill_mckee(&graph);
        order.sort_unstable();
        assert_eq!(order, (0..9).collect::<Vec<u32>>());
    }

    #[test]
    fn a_shuffled_path_gets_bandwidth_one() {
        let shuffled = [3u32, 0, 4, 1, 5, 2];
        let graph = Graph::of_elements(6, &shuffled.windows(2).map(|w| [w[0], w[1]]).collect::<Vec<_>>());
        let order = reverse_cuthill_mckee(&graph);
        for w in order.windows(2) {
            assert!(graph.of(w[0] as usize).contains(&w[1]));
        }
    }
}
