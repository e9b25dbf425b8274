//! How a prediction is made; the table `[predict]` of the settings.

use super::head::Head;
use super::known_level::KnownLevel;
use crate::experiment::resection::{CsfSettings, ResectionSettings, Supports, TISSUE_KG_PER_M3};
use crate::experiment::setting::{SettingError, first_broken};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a prediction is made; the table `[predict]` of the settings. What a patient's job has anyway (median of the effective
/// density, Poisson's ratio, supports, skull, law and studies of the prior, element) is taken from `[resection]`, `[prior]`
/// and `[estimate]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PredictSettings {
    /// How the head lies: supine, prone, left, right, sitting or the way down as `x,y,z` of the scanner. The first is the
    /// state `predicted`; the others are compared with it.
    pub heads: Vec<Head>,
    /// 1: the whole brain one material; 2: grey and white matter apart.
    pub tissues: usize,
    /// Draws from the priors, for each way of supporting the brain.
    pub draws: usize,
    /// Draws that are also solved whole, for each way of supporting the brain with the first head.
    pub checks: usize,
    /// What counts as a shift, mm: probabilities are those of moving more.
    pub threshold_mm: f64,
    /// Standard deviation of ln(effective density): the default spans 33 (all submerged) to 300 kg/m3 around 100.
    pub density_log_sd: f64,
    /// The part of the fluid that will have drained, from the top, where it can be told; then tissue has its own weight above
    /// the fluid's level and is buoyant below it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drained: Option<f64>,
    /// Standard deviation of ln(part drained): a factor of 1.5 to either side.
    pub drained_log_sd: f64,
    /// Density of the tissue itself, where `drained` is given.
    pub tissue_density_kg_per_m3: f64,
    /// Standard deviation of either angle between the head and how it is said to lie, degrees.
    pub direction_sd_deg: f64,
    /// How probable it is, against `sliding_weight`, that base and falx hold the brain. Before an operation nothing speaks for
    /// either.
    pub fixed_weight: f64,
    /// How probable it is that the brain slides on the skull.
    pub sliding_weight: f64,
    /// Draws Poisson's ratio as well, one for all tissue, with the shear moduli held: standard deviation of ln(lambda / mu)
    /// around that of `poisson_ratio` of `[resection]`, so that none lies outside 0 to 0.5. Around 0.45, 0.7 puts 95 % between 0.35, as
    /// tissue whose fluid may leave has been given (Kaczmarek et al., Bulletin of Mathematical Biology 59, 1997), and 0.49, as tissue
    /// whose fluid may not (Wittek et al., Biomechanics and Modeling in Mechanobiology 8, 2009). Left out: it is taken as known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub poisson_log_sd: Option<f64>,
    /// Seed of the points that draws are made from. 0: Halton's own; any other: the same turned, for draws that are independent of
    /// these.
    #[serde(skip_serializing_if = "is_first")]
    pub seed: u64,
    /// Where the fluid will stand, where that is known, in place of `drained`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fluid_level: Option<KnownLevel>,
}

/// Draws from which on Halton's points of the higher bases no longer lie on a line: of the first 16, those of bases 19 and 23 are
/// multiples of each other.
pub const ENOUGH_DRAWS: usize = 64;

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands it so")]
fn is_first(seed: &u64) -> bool {
    *seed == 0
}

impl Default for PredictSettings {
    fn default() -> Self {
        Self {
            heads: vec![Head::Supine],
            tissues: 2,
            draws: 128,
            checks: 2,
            threshold_mm: 2.0,
            density_log_sd: 0.56,
            drained: None,
            drained_log_sd: 0.4,
            tissue_density_kg_per_m3: TISSUE_KG_PER_M3,
            direction_sd_deg: 10.0,
            fixed_weight: 0.5,
            sliding_weight: 0.5,
            poisson_log_sd: None,
            seed: 0,
            fluid_level: None,
        }
    }
}

