//! A tetrahedral complex that can be edited: tets around every vertex, cells replaced cavity by cavity.

use crate::mesh::sheet::Sheet;
use nalgebra::Vector3;
use rayon::prelude::*;

/// A point of the box of a `LabelField`, mm.
pub(crate) type Point = Vector3<f64>;

/// Field number of a tet that has been taken out.
pub(crate) const GONE: u8 = u8::MAX;

/// Field number of a tet outside the labels. Such tets are no part of the mesh. A layer of them around it, where an engine gives
/// one, keeps its outer surface from passing through itself: like any tet they may not be turned inside out, but their shape
/// is nobody's concern.
pub(crate) const AIR: u8 = 0;

/// The six edges of a tet by local corners.
pub(crate) const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// A facet between two fields: corners seen counter-clockwise from the side of `above`, which alone may be the outside, 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct InterfaceFacet {
    pub corners: [u32; 3],
    pub below: u8,
    pub above: u8,
}

/// Tets with a field number each, editable. See [`AIR`] for those outside the labels.
#[derive(Clone, Debug, Default)]
pub(crate) struct Complex {
    pub x: Vec<Point>,
    pub tets: Vec<[u32; 4]>,
    pub field: Vec<u8>,
    pub star: Vec<Vec<u32>>,
    /// Where fields are halves of one label.
    pub sheet: Option<Sheet>,
    /// Vertices that move in the midplane only; empty when none do.
    pub flat: Vec<bool>,
    free: Vec<u32>,
}

impl Complex {
    pub fn new(x: Vec<Point>, tets: Vec<[u32; 4]>, field: Vec<u8>) -> Self {
        let mut star = vec![Vec::new(); x.len()];
        for (t, tet) in tets.iter().enumerate() {
            for &v in tet {
                star[v as usize].push(t as u32);
            }
        }
        Self { x, tets, field, star, sheet: None, flat: Vec::new(), free: Vec::new() }
    }

