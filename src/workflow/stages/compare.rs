//! Stage `compare`: models of one patient beside each other, by their evidence.

use super::estimate::{Bodies, EstimateInput};
use super::held_body::HeldBody;
use super::held_by::held_by;
use crate::artefact::Produced;
use crate::experiment::compare::{Comparison, compare as weigh};
use crate::experiment::prior::PriorSettings;
use crate::experiment::sample::Tissue;
use crate::geometry::{Frame, Mni};
use crate::layout::COMPARISON;
use crate::material::meta_model::MetaModel;
use crate::workflow::error::WorkflowError;
use crate::workflow::stage_name::StageName;
use crate::workflow::warning::Warning;
use crate::workflow::work::{Made, Work, facts};
use std::collections::BTreeMap;

/// Raised when the stage's code changes its result.
const VERSION: u32 = 17;
const NAME: StageName = StageName::Compare;
/// The laws of the family.
const LAWS: [MetaModel; 3] = [MetaModel::NEO_HOOKEAN, MetaModel::MOONEY_RIVLIN, MetaModel::OGDEN];

/// Estimates every model of the family on the same displacement (or skips it): supports, one or two tissues, each law; with what
/// carries the brain as given, and with the prior's law in fluid of unknown level as well.
pub(crate) fn compare(
    work: &Work<'_>,
    made: &mut Made,
    input: &EstimateInput<'_>,
) -> Result<Comparison, WorkflowError> {
    let (options, prior) = (&work.settings.estimate, &work.settings.prior);
    options.suits(&input.scenario.loads).map_err(WorkflowError::EstimateLoads)?;
    let posed = serde_json::json!({
        "scenario": input.scenario, "poisson_ratio": input.poisson_ratio, "noise_mm": input.noise_mm,
        "estimate": options, "prior": prior, "laws": LAWS, "held": held_by(work),
    });
    let stage = work.stage(made, &NAME, VERSION, &posed).input("mesh", input.mesh.1).frame(Mni::NAME);
    work.run(made, &NAME, &stage, || {
        let families = [(1, Tissue::whole_brain()), (2, Tissue::grey_and_white())];
        let bodies = Bodies::of(work, &EstimateInput { held: input.every_fluid.or(input.held), ..*input })?;
        let own = [if LAWS.contains(&prior.law) { prior.law } else { LAWS[0] }];
        // Crossed with every law the family would have twice as many models.
        let laws = |body: &HeldBody| if body.levels.is_some() { &own[..] } else { &LAWS[..] };
        let models: usize = bodies.list.iter().map(|body| families.len() * laws(body).len()).sum();
        work.tell(|p| p.begin("models", models));
        let (mut models, mut seen, mut left_out) = (Vec::new(), BTreeMap::new(), Vec::new());
        for (n, body) in bodies.list.iter().enumerate() {
            for (count, tissues) in &families {
                for &law in laws(body) {
                    let of = if *count == 1 { "brain" } else { "grey and white matter" };
                    let name = format!("{}, {} {of}", body.name(), law.name());
                    work.tell(|p| p.doing(&name));
                    // A population is of one law: models are held against each other under the literature's priors.
                    let prior = PriorSettings { law, population: None, ..prior.clone() };
                    match bodies.solved(work, input, n, tissues, &prior) {
                        Ok(found) => {
                            seen.insert(name.clone(), (tissues, prior, found.seen));
                            models.push((name, found.outcome));
                        }
                        // The others are still compared; what could not be solved is neither refuted nor borne out.
                        Err(error) => left_out.push((name, error.to_string())),
                    }
                    work.tell(|p| p.step());
                }
            }
        }
        work.tell(|p| p.end());
        let (mut comparison, _) = weigh(models).ok_or(WorkflowError::NoEvidence)?;
        if let Some((tissues, prior, seen)) = comparison.candidates.first().and_then(|best| seen.get(&best.name)) {
            comparison.verdict = bodies.bounded(work, input, (tissues.as_slice(), prior), seen, comparison.verdict)?;
        }
        comparison.verdict = comparison.verdict.beside_unsolved(left_out.iter().map(|(model, _)| model.clone()));
        let mut produced = Produced::default();
        produced.warn(left_out.into_iter().map(|(model, reason)| Warning::ModelLeftOut { model, reason }));
        let json = serde_json::to_string_pretty(&comparison).expect("figures are plain data") + "\n";
        produced.files.push((COMPARISON.to_owned(), json.into_bytes()));
        produced.facts = facts(&comparison);
        Ok(produced)
    })
}
