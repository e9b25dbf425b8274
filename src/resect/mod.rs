//! Cavity mask on post, resected-tissue mask on pre, subtraction.

mod cavity;
mod intensity;

pub use cavity::{CavityFinding, CavityPair, CavitySettings, ResectError, Side, apart_from, find_cavity, subtract};
pub use intensity::csf_grey_border;
