//! The ventricles' change: what the model's walls enclose, at rest and deformed, against what the two scans show. A load or a
//! pressure that is not as assumed shows here, even where the depth of the brain is explained.

use super::verdict::CONTRADICTION_SD;
use crate::mesh::TetMesh;
use crate::tag::VENTRICLE;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How differently two segmentations of one person place the ventricles' wall on the whole, mm, standard deviation
/// (docs/evidence/choices.md).
const WALL_MM: f64 = 0.05;
/// Where ventricle and cavity are one, the two draw the border between them within this, mm.
const BORDER_MM: f64 = 1.0;
/// Cubic millimetres of a cubic centimetre.
const MM3_PER_CC: f64 = 1e3;

/// Volumes of the ventricles, cm3.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VentricleChange {
    /// What the model's walls enclose at rest.
    pub model_rest_cc: f64,
    /// By how much more they do in the estimate's state.
    pub model_change_cc: f64,
    /// What the segmentation of the pre-operative scan has.
    pub seen_before_cc: f64,
    /// What that of the post-operative scan has.
    pub seen_after_cc: f64,
    /// Standard deviation of the difference between the two changes where nothing is wrong: two segmentations, the border to a
    /// cavity, the estimate's own.
    pub sd_cc: f64,
}

impl VentricleChange {
    /// Of a state, beside what the scans show before and after (cm3); `log_sd` is how well the state's size is known. `None` of a
    /// mesh without ventricles.
    pub fn of(mesh: &TetMesh, displacement_mm: &[[f64; 3]], seen_cc: [f64; 2], log_sd: f64) -> Option<Self> {
        let wall = mesh.facet_sets.get(VENTRICLE).filter(|wall| !wall.is_empty())?;
        let rest = |n: u32| Vector3::from(mesh.nodes_mm()[n as usize]);
        let moved = |n: u32| rest(n) + Vector3::from(displacement_mm[n as usize]);
        let [before, after] = [Enclosed::of(wall, &rest), Enclosed::of(wall, &moved)];
        let model_change_cc = (after.volume_mm3.abs() - before.volume_mm3.abs()) / MM3_PER_CC;
        let of_walls = 2f64.sqrt() * WALL_MM * before.area_mm2 / MM3_PER_CC;
        let of_border = BORDER_MM * before.opening_mm2 / MM3_PER_CC;
        Some(Self {
            model_rest_cc: before.volume_mm3.abs() / MM3_PER_CC,
            model_change_cc,
            seen_before_cc: seen_cc[0],
            seen_after_cc: seen_cc[1],
            sd_cc: of_walls.hypot(of_border).hypot(model_change_cc * log_sd),
        })
    }

    /// By how much more the scans show after than before.
    pub fn seen_change_cc(&self) -> f64 {
        self.seen_after_cc - self.seen_before_cc
    }

    /// Whether the two changes are the same, as far as can be told.
    pub fn agrees(&self) -> bool {
        (self.model_change_cc - self.seen_change_cc()).abs() <= CONTRADICTION_SD * self.sd_cc
    }

    /// In a sentence.
    pub fn sentence(&self) -> String {
        let (seen, told) = (self.seen_change_cc(), CONTRADICTION_SD * self.sd_cc);
        let changes = format!(
            "the ventricles change by {seen:+.1} cc on the scans ({:.1} to {:.1} cc) and by {:+.1} cc in the model",
            self.seen_before_cc, self.seen_after_cc, self.model_change_cc
        );
        if self.agrees() {
            format!("{changes}: no difference that could be told ({told:.1} cc)")
        } else {
            format!(
                "{changes}, more apart than could be by chance ({told:.1} cc): a pressure or a load is not as assumed"
            )
        }
    }
}

/// What a wall encloses, its openings closed by a cone over the middle of each rim.
struct Enclosed {
    volume_mm3: f64,
    area_mm2: f64,
    opening_mm2: f64,
}

impl Enclosed {
    fn of(wall: &[[u32; 3]], at: &impl Fn(u32) -> Vector3<f64>) -> Self {
        let mut found = Self { volume_mm3: 0.0, area_mm2: 0.0, opening_mm2: 0.0 };
        // Near the wall, so that little is lost to rounding.
        let origin = at(wall[0][0]);
        let cone = |t: [Vector3<f64>; 3]| {
            let [a, b, c] = t.map(|x| x - origin);
            (a.dot(&b.cross(&c)) / 6.0, 0.5 * (b - a).cross(&(c - a)).norm())
        };
        for facet in wall {
            let (volume, area) = cone(facet.map(at));
            found.volume_mm3 += volume;
            found.area_mm2 += area;
        }
        for rim in rims(wall) {
            let middle = rim.iter().map(|[a, _]| at(*a)).sum::<Vector3<f64>>() / rim.len() as f64;
            for [a, b] in rim {
                let (volume, area) = cone([at(b), at(a), middle]);
                found.volume_mm3 += volume;
                found.opening_mm2 += area;
            }
        }
        found
    }
}

