//! How large the tets shall be, where.

use super::error::EngineError;
use crate::geometry::Native;
use crate::image::distance::signed_distance_mm;
use crate::image::{Grid, Mask};
use crate::mesh::label_field::LabelField;
use crate::mesh::optimise::Point;
use crate::segment::label;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// Where edges shall be other than the target. With [`super::MeshSize::Cells`] the target itself is what gives that many
/// tets. The lattice's cubes have these sizes to the nearest power of two; gmsh and TetGen follow inside a surface that does.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sizing {
    /// Inside labels.
    pub labels: Vec<LabelEdge>,
    /// Near the walls of labels: of the ventricle, of the resected tissue. Where two reach, the smaller factor counts.
    pub walls: Vec<WallEdge>,
}

/// Edges inside a label.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LabelEdge {
    /// The label.
    pub label: u8,
    /// Times the target edge: 0.25 to 4.
    pub factor: f64,
}

/// Edges on both sides of the wall of a label.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WallEdge {
    /// The label.
    pub label: u8,
    /// Times the edge that there would be: 0.25 to 1 at the wall, from there linear to 1.
    pub factor: f64,
    /// Distance in mm at which the wall counts no more.
    pub reach_mm: f64,
}

impl FromStr for LabelEdge {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let (label, factor) = text.split_once('=')?;
            Some(Self { label: label::number(label)?, factor: factor.parse().ok()? })
        };
        read().ok_or_else(|| format!("`{text}` is not LABEL=FACTOR, such as white_matter=1.5 or 3=1.5"))
    }
}

impl FromStr for WallEdge {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let (label, rest) = text.split_once('=')?;
            let (factor, reach) = rest.split_once('@')?;
            Some(Self { label: label::number(label)?, factor: factor.parse().ok()?, reach_mm: reach.parse().ok()? })
        };
        read().ok_or_else(|| format!("`{text}` is not LABEL=FACTOR@MM, such as ventricle=0.5@8 or 4=0.5@8"))
    }
}

/// Factors on edges lie between these.
const FACTORS: [f64; 2] = [0.25, 4.0];

impl Sizing {
    /// Whether every factor is in its range and every label is there.
    pub(super) fn check(&self, present: &[u8]) -> Result<(), EngineError> {
        let [least, most] = FACTORS;
        let labels = self.labels.iter().map(|l| ("label", l.label, l.factor, most, 1.0));
        let walls = self.walls.iter().map(|w| ("the wall of label", w.label, w.factor, 1.0, w.reach_mm));
        for (place, label, factor, most, reach_mm) in labels.chain(walls) {
            if !present.contains(&label) {
                return Err(EngineError::NoSuchLabel { label, present: present.to_vec() });
            }
            // Written so that NaN is refused.
            if !(factor >= least && factor <= most) {
                return Err(EngineError::Factor { place, label, factor, least, most });
            }
            if !(reach_mm > 0.0 && reach_mm.is_finite()) {
                let name = "sizing.walls.reach_mm";
                return Err(EngineError::Setting { name, value: reach_mm, rule: "above 0" });
            }
        }
        Ok(())
    }
}

/// Edges may grow by this much per mm of distance from smaller ones.
const GROWTH: f64 = 0.3;
/// Distance of the samples of factors, mm.
const SAMPLES_MM: f64 = 2.0;

/// [`Sizing`] over the box of a `LabelField`, as factors on the target edge.
#[derive(Clone, Debug)]
pub(crate) struct EdgeFactors {
    dims: [usize; 3],
    spacing_mm: [f64; 3],
    factor: Vec<f32>,
}

