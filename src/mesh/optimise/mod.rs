//! The quality pass of every engine: fit interfaces to the label fields, then raise the worst tets.
//!
//! Vertices move (pattern search; along interfaces on interfaces), edges and faces flip, edges collapse. Each change is
//! taken only when the worst tet of the cavity gets better, so the worst of the mesh never gets worse. Other sweeps raise
//! the mean, and the last ones give every label its volume. Tets are visited in an order that depends on the mesh only.

mod complex;
mod fit;
mod flatten;
mod flip;
mod relax;
mod smooth;
mod volume;

pub(crate) use complex::{AIR, Complex, Point, min_sine};

use super::label_field::LabelField;
use flip::Limits;

/// What the quality pass aims at.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OptimiseSettings {
    /// Dihedral angles are raised until all are at least this, in degrees.
    pub target_angle_deg: f64,
    /// Fitting interfaces may not push an angle below this, in degrees.
    pub fit_floor_deg: f64,
    /// Rounds of fitting and raising.
    pub rounds: usize,
    /// Fit sweeps per round.
    pub sweeps: usize,
    /// Sweeps per round, and at the very end inside the labels, that raise the mean radius ratio.
    pub relaxing: usize,
}

impl Default for OptimiseSettings {
    fn default() -> Self {
        Self { target_angle_deg: 18.0, fit_floor_deg: 20.0, rounds: 2, sweeps: 2, relaxing: 4 }
    }
}

/// Fits and improves in place; the fields with the label of field k together shall fill `wanted_mm3[k]`.
pub(crate) fn optimise(complex: &mut Complex, field: &LabelField, wanted_mm3: &[f64], settings: &OptimiseSettings) {
    let target = settings.target_angle_deg.to_radians().sin();
    let floor = settings.fit_floor_deg.to_radians().sin();
    flatten::flatten(complex, PRESSED);
    raise(complex, target, 3);
    for _ in 0..settings.rounds {
        for _ in 0..settings.sweeps {
            fit::sweep(complex, field, floor);
        }
        for _ in 0..settings.relaxing {
            relax::sweep(complex, target, false);
        }
        flatten::flatten(complex, PRESSED);
        raise(complex, target, 3);
    }
    flatten::cut(complex);
    flatten::flatten(complex, PRESSED);
    raise(complex, target, 6);
    flatten::flatten(complex, target);
    // The last word: places as near the interface as the target allows.
    volume::match_volumes(complex, field, wanted_mm3, target);
    for _ in 0..settings.relaxing {
        relax::sweep(complex, target, true);
    }
}

/// Quality to which laying the sheet flat may press a tet that is raised again afterwards.
const PRESSED: f64 = 0.03;

/// Raises tets below `target` (sine of the smallest dihedral angle) in at most `passes` passes.
pub(crate) fn raise(complex: &mut Complex, target: f64, passes: usize) {
    let limits = Limits::default();
    for _ in 0..passes {
        let fields = complex.all_fields();
        let mut bad: Vec<(f64, u32)> =
            complex.solid().map(|t| (complex.quality(t), t)).filter(|(q, _)| *q < target).collect();
        if bad.is_empty() {
            return;
        }
        bad.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut changed = 0usize;
        for (_, first) in bad {
            let mut open = vec![first];
            let mut budget = 12;
            while let Some(t) = open.pop() {
                if budget == 0 {
                    break;
                }
                if !complex.is_solid(t) || complex.quality(t) >= target {
                    continue;
                }
                budget -= 1;
                if let Some(fresh) = flip::improve_connectivity(complex, t, &limits) {
                    changed += 1;
                    open.extend(fresh);
                    continue;
                }
                for v in complex.tets[t as usize] {
                    if smooth::improve_position(complex, v, fields[v as usize].count_ones() > 1) {
                        changed += 1;
                    }
                }
                if complex.quality(t) >= target {
                    continue;
                }
                if let Some(fresh) = merge_away(complex, t, &fields, &limits) {
                    changed += 1;
                    open.extend(fresh);
                }
            }
        }
        if changed == 0 {
            return;
        }
    }
}

/// Collapses an edge of the tet when that helps.
fn merge_away(complex: &mut Complex, t: u32, fields: &[u64], limits: &Limits) -> Option<Vec<u32>> {
    let tet = complex.tets[t as usize];
    for [i, j] in complex::EDGES {
        for (a, b) in [(tet[i], tet[j]), (tet[j], tet[i])] {
            let beat = complex.star_quality(a) + 1e-4;
            if let Some(fresh) = flip::collapse(complex, a, b, fields, beat, limits) {
                return Some(fresh);
            }
        }
    }
    None
}
