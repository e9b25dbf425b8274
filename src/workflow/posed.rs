//! A body as a case, or a mesh in a file, poses it: what a session that is stepped by hand starts from.

use super::case::Case;
use super::error::{AskedError, CaseError, SimulationError, WorkflowError};
use super::facts::EstimateFacts;
use super::progress::Progress;
use super::settings::{Settings, in_words};
use super::sights::Sights;
use super::simulation::{called_otherwise, mesh_in};
use super::stage_name::Subject;
use super::stages::{self, HeldBody};
use super::user_file::{read_input, read_text, shown};
use super::work::{Place, Work};
use crate::anatomy::label;
use crate::experiment::compare::Comparison;
use crate::experiment::parameter_name::in_words as called;
use crate::experiment::predict::Head;
use crate::experiment::prior::{PriorSettings, held_material};
use crate::experiment::resection::{ResectionSettings, Supports};
use crate::experiment::verdict::{Finding, Verdict};
use crate::fem::Scenario;
use crate::material::law::Material;
use crate::mesh::TetMesh;
use nalgebra::UnitQuaternion;
use std::path::{Path, PathBuf};

/// Node sets that hold a mesh that comes without a scenario, where it has them.
const HOLDING: [&str; 3] = ["base", "falx", "fixed"];

/// Tissues that a case of one tissue takes for one.
const OF_BRAIN: [&str; 2] = ["grey_matter", "white_matter"];

/// Mesh and scenario with all its materials, and the case's estimate where it has one.
#[derive(Clone, Debug)]
pub struct Posed {
    /// The last part of its path.
    pub name: String,
    /// The undeformed mesh.
    pub mesh: TetMesh,
    /// Materials, loads, supports, solver.
    pub scenario: Scenario,
    /// Modes and intervals of the moduli.
    pub estimate: Option<EstimateFacts>,
    /// What is to be seen beside it.
    pub sights: Sights,
    /// Where the body is not as the case's estimate has it, a sentence each.
    pub notes: Vec<String>,
}

/// Whether a case's body has the tissue that was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resection {
    /// It is out: the case's own mesh.
    Done,
    /// It is still in, under a label of its own: a mesh made for the purpose, with other nodes than the case's.
    Undone,
}

/// What a body is taken from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BodySource {
    /// The folder of a case, with or without the tissue that was taken.
    Case(Resection),
    /// A mesh in a file, with the scenario in another.
    Mesh(Option<PathBuf>),
}

impl BodySource {
    /// What lies at a path: a folder is a case, a file is a mesh.
    ///
    /// # Errors
    /// A scenario beside a case, which brings its own; tissue to be put back into a mesh, which a case alone knows.
    pub fn at(path: &Path, scenario: Option<PathBuf>, resection: Resection) -> Result<Self, WorkflowError> {
        if path.is_dir() {
            return match scenario {
                None => Ok(Self::Case(resection)),
                Some(_) => Err(AskedError::ScenarioOfCase { folder: path.to_path_buf() }.into()),
            };
        }
        match resection {
            Resection::Done => Ok(Self::Mesh(scenario)),
            Resection::Undone => Err(AskedError::MeshBeforeResection { mesh: path.to_path_buf() }.into()),
        }
    }
}

