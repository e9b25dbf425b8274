//! Mass of the free nodes: lumped, or the Galerkin matrix on the pattern of the stiffness.

use super::body::Body;
use super::linear::Tangent;
use super::model::Model;
use super::reduce::by_rows;
use super::scenario::MassKind;
use super::sparse::{BlockPattern, HELD};
use std::sync::Arc;

/// One number per block of the pattern, kg: every block is that times the identity.
pub(super) struct Mass {
    pattern: Arc<BlockPattern>,
    blocks: Vec<f64>,
}

/// Integrals of products of shape functions over a tetrahedron of volume 1: (1 + [a = b]) / 20.
fn linear(a: usize, b: usize) -> f64 {
    if a == b { 0.1 } else { 0.05 }
}

/// The same for the quadratic tetrahedron with straight edges (Zienkiewicz and Taylor, vol. 1).
fn quadratic(a: usize, b: usize) -> f64 {
    use super::element::EDGES;
    let at_edge = |corner: usize, edge: usize| EDGES[edge - 4].contains(&corner);
    let entry = match (a < 4, b < 4) {
        (true, true) => [1.0, 6.0][usize::from(a == b)],
        (true, false) => [-6.0, -4.0][usize::from(at_edge(a, b))],
        (false, true) => [-6.0, -4.0][usize::from(at_edge(b, a))],
        (false, false) => {
            let shared = EDGES[a - 4].iter().filter(|c| EDGES[b - 4].contains(c)).count();
            [8.0, 16.0, 32.0][shared]
        }
    };
    entry / 420.0
}

impl Mass {
    pub(super) fn new(model: &Model) -> Self {
        let pattern = Arc::clone(&model.pattern);
        let mut mass = Self { blocks: vec![0.0; pattern.columns.len()], pattern };
        match &model.body {
            Body::Tet4(e) | Body::Tet4Nodal(e, _) => {
                let volumes = e.points.iter().map(|p| p[0].weight_m3);
                mass.add_elements(model, &e.nodes, volumes, linear);
            }
            Body::Tet10(e) => {
                let volumes = e.points.iter().map(|p| p.iter().map(|q| q.weight_m3).sum());
                mass.add_elements(model, &e.nodes, volumes, quadratic);
            }
        }
        mass
    }

    fn add_elements<const K: usize>(
        &mut self,
        model: &Model,
        nodes: &[[u32; K]],
        volumes_m3: impl Iterator<Item = f64>,
        share: fn(usize, usize) -> f64,
    ) {
        let density = model.scenario.loads.density_kg_per_m3;
        let lumped = model.scenario.dynamics.mass == MassKind::Lumped;
        // Diagonal scaled to the whole mass (Hinton, Rock and Zienkiewicz, 1976): a quarter each for four nodes.
        let trace: f64 = (0..K).map(|a| share(a, a)).sum();
        for (element, volume) in nodes.iter().zip(volumes_m3) {
            let rows = element.map(|n| model.row_of[n as usize]);
            for a in (0..K).filter(|&a| rows[a] != HELD) {
                if lumped {
                    let own = self.pattern.diagonal[rows[a] as usize] as usize;
                    self.blocks[own] += density * volume * share(a, a) / trace;
                    continue;
                }
                for b in (0..K).filter(|&b| rows[b] != HELD) {
                    let at = self.pattern.position(rows[a], rows[b]);
                    if at != HELD {
                        self.blocks[at as usize] += density * volume * share(a, b);
                    }
                }
            }
        }
    }

    /// M x.
    pub(super) fn product(&self, x: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let pattern = &*self.pattern;
        let mut product = vec![[0.0; 3]; pattern.rows()];
        by_rows(&mut product, |first, rows| {
            for (row, sum) in (first..).zip(rows) {
                for at in pattern.row_start[row]..pattern.row_start[row + 1] {
                    let (m, x) = (self.blocks[at], x[pattern.columns[at] as usize]);
                    (0..3).for_each(|i| sum[i] += m * x[i]);
                }
            }
            []
        });
        product
    }

    /// factor M + stiffness_factor K.
    pub(super) fn plus(&self, factor: f64, mut tangent: Tangent, stiffness_factor: f64) -> Tangent {
        by_rows(&mut tangent.matrix.blocks, |first, blocks| {
            for (block, m) in blocks.iter_mut().zip(&self.blocks[first..]) {
                for v in block.iter_mut() {
                    *v *= stiffness_factor;
                }
                for i in [0, 4, 8] {
                    block[i] += factor * m;
                }
            }
            []
        });
        if let Some(nodal) = &mut tangent.nodal {
            by_rows(&mut nodal.moduli, |_, moduli| {
                for v in moduli.as_flattened_mut() {
                    *v *= stiffness_factor;
                }
                []
            });
        }
        tangent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_a_tetrahedron_sum_to_one() {
        let sum = |n: usize, f: fn(usize, usize) -> f64| -> f64 {
            (0..n).flat_map(|a| (0..n).map(move |b| (a, b))).map(|(a, b)| f(a, b)).sum()
        };
        assert!((sum(4, linear) - 1.0).abs() < 1e-15);
        assert!((sum(10, quadratic) - 1.0).abs() < 1e-15);
        // Rows integrate single shape functions: -1/20 at corners, 1/5 at mid-edges.
        let row = |a: usize| (0..10).map(|b| quadratic(a, b)).sum::<f64>();
        assert!((0..4).all(|a| (row(a) + 0.05).abs() < 1e-15) && (4..10).all(|a| (row(a) - 0.2).abs() < 1e-15));
    }
}
