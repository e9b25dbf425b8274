//! What hands do to a body: springs that pull nodes, and a ball that pushes the surface out of itself.
//!
//! Both store energy like any elastic part, so that Newton's method and its line search treat them as such. A ball's
//! stiffness leaves out how its normal turns: that part is negative and would cost the tangent its sign.

use super::super::linear::Tangent;
use super::super::sparse::HELD;
use super::super::units::METRES_PER_MM;
use nalgebra::{Matrix3, Vector3};

/// A spring between a node and a place.
#[derive(Clone, Debug, PartialEq)]
pub struct Grip {
    /// Node of the mesh.
    pub node: u32,
    /// Displacement of the node at which the spring is slack, mm.
    pub to_mm: [f64; 3],
    /// Stiffness, N/mm.
    pub stiffness_n_per_mm: f64,
}

/// A ball that pushes surface nodes out of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre, mm.
    pub centre_mm: [f64; 3],
    /// Radius, mm.
    pub radius_mm: f64,
    /// Pressure per depth, Pa/mm.
    pub stiffness_pa_per_mm: f64,
}

/// A node of the surface: solver number, row, the area it stands for (m2).
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct SurfaceNode {
    pub node: u32,
    pub row: u32,
    pub area_m2: f64,
}

/// A grip in the solver's units: node, row, place (m), N/m.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Spring {
    pub node: u32,
    pub row: u32,
    pub to_m: Vector3<f64>,
    pub stiffness: f64,
}

/// All that hands do at one moment.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Hands {
    pub springs: Vec<Spring>,
    pub ball: Option<Ball>,
    pub surface: Vec<SurfaceNode>,
}

impl Hands {
    fn stretch(spring: &Spring, u: &[[f64; 3]]) -> Vector3<f64> {
        Vector3::from(u[spring.node as usize]) - spring.to_m
    }

    /// Nodes in the ball: with depth (m), outward normal, stiffness (N/m).
    fn pushed<'a>(
        &'a self,
        u: &'a [[f64; 3]],
        nodes_m: &'a [[f64; 3]],
    ) -> impl Iterator<Item = (&'a SurfaceNode, f64, Vector3<f64>, f64)> {
        self.ball.iter().flat_map(move |ball| {
            let centre = Vector3::from(ball.centre_mm) * METRES_PER_MM;
            let radius = ball.radius_mm * METRES_PER_MM;
            let pressure = ball.stiffness_pa_per_mm / METRES_PER_MM;
            self.surface.iter().filter_map(move |s| {
                let n = s.node as usize;
                let from = Vector3::from(nodes_m[n]) + Vector3::from(u[n]) - centre;
                let distance = from.norm();
                let inside = distance < radius && distance > 1e-3 * radius;
                inside.then(|| (s, radius - distance, from / distance, pressure * s.area_m2))
            })
        })
    }

    /// Stored energy, J.
    pub fn energy(&self, u: &[[f64; 3]], nodes_m: &[[f64; 3]]) -> f64 {
        let springs = self.springs.iter().map(|s| 0.5 * s.stiffness * Self::stretch(s, u).norm_squared());
        let ball = self.pushed(u, nodes_m).map(|(_, depth, _, k)| 0.5 * k * depth * depth);
        springs.sum::<f64>() + ball.sum::<f64>()
    }

    /// Adds the derivative of the energy to the internal forces of the nodes, N.
    pub fn add_forces(&self, u: &[[f64; 3]], nodes_m: &[[f64; 3]], forces: &mut [[f64; 3]]) {
        let mut add = |node: u32, f: Vector3<f64>| (0..3).for_each(|i| forces[node as usize][i] += f[i]);
        for s in &self.springs {
            add(s.node, s.stiffness * Self::stretch(s, u));
        }
        for (s, depth, normal, k) in self.pushed(u, nodes_m) {
            add(s.node, -k * depth * normal);
        }
    }

    /// Adds the stiffness to the blocks of the diagonal; held components of free rows stay alone.
    pub fn add_stiffness(
        &self,
        u: &[[f64; 3]],
        nodes_m: &[[f64; 3]],
        held: Option<&[[bool; 3]]>,
        tangent: &mut Tangent,
    ) {
        let matrix = &mut tangent.matrix;
        let mut add = |row: u32, block: Matrix3<f64>| {
            if row == HELD {
                return;
            }
            let held = held.map_or([false; 3], |h| h[row as usize]);
            let target = &mut matrix.blocks[matrix.pattern.diagonal[row as usize] as usize];
            for c in (0..3).filter(|&c| !held[c]) {
                for r in (0..3).filter(|&r| !held[r]) {
                    target[3 * c + r] += block[(r, c)];
                }
            }
        };
        for s in &self.springs {
            add(s.row, s.stiffness * Matrix3::identity());
        }
        for (s, _, normal, k) in self.pushed(u, nodes_m) {
            add(s.row, k * normal * normal.transpose());
        }
    }

    /// Force of the springs and of the ball on the body, N.
    pub fn force_n(&self, u: &[[f64; 3]], nodes_m: &[[f64; 3]]) -> [[f64; 3]; 2] {
        let springs: Vector3<f64> = self.springs.iter().map(|s| -s.stiffness * Self::stretch(s, u)).sum();
        let ball: Vector3<f64> = self.pushed(u, nodes_m).map(|(_, depth, normal, k)| k * depth * normal).sum();
        [springs.into(), ball.into()]
    }

    /// Solver numbers of the nodes that hands act on now, ascending.
    pub fn touched(&self, u: &[[f64; 3]], nodes_m: &[[f64; 3]]) -> Vec<u32> {
        let springs = self.springs.iter().map(|s| s.node);
        let mut nodes: Vec<u32> = springs.chain(self.pushed(u, nodes_m).map(|(s, ..)| s.node)).collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forces_of_hands_are_the_derivative_of_their_energy() {
        let nodes_m = [[0.0, 0.0, 0.01], [0.004, 0.0, 0.012], [0.1, 0.0, 0.0]];
        let u = [[0.001, -0.002, 0.0], [0.0, 0.001, 0.002], [0.0; 3]];
        let node = |n: u32| SurfaceNode { node: n, row: n, area_m2: 2e-5 };
        let hands = Hands {
            springs: vec![Spring { node: 1, row: 1, to_m: Vector3::new(0.002, 0.0, 0.001), stiffness: 40.0 }],
            ball: Some(Ball { centre_mm: [1.0, 0.0, 5.0], radius_mm: 12.0, stiffness_pa_per_mm: 3000.0 }),
            surface: vec![node(0), node(1), node(2)],
        };
        let mut forces = [[0.0; 3]; 3];
        hands.add_forces(&u, &nodes_m, &mut forces);
        assert_eq!((forces[2], hands.touched(&u, &nodes_m)), ([0.0; 3], vec![0, 1]));
        for n in 0..2 {
            for i in 0..3 {
                let at = |step: f64| {
                    let mut moved = u;
                    moved[n][i] += step;
                    hands.energy(&moved, &nodes_m)
                };
                let slope = (at(1e-7) - at(-1e-7)) / 2e-7;
                assert!((slope - forces[n][i]).abs() < 1e-6 * (1.0 + slope.abs()), "{n} {i}: {slope} {}", forces[n][i]);
            }
        }
        let [springs, ball] = hands.force_n(&u, &nodes_m);
        for i in 0..3 {
            assert!((springs[i] + ball[i] + forces[0][i] + forces[1][i]).abs() < 1e-12);
        }
    }
}