/// The body of a case: its mesh, held at base and falx, under the loads of its settings; materials are those of an
/// estimate that claims a stiffness, else the means of the prior. Estimates of bodies that slide are posed at the fixed base, too;
/// what is not as the estimate has it stands in the notes.
///
/// # Errors
/// A folder that is no case, and files that are missing or damaged; a resection to be undone where there was none, and what the
/// mesh engine refuses.
pub fn posed_case(
    place: &Place,
    settings: &Settings,
    resection: Resection,
    progress: &mut dyn Progress,
) -> Result<Posed, WorkflowError> {
    let folder = place.folder.as_path();
    let case = Case::open(folder)?;
    let mesh = match resection {
        Resection::Done => case.mesh()?,
        Resection::Undone if case.subject() == Some(Subject::Patient) => {
            let work = Work::new(place, Subject::Patient, settings, progress);
            stages::mesh_before_resection(&work, &stages::Anatomy::read(&case)?)?
        }
        Resection::Undone => return Err(CaseError::NothingResected { folder: folder.to_path_buf() }.into()),
    };
    if resection == Resection::Undone && !mesh.labels().contains(&label::RESECTED) {
        return Err(CaseError::NothingResected { folder: folder.to_path_buf() }.into());
    }
    // Only where the case has one: without it the prior's means stand.
    let estimate = case.present_estimate()?;
    let subject = case.subject();
    let none = || CaseError::NotACase { folder: folder.to_path_buf() };
    let (mut scenario, ratio) = match subject.ok_or_else(none)? {
        Subject::Phantom { .. } => (settings.phantom.scenario(), settings.phantom.poisson_ratio),
        Subject::Patient => {
            let mut own = ResectionSettings { supports: Supports::Fixed, ..settings.resection.clone() };
            // Moduli that were found in fluid of unknown level belong to the level found with them.
            if let Some(fluid) = estimate.as_ref().and_then(|facts| facts.estimate.fluid.as_ref()) {
                own = own.in_fluid();
                own.csf.iter_mut().for_each(|csf| csf.drained = fluid.drained);
            }
            let mut scenario = own.scenario(&stages::mni_from_gravity_frame(&case, own.gravity_frame)?);
            if own.needs_labels() {
                scenario = own.supported(&scenario, &stages::Anatomy::read(&case)?.before)?;
            }
            (scenario, own.poisson_ratio)
        }
        Subject::Plan => {
            // The way to lie that comes first, in the fluid that its draws are around; its gravity is in the mesh's frame already.
            let head = settings.predict.heads.first().copied().unwrap_or(Head::Supine);
            let gravity = head.gravity_m_per_s2(&stages::mni_from_pre(&case)?);
            let labels = stages::PlannedHead::read(&case)?.before;
            let (own, scenario) = stages::planned_body(settings, gravity, Supports::Fixed, &labels)?;
            (scenario, own.poisson_ratio)
        }
    };
    add_materials(&mesh, &mut scenario, ratio, &settings.prior)?;
    // What is withheld, or only bounded, is no answer to open a body on.
    let claimed = estimate.as_ref().filter(|facts| facts.estimate.verdict.finding.has_stiffness());
    if let Some(facts) = claimed {
        for (tissue, &pa) in &facts.record.shear_modulus_pa {
            let of_tissue = |name: &str| name == tissue || (tissue == "brain" && OF_BRAIN.contains(&name));
            for (_, material) in scenario.materials.iter_mut().filter(|(name, _)| of_tissue(name)) {
                *material = Material::neo_hookean(pa, ratio);
            }
        }
    }
    let mut sights = Sights::of(&case, &mesh)?;
    if claimed.is_none() {
        // Of an estimate that another job has left, or of moduli that the body does not have.
        sights.estimate_sd_mm = None;
    }
    let supports = (subject == Some(Subject::Patient)).then_some(settings.resection.supports);
    let notes = estimate.as_ref().map_or_else(Vec::new, |facts| {
        let mut notes = notes(&facts.estimate.verdict, facts.comparison.as_ref(), supports.unwrap_or(Supports::Fixed));
        notes.extend(claimed.and_then(|facts| not_taken_over(&facts.estimate.posterior.names)));
        notes
    });
    Ok(Posed { name: shown(folder), mesh, scenario, estimate, sights, notes })
}

/// What an estimate of these parameters has found that a body is not posed with.
fn not_taken_over(parameters: &[String]) -> Option<String> {
    // Of the supports a note of its own tells; fluid is taken over.
    let taken = ["shear_modulus_pa", "gap_mm", "part of the fluid"];
    let own: Vec<String> = parameters
        .iter()
        .filter(|name| !taken.iter().any(|t| name.starts_with(t)))
        .map(|name| called(name).0)
        .collect();
    (!own.is_empty()).then(|| {
        format!(
            "the estimate has its own {}: here loads are those of the settings, and laws neo-Hookean",
            own.join(", ")
        )
    })
}

