//! The bundled pair, a synthetic patient whose truth is known, through the whole job, and the phantom beside it.

use super::layer::Layer;
use super::{Case, Goal, Inputs, Place, Progress, Settings, WorkflowError, run_to};
use crate::artefact::write_whole;
use crate::mesh::engine::{Engine, MeshSize};

const PRE: &[u8] = include_bytes!("../../sample-data/pre.nii.gz");
const POST: &[u8] = include_bytes!("../../sample-data/post.nii.gz");
/// How that patient lay, how much fluid was lost, and a coarse mesh.
const SETTINGS: &str = include_str!("../../sample-data/settings.toml");

/// Tetrahedra of the phantom's mesh.
const CELLS: usize = 15_000;

/// The settings of the bundled pair, to lay others over.
///
/// # Errors
/// None: they are part of the program.
pub fn demo_pair_settings() -> Result<toml::Table, WorkflowError> {
    Ok(Settings::layer(SETTINGS, "the settings of the bundled pair")?)
}

/// Those of the phantom: the embedded engine and a coarse mesh, as for the pair: the same bytes on every machine, whatever is
/// installed, and soon.
pub fn demo_phantom_settings() -> Layer {
    let mut layer = Layer::default();
    layer.set("phantom.tissues", Some(1));
    layer.set("mesh.engine", Some(Engine::LATTICE));
    layer.set("mesh.size", Some(MeshSize::Cells(CELLS)));
    layer
}

/// The pair's estimate into `pair` of the place's folder, the phantom into `phantom`; the scans lie in `input`.
///
/// # Errors
/// As [`run_to`].
pub fn demo(
    place: &Place,
    [of_pair, of_phantom]: [&Settings; 2],
    progress: &mut dyn Progress,
) -> Result<[Case; 2], WorkflowError> {
    let at = |name: &str| Place { folder: place.folder.join(name), ..place.clone() };
    let input = place.folder.join("input");
    let scan = |name: &str, bytes: &[u8]| -> Result<_, WorkflowError> {
        let path = input.join(name);
        write_whole(&path, bytes)?;
        Ok(path)
    };
    let inputs = Inputs::pair(scan("pre.nii.gz", PRE)?, scan("post.nii.gz", POST)?);
    let pair = run_to(Goal::Estimate, &inputs, &at("pair"), of_pair, progress)?;
    let phantom = super::phantom(false, &at("phantom"), of_phantom, progress)?;
    Ok([pair, phantom])
}
