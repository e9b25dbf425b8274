//! Stage `reference`: the surfaces that the post-operative scan shows.

use super::{Anatomy, Case, Failure};
use crate::artefact::{Manifest, Produced, Stage};
use crate::experiment::observed::mask_surface;
use crate::mesh::TriMesh;
use crate::mesh::format::gifti::{self, Space};
use std::collections::BTreeMap;

/// Raised when the stage's code changes its result.
const VERSION: u32 = 1;

/// The surfaces of a patient's case by the name of the node set that should lie on them.
pub fn observed_surfaces(anatomy: &Anatomy) -> BTreeMap<String, TriMesh> {
    BTreeMap::from([
        ("margin".to_owned(), mask_surface(&anatomy.cavity)),
        ("ventricle".to_owned(), mask_surface(&anatomy.post_ventricle)),
    ])
}

/// The stage with its input.
pub fn reference_stage(case: &Case, after: &Manifest) -> Stage {
    Stage::new("reference", VERSION, &case.folder, &()).after(after)
}

/// Writes the surfaces as GIFTI.
///
/// # Errors
/// The disk's.
pub fn reference(case: &Case, anatomy: &Anatomy, after: &Manifest) -> Result<Manifest, Failure> {
    let (manifest, ()) = case.run(&reference_stage(case, after), "reference", || {
        let file = |(set, surface): (&String, &TriMesh)| {
            (format!("mesh/reference_{set}.surf.gii"), gifti::encode_surface(surface, Space::Mni152, set))
        };
        let surfaces = observed_surfaces(anatomy);
        Ok(Produced { files: surfaces.iter().map(file).collect(), ..Produced::default() })
    })?;
    Ok(manifest)
}
