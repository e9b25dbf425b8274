//! Volume terms averaged around nodes: linear tetrahedra without locking.
//!
//! With lambda evaluated in every linear tetrahedron there are about five times as many volume constraints as nodes,
//! and the mesh locks towards nu = 0.5. Here the volume ratio is averaged, J_a = sum_e V_e/4 J_e / sum_e V_e/4 over the
//! elements of one tissue around node a, and only U(J_a), the lambda term, uses it (Bonet and Burton, "A simple average
//! nodal pressure tetrahedral element", Commun. Numer. Meth. Engng 14, 1998). The rest of the law stays in the
//! elements, which keeps every element's own barrier against inversion and leaves no mode without energy. Averages do
//! not cross a tissue boundary, where the pressure jumps.
//!
//! Forces are the elements' own with the pressure p_e = mean of U'(J_a); the Hessian is sum_a U''(J_a)/V_a b_a b_a^T
//! (b_a = V_a dJ_a/dx) added to sparse element blocks and never multiplied out.

use super::super::sparse::HELD;
use super::assembly::Elements;
use crate::material::law::Material;
use rayon::prelude::*;

/// A node seen from one tissue.
struct Group {
    material: u16,
    volume_m3: f64,
}

/// Average volumes and their pressures on linear tetrahedra.
pub(in super::super) struct NodalPressure {
    groups: Vec<Group>,
    element_groups: Vec<[u32; 4]>,
    /// Elements of each group.
    incident_start: Vec<usize>,
    incident: Vec<u32>,
    /// Free rows each group's average depends on.
    row_start: Vec<usize>,
    rows: Vec<u32>,
    /// The other way round: for each row its (group, position in `rows`).
    group_start: Vec<usize>,
    group_positions: Vec<(u32, u32)>,
    row_of: Vec<u32>,
}

/// The low-rank part of a tangent: sum_a weight_a b_a b_a^T, by group and by row.
#[derive(Clone, Debug)]
pub(in super::super) struct Dilation {
    pub row_start: Vec<usize>,
    pub rows: Vec<u32>,
    pub values: Vec<[f64; 3]>,
    pub weights: Vec<f64>,
    pub group_start: Vec<usize>,
    pub group_positions: Vec<(u32, u32)>,
}

/// U(J) of a law.
#[derive(Clone, Copy)]
struct Volumetric {
    lambda: f64,
    /// lambda/2 (J - 1)^2 instead of lambda/2 ln^2 J.
    square: bool,
    floor: f64,
}

impl Volumetric {
    fn new(material: &Material, share: f64) -> Self {
        let square = matches!(material, Material::StableNeoHookean { .. });
        Self { lambda: share * material.lame_lambda_pa(), square, floor: material.inversion_threshold() }
    }

    /// U, U', U'' at J - 1.
    fn of(self, x: f64) -> [f64; 3] {
        let (l, first, second) = if self.square {
            (x, 1.0, 0.0)
        } else if 1.0 + x > self.floor {
            let j = 1.0 + x;
            if j <= 0.0 {
                return [f64::INFINITY, f64::NAN, f64::NAN];
            }
            (x.ln_1p(), 1.0 / j, -1.0 / (j * j))
        } else {
            let (d, f) = (1.0 + x - self.floor, self.floor);
            (f.ln() + d / f - 0.5 * d * d / (f * f), 1.0 / f - d / (f * f), -1.0 / (f * f))
        };
        [0.5 * self.lambda * l * l, self.lambda * l * first, self.lambda * (first * first + l * second)]
    }
}

/// Counts to starts of compressed rows.
fn starts(counts: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut start = vec![0];
    for count in counts {
        start.push(start[start.len() - 1] + count);
    }
    start
}

impl NodalPressure {
    /// Groups of a mesh whose free nodes have the rows `row_of`.
    pub(in super::super) fn new(elements: &Elements<4, 1>, row_of: &[u32]) -> Self {
        let mut keys: Vec<(u32, u16, u32)> = Vec::with_capacity(4 * elements.nodes.len());
        for (e, nodes) in elements.nodes.iter().enumerate() {
            keys.extend(nodes.map(|n| (n, elements.material[e], e as u32)));
        }
        keys.sort_unstable();
        let mut groups: Vec<Group> = Vec::new();
        let mut element_groups = vec![[0u32; 4]; elements.nodes.len()];
        let mut incident_start = Vec::new();
        for (at, &(node, material, e)) in keys.iter().enumerate() {
            if at == 0 || (keys[at - 1].0, keys[at - 1].1) != (node, material) {
                groups.push(Group { material, volume_m3: 0.0 });
                incident_start.push(at);
            }
            let group = groups.len() - 1;
            groups[group].volume_m3 += 0.25 * elements.points[e as usize][0].weight_m3;
            for (corner, &n) in elements.nodes[e as usize].iter().enumerate() {
                if n == node {
                    element_groups[e as usize][corner] = group as u32;
                }
            }
        }
        incident_start.push(keys.len());
        let incident: Vec<u32> = keys.iter().map(|k| k.2).collect();
        let mut rows = Vec::new();
        let mut row_start = vec![0];
        for g in 0..groups.len() {
            let from = rows.len();
            for &e in &incident[incident_start[g]..incident_start[g + 1]] {
                rows.extend(elements.nodes[e as usize].iter().map(|&n| row_of[n as usize]).filter(|&r| r != HELD));
            }
            let mut own = rows.split_off(from);
            own.sort_unstable();
            own.dedup();
            rows.append(&mut own);
            row_start.push(rows.len());
        }
        let free = row_of.iter().filter(|&&r| r != HELD).count();
        let mut counts = vec![0usize; free];
        for &r in &rows {
            counts[r as usize] += 1;
        }
        let group_start = starts(counts.into_iter());
        let mut fill = group_start.clone();
        let mut group_positions = vec![(0u32, 0u32); rows.len()];
        for g in 0..groups.len() {
            for at in row_start[g]..row_start[g + 1] {
                let slot = &mut fill[rows[at] as usize];
                group_positions[*slot] = (g as u32, at as u32);
                *slot += 1;
            }
        }
        let row_of = row_of.to_vec();
        Self { groups, element_groups, incident_start, incident, row_start, rows, group_start, group_positions, row_of }
    }

