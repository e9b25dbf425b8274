//! Bars of the study-level model: prediction of publications that were left out, its own simulated literatures, cost.

use crate::bar::Bar;
use hgm::material::generative::SampleSettings;
use hgm::material::gp::Hyperparameters;
use hgm::material::literature::{Curves, LiteratureModel, table};
use hgm::material::study_level::{
    Evidence, LeftOut, Of, SPREAD_NAMES, SPREADS, Spreads, Studies, StudyLevelFit, drawn_materials, fit, intervals,
    leave_one_publication_out, predict, published_log_density, refit, simulate, uniform_probability,
};
use hgm::material::task::stretches;
use hgm::material::{StudyKind, Task};
use rayon::prelude::*;
use std::time::Instant;

/// Literatures drawn from the model.
const LITERATURES: u64 = 200;

pub fn bars() -> Vec<Bar> {
    let studies = Studies::from_literature(&table(), Curves::Corrected);
    let Ok(all) = refit(&studies, &Spreads::default()) else {
        return vec![Bar::new("study-level: fit", "finite", "none", false)];
    };
    let mut bars = left_out(&studies, &all);
    // One thread: what the bars are stated for.
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one thread");
    bars.extend(one.install(|| cost(&studies)));
    bars.push(draws(&studies, &all));
    bars.extend(simulated(&studies));
    bars
}

fn left_out(studies: &Studies, all: &StudyLevelFit) -> Vec<Bar> {
    let left = leave_one_publication_out(studies, all).unwrap_or_default();
    let points = left.iter().map(|l| l.points).sum::<usize>() as f64;
    let sum = |of: fn(&LeftOut) -> f64| left.iter().map(of).sum::<f64>() / points;
    let (density, at_mode) = (sum(|l| l.log_density), sum(|l| l.log_density_at_mode));
    let parameters = Hyperparameters::published();
    let published: Vec<f64> =
        (0..left.len()).into_par_iter().map(|n| published_log_density(studies, n, &parameters)).collect();
    let worse = left.iter().zip(&published).filter(|(l, p)| l.log_density <= **p);
    let worse: Vec<&str> = worse.map(|(l, _)| l.publication.as_str()).collect();
    let better = left.len() - worse.len();
    let inside: Vec<&LeftOut> = left.iter().filter(|l| l.inside_95 >= 0.9).collect();
    let outside: Vec<&str> = left.iter().filter(|l| l.inside_95 < 0.9).map(|l| l.publication.as_str()).collect();
    let share = inside.len() as f64 / left.len() as f64;
    let half = left.iter().map(|l| l.inside_50).sum::<f64>() / left.len() as f64;
    // By themselves: many curves that hardly bend hide a band that is too wide for those that do.
    let bends = |l: &&LeftOut| l.curves.iter().any(|curve| curve.task.kind == StudyKind::Hyperelastic);
    let bending: Vec<f64> = left.iter().filter(bends).map(|l| l.inside_50).collect();
    let half_bending = bending.iter().sum::<f64>() / bending.len() as f64;
    let p = uniform_probability(&left.iter().map(|l| l.rank).collect::<Vec<_>>());
    let published = published.iter().sum::<f64>() / points;
    let whole = left.len() == 30;
    vec![
        Bar::new(
            "study-level: left-out publications",
            ">= +1.0 per point, jointly, over all 30",
            format!(
                "{density:+.2} with the spreads integrated out, {at_mode:+.2} with those of the other 29 taken as known; \
                 published model {published:+.2}; {points} points"
            ),
            whole && density >= 1.0,
        ),
        Bar::new(
            "study-level: better than published",
            ">= 26 of 30, exceptions named",
            format!("{better}; not for {}", worse.join(", ")),
            whole && better >= 26,
        ),
        Bar::new(
            "study-level: 95 % band of a new study",
            "90 to 99 % of publications have >= 90 % of points inside",
            format!("{:.0} % ({} of {}); not {}", 100.0 * share, inside.len(), left.len(), outside.join(", ")),
            whole && (0.9..=0.99).contains(&share),
        ),
        Bar::new(
            "study-level: 50 % band",
            "35 to 65 % inside",
            format!("{:.1} %, mean over publications", 100.0 * half),
            (0.35..=0.65).contains(&half),
        ),
        Bar::new(
            "study-level: 50 % band of hyperelastic studies",
            "35 to 65 % inside",
            format!("{:.1} %, mean over the {} publications with such a curve", 100.0 * half_bending, bending.len()),
            (0.35..=0.65).contains(&half_bending),
        ),
        Bar::new("study-level: ranks of moduli", "uniform, p >= .01", format!("p = {p:.2} (Kolmogorov)"), p >= 0.01),
    ]
}

