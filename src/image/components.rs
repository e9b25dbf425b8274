//! Connected components of masks and filling of holes.

use super::volume::{Mask, Volume};
use crate::geometry::Frame;

/// Which neighbours a voxel touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Connectivity {
    /// The 6 neighbours that share a face.
    Faces,
    /// The 26 neighbours that share a face, an edge or a corner.
    Corners,
}

/// The connected components of a mask.
#[derive(Clone, Debug, PartialEq)]
pub struct Components<F: Frame> {
    /// 0 outside the mask, else 1, 2, ... in the order in which the components begin in memory.
    pub labels: Volume<u32, F>,
    /// Number of voxels of each component; `voxels[n - 1]` belongs to label n.
    pub voxels: Vec<usize>,
}

impl<F: Frame> Components<F> {
    /// The label with the most voxels (the first of equals), or `None` for an empty mask.
    pub fn largest(&self) -> Option<u32> {
        let best = self.voxels.iter().enumerate().max_by_key(|&(n, &count)| (count, std::cmp::Reverse(n)))?.0;
        Some(best as u32 + 1)
    }

    /// The mask of one component.
    pub fn mask(&self, label: u32) -> Mask<F> {
        self.labels.map(|l| l == label)
    }

    /// The mask of the components that a rule on (label, number of voxels) keeps.
    pub fn kept(&self, keep: impl Fn(u32, usize) -> bool) -> Mask<F> {
        let kept: Vec<bool> = self.voxels.iter().enumerate().map(|(n, &count)| keep(n as u32 + 1, count)).collect();
        self.labels.map(|l| l > 0 && kept[l as usize - 1])
    }
}

/// Voxels `first..end` of one row, all inside.
struct Run {
    first: u32,
    end: u32,
}

/// Finds the connected components of a mask, by uniting runs of neighbouring rows.
#[must_use]
pub fn components<F: Frame>(mask: &Mask<F>, connectivity: Connectivity) -> Components<F> {
    let [nx, ny, nz] = mask.grid.dims;
    let mut runs: Vec<Run> = Vec::new();
    let mut row_start = Vec::with_capacity(ny * nz + 1);
    for row in mask.data.chunks_exact(nx.max(1)) {
        row_start.push(runs.len());
        let mut i = 0;
        while let Some(step) = row[i..].iter().position(|&inside| inside) {
            let first = i + step;
            i = row[first..].iter().position(|&inside| !inside).map_or(nx, |length| first + length);
            runs.push(Run { first: first as u32, end: i as u32 });
        }
    }
    row_start.push(runs.len());

    let mut parent: Vec<u32> = (0..runs.len() as u32).collect();
    // Rows that come earlier in memory and touch row (j, k), as steps in (j, k).
    let (earlier, reach): (&[[isize; 2]], u32) = match connectivity {
        Connectivity::Faces => (&[[-1, 0], [0, -1]], 0),
        Connectivity::Corners => (&[[-1, 0], [-1, -1], [0, -1], [1, -1]], 1),
    };
    for k in 0..nz {
        for j in 0..ny {
            let here = row_start[k * ny + j]..row_start[k * ny + j + 1];
            for &[dj, dk] in earlier {
                let (Some(j), Some(k)) = (j.checked_add_signed(dj), k.checked_add_signed(dk)) else { continue };
                if j >= ny {
                    continue;
                }
                let (mut a, mut b) = (here.start, row_start[k * ny + j]);
                let b_end = row_start[k * ny + j + 1];
                while a < here.end && b < b_end {
                    if runs[a].first < runs[b].end + reach && runs[b].first < runs[a].end + reach {
                        unite(&mut parent, a as u32, b as u32);
                    }
                    // A diagonal neighbour may touch the next run too, so the one that ends first moves on.
                    if runs[a].end < runs[b].end {
                        a += 1;
                    } else {
                        b += 1;
                    }
                }
            }
        }
    }

    let mut label_of_root = vec![0u32; runs.len()];
    let mut voxels = Vec::new();
    let mut labels = vec![0u32; mask.data.len()];
    for row in 0..ny * nz {
        for n in row_start[row]..row_start[row + 1] {
            // The root is the earliest run of its component, so labels follow the order in memory.
            let root = find(&mut parent, n as u32) as usize;
            if label_of_root[root] == 0 {
                voxels.push(0);
                label_of_root[root] = voxels.len() as u32;
            }
            let (label, run) = (label_of_root[root], &runs[n]);
            voxels[label as usize - 1] += (run.end - run.first) as usize;
            labels[row * nx..][run.first as usize..run.end as usize].fill(label);
        }
    }
    Components { labels: Volume::from_data(mask.grid, labels), voxels }
}