    /// J_a - 1 of every group.
    fn volume_changes(&self, elements: &Elements<4, 1>, u: &[[f64; 3]]) -> Vec<f64> {
        let of_element: Vec<f64> = (0..elements.nodes.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(|e| 0.25 * elements.points[e][0].weight_m3 * elements.dilatation(e, u).1)
            .collect();
        (0..self.groups.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(|g| {
                let own = &self.incident[self.incident_start[g]..self.incident_start[g + 1]];
                own.iter().map(|&e| of_element[e as usize]).sum::<f64>() / self.groups[g].volume_m3
            })
            .collect()
    }

    /// Stored energy of the averaged part, J. `share` is the part of lambda that is averaged.
    pub(in super::super) fn energy(
        &self,
        elements: &Elements<4, 1>,
        u: &[[f64; 3]],
        materials: &[Material],
        share: f64,
    ) -> f64 {
        let laws: Vec<Volumetric> = materials.iter().map(|m| Volumetric::new(m, share)).collect();
        let changes = self.volume_changes(elements, u);
        super::super::reduce::chunked(self.groups.len(), |range| {
            range.map(|g| self.groups[g].volume_m3 * laws[usize::from(self.groups[g].material)].of(changes[g])[0]).sum()
        })
    }

    /// Mean pressure (Pa, positive in tension) of every element and U'' of every group.
    pub(in super::super) fn pressures(
        &self,
        elements: &Elements<4, 1>,
        u: &[[f64; 3]],
        materials: &[Material],
        share: f64,
    ) -> (Vec<f64>, Vec<f64>) {
        let laws: Vec<Volumetric> = materials.iter().map(|m| Volumetric::new(m, share)).collect();
        let changes = self.volume_changes(elements, u);
        let of_group: Vec<[f64; 3]> =
            changes.iter().zip(&self.groups).map(|(&x, g)| laws[usize::from(g.material)].of(x)).collect();
        let mean = |groups: &[u32; 4]| 0.25 * groups.iter().map(|&g| of_group[g as usize][1]).sum::<f64>();
        (self.element_groups.iter().map(mean).collect(), of_group.iter().map(|u| u[2]).collect())
    }

    /// The low-rank part of the tangent; negative curvature U'' < 0 is dropped when `project`.
    pub(in super::super) fn dilation(
        &self,
        elements: &Elements<4, 1>,
        u: &[[f64; 3]],
        second: &[f64],
        project: bool,
    ) -> Dilation {
        // V_e/4 cof G_a of every element.
        let gradients: Vec<[[f64; 3]; 4]> = (0..elements.nodes.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(|e| {
                let point = &elements.points[e][0];
                let (cof, _) = elements.dilatation(e, u);
                let quarter = 0.25 * point.weight_m3;
                point
                    .gradients
                    .map(|g| [0, 1, 2].map(|r| quarter * (cof[r][0] * g[0] + cof[r][1] * g[1] + cof[r][2] * g[2])))
            })
            .collect();
        let per_group: Vec<Vec<[f64; 3]>> = (0..self.groups.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|g| {
                let rows = &self.rows[self.row_start[g]..self.row_start[g + 1]];
                let mut values = vec![[0.0; 3]; rows.len()];
                for &e in &self.incident[self.incident_start[g]..self.incident_start[g + 1]] {
                    for (node, gradient) in elements.nodes[e as usize].iter().zip(&gradients[e as usize]) {
                        if let Ok(at) = rows.binary_search(&self.row_of[*node as usize]) {
                            (0..3).for_each(|i| values[at][i] += gradient[i]);
                        }
                    }
                }
                values
            })
            .collect();
        let least = if project { 0.0 } else { f64::NEG_INFINITY };
        Dilation {
            row_start: self.row_start.clone(),
            rows: self.rows.clone(),
            values: per_group.into_iter().flatten().collect(),
            weights: second.iter().zip(&self.groups).map(|(u2, g)| u2.max(least) / g.volume_m3).collect(),
            group_start: self.group_start.clone(),
            group_positions: self.group_positions.clone(),
        }
    }
}

impl NodalPressure {
    /// Averaged energy density (Pa) of every element: the mean of its corners'.
    pub(in super::super) fn energy_density(
        &self,
        elements: &Elements<4, 1>,
        u: &[[f64; 3]],
        materials: &[Material],
        share: f64,
    ) -> Vec<f64> {
        let laws: Vec<Volumetric> = materials.iter().map(|m| Volumetric::new(m, share)).collect();
        let changes = self.volume_changes(elements, u);
        let of_group = |&g: &u32| laws[usize::from(self.groups[g as usize].material)].of(changes[g as usize])[0];
        self.element_groups.iter().map(|groups| 0.25 * groups.iter().map(of_group).sum::<f64>()).collect()
    }
}
