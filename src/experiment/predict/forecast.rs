//! From a body whose unknowns have priors to draws of its displacement.

use super::check::{Check, checked};
use super::path::Path;
use super::response::{Coordinates, Response, SolvedState};
use super::uncertain::Uncertainty;
use crate::experiment::estimate::{Body, BodyError, Observation, Solved};
use crate::fem::Scenario;
use crate::mesh::TetMesh;
use rayon::prelude::*;
use thiserror::Error;

/// A body as one way of supporting it poses it.
#[derive(Clone, Debug)]
pub struct Posed {
    /// `fixed` or `sliding`.
    pub supports: String,
    /// How probable that is.
    pub weight: f64,
    /// The undeformed mesh with the sets that this needs; nodes of the case's mesh come first.
    pub mesh: TetMesh,
    /// Loads, supports, solver.
    pub scenario: Scenario,
    /// Poisson's ratio of all tissue.
    pub poisson_ratio: f64,
    /// What is not known.
    pub uncertainty: Uncertainty,
}

impl Posed {
    fn has_walls(&self) -> bool {
        !self.scenario.contact.is_empty()
    }

    /// How many equilibria its forecast solves, with so many checks: for whoever is told of each.
    pub fn solutions(&self, checks: usize) -> usize {
        let path = Path::new(&self.uncertainty, self.has_walls());
        path.points(&self.uncertainty).len() + path.beside(&self.uncertainty) + checks
    }
}

/// What one way of supporting a body comes to.
#[derive(Clone, Debug)]
pub struct Forecast {
    /// The surface.
    pub response: Response,
    /// Displacement of every node in each draw, mm.
    pub draws_mm: Vec<Vec<[f64; 3]>>,
    /// How far the surface is off; `None` where nothing was solved to tell.
    pub check: Option<Check>,
    /// Equilibria that were solved for the surface.
    pub states: usize,
}

/// Why there is none.
#[derive(Debug, Error)]
#[error("supports {supports}: {source}")]
pub struct ForecastError {
    /// How the brain is supported.
    pub supports: String,
    /// Why.
    pub source: BodyError,
}

/// Relative residual of a surface's equilibria and of their sensitivities: what it is off by is more (docs/evidence/prediction.md).
const BALANCED: f64 = 1e-4;
const SENSITIVE: f64 = 1e-3;

/// Solves the states of a surface, reads `draws` from it and solves the first `checks` of them whole. `step` is called after
/// each solution.
///
/// # Errors
/// [`ForecastError`] where a state has no equilibrium.
pub fn forecast(
    posed: &Posed,
    nodes: usize,
    (draws, checks): (usize, usize),
    step: &(dyn Fn() + Sync),
) -> Result<Forecast, ForecastError> {
    let refused = |source| ForecastError { supports: posed.supports.clone(), source };
    let uncertainty = &posed.uncertainty;
    let body = |scenario: &Scenario| {
        let nothing = Observation::Nodes(Vec::new());
        Body::new(&posed.mesh, scenario, uncertainty.unknowns(), posed.poisson_ratio, nothing).map_err(refused)
    };
    let mut roughly = posed.scenario.clone();
    roughly.solver.relative_residual = roughly.solver.relative_residual.max(BALANCED);
    let mut rough = body(&roughly)?.sensitive_within(SENSITIVE);
    let solved = |at: Vec<f64>, found: Solved| {
        step();
        SolvedState { at, displacement_mm: found.outcome.displacement_mm, slopes_mm: found.sensitivities }
    };
    // From stiff and light to soft and heavy, each from the one before it; where much of the body has come to a wall, slopes do
    // not say enough of the next, and the way goes on through a state between.
    let path = Path::new(uncertainty, posed.has_walls());
    let mut states: Vec<SolvedState> = Vec::new();
    for at in path.points(uncertainty) {
        if let Some(last) = states.last().filter(|_| posed.has_walls() && states.len() > path.middle()) {
            let half = rough.equilibrium(&last.half_way_to(&at)).map_err(refused)?;
            rough.start_from(&last.through(&half.displacement_mm, &at));
        }
        let found = rough.solve(&at).map_err(refused)?;
        states.push(solved(at, found));
    }
    let middle = path.middle();
    let coordinates = Coordinates::new(uncertainty, path, &states[middle]);
    let first = Response::fitted(coordinates.clone(), &states);
    for beside in coordinates.beside() {
        rough.start_from(&first.at(&beside.at));
        let found = rough.solve_partly(&beside.at, &beside.slopes).map_err(refused)?;
        states.push(solved(beside.at, found));
    }
    let response = Response::fitted(coordinates, &states);
    let read = |n: usize| response.at(&uncertainty.draw(n));
    let (mut pairs, mut exact) = (Vec::new(), body(&posed.scenario)?);
    for n in 0..checks.min(draws) {
        let mut read = read(n);
        exact.start_from(&read);
        let mut solved = exact.equilibrium(&uncertainty.draw(n)).map_err(refused)?.displacement_mm;
        read.truncate(nodes);
        solved.truncate(nodes);
        step();
        pairs.push((read, solved));
    }
    let check = (!pairs.is_empty()).then(|| checked(&posed.supports, &pairs));
    // Nodes that the supports have added come last.
    let response = response.thinned(&(0..nodes).collect::<Vec<_>>());
    let draws_mm: Vec<Vec<[f64; 3]>> = (0..draws).into_par_iter().map(|n| response.at(&uncertainty.draw(n))).collect();
    Ok(Forecast { response, draws_mm, check, states: states.len() })
}

