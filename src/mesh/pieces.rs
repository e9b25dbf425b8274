//! Pieces of a mesh that hang together through facets, with a sheet between them.

use super::TetMesh;
use super::tet_mesh::root_of;
use std::collections::BTreeMap;

/// The most tetrahedra of a crumb.
const CRUMB: usize = 8;
/// A piece that is more of the mesh than one part in so many is none.
const PART: usize = 100;

/// A facet between two tetrahedra.
type Between = ([u32; 3], [u32; 2]);

fn sorted(mut facet: [u32; 3]) -> [u32; 3] {
    facet.sort_unstable();
    facet
}

/// The facets between two tetrahedra, those of the sheet and all others.
fn parted(mesh: &TetMesh, sheet: &[[u32; 3]]) -> (Vec<Between>, Vec<Between>) {
    let mut cut: Vec<[u32; 3]> = sheet.iter().copied().map(sorted).collect();
    cut.sort_unstable();
    let between = mesh.facets().into_iter().filter_map(|(facet, t, other)| Some((facet, [t as u32, other? as u32])));
    between.partition(|(facet, _)| cut.binary_search(&sorted(*facet)).is_ok())
}

fn join(root: &mut [u32], [a, b]: [u32; 2]) {
    let (a, b) = (root_of(root, a), root_of(root, b));
    root[a.max(b) as usize] = a.min(b);
}

impl TetMesh {
    /// For every tetrahedron the first one of its piece: pieces hang together through facets that are not of `sheet`.
    pub fn pieces_beside(&self, sheet: &[[u32; 3]]) -> Vec<u32> {
        let mut root: Vec<u32> = (0..self.tets().len() as u32).collect();
        parted(self, sheet).1.iter().for_each(|(_, sides)| join(&mut root, *sides));
        (0..root.len() as u32).map(|t| root_of(&mut root, t)).collect()
    }

    /// `sheet` without the facets that hold a crumb: tetrahedra that hang on to the body across the sheet alone, at a fold
    /// of it narrower than a cell. A cut there would leave them turning about an edge or a corner, where no
    /// equilibrium holds them; they stay with the neighbour that they share most area with.
    #[must_use]
    pub fn without_crumbs(&self, sheet: &[[u32; 3]]) -> Vec<[u32; 3]> {
        let (mut cut, whole) = parted(self, sheet);
        let mut root: Vec<u32> = (0..self.tets().len() as u32).collect();
        for (_, sides) in &whole {
            join(&mut root, *sides);
        }
        loop {
            let kept = self.one_round_of_crumbs(&mut root, &cut);
            if kept.len() == cut.len() {
                return cut.into_iter().map(|(facet, _)| facet).collect();
            }
            cut = kept;
        }
    }

    /// Joins every crumb to its nearest neighbour; what is left of the cut.
    fn one_round_of_crumbs(&self, root: &mut [u32], cut: &[Between]) -> Vec<Between> {
        let mut cells: BTreeMap<u32, usize> = BTreeMap::new();
        (0..root.len() as u32).for_each(|t| *cells.entry(root_of(root, t)).or_default() += 1);
        let crumb = |piece: u32| cells.get(&piece).is_some_and(|&n| n <= CRUMB && n * PART <= self.tets().len());
        let mut shared: BTreeMap<[u32; 2], f64> = BTreeMap::new();
        for (facet, sides) in cut {
            let [a, b] = sides.map(|t| root_of(root, t));
            let area = self.area_vector_mm2(*facet).norm();
            for pair in [[a, b], [b, a]].into_iter().filter(|[own, other]| own != other && crumb(*own)) {
                *shared.entry(pair).or_default() += area;
            }
        }
        // The first of equals, so that the answer does not depend on an order.
        let mut nearest: BTreeMap<u32, (u32, f64)> = BTreeMap::new();
        for ([own, other], area) in shared {
            let best = nearest.entry(own).or_insert((other, area));
            if area > best.1 {
                *best = (other, area);
            }
        }
        let before: Vec<[u32; 2]> = cut.iter().map(|(_, sides)| sides.map(|t| root_of(root, t))).collect();
        let joined =
            |[a, b]: [u32; 2]| [(a, b), (b, a)].iter().any(|(own, to)| nearest.get(own).is_some_and(|n| n.0 == *to));
        for (own, (other, _)) in &nearest {
            join(root, [*own, *other]);
        }
        cut.iter().zip(before).filter(|(_, pair)| !joined(*pair)).map(|(facet, _)| *facet).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block of so many cubes of six tetrahedra each.
    fn block(n: usize) -> TetMesh {
        let node = |i: usize, j: usize, k: usize| (i + (n + 1) * (j + (n + 1) * k)) as u32;
        let side = n + 1;
        let nodes = (0..side.pow(3)).map(|m| [m % side, m / side % side, m / side / side].map(|x| x as f64)).collect();
        let mut tets = Vec::new();
        for cell in 0..n.pow(3) {
            let (i, j, k) = (cell % n, cell / n % n, cell / n / n);
            let corner = |b: usize| node(i + (b & 1), j + (b >> 1 & 1), k + (b >> 2));
            for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
                tets.push([corner(0), corner(a), corner(b), corner(7)]);
            }
        }
        let labels = vec![2; tets.len()];
        TetMesh::new(nodes, tets, labels).unwrap()
    }

    fn pieces(mesh: &TetMesh, sheet: &[[u32; 3]]) -> usize {
        let mut pieces = mesh.pieces_beside(sheet);
        pieces.sort_unstable();
        pieces.dedup();
        pieces.len()
    }

    #[test]
    fn a_sheet_that_is_folded_about_a_cell_is_cut_on_one_side_of_it() {
        let mesh = block(6);
        let at = |x: f64| {
            let on = |f: &[u32; 3]| f.iter().all(|&n| (mesh.nodes_mm()[n as usize][0] - x).abs() < 1e-9);
            mesh.facets().into_iter().filter(|f| f.2.is_some() && on(&f.0)).map(|f| f.0).collect::<Vec<_>>()
        };
        let plane = at(3.0);
        assert_eq!(pieces(&mesh, &plane), 2);
        assert_eq!(mesh.without_crumbs(&plane), plane, "a clean sheet stays as it is");
        // All four facets of a tetrahedron at the plane belong to the sheet.
        let beside = mesh.facets().into_iter().find(|f| f.0 == plane[40]).unwrap();
        let cell = beside.1 as u32;
        let own =
            mesh.facets().into_iter().filter(|f| f.2.is_some() && (f.1 as u32 == cell || f.2 == Some(cell as usize)));
        let folded: Vec<[u32; 3]> = plane.iter().copied().chain(own.map(|f| f.0)).collect();
        assert_eq!(pieces(&mesh, &folded), 3);
        let mended = mesh.without_crumbs(&folded);
        assert_eq!(pieces(&mesh, &mended), 2);
        assert_eq!(mended, mesh.without_crumbs(&mended));
        assert_eq!(mesh.cut_along("sheet", &mended).pieces_beside(&[]), mesh.pieces_beside(&mended));
    }
}