/// What of a body is not as the estimate with this verdict has it; `supports` are those it was asked for.
fn notes(verdict: &Verdict, compared: Option<&Comparison>, supports: Supports) -> Vec<String> {
    let finding = verdict.finding;
    if !finding.has_stiffness() {
        let why = finding.short();
        return vec![format!("the case's estimate is withheld ({why}): moduli are the prior's means")];
    }
    let averaged = finding == Finding::CannotTell;
    let slides = compared.map_or(supports == Supports::Sliding, |compared| {
        // An average has something of every model that it is over.
        let models = if averaged { usize::MAX } else { 1 };
        compared.averaged().take(models).any(|model| HeldBody::slides(&model.name))
    });
    let average = "moduli are an average over models that cannot be told apart: no curve is drawn of it";
    let held = "the case's estimate slides along the skull, or some of its models do; here the base is held";
    let notes = [averaged.then_some(average), slides.then_some(held)];
    notes.into_iter().flatten().map(str::to_owned).collect()
}

/// The body of a mesh in a file, by the scenario in another; without one every tissue is the mean of its prior under the
/// effective weight of the settings, held by the sets base and falx.
///
/// # Errors
/// [`SimulationError`] for files that do not fit.
pub fn posed_mesh(file: &Path, scenario: Option<&Path>, settings: &Settings) -> Result<Posed, WorkflowError> {
    let bytes = read_input(file)?;
    let mesh = mesh_in(file, &bytes)?;
    let scenario = if let Some(path) = scenario {
        let name = path.display().to_string();
        let refused =
            |e: crate::fem::ScenarioError| SimulationError::Scenario { name, reason: in_words(&e.to_string()) };
        Scenario::from_toml(&read_text(path)?).map_err(refused)?
    } else {
        let own = ResectionSettings { supports: Supports::Fixed, ..settings.resection.clone() };
        let mut scenario = own.scenario(&UnitQuaternion::identity());
        scenario.fixed =
            HOLDING.into_iter().filter(|set| mesh.node_sets.contains_key(*set)).map(str::to_owned).collect();
        add_materials(&mesh, &mut scenario, own.poisson_ratio, &settings.prior)?;
        scenario
    };
    let notes = called_otherwise(file, &bytes, &mesh, &scenario).iter().map(ToString::to_string).collect();
    Ok(Posed { name: shown(file), mesh, scenario, estimate: None, sights: Sights::default(), notes })
}

