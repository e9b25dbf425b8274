//! What an engine is, and what it is asked.

use super::body_centred;
use super::process::{Limits, ProcessError};
use super::sizing::{EdgeFactors, EdgeField, interface_seeds};
use super::surface::InterfaceSurface;
use crate::mesh::label_field::LabelField;
use crate::mesh::optimise::{Complex, Point};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Volume of a tet per cubed edge length in a mesh of this kind (a regular one has 0.118, CGAL's average 0.17).
pub(super) const TET_SHARE: f64 = 0.17;

/// A meshing engine.
pub(crate) trait Mesher: Sync {
    /// The name used on the command line and in manifests.
    fn name(&self) -> &'static str;
    /// The program it is; `None` for an engine of our own, which is always there.
    fn program(&self) -> Option<&'static Program>;
    /// Tets of about this edge (mm), labelled by the number of their field. None at all: nothing was found to mesh.
    ///
    /// # Errors
    /// [`ProcessError`] of the program.
    fn mesh(&self, request: &Request, edge_mm: f64) -> Result<Complex, ProcessError>;
    /// By how much the first edge is multiplied when a number of cells is asked for.
    fn first_guess(&self, _edge_mm: f64) -> f64 {
        1.0
    }
}

/// A program that an engine is.
#[derive(Debug)]
pub(crate) struct Program {
    /// Its file name.
    pub name: &'static str,
    /// What it is for, in a few words.
    pub used_for: &'static str,
    /// A variable of the environment that may name it.
    pub variable: Option<&'static str>,
    /// The command that installs it.
    pub install: &'static str,
}

/// What an engine is given.
pub(crate) struct Request<'a> {
    /// What to mesh.
    pub(super) field: &'a LabelField,
    /// Where the program is; empty for an engine of our own.
    pub(super) program: PathBuf,
    pub(super) limits: &'a Limits,
    factors: &'a EdgeFactors,
    polish: &'a dyn Fn(Complex) -> Complex,
    seeds: OnceLock<Vec<Point>>,
}

/// Points on the border of every part of a label that an engine may start from.
const SEEDS: usize = 12;
/// The same when it found nothing with those.
const DENSE_SEEDS: usize = 400;

impl<'a> Request<'a> {
    pub(super) fn new(
        field: &'a LabelField,
        factors: &'a EdgeFactors,
        polish: &'a dyn Fn(Complex) -> Complex,
        program: Option<&Path>,
        limits: &'a Limits,
    ) -> Self {
        let program = program.map(Path::to_path_buf).unwrap_or_default();
        Self { field, program, limits, factors, polish, seeds: OnceLock::new() }
    }

    /// The edge everywhere.
    pub(super) fn edges(&self, edge_mm: f64) -> EdgeField {
        self.factors.edges(edge_mm)
    }

    /// A few points on the border of every part of a label.
    pub(super) fn seeds(&self) -> &[Point] {
        self.seeds.get_or_init(|| interface_seeds(self.field, SEEDS))
    }

    /// Many points on the border of every part of a label.
    pub(super) fn dense_seeds(&self) -> Vec<Point> {
        interface_seeds(self.field, DENSE_SEEDS)
    }

    /// The interfaces as our own lattice has them, for engines that mesh the inside of a surface.
    pub(super) fn surface(&self, edge: &EdgeField) -> InterfaceSurface {
        InterfaceSurface::of(&(self.polish)(body_centred::tets(self.field, edge)))
    }
}
