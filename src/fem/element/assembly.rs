//! Energy, forces and stiffness summed over elements.
//!
//! Rows are dealt out to threads; every row is summed in the order of its elements by the one thread that owns it, so
//! the bytes do not depend on the number of threads. Elements on a seam are evaluated once per owner.

use super::super::portion::Portion;
use super::super::reduce::CHUNK;
use super::super::sparse::{BlockMatrix, BlockPattern, HELD};
use super::kernel::{Kernel, M3, cofactors};
use super::point::Point;
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Elements with `K` nodes and `Q` points, ordered so that neighbours in the list share nodes in memory.
pub(in super::super) struct Elements<const K: usize, const Q: usize> {
    pub nodes: Vec<[u32; K]>,
    pub points: Vec<[Point<K>; Q]>,
    /// Of which cell each element is which part, and which kernel it uses.
    pub portions: Vec<Portion>,
    /// Where block (a, b) of each element goes in the matrix.
    positions: Vec<[[u32; K]; K]>,
}

/// Who owns which nodes, and which elements touch them.
pub(in super::super) struct Partition {
    parts: Vec<Part>,
}

/// The state at which elements are evaluated.
#[derive(Clone, Copy)]
pub(in super::super) struct At<'a> {
    /// Displacements, m.
    pub u: &'a [[f64; 3]],
    pub kernels: &'a [Kernel],
    /// Stress that every element has besides its own, Pa.
    pub more_stress_pa: Option<&'a [M3]>,
    /// Make element tangents positive semi-definite.
    pub project: bool,
}

struct Part {
    nodes: std::ops::Range<usize>,
    blocks: std::ops::Range<usize>,
    elements: Vec<u32>,
}

impl<const K: usize, const Q: usize> Elements<K, Q> {
    pub(in super::super) fn new(
        nodes: Vec<[u32; K]>,
        points: Vec<[Point<K>; Q]>,
        portions: Vec<Portion>,
        row_of: &[u32],
        pattern: &BlockPattern,
    ) -> Self {
        let positions = nodes
            .iter()
            .map(|element| element.map(|a| element.map(|b| pattern.position(row_of[a as usize], row_of[b as usize]))))
            .collect();
        Self { nodes, points, portions, positions }
    }

    /// Parts of about equal work, one per thread.
    pub(in super::super) fn partition(&self, row_of: &[u32], pattern: &BlockPattern) -> Partition {
        let nodes = row_of.len();
        let threads = rayon::current_num_threads().max(1);
        let mut incident = vec![0usize; nodes + 1];
        self.nodes.iter().flatten().for_each(|&n| incident[n as usize + 1] += 1);
        for n in 0..nodes {
            incident[n + 1] += incident[n];
        }
        let cut = |part: usize| incident.partition_point(|&sum| sum * threads < incident[nodes] * part).min(nodes);
        let mut block_start = Vec::with_capacity(nodes + 1);
        block_start.push(0);
        for &row in row_of {
            let last = block_start[block_start.len() - 1];
            block_start.push(if row == HELD { last } else { pattern.row_start[row as usize + 1] });
        }
        let parts = (0..threads)
            .map(|p| {
                let range = (if p == 0 { 0 } else { cut(p) })..(if p + 1 == threads { nodes } else { cut(p + 1) });
                let touches = |e: &u32| self.nodes[*e as usize].iter().any(|&n| range.contains(&(n as usize)));
                let elements = (0..self.nodes.len() as u32).filter(touches).collect();
                Part { blocks: block_start[range.start]..block_start[range.end], nodes: range, elements }
            })
            .collect();
        Partition { parts }
    }

    /// Displacement gradient at a point.
    #[inline(always)]
    fn gradient(point: &Point<K>, u: &[[f64; 3]; K]) -> [[f64; 3]; 3] {
        let mut h = [[0.0; 3]; 3];
        // Shape functions sum to one: differences to the first node lose no small strain in a large translation.
        for a in 1..K {
            let d = [u[a][0] - u[0][0], u[a][1] - u[0][1], u[a][2] - u[0][2]];
            for r in 0..3 {
                for c in 0..3 {
                    h[r][c] += d[r] * point.gradients[a][c];
                }
            }
        }
        h
    }

    #[inline(always)]
    fn local(&self, element: usize, u: &[[f64; 3]]) -> [[f64; 3]; K] {
        self.nodes[element].map(|n| u[n as usize])
    }

    /// Stored energy, J.
    pub(in super::super) fn energy(&self, u: &[[f64; 3]], kernels: &[Kernel]) -> f64 {
        super::super::reduce::chunked(self.nodes.len(), |range| {
            let mut sum = 0.0;
            for e in range {
                let local = self.local(e, u);
                let kernel = &kernels[usize::from(self.portions[e].material)];
                for point in &self.points[e] {
                    sum += point.weight_m3 * kernel.energy(&Self::gradient(point, &local));
                }
            }
            sum
        })
    }

