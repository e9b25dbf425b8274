//! How much of the fluid around the brain has drained, where nobody can tell: the level it stands at as an unknown.
//!
//! The number is the logarithm of the odds of the part drained, so that it is between none and all wherever a descent goes.

use super::{Knowledge, LogPrior, Posterior, Scale, Unknown, Z_95};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The least part drained, and the least left, that a prior is put around.
const LEAST: f64 = 0.02;

/// What is known of the part drained beforehand: around `drained`, a standard deviation below which `log_sd` less of its
/// logarithm has drained, as before a prediction; never more than all of it.
pub fn prior_of_drained(unknown: &Unknown, drained: f64, log_sd: f64) -> LogPrior {
    // None and all have no odds.
    let drained = drained.clamp(LEAST, 1.0 - LEAST);
    let [middle, below] = [drained, drained * (-log_sd).exp()].map(|part| Scale::Share.number(part));
    unknown.prior(middle, middle - below)
}

/// What an estimate found of the fluid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FluidOutcome {
    /// Most probable part of the fluid that has drained, 0 to 1.
    pub drained: f64,
    /// Its 95 % interval.
    pub interval_95: [f64; 2],
    /// The interval before the scans were looked at.
    pub prior_95: [f64; 2],
    /// The level at the most probable part, mm against gravity from the origin of the frame.
    pub level_mm: f64,
    /// What the scans say of it.
    pub knowledge: Knowledge,
}

impl FluidOutcome {
    /// Of an estimate at these numbers; `None` where the part drained is not one of its unknowns.
    pub(super) fn of(unknowns: &[Unknown], prior: &[LogPrior], numbers: &[f64], posterior: &Posterior) -> Option<Self> {
        let found = unknowns.iter().enumerate().find_map(|(n, unknown)| match unknown {
            Unknown::Drained(levels) => Some((n, levels)),
            _ => None,
        });
        let (n, levels) = found?;
        let known = &prior[n];
        let before = |z: f64| known.scale.value(known.mean + z * known.sd.unwrap_or(0.0));
        Some(Self {
            drained: posterior.mode[n],
            interval_95: posterior.interval_95[n],
            prior_95: [before(-Z_95), before(Z_95)],
            level_mm: levels.at_number(numbers[n])[0],
            knowledge: posterior.identifiability.verdicts[n],
        })
    }

