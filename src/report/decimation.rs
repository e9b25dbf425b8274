//! Surfaces made small enough for a page.

use crate::mesh::TriMesh;

/// A surface with fewer triangles, and where its nodes come from: nodes that share a cube of a lattice become their mean, the
/// cube as small as will do (J. Rossignac, P. Borrel, "Multi-resolution 3D approximations for rendering complex scenes", 1993).
#[derive(Clone, Debug, PartialEq)]
pub struct Decimation {
    /// The smaller surface.
    pub surface: TriMesh,
    /// The node of the smaller surface that every node has gone into; absent where the surface was small enough.
    node_of: Option<Vec<u32>>,
}

impl Decimation {
    /// A surface with at most about `triangles_max` triangles; one that is small enough stays as it is.
    pub fn of(surface: &TriMesh, triangles_max: usize) -> Self {
        let mut found = Self { surface: surface.clone(), node_of: None };
        // Two triangles per square of the lattice on a flat surface; then larger until it fits.
        let mut edge_mm = (2.0 * surface.area_mm2() / triangles_max.max(1) as f64).sqrt();
        while found.surface.triangles.len() > triangles_max && edge_mm > 0.0 {
            found = Self::clustered(surface, edge_mm);
            edge_mm *= 1.15;
        }
        found
    }

    fn clustered(surface: &TriMesh, edge_mm: f64) -> Self {
        let cube = |p: &[f64; 3]| p.map(|x| (x / edge_mm).floor() as i64);
        let mut cubes: Vec<[i64; 3]> = surface.nodes_mm.iter().map(cube).collect();
        cubes.sort_unstable();
        cubes.dedup();
        let number = |p: &[f64; 3]| cubes.binary_search(&cube(p)).unwrap_or(0) as u32;
        let node_of: Vec<u32> = surface.nodes_mm.iter().map(number).collect();
        let mut triangles: Vec<[u32; 3]> = surface.triangles.iter().map(|t| t.map(|n| node_of[n as usize])).collect();
        triangles.retain(|[a, b, c]| a != b && b != c && c != a);
        let nodes_mm = means(&node_of, cubes.len(), &surface.nodes_mm);
        Self { surface: TriMesh { nodes_mm, triangles }, node_of: Some(node_of) }
    }

    /// What the nodes carried, on the smaller surface: the mean of the finite values, component by component; NaN where there
    /// is none.
    pub fn means<const N: usize>(&self, values: &[[f64; N]]) -> Vec<[f64; N]> {
        match &self.node_of {
            None => values.to_vec(),
            Some(node_of) => means(node_of, self.surface.nodes_mm.len(), values),
        }
    }
}

fn means<const N: usize>(node_of: &[u32], nodes: usize, values: &[[f64; N]]) -> Vec<[f64; N]> {
    let mut sums = vec![[0.0; N]; nodes];
    let mut finite = vec![[0.0; N]; nodes];
    for (&node, value) in node_of.iter().zip(values) {
        for (a, v) in value.iter().enumerate().filter(|(_, v)| v.is_finite()) {
            sums[node as usize][a] += v;
            finite[node as usize][a] += 1.0;
        }
    }
    let mean = |(sum, count): ([f64; N], [f64; N])| std::array::from_fn(|a| sum[a] / count[a]);
    sums.into_iter().zip(finite).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of n x n quads in the plane z = 0.
    fn square(n: usize) -> TriMesh {
        let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
        let nodes_mm: Vec<[f64; 3]> = (0..=n).flat_map(|i| (0..=n).map(move |j| [i as f64, j as f64, 0.0])).collect();
        let triangles = (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        TriMesh { nodes_mm, triangles }
    }

    #[test]
    fn decimation_keeps_area_values_and_the_bound() {
        let surface = square(60);
        let values: Vec<[f64; 1]> = surface.nodes_mm.iter().map(|p| [p[0]]).collect();
        let small = Decimation::of(&surface, 2000);
        let means = small.means(&values);
        let count = small.surface.triangles.len();
        assert!(count <= 2000 && count > 1000, "{count}");
        assert!((small.surface.area_mm2() / surface.area_mm2() - 1.0).abs() < 0.08);
        assert!(small.surface.nodes_mm.iter().zip(&means).all(|(p, [v])| (p[0] - v).abs() < 1e-9));
    }

    #[test]
    fn a_small_surface_is_left_alone_and_a_value_that_is_not_there_counts_for_nothing() {
        let surface = square(3);
        let kept = Decimation::of(&surface, 100);
        assert_eq!(kept.surface, surface);
        assert_eq!(kept.means(&[[1.0, 2.0]]), [[1.0, 2.0]]);
        let found = means(&[0, 0, 1], 2, &[[1.0], [f64::NAN], [f64::NAN]]);
        assert!(found[0] == [1.0] && found[1][0].is_nan());
    }
}