    pub fn alive(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.tets.len() as u32).filter(|&t| self.field[t as usize] != GONE)
    }

    /// The tets of the mesh: alive and not [`AIR`].
    pub fn solid(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.tets.len() as u32).filter(|&t| self.is_solid(t))
    }

    #[inline]
    pub fn is_solid(&self, t: u32) -> bool {
        !matches!(self.field[t as usize], GONE | AIR)
    }

    /// Number of tets of the mesh.
    pub fn count(&self) -> usize {
        self.solid().count()
    }

    /// Takes a tet out of the mesh: it becomes air where there is air, so that the layer stays whole.
    pub fn vent(&mut self, t: u32) {
        if self.field.contains(&AIR) {
            self.field[t as usize] = AIR;
        } else {
            self.take_out(t);
        }
    }

    #[inline]
    pub fn points(&self, tet: &[u32; 4]) -> [Point; 4] {
        tet.map(|v| self.x[v as usize])
    }

    #[inline]
    pub fn quality(&self, t: u32) -> f64 {
        let [a, b, c, d] = self.points(&self.tets[t as usize]);
        quality(&a, &b, &c, &d)
    }

    /// Worst quality of the mesh's tets around a vertex.
    pub fn star_quality(&self, v: u32) -> f64 {
        self.star[v as usize].iter().filter(|&&t| self.is_solid(t)).map(|&t| self.quality(t)).fold(f64::MAX, f64::min)
    }

    /// The other tet at the face of `t` opposite its local corner, or `None` at the outside.
    pub fn across(&self, t: u32, corner: usize) -> Option<u32> {
        let tet = self.tets[t as usize];
        let face: [u32; 3] = std::array::from_fn(|n| tet[(corner + 1 + n) % 4]);
        self.sharing(&face).find(|&other| other != t)
    }

    /// Tets that have all of these vertices.
    pub fn sharing<'a>(&'a self, vertices: &'a [u32]) -> impl Iterator<Item = u32> + 'a {
        let shortest = vertices.iter().copied().min_by_key(|&v| self.star[v as usize].len()).unwrap_or(0);
        let has_all = move |t: &u32| vertices.iter().all(|v| self.tets[*t as usize].contains(v));
        self.star[shortest as usize].iter().copied().filter(has_all)
    }

    /// A new vertex, without tets yet.
    pub fn add(&mut self, place: Point) -> u32 {
        self.x.push(place);
        self.star.push(Vec::new());
        (self.x.len() - 1) as u32
    }

    pub fn take_out(&mut self, t: u32) {
        for v in self.tets[t as usize] {
            self.star[v as usize].retain(|&s| s != t);
        }
        self.field[t as usize] = GONE;
        self.free.push(t);
    }

    pub fn put_in(&mut self, tet: [u32; 4], field: u8) -> u32 {
        let t = if let Some(t) = self.free.pop() {
            self.tets[t as usize] = tet;
            self.field[t as usize] = field;
            t
        } else {
            self.tets.push(tet);
            self.field.push(field);
            (self.tets.len() - 1) as u32
        };
        for v in tet {
            self.star[v as usize].push(t);
        }
        t
    }

    /// Whether the face between fields `a` and `b` counts for nothing (see [`Sheet::is_loose`]).
    #[inline]
    pub fn is_loose(&self, a: u8, b: u8, face: [u32; 3]) -> bool {
        self.sheet.as_ref().is_some_and(|sheet| {
            sheet.crosses(a, b)
                && sheet.is_loose(a, b, &(face.iter().map(|&v| self.x[v as usize]).sum::<Point>() / 3.0))
        })
    }

    /// The part of a step of a vertex that it may take.
    #[inline]
    pub fn allowed(&self, v: u32, step: Point) -> Point {
        match &self.sheet {
            Some(sheet) if self.flat.get(v as usize) == Some(&true) => {
                step - sheet.normal() * sheet.normal().dot(&step)
            }
            _ => step,
        }
    }

    /// For every vertex: bit k when field k meets it, bit 0 when it is on the outer boundary.
    pub fn all_fields(&self) -> Vec<u64> {
        let mut mask = vec![0u64; self.x.len()];
        for t in self.alive() {
            for v in self.tets[t as usize] {
                mask[v as usize] |= 1 << self.field[t as usize];
            }
        }
        for facet in self.interface_facets() {
            for v in facet.corners {
                mask[v as usize] |= 1 << facet.below | 1 << facet.above;
            }
        }
        mask
    }

    /// Neighbours of a vertex, ascending.
    pub fn neighbours(&self, v: u32) -> Vec<u32> {
        let star = self.star[v as usize].iter();
        let mut near: Vec<u32> = star.flat_map(|&t| self.tets[t as usize]).filter(|&n| n != v).collect();
        near.sort_unstable();
        near.dedup();
        near
    }

    /// Every facet between two fields and every outer facet, in an order that depends on the complex only.
    pub fn interface_facets(&self) -> Vec<InterfaceFacet> {
        let mut faces: Vec<([u32; 3], u32)> = Vec::with_capacity(4 * self.tets.len());
        for t in self.alive() {
            for corner in 0..4u32 {
                let tet = self.tets[t as usize];
                let mut key: [u32; 3] = std::array::from_fn(|n| tet[(corner as usize + 1 + n) % 4]);
                key.sort_unstable();
                faces.push((key, 4 * t + corner));
            }
        }
        faces.par_sort_unstable();
        let mut facets = Vec::new();
        let mut n = 0;
        while n < faces.len() {
            let (key, id) = faces[n];
            let below = self.field[id as usize / 4];
            let partner = faces.get(n + 1).filter(|f| f.0 == key);
            let above = partner.map_or(0, |f| self.field[f.1 as usize / 4]);
            n += 1 + usize::from(partner.is_some());
            if above != below {
                let tet = self.tets[id as usize / 4];
                let [a, b, c] = crate::mesh::TET_FACES[id as usize % 4].map(|c| tet[c]);
                facets.push(if below == AIR {
                    InterfaceFacet { corners: [a, c, b], below: above, above: below }
                } else {
                    InterfaceFacet { corners: [a, b, c], below, above }
                });
            }
        }
        facets
    }

    /// The tets around an edge in order and the ring of vertices: `ring[n], ring[n + 1]` belong to `tets[n]`. A closed
    /// ring has as many vertices as tets, an open one (outer edge) one more. `None` when the tets around the edge do
    /// not form one fan.
    pub fn ring(&self, a: u32, b: u32) -> Option<Ring> {
        let mut sides: Vec<(u32, u32, u32)> = Vec::with_capacity(8);
        for t in self.sharing(&[a, b]) {
            // The two others in the order that makes (a, b, from, to) right-handed.
            let tet = self.tets[t as usize];
            let (from, to) = others_in_order(&tet, a, b);
            sides.push((from, to, t));
        }
        if sides.is_empty() {
            return None;
        }
        let start = sides.iter().position(|s| sides.iter().all(|o| o.1 != s.0));
        let closed = start.is_none();
        let mut at = start.unwrap_or(0);
        let mut ring = Ring { vertices: vec![sides[at].0], tets: Vec::with_capacity(sides.len()), closed };
        for _ in 0..sides.len() {
            ring.tets.push(sides[at].2);
            let to = sides[at].1;
            if ring.tets.len() == sides.len() {
                if closed {
                    return (to == ring.vertices[0]).then_some(ring);
                }
                ring.vertices.push(to);
                return Some(ring);
            }
            ring.vertices.push(to);
            at = sides.iter().position(|s| s.0 == to)?;
            if ring.tets.contains(&sides[at].2) {
                return None;
            }
        }
        None
    }

    /// The mesh alone, without what is gone or air, numbered anew in order.
    pub fn compacted(&self) -> (Vec<Point>, Vec<[u32; 4]>, Vec<u8>) {
        let mut number = vec![u32::MAX; self.x.len()];
        for t in self.solid() {
            for v in self.tets[t as usize] {
                number[v as usize] = 0;
            }
        }
        let mut x = Vec::new();
        for (v, number) in number.iter_mut().enumerate().filter(|(_, n)| **n == 0) {
            *number = x.len() as u32;
            x.push(self.x[v]);
        }
        let tets = self.solid().map(|t| self.tets[t as usize].map(|v| number[v as usize])).collect();
        (x, tets, self.solid().map(|t| self.field[t as usize]).collect())
    }
}