#[cfg(test)]
mod tests {
    use super::super::uncertain::{Cause, Uncertain};
    use super::*;
    use crate::experiment::estimate::{Turn, Unknown};
    use crate::experiment::phantom::block;
    use crate::experiment::sample::Tissue;

    /// A block of two tissues that stands on its base under its own weight.
    fn posed(sd: f64) -> Posed {
        let mesh = block(4);
        let scenario = Scenario::from_toml(
            "fixed = ['base']\n[loads]\ngravity_m_per_s2 = [0.0, 0.0, -9.81]\n[solver]\nelement = 'tet4-nodal'\n",
        )
        .unwrap();
        let unknown = |unknown: Unknown, mean: f64, sd: f64, cause| {
            let prior = unknown.prior(mean, sd);
            Uncertain { unknown, prior, cause, levels_mm: Vec::new() }
        };
        let mut list: Vec<Uncertain> = Tissue::grey_and_white()
            .into_iter()
            .zip([1200f64, 700.0])
            .map(|(tissue, pa)| unknown(Unknown::ShearModulus(tissue), pa.ln(), 0.4 * sd, Cause::Stiffness))
            .collect();
        list.push(unknown(Unknown::Density, 100f64.ln(), 0.5 * sd, Cause::Load));
        for turn in [Turn::Nodding, Turn::Rolling] {
            list.push(unknown(Unknown::GravityTurn(turn), 0.0, 0.17 * sd, Cause::Direction));
        }
        let uncertainty = Uncertainty::new(list);
        Posed { supports: "fixed".to_owned(), weight: 1.0, mesh, scenario, poisson_ratio: 0.45, uncertainty }
    }

    fn off(sd: f64, checks: usize) -> Check {
        let posed = posed(sd);
        let nodes = posed.mesh.nodes_mm().len();
        forecast(&posed, nodes, (16, checks), &|| ()).unwrap().check.unwrap()
    }

    #[test]
    fn draws_read_from_the_surface_are_those_of_full_solves() {
        let found = off(1.0, 16);
        assert!(found.mean_off_95.unwrap() < 0.03 && found.sd_off_95.unwrap() < 0.08, "{found:?}");
    }

    #[test]
    fn in_the_limit_of_a_small_spread_the_surface_is_the_full_solution() {
        let ratio = |sd: f64| {
            let found = off(sd, 4);
            found.difference_rms_mm / found.displacement_rms_mm
        };
        let (large, small) = (ratio(0.4), ratio(0.04));
        assert!(small < 1e-4 && small < large / 5.0, "{large} {small}");
    }

    #[test]
    fn the_same_draws_on_one_thread_and_on_two() {
        let posed = posed(1.0);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let nodes = posed.mesh.nodes_mm().len();
            pool.install(|| forecast(&posed, nodes, (16, 0), &|| ()).unwrap().draws_mm)
        };
        let bits =
            |draws: Vec<Vec<[f64; 3]>>| draws.into_iter().flatten().flatten().map(f64::to_bits).collect::<Vec<_>>();
        assert_eq!(bits(on(1)), bits(on(2)));
    }
}
