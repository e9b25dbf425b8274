//! What an estimate reports: the numbers, and the state behind them.

use super::evidence::Unexplained;
use super::findings::{Odds, Shift};
use super::fluid::FluidOutcome;
use super::re_registration::MovedNode;
use super::shape::{EdgeAmounts, FalxAmounts, OutlineAmounts};
use super::{Convergence, LogPrior, Posterior, Process};
use crate::experiment::reach::reach_95;
use crate::experiment::ventricles::VentricleChange;
use crate::experiment::verdict::Verdict;
use crate::fem::Outcome;
use crate::material::law::Material;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Array of a state: what the images showed of a node, the registration's own error taken out, mm; zero elsewhere.
pub const SEEN_DISPLACEMENT: &str = "seen_displacement";
/// Array of a state: the nodes that the estimate was held against.
pub const SEEN_AT: &str = "seen";

/// The estimate as tables, JSON and the page show it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EstimateOutcome {
    /// Modes, intervals, identifiability.
    pub posterior: Posterior,
    /// What was known before.
    pub prior: Vec<LogPrior>,
    /// Patients of the cohort that the prior was learnt from; absent where it is the literature's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub taught_by: Option<usize>,
    /// How much of the fluid has drained, where that was estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fluid: Option<FluidOutcome>,
    /// The ventricles' change in the model and on the scans; absent where no stiffness is claimed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ventricles: Option<VentricleChange>,
    /// Largest standard deviation of ln(modulus) that the mesh itself adds to the intervals.
    #[serde(default)]
    pub model_log_sd: f64,
    /// The same per parameter, in their order, where a coarser mesh was there to find it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub mesh_log_sd: Vec<f64>,
    /// Standard deviation of ln(modulus) that labels and supports of the body add to the intervals.
    #[serde(default)]
    pub body_log_sd: f64,
    /// Observations (nodes of the observed sets, or components of displacements).
    pub observations: usize,
    /// How many of them count as independent.
    pub independent_observations: f64,
    /// Standard deviation of one observation, mm: the measurement's, or the misfit's where that is larger; where no shift was seen
    /// the measurement's.
    pub noise_mm: f64,
    /// Root mean square of the residuals at the estimate, mm; where no shift was seen, at rest.
    pub residual_rms_mm: f64,
    /// Root mean square of the measurement's own error that was taken out of one observation, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub taken_out_rms_mm: Option<f64>,
    /// What rigid registration follows of the estimate's own state, MNI: rows of the matrix from where that state carries a point
    /// (x, y, z, 1; mm) to where the scans, brought onto each other, show it. The identity where it follows nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rigid_taken_up: Option<[[f64; 4]; 4]>,
    /// How the descent ended.
    pub convergence: Convergence,
    /// Equilibria solved.
    pub solves: usize,
    /// Linear solves for sensitivities.
    pub tangent_solves: usize,
    /// What limits the estimate, in sentences.
    pub limits: Vec<String>,
    /// What it comes down to.
    #[serde(default)]
    pub verdict: Verdict,
    /// Noise of the measurement and discrepancy of the model, where errors are alike over a distance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unexplained: Option<Unexplained>,
    /// What the residual is held against: the measurement's noise, or what is left of it without the instrument's own error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured_noise: Option<Process>,
    /// How probable the model is beside simpler explanations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub odds: Option<Odds>,
    /// Whether anything has moved, and what would have been seen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shift: Option<Shift>,
    /// Root mean square of the rigid registration's remainder over the observed nodes, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rigid_remainder_mm: Option<f64>,
    /// How much farther out than segmented the brain's outline most probably is, mm: everywhere, and on top of that at the right,
    /// front and upper end (as much less at the other ends).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outline_mm: Option<OutlineAmounts>,
    /// How much farther to the right than meshed the falx most probably is, mm: everywhere, and on top of that at the front and
    /// upper end (as much less at the other ends).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub falx_mm: Option<FalxAmounts>,
    /// How much deeper than meshed the free edge of the falx most probably lies, mm: everywhere, and on top of that at the front
    /// (as much less at the back).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub falx_edge_mm: Option<EdgeAmounts>,
    /// How much farther up than tagged the base most probably holds, mm, likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base_edge_mm: Option<EdgeAmounts>,
}

/// The estimate with the state behind it and how sure that state is.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// The numbers.
    pub outcome: EstimateOutcome,
    /// Displacement, Jacobian and energy at the mode.
    pub state: Outcome,
    /// Standard deviation of the displacement at every node, mm (root of the trace of its covariance).
    pub displacement_sd_mm: Vec<f64>,
    /// The 95 % bound of how far every node moves: |mean| + 1.96 sd along the mean, mm.
    pub displacement_95_mm: Vec<f64>,
    /// Nodes held against the model, with what was seen of them, the instrument's own error taken out (mm); none where
    /// surfaces are.
    pub seen: Vec<MovedNode>,
    /// The tissues' materials at the mode, by tissue.
    pub materials: BTreeMap<String, Material>,
    /// The unknowns' numbers at the mode, as [`super::Problem::start`] takes them.
    pub numbers: Vec<f64>,
}

impl Estimate {
    /// The state of what has not been seen to move: at rest, as sure as the measurement is of that. That of the mode, a body
    /// which the prior made, would be a shift that nobody saw.
    #[must_use]
    pub fn at_rest(mut self) -> Self {
        let reach_mm = self.outcome.shift.map_or(0.0, |shift| shift.would_be_seen_mm);
        self.state.displacement_mm.fill([0.0; 3]);
        self.state.reaction_n.fill([0.0; 3]);
        self.state.jacobian.fill(1.0);
        self.state.strain_energy_density_pa.fill(0.0);
        self.state.contact.clear();
        self.state.contact_pressure_pa.clear();
        self.state.tethers.clear();
        self.state.warnings.clear();
        // The standard deviation with which a size around rest reaches so far.
        self.displacement_sd_mm.fill(reach_mm / reach_95(0.0, 1.0));
        self.displacement_95_mm.fill(reach_mm);
        self
    }
}
