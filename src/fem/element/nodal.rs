//! Deformation averaged around nodes: linear tetrahedra without locking.
//!
//! With the volume term in every linear tetrahedron there are about five times as many volume constraints as nodes,
//! and the mesh locks towards nu = 0.5; and linear tetrahedra are too stiff in bending at any nu. Here every node of
//! every tissue has the mean deformation gradient of the elements around it,
//! F_a = sum_e V_e/4 F_e / V_a with V_a = sum_e V_e/4, and the energy is
//!
//!   sum_e V_e (1 - s) Psi_0(F_e) + sum_a V_a (s Psi_0(F_a) + U(det F_a)),
//!
//! Psi_0 the law without its volume term U (Dohrmann et al., "Node-based uniform strain elements", Int. J. Numer. Meth.
//! Engng 47, 2000; the part left in the elements after Puso and Solberg, ibid. 67, 2006: it keeps each element's own
//! barrier against inversion and leaves no mode without energy). Averages do not cross a tissue boundary, where the
//! pressure jumps. Constant strain is reproduced exactly.
//!
//! Chosen by measuring (docs/evidence/choices.md): averaging only the volume ratio (Bonet and Burton, 1998) stays farther from
//! quadratic tetrahedra than with a part of Psi_0 averaged too. Smoothing over edges instead comes as close but has seven nodes
//! per point and three times the matrix.
//!
//! Forces are the elements' own plus the mean stress of their four corners; the tangent is that of the elements plus
//! sum_a B_a^T V_a C_a B_a, which is never multiplied out: B_a does not change, C_a is 9 x 9.

use super::super::reduce;
use super::super::sparse::HELD;
use super::assembly::Elements;
use super::kernel::{M3, projected};
use crate::material::Hyperelastic;
use nalgebra::Matrix3;
use rayon::prelude::*;
use std::sync::Arc;

/// s: the part of the law without its volume term that is evaluated at the nodes.
pub(in super::super) const NODAL_SHARE: f64 = 0.5;

/// A node seen from one tissue.
struct Group {
    material: u16,
    volume_m3: f64,
    node: u32,
}

/// Mean deformation gradients on linear tetrahedra.
pub(in super::super) struct NodalGradient {
    groups: Vec<Group>,
    element_groups: Vec<[u32; 4]>,
    /// Nodes around each group with B_a: H_a = sum_n u_n (x) gradient_n.
    start: Vec<usize>,
    nodes: Vec<u32>,
    gradients: Vec<[f64; 3]>,
    rings: Arc<Rings>,
}

/// B of the free rows, by group and by row.
pub(in super::super) struct Rings {
    pub row_start: Vec<usize>,
    pub rows: Vec<u32>,
    pub gradients: Vec<[f64; 3]>,
    pub group_start: Vec<usize>,
    pub groups: Vec<u32>,
    pub gradients_of_row: Vec<[f64; 3]>,
}

/// Entries of a symmetric 3 x 3 matrix.
const PAIRS: [[usize; 2]; 6] = [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]];

/// The nodal part of a tangent: sum_a B_a^T moduli_a B_a.
#[derive(Clone)]
pub(in super::super) struct NodalTangent {
    pub rings: Arc<Rings>,
    /// V_a C_a, column-major 9 x 9, entry (r + 3 c, r' + 3 c').
    pub moduli: Vec<[f64; 81]>,
    /// Components held on rows that are otherwise free.
    pub held: Option<Arc<Vec<[bool; 3]>>>,
}