    /// Internal forces (N) of all nodes and, when a matrix is given, the stiffness of the free ones.
    pub(in super::super) fn assemble(
        &self,
        at: At,
        partition: &Partition,
        forces: &mut [[f64; 3]],
        matrix: Option<&mut BlockMatrix>,
    ) {
        let At { u, kernels, more_stress_pa, project } = at;
        let mut blocks: &mut [[f64; 9]] = matrix.map_or(&mut [], |m| &mut m.blocks);
        let with_blocks = !blocks.is_empty();
        let mut forces = forces;
        let mut work = Vec::with_capacity(partition.parts.len());
        for part in &partition.parts {
            let (own_forces, rest) = forces.split_at_mut(part.nodes.len());
            forces = rest;
            let (own_blocks, rest) = blocks.split_at_mut(if with_blocks { part.blocks.len() } else { 0 });
            blocks = rest;
            work.push((part, own_forces, own_blocks));
        }
        work.into_par_iter().for_each(|(part, forces, blocks)| {
            forces.fill([0.0; 3]);
            blocks.fill([0.0; 9]);
            let first_block = part.blocks.start as u32;
            for &e in &part.elements {
                let e = e as usize;
                let local = self.local(e, u);
                let kernel = &kernels[usize::from(self.portions[e].material)];
                let more = more_stress_pa.map(|m| &m[e]);
                let owned = self.nodes[e].map(|n| part.nodes.contains(&(n as usize)));
                let positions = &self.positions[e];
                for point in &self.points[e] {
                    let h = Self::gradient(point, &local);
                    let mut stress = if with_blocks {
                        kernel.stiffness(&h, &point.gradients, point.weight_m3, project, |a, b, block| {
                            if owned[a] && positions[a][b] != HELD {
                                let target = &mut blocks[(positions[a][b] - first_block) as usize];
                                for i in 0..9 {
                                    target[i] += block[i];
                                }
                            }
                            if a != b && owned[b] && positions[b][a] != HELD {
                                let target = &mut blocks[(positions[b][a] - first_block) as usize];
                                for c in 0..3 {
                                    for r in 0..3 {
                                        target[3 * c + r] += block[3 * r + c];
                                    }
                                }
                            }
                        })
                    } else {
                        kernel.stress(&h)
                    };
                    if let Some(more) = more {
                        stress.iter_mut().flatten().zip(more.iter().flatten()).for_each(|(s, m)| *s += m);
                    }
                    for a in (0..K).filter(|&a| owned[a]) {
                        let g = point.gradients[a].map(|v| v * point.weight_m3);
                        let force = &mut forces[self.nodes[e][a] as usize - part.nodes.start];
                        for r in 0..3 {
                            force[r] += stress[r][0] * g[0] + stress[r][1] * g[1] + stress[r][2] * g[2];
                        }
                    }
                }
            }
        });
    }

    /// Per element: mean volume ratio, smallest volume ratio and mean energy density (Pa).
    pub(in super::super) fn state(&self, u: &[[f64; 3]], kernels: &[Kernel]) -> Vec<[f64; 3]> {
        let one = |e: usize| {
            let local = self.local(e, u);
            let kernel = &kernels[usize::from(self.portions[e].material)];
            let (mut volume, mut mean_j, mut least_j, mut energy) = (0.0, 0.0, f64::INFINITY, 0.0);
            for point in &self.points[e] {
                let h = Self::gradient(point, &local);
                let j = 1.0 + cofactors(&h).1;
                volume += point.weight_m3;
                mean_j += point.weight_m3 * j;
                energy += point.weight_m3 * kernel.energy(&h);
                least_j = f64::min(least_j, j);
            }
            [mean_j / volume, least_j, energy / volume]
        };
        (0..self.nodes.len()).into_par_iter().with_min_len(CHUNK).map(one).collect()
    }

    /// Per element of a material: the principal stretch that is farthest from rest, the least and the largest of its points.
    pub(in super::super) fn farthest_stretches(&self, u: &[[f64; 3]], material: u16) -> Vec<[f64; 2]> {
        let own = |e: &usize| self.portions[*e].material == material;
        let one = |e: usize| {
            let local = self.local(e, u);
            let of_points = self.points[e].iter().map(|point| farthest(&Self::gradient(point, &local)));
            of_points.fold([f64::INFINITY, 0.0], |[least, most], s| [f64::min(least, s), f64::max(most, s)])
        };
        (0..self.nodes.len()).into_par_iter().with_min_len(CHUNK).filter(own).map(one).collect()
    }
}

/// The principal stretch farthest from 1 by its logarithm, of a displacement gradient.
fn farthest(h: &M3) -> f64 {
    let f = Matrix3::from_fn(|r, c| h[r][c] + f64::from(u8::from(r == c)));
    let squares: [f64; 3] = (f.transpose() * f).symmetric_eigenvalues().into();
    let far = |s: f64| s.ln().abs();
    squares.map(|s| s.max(0.0).sqrt()).into_iter().max_by(|a, b| far(*a).total_cmp(&far(*b))).unwrap_or(1.0)
}