/// The mean of the prior for every tissue of the mesh that the scenario has no material for.
fn add_materials(
    mesh: &TetMesh,
    scenario: &mut Scenario,
    poisson_ratio: f64,
    prior: &PriorSettings,
) -> Result<(), WorkflowError> {
    let mut labels = mesh.labels().to_vec();
    labels.sort_unstable();
    labels.dedup();
    for (label, name) in labels.into_iter().filter_map(|l| Some((l, label::name(l)?))) {
        if !scenario.materials.contains_key(name) {
            // What tissue the resected part was, its label does not say.
            let of = if label == label::RESECTED { "brain" } else { name };
            scenario.materials.insert(name.to_owned(), held_material(of, poisson_ratio, prior)?.material);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::compare::Candidate;

    #[test]
    fn a_body_says_where_it_is_not_as_the_estimate_has_it() {
        let verdict = |finding| Verdict { finding, ..Verdict::default() };
        let model = |name: &str| Candidate {
            name: name.to_owned(),
            log_evidence: 0.0,
            weight: 0.5,
            finding: Finding::Identified,
            explained_share: 0.9,
            moduli_pa: Vec::new(),
        };
        let of = |finding, models: &[&str], supports| {
            let candidates: Vec<Candidate> = models.iter().map(|name| model(name)).collect();
            let comparison = Comparison { candidates, log_odds: Some(1.0), verdict: verdict(finding) };
            notes(&verdict(finding), (!models.is_empty()).then_some(&comparison), supports).join("; ")
        };
        let both = ["supports fixed", "supports sliding, fluid of unknown level"];
        let turned = [both[1], both[0]];
        for finding in [Finding::NoShift, Finding::Unexplained, Finding::Conflict] {
            let said = of(finding, &turned, Supports::Evidence);
            assert!(said.contains(finding.short()) && said.contains("prior's means"), "{said}");
        }
        assert_eq!(of(Finding::Identified, &both, Supports::Evidence), "");
        assert!(of(Finding::Identified, &turned, Supports::Evidence).contains("slides"));
        assert!(of(Finding::Widened, &[], Supports::Sliding).contains("slides"));
        assert_eq!(of(Finding::Widened, &[], Supports::Fixed), "");
        let said = of(Finding::CannotTell, &both, Supports::Evidence);
        assert!(said.contains("average") && said.contains("slides"), "an average has something of both: {said}");
        assert!(!of(Finding::CannotTell, &["supports fixed"], Supports::Evidence).contains("slides"));
        let ruled_out = Candidate { log_evidence: -9.0, ..model(both[1]) };
        let candidates = vec![model(both[0]), model("supports fixed, fluid of unknown level"), ruled_out];
        let verdict = verdict(Finding::CannotTell);
        let comparison = Comparison { candidates, log_odds: Some(0.0), verdict: verdict.clone() };
        let said = notes(&verdict, Some(&comparison), Supports::Evidence).join("; ");
        assert!(said.contains("average") && !said.contains("slides"), "not of one that is ruled out: {said}");
    }

    #[test]
    fn what_an_estimate_has_beside_moduli_is_named() {
        let of = |names: &[&str]| not_taken_over(&names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>());
        assert_eq!(of(&["shear_modulus_pa of brain", "gap_mm between cortex and skull"]), None);
        let said = of(&["shear_modulus_pa of brain", "effective density_kg_per_m3"]).unwrap();
        assert!(said.contains("its own effective density") && !said.contains("shear"), "{said}");
    }

    #[test]
    fn a_mesh_whose_volumes_are_called_otherwise_than_they_are_taken_says_so() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let nodes = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3]], vec![label::GREY_MATTER]).unwrap();
        let text = String::from_utf8(crate::mesh::format::msh::encode(&mesh).unwrap()).unwrap();
        std::fs::write(at("right.msh"), &text).unwrap();
        std::fs::write(at("wrong.msh"), text.replace("\"grey_matter\"", "\"white_matter\"")).unwrap();
        let material = "law = 'neo-hookean'\nshear_modulus_pa = 1370.0\npoisson_ratio = 0.45\n";
        std::fs::write(at("s.toml"), format!("fixed = ['base']\n[materials.grey_matter]\n{material}")).unwrap();
        let notes = |mesh: &str| posed_mesh(&at(mesh), Some(&at("s.toml")), &Settings::default()).unwrap().notes;
        assert_eq!(notes("right.msh"), [""; 0]);
        let said = notes("wrong.msh").join("; ");
        assert!(said.contains("called `white_matter`") && said.contains("taken for `grey_matter`"), "{said}");
    }

    #[test]
    fn a_folder_is_a_case_a_file_a_mesh_and_neither_takes_what_is_the_others() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = folder.path().join("brain.vtu");
        let scenario = || Some(PathBuf::from("s.toml"));
        let at = |path: &Path, scenario, resection| BodySource::at(path, scenario, resection);
        for resection in [Resection::Done, Resection::Undone] {
            assert_eq!(at(folder.path(), None, resection).unwrap(), BodySource::Case(resection));
            let refused = at(folder.path(), scenario(), resection).unwrap_err();
            assert!(matches!(refused, WorkflowError::Asked(AskedError::ScenarioOfCase { .. })), "{refused}");
        }
        assert_eq!(at(&mesh, scenario(), Resection::Done).unwrap(), BodySource::Mesh(scenario()));
        assert_eq!(at(&mesh, None, Resection::Done).unwrap(), BodySource::Mesh(None));
        let refused = at(&mesh, None, Resection::Undone).unwrap_err().to_string();
        assert!(refused.contains("brain.vtu") && refused.contains("label 5"), "{refused}");
    }
}
