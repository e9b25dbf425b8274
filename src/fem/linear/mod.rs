//! Solvers for the symmetric linear systems of Newton's method, behind one interface; one file per method.

mod block_jacobi;
mod coarse;
mod direct;
mod dissection;
mod factor;
mod operator;
mod pcg;
mod system;

pub(super) use coarse::Rows;
pub(super) use direct::Direct;
pub(super) use factor::Symbolic;
pub(super) use pcg::Pcg;
pub(crate) use system::Within;
pub(super) use system::{LinearReport, LinearSolver, Tangent};