/// Edges of facets that no other facet goes along the other way, by the rim they belong to.
fn rims(wall: &[[u32; 3]]) -> Vec<Vec<[u32; 2]>> {
    let mut open: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for [a, b, c] in wall {
        for [from, to] in [[*a, *b], [*b, *c], [*c, *a]] {
            let (edge, way) = if from < to { ([from, to], 1) } else { ([to, from], -1) };
            *open.entry(edge).or_default() += way;
        }
    }
    let directed = open.into_iter().filter(|(_, ways)| *ways != 0);
    let mut left: Vec<[u32; 2]> = directed.map(|([a, b], ways)| if ways > 0 { [a, b] } else { [b, a] }).collect();
    let mut rims = Vec::new();
    while let Some(first) = left.pop() {
        let mut rim = vec![first];
        let mut next = 0;
        while next < rim.len() {
            let ends = rim[next];
            let (touching, rest) = left.into_iter().partition(|edge| edge.iter().any(|n| ends.contains(n)));
            let touching: Vec<[u32; 2]> = touching;
            rim.extend(touching);
            left = rest;
            next += 1;
        }
        rims.push(rim);
    }
    rims
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;

    /// A block of 50 mm whose outside is taken for a ventricle's wall, without the facets that `open` names.
    fn walled(open: impl Fn([f64; 3]) -> bool) -> TetMesh {
        let mut mesh = block(5);
        let nodes = mesh.nodes_mm().to_vec();
        let middle = |f: &[u32; 3]| [0, 1, 2].map(|i| f.iter().map(|&n| nodes[n as usize][i]).sum::<f64>() / 3.0);
        let wall: Vec<[u32; 3]> = mesh.outside_without(&[]).into_iter().filter(|f| !open(middle(f))).collect();
        mesh.facet_sets.insert(VENTRICLE.to_owned(), wall);
        mesh
    }

    /// Wider by this share in each direction, and moved.
    fn wider(mesh: &TetMesh, by: f64) -> Vec<[f64; 3]> {
        mesh.nodes_mm().iter().map(|x| [by * x[0] + 7.0, by * x[1] - 3.0, by * x[2] + 11.0]).collect()
    }

    #[test]
    fn a_wall_that_moves_encloses_as_much_and_one_that_widens_the_cube_of_it_open_or_not() {
        let hole = |x: [f64; 3]| x[0] < 1e-9 && x[1] < 20.0 && x[2] < 20.0;
        for (mesh, opening) in [(walled(|_| false), false), (walled(hole), true)] {
            let still = VentricleChange::of(&mesh, &wider(&mesh, 0.0), [125.0, 125.0], 0.0).unwrap();
            assert!((still.model_rest_cc - 125.0).abs() < 1e-9 && still.model_change_cc.abs() < 1e-9, "{still:?}");
            let wide = VentricleChange::of(&mesh, &wider(&mesh, 0.02), [125.0, 125.0], 0.0).unwrap();
            assert!((wide.model_change_cc - 125.0 * (1.02f64.powi(3) - 1.0)).abs() < 1e-9, "{wide:?}");
            let walls = still.sd_cc;
            assert_eq!(walls > 2f64.sqrt() * WALL_MM * 15.0 + 1e-6, opening, "{walls}");
        }
    }

    #[test]
    fn a_change_beyond_what_two_segmentations_are_good_to_is_told() {
        let mesh = walled(|_| false);
        let of = |after_cc: f64| {
            let rest = vec![[0.0; 3]; mesh.nodes_mm().len()];
            VentricleChange::of(&mesh, &rest, [125.0, after_cc], 0.2).unwrap()
        };
        let reach = CONTRADICTION_SD * of(125.0).sd_cc;
        for (off, agrees) in [(0.9 * reach, true), (-0.9 * reach, true), (1.1 * reach, false), (-1.1 * reach, false)] {
            let found = of(125.0 + off);
            assert_eq!(found.agrees(), agrees, "{off}");
            assert_eq!(found.sentence().contains("not as assumed"), !agrees, "{}", found.sentence());
        }
    }
}
