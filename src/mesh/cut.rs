//! A mesh cut open along facets between its tetrahedra.

use super::{TET_FACES, TetMesh};
use std::collections::BTreeMap;

impl TetMesh {
    /// The mesh cut open along `sheet`, facets between two tetrahedra each. A node is doubled where the sheet parts the
    /// tetrahedra around it; at an edge of the sheet inside the body they hang together, and the node stays one. New nodes
    /// follow the old ones, in the order of the nodes they double, whose node sets they join. The facets of both sides,
    /// outward, become the facet set `name`, also where both still have the same three nodes; facets of other sets follow
    /// their tetrahedron.
    #[must_use]
    pub fn cut_along(&self, name: &str, sheet: &[[u32; 3]]) -> Self {
        let sorted = |mut facet: [u32; 3]| {
            facet.sort_unstable();
            facet
        };
        let mut cut: Vec<[u32; 3]> = sheet.iter().copied().map(sorted).collect();
        cut.sort_unstable();
        cut.dedup();
        let is_cut = |facet: [u32; 3]| cut.binary_search(&sorted(facet)).is_ok();
        let mut of_sheet = cut.as_flattened().to_vec();
        of_sheet.sort_unstable();
        of_sheet.dedup();

        let mut around: BTreeMap<u32, Vec<usize>> = of_sheet.iter().map(|&n| (n, Vec::new())).collect();
        for (t, tet) in self.tets().iter().enumerate() {
            for n in tet {
                if let Some(tets) = around.get_mut(n) {
                    tets.push(t);
                }
            }
        }
        let mut nodes = self.nodes_mm().to_vec();
        let mut tets = self.tets().to_vec();
        let mut doubles: Vec<(u32, u32)> = Vec::new();
        for (&node, own) in &around {
            for part in self.parts_around(node, own, &is_cut).into_iter().skip(1) {
                let double = nodes.len() as u32;
                nodes.push(nodes[node as usize]);
                doubles.push((node, double));
                for t in part {
                    tets[t].iter_mut().filter(|n| **n == node).for_each(|n| *n = double);
                }
            }
        }
        // The shape of no tetrahedron has changed.
        let Ok(mut mesh) = Self::new(nodes, tets, self.labels().to_vec()) else { return self.clone() };
        // No cell has come or gone.
        let Ok(()) = mesh.set_fractions(self.fractions().clone()) else { return self.clone() };
        for (set, members) in &self.node_sets {
            let more = doubles.iter().filter(|(node, _)| members.binary_search(node).is_ok()).map(|d| d.1);
            mesh.node_sets.insert(set.clone(), members.iter().copied().chain(more).collect());
        }
        // Which facets the tetrahedra at the sheet have now, by the facet they had.
        let mut now: BTreeMap<[u32; 3], Vec<[u32; 3]>> = BTreeMap::new();
        let mut at_sheet: Vec<usize> = around.into_values().flatten().collect();
        at_sheet.sort_unstable();
        at_sheet.dedup();
        for t in at_sheet {
            for face in TET_FACES {
                let was = sorted(face.map(|c| self.tets()[t][c]));
                now.entry(was).or_default().push(face.map(|c| mesh.tets()[t][c]));
            }
        }
        for (set, facets) in self.facet_sets.iter().filter(|(set, _)| *set != name) {
            let follow = |facet: &[u32; 3]| match now.get(&sorted(*facet)).and_then(|faces| faces.first()) {
                // As its tetrahedron sees it, in the order in which the set has it.
                Some(face) => facet.map(|n| {
                    let same = face.iter().find(|m| **m == n || doubles.contains(&(n, **m)));
                    same.copied().unwrap_or(n)
                }),
                None => *facet,
            };
            mesh.facet_sets.insert(set.clone(), facets.iter().map(follow).collect());
        }
        let sides = cut.iter().flat_map(|facet| now.get(facet).cloned().unwrap_or_default()).collect();
        mesh.facet_sets.insert(name.to_owned(), sides);
        mesh
    }

