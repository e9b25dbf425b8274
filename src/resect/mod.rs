//! Cavity mask on post, resected-tissue mask on pre, subtraction.

mod blood;
mod cavity;
mod intensity;
mod midline;
mod pair;
mod sag;

pub use cavity::{CavityFinding, CavityPair, CavitySettings, ResectError, Side, apart_from, find_cavity, subtract};
pub use intensity::on_the_scale_of;
pub use midline::midline_shift_mm;
pub use pair::{GivenMasks, OperatedBrain, PairError, PairSettings, take_pair_apart};
pub use sag::{SagScans, fit_sag, moved_scan};
