//! A patient's body as one way of holding it poses it, and what an estimate does not know of its loads.

use crate::experiment::estimate::{FluidLevels, LogPrior, Turn, Unknown, prior_of_drained};
use crate::experiment::resection::{ResectionSettings, Supports};
use crate::experiment::stuck_cortex::{with_stuck_cortex, with_stuck_set};
use crate::experiment::sweep::Reference;
use crate::experiment::verdict::Finding;
use crate::fem::{Loads, Scenario};
use crate::mesh::TetMesh;
use crate::workflow::estimate_options::EstimateOptions;
use crate::workflow::loads_in_words::loads_in_words;
use std::sync::Arc;

impl EstimateOptions {
    /// The loads that are estimated, with what is known of them beforehand.
    pub(super) fn unknown_loads(&self, loads: &Loads) -> Vec<(Unknown, LogPrior)> {
        let mut unknowns = Vec::new();
        let mut add = |unknown: Unknown, mean: f64, sd: f64| {
            let prior = unknown.prior(mean, sd);
            unknowns.push((unknown, prior));
        };
        // Beside a fluid the density is the tissue's own, which is known.
        if self.density && loads.csf.is_none() {
            add(Unknown::Density, loads.density_kg_per_m3.ln(), self.density_log_sd);
        }
        if self.gravity_direction {
            for turn in [Turn::Nodding, Turn::Rolling] {
                add(Unknown::GravityTurn(turn), 0.0, self.gravity_direction_sd_deg.to_radians());
            }
        }
        if self.pressure {
            for (n, load) in loads.pressure.iter().enumerate() {
                add(Unknown::Pressure(n), load.pressure_pa.abs().ln(), self.pressure_log_sd);
            }
        }
        unknowns
    }
}

/// A body as one way of holding it poses it.
pub(crate) struct HeldBody {
    /// What holds it; none of a phantom.
    pub settings: Option<ResectionSettings>,
    /// Loads, supports, solver.
    pub scenario: Scenario,
    /// The undeformed mesh, with the sets that slide; the nodes of the case's mesh come first.
    pub mesh: TetMesh,
    /// What its state is compared with.
    pub reference: Reference,
    /// The levels of the fluid around it, where nobody knows how much has drained.
    pub levels: Option<Arc<FluidLevels>>,
}

impl HeldBody {
    /// The part of the fluid that has drained, where nobody knows it.
    pub(super) fn unknown_fluid(&self, options: &EstimateOptions) -> Option<(Unknown, LogPrior)> {
        let unknown = Unknown::Drained(self.levels.clone()?);
        let drained = self.settings.as_ref()?.csf.as_ref()?.drained;
        let prior = prior_of_drained(&unknown, drained, options.drained_log_sd);
        Some((unknown, prior))
    }

    /// The room between cortex and skull, which no scan shows well enough to be given, where the body slides.
    pub(super) fn unknown_room(&self) -> Option<(Unknown, LogPrior)> {
        let skull = &self.settings.as_ref().filter(|s| s.supports == Supports::Sliding)?.skull;
        (skull.gap_mm > 0.0 && skull.gap_log_sd > 0.0).then(|| {
            let unknown = Unknown::Gap(0);
            let prior = unknown.prior(skull.gap_mm.ln(), skull.gap_log_sd);
            (unknown, prior)
        })
    }

    /// Standard deviation of ln(modulus) that its labels and supports add.
    pub(super) fn log_sd(&self, options: &EstimateOptions) -> f64 {
        let slides = self.settings.as_ref().is_some_and(|s| s.supports == Supports::Sliding);
        if slides { options.wall_log_sd } else { options.labels_log_sd }
    }

    /// The same body with its cortex stuck to the skull where it faces down.
    pub fn stuck(&self) -> Self {
        Self {
            settings: self.settings.clone(),
            mesh: self.stuck_mesh(self.mesh.clone()),
            reference: self.reference.clone(),
            levels: self.levels.clone(),
            scenario: with_stuck_cortex(&self.scenario),
        }
    }

    /// A mesh of it with what sticks to the skull then.
    pub(super) fn stuck_mesh(&self, mesh: TetMesh) -> TetMesh {
        let skull = self.settings.as_ref().map(|s| s.skull.clone()).unwrap_or_default();
        with_stuck_set(mesh, &skull, self.scenario.loads.gravity_m_per_s2)
    }

    /// What it assumes, in words.
    pub fn name(&self) -> String {
        let Some(settings) = &self.settings else { return String::new() };
        let fluid = match (&self.levels, &settings.csf) {
            (Some(_), _) => ", fluid of unknown level".to_owned(),
            (None, Some(csf)) => format!(", {:.0} % of the fluid drained", 100.0 * csf.drained),
            (None, None) => String::new(),
        };
        format!("supports {}{fluid}", settings.supports.name())
    }

    /// Its loads and supports in words, and what of them a verdict of this finding leaves open; none of a phantom.
    pub(super) fn loads_in_words(&self, options: &EstimateOptions, finding: Finding) -> Option<String> {
        let settings = self.settings.as_ref()?;
        let unknown = options.unknown_loads(&self.scenario.loads).into_iter();
        let unknown = unknown.chain(self.unknown_room()).chain(self.unknown_fluid(options));
        let open: Vec<Unknown> = unknown.map(|(unknown, _)| unknown).collect();
        // Of what has not moved nothing is estimated: a bound leaves room for what was not known.
        let how = if finding == Finding::NoShift { "not taken as known" } else { "estimated along" };
        Some(loads_in_words(settings, &self.scenario, (&open, how)))
    }

    /// Whether a body of this name ([`Self::name`]) slides.
    pub fn slides(name: &str) -> bool {
        name.starts_with(&format!("supports {}", Supports::Sliding.name()))
    }
}
