//! The smooth continuation of values through a region where nothing is known.

use crate::image::pieces::each_piece;
use rayon::prelude::*;

/// What is known at a voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The value stands.
    Known,
    /// The value is to be found.
    Free,
}

/// Sweeps on every level; on the coarsest, where they cost nothing, many more. The continuation need be smooth, not
/// exact.
const SWEEPS: usize = 24;
const COARSEST_SWEEPS: usize = 200;
/// A level is not halved below this many voxels along an axis.
const SMALLEST: usize = 6;
/// Voxels that one thread does alone, and those of a chunk of memory.
const FEW: usize = 1 << 14;
/// Every neighbour lies on the grid.
const ALL: u8 = 63;
/// Over-relaxation of a sweep.
const OVER: f32 = 1.9;

/// The values with those at free places replaced by a solution of Laplace's equation between the known ones (which
/// stay as they are). Beyond the grid nothing flows. `spacing_mm` weighs the directions.
///
/// Solved from coarse to fine (cascadic multigrid: Bornemann and Deuflhard, Numerische Mathematik 75, 1996) by red-black
/// sweeps, in a fixed order: the bytes do not depend on the number of threads.
pub fn continued<const N: usize>(
    dims: [usize; 3],
    spacing_mm: [f64; 3],
    place: &[Place],
    mut values: Vec<[f32; N]>,
) -> Vec<[f32; N]> {
    let free = place.par_iter().filter(|p| **p == Place::Free).count();
    if free == 0 || free == place.len() {
        return values;
    }
    let coarse_dims = dims.map(|n| n.div_ceil(2));
    let coarsest = dims.iter().any(|&n| n < 2 * SMALLEST);
    if !coarsest {
        let (coarse_place, coarse_values) = halved(dims, coarse_dims, place, &values);
        let coarse = continued(coarse_dims, spacing_mm.map(|h| 2.0 * h), &coarse_place, coarse_values);
        fill(dims, coarse_dims, place, &coarse, &mut values);
    }
    let lattice = Lattice::new(dims, spacing_mm);
    let colours = lattice.colours(place);
    let mut renewed = Vec::new();
    let sweeps = if coarsest { COARSEST_SWEEPS } else { SWEEPS };
    for sweep in 0..sweeps {
        // The last sweeps without over-relaxation leave no ripples.
        let over = if sweep + 4 < sweeps { OVER } else { 1.0 };
        for colour in &colours {
            lattice.relax(colour, over, &mut values, &mut renewed);
        }
    }
    values
}

/// A grid's neighbours and what each of them weighs.
struct Lattice {
    dims: [usize; 3],
    stride: [usize; 3],
    weight: [f32; 3],
    /// One over the weights together, by which neighbours there are.
    share: [f32; 64],
}

/// Free voxels no two of which are neighbours, in the order of memory.
#[derive(Default)]
struct Colour {
    voxels: Vec<u32>,
    /// Which of the six neighbours lie on the grid, a bit each: below and above along each axis.
    neighbours: Vec<u8>,
    /// Where the voxels of each chunk of memory begin.
    begins: Vec<usize>,
}

impl Lattice {
    fn new(dims: [usize; 3], spacing_mm: [f64; 3]) -> Self {
        let weight = spacing_mm.map(|h| (1.0 / (h * h)) as f32);
        let of = |neighbours: usize| -> f32 {
            let total: f32 = (0..6).filter(|bit| neighbours >> bit & 1 == 1).map(|bit| weight[bit / 2]).sum();
            1.0 / total
        };
        Self { dims, stride: [1, dims[0], dims[0] * dims[1]], weight, share: std::array::from_fn(of) }
    }

    fn colours(&self, place: &[Place]) -> [Colour; 2] {
        let of_plane = |(k, place): (usize, &[Place])| {
            let mut colours = [Colour::default(), Colour::default()];
            for (n, _) in place.iter().enumerate().filter(|(_, p)| **p == Place::Free) {
                let v = [n % self.dims[0], n / self.dims[0], k];
                let bits = |a: usize| u8::from(v[a] > 0) | u8::from(v[a] + 1 < self.dims[a]) << 1;
                let colour = &mut colours[(v[0] + v[1] + v[2]) % 2];
                colour.voxels.push((k * self.stride[2] + n) as u32);
                colour.neighbours.push(bits(0) | bits(1) << 2 | bits(2) << 4);
            }
            colours
        };
        let planes: Vec<[Colour; 2]> = place.par_chunks(self.stride[2]).enumerate().map(of_plane).collect();
        let mut colours = [Colour::default(), Colour::default()];
        for (n, colour) in colours.iter_mut().enumerate() {
            for plane in &planes {
                colour.voxels.extend_from_slice(&plane[n].voxels);
                colour.neighbours.extend_from_slice(&plane[n].neighbours);
            }
            let before = |first: usize| colour.voxels.partition_point(|&n| (n as usize) < first);
            colour.begins = (0..=place.len().div_ceil(FEW)).map(|chunk| before(chunk * FEW)).collect();
        }
        colours
    }

