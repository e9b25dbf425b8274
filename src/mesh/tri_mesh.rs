//! A triangle surface.

use nalgebra::Vector3;

/// Triangles over nodes in mm, RAS+; counter-clockwise seen from outside where there is an outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Node coordinates in mm.
    pub nodes_mm: Vec<[f64; 3]>,
    /// Node numbers of every triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl TriMesh {
    /// The surface made of `facets` of a larger node list: nodes renumbered in ascending order.
    /// Also returns, for every new node, its old number.
    pub fn from_facets(nodes_mm: &[[f64; 3]], facets: &[[u32; 3]]) -> (Self, Vec<u32>) {
        let mut old: Vec<u32> = facets.iter().flatten().copied().collect();
        old.sort_unstable();
        old.dedup();
        let mut number = vec![0u32; nodes_mm.len()];
        for (new, &o) in old.iter().enumerate() {
            number[o as usize] = new as u32;
        }
        let surface = Self {
            nodes_mm: old.iter().map(|&o| nodes_mm[o as usize]).collect(),
            triangles: facets.iter().map(|f| f.map(|n| number[n as usize])).collect(),
        };
        (surface, old)
    }

    /// Area vector of a triangle: normal times area, mm2.
    pub fn area_vector_mm2(&self, triangle: usize) -> Vector3<f64> {
        let [a, b, c] = self.triangles[triangle].map(|n| Vector3::from(self.nodes_mm[n as usize]));
        (b - a).cross(&(c - a)) * 0.5
    }

    /// Total area in mm2.
    pub fn area_mm2(&self) -> f64 {
        (0..self.triangles.len()).map(|t| self.area_vector_mm2(t).norm()).sum()
    }

    /// Whether the surface has no rim: every edge has exactly two triangles.
    pub fn is_closed(&self) -> bool {
        let of_triangle = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)]);
        let mut edges: Vec<[u32; 2]> = self.triangles.iter().flat_map(of_triangle).collect();
        edges.sort_unstable();
        !edges.is_empty() && edges.chunk_by(|a, b| a == b).all(|same| same.len() == 2)
    }

    /// Volume enclosed by a closed surface in mm3; positive when it is outward.
    pub fn enclosed_volume_mm3(&self) -> f64 {
        let cone = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|n| Vector3::from(self.nodes_mm[n as usize]));
            a.dot(&b.cross(&c)) / 6.0
        };
        self.triangles.iter().map(cone).sum()
    }
}
