//! Mass of the free nodes: lumped, or the Galerkin matrix on the pattern of the stiffness.

use super::element::Body;
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

impl Mass {
    pub(super) fn new(model: &Model) -> Self {
        let pattern = Arc::clone(&model.pattern);
        let mut mass = Self { blocks: vec![0.0; pattern.columns.len()], pattern };
        mass.add_elements(model, model.body.as_ref());
        mass
    }

    fn add_elements(&mut self, model: &Model, body: &dyn Body) {
        let density = model.scenario.loads.density_kg_per_m3;
        let lumped = model.scenario.dynamics.mass == MassKind::Lumped;
        body.each_element(&mut |element, volume| {
            // Diagonal scaled to the whole mass (Hinton, Rock and Zienkiewicz, 1976): a quarter each for four nodes.
            let trace: f64 = (0..element.len()).map(|a| body.mass_share(a, a)).sum();
            let row = |a: usize| model.row_of[element[a] as usize];
            for a in (0..element.len()).filter(|&a| row(a) != HELD) {
                if lumped {
                    let own = self.pattern.diagonal[row(a) as usize] as usize;
                    self.blocks[own] += density * volume * body.mass_share(a, a) / trace;
                    continue;
                }
                for b in (0..element.len()).filter(|&b| row(b) != HELD) {
                    let at = self.pattern.position(row(a), row(b));
                    if at != HELD {
                        self.blocks[at as usize] += density * volume * body.mass_share(a, b);
                    }
                }
            }
        });
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
        for v in tangent.walls.iter_mut().flat_map(|(_, block)| block) {
            *v *= stiffness_factor;
        }
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
