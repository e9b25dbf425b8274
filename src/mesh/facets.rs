//! Facets of a tetrahedral mesh: normals, areas, the share of each node.

use super::{TET_FACES, TetMesh};
use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};

impl TetMesh {
    /// Normal times area of a facet, mm2, pointing where its nodes run counter-clockwise.
    pub fn area_vector_mm2(&self, facet: [u32; 3]) -> Vector3<f64> {
        let [a, b, c] = facet.map(|n| Vector3::from(self.nodes_mm()[n as usize]));
        (b - a).cross(&(c - a)) * 0.5
    }

    /// Centroid of a facet, mm.
    pub fn facet_centroid_mm(&self, facet: [u32; 3]) -> [f64; 3] {
        let [a, b, c] = facet.map(|n| Vector3::from(self.nodes_mm()[n as usize]));
        ((a + b + c) / 3.0).into()
    }

    /// Facets of sets that are part of the outer surface, once each and as they are seen from outside: other programs turn a
    /// surface as it was drawn.
    pub fn turn_facets_outwards(&mut self) {
        let sorted = |facet: &[u32; 3]| {
            let mut key = *facet;
            key.sort_unstable();
            key
        };
        let outer: BTreeMap<[u32; 3], [u32; 3]> =
            self.boundary_facets(|_| true).into_iter().map(|facet| (sorted(&facet), facet)).collect();
        for facets in self.facet_sets.values_mut() {
            let mut seen = BTreeSet::new();
            facets.retain(|facet| !outer.contains_key(&sorted(facet)) || seen.insert(sorted(facet)));
            for facet in facets {
                let Some(&[a, b, c]) = outer.get(&sorted(facet)) else { continue };
                if ![[a, b, c], [b, c, a], [c, a, b]].contains(facet) {
                    facet.swap(1, 2);
                }
            }
        }
    }

    /// The facets of the outside that are in none of these facet sets, outward, in order of tetrahedron.
    pub fn outside_without(&self, sets: &[&str]) -> Vec<[u32; 3]> {
        let sorted = |mut facet: [u32; 3]| {
            facet.sort_unstable();
            facet
        };
        let of = sets.iter().filter_map(|set| self.facet_sets.get(*set)).flatten();
        let mut left_out: Vec<[u32; 3]> = of.copied().map(sorted).collect();
        left_out.sort_unstable();
        let mut outside = self.boundary_facets(|_| true);
        outside.retain(|facet| left_out.binary_search(&sorted(*facet)).is_err());
        outside
    }

    /// Normals of the nodes of a surface, mm2: the sum of the area vectors of the facets around each; zero for a node of none.
    pub fn node_normals_mm2(&self, facets: &[[u32; 3]]) -> Vec<Vector3<f64>> {
        let mut normals = vec![Vector3::zeros(); self.nodes_mm().len()];
        for facet in facets {
            let area = self.area_vector_mm2(*facet);
            for n in facet {
                normals[*n as usize] += area;
            }
        }
        normals
    }

    /// The area that belongs to each node of `facets`, a third of every facet it is a corner of: `(node, mm2)`, nodes
    /// ascending. The areas sum to the whole, so a force shared by them is the same at every resolution.
    ///
    /// ```
    /// use hgm::mesh::TetMesh;
    /// let nodes = vec![[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]];
    /// let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3]], vec![2]).unwrap();
    /// assert_eq!(mesh.node_areas_mm2(&[[0, 2, 1]]), [(0, 1.0), (1, 1.0), (2, 1.0)]);
    /// ```
    pub fn node_areas_mm2(&self, facets: &[[u32; 3]]) -> Vec<(u32, f64)> {
        let mut shares: Vec<(u32, f64)> = Vec::with_capacity(3 * facets.len());
        for &facet in facets {
            let third = self.area_vector_mm2(facet).norm() / 3.0;
            shares.extend(facet.map(|n| (n, third)));
        }
        shares.sort_by_key(|share| share.0); // stable: the order of summation is that of the facets
        let mut areas: Vec<(u32, f64)> = Vec::new();
        for (node, share) in shares {
            match areas.last_mut() {
                Some(last) if last.0 == node => last.1 += share,
                _ => areas.push((node, share)),
            }
        }
        areas
    }

    /// Every facet between two tetrahedra or outside one, once: its nodes as the first tetrahedron sees them from
    /// outside, that tetrahedron, and the one on the other side. In order of first tetrahedron and local face.
    pub fn facets(&self) -> Vec<([u32; 3], usize, Option<usize>)> {
        let mut faces: Vec<([u32; 3], u32)> = Vec::with_capacity(4 * self.tets().len());
        for (t, tet) in self.tets().iter().enumerate() {
            for (f, face) in TET_FACES.iter().enumerate() {
                let mut key = face.map(|c| tet[c]);
                key.sort_unstable();
                faces.push((key, (4 * t + f) as u32));
            }
        }
        faces.sort_unstable();
        let mut facets: Vec<(u32, Option<usize>)> = Vec::with_capacity(2 * self.tets().len());
        for same in faces.chunk_by(|a, b| a.0 == b.0) {
            facets.push((same[0].1, same.get(1).map(|other| other.1 as usize / 4)));
        }
        facets.sort_unstable();
        let facet = |(id, other): (u32, Option<usize>)| {
            let tet = id as usize / 4;
            (TET_FACES[id as usize % 4].map(|c| self.tets()[tet][c]), tet, other)
        };
        facets.into_iter().map(facet).collect()
    }

    /// Median length of the mesh's edges, mm.
    pub fn median_edge_mm(&self) -> f64 {
        let mut edges: Vec<[u32; 2]> = Vec::with_capacity(6 * self.tets().len());
        for tet in self.tets() {
            for (a, b) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
                edges.push([tet[a].min(tet[b]), tet[a].max(tet[b])]);
            }
        }
        edges.sort_unstable();
        edges.dedup();
        let point = |n: u32| Vector3::from(self.nodes_mm()[n as usize]);
        let mut lengths: Vec<f64> = edges.iter().map(|&[a, b]| (point(a) - point(b)).norm()).collect();
        let middle = lengths.len() / 2;
        *lengths.select_nth_unstable_by(middle, f64::total_cmp).1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_tets() -> TetMesh {
        let nodes = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]];
        TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4]], vec![2, 3]).unwrap()
    }

    #[test]
    fn node_areas_sum_to_the_surface() {
        let mesh = two_tets();
        let facets = mesh.boundary_facets(|_| true);
        let whole: f64 = facets.iter().map(|&f| mesh.area_vector_mm2(f).norm()).sum();
        let shared: f64 = mesh.node_areas_mm2(&facets).iter().map(|a| a.1).sum();
        assert!((whole - shared).abs() < 1e-12 * whole);
    }

    #[test]
    fn every_facet_is_listed_once_with_both_its_sides() {
        let facets = two_tets().facets();
        assert_eq!(facets.len(), 7);
        let inner: Vec<_> = facets.iter().filter(|f| f.2.is_some()).collect();
        assert_eq!((inner.len(), inner[0].0, inner[0].1, inner[0].2), (1, [1, 2, 3], 0, Some(1)));
    }

    #[test]
    fn the_median_edge_is_the_middle_one() {
        // Edges: 1, 1, 1 and root two six times.
        assert!((two_tets().median_edge_mm() - 2f64.sqrt()).abs() < 1e-15);
    }
}
