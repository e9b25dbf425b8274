//! Where a surgeon begins and how far the lobe goes, by planes placed by eye on the template: for making patients, not for
//! measuring.

use crate::geometry::{Mni, Position};
use crate::segment::atlas::{Side, above_sylvian, central_mm, temporal_lobe};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A place of an operation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Lobe {
    /// From the temporal pole backwards.
    #[default]
    Temporal,
    /// From the frontal pole backwards.
    Frontal,
    /// From the upper convexity inwards.
    Parietal,
    /// From the occipital pole forwards.
    Occipital,
    /// Around the middle of the insula.
    Insular,
    /// A cut around the central core (insula, basal ganglia, thalamus), as of a functional hemispherotomy: the hemisphere
    /// stays, disconnected. The volume says how wide the cut is (docs/evidence/synthetic-faults.md).
    Hemisphere,
}

/// The central core, as an ellipsoid around (|x|, y, z), mm.
const CORE_MM: [f64; 3] = [27.0, -8.0, 6.0];
/// Half axes of its outside, where the cut runs, mm.
const CORE_RADII_MM: [f64; 3] = [25.0, 44.0, 27.0];
/// The core's lower part stays on the brainstem, mm.
const CUT_BOTTOM_MM: f64 = -14.0;
/// The cut is nowhere wider than twice this, mm.
const CUT_MM: f64 = 6.0;

/// About how far a point lies from the outside of the central core, mm.
fn from_core_mm(p: [f64; 3]) -> f64 {
    let from: Vec<f64> = (0..3).map(|a| p[a] - CORE_MM[a]).collect();
    let radius = from.iter().zip(CORE_RADII_MM).map(|(d, r)| (d / r).powi(2)).sum::<f64>().sqrt();
    let length = from.iter().map(|d| d * d).sum::<f64>().sqrt();
    // Along the ray from the centre.
    (radius - 1.0).abs() * length / radius.max(1e-6)
}

impl Lobe {
    /// Every place.
    pub const ALL: [Self; 6] =
        [Self::Temporal, Self::Frontal, Self::Parietal, Self::Occipital, Self::Insular, Self::Hemisphere];

    /// The word in files and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Temporal => "temporal",
            Self::Frontal => "frontal",
            Self::Parietal => "parietal",
            Self::Occipital => "occipital",
            Self::Insular => "insular",
            Self::Hemisphere => "hemisphere",
        }
    }

    /// Whether a point of the template lies in the lobe of this side.
    pub(super) fn holds(self, side: Side, p: Position<Mni>) -> bool {
        let own_side = if side == Side::Left { p.mm.x < -2.0 } else { p.mm.x > 2.0 };
        let [x, y, z] = [p.mm.x.abs(), p.mm.y, p.mm.z];
        let (above_sylvian, central_mm) = (above_sylvian(y, z), central_mm(z));
        own_side
            && match self {
                Self::Temporal => temporal_lobe(p) == Some(side),
                Self::Frontal => y > central_mm && above_sylvian && z > -30.0,
                Self::Parietal => y < central_mm && y > -72.0 && above_sylvian && z > 18.0,
                Self::Occipital => y < -68.0 && z > -8.0 && z < 45.0,
                Self::Insular => (26.0..46.0).contains(&x) && (-22.0..28.0).contains(&y) && (-10.0..20.0).contains(&z),
                Self::Hemisphere => z > CUT_BOTTOM_MM && from_core_mm([x, y, z]) < CUT_MM,
            }
    }

    /// How far the wall strays, and the radius of what is taken at once, mm.
    pub(super) fn tool_mm(self) -> (f64, f64) {
        match self {
            Self::Hemisphere => (0.4, 1.0),
            _ => (2.5, 2.0),
        }
    }

    /// How late a point would be taken: an elliptic distance from where the surgeon begins, mm.
    pub(super) fn order_mm(self, side: Side, p: Position<Mni>) -> f64 {
        let sign = if side == Side::Left { -1.0 } else { 1.0 };
        let (begin, stretch) = match self {
            Self::Temporal => ([42.0, 16.0, -30.0], [1.0, 1.7, 1.05]),
            Self::Frontal => ([24.0, 62.0, 8.0], [1.0, 1.2, 1.0]),
            Self::Parietal => ([36.0, -50.0, 62.0], [1.0, 1.0, 1.0]),
            Self::Occipital => ([18.0, -104.0, 6.0], [1.0, 1.3, 1.0]),
            Self::Insular => ([37.0, 4.0, 5.0], [0.7, 1.3, 1.1]),
            Self::Hemisphere => return from_core_mm([sign * p.mm.x, p.mm.y, p.mm.z]),
        };
        let from = [p.mm.x - sign * begin[0], p.mm.y - begin[1], p.mm.z - begin[2]];
        (0..3).map(|a| (from[a] / stretch[a]).powi(2)).sum::<f64>().sqrt()
    }
}

impl std::str::FromStr for Lobe {
    type Err = String;
    fn from_str(word: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|lobe| lobe.name() == word);
        known.ok_or_else(|| "say temporal, frontal, parietal, occipital, insular or hemisphere".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cut_that_disconnects_a_hemisphere_goes_around_its_core_and_leaves_the_core_and_the_other_side() {
        let cut = |x: f64, y: f64, z: f64| Lobe::Hemisphere.holds(Side::Left, Position::new(x, y, z));
        // Callosum, frontal white matter, corona radiata above, insula's opercula.
        for (x, y, z) in [(-3.0, -8.0, 8.0), (-27.0, 36.0, 6.0), (-27.0, -8.0, 33.0), (-51.0, -8.0, 6.0)] {
            assert!(cut(x, y, z), "{x} {y} {z}");
            assert!(!cut(-x, y, z) && Lobe::Hemisphere.order_mm(Side::Left, Position::new(x, y, z)) < 2.0);
        }
        // Putamen, pole, vertex, brainstem.
        for (x, y, z) in [(-27.0, -2.0, 2.0), (-27.0, 60.0, 6.0), (-27.0, -8.0, 60.0), (-5.0, -30.0, -40.0)] {
            assert!(!cut(x, y, z), "{x} {y} {z}");
        }
    }

    #[test]
    fn a_place_lies_in_one_lobe_of_one_side_and_the_surgeon_begins_beside_it() {
        let places = [
            (Lobe::Temporal, [45.0, 10.0, -30.0]),
            (Lobe::Frontal, [25.0, 50.0, 10.0]),
            (Lobe::Parietal, [36.0, -50.0, 50.0]),
            (Lobe::Occipital, [18.0, -95.0, 5.0]),
        ];
        for (lobe, [x, y, z]) in places {
            for (side, x) in [(Side::Right, x), (Side::Left, -x)] {
                let p = Position::new(x, y, z);
                let held: Vec<Lobe> = Lobe::ALL.into_iter().filter(|l| l.holds(side, p)).collect();
                assert_eq!(held, [lobe], "{p:?}");
                assert!(lobe.order_mm(side, p) < 20.0);
                let other = if side == Side::Left { Side::Right } else { Side::Left };
                assert!(Lobe::ALL.iter().all(|l| !l.holds(other, p)));
            }
            assert_eq!(lobe.name().parse(), Ok(lobe));
        }
    }
}
