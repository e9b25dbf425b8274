//! Our own engine: the body-centred lattice, snapped to the label interfaces.

use super::body_centred;
use super::mesher::{Mesher, Program, Request};
use super::process::ProcessError;
use crate::mesh::optimise::Complex;

/// The engine.
pub(super) struct Lattice;

impl Mesher for Lattice {
    fn name(&self) -> &'static str {
        "lattice"
    }

    fn program(&self) -> Option<&'static Program> {
        None
    }

    fn mesh(&self, request: &Request, edge_mm: f64) -> Result<Complex, ProcessError> {
        Ok(body_centred::tets(request.field, &request.edges(edge_mm)))
    }
}
