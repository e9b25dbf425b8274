//! A balanced octree and the tets that fill it: a body-centred lattice that is finer in some places than in others.
//!
//! Each leaf has a vertex at its centre. Where leaves of one size meet, the tets are those of the body-centred cubic lattice
//! (60 and 90 degrees), cut in two where an edge of the shared square has a vertex in its middle; where sizes meet, the
//! smaller squares are cut by the diagonal that ends in the middle of the larger one (Labelle and Shewchuk, "Isosurface
//! stuffing", 2007: bisected tets and half pyramids). No dihedral angle is below 45 degrees.

/// Leaves over a box of finest cells.
#[derive(Clone, Debug)]
pub(super) struct Octree {
    /// Finest cells along x, y, z.
    cells: [usize; 3],
    /// For every finest cell, x fastest, the level of its leaf: an edge of 2^level finest cells.
    level: Vec<u8>,
}

/// A leaf: its lowest finest cell and its level.
type Leaf = ([usize; 3], u8);

/// A place in halves of a finest cell.
type Place = [u32; 3];

impl Octree {
    /// The coarsest tree of leaves up to level `top` that `whole` says need no dividing, but for what it takes that neighbours
    /// across faces and edges differ by one level at most. `cells` are multiples of 2^top.
    pub fn new(cells: [usize; 3], top: u8, whole: impl Fn([usize; 3], u8) -> bool) -> Self {
        let mut tree = Self { cells, level: vec![top; cells.iter().product()] };
        let mut open: Vec<Leaf> = tree.leaves().collect();
        while let Some((low, level)) = open.pop() {
            if level > 0 && !whole(low, level) {
                open.extend(tree.divide((low, level)));
            }
        }
        loop {
            let steep: Vec<Leaf> = tree.leaves().filter(|leaf| tree.is_steep(*leaf)).collect();
            if steep.is_empty() {
                return tree;
            }
            for leaf in steep {
                tree.divide(leaf);
            }
        }
    }

    fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.cells[0] * (j + self.cells[1] * k)
    }

    /// Leaves in the order of their lowest cells, x fastest.
    fn leaves(&self) -> impl Iterator<Item = Leaf> + '_ {
        let [nx, ny, _] = self.cells;
        (0..self.level.len()).filter_map(move |n| {
            let (low, level) = ([n % nx, n / nx % ny, n / (nx * ny)], self.level[n]);
            low.iter().all(|x| x & ((1 << level) - 1) == 0).then_some((low, level))
        })
    }

    /// Makes eight leaves of one.
    fn divide(&mut self, (low, level): Leaf) -> [Leaf; 8] {
        let size = 1 << level;
        for k in low[2]..low[2] + size {
            for j in low[1]..low[1] + size {
                let row = self.index([low[0], j, k]);
                self.level[row..row + size].fill(level - 1);
            }
        }
        std::array::from_fn(|child| (std::array::from_fn(|a| low[a] + ((child >> a & 1) << (level - 1))), level - 1))
    }

    /// Whether a leaf `level` high has a leaf more than `by` levels smaller at any of its finest cells `from..=to`.
    fn is_finer(&self, from: [isize; 3], to: [isize; 3], than: u8) -> bool {
        let clip = |x: isize, a: usize| x.clamp(0, self.cells[a] as isize - 1) as usize;
        if (0..3).any(|a| to[a] < 0 || from[a] >= self.cells[a] as isize) {
            return false;
        }
        (clip(from[2], 2)..=clip(to[2], 2)).any(|k| {
            (clip(from[1], 1)..=clip(to[1], 1)).any(|j| {
                let row = self.index([0, j, k]);
                self.level[row + clip(from[0], 0)..=row + clip(to[0], 0)].iter().any(|&l| l < than)
            })
        })
    }

    /// Whether a neighbour across a face or an edge is more than one level smaller.
    fn is_steep(&self, (low, level): Leaf) -> bool {
        if level < 2 {
            return false;
        }
        let (from, to) = (low.map(|x| x as isize), low.map(|x| (x + (1 << level)) as isize - 1));
        // All around but the corners: three slabs, each wider by one cell along two axes.
        (0..3).any(|a| {
            let (mut from, mut to) = (from.map(|x| x - 1), to.map(|x| x + 1));
            (from[a], to[a]) = (from[a] + 1, to[a] - 1);
            self.is_finer(from, to, level - 1)
        })
    }

    /// The tets between the centres of the leaves, right-handed; the outermost leaves are filled on their inner sides only.
    /// Places in units of a finest cell's edge.
    pub fn tets(&self) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
        let mut tets: Vec<[Place; 4]> = Vec::new();
        for leaf in self.leaves() {
            for axis in 0..3 {
                self.fill(leaf, axis, &mut tets);
            }
        }
        let key = |p: &Place| (u64::from(p[2]) << 42) | (u64::from(p[1]) << 21) | u64::from(p[0]);
        let mut keys: Vec<u64> = tets.iter().flatten().map(key).collect();
        keys.sort_unstable();
        keys.dedup();
        let number = |p: &Place| keys.binary_search(&key(p)).unwrap_or(0) as u32;
        let numbered =
            tets.iter().map(|tet| if is_right_handed(tet) { *tet } else { [tet[0], tet[1], tet[3], tet[2]] });
        let numbered = numbered.map(|tet| tet.each_ref().map(number)).collect();
        let place = |key: &u64| [0, 21, 42].map(|shift| 0.5 * (key >> shift & 0x1f_ffff) as f64);
        (keys.iter().map(place).collect(), numbered)
    }

    /// The tets across the upper face of a leaf along an axis.
    fn fill(&self, (low, level): Leaf, axis: usize, tets: &mut Vec<[Place; 4]>) {
        let size = 1usize << level;
        let mut next = low;
        next[axis] += size;
        if next[axis] == self.cells[axis] {
            return;
        }
        let other = self.level[self.index(next)];
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        // The square between the two centres, its edges in turn at the lower v, upper u, upper v and lower u.
        let square = |low: [usize; 3], size: usize| {
            [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[du, dv]| {
                let mut corner = low;
                corner[u] += du * size;
                corner[v] += dv * size;
                corner.map(|x| 2 * x as u32)
            })
        };
        match other.cmp(&level) {
            std::cmp::Ordering::Equal => {
                let (a, b, square) = (centre(low, size), centre(next, size), square(next, size));
                for n in 0..4 {
                    let (p, q) = (square[n], square[(n + 1) % 4]);
                    // The leaves beyond the edge: on one side of the pair, along the whole edge.
                    let (mut from, mut to) = (next.map(|x| x as isize), next.map(|x| (x + size) as isize - 1));
                    (from[axis], to[axis]) = (next[axis] as isize - 1, next[axis] as isize);
                    let (across, up) = ([v, u, v, u][n], n == 1 || n == 2);
                    from[across] += if up { size as isize } else { -1 };
                    to[across] = from[across];
                    if self.is_finer(from, to, level) {
                        let middle = std::array::from_fn(|a| u32::midpoint(p[a], q[a]));
                        tets.extend([[a, b, p, middle], [a, b, middle, q]]);
                    } else {
                        tets.push([a, b, p, q]);
                    }
                }
            }
            std::cmp::Ordering::Greater => {
                let large = next.map(|x| x & !(2 * size - 1));
                half_pyramids(square(next, size), [centre(low, size), centre(large, 2 * size)], tets);
            }
            std::cmp::Ordering::Less => {
                let half = size / 2;
                for [du, dv] in [[0, 0], [half, 0], [half, half], [0, half]] {
                    let mut small = next;
                    small[u] += du;
                    small[v] += dv;
                    half_pyramids(square(small, half), [centre(low, size), centre(small, half)], tets);
                }
            }
        }
    }
}

fn centre(low: [usize; 3], size: usize) -> Place {
    low.map(|x| (2 * x + size) as u32)
}

/// The two triangles of a smaller leaf's square with either centre; the diagonal ends in the middle of the larger leaf's face,
/// which lies right in front of its centre.
fn half_pyramids(square: [Place; 4], centres: [Place; 2], tets: &mut Vec<[Place; 4]>) {
    let apart = |corner: &Place, centre: &Place| (0..3).filter(|&a| corner[a] != centre[a]).count();
    let middle = (0..4).find(|&n| centres.iter().any(|c| apart(&square[n], c) == 1)).unwrap_or(0);
    let at = |n: usize| square[(middle + n) % 4];
    for apex in centres {
        tets.extend([[apex, at(0), at(1), at(2)], [apex, at(0), at(2), at(3)]]);
    }
}

