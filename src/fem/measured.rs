//! Laws that were measured over some stretches only, held against the stretches of the body that they were given to.

use super::FemWarning;
use super::element::{Body, Laws};

/// Part of a stretch by which a window may be left: papers give its ends to two digits.
const EXCESS: f64 = 0.01;
/// Part of a material's cells that may leave it: where a held face meets a free one strains grow as cells shrink, and a few cells
/// say nothing of the body.
const STRAY: f64 = 0.01;

/// Every material that is stretched beyond what it was measured at. A test stretches along one axis, and the others follow; so of a
/// cell that stretch counts which is farthest from 1.
pub(super) fn outside_measured(body: &dyn Body, names: &[String], u: &[[f64; 3]], laws: &Laws) -> Vec<FemWarning> {
    let mut found = Vec::new();
    for (n, (material, window)) in names.iter().zip(&laws.measured).enumerate() {
        let Some([low, high]) = *window else { continue };
        let stretches = body.farthest_stretches(u, n as u16);
        let is_outside = |s: &[f64; 2]| s[0] < low * (1.0 - EXCESS) || s[1] > high * (1.0 + EXCESS);
        let outside: Vec<[f64; 2]> = stretches.iter().copied().filter(is_outside).collect();
        if outside.is_empty() || outside.len() as f64 <= STRAY * stretches.len() as f64 {
            continue;
        }
        let least = outside.iter().fold(f64::INFINITY, |least, s| least.min(s[0]));
        let most = outside.iter().fold(f64::NEG_INFINITY, |most, s| most.max(s[1]));
        let (material, cells, of) = (material.clone(), outside.len(), stretches.len());
        found.push(FemWarning::OutsideMeasured { material, cells, of, least, most, low, high });
    }
    found
}