impl NodalGradient {
    /// Groups of a mesh whose free nodes have the rows `row_of`.
    pub(in super::super) fn new(elements: &Elements<4, 1>, row_of: &[u32]) -> Self {
        let mut keys: Vec<(u32, u16, u32)> = Vec::with_capacity(4 * elements.nodes.len());
        for (e, nodes) in elements.nodes.iter().enumerate() {
            keys.extend(nodes.map(|n| (n, elements.portions[e].material, e as u32)));
        }
        keys.sort_unstable();
        let mut groups: Vec<Group> = Vec::new();
        let mut element_groups = vec![[0u32; 4]; elements.nodes.len()];
        let (mut start, mut nodes, mut gradients) = (vec![0], Vec::new(), Vec::new());
        for own in keys.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (node, material, _) = own[0];
            let volume_m3: f64 = own.iter().map(|k| 0.25 * elements.points[k.2 as usize][0].weight_m3).sum();
            let mut ring: Vec<u32> = own.iter().flat_map(|k| elements.nodes[k.2 as usize]).collect();
            ring.sort_unstable();
            ring.dedup();
            let mut sums = vec![[0.0; 3]; ring.len()];
            for &(.., e) in own {
                let (point, corners) = (&elements.points[e as usize][0], &elements.nodes[e as usize]);
                for (corner, n) in corners.iter().enumerate() {
                    if *n == node {
                        element_groups[e as usize][corner] = groups.len() as u32;
                    }
                    let at = ring.partition_point(|m| m < n);
                    let weight = 0.25 * point.weight_m3 / volume_m3;
                    (0..3).for_each(|i| sums[at][i] += weight * point.gradients[corner][i]);
                }
            }
            groups.push(Group { material, volume_m3, node });
            nodes.append(&mut ring);
            gradients.append(&mut sums);
            start.push(nodes.len());
        }
        let rings = Arc::new(Rings::new(&start, &nodes, &gradients, row_of));
        Self { groups, element_groups, start, nodes, gradients, rings }
    }

    /// B of the free rows.
    pub(in super::super) fn rings(&self) -> &Rings {
        &self.rings
    }

    /// H_a.
    fn displacement_gradient(&self, group: usize, u: &[[f64; 3]]) -> Matrix3<f64> {
        let origin = u[self.groups[group].node as usize];
        let mut h = Matrix3::zeros();
        for at in self.start[group]..self.start[group + 1] {
            let (x, g) = (u[self.nodes[at] as usize], self.gradients[at]);
            for c in 0..3 {
                for r in 0..3 {
                    h[(r, c)] += (x[r] - origin[r]) * g[c];
                }
            }
        }
        h
    }

    fn law<'a>(&self, group: usize, laws: &'a [Box<dyn Hyperelastic>]) -> &'a dyn Hyperelastic {
        laws[usize::from(self.groups[group].material)].as_ref()
    }

    /// `f` of every group, in order; one loop for every caller (see `reduce`).
    fn of_groups<T: Send>(&self, f: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
        (0..self.groups.len()).into_par_iter().with_min_len(256).map(f).collect()
    }

    /// Stored energy of the nodal part, J.
    pub(in super::super) fn energy(&self, u: &[[f64; 3]], laws: &[Box<dyn Hyperelastic>]) -> f64 {
        reduce::chunked(self.groups.len(), |range| {
            let one = |g: usize| {
                self.groups[g].volume_m3 * self.law(g, laws).energy_density_pa(&self.displacement_gradient(g, u))
            };
            range.map(one).sum()
        })
    }

    /// Mean of an element's four corners.
    fn corner_mean<const N: usize>(&self, of_group: &[[f64; N]]) -> Vec<[f64; N]> {
        let mean = |groups: &[u32; 4]| {
            let sum = |i: usize| groups.iter().map(|&g| of_group[g as usize][i]).sum::<f64>();
            std::array::from_fn(|i| 0.25 * sum(i))
        };
        self.element_groups.iter().map(mean).collect()
    }

    /// Mean nodal stress of every element (row-major, Pa): what it adds to the element's own.
    pub(in super::super) fn stresses(&self, u: &[[f64; 3]], laws: &[Box<dyn Hyperelastic>]) -> Vec<M3> {
        let of_group = self.of_groups(&|g| -> [f64; 9] {
            let stress = self.law(g, laws).first_piola_kirchhoff_pa(&self.displacement_gradient(g, u));
            std::array::from_fn(|i| stress[(i / 3, i % 3)])
        });
        let rows = |s: [f64; 9]| [[s[0], s[1], s[2]], [s[3], s[4], s[5]], [s[6], s[7], s[8]]];
        self.corner_mean(&of_group).into_iter().map(rows).collect()
    }

    /// The nodal part of the tangent; made positive semi-definite when `project`.
    pub(in super::super) fn tangent(
        &self,
        u: &[[f64; 3]],
        laws: &[Box<dyn Hyperelastic>],
        held: Option<Arc<Vec<[bool; 3]>>>,
        project: bool,
    ) -> NodalTangent {
        let moduli = self.of_groups(&|g| -> [f64; 81] {
            let mut tangent = self.law(g, laws).tangent_pa(&self.displacement_gradient(g, u));
            if project {
                tangent = projected(&tangent);
            }
            std::array::from_fn(|i| self.groups[g].volume_m3 * tangent[(i % 9, i / 9)])
        });
        NodalTangent { rings: Arc::clone(&self.rings), moduli, held }
    }

    /// Nodal energy density (Pa) of every element: the mean of its corners'.
    pub(in super::super) fn energy_density(&self, u: &[[f64; 3]], laws: &[Box<dyn Hyperelastic>]) -> Vec<f64> {
        let of_group = self.of_groups(&|g| [self.law(g, laws).energy_density_pa(&self.displacement_gradient(g, u))]);
        self.corner_mean(&of_group).into_iter().map(|[v]| v).collect()
    }
}