/// Ten times the studies: copies of the publications, each over a slightly narrower window, so that no grid is shared.
fn tenfold() -> Vec<LiteratureModel> {
    let narrowed = |model: LiteratureModel, copy: u32| {
        let [low, high] = model.stretch_window;
        let inwards = 1.0 - 0.001 * f64::from(copy);
        let stretch_window = [1.0 - (1.0 - low) * inwards, 1.0 + (high - 1.0) * inwards];
        let citation = format!("{} {copy}", model.citation);
        LiteratureModel { id: model.id + 1000 * copy, stretch_window, citation, ..model }
    };
    (0..10).flat_map(|copy| table().into_iter().map(move |model| narrowed(model, copy))).collect()
}

fn cost(studies: &Studies) -> Vec<Bar> {
    let spreads = Spreads::default();
    let value = |studies: &Studies| Evidence::new(studies, &spreads).map_or(f64::NAN, |e| e.gradient[0]);
    let one = crate::material::least_ms(|| value(studies));
    let more = Studies::from_literature(&tenfold(), Curves::Corrected);
    let ten = crate::material::least_ms(|| value(&more));
    let start = Instant::now();
    let (found, seconds) = crate::material::seconds_of(|| fit(studies, &spreads, 0));
    let wall = start.elapsed().as_secs_f64();
    let norm = found.map_or(f64::NAN, |fit| fit.gradient_norm);
    vec![
        Bar::new(
            "study-level: evidence with gradient",
            "<= 10 ms, one thread",
            format!("{one:.2} ms of the thread"),
            one <= 10.0,
        ),
        Bar::new(
            "study-level: fit",
            "<= 10 s, one thread",
            format!("{seconds:.2} s of the thread, {wall:.2} s by the clock; norm of the gradient {norm:.1e}"),
            seconds <= 10.0 && norm < 0.1,
        ),
        Bar::new(
            "study-level: ten times the studies",
            "<= 12 times the time",
            format!("{:.1} times an evaluation with gradient", ten / one),
            ten <= 12.0 * one,
        ),
    ]
}

fn draws(studies: &Studies, all: &StudyLevelFit) -> Bar {
    let settings = SampleSettings { stretches: 101, ..SampleSettings::default() };
    let Some(evidence) = Evidence::new(studies, &all.spreads) else {
        return Bar::new("study-level: draws", "all stable", "none", false);
    };
    let (mut stable, mut drawn) = (0, 0);
    for task in Task::all() {
        let [low, high] = task.stretch_window();
        for of in [Of::Mean, Of::Person, Of::Study] {
            let prior = predict(&evidence.means, &all.spreads, task, of, &stretches(low, high, 101));
            let materials = drawn_materials(&prior, 1000, 0, &settings).unwrap_or_default();
            stable += materials.iter().filter(|m| m.fit.stability.everywhere()).count();
            drawn += materials.len();
        }
    }
    Bar::new(
        "study-level: draws fitted by a stable law",
        "12 tasks, 1000 of the mean, a person, a study each",
        format!("{stable} of {drawn}"),
        stable == 36_000,
    )
}

/// Spreads drawn from their priors, a literature of the same design drawn under them, the intervals fitted to it.
fn simulated(design: &Studies) -> Vec<Bar> {
    let inside = |number: u64| -> Option<[bool; SPREADS]> {
        let truth = Spreads::from_prior(2026, number);
        let literature = simulate(design, &truth, 1000 + number);
        let fit = refit(&literature, &Spreads::default()).ok()?;
        let found = intervals(&literature, &fit)?;
        let truth = truth.to_array();
        Some(std::array::from_fn(|n| found[n][0] <= truth[n] && truth[n] <= found[n][1]))
    };
    let found: Vec<[bool; SPREADS]> = (0..LITERATURES).into_par_iter().filter_map(inside).collect();
    let sets = found.len() as f64;
    let shares: Vec<f64> = (0..SPREADS).map(|n| found.iter().filter(|row| row[n]).count() as f64 / sets).collect();
    let all = shares.iter().sum::<f64>() / SPREADS as f64;
    let least = (0..SPREADS).fold(0, |least, n| if shares[n] < shares[least] { n } else { least });
    let most = shares.iter().fold(0.0_f64, |most, share| most.max(*share));
    let within = shares.iter().filter(|share| (0.85..=0.95).contains(*share)).count();
    vec![Bar::new(
        "study-level: 90 % intervals of the spreads",
        "200 simulated literatures, 85 to 95 % cover",
        format!(
            "{:.1} % of all; {within} of {SPREADS} spreads each within 85 to 95 %, from {:.1} % ({}) to {:.1} %; {sets} sets",
            100.0 * all,
            100.0 * shares[least],
            SPREAD_NAMES[least],
            100.0 * most
        ),
        found.len() as u64 == LITERATURES && (0.85..=0.95).contains(&all),
    )]
}
