//! The study-level model: what the next laboratory, or the next person, may show, learnt from how studies differ.
//!
//! The published Gaussian process ([`super::gp`]) takes the curves for noisy readings of one function per task. They are
//! not: each is a smooth curve without noise, and what differs between them is a publication's level and shape. Here
//!
//! ```text
//! ln g(l) = ln( 2 W(l) / (I1(l) - 3) ),        x = ln l,
//! ln g    = m_task(x) + u_publication(x) + v_curve(x) + nugget
//! ```
//!
//! where g is the effective shear modulus (Pa), constant for a neo-Hookean solid: the dip of W to zero at rest and any
//! offset inside the logarithm are gone. m, u and v are Gaussian processes in the same few functions of x ([`Basis`]): the
//! level, a step between compression and tension, the slopes of both sides (an exponent of stiffening) and a smooth
//! remainder, none at rest, in the reduced rank of Solin and Särkkä, "Hilbert space methods for reduced-rank Gaussian process
//! regression", Statistics and Computing 2020. The tasks' means are coregionalised: tasks of one kind of study, or of one
//! region, share a part of their level. Studies of abnormal tissue have spreads of their own; shapes of elastography
//! and of linear elasticity are scaled by one factor.
//!
//! Everything is linear and Gaussian, so the likelihood is exact; the curves' points enter through sums that are taken
//! once, and one evaluation costs a few small matrices per curve ([`Evidence`]). Spreads are found where their posterior is
//! highest under stated half-normal priors ([`fit`]): with one to six publications per task plain likelihood lets them
//! grow without end.

mod basis;
mod evidence;
mod fit;
mod intervals;
mod joint;
mod leave_one_out;
mod model_file;
mod moduli;
mod predict;
mod simulate;
mod spreads;
mod study;

pub use basis::Basis;
pub use evidence::{Evidence, MeanPosterior};
pub use fit::{FitError, StudyLevelFit, Unfinished, fit, refit};
pub use intervals::intervals;
pub use joint::{JointPrediction, predict_jointly};
pub use leave_one_out::{LeftOut, LeftOutCurve, leave_one_publication_out, published_log_density, uniform_probability};
pub use model_file::StudyLevelFile;
pub use moduli::{ModuliPrior, drawn_materials, materials_at_levels};
pub use predict::{Of, StudyLevelPrior, log_energies, predict};
pub use simulate::simulate;
pub use spreads::{SPREAD_NAMES, SPREADS, Spreads};
pub use study::{Studies, StudyCurve};

#[cfg(test)]
mod tests;
