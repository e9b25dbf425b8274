//! Before meshing: islands of a label map. After: outer surfaces that are manifold.

use super::optimise::Complex;
use crate::geometry::Frame;
use crate::image::LabelMap;
use crate::image::components::{Connectivity, components};
use serde::Serialize;
use std::collections::BTreeMap;

/// A part that was removed because it is too small; of several labels an island each.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Island {
    /// Its label in the map.
    pub label: u8,
    /// Its volume in mm3.
    pub volume_mm3: f64,
    /// The label it took: 0 when it lay apart from the rest.
    pub became: u8,
}

/// Removes parts of the labelled region below `smallest_part` of the largest one, and gives parts of a label below
/// `tet_mm3` the label that surrounds them most (never the last part of a label). In the order of first voxels,
/// and of labels within a part.
pub(crate) fn remove_islands<F: Frame>(map: &mut LabelMap<F>, smallest_part: f64, tet_mm3: f64) -> Vec<Island> {
    let voxel_mm3 = map.grid.voxel_volume_mm3();
    let mut islands = Vec::new();
    let whole = components(&map.map(|l| l != 0), Connectivity::Faces);
    let largest = whole.voxels.iter().copied().max().unwrap_or(0) as f64;
    let apart = |n: usize| (whole.voxels[n] as f64) < smallest_part * largest;
    // One pass for all of them: a speckled map has a hundred thousand. A part may hold several labels, of which each is told.
    let mut voxels_of: BTreeMap<(u32, u8), usize> = BTreeMap::new();
    for (value, &part) in map.data.iter_mut().zip(&whole.labels.data) {
        if part > 0 && apart(part as usize - 1) {
            *voxels_of.entry((part, std::mem::take(value))).or_default() += 1;
        }
    }
    for ((_, label), voxels) in voxels_of {
        islands.push(Island { label, volume_mm3: voxels as f64 * voxel_mm3, became: 0 });
    }
    let mut present = [false; 256];
    map.data.iter().for_each(|&l| present[l as usize] = true);
    for label in (1..=255u8).filter(|&l| present[l as usize]) {
        let parts = components(&map.map(|l| l == label), Connectivity::Faces);
        let keep = parts.largest();
        let small: Vec<bool> = parts
            .voxels
            .iter()
            .enumerate()
            .map(|(n, &voxels)| (voxels as f64) * voxel_mm3 < tet_mm3 && keep != Some(n as u32 + 1))
            .collect();
        if !small.contains(&true) {
            continue;
        }
        let mut around = vec![[0u32; 256]; small.len()];
        let [nx, ny, nz] = map.grid.dims;
        for (v, &part) in parts.labels.data.iter().enumerate() {
            if part == 0 || !small[part as usize - 1] {
                continue;
            }
            let c = [v % nx, v / nx % ny, v / (nx * ny)];
            for (stride, at, n) in [(1, c[0], nx), (nx, c[1], ny), (nx * ny, c[2], nz)] {
                let neighbours = [(at > 0).then(|| v - stride), (at + 1 < n).then(|| v + stride)];
                for other in neighbours.into_iter().flatten().map(|o| map.data[o]).filter(|&l| l != label) {
                    around[part as usize - 1][other as usize] += 1;
                }
            }
        }
        let became: Vec<u8> =
            around.iter().map(|votes| (0..=255u8).max_by_key(|&l| (votes[l as usize], 255 - l)).unwrap_or(0)).collect();
        for (value, &part) in map.data.iter_mut().zip(&parts.labels.data) {
            if part > 0 && small[part as usize - 1] {
                *value = became[part as usize - 1];
            }
        }
        for n in (0..small.len()).filter(|&n| small[n]) {
            islands.push(Island { label, volume_mm3: parts.voxels[n] as f64 * voxel_mm3, became: became[n] });
        }
    }
    islands
}