    /// The tetrahedra around a node in parts that hang together through faces at the node which are not cut, by their first
    /// tetrahedron.
    fn parts_around(&self, node: u32, own: &[usize], is_cut: &impl Fn([u32; 3]) -> bool) -> Vec<Vec<usize>> {
        let mut faces: Vec<([u32; 3], usize)> = Vec::new();
        for (place, &t) in own.iter().enumerate() {
            for face in TET_FACES.map(|face| face.map(|c| self.tets()[t][c])) {
                if face.contains(&node) && !is_cut(face) {
                    let mut key = face;
                    key.sort_unstable();
                    faces.push((key, place));
                }
            }
        }
        faces.sort_unstable();
        let mut part: Vec<usize> = (0..own.len()).collect();
        loop {
            let before = part.clone();
            for pair in faces.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
                let least = part[pair[0].1].min(part[pair[1].1]);
                (part[pair[0].1], part[pair[1].1]) = (least, least);
            }
            if part == before {
                break;
            }
        }
        let mut parts: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (place, &t) in own.iter().enumerate() {
            parts.entry(part[place]).or_default().push(t);
        }
        parts.into_values().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of cubes along x, each of six tetrahedra, with the plane between the first two as a sheet.
    fn row(cubes: usize, wide: usize) -> (TetMesh, Vec<[u32; 3]>) {
        const SPLIT: [[usize; 4]; 6] =
            [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]];
        let number = |i: usize, j: usize, k: usize| (i + (cubes + 1) * (j + 2 * k)) as u32;
        let mut nodes = Vec::new();
        for k in 0..=wide {
            for j in 0..2 {
                nodes.extend((0..=cubes).map(|i| [i as f64, f64::from(j), k as f64]));
            }
        }
        let mut tets = Vec::new();
        for k in 0..wide {
            for i in 0..cubes {
                let c = [(0, 0), (1, 0), (1, 1), (0, 1)];
                let at = |k: usize| c.map(|(a, b)| number(i + a, b, k));
                let corners = [at(k), at(k + 1)].concat();
                tets.extend(SPLIT.map(|tet| tet.map(|n| corners[n])));
            }
        }
        let labels = vec![2; tets.len()];
        let mesh = TetMesh::new(nodes, tets, labels).unwrap();
        let on = |f: &[u32; 3]| f.iter().all(|&n| mesh.nodes_mm()[n as usize][0] == 1.0);
        let sheet = mesh.facets().into_iter().filter(|f| f.2.is_some() && on(&f.0)).map(|f| f.0).collect();
        (mesh, sheet)
    }

    #[test]
    fn a_sheet_across_the_body_parts_it_in_two() {
        let (mut mesh, sheet) = row(2, 1);
        mesh.set_nodes("sheet", sheet.as_flattened().to_vec()).unwrap();
        let cut = mesh.cut_along("sheet", &sheet);
        assert_eq!((mesh.nodes_mm().len(), cut.nodes_mm().len()), (12, 16));
        assert_eq!(cut.largest_face_connected_part().unwrap().0.tets().len(), 6);
        assert_eq!((cut.node_sets["sheet"].len(), cut.facet_sets["sheet"].len()), (8, 4));
        let normals: Vec<f64> = cut.facet_sets["sheet"].iter().map(|&f| cut.area_vector_mm2(f).x.signum()).collect();
        assert_eq!(normals.iter().filter(|n| **n > 0.0).count(), 2);
        assert_eq!(cut.boundary_facets(|_| true).len(), mesh.boundary_facets(|_| true).len() + 4);
    }

    #[test]
    fn where_the_sheet_ends_inside_the_body_it_stays_whole() {
        // The sheet covers the lower of two rows: its upper edge is inside.
        let (mesh, sheet) = row(2, 2);
        let lower: Vec<[u32; 3]> =
            sheet.into_iter().filter(|f| f.iter().all(|&n| mesh.nodes_mm()[n as usize][2] <= 1.0)).collect();
        let cut = mesh.cut_along("sheet", &lower);
        assert_eq!(cut.nodes_mm().len(), mesh.nodes_mm().len() + 2);
        assert_eq!(cut.largest_face_connected_part().unwrap().0.tets().len(), mesh.tets().len());
    }

    #[test]
    fn facets_of_other_sets_follow_their_tetrahedron() {
        let (mut mesh, sheet) = row(2, 1);
        let bottom: Vec<[u32; 3]> = mesh.boundary_facets(|_| true);
        mesh.facet_sets.insert("outside".into(), bottom);
        let cut = mesh.cut_along("sheet", &sheet);
        let mut outside = cut.boundary_facets(|_| true);
        outside.retain(|f| !cut.facet_sets["sheet"].contains(f));
        assert_eq!(cut.facet_sets["outside"], outside);
        // Cut once more, nothing is left to part.
        let sides = cut.facet_sets["sheet"].clone();
        assert_eq!(cut.cut_along("sheet", &sides).nodes_mm(), cut.nodes_mm());
    }
}