impl EdgeFactors {
    pub fn new(field: &LabelField, sizing: &Sizing) -> Self {
        if *sizing == Sizing::default() {
            return Self { dims: [1; 3], spacing_mm: [1.0; 3], factor: vec![1.0] };
        }
        let (dims, voxel_mm) = (field.dims(), field.spacing_mm());
        let label: Vec<u8> = field.largest().iter().map(|&k| field.labels()[k as usize]).collect();
        let mut inside = [1.0f32; 256];
        sizing.labels.iter().for_each(|l| inside[l.label as usize] = l.factor as f32);
        // What lies outside asks for nothing, so it must not hold down a coarse label's edges at the surface.
        inside[0] = inside.iter().copied().fold(1.0, f32::max);
        let mut factor = vec![1.0f32; label.len()];
        for wall in &sizing.walls {
            let grid = Grid::<Native>::axis_aligned(dims, voxel_mm, [0.0; 3]);
            let mask = Mask::from_data(grid, label.iter().map(|&l| l == wall.label).collect());
            for (factor, distance) in factor.iter_mut().zip(signed_distance_mm(&mask).data) {
                let share = (distance.abs() / wall.reach_mm as f32).min(1.0);
                *factor = factor.min(wall.factor as f32 * (1.0 - share) + share);
            }
        }
        // Each sample has the smallest factor of the voxels around it: nothing thin falls between samples.
        let stride = voxel_mm.map(|s| (SAMPLES_MM / s).round().max(1.0) as usize);
        let coarse: [usize; 3] = std::array::from_fn(|a| (dims[a] - 1).div_ceil(stride[a]) + 1);
        let mut least = vec![f32::MAX; coarse.iter().product()];
        for (v, &l) in label.iter().enumerate() {
            let c = [v % dims[0], v / dims[0] % dims[1], v / (dims[0] * dims[1])];
            let [i, j, k] = std::array::from_fn(|a| (c[a] + stride[a] / 2) / stride[a]);
            let least = &mut least[i + coarse[0] * (j + coarse[1] * k)];
            *least = least.min(factor[v] * inside[l as usize]);
        }
        let spacing_mm = std::array::from_fn(|a| stride[a] as f64 * voxel_mm[a]);
        Self { dims: coarse, spacing_mm, factor: least }
    }

    /// The edges for a target; none grows faster than by [`GROWTH`].
    pub fn edges(&self, target_mm: f64) -> EdgeField {
        let mut edge_mm: Vec<f32> = self.factor.iter().map(|f| (f64::from(*f) * target_mm) as f32).collect();
        let [nx, ny, _] = self.dims;
        for (a, stride) in [1, nx, nx * ny].into_iter().enumerate() {
            let step = (GROWTH * self.spacing_mm[a]) as f32;
            let is_first = |v: usize| (v / stride).is_multiple_of(self.dims[a]);
            for v in (0..edge_mm.len()).filter(|&v| !is_first(v)) {
                edge_mm[v] = edge_mm[v].min(edge_mm[v - stride] + step);
            }
            for v in (0..edge_mm.len()).rev().filter(|&v| !is_first(v)) {
                edge_mm[v - stride] = edge_mm[v - stride].min(edge_mm[v] + step);
            }
        }
        EdgeField { target_mm, dims: self.dims, spacing_mm: self.spacing_mm, edge_mm }
    }
}

/// Edge length in mm on a coarse grid over the box of a `LabelField`, trilinear between, x fastest.
#[derive(Clone, Debug)]
pub(crate) struct EdgeField {
    /// Where nothing else was asked.
    pub target_mm: f64,
    pub dims: [usize; 3],
    pub spacing_mm: [f64; 3],
    pub edge_mm: Vec<f32>,
}

impl EdgeField {
    /// The smallest and the largest edge.
    pub fn range_mm(&self) -> [f64; 2] {
        let each = || self.edge_mm.iter().copied().map(f64::from);
        [each().fold(f64::MAX, f64::min), each().fold(0.0, f64::max)]
    }

    /// The smallest edge in or next to a box between two of its corners, mm.
    pub fn least_mm(&self, low_mm: [f64; 3], high_mm: [f64; 3]) -> f64 {
        let samples = |a: usize| {
            let clip = |x: f64| x.clamp(0.0, (self.dims[a] - 1) as f64) as usize;
            clip((low_mm[a] / self.spacing_mm[a]).floor())..=clip((high_mm[a] / self.spacing_mm[a]).ceil())
        };
        let rows = samples(2).flat_map(|k| samples(1).map(move |j| self.dims[0] * (j + self.dims[1] * k)));
        let least = |row: usize| {
            self.edge_mm[row + *samples(0).start()..=row + *samples(0).end()].iter().copied().fold(f32::MAX, f32::min)
        };
        f64::from(rows.map(least).fold(f32::MAX, f32::min))
    }
}