fn find(parent: &mut [u32], mut n: u32) -> u32 {
    while parent[n as usize] != n {
        let up = parent[parent[n as usize] as usize];
        parent[n as usize] = up;
        n = up;
    }
    n
}

fn unite(parent: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(parent, a), find(parent, b));
    let (low, high) = (a.min(b), a.max(b));
    parent[high as usize] = low;
}

/// The largest component of a mask (empty for an empty mask).
#[must_use]
pub fn largest_component<F: Frame>(mask: &Mask<F>, connectivity: Connectivity) -> Mask<F> {
    let found = components(mask, connectivity);
    found.largest().map_or_else(|| mask.clone(), |label| found.mask(label))
}

/// The mask without components of fewer than `voxels` voxels.
#[must_use]
pub fn without_islands<F: Frame>(mask: &Mask<F>, connectivity: Connectivity, voxels: usize) -> Mask<F> {
    components(mask, connectivity).kept(|_, count| count >= voxels)
}

/// The mask with every outside region filled that no path over faces links to the border of the grid.
#[must_use]
pub fn fill_holes<F: Frame>(mask: &Mask<F>) -> Mask<F> {
    let [nx, ny, nz] = mask.grid.dims;
    let outside = components(&mask.map(|inside| !inside), Connectivity::Faces);
    let mut open = vec![false; outside.voxels.len() + 1];
    for (row, labels) in outside.labels.data.chunks_exact(nx.max(1)).enumerate() {
        let (j, k) = (row % ny, row / ny);
        if j == 0 || k == 0 || j + 1 == ny || k + 1 == nz {
            for &label in labels {
                open[label as usize] = true;
            }
        } else {
            open[labels[0] as usize] = true;
            open[labels[nx - 1] as usize] = true;
        }
    }
    // Label 0 is the mask itself.
    open[0] = false;
    outside.labels.map(|l| !open[l as usize])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use crate::image::Grid;
    use proptest::prelude::*;

    const DIMS: [usize; 3] = [7, 6, 5];

    fn flood(mask: &Mask<Pre>, connectivity: Connectivity) -> Vec<u32> {
        let mut labels = vec![0; mask.data.len()];
        let mut next = 0;
        for seed in 0..mask.data.len() {
            if !mask.data[seed] || labels[seed] != 0 {
                continue;
            }
            next += 1;
            labels[seed] = next;
            let mut stack = vec![seed];
            while let Some(n) = stack.pop() {
                let v = mask.grid.voxel(n).map(|x| x as isize);
                for m in 0..27isize {
                    let d = [m % 3 - 1, m / 3 % 3 - 1, m / 9 - 1];
                    let steps: isize = d.iter().map(|x| x.abs()).sum();
                    if steps == 0 || (connectivity == Connectivity::Faces && steps > 1) {
                        continue;
                    }
                    if mask.get(v[0] + d[0], v[1] + d[1], v[2] + d[2]) == Some(true) {
                        let to = [0, 1, 2].map(|a| (v[a] + d[a]) as usize);
                        let to = mask.grid.index(to[0], to[1], to[2]);
                        if labels[to] == 0 {
                            labels[to] = next;
                            stack.push(to);
                        }
                    }
                }
            }
        }
        labels
    }

    proptest! {
        #[test]
        fn components_are_those_of_a_flood(data in proptest::collection::vec(prop::bool::weighted(0.35), 7 * 6 * 5)) {
            let mask = Mask::from_data(Grid::<Pre>::axis_aligned(DIMS, [1.0; 3], [0.0; 3]), data);
            for connectivity in [Connectivity::Faces, Connectivity::Corners] {
                let found = components(&mask, connectivity);
                prop_assert_eq!(&found.labels.data, &flood(&mask, connectivity));
                prop_assert_eq!(found.voxels.iter().sum::<usize>(), mask.count());
            }
        }
    }

    #[test]
    fn a_shell_is_filled_and_an_open_bowl_is_not() {
        let grid = Grid::<Pre>::axis_aligned([5, 5, 5], [1.0; 3], [0.0; 3]);
        let centre = grid.index(2, 2, 2);
        let shell = Mask::from_data(
            grid,
            (0..grid.len()).map(|n| n != centre && grid.voxel(n).iter().all(|v| (1..4).contains(v))).collect(),
        );
        assert!(fill_holes(&shell).data[centre]);
        assert_eq!(fill_holes(&shell).count(), 27);
        let mut bowl = shell.clone();
        bowl.data[grid.index(2, 2, 3)] = false;
        assert_eq!(fill_holes(&bowl), bowl);
        let mut two = shell.clone();
        two.data[0] = true;
        assert_eq!(largest_component(&two, Connectivity::Faces), shell);
        assert_eq!(without_islands(&two, Connectivity::Faces, 2), shell);
        assert_eq!(components(&two, Connectivity::Corners).voxels, [27]);
    }
}
