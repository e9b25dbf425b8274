//! Cavity mask on post, resected-tissue mask on pre, subtraction.

mod belief;
mod blood;
mod by_hand;
mod cavity;
mod cavity_pair;
mod edge;
mod elsewhere;
mod intensity;
mod likeness;
mod midline;
mod pair;
mod sag;
mod sets;
mod window;

pub use belief::{Doubt, Evidence};
pub use by_hand::subtract;
pub use cavity::{CavityFinding, CavitySettings, ResectError, Side, apart_from, find_cavity};
pub use cavity_pair::CavityPair;
pub use intensity::on_the_scale_of;
pub use likeness::{Likeness, likeness};
pub use midline::midline_shift_mm;
pub use pair::{
    GivenMasks, HeadApart, OperatedBrain, PairError, PairSettings, take_head_apart, take_pair_apart,
    template_correlation,
};
pub use sag::{SagScans, fit_sag, moved_scan, skull_is_shown};