/// See [`Complex::ring`].
pub(crate) struct Ring {
    pub vertices: Vec<u32>,
    pub tets: Vec<u32>,
    pub closed: bool,
}

// The two others of (i, j) in an even permutation (i, j, k, l).
const ORDER: [[(usize, usize); 4]; 4] = [
    [(0, 0), (2, 3), (3, 1), (1, 2)],
    [(3, 2), (0, 0), (0, 3), (2, 0)],
    [(1, 3), (3, 0), (0, 0), (0, 1)],
    [(2, 1), (0, 2), (1, 0), (0, 0)],
];

/// The other two vertices of a tet, such that (a, b, first, second) is right-handed when the tet is.
fn others_in_order(tet: &[u32; 4], a: u32, b: u32) -> (u32, u32) {
    let i = tet.iter().position(|&v| v == a).unwrap_or(0);
    let j = tet.iter().position(|&v| v == b).unwrap_or(1);
    let (k, l) = ORDER[i][j];
    (tet[k], tet[l])
}

/// Smallest sine of the six dihedral angles, negative for an inverted tet: 3 V l / (2 A1 A2) over the edges, with the
/// areas of the two faces at the edge (Freitag and Ollivier-Gooch 1997).
#[inline]
pub(crate) fn min_sine(a: &Point, b: &Point, c: &Point, d: &Point) -> f64 {
    let (ab, ac, ad, bc, bd, cd) = (b - a, c - a, d - a, c - b, d - b, d - c);
    let (na, nb, nc, nd) = (bc.cross(&bd), ac.cross(&ad), ab.cross(&ad), ab.cross(&ac));
    let six_v = nd.dot(&ad);
    let (sa, sb, sc, sd) = (na.norm_squared(), nb.norm_squared(), nc.norm_squared(), nd.norm_squared());
    // sin^2 = (6V)^2 l^2 / (|n1|^2 |n2|^2), n = twice the area vector.
    let smallest = [
        ab.norm_squared() / (sc * sd),
        ac.norm_squared() / (sb * sd),
        ad.norm_squared() / (sb * sc),
        bc.norm_squared() / (sa * sd),
        bd.norm_squared() / (sa * sc),
        cd.norm_squared() / (sa * sb),
    ]
    .into_iter()
    .fold(f64::MAX, f64::min);
    let sine = six_v * smallest.sqrt();
    if sine.is_finite() { sine } else { -1.0 }
}

/// How many times radius ratio and scaled Jacobian count against the smallest sine: at the default target angle of 18
/// degrees (sine 0.31) they are raised to at least 0.15 and 0.08. Angles alone leave tets with three corners nearly on a line.
const RADIUS_RATIO_WEIGHT: f64 = 2.0;
const SCALED_JACOBIAN_WEIGHT: f64 = 4.0;

/// Six volumes of a tet over its longest edge at `a`, cubed: what tets of air keep at least [`THIN`] of, so that nothing touches.
#[inline]
pub(crate) fn thickness(a: &Point, b: &Point, c: &Point, d: &Point) -> f64 {
    let (ab, ac, ad) = (b - a, c - a, d - a);
    let scale = ab.norm_squared().max(ac.norm_squared()).max(ad.norm_squared()).max(f64::MIN_POSITIVE);
    ab.cross(&ac).dot(&ad) / (scale * scale.sqrt())
}

