//! The tissue that every one of several plans leaves: what a comparison of plans may count.
//!
//! A plan's own tissue is what it does not take. Counted over that, the plan that takes most has least left to move, and would be
//! the best for that alone. Each plan also has a mesh of its own: what all leave is counted at the same voxels in each of them,
//! so that the same tissue is counted. What their meshes make of its movement differs still, by how much was not measured.

use super::modes::Modes;
use crate::experiment::field::of_voxels;
use crate::geometry::Mni;
use crate::image::Mask;
use crate::mesh::TetMesh;
use nalgebra::Vector3;
use rayon::prelude::*;

/// The tissue that all plans leave, as the nodes of each plan's mesh share it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LeftByAll {
    /// How much it is, cc.
    pub cc: f64,
    /// What every node stands for, cc, plan by plan; 0 of a node away from it.
    shares_cc: Vec<Vec<f64>>,
}

impl LeftByAll {
    /// Of the meshes of plans and what each of them takes, on one grid.
    pub fn of(meshes: &[&TetMesh], taken: &[Mask<Mni>]) -> Self {
        let Some(grid) = taken.first().map(|mask| mask.grid) else { return Self::default() };
        let mut left: Vec<bool> = (0..grid.len()).map(|n| taken.iter().all(|mask| !mask.data[n])).collect();
        for mesh in meshes {
            let (inside, _) = of_voxels(mesh.tets(), mesh.nodes_mm(), &grid, (), |_, _| ());
            left.iter_mut().zip(inside).for_each(|(left, inside)| *left = *left && inside);
        }
        let voxel_cc = grid.voxel_volume_mm3() / 1000.0;
        let shares_of = |mesh: &&TetMesh| {
            let of_corners = |t: u32, w: [f64; 4]| (t, [w[1] as f32, w[2] as f32, w[3] as f32]);
            let (_, found) = of_voxels(mesh.tets(), mesh.nodes_mm(), &grid, (0, [0.0; 3]), of_corners);
            let mut shares = vec![0.0; mesh.nodes_mm().len()];
            for (_, (t, others)) in left.iter().zip(found).filter(|(left, _)| **left) {
                let [b, c, d] = others.map(f64::from);
                // A voxel is a whole one, however its corners' weights were rounded.
                for (&n, weight) in mesh.tets()[t as usize].iter().zip([1.0 - b - c - d, b, c, d]) {
                    shares[n as usize] += weight * voxel_cc;
                }
            }
            shares
        };
        let shares_cc = meshes.iter().map(shares_of).collect();
        Self { cc: left.iter().filter(|left| **left).count() as f64 * voxel_cc, shares_cc }
    }

