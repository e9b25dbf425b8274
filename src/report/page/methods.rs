//! The methods paragraph, what to cite, and BibTeX.

use super::super::html::{count, number};
use super::results::tissue_name;
use crate::experiment::estimate::EstimateOutcome;
use crate::experiment::outcome::{ESTIMATE, ExperimentKind, ExperimentOutcome, SampleOutcome};
use crate::experiment::parameter_name::in_words;
use crate::experiment::predict::{Cause, DrawsSolved, Prediction, UnknownOutcome};
use crate::experiment::verdict::{Claim, Finding};
use crate::geometry::{Frame, Pre};
use maud::{Markup, html};

/// A work to cite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reference {
    /// Key in BibTeX.
    pub key: &'static str,
    /// The citation as text.
    pub text: &'static str,
    /// The BibTeX entry.
    pub bibtex: &'static str,
}

const GENERATIVE_MODEL: Reference = Reference {
    key: "Granados2021",
    text: "A. Granados, F. Pérez-García, M. Schweiger, V. Vakharia, S. B. Vos, A. Miserocchi, A. W. McEvoy, J. S. Duncan, \
           R. Sparks, S. Ourselin. A generative model of hyperelastic strain energy density functions for multiple tissue \
           brain deformation. International Journal of Computer Assisted Radiology and Surgery 16, 141–150, 2021. \
           doi:10.1007/s11548-020-02284-y",
    bibtex: "@article{Granados2021,\n  author  = {Granados, Alejandro and P{\\'e}rez-Garc{\\'i}a, Fernando and Schweiger, Martin and \
             Vakharia, Vejay and Vos, Sjoerd B. and Miserocchi, Anna and McEvoy, Andrew W. and Duncan, John S. and \
             Sparks, Rachel and Ourselin, S{\\'e}bastien},\n  title   = {A generative model of hyperelastic strain energy \
             density functions for multiple tissue brain deformation},\n  journal = {International Journal of Computer \
             Assisted Radiology and Surgery},\n  volume  = {16},\n  pages   = {141--150},\n  year    = {2021},\n  doi     = \
             {10.1007/s11548-020-02284-y}\n}",
};

const MUTUAL_INFORMATION: Reference = Reference {
    key: "Mattes2003",
    text: "D. Mattes, D. R. Haynor, H. Vesselle, T. K. Lewellen, W. Eubank. PET-CT image registration in the chest using \
           free-form deformations. IEEE Transactions on Medical Imaging 22, 120–128, 2003. doi:10.1109/TMI.2003.809072",
    bibtex: "@article{Mattes2003,\n  author  = {Mattes, David and Haynor, David R. and Vesselle, Hubert and Lewellen, Thomas K. \
             and Eubank, William},\n  title   = {{PET-CT} image registration in the chest using free-form \
             deformations},\n  journal = {IEEE Transactions on Medical Imaging},\n  volume  = {22},\n  number  = {1},\n  pages   = \
             {120--128},\n  year    = {2003},\n  doi     = {10.1109/TMI.2003.809072}\n}",
};

const TEMPLATE: Reference = Reference {
    key: "Fonov2011",
    text: "V. Fonov, A. C. Evans, K. Botteron, C. R. Almli, R. C. McKinstry, D. L. Collins, Brain Development Cooperative \
           Group. Unbiased average age-appropriate atlases for pediatric studies. NeuroImage 54, 313–327, 2011. \
           doi:10.1016/j.neuroimage.2010.07.033",
    bibtex: "@article{Fonov2011,\n  author  = {Fonov, Vladimir and Evans, Alan C. and Botteron, Kelly and Almli, C. Robert and \
             McKinstry, Robert C. and Collins, D. Louis and {Brain Development Cooperative Group}},\n  title   = {Unbiased \
             average age-appropriate atlases for pediatric studies},\n  journal = {NeuroImage},\n  volume  = {54},\n  number  = \
             {1},\n  pages   = {313--327},\n  year    = {2011},\n  doi     = {10.1016/j.neuroimage.2010.07.033}\n}",
};

