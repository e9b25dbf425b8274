//! The interface surface that engines for the inside of surfaces are fed.

use crate::mesh::optimise::{AIR, Complex, Point};
use std::collections::HashMap;

/// All facets between fields and around the mesh, by the two connected regions on their sides. It is made of faces of a valid
/// tetrahedral mesh: closed around every region, nothing crosses.
#[derive(Debug)]
pub(super) struct InterfaceSurface {
    pub x: Vec<Point>,
    /// Corners and the regions below and above (counter-clockwise seen from above); no region above outer facets.
    pub facets: Vec<([u32; 3], u32, Option<u32>)>,
    /// Field of every region.
    pub field: Vec<u8>,
    /// The layer of tets outside: numbers of nodes, those past the end of `x` in `far`.
    air: Vec<[u32; 4]>,
    far: Vec<Point>,
}

impl InterfaceSurface {
    /// Of a mesh; a region is what hangs together through faces of one field.
    pub fn of(complex: &Complex) -> Self {
        let solid = |t: &u32| complex.is_solid(*t);
        let mut region = vec![u32::MAX; complex.tets.len()];
        let mut field = Vec::new();
        for start in complex.solid() {
            if region[start as usize] != u32::MAX {
                continue;
            }
            region[start as usize] = field.len() as u32;
            let mut open = vec![start];
            while let Some(t) = open.pop() {
                for next in (0..4).filter_map(|corner| complex.across(t, corner)) {
                    let joined = complex.field[next as usize] == complex.field[t as usize];
                    if joined && region[next as usize] == u32::MAX {
                        region[next as usize] = field.len() as u32;
                        open.push(next);
                    }
                }
            }
            field.push(complex.field[start as usize]);
        }
        let mut number = vec![u32::MAX; complex.x.len()];
        let mut x: Vec<Point> = Vec::new();
        let mut numbered = |v: u32, x: &mut Vec<Point>| {
            if number[v as usize] == u32::MAX {
                number[v as usize] = x.len() as u32;
                x.push(complex.x[v as usize]);
            }
            number[v as usize]
        };
        let mut facets = Vec::new();
        for t in complex.solid() {
            for corner in 0..4 {
                let across = complex.across(t, corner).filter(solid);
                let own = region[t as usize];
                if across.is_none_or(|other| region[other as usize] != own && t < other) {
                    let face = crate::mesh::TET_FACES[corner].map(|c| complex.tets[t as usize][c]);
                    facets.push((face.map(|v| numbered(v, &mut x)), own, across.map(|other| region[other as usize])));
                }
            }
        }
        let nodes = x.len();
        let outside = complex.alive().filter(|t| !solid(t));
        let air = outside.map(|t| complex.tets[t as usize].map(|v| numbered(v, &mut x))).collect();
        let far = x.split_off(nodes);
        Self { x, facets, field, air, far }
    }

    /// What an engine made of the inside, with the layer outside around it again. The engine keeps the surface's nodes where
    /// they are, in whatever order; without a layer, or where it moved some, the inside alone.
    pub fn around(&self, mut x: Vec<Point>, mut tets: Vec<[u32; 4]>, mut fields: Vec<u8>) -> Complex {
        let place = |p: &Point| p.map(|c| (c * 1e6).round() as i64);
        let numbers: HashMap<_, u32> = x.iter().enumerate().map(|(n, p)| (place(p), n as u32)).collect();
        let found: Option<Vec<u32>> = self.x.iter().map(|p| numbers.get(&place(p)).copied()).collect();
        if let Some(found) = found {
            let inside = x.len() as u32;
            let number = |v: u32| found.get(v as usize).copied().unwrap_or(inside + v - found.len() as u32);
            tets.extend(self.air.iter().map(|tet| tet.map(number)));
            fields.resize(tets.len(), AIR);
            x.extend(&self.far);
        }
        Complex::new(x, tets, fields)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_that_do_not_touch_are_told_apart_and_every_surface_is_closed() {
        // Two tets of field 1 on either side of one of field 2, and a third apart.
        let x = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 0.0, 0.0]];
        let mut x: Vec<Point> = x.map(Point::from).to_vec();
        let apart: Vec<Point> = x[..4].iter().map(|p| p + Point::new(9.0, 0.0, 0.0)).collect();
        x.extend(apart);
        let tets = vec![[1, 2, 3, 4], [0, 1, 2, 3], [0, 5, 3, 2], [6, 7, 8, 9]];
        let surface = InterfaceSurface::of(&Complex::new(x, tets, vec![1, 2, 1, 1]));
        assert_eq!(surface.field, [1, 2, 1, 1]);
        for region in 0..4 {
            let mut sum = Point::zeros();
            for (corners, below, above) in &surface.facets {
                let [a, b, c] = corners.map(|v| surface.x[v as usize]);
                let area = (b - a).cross(&(c - a));
                sum += area * (f64::from(u8::from(*below == region)) - f64::from(u8::from(*above == Some(region))));
            }
            assert!(sum.norm() < 1e-12, "the area vectors of a closed surface cancel");
        }
    }
}