impl PredictSettings {
    /// Draws that are too few for what is read from them.
    pub fn few_draws(&self) -> Option<usize> {
        Some(self.draws).filter(|draws| *draws < ENOUGH_DRAWS)
    }

    /// Refuses what no prediction can be made with.
    ///
    /// # Errors
    /// The first setting out of its range.
    pub fn check(&self) -> Result<(), SettingError> {
        let sd = |x: f64| (0.0..=3.0).contains(&x);
        let weights = [self.fixed_weight, self.sliding_weight];
        let weigh = weights.iter().all(|w| *w >= 0.0 && w.is_finite()) && weights.iter().sum::<f64>() > 0.0;
        let part = self.drained.is_none_or(|part| part > 0.0 && part <= 1.0);
        let poisson = self.poisson_log_sd.is_none_or(|sd| sd > 0.0 && sd <= 2.0);
        let one_of_both = self.fluid_level.is_none() || self.drained.is_none();
        let apart = (0..self.heads.len()).all(|n| !self.heads[..n].iter().any(|head| head.is_same_as(&self.heads[n])));
        if let Some(level) = &self.fluid_level {
            level.check()?;
        }
        first_broken(&[
            ("heads", &self.heads, !self.heads.is_empty() && apart, "one or more ways to lie, none twice"),
            (
                "tissues",
                &self.tissues,
                (1..=2).contains(&self.tissues),
                "1 (the whole brain) or 2 (grey and white matter)",
            ),
            ("draws", &self.draws, (16..=1024).contains(&self.draws), "16 to 1024"),
            ("checks", &self.checks, self.checks <= self.draws, "at most as many as draws"),
            ("threshold_mm", &self.threshold_mm, (0.01..=50.0).contains(&self.threshold_mm), "0.01 to 50 mm"),
            ("density_log_sd", &self.density_log_sd, sd(self.density_log_sd), "0 to 3"),
            ("drained", &self.drained.unwrap_or_default(), part, "a part above 0, at most 1"),
            ("drained_log_sd", &self.drained_log_sd, sd(self.drained_log_sd), "0 to 3"),
            (
                "tissue_density_kg_per_m3",
                &self.tissue_density_kg_per_m3,
                (CsfSettings::default().density_kg_per_m3..=2000.0).contains(&self.tissue_density_kg_per_m3),
                "1007 (the fluid's) to 2000",
            ),
            (
                "direction_sd_deg",
                &self.direction_sd_deg,
                (0.0..=30.0).contains(&self.direction_sd_deg),
                "0 to 30 degrees",
            ),
            ("poisson_log_sd", &self.poisson_log_sd.unwrap_or_default(), poisson, "above 0, at most 2"),
            (
                "fluid_level.below_top_mm",
                &self.fluid_level.as_ref().map_or(0.0, |level| level.below_top_mm),
                one_of_both,
                "left out where `drained` says how much of the fluid will have drained: give one of the two",
            ),
            ("fixed_weight and sliding_weight", &weights, weigh, "0 or more, and not both 0"),
        ])
    }