/// Points on the interfaces: up to `per_part` on the border of every connected part of every field, so that no part is
/// missed.
pub(crate) fn interface_seeds(field: &LabelField, per_part: usize) -> Vec<Point> {
    let [nx, ny, nz] = field.dims();
    let largest = field.largest();
    let spacing = field.spacing_mm();
    let mut seen = vec![false; largest.len()];
    let mut seeds = Vec::new();
    let (mut part, mut border) = (Vec::new(), Vec::new());
    for start in 0..largest.len() {
        if seen[start] || largest[start] == 0 {
            continue;
        }
        seen[start] = true;
        part.push(start);
        border.clear();
        while let Some(v) = part.pop() {
            let c = [v % nx, v / nx % ny, v / (nx * ny)];
            let steps = [(1, c[0], nx, 0), (nx, c[1], ny, 1), (nx * ny, c[2], nz, 2)];
            for (stride, at, n, axis) in steps {
                for (go, next, sign) in [(at > 0, v.wrapping_sub(stride), -1.0), (at + 1 < n, v + stride, 1.0)] {
                    if !go {
                        continue;
                    }
                    if largest[next] != largest[v] {
                        border.push((v, axis, sign));
                    } else if !seen[next] {
                        seen[next] = true;
                        part.push(next);
                    }
                }
            }
        }
        border.sort_by_key(|b| b.0);
        let count = per_part.min(border.len());
        for n in 0..count {
            let (v, axis, sign) = border[n * border.len() / count];
            let c = [v % nx, v / nx % ny, v / (nx * ny)];
            let p = Point::from(std::array::from_fn::<f64, 3, _>(|a| c[a] as f64 * spacing[a]));
            let mut step = Point::zeros();
            step[axis] = sign * spacing[axis];
            let (mut near, mut far) = (0.0, 1.0);
            for _ in 0..12 {
                let middle = 0.5 * (near + far);
                if field.field_at(&(p + step * middle)) == largest[v] {
                    near = middle;
                } else {
                    far = middle;
                }
            }
            seeds.push(p + step * (0.5 * (near + far)));
        }
    }
    seeds
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::engine::meshing::tests::ball_in_shell;

    #[test]
    fn sizes_are_read_by_name_or_number_of_the_label() {
        let wall = Ok(WallEdge { label: label::VENTRICLE, factor: 0.5, reach_mm: 8.0 });
        assert_eq!(["ventricle=0.5@8".parse(), "4=0.5@8".parse()], [wall.clone(), wall]);
        assert_eq!("white_matter=1.5".parse(), Ok(LabelEdge { label: label::WHITE_MATTER, factor: 1.5 }));
        for text in ["ventricle", "ventricle=0.5", "falx=0.5@8", "4=half@8", "300=0.5@8"] {
            assert!(text.parse::<WallEdge>().unwrap_err().contains("ventricle=0.5@8"), "{text}");
        }
        assert!("3=".parse::<LabelEdge>().unwrap_err().contains("white_matter=1.5"));
    }

    #[test]
    fn edges_have_their_factor_at_the_wall_and_grow_gently_from_there() {
        let field = LabelField::new(&ball_in_shell(), 0.7).unwrap();
        let labels = vec![LabelEdge { label: 2, factor: 2.0 }];
        let walls = vec![WallEdge { label: 3, factor: 0.5, reach_mm: 6.0 }];
        let edge = EdgeFactors::new(&field, &Sizing { labels, walls }).edges(4.0);
        let to_box = field.frame_from_box().try_inverse().unwrap();
        let at = |r: f64| {
            let p = to_box.transform_point(&nalgebra::Point3::new(0.6 * r, 0.0, 0.8 * r)).coords.into();
            edge.least_mm(p, p)
        };
        assert!((2.0..2.5).contains(&at(20.0)), "half of the target at the wall: {}", at(20.0));
        assert!((at(10.0) - 4.0).abs() < 1e-3, "the target in the ball: {}", at(10.0));
        let shell: Vec<f64> = (21..30).map(|r| at(f64::from(r))).collect();
        assert!(shell.windows(2).all(|w| w[1] >= w[0]) && shell[8] > 4.0 && shell[8] < 8.0, "{shell:?}");
        let [nx, ny, _] = edge.dims;
        for (a, stride) in [1, nx, nx * ny].into_iter().enumerate() {
            for v in (stride..edge.edge_mm.len()).filter(|v| v / stride % edge.dims[a] > 0) {
                let step = f64::from((edge.edge_mm[v] - edge.edge_mm[v - stride]).abs());
                assert!(step <= GROWTH * edge.spacing_mm[a] + 1e-5);
            }
        }
    }
}
