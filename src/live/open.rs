//! A posed body with what is known of its tissues.

use super::body::{LiveBody, LiveTissue, Spread};
use crate::artefact::sha256_hex;
use crate::experiment::estimate::LogPrior;
use crate::experiment::prior::{PriorSettings, log_prior};
use crate::experiment::sample::Tissue;
use crate::mesh::TetMesh;
use crate::workflow::{EstimateFacts, Posed};

impl LiveBody {
    /// A session's body, with the prior of these settings and the case's posterior for every tissue that has one.
    pub fn of(posed: Posed, prior: &PriorSettings) -> Self {
        let Posed { name, mesh, scenario, estimate, sights } = posed;
        let tissue = |name: &String| LiveTissue {
            name: name.clone(),
            prior: spread(log_prior(&Tissue { name: name.clone(), labels: Vec::new() }, prior).ok().as_ref()),
            posterior: estimate.as_ref().and_then(|facts| posterior(facts, name)),
        };
        let tissues = scenario.materials.keys().map(tissue).collect();
        let mut notes = vec![format!("{} nodes, {} tetrahedra", mesh.nodes_mm().len(), mesh.tets().len())];
        notes.push("loads act on the undeformed shape, as in scenarios".to_owned());
        let mesh_sha256 = sum(&mesh);
        Self { name, mesh, scenario, tissues, sights, notes, mesh_sha256 }
    }
}

fn spread(prior: Option<&LogPrior>) -> Option<Spread> {
    let prior = prior?;
    Some(Spread { log_mean: prior.mean, log_sd: prior.sd? })
}

/// What the estimate says of a tissue, or of the whole brain.
fn posterior(facts: &EstimateFacts, tissue: &str) -> Option<Spread> {
    let posterior = &facts.estimate.posterior;
    let of = |name: &str| posterior.names.iter().position(|n| *n == format!("shear_modulus_pa of {name}"));
    let whole = || of("brain").filter(|_| ["grey_matter", "white_matter"].contains(&tissue));
    let n = of(tissue).or_else(whole)?;
    Some(Spread { log_mean: posterior.mode[n].ln(), log_sd: posterior.log_sd[n] })
}

/// SHA-256 of what makes a mesh.
fn sum(mesh: &TetMesh) -> String {
    let mut bytes: Vec<u8> = mesh.nodes_mm().as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend(mesh.tets().as_flattened().iter().flat_map(|n| n.to_le_bytes()));
    bytes.extend_from_slice(mesh.labels());
    sha256_hex(&bytes)
}