impl Rings {
    fn new(start: &[usize], nodes: &[u32], gradients: &[[f64; 3]], row_of: &[u32]) -> Self {
        let (mut row_start, mut rows, mut own) = (vec![0], Vec::new(), Vec::new());
        let free = row_of.iter().filter(|&&r| r != HELD).count();
        let mut group_start = vec![0usize; free + 1];
        for group in start.windows(2) {
            for at in group[0]..group[1] {
                let row = row_of[nodes[at] as usize];
                if row != HELD {
                    rows.push(row);
                    own.push(gradients[at]);
                    group_start[row as usize + 1] += 1;
                }
            }
            row_start.push(rows.len());
        }
        for row in 0..free {
            group_start[row + 1] += group_start[row];
        }
        let mut fill = group_start.clone();
        let (mut groups, mut gradients_of_row) = (vec![0u32; rows.len()], vec![[0.0; 3]; rows.len()]);
        for g in 0..row_start.len() - 1 {
            for at in row_start[g]..row_start[g + 1] {
                let slot = &mut fill[rows[at] as usize];
                (groups[*slot], gradients_of_row[*slot]) = (g as u32, own[at]);
                *slot += 1;
            }
        }
        Self { row_start, rows, gradients: own, group_start, groups, gradients_of_row }
    }
}

impl NodalTangent {
    /// y += sum_a B_a^T moduli_a B_a x.
    pub(in super::super) fn add_product(&self, x: &[[f64; 3]], y: &mut [[f64; 3]]) {
        let rings = &*self.rings;
        let stresses: Vec<[[f64; 3]; 3]> = self
            .moduli
            .par_iter()
            .with_min_len(256)
            .enumerate()
            .map(|(g, moduli)| {
                let mut h = [0.0; 9];
                for at in rings.row_start[g]..rings.row_start[g + 1] {
                    let (x, b) = (x[rings.rows[at] as usize], rings.gradients[at]);
                    for c in 0..3 {
                        for r in 0..3 {
                            h[3 * c + r] += x[r] * b[c];
                        }
                    }
                }
                let mut stress = [[0.0; 3]; 3];
                for (column, h) in moduli.as_chunks::<9>().0.iter().zip(h) {
                    for c in 0..3 {
                        for r in 0..3 {
                            stress[c][r] += column[3 * c + r] * h;
                        }
                    }
                }
                stress
            })
            .collect();
        y.par_iter_mut().with_min_len(1024).enumerate().for_each(|(row, out)| {
            let mut sum = [0.0; 3];
            for at in rings.group_start[row]..rings.group_start[row + 1] {
                let (s, b) = (&stresses[rings.groups[at] as usize], rings.gradients_of_row[at]);
                for c in 0..3 {
                    for r in 0..3 {
                        sum[r] += s[c][r] * b[c];
                    }
                }
            }
            let held = self.held.as_ref().map_or([false; 3], |h| h[row]);
            (0..3).filter(|&i| !held[i]).for_each(|i| out[i] += sum[i]);
        });
    }

    /// Adds its part of the diagonal block, column-major, of every row.
    ///
    /// Entry (r, k) of B_a^T C B_a is sum_cd b_c b_d C(r c, k d): the 6 products of b times what C has for each of them.
    pub(in super::super) fn add_diagonal_blocks(&self, blocks: &mut [[f64; 9]]) {
        let rings = &*self.rings;
        let mut by_product = vec![[[0.0; 6]; 6]; self.moduli.len()];
        reduce::by_rows(&mut by_product, |first, groups| {
            for (out, moduli) in groups.iter_mut().zip(&self.moduli[first..]) {
                let c = |r: usize, c: usize, k: usize, d: usize| moduli[r + 3 * c + 9 * (k + 3 * d)];
                *out = PAIRS.map(|[p, q]| {
                    PAIRS.map(|[r, k]| if p == q { c(r, p, k, p) } else { c(r, p, k, q) + c(r, q, k, p) })
                });
            }
            []
        });
        reduce::by_rows(blocks, |first, rows| {
            for (row, block) in (first..).zip(rows) {
                let mut sum = [0.0; 6];
                for at in rings.group_start[row]..rings.group_start[row + 1] {
                    let (of, b) = (&by_product[rings.groups[at] as usize], rings.gradients_of_row[at]);
                    for (of, [p, q]) in of.iter().zip(PAIRS) {
                        let product = b[p] * b[q];
                        (0..6).for_each(|i| sum[i] += product * of[i]);
                    }
                }
                let held = self.held.as_ref().map_or([false; 3], |h| h[row]);
                for (sum, [r, k]) in sum.into_iter().zip(PAIRS) {
                    if r == k {
                        block[4 * r] += sum;
                    } else if !(held[r] || held[k]) {
                        block[r + 3 * k] += sum;
                        block[k + 3 * r] += sum;
                    }
                }
            }
            []
        });
    }
}
