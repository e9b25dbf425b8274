//! Model and seen displacement together: the model everywhere, put right by a process over what it leaves unexplained.

use super::process::{Process, Residual};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// How far the images say that a node has moved.
#[derive(Clone, Copy, Debug)]
pub struct SeenNode {
    /// The node.
    pub node: u32,
    /// Its displacement, mm.
    pub displacement_mm: [f64; 3],
    /// Standard deviation of one component, mm.
    pub noise_mm: f64,
}

/// Most residuals that a process is conditioned on: its cost grows with their cube.
const MOST: usize = 320;
/// Edges of the cells that leave one node each, mm; tried until few enough are left. A registration's errors are alike
/// over less than the first.
const CELLS_MM: [f64; 8] = [12.0, 14.0, 16.0, 18.0, 21.0, 25.0, 32.0, 45.0];

/// A state of the model put right by what was seen.
#[derive(Clone, Debug)]
pub struct Fused {
    /// Displacement of every node, mm.
    pub displacement_mm: Vec<[f64; 3]>,
    /// Standard deviation of every node (root of the trace), mm.
    pub sd_mm: Vec<f64>,
    /// The 95 % reach of every node, mm.
    pub reach95_mm: Vec<f64>,
    /// The discrepancy; `None` where the model leaves nothing unexplained.
    pub process: Option<Process>,
    /// Nodes whose residuals it was conditioned on.
    pub conditioned_on: usize,
}

/// The model's displacement with the most probable discrepancy added. `model_sd_mm`: of every node, from the posterior.
pub fn fused(nodes_mm: &[[f64; 3]], model_mm: &[[f64; 3]], model_sd_mm: &[f64], seen: &[SeenNode]) -> Fused {
    let chosen = thinned(nodes_mm, seen);
    let residuals: Vec<Residual> = chosen
        .iter()
        .map(|s| {
            let model = model_mm[s.node as usize];
            let value_mm = [0, 1, 2].map(|a| s.displacement_mm[a] - model[a]);
            Residual { x_mm: nodes_mm[s.node as usize], value_mm, noise_mm: s.noise_mm }
        })
        .collect();
    let process = Process::fitted(&residuals);
    let corrected: Vec<([f64; 3], f64)> =
        nodes_mm.par_iter().map(|x| process.as_ref().map_or(([0.0; 3], 0.0), |process| process.at(*x))).collect();
    let displacement_mm: Vec<[f64; 3]> =
        model_mm.iter().zip(&corrected).map(|(u, (d, _))| [0, 1, 2].map(|a| u[a] + d[a])).collect();
    let sd_mm: Vec<f64> =
        model_sd_mm.iter().zip(&corrected).map(|(model, (_, sd))| model.hypot(3f64.sqrt() * sd)).collect();
    let reach = |(u, sd): (&[f64; 3], &f64)| {
        // Along the mean, of a spread that is alike in all directions.
        u.iter().map(|x| x * x).sum::<f64>().sqrt() + 1.96 / 3f64.sqrt() * sd
    };
    let reach95_mm = displacement_mm.iter().zip(&sd_mm).map(reach).collect();
    Fused { displacement_mm, sd_mm, reach95_mm, process, conditioned_on: residuals.len() }
}

/// One node of each cell of a grid, the one with the least noise (the first of equals); cells as small as the number of
/// nodes allows.
fn thinned(nodes_mm: &[[f64; 3]], seen: &[SeenNode]) -> Vec<SeenNode> {
    let mut few = Vec::new();
    for cell_mm in CELLS_MM {
        let mut cells: BTreeMap<[i64; 3], SeenNode> = BTreeMap::new();
        for s in seen {
            let cell = nodes_mm[s.node as usize].map(|x| (x / cell_mm).floor() as i64);
            let kept = cells.entry(cell).or_insert(*s);
            if s.noise_mm < kept.noise_mm {
                *kept = *s;
            }
        }
        few = cells.into_values().collect();
        if few.len() <= MOST {
            break;
        }
    }
    few.truncate(MOST);
    few
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;

    /// A model that moves half as far as the tissue, seen at every fourth node.
    #[test]
    fn where_the_model_falls_short_the_seen_part_is_added_and_the_spread_says_how_well() {
        let mesh = block(8);
        let nodes = mesh.nodes_mm();
        let truth: Vec<[f64; 3]> = nodes.iter().map(|x| [0.0, 0.02 * x[1], -3.0 + 0.03 * x[2]]).collect();
        let model: Vec<[f64; 3]> = truth.iter().map(|u| u.map(|x| 0.5 * x)).collect();
        let seen: Vec<SeenNode> = (0..nodes.len())
            .step_by(4)
            .map(|n| SeenNode { node: n as u32, displacement_mm: truth[n], noise_mm: 0.05 })
            .collect();
        let found = fused(nodes, &model, &vec![0.1; nodes.len()], &seen);
        let off = |u: &[[f64; 3]]| {
            let squares = u.iter().zip(&truth).map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>());
            (squares.sum::<f64>() / nodes.len() as f64).sqrt()
        };
        assert!(off(&found.displacement_mm) < 0.1 * off(&model), "{} {}", off(&found.displacement_mm), off(&model));
        assert!(found.conditioned_on <= MOST && found.process.is_some());
        assert!(found.sd_mm.iter().all(|sd| *sd >= 0.1));
    }

    #[test]
    fn a_model_that_explains_all_is_left_as_it_is() {
        let mesh = block(4);
        let u: Vec<[f64; 3]> = mesh.nodes_mm().iter().map(|x| [0.01 * x[2], 0.0, 1.0]).collect();
        let seen: Vec<SeenNode> = u
            .iter()
            .enumerate()
            .map(|(n, u)| SeenNode { node: n as u32, displacement_mm: *u, noise_mm: 0.1 })
            .collect();
        let sd = vec![0.2; u.len()];
        let found = fused(mesh.nodes_mm(), &u, &sd, &seen);
        assert!(found.process.is_none() && found.displacement_mm == u && found.sd_mm == sd);
    }

    #[test]
    fn nothing_seen_leaves_the_model_alone() {
        let mesh = block(3);
        let u = vec![[1.0, 0.0, 0.0]; mesh.nodes_mm().len()];
        let found = fused(mesh.nodes_mm(), &u, &vec![0.0; u.len()], &[]);
        assert!(found.displacement_mm == u && found.conditioned_on == 0);
    }
}
