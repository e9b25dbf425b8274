//! Supports as a scenario states them: sets that are held, sets that slide, walls, and springs.

use crate::geometry::SmoothField;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How a set is supported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Support {
    /// Held at zero displacement.
    #[default]
    Fixed,
    /// Free to slide and to leave, not to go through. A sheet inside the tissue is cut open, and either side slides along
    /// it; any other set stands before a wall where its surface is at rest.
    Sliding,
}

/// A surface that stands before a wall, which pushes back without friction and never pulls.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Facet set or node set (of a node set the boundary facets with all three nodes in it); `surface`, where the mesh has
    /// no set of that name, is the whole boundary.
    pub set: String,
    /// The wall.
    pub wall: Wall,
    /// Room between surface and wall at rest, mm, as [`Wall`] says; none before a plane, which stands where its point is. Half of
    /// `softness_mm` is left in any case, so that the body at rest is not pressed.
    #[serde(default)]
    pub gap_mm: f64,
    /// Pressure per depth beyond the wall, Pa/mm. Depth is pressure over this: by default 1500 Pa, a column of brain of 150 mm,
    /// go .017 mm deep.
    #[serde(default = "stiffness_pa_per_mm")]
    pub stiffness_pa_per_mm: f64,
    /// The pressure sets in over this distance, half before the wall and half behind, mm.
    #[serde(default = "softness_mm")]
    pub softness_mm: f64,
}

/// Default of [`Contact::stiffness_pa_per_mm`].
fn stiffness_pa_per_mm() -> f64 {
    90_000.0
}

/// Default of [`Contact::softness_mm`].
fn softness_mm() -> f64 {
    0.05
}

/// Where a wall is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "shape", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Wall {
    /// A plane; nodes beyond it at rest are pushed back.
    Plane {
        /// A point of it, mm.
        point_mm: [f64; 3],
        /// Towards the side that is free.
        normal: [f64; 3],
    },
    /// `gap_mm` outside the surface at rest: at every node the plane across its outward normal.
    OwnSurface,
    /// Both sides of a sheet of facets between tetrahedra, along which the mesh is cut open: a thin rigid wall that
    /// either side slides along. The sheet's edge inside the tissue stays whole.
    Sheet,
    /// A smooth distance to the wall, positive where there is room, mm: given by library calls and by a patient's stages.
    /// Every node has the room that the field says at rest and `gap_mm` more; or, `even`, `gap_mm` alone, and only the
    /// wall's shape is the field's.
    Field {
        /// What it is, for messages and keys.
        name: String,
        /// Every node has `gap_mm` of room at rest, whatever the field says.
        #[serde(default)]
        even: bool,
        /// The distance.
        #[serde(skip)]
        distance_mm: Option<Arc<SmoothField>>,
    },
}

impl Contact {
    /// A set before a wall, with the default stiffness and softness.
    pub fn new(set: &str, wall: Wall, gap_mm: f64) -> Self {
        let (stiffness_pa_per_mm, softness_mm) = (stiffness_pa_per_mm(), softness_mm());
        Self { set: set.to_owned(), wall, gap_mm, stiffness_pa_per_mm, softness_mm }
    }
}

/// Springs between a surface and the place where it is at rest: bridging veins and arachnoid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tether {
    /// Facet set or node set, as for [`Contact`].
    pub set: String,
    /// Traction per displacement, Pa/mm.
    pub stiffness_pa_per_mm: f64,
    /// Only the part of the displacement along the normal at rest is held: the set may slide, not leave.
    #[serde(default)]
    pub only_normal: bool,
}