const CGAL: Reference = Reference {
    key: "CGAL",
    text: "The CGAL Project. CGAL User and Reference Manual. CGAL Editorial Board. https://www.cgal.org",
    bibtex: "@manual{CGAL,\n  author = {{The CGAL Project}},\n  title  = {{CGAL} User and Reference Manual},\n  organization = \
             {{CGAL Editorial Board}},\n  url    = {https://www.cgal.org}\n}",
};

/// What a reader of this outcome should cite, in the order of the text: the works whose methods were used.
pub fn references(outcome: &ExperimentOutcome) -> Vec<Reference> {
    let mut all = vec![TEMPLATE];
    if outcome.registrations.iter().any(|registration| !registration.is_by_hand()) {
        all.push(MUTUAL_INFORMATION);
    }
    if outcome.mesh.as_ref().is_some_and(|m| m.engine == "cgal") {
        all.push(CGAL);
    }
    let predicted = outcome.kind == ExperimentKind::Prediction;
    if !outcome.samples.is_empty() || outcome.estimate.is_some() || predicted {
        all.push(GENERATIVE_MODEL);
    }
    all
}

/// The paragraph, what was found, the references and their BibTeX; of a prediction its numbers say how it was drawn.
pub fn section(outcome: &ExperimentOutcome, prediction: Option<&Prediction>) -> Markup {
    let references = references(outcome);
    let bibtex: Vec<&str> = references.iter().map(|r| r.bibtex).collect();
    html! {
        p { "Text that may be used as it stands:" }
        blockquote id="methods-text" {
            p { (paragraph(outcome, prediction)) }
            p { "Result. " (outcome.verdict.sentence) }
        } "\n"
        h3 { "References" }
        ol class="references" { @for r in &references { li id={ "ref-" (r.key) } { (r.text) } } }
        details {
            summary { "BibTeX" }
            pre tabindex="0" aria-label="BibTeX" { (bibtex.join("\n\n")) }
        } "\n"
    }
}