    /// One sweep over a colour; `renewed` is its memory.
    fn relax<const N: usize>(&self, colour: &Colour, over: f32, values: &mut [[f32; N]], renewed: &mut Vec<[f32; N]>) {
        let renew = |(&n, &neighbours): (&u32, &u8)| -> [f32; N] {
            let (n, share) = (n as usize, over * self.share[usize::from(neighbours)]);
            let mut sum = [0f32; N];
            if neighbours == ALL {
                // Nearly all voxels: without a question for each neighbour.
                for a in 0..3 {
                    let (low, high) = (&values[n - self.stride[a]], &values[n + self.stride[a]]);
                    for c in 0..N {
                        sum[c] += self.weight[a] * (low[c] + high[c]);
                    }
                }
                return std::array::from_fn(|c| values[n][c] * (1.0 - over) + share * sum[c]);
            }
            for a in 0..3 {
                let mut add = |m: usize| {
                    for (s, x) in sum.iter_mut().zip(&values[m]) {
                        *s += self.weight[a] * x;
                    }
                };
                if neighbours >> (2 * a) & 1 == 1 {
                    add(n - self.stride[a]);
                }
                if neighbours >> (2 * a) & 2 == 2 {
                    add(n + self.stride[a]);
                }
            }
            std::array::from_fn(|c| values[n][c] * (1.0 - over) + share * sum[c])
        };
        // Few are done before other threads have woken.
        if colour.voxels.len() < FEW {
            renewed.clear();
            renewed.extend(colour.voxels.iter().zip(&colour.neighbours).map(renew));
            for (&n, value) in colour.voxels.iter().zip(renewed.iter()) {
                values[n as usize] = *value;
            }
            return;
        }
        colour.voxels.par_iter().zip(&colour.neighbours).map(renew).collect_into_vec(renewed);
        each_piece(values, FEW, &|first, values| {
            let chunk = first / FEW;
            let those = colour.begins[chunk]..colour.begins[chunk + 1];
            for (&n, value) in colour.voxels[those.clone()].iter().zip(&renewed[those]) {
                values[n as usize - first] = *value;
            }
        });
    }
}

/// The grid of half as many voxels: known where a known voxel lies within, with the mean of those.
fn halved<const N: usize>(
    dims: [usize; 3],
    coarse: [usize; 3],
    place: &[Place],
    values: &[[f32; N]],
) -> (Vec<Place>, Vec<[f32; N]>) {
    let mut sums = vec![([0f32; N], 0u32); coarse.iter().product()];
    let plane = dims[0] * dims[1];
    each_piece(&mut sums, coarse[0] * coarse[1], &|first, sums| {
        let k = first / (coarse[0] * coarse[1]);
        for n in 2 * k * plane..place.len().min((2 * k + 2) * plane) {
            if place[n] == Place::Known {
                let (sum, count) = &mut sums[n % dims[0] / 2 + coarse[0] * (n / dims[0] % dims[1] / 2)];
                sum.iter_mut().zip(&values[n]).for_each(|(s, x)| *s += x);
                *count += 1;
            }
        }
    });
    let mean = |(sum, count): &([f32; N], u32)| sum.map(|s| s / (*count).max(1) as f32);
    let known = |(_, count): &([f32; N], u32)| if *count > 0 { Place::Known } else { Place::Free };
    (sums.par_iter().map(known).collect(), sums.par_iter().map(mean).collect())
}

/// Free voxels from the coarse grid, linearly between its centres.
fn fill<const N: usize>(
    dims: [usize; 3],
    coarse: [usize; 3],
    place: &[Place],
    found: &[[f32; N]],
    values: &mut [[f32; N]],
) {
    let [nx, ny, _] = dims;
    each_piece(values, nx * ny, &|first, plane| {
        let k = first / (nx * ny);
        for (n, value) in plane.iter_mut().enumerate().filter(|(n, _)| place[k * nx * ny + n] == Place::Free) {
            let mut low = [0; 3];
            let mut part = [0f32; 3];
            for (a, x) in [n % nx, n / nx, k].into_iter().enumerate() {
                // The coarse centre lies between its two voxels.
                let at = (0.5 * (x as f32 - 0.5)).clamp(0.0, (coarse[a] - 1) as f32);
                low[a] = (at as usize).min(coarse[a].saturating_sub(2));
                part[a] = at - low[a] as f32;
            }
            *value = [0f32; N];
            for corner in 0..8 {
                let up = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
                let w: f32 = (0..3).map(|a| if up[a] == 1 { part[a] } else { 1.0 - part[a] }).product();
                let at = [0, 1, 2].map(|a| (low[a] + up[a]).min(coarse[a] - 1));
                let there = &found[at[0] + coarse[0] * (at[1] + coarse[1] * at[2])];
                for (v, x) in value.iter_mut().zip(there) {
                    *v += w * x;
                }
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Between two plates the solution is linear; nothing exceeds what is known; known values stay.
    #[test]
    fn between_two_plates_the_continuation_is_linear() {
        let dims = [41, 14, 12];
        let known = |n: usize| [0, 40].contains(&(n % dims[0]));
        let count: usize = dims.iter().product();
        let place: Vec<Place> = (0..count).map(|n| if known(n) { Place::Known } else { Place::Free }).collect();
        let values: Vec<[f32; 2]> =
            (0..count).map(|n| if n % dims[0] == 40 { [4.0, -8.0] } else { [0.0; 2] }).collect();
        let found = continued(dims, [1.0, 1.0, 2.0], &place, values.clone());
        for (n, value) in found.iter().enumerate() {
            let x = (n % dims[0]) as f32;
            assert!((value[0] - 0.1 * x).abs() < 0.03 && (value[1] + 0.2 * x).abs() < 0.06, "{x} {value:?}");
            if known(n) {
                assert_eq!(*value, values[n]);
            }
        }
    }

    #[test]
    fn nothing_to_find_and_nothing_known_are_left_alone() {
        let values = vec![[1.0f32]; 8];
        assert_eq!(continued([2; 3], [1.0; 3], &[Place::Free; 8], values.clone()), values);
        assert_eq!(continued([2; 3], [1.0; 3], &[Place::Known; 8], values.clone()), values);
    }
}