    /// In a sentence.
    pub fn sentence(&self) -> String {
        let percent = |part: f64| format!("{:.0}", 100.0 * part);
        let [[low, high], [before_low, before_high]] = [self.interval_95, self.prior_95].map(|ends| ends.map(percent));
        let (part, before) = (percent(self.drained), format!("{before_low} to {before_high} % before the scans"));
        match self.knowledge {
            Knowledge::Identified | Knowledge::Widened | Knowledge::Averaged => {
                format!("{part} % of the fluid has drained ({low} to {high} %): the scans have narrowed it ({before})")
            }
            Knowledge::PriorDominated | Knowledge::NotIdentifiable | Knowledge::Withheld => {
                format!("{part} % of the fluid has drained ({low} to {high} %): the interval is the prior's ({before})")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::estimate::{
        Body, CorrelatedErrors, Errors, Estimate, EstimateSettings, FluidLevels, Observation, Problem, Process,
        solve_problem,
    };
    use crate::experiment::phantom::block;
    use crate::experiment::rmse::root_mean_square;
    use crate::experiment::sample::Tissue;
    use crate::fem::Scenario;
    use crate::material::random::CounterRng;
    use crate::mesh::TetMesh;
    use std::sync::Arc;

    #[test]
    fn the_prior_has_the_predictions_middle_and_lower_end_and_never_more_than_all() {
        let unknown = drained();
        for drained in [0.05, 0.3, 0.9] {
            let prior = prior_of_drained(&unknown, drained, 0.4);
            let at = |z: f64| prior.scale.value(prior.mean + z * prior.sd.unwrap());
            assert!((at(0.0) / drained - 1.0).abs() < 1e-12 && (at(-1.0) / drained - (-0.4f64).exp()).abs() < 1e-12);
            assert!(at(Z_95) < 1.0);
        }
        let none = prior_of_drained(&unknown, 0.0, 0.4);
        assert!(none.mean.is_finite() && none.sd.is_some_and(f64::is_finite));
    }

    /// A block of 50 mm that stands in fluid, lying on its side so that the level cuts grey and white matter alike.
    fn scenario(loads: &str) -> Scenario {
        let text = format!(
            "fixed = ['base']\n[loads]\ngravity_m_per_s2 = [0.0, -9.81, 0.0]\n{loads}\n[solver]\nelement = 'tet4-nodal'\n"
        );
        Scenario::from_toml(&text).unwrap()
    }

    const IN_FLUID: &str = "density_kg_per_m3 = 1040.0\ncsf = { density_kg_per_m3 = 1007.0, level_mm = 30.0 }";

    fn moduli() -> Vec<Unknown> {
        Tissue::grey_and_white().into_iter().map(Unknown::ShearModulus).collect()
    }

    /// From the top of the block to its bottom.
    fn drained() -> Unknown {
        let level = |n: i32| 50.0 - 50.0 * (f64::from(n) / 32.0).powf(0.8);
        Unknown::Drained(Arc::new(FluidLevels::new((0..=32).map(level).collect()).unwrap()))
    }

    fn solved(mesh: &TetMesh, scenario: &Scenario, unknowns: &[Unknown], at: &[f64]) -> Vec<[f64; 3]> {
        let nothing = Observation::Nodes(Vec::new());
        let mut body = Body::new(mesh, scenario, unknowns.to_vec(), 0.45, nothing).unwrap();
        body.solve(at).unwrap().outcome.displacement_mm
    }

    #[test]
    fn sensitivities_to_the_part_drained_are_the_slopes_of_solutions() {
        let mesh = block(5);
        let (scenario, unknowns) = (scenario(IN_FLUID), [moduli(), vec![drained()]].concat());
        for number in [-2.0, -0.847, 0.6] {
            let at = |by: f64| [1370f64.ln(), 990f64.ln(), number + by];
            let step = 1e-3;
            let nothing = Observation::Nodes(Vec::new());
            let mut body = Body::new(&mesh, &scenario, unknowns.clone(), 0.45, nothing).unwrap();
            let column = body.solve(&at(0.0)).unwrap().sensitivities.remove(2);
            let [below, above] = [-step, step].map(|by| solved(&mesh, &scenario, &unknowns, &at(by)));
            let largest = column.iter().flatten().fold(0.0_f64, |m, s| m.max(s.abs()));
            assert!(largest > 0.05, "the level matters: {largest} mm at {number}");
            let sides = below.iter().flatten().zip(above.iter().flatten());
            for (found, (below, above)) in column.iter().flatten().zip(sides) {
                let slope = (above - below) / (2.0 * step);
                assert!((slope - found).abs() < 1e-3 * largest, "{slope} against {found} of {largest} at {number}");
            }
        }
    }

    /// What is seen of a body, each component with an error of its own.
    fn seen(u: &[[f64; 3]], error_mm: f64, stream: u64) -> Vec<(u32, [f64; 3])> {
        let rng = CounterRng::new(23, stream);
        let off = |n: usize, a: usize| error_mm * rng.normal((3 * n + a) as u64);
        u.iter().enumerate().map(|(n, u)| (n as u32, [0, 1, 2].map(|a| u[a] + off(n, a)))).collect()
    }

    fn posed<'a>(
        mesh: &'a TetMesh,
        scenario: &'a Scenario,
        in_fluid: bool,
        seen: (Vec<(u32, [f64; 3])>, Errors),
    ) -> Problem<'a> {
        let of = |unknown: Unknown| {
            let prior = unknown.prior(1100f64.ln(), 0.6);
            (unknown, prior)
        };
        let mut unknowns: Vec<_> = moduli().into_iter().map(of).collect();
        if in_fluid {
            let prior = prior_of_drained(&drained(), 0.3, 0.4);
            unknowns.push((drained(), prior));
        }
        Problem::new(mesh, scenario, unknowns, 0.45, (Observation::Nodes(seen.0), seen.1))
    }

    #[test]
    fn a_level_that_went_in_comes_out_inside_its_interval_and_so_do_the_moduli() {
        let mesh = block(5);
        let (scenario, unknowns) = (scenario(IN_FLUID), [moduli(), vec![drained()]].concat());
        let truth = [1370.0, 990.0, 0.45];
        let numbers = [1370f64.ln(), 990f64.ln(), Scale::Share.number(0.45)];
        let u = solved(&mesh, &scenario, &unknowns, &numbers);
        let (mut inside, mut all) = (0, 0);
        for stream in 0..8 {
            let errors = Errors::Independent { share: 1.0 };
            let problem = posed(&mesh, &scenario, true, (seen(&u, 0.1, stream), errors));
            let settings = EstimateSettings { noise_mm: 0.1, ..EstimateSettings::default() };
            let outcome = solve_problem(problem, &settings).unwrap().outcome;
            let intervals = outcome.posterior.interval_95.iter();
            inside += intervals.zip(truth).filter(|([low, high], truth)| low <= truth && truth <= high).count();
            all += truth.len();
            let fluid = outcome.fluid.unwrap();
            assert_eq!(fluid.knowledge, Knowledge::Identified, "{fluid:?}");
            assert!((fluid.drained - 0.45).abs() < 0.1 && fluid.prior_95[1] > 0.5, "{fluid:?}");
            assert!(fluid.sentence().contains("narrowed"), "{}", fluid.sentence());
        }
        assert!(inside + 3 >= all, "{inside} of {all} inside their 95 % intervals");
    }

    #[test]
    fn where_little_is_seen_of_the_level_the_interval_is_said_to_be_the_priors() {
        let mesh = block(3);
        let (scenario, unknowns) = (scenario(IN_FLUID), [moduli(), vec![drained()]].concat());
        let u = solved(&mesh, &scenario, &unknowns, &[7.0, 7.0, -0.847]);
        // A shift that is seen, by few observations.
        let noise_mm = 0.5 * root_mean_square(u.as_flattened()).unwrap();
        let errors = Errors::Independent { share: 0.0005 };
        let problem = posed(&mesh, &scenario, true, (seen(&u, 0.0, 0), errors));
        let settings = EstimateSettings { noise_mm, ..EstimateSettings::default() };
        let fluid = solve_problem(problem, &settings).unwrap().outcome.fluid.unwrap();
        assert_eq!(fluid.knowledge, Knowledge::PriorDominated);
        assert!(fluid.sentence().contains("the interval is the prior's"), "{}", fluid.sentence());
        let wide = |ends: [f64; 2]| ends[1] - ends[0];
        assert!(wide(fluid.interval_95) > 0.7 * wide(fluid.prior_95), "{fluid:?}");
    }

    #[test]
    fn the_evidence_is_for_the_load_that_was_there() {
        let mesh = block(5);
        let (fluid, even) = (scenario(IN_FLUID), scenario("density_kg_per_m3 = 300.0"));
        let unknowns = [moduli(), vec![drained()]].concat();
        let numbers = [1370f64.ln(), 990f64.ln(), Scale::Share.number(0.45)];
        let of_fluid = solved(&mesh, &fluid, &unknowns, &numbers);
        let of_even = solved(&mesh, &even, &moduli(), &numbers[..2]);
        let evidence = |u: &[[f64; 3]], in_fluid: bool| -> f64 {
            let noise = Process { sd_mm: 0.02, length_mm: 7.5 };
            let errors = CorrelatedErrors { noise, corrected_mm: 0.02, rigid_mm: 0.1, places: 150 };
            let scenario = if in_fluid { &fluid } else { &even };
            let problem = posed(&mesh, scenario, in_fluid, (seen(u, 0.02, 9), Errors::Correlated(errors)));
            let Estimate { outcome, .. } = solve_problem(problem, &EstimateSettings::default()).unwrap();
            assert!(outcome.fluid.is_none() || in_fluid);
            outcome.odds.unwrap().log_evidence
        };
        let [drained, level] = [&of_fluid, &of_even].map(|u| evidence(u, true) - evidence(u, false));
        assert!(drained > 3.0 && level < -3.0, "{drained} {level}");
    }
}