/// Takes out the fewest tets after which every edge of the outer surface has exactly two outer facets: at an edge where
/// several fans of tets meet, the smallest fans go.
pub(crate) fn separate(complex: &mut Complex) {
    // Each round takes out at least one tet, so this ends.
    loop {
        let mut edges: Vec<[u32; 2]> = complex
            .interface_facets()
            .iter()
            .filter(|f| f.above == 0)
            .flat_map(|f| {
                [[0, 1], [1, 2], [2, 0]].map(|[i, j]| [f.corners[i].min(f.corners[j]), f.corners[i].max(f.corners[j])])
            })
            .collect();
        edges.sort_unstable();
        let crowded: Vec<[u32; 2]> =
            edges.chunk_by(|a, b| a == b).filter(|same| same.len() > 2).map(|same| same[0]).collect();
        if crowded.is_empty() {
            return;
        }
        for [a, b] in crowded {
            let mut fans = fans(complex, a, b);
            if fans.len() < 2 {
                continue;
            }
            let volume = |fan: &Vec<u32>| fan.iter().map(|&t| six_volumes(complex, t)).sum::<f64>();
            fans.sort_by(|p, q| volume(p).total_cmp(&volume(q)).then(p.cmp(q)));
            fans.pop();
            fans.into_iter().flatten().for_each(|t| complex.vent(t));
        }
    }
}

/// Turns ears into air: tets that hang on by one facet and stick out of the body. A label's coarse tets leave them where
/// the outer surface cuts a thin wedge; they carry no load and look like thorns. The label's volume is matched later.
pub(crate) fn drop_ears(complex: &mut Complex) {
    loop {
        let lonely = |complex: &Complex, v: u32| {
            complex.star[v as usize].iter().filter(|&&t| complex.is_solid(t)).take(2).count() == 1
        };
        let ear = |t: &u32| complex.tets[*t as usize].iter().filter(|&&v| lonely(complex, v)).count() == 1;
        let ears: Vec<u32> = complex.solid().filter(ear).collect();
        if ears.is_empty() {
            return;
        }
        for t in ears {
            complex.vent(t);
        }
    }
}

fn six_volumes(complex: &Complex, t: u32) -> f64 {
    let [a, b, c, d] = complex.points(&complex.tets[t as usize]);
    (b - a).cross(&(c - a)).dot(&(d - a))
}

/// The tets around an edge, grouped by whether they share faces.
fn fans(complex: &Complex, a: u32, b: u32) -> Vec<Vec<u32>> {
    let mut rest: Vec<u32> = complex.sharing(&[a, b]).filter(|&t| complex.is_solid(t)).collect();
    rest.sort_unstable();
    let mut fans = Vec::new();
    while let Some(first) = rest.pop() {
        let mut fan = vec![first];
        let mut at = 0;
        while at < fan.len() {
            let tet = complex.tets[fan[at] as usize];
            let joined = |t: &u32| complex.tets[*t as usize].iter().filter(|v| tet.contains(v)).count() == 3;
            let (more, left): (Vec<u32>, Vec<u32>) = rest.iter().partition(|t| joined(t));
            fan.extend(more);
            rest = left;
            at += 1;
        }
        fan.sort_unstable();
        fans.push(fan);
    }
    fans
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;

    #[test]
    fn a_part_that_lay_apart_is_told_by_what_it_has_of_every_label() {
        // A row of white matter, and apart from it a short one of three labels whose last voxel is ventricle.
        let grid = Grid::<Mni>::axis_aligned([30, 1, 3], [1.0, 2.0, 1.0], [0.0; 3]);
        let before = LabelMap::from_fn(grid, |n| match n {
            0..30 | 62 => 3,
            60 | 61 => 2,
            63 => 4,
            _ => 0,
        });
        let mut map = before.clone();
        let islands = remove_islands(&mut map, 0.5, 0.0);
        let of = |label, volume_mm3| Island { label, volume_mm3, became: 0 };
        assert_eq!(islands, [of(2, 4.0), of(3, 2.0), of(4, 2.0)]);
        assert_eq!(map, LabelMap::from_fn(grid, |n| if n < 30 { 3 } else { 0 }));
    }
}