    /// Refuses what a patient's loads make of these settings: `own` is the table `[resection]`, whose settings are named as they stand
    /// there.
    ///
    /// # Errors
    /// The first setting of either table that no prediction can be made with.
    pub fn check_loads(&self, own: &ResectionSettings) -> Result<(), SettingError> {
        let own_weight = self.drained.is_some() || self.fluid_level.is_some();
        let fluid = own.csf.clone().unwrap_or_default().density_kg_per_m3;
        let (tissue, drained) = (self.tissue_density_kg_per_m3, own.csf.as_ref().map_or(1.0, |csf| csf.drained));
        let effective = own.density_kg_per_m3;
        let held = own.supports == Supports::Sliding || !own.fixed.is_empty();
        first_broken(&[
            (
                "resection.density_kg_per_m3",
                &effective,
                own_weight || effective > 0.0,
                "above 0: a prediction is of a brain that sinks under a weight",
            ),
            (
                "resection.csf.drained",
                &drained,
                own_weight || drained > 0.0,
                "above 0: with all of the fluid left nothing sinks, and a factor either way of nothing is nothing",
            ),
            (
                "predict.tissue_density_kg_per_m3",
                &tissue,
                !own_weight || tissue >= fluid,
                "at least the fluid's density (`density_kg_per_m3` of the table [resection.csf], 1007 where that is left out): lighter tissue \
                 floats",
            ),
            ("resection.fixed", &own.fixed, held, "one set or more: a brain that nothing holds falls"),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_drawn_from_is_refused_by_name() {
        let of = |change: &dyn Fn(&mut PredictSettings)| {
            let mut settings = PredictSettings::default();
            change(&mut settings);
            settings.check().map_err(|e| e.to_string())
        };
        assert_eq!(of(&|_| ()), Ok(()));
        type Change<'a> = &'a dyn Fn(&mut PredictSettings);
        let downward = |y: f64| Head::Down([0.0, y, 0.0]);
        let cases: [(&str, Change<'_>); 10] = [
            ("`heads`", &|s| s.heads = Vec::new()),
            ("`heads` is [left, left]", &|s| s.heads = vec![Head::Left, Head::Left]),
            ("`heads` is [0,-1,0, 0,-2,0]", &|s| s.heads = vec![downward(-1.0), downward(-2.0)]),
            ("`draws`", &|s| s.draws = 3),
            ("`drained` is 0.0:", &|s| s.drained = Some(0.0)),
            ("`drained` is NaN:", &|s| s.drained = Some(f64::NAN)),
            ("`poisson_log_sd` is 0.0:", &|s| s.poisson_log_sd = Some(0.0)),
            ("`poisson_log_sd` is NaN:", &|s| s.poisson_log_sd = Some(f64::NAN)),
            ("`threshold_mm`", &|s| s.threshold_mm = f64::NAN),
            ("`fixed_weight and sliding_weight`", &|s| (s.fixed_weight, s.sliding_weight) = (0.0, 0.0)),
        ];
        for (name, change) in cases {
            assert!(of(change).unwrap_err().contains(name), "{name}");
        }
    }

    #[test]
    fn fewer_draws_than_the_points_are_even_for_are_told_and_taken() {
        let of = |draws| PredictSettings { draws, ..PredictSettings::default() };
        assert_eq!((of(16).check(), of(16).few_draws(), of(64).few_draws()), (Ok(()), Some(16), None));
    }

    #[test]
    fn what_the_patients_own_loads_make_impossible_is_refused_by_name() {
        let fluid = |density_kg_per_m3, drained| Some(CsfSettings { density_kg_per_m3, drained });
        let own = ResectionSettings::default();
        let tissue = ResectionSettings { density_kg_per_m3: 1040.0, ..own.clone() };
        let drained = PredictSettings { drained: Some(0.3), ..PredictSettings::default() };
        let light = PredictSettings { tissue_density_kg_per_m3: 1010.0, ..drained.clone() };
        let plain = PredictSettings::default();
        let cases = [
            (&plain, ResectionSettings { density_kg_per_m3: 0.0, ..own.clone() }, "resection.density_kg_per_m3"),
            (&plain, ResectionSettings { csf: fluid(1007.0, 0.0), ..tissue.clone() }, "resection.csf.drained"),
            (
                &light,
                ResectionSettings { csf: fluid(1035.0, 0.3), ..tissue.clone() },
                "predict.tissue_density_kg_per_m3",
            ),
            (&plain, ResectionSettings { fixed: Vec::new(), ..own.clone() }, "resection.fixed"),
        ];
        for (settings, own, name) in cases {
            assert_eq!(settings.check_loads(&own).unwrap_err().name, name);
        }
        assert_eq!(plain.check_loads(&own), Ok(()));
        assert_eq!(drained.check_loads(&ResectionSettings { csf: fluid(1007.0, 0.0), ..tissue }), Ok(()));
        assert_eq!(light.check_loads(&own), Ok(()));
    }
}
