//! A posed body with what is known of its tissues.

use super::body::{LiveBody, LiveTissue, Spread};
use crate::artefact::sha256_hex;
use crate::experiment::estimate::{EstimateOutcome, Knowledge, LogPrior};
use crate::experiment::prior::{PriorSettings, log_prior};
use crate::experiment::sample::Tissue;
use crate::experiment::verdict::Claim;
use crate::mesh::TetMesh;
use crate::workflow::Posed;

impl LiveBody {
    /// A session's body, with the prior of these settings and the case's posterior for every tissue that an interval is claimed of.
    pub fn of(posed: Posed, prior: &PriorSettings) -> Self {
        let Posed { name, mesh, scenario, estimate, sights, notes: of_estimate } = posed;
        let tissue = |name: &String| LiveTissue {
            name: name.clone(),
            prior: spread(log_prior(&Tissue { name: name.clone(), labels: Vec::new() }, prior).ok().as_ref()),
            posterior: estimate.as_ref().and_then(|facts| posterior(&facts.estimate, name)),
        };
        let tissues = scenario.materials.keys().map(tissue).collect();
        let mut notes = vec![format!("{} nodes, {} tetrahedra", mesh.nodes_mm().len(), mesh.tets().len())];
        notes.push("loads act on the undeformed shape, as in scenarios".to_owned());
        notes.extend(of_estimate);
        let mesh_sha256 = sum(&mesh);
        Self { name, mesh, scenario, tissues, sights, notes, mesh_sha256 }
    }
}

fn spread(prior: Option<&LogPrior>) -> Option<Spread> {
    let prior = prior?;
    Some(Spread { log_mean: prior.mean, log_sd: prior.sd? })
}

/// What the estimate says of a tissue, or of the whole brain, where it claims an interval that is a Gaussian's: a bound is none, an
/// average over models has several humps, and what nothing holds has no ends.
fn posterior(estimate: &EstimateOutcome, tissue: &str) -> Option<Spread> {
    let posterior = &estimate.posterior;
    let of = |name: &str| posterior.names.iter().position(|n| *n == format!("shear_modulus_pa of {name}"));
    let whole = || of("brain").filter(|_| ["grey_matter", "white_matter"].contains(&tissue));
    let (name, n) = of(tissue).map(|n| (tissue, n)).or_else(|| Some(("brain", whole()?)))?;
    let (_, claim) = estimate.verdict.moduli.iter().find(|(of, _)| of == name)?;
    let known = posterior.identifiability.verdicts.get(n)?;
    let gaussian = !matches!(known, Knowledge::Averaged | Knowledge::NotIdentifiable | Knowledge::Withheld);
    let spread = Spread { log_mean: posterior.mode[n].ln(), log_sd: posterior.log_sd[n] };
    (matches!(claim, Claim::Interval { .. }) && gaussian && spread.log_sd.is_finite()).then_some(spread)
}

/// SHA-256 of what makes a mesh.
fn sum(mesh: &TetMesh) -> String {
    let mut bytes: Vec<u8> = mesh.nodes_mm().as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend(mesh.tets().as_flattened().iter().flat_map(|n| n.to_le_bytes()));
    bytes.extend_from_slice(mesh.labels());
    sha256_hex(&bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// An estimate of one modulus, 1000 Pa with a standard deviation of ln of 0.2, of which this is claimed.
    fn estimate(tissue: &str, claim: &serde_json::Value, known: &str) -> EstimateOutcome {
        let value = json!({
            "posterior": {
                "names": [format!("shear_modulus_pa of {tissue}")],
                "mode": [1000.0],
                "log_sd": [0.2],
                "interval_95": [[676.0, 1480.0]],
                "log_covariance": [[0.04]],
                "identifiability": {
                    "verdicts": [known],
                    "sensitivity_correlation": [[1.0]],
                    "condition": 1.0,
                    "valley": [1.0],
                    "valley_log_sd": 0.2,
                },
            },
            "prior": [],
            "observations": 300,
            "independent_observations": 100.0,
            "noise_mm": 0.1,
            "residual_rms_mm": 0.1,
            "convergence": "step-below-tolerance",
            "solves": 5,
            "tangent_solves": 8,
            "limits": [],
            "verdict": { "finding": "identified", "sentence": "", "moduli": [[tissue, claim]] },
        });
        serde_json::from_value(value).unwrap()
    }

    #[test]
    fn a_posterior_is_shown_only_where_an_interval_of_one_gaussian_is_claimed() {
        let interval = json!({ "kind": "interval", "mode_pa": 1000.0, "interval_95_pa": [676.0, 1480.0] });
        let of = |claim: &serde_json::Value, known| posterior(&estimate("grey_matter", claim, known), "grey_matter");
        let own = Some(Spread { log_mean: 1000f64.ln(), log_sd: 0.2 });
        for known in ["identified", "prior-dominated", "widened"] {
            assert_eq!(of(&interval, known), own, "{known}");
        }
        for known in ["averaged", "not-identifiable", "withheld"] {
            assert_eq!(of(&interval, known), None, "{known}");
        }
        for claim in [json!({ "kind": "above", "bound_pa": 4000.0 }), json!({ "kind": "withheld" })] {
            assert_eq!(of(&claim, "identified"), None, "{claim}");
        }
        let mut endless = estimate("grey_matter", &interval, "identified");
        endless.posterior.log_sd = vec![f64::INFINITY];
        assert_eq!(posterior(&endless, "grey_matter"), None);
    }

    #[test]
    fn what_is_claimed_of_the_brain_is_said_of_grey_and_white_matter_alone() {
        let interval = json!({ "kind": "interval", "mode_pa": 1000.0, "interval_95_pa": [676.0, 1480.0] });
        let brain = estimate("brain", &interval, "identified");
        assert!(["grey_matter", "white_matter", "brain"].iter().all(|tissue| posterior(&brain, tissue).is_some()));
        assert!(["falx", "resected"].iter().all(|tissue| posterior(&brain, tissue).is_none()));
    }
}