    /// How much of it moves by more than the threshold in every draw of a plan, cc: what a node stands for does where the node does.
    pub fn over_threshold_cc(&self, plan: usize, modes: &Modes, threshold_mm: f64) -> Vec<f64> {
        let nodes: Vec<(usize, f64)> =
            self.shares_cc[plan].iter().copied().enumerate().filter(|(_, share)| *share != 0.0).collect();
        let of_draw = |coordinates: &Vec<f64>| -> f64 {
            let over = |&&(n, _): &&(usize, f64)| {
                let mean = Vector3::from(modes.mean_mm[n]);
                let away = modes.modes_mm.iter().zip(coordinates).map(|(mode, c)| *c * Vector3::from(mode[n]));
                (mean + away.sum::<Vector3<f64>>()).norm() > threshold_mm
            };
            let cc: f64 = nodes.iter().filter(over).map(|(_, share)| share).sum();
            // As exact as a draw's own volume is kept: sums of the same in another order are the same.
            (cc * 1e4).round() / 1e4 + 0.0
        };
        modes.draws.par_iter().map(|draw| of_draw(&draw.coordinates)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::modes::DrawnState;
    use super::super::plans::{PlanDraws, compared_plans};
    use super::*;
    use crate::experiment::phantom::block;
    use crate::image::Grid;

    /// A block without what a plan takes of it.
    fn without(taken: &Mask<Mni>) -> TetMesh {
        let whole = block(6);
        let nodes = whole.nodes_mm();
        let middle = |tet: &[u32; 4]| {
            let sum: Vector3<f64> = tet.iter().map(|&n| Vector3::from(nodes[n as usize])).sum();
            (sum / 4.0).into()
        };
        let stays = |tet: &[u32; 4]| {
            let [x, y, z] = middle(tet);
            taken.nearest(crate::geometry::Position::new(x, y, z)) != Some(true)
        };
        let tets: Vec<[u32; 4]> = whole.tets().iter().copied().filter(stays).collect();
        let labels = vec![1; tets.len()];
        // Nodes of what was taken go, so that no plan's nodes have another's numbers.
        let mut number = vec![u32::MAX; nodes.len()];
        let mut kept = Vec::new();
        for n in tets.iter().flatten() {
            if number[*n as usize] == u32::MAX {
                number[*n as usize] = kept.len() as u32;
                kept.push(nodes[*n as usize]);
            }
        }
        let renumbered = tets.iter().map(|tet| tet.map(|n| number[n as usize])).collect();
        TetMesh::new(kept, renumbered, labels).unwrap()
    }

    fn draws(mesh: &TetMesh, moved_mm: impl Fn(&[f64; 3]) -> f64, count: usize) -> Modes {
        let draw = |number: usize| DrawnState {
            supports: "fixed".to_owned(),
            number,
            weight: 1.0 / count as f64,
            over_threshold_cc: 0.0,
            // Half of the draws move twice as far.
            coordinates: vec![(number % 2) as f64],
        };
        let mean_mm: Vec<[f64; 3]> = mesh.nodes_mm().iter().map(|x| [0.0, -moved_mm(x), 0.0]).collect();
        Modes { modes_mm: vec![mean_mm.clone()], mean_mm, draws: (0..count).map(draw).collect() }
    }

    /// A plan and one that contains it, and what all leave of the block.
    fn two_plans() -> (Vec<TetMesh>, LeftByAll) {
        let grid = Grid::<Mni>::axis_aligned([31; 3], [2.0; 3], [0.0; 3]);
        let up_to = |mm: f64| {
            Mask::from_fn(grid, |n| {
                let p = grid.centre(grid.voxel(n)).mm;
                p.x < mm && p.y < 30.0 && p.z < 30.0
            })
        };
        let taken = vec![up_to(10.0), up_to(30.0)];
        let meshes: Vec<TetMesh> = taken.iter().map(without).collect();
        let left = LeftByAll::of(&meshes.iter().collect::<Vec<_>>(), &taken);
        (meshes, left)
    }

    fn compared(meshes: &[TetMesh], left: &LeftByAll, moved_mm: [f64; 2]) -> super::super::plans::PlansOfHead {
        let plans = meshes.iter().zip(moved_mm).enumerate().map(|(n, (mesh, moved))| {
            let mut modes = draws(mesh, |_| moved, 40);
            let of_all_cc = left.over_threshold_cc(n, &modes, 2.0);
            // The plan's own, over all of its mesh: what it takes cannot move.
            let own = (0..mesh.tets().len()).map(|t| mesh.volume_mm3(t) / 1000.0).sum::<f64>();
            modes.draws.iter_mut().for_each(|draw| draw.over_threshold_cc = own);
            PlanDraws {
                plan: format!("plan-{}", n + 1),
                largest_mm: 3.0,
                draws: modes.draws,
                of_all_cc,
                refused: false,
            }
        });
        compared_plans("supine", &plans.collect::<Vec<_>>())
    }

    #[test]
    fn a_plan_that_takes_more_is_not_the_better_for_it() {
        let (meshes, left) = two_plans();
        assert!(meshes[0].tets().len() > meshes[1].tets().len() && left.cc > 100.0, "{}", left.cc);
        let found = compared(&meshes, &left, [3.0, 3.0]);
        let row = &found.plans[1];
        assert!(found.plans[0].over_threshold_cc > row.over_threshold_cc + 5.0, "its own tissue is less: {found:?}");
        assert_eq!((row.more_than_least_cc, row.more_interval_95_cc), (0.0, [0.0, 0.0]), "{found:?}");
        assert_eq!(found.not_told_from, ["plan-2"]);
        assert!(found.sentence.contains("cannot be told"), "{}", found.sentence);
        let all = found.plans.iter().all(|row| (row.left_by_all_over_cc - left.cc).abs() < 1e-3);
        assert!(all, "{} of {found:?}", left.cc);
    }

    #[test]
    fn of_what_all_leave_the_plan_that_moves_it_less_is_told() {
        let (meshes, left) = two_plans();
        // It leaves more, and none of that moves over the threshold.
        let found = compared(&meshes, &left, [0.9, 3.0]);
        assert!(found.least == "plan-1" && found.not_told_from.is_empty(), "{found:?}");
        assert!((found.plans[1].more_than_least_cc - left.cc).abs() < 1e-3, "{found:?}");
        assert!(found.sentence.contains("of the tissue that all plans leave"), "{}", found.sentence);
    }

    #[test]
    fn every_mesh_shares_out_the_same_volume() {
        let (meshes, left) = two_plans();
        for (mesh, shares) in meshes.iter().zip(&left.shares_cc) {
            assert_eq!(mesh.nodes_mm().len(), shares.len());
            assert!((shares.iter().sum::<f64>() - left.cc).abs() < 1e-6);
        }
        // Only a part of it moves.
        let modes = draws(&meshes[1], |x| if x[2] > 35.0 { 2.5 } else { 0.0 }, 2);
        let over = left.over_threshold_cc(1, &modes, 2.0);
        assert!(over[0] == over[1] && over[0] > 0.2 * left.cc && over[0] < 0.6 * left.cc, "{over:?} of {}", left.cc);
    }
}