/// See [`thickness`].
pub(crate) const THIN: f64 = 1e-3;

/// Smallest dihedral sine (see [`min_sine`]), radius ratio and scaled Jacobian (see `ShapeQuality`), all negative for an
/// inverted tet.
#[inline]
pub(crate) fn shape(a: &Point, b: &Point, c: &Point, d: &Point) -> [f64; 3] {
    let (ab, ac, ad, bc, bd, cd) = (b - a, c - a, d - a, c - b, d - b, d - c);
    let (na, nb, nc, nd) = (bc.cross(&bd), ac.cross(&ad), ab.cross(&ad), ab.cross(&ac));
    let six_v = nd.dot(&ad);
    let (sa, sb, sc, sd) = (na.norm_squared(), nb.norm_squared(), nc.norm_squared(), nd.norm_squared());
    let [lab, lac, lad, lbc, lbd, lcd] = [ab, ac, ad, bc, bd, cd].map(|e| e.norm_squared());
    let smallest =
        [lab / (sc * sd), lac / (sb * sd), lad / (sb * sc), lbc / (sa * sd), lbd / (sa * sc), lcd / (sa * sb)]
            .into_iter()
            .fold(f64::MAX, f64::min);
    let twice_area = sa.sqrt() + sb.sqrt() + sc.sqrt() + sd.sqrt();
    let to_centre = nb * lab - nc * lac + nd * lad;
    // 3 r / R with r = 3 V / A and R = |to_centre| / (12 V).
    let radius_ratio = 6.0 * six_v * six_v.abs() / (twice_area * to_centre.norm());
    let corner = [lab * lac * lad, lab * lbc * lbd, lac * lbc * lcd, lad * lbd * lcd].into_iter().fold(0.0, f64::max);
    [six_v * smallest.sqrt(), radius_ratio, std::f64::consts::SQRT_2 * six_v / corner.sqrt()]
}

/// What the quality pass raises: the smallest of dihedral sine, weighted radius ratio and weighted scaled Jacobian;
/// negative for an inverted tet.
#[inline]
pub(crate) fn quality(a: &Point, b: &Point, c: &Point, d: &Point) -> f64 {
    let [sine, radius_ratio, scaled_jacobian] = shape(a, b, c, d);
    let quality = sine.min(RADIUS_RATIO_WEIGHT * radius_ratio).min(SCALED_JACOBIAN_WEIGHT * scaled_jacobian);
    if quality.is_finite() { quality } else { -1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regular_tet_has_the_sine_of_its_dihedral_angle() {
        let p = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(Point::from);
        // cos = 1/3, so sin = sqrt(8)/3.
        let sine = min_sine(&p[0], &p[2], &p[1], &p[3]).abs();
        assert!((sine - 8f64.sqrt() / 3.0).abs() < 1e-12);
        assert!((min_sine(&p[0], &p[1], &p[2], &p[3]) + min_sine(&p[0], &p[2], &p[1], &p[3])).abs() < 1e-12);
    }

    #[test]
    fn the_ring_of_an_inner_edge_is_closed_and_right_handed() {
        let mut x = vec![Point::new(0.0, 0.0, -1.0), Point::new(0.0, 0.0, 1.0)];
        let n = 5;
        for k in 0..n {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(n);
            x.push(Point::new(angle.cos(), angle.sin(), 0.0));
        }
        let side = |k: u32| [0, 1, 2 + k, 2 + (k + 1) % 5];
        let complex = Complex::new(x.clone(), (0..5).map(side).collect(), vec![1; 5]);
        assert!(complex.alive().all(|t| complex.quality(t) > 0.0));
        let ring = complex.ring(0, 1).unwrap();
        assert!(ring.closed && ring.vertices.len() == 5);
        for (n, &t) in ring.tets.iter().enumerate() {
            let (p, q) = (ring.vertices[n], ring.vertices[(n + 1) % 5]);
            assert!(complex.tets[t as usize].contains(&p) && complex.tets[t as usize].contains(&q));
            let [a, b, c, d] = complex.points(&[0, 1, p, q]);
            assert!(min_sine(&a, &b, &c, &d) > 0.0);
        }
        let open = Complex::new(x, (0..4).map(side).collect(), vec![1; 4]).ring(0, 1).unwrap();
        assert!(!open.closed && open.vertices.len() == 5 && open.tets.len() == 4);
    }
}