fn list(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// A mark that leads to a reference.
fn cite(references: &[Reference], wanted: Reference) -> Markup {
    let number = references.iter().position(|other| *other == wanted).map_or(0, |n| n + 1);
    html! { a href={ "#ref-" (wanted.key) } { "[" (number) "]" } }
}

/// Only what was done: a step that was not reached has no sentence.
fn paragraph(outcome: &ExperimentOutcome, prediction: Option<&Prediction>) -> Markup {
    let references = references(outcome);
    let cite = |wanted| cite(&references, wanted);
    let is_estimate = |s: &&SampleOutcome| outcome.estimate.is_some() && s.id == ESTIMATE;
    let swept = outcome.samples.iter().filter(|s| !is_estimate(s)).count();
    let simulated = swept > 0 || outcome.estimate.is_some();
    html! {
        "Processing was done with hgm " (env!("CARGO_PKG_VERSION")) ", research software"
        @match outcome.kind {
            ExperimentKind::Phantom => { ", on the MNI152NLin2009aSym template " (cite(TEMPLATE)) ". " },
            ExperimentKind::Prediction => {
                ". " (registered(outcome, &cite)) "The tissue of the plan was removed from the mesh. "
            },
            ExperimentKind::Resection => {
                ". " (registered(outcome, &cite))
                @if outcome.answer.is_some() { "No mesh was made and nothing was simulated. " }
            },
        }
        @if let Some(mesh) = &outcome.mesh {
            @if outcome.kind == ExperimentKind::Resection { "Resected tissue was removed from the mesh. " }
            "The brain was meshed with "
            @if mesh.engine == "cgal" { "CGAL " (cite(CGAL)) } @else { "the engine " (mesh.engine) " of hgm" }
            " into " (count(mesh.tets)) " tetrahedra and " (count(mesh.nodes)) " nodes. "
        }
        @if (simulated || outcome.kind == ExperimentKind::Prediction) && !outcome.loads.is_empty() {
            "Loads: " (list(&outcome.loads)) ". "
        }
        @if outcome.kind == ExperimentKind::Prediction {
            (of_draws(prediction, &cite(GENERATIVE_MODEL)))
        }
        @if swept > 0 { (of_samples(outcome, swept, &cite(GENERATIVE_MODEL))) }
        @if let Some(estimate) = &outcome.estimate { (of_estimate(outcome, estimate, &cite(GENERATIVE_MODEL))) }
        @if !outcome.held_shear_modulus_pa.is_empty() && (simulated || outcome.kind == ExperimentKind::Prediction) {
            "Held at the mean of the prior of abnormal tissue: "
            (list(&outcome.held_shear_modulus_pa.keys().map(|name| tissue_name(name)).collect::<Vec<_>>())) ". "
        }
    }
}

/// How the images came to lie on the template: registered, or by a transform that was given.
fn registered(outcome: &ExperimentOutcome, cite: &dyn Fn(Reference) -> Markup) -> Markup {
    let by_hand = outcome.registrations.iter().any(|r| r.moving == Pre::NAME && r.is_by_hand());
    let computed = outcome.registrations.iter().any(|r| !r.is_by_hand());
    let template = html! { "the MNI152NLin2009aSym template " (cite(TEMPLATE)) };
    html! {
        @match (outcome.kind == ExperimentKind::Resection, by_hand) {
            (true, false) => {
                "The images were registered rigidly, after surgery to before surgery and before surgery to " (template)
            },
            (true, true) => {
                "The pre-operative image was placed on " (template)
                " by a transform given by hand, and the post-operative one was registered rigidly to it"
            },
            (false, false) => { "The pre-operative image was registered rigidly to " (template) },
            (false, true) => { "The pre-operative image was placed on " (template) " by a transform given by hand" },
        }
        @if computed { ", maximising Mattes mutual information " (cite(MUTUAL_INFORMATION)) }
        ", so that sizes stay the patient's. "
    }
}

/// What was drawn, and what came of each draw; the model is of the stiffness.
fn of_draws(prediction: Option<&Prediction>, model: &Markup) -> Markup {
    let Some(found) = prediction else {
        return html! { "Unknowns were drawn by Halton's sequence from their priors " (model) ". " };
    };
    let prior = |u: &UnknownOutcome| {
        let (name, unit) = in_words(&u.name);
        let figures = [u.median, u.interval_95[0], u.interval_95[1]].map(|x| number(x, 3));
        let [middle, low, high] = figures;
        // A share and a ratio have none.
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        html! { (name) @if u.cause == Cause::Stiffness { " " (model) } ", " (middle) " (" (low) " to " (high) ")" (unit) }
    };
    let solved = found.heads.iter().map(|head| head.draws_solved).collect::<Option<Vec<DrawsSolved>>>();
    let solved = solved.map(|all| all.iter().fold((0, 0), |(solved, of), d| (solved + d.solved, of + d.of)));
    html! {
        "What is not known of the patient was drawn by Halton's sequence from its priors (middle, and 95 % between): "
        @for (n, unknown) in found.unknowns.iter().enumerate() { @if n > 0 { "; " } (prior(unknown)) }
        ". "
        @match solved {
            None | Some((_, 0)) => {},
            Some((solved, of)) if solved == of => {
                "Each of the " (count(of)) " draws was solved to its own static equilibrium. "
            },
            Some((0, of)) => {
                "The displacement of each of the " (count(of)) " draws was read from a response surface through static equilibria and their \
                 sensitivities. "
            },
            Some((solved, of)) => {
                "Of the " (count(of)) " draws " (count(solved)) " were solved to their own static equilibria; the displacement of the others was \
                 read from a response surface through static equilibria and their sensitivities. "
            },
        }
    }
}

fn tissues(outcome: &ExperimentOutcome) -> String {
    list(&outcome.tissues.iter().map(|name| tissue_name(name)).collect::<Vec<_>>())
}

/// The laws that were fitted to the prior.
fn laws(outcome: &ExperimentOutcome) -> String {
    let mut laws: Vec<String> = outcome.samples.iter().flat_map(|s| s.laws.values().map(|l| l.law.clone())).collect();
    laws.sort();
    laws.dedup();
    list(&laws)
}

fn of_samples(outcome: &ExperimentOutcome, samples: usize, model: &Markup) -> Markup {
    let laws = laws(outcome);
    let points = if samples == 1 { "point" } else { "points" };
    let failed = outcome.samples.iter().filter(|s| !s.converged).count();
    html! {
        @if !outcome.reference_shear_modulus_pa.is_empty() {
            "The reference is a simulation with known shear moduli: "
            (list(&outcome.reference_shear_modulus_pa.iter()
                .map(|(name, modulus)| format!("{} Pa for {}", number(*modulus, 4), tissue_name(name))).collect::<Vec<_>>()))
            ". "
        }
        "Material parameters of " (tissues(outcome)) " were sampled at " (samples) " " (points)
        " of a Gaussian-process model of the literature"
        @if !laws.is_empty() { " through " (laws) " meta-models" }
        " " (model) ". "
        @if failed > 0 { (failed) " of the simulations reached no equilibrium. " }
        "Each static equilibrium was compared with " (outcome.reference)
        " by the root mean square over nodes of the distance, RMSE = √(Σ|u − u" sub { "ref" } "|² / S). "
    }
}

fn of_estimate(outcome: &ExperimentOutcome, estimate: &EstimateOutcome, model: &Markup) -> Markup {
    let laws = laws(outcome);
    let of_person = estimate.prior.iter().any(|prior| prior.average.is_some());
    let prior = html! {
        @if let Some(patients) = estimate.taught_by { "a cohort of " (patients) " patients" }
        @else if of_person {
            "a study-level model of the curves collected by " (model) ", for a person nobody has measured"
        } @else { "a Gaussian-process model of the literature " (model) }
    };
    let still = estimate.verdict.finding == Finding::NoShift;
    html! {
        @if still { (without_shift(outcome, estimate, &prior)) } @else {
            "Shear moduli of " (tissues(outcome)) " were estimated by least squares with solver sensitivities from "
            (count(estimate.observations)) " observations, each known to " (number(estimate.noise_mm, 2)) " mm, under a prior from "
            (prior)
            @if !laws.is_empty() { ", with " (laws) " laws" }
            @if of_person && estimate.taught_by.is_none() { "; what one more study would report judged the result" }
            "; intervals are 95 % intervals of the posterior. "
        }
        @if estimate.taken_out_rms_mm.is_some() {
            "The registration's own error was measured on " @if still { "a state of the model" } @else { "the estimate's state" }
            " and taken out of what it saw. "
        }
        @if let Some(fluid) = &estimate.fluid {
            "How much of the fluid around the brain had drained was estimated along with the moduli, tissue above its level with its own \
             weight and buoyant below: " (fluid.sentence()) ". "
        }
        @if let Some(models) = &outcome.comparison {
            (models.candidates.len()) " models were held against each other by their evidence. "
        }
    }
}

/// Of what has not moved: no estimate, and what bounds the moduli where something does.
fn without_shift(outcome: &ExperimentOutcome, estimate: &EstimateOutcome, prior: &Markup) -> Markup {
    let above = |(tissue, claim): &(String, Claim)| matches!(claim, Claim::Above { .. }).then(|| tissue_name(tissue));
    let bounded: Vec<String> = estimate.verdict.moduli.iter().filter_map(above).collect();
    html! {
        "No shift was seen in " (count(estimate.observations)) " observations, each known to " (number(estimate.noise_mm, 2))
        " mm, and no shear modulus of " (tissues(outcome)) " was estimated. "
        @if bounded.is_empty() {
            "What is known of the moduli beforehand is from " (prior) ". "
        } @else {
            "What a body with the most probable moduli of " (prior) " would have done under these loads bounds the shear moduli of "
            (list(&bounded)) " from below, with 95 % certainty. "
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::posterior::tests::estimate;
    use super::*;

    #[test]
    fn without_a_shift_the_methods_tell_a_bound_and_no_estimate() {
        let told = |finding| {
            let tissues = vec!["grey_matter".to_owned(), "white_matter".to_owned()];
            let estimate = Some(estimate(finding, [0.3, 0.25]));
            paragraph(&ExperimentOutcome { tissues, estimate, ..ExperimentOutcome::default() }, None).into_string()
        };
        let still = told(Finding::NoShift);
        assert!(still.contains("No shift was seen in 300 observations, each known to 0.10 mm"), "{still}");
        assert!(still.contains("of grey matter and white matter from below, with 95 % certainty"), "{still}");
        assert!(!still.contains("were estimated") && !still.contains("posterior"), "{still}");
        let moved = told(Finding::Identified);
        assert!(moved.contains("were estimated by least squares") && !moved.contains("from below"), "{moved}");
    }
}
