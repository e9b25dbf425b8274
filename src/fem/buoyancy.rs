//! What a fluid carries of a body that stands in it up to a level.
//!
//! Every tetrahedron loses the weight of the fluid that its submerged part displaces. That part is cut off exactly, so its
//! volume grows smoothly while the level rises through an element, and so does every force.

use super::scenario::{CsfLevel, Loads};
use super::sharing::Sharing;
use super::units::METRES_PER_MM;

/// The part of a tetrahedron below a level, by the heights of its corners, and what it grows by per unit of the level.
pub(super) fn submerged(mut heights: [f64; 4], level: f64) -> [f64; 2] {
    heights.sort_unstable_by(f64::total_cmp);
    let h = heights;
    // How far the level is up the edge from one corner to another, and by how much more per unit.
    let up = |from: usize, to: usize| [(level - h[from]) / (h[to] - h[from]), 1.0 / (h[to] - h[from])];
    let product = |edges: [[f64; 2]; 3]| {
        let [[a, da], [b, db], [c, dc]] = edges;
        [a * b * c, da * b * c + a * db * c + a * b * dc]
    };
    match h.iter().filter(|h| **h < level).count() {
        0 => [0.0; 2],
        1 => product([up(0, 1), up(0, 2), up(0, 3)]),
        2 => {
            // The wedge of the two lower corners in three tetrahedra.
            let [[a, da], [b, db], [c, dc], [d, dd]] = [up(0, 2), up(0, 3), up(1, 2), up(1, 3)];
            let part = c * d + c * (1.0 - d) * b + (1.0 - c) * a * b;
            let growth = dc * d + c * dd + dc * (1.0 - d) * b - c * dd * b + c * (1.0 - d) * db - dc * a * b
                + (1.0 - c) * (da * b + a * db);
            [part, growth]
        }
        3 => {
            let [rest, shrinks] = product([0, 1, 2].map(|i| [1.0 - up(i, 3)[0], -up(i, 3)[1]]));
            [1.0 - rest, -shrinks]
        }
        _ => [1.0, 0.0],
    }
}

/// Forces of the fluid on the nodes, N, and how they change.
#[allow(clippy::struct_field_names, reason = "the unit is in the name")]
pub(super) struct Buoyancy {
    /// Against gravity.
    pub lift_n: Vec<[f64; 3]>,
    /// With the level, per mm.
    pub per_mm_n: Vec<[f64; 3]>,
    /// With gravity along each axis, per m/s2.
    pub per_gravity_n: [Vec<[f64; 3]>; 3],
}

impl Buoyancy {
    /// `None` without fluid or without gravity.
    pub(super) fn new(sharing: &Sharing, loads: &Loads) -> Option<Self> {
        let csf = loads.csf.filter(|_| loads.gravity_m_per_s2 != [0.0; 3])?;
        let g = loads.gravity_m_per_s2;
        let [lift_n, per_mm_n] = lift(sharing, csf, g);
        let step = 1e-4 * g.iter().map(|v| v * v).sum::<f64>().sqrt();
        let per_gravity_n = [0, 1, 2].map(|axis| {
            let at = |step: f64| {
                let mut turned = g;
                turned[axis] += step;
                let [lift, _] = lift(sharing, csf, turned);
                lift
            };
            let both = at(step).into_iter().zip(at(-step));
            both.map(|(a, b)| [0, 1, 2].map(|i| (a[i] - b[i]) / (2.0 * step))).collect()
        });
        Some(Self { lift_n, per_mm_n, per_gravity_n })
    }

    /// In another numbering: `order` says which node every new one was.
    pub(super) fn ordered(&self, order: &[u32]) -> Self {
        let by = |forces: &[[f64; 3]]| order.iter().map(|&old| forces[old as usize]).collect();
        Self {
            lift_n: by(&self.lift_n),
            per_mm_n: by(&self.per_mm_n),
            per_gravity_n: std::array::from_fn(|axis| by(&self.per_gravity_n[axis])),
        }
    }
}

/// Forces of the fluid on the nodes and their change with the level.
fn lift(sharing: &Sharing, csf: CsfLevel, gravity: [f64; 3]) -> [Vec<[f64; 3]>; 2] {
    let strength = gravity.iter().map(|v| v * v).sum::<f64>().sqrt();
    let up = gravity.map(|v| -v / strength);
    let nodes = sharing.mesh.nodes_mm();
    let height = |n: u32| (0..3).map(|i| nodes[n as usize][i] * up[i]).sum::<f64>();
    let mut forces = [vec![[0.0; 3]; sharing.nodes()], vec![[0.0; 3]; sharing.nodes()]];
    for (t, tet) in sharing.mesh.tets().iter().enumerate() {
        let parts = submerged(tet.map(height), csf.level_mm);
        if parts == [0.0; 2] {
            continue;
        }
        let mass = csf.density_kg_per_m3 * sharing.mesh.volume_mm3(t) * METRES_PER_MM.powi(3);
        for (n, share) in sharing.of_tet(t) {
            for (forces, part) in forces.iter_mut().zip(parts) {
                (0..3).for_each(|i| forces[n as usize][i] -= share * mass * part * gravity[i]);
            }
        }
    }
    forces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_submerged_is_the_share_of_points_below_the_level() {
        // Points spread evenly in barycentric coordinates.
        let heights = [3.0, -1.0, 0.5, 2.0];
        let n = 60;
        for level in [-1.5, -0.4, 0.9, 1.7, 2.6, 3.5] {
            let (mut below, mut all) = (0.0, 0.0);
            for a in 0..n {
                for b in 0..n - a {
                    for c in 0..n - a - b {
                        let place = [a, b, c].map(|v| (f64::from(v) + 0.25) / f64::from(n));
                        let last = 1.0 - place.iter().sum::<f64>();
                        let h = place.iter().zip(&heights).map(|(p, h)| p * h).sum::<f64>() + last * heights[3];
                        all += 1.0;
                        below += f64::from(u8::from(h < level));
                    }
                }
            }
            let [part, _] = submerged(heights, level);
            assert!((part - below / all).abs() < 0.02, "{level}: {part} against {}", below / all);
        }
    }

    #[test]
    fn the_part_grows_as_its_slope_says_through_every_corner() {
        for heights in [[3.0, -1.0, 0.5, 2.0], [0.0, 0.0, 1.0, 1.0], [0.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]] {
            for n in 1..80 {
                let (level, step) = (-1.5 + 0.0641 * f64::from(n), 1e-6);
                let slope = (submerged(heights, level + step)[0] - submerged(heights, level - step)[0]) / (2.0 * step);
                assert!((slope - submerged(heights, level)[1]).abs() < 1e-5, "{heights:?} {level}");
            }
        }
        // Two pairs of corners: 3 t^2 - 2 t^3.
        assert!((submerged([0.0, 0.0, 1.0, 1.0], 0.25)[0] - 0.15625).abs() < 1e-14);
        assert_eq!(submerged([1.0; 4], 1.0), [0.0; 2]);
    }
}
