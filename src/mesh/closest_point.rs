//! Distance from points to a triangle surface.

use super::TriMesh;
use nalgebra::{Point3, Vector3};

/// A surface prepared for closest-point queries: a tree of boxes over its triangles.
///
/// ```
/// use hgm::mesh::{ClosestPoint, TriMesh};
/// let floor = TriMesh { nodes_mm: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], triangles: vec![[0, 1, 2]] };
/// let hit = ClosestPoint::new(&floor).unwrap().find([0.2, 0.2, 3.0]);
/// assert_eq!((hit.distance_mm, hit.triangle), (3.0, 0));
/// ```
#[derive(Clone, Debug)]
pub struct ClosestPoint {
    corners: Vec<[Point3<f64>; 3]>,
    number: Vec<u32>,
    boxes: Vec<Node>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    low: Point3<f64>,
    high: Point3<f64>,
    first: u32,
    count: u32,
    /// The right child; the left one follows its parent. 0 for a leaf.
    right: u32,
}

/// The nearest point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The point, mm.
    pub point_mm: Point3<f64>,
    /// Its distance, mm.
    pub distance_mm: f64,
    /// The triangle it lies on.
    pub triangle: u32,
}

const LEAF: usize = 8;

impl ClosestPoint {
    /// Prepares a surface; `None` when it has no triangles.
    pub fn new(surface: &TriMesh) -> Option<Self> {
        if surface.triangles.is_empty() {
            return None;
        }
        let corner = |t: &[u32; 3]| t.map(|n| Point3::from(surface.nodes_mm[n as usize]));
        let mut order: Vec<([Point3<f64>; 3], u32)> =
            surface.triangles.iter().enumerate().map(|(n, t)| (corner(t), n as u32)).collect();
        let mut boxes = Vec::with_capacity(order.len() / 2);
        let end = order.len();
        split(&mut order, 0, end, &mut boxes);
        let (corners, number) = order.into_iter().unzip();
        Some(Self { corners, number, boxes })
    }

    /// The closest point of the surface.
    pub fn find(&self, point_mm: [f64; 3]) -> Hit {
        let p = Point3::from(point_mm);
        let mut best = (f64::INFINITY, p, 0u32);
        let mut stack = vec![(0u32, 0.0f64)];
        while let Some((n, bound)) = stack.pop() {
            if bound > best.0 {
                continue;
            }
            let node = &self.boxes[n as usize];
            if node.right == 0 {
                for t in node.first..node.first + node.count {
                    let q = closest_on_triangle(p, &self.corners[t as usize]);
                    let candidate = ((q - p).norm_squared(), q, self.number[t as usize]);
                    // Ties go to the lower triangle number: the answer does not depend on the tree.
                    if candidate.0 < best.0 || (candidate.0 == best.0 && candidate.2 < best.2) {
                        best = candidate;
                    }
                }
                continue;
            }
            let child = |c: u32| (c, squared_distance_to_box(p, &self.boxes[c as usize]));
            let (left, right) = (child(n + 1), child(node.right));
            let (near, far) = if left.1 <= right.1 { (left, right) } else { (right, left) };
            stack.push(far);
            stack.push(near);
        }
        Hit { point_mm: best.1, distance_mm: best.0.sqrt(), triangle: best.2 }
    }
}

fn split(order: &mut [([Point3<f64>; 3], u32)], first: usize, end: usize, boxes: &mut Vec<Node>) {
    let part = &mut order[first..end];
    let (mut low, mut high) = (part[0].0[0], part[0].0[0]);
    for corner in part.iter().flat_map(|(corners, _)| corners) {
        low = low.inf(corner);
        high = high.sup(corner);
    }
    let me = boxes.len();
    boxes.push(Node { low, high, first: first as u32, count: (end - first) as u32, right: 0 });
    if end - first <= LEAF {
        return;
    }
    let axis = (high - low).imax();
    let centre = |t: &([Point3<f64>; 3], u32)| (t.0[0][axis] + t.0[1][axis] + t.0[2][axis], t.1);
    let middle = usize::midpoint(first, end);
    part.select_nth_unstable_by(middle - first, |a, b| {
        let (a, b) = (centre(a), centre(b));
        a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
    });
    split(order, first, middle, boxes);
    boxes[me].right = boxes.len() as u32;
    split(order, middle, end, boxes);
}

fn squared_distance_to_box(p: Point3<f64>, node: &Node) -> f64 {
    let outside = |a: usize| (node.low[a] - p[a]).max(p[a] - node.high[a]).max(0.0);
    outside(0).powi(2) + outside(1).powi(2) + outside(2).powi(2)
}

/// Ericson, "Real-Time Collision Detection" (2005), section 5.1.5: by the Voronoi regions of the triangle.
pub(super) fn closest_on_triangle(p: Point3<f64>, [a, b, c]: &[Point3<f64>; 3]) -> Point3<f64> {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return b + (c - b) * w;
    }
    let scale = 1.0 / (va + vb + vc);
    let inner: Vector3<f64> = ab * (vb * scale) + ac * (vc * scale);
    a + inner
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bumpy_floor() -> TriMesh {
        let height = |i: usize, j: usize| ((i * 7 + j * 13) % 5) as f64 * 0.3;
        let nodes = (0..100).map(|n| [(n % 10) as f64, (n / 10) as f64, height(n % 10, n / 10)]).collect();
        let cells = (0..81u32).map(|c| c % 9 + c / 9 * 10);
        let triangles = cells.flat_map(|o| [[o, o + 1, o + 11], [o, o + 11, o + 10]]).collect();
        TriMesh { nodes_mm: nodes, triangles }
    }

    proptest! {
        #[test]
        fn the_tree_finds_what_looking_at_every_triangle_finds(p in [-3.0..12.0f64, -3.0..12.0f64, -4.0..4.0f64]) {
            let surface = bumpy_floor();
            let hit = ClosestPoint::new(&surface).unwrap().find(p);
            let each = surface.triangles.iter().map(|t| {
                let corners = t.map(|n| Point3::from(surface.nodes_mm[n as usize]));
                (closest_on_triangle(Point3::from(p), &corners) - Point3::from(p)).norm()
            });
            prop_assert_eq!(hit.distance_mm, each.fold(f64::INFINITY, f64::min));
        }
    }

    #[test]
    fn an_empty_surface_is_refused() {
        assert!(ClosestPoint::new(&TriMesh::default()).is_none());
    }
}