fn is_right_handed([a, b, c, d]: &[Place; 4]) -> bool {
    let from_a =
        |p: &Place| nalgebra::Vector3::from(std::array::from_fn::<i64, 3, _>(|n| i64::from(p[n]) - i64::from(a[n])));
    from_a(b).cross(&from_a(c)).dot(&from_a(d)) > 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::optimise::{Point, min_sine};
    use std::collections::BTreeMap;

    /// Finest around a point off the middle and along a bent line, coarse elsewhere.
    fn tree() -> Octree {
        let near = |low: [usize; 3], size: usize| {
            let holds = |p: [usize; 3]| (0..3).all(|a| (low[a]..low[a] + size).contains(&p[a]));
            holds([9, 10, 5]) || (0..24).any(|n| holds([n, 16 + n / 4, 12 + n % 3]))
        };
        Octree::new([24, 32, 24], 3, |low, level| !near(low, 1 << level))
    }

    #[test]
    fn neighbours_across_faces_and_edges_differ_by_one_level_at_most() {
        let tree = tree();
        for level in 0..=3 {
            assert!(tree.leaves().any(|leaf| leaf.1 == level), "a tree of all levels");
        }
        let [nx, ny, nz] = tree.cells;
        let at = |i: usize, j: usize, k: usize| i32::from(tree.level[tree.index([i, j, k])]);
        for (i, j, k) in (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| (i, j, k)))) {
            for [di, dj, dk] in [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1]] {
                if i + di < nx && j + dj < ny && k + dk < nz {
                    assert!((at(i, j, k) - at(i + di, j + dj, k + dk)).abs() <= 1, "({i}, {j}, {k})");
                }
            }
        }
    }

    #[test]
    fn tets_share_faces_two_by_two_and_fill_all_but_the_rim() {
        let tree = tree();
        let (x, tets) = tree.tets();
        let mut faces: BTreeMap<[u32; 3], i32> = BTreeMap::new();
        let mut volume = 0.0;
        for tet in &tets {
            let [a, b, c, d] = tet.map(|v| Point::from(x[v as usize]));
            let six_v = (b - a).cross(&(c - a)).dot(&(d - a));
            assert!(six_v > 0.0);
            volume += six_v / 6.0;
            for corner in 0..4 {
                let mut face: [u32; 3] = std::array::from_fn(|n| tet[(corner + 1 + n) % 4]);
                face.sort_unstable();
                *faces.entry(face).or_default() += 1;
            }
        }
        // A face with one tet is a side of the pyramid that an outermost leaf lacks: it holds the leaf's centre.
        let sizes: BTreeMap<[u64; 3], f64> = tree
            .leaves()
            .map(|(low, level)| (centre(low, 1 << level).map(u64::from), f64::from(1u32 << level)))
            .collect();
        let centres = |v: u32| sizes.get(&x[v as usize].map(|c| (2.0 * c) as u64));
        for (face, count) in &faces {
            assert!(*count <= 2, "{face:?}");
            let at_rim = |v: &u32| (0..3).any(|a| [0.0, tree.cells[a] as f64].contains(&x[*v as usize][a]));
            assert!(
                *count == 2
                    || (face.iter().any(|v| centres(*v).is_some()) && face.iter().filter(|v| at_rim(v)).count() == 2)
            );
        }
        let mut missing = 0.0;
        for (low, level) in tree.leaves() {
            let size = 1 << level;
            let sides =
                (0..3).map(|a| usize::from(low[a] == 0) + usize::from(low[a] + size == tree.cells[a])).sum::<usize>();
            missing += sides as f64 * (size as f64).powi(3) / 6.0;
        }
        let whole: f64 = tree.cells.iter().product::<usize>() as f64;
        assert!((volume + missing - whole).abs() < 1e-6 * whole, "{volume} and {missing} of {whole}");
    }

    #[test]
    fn no_dihedral_angle_is_below_45_degrees() {
        let (x, tets) = tree().tets();
        let sine = |tet: &[u32; 4]| {
            let [a, b, c, d] = tet.map(|v| Point::from(x[v as usize]));
            min_sine(&a, &b, &c, &d)
        };
        let worst = tets.iter().map(sine).fold(f64::MAX, f64::min);
        assert!((worst - 0.5f64.sqrt()).abs() < 1e-9, "{worst}");
    }
}
