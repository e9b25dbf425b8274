//! From a body whose unknowns have priors to draws of its displacement.

use super::check::{Check, checked};
use super::response::{Coordinates, Response, SolvedState};
use super::uncertain::Uncertainty;
use crate::experiment::estimate::{Body, BodyError, Observation};
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

/// Solves the states of a surface, reads `draws` from it and solves the first `checks` of them whole. `step` is called after
/// each solution.
///
/// # Errors
/// [`ForecastError`] where a state has no equilibrium.
pub fn forecast(
    posed: &Posed,
    nodes: usize,
    (draws, checks): (usize, usize),
    step: &dyn Fn(),
) -> Result<Forecast, ForecastError> {
    let refused = |source| ForecastError { supports: posed.supports.clone(), source };
    let uncertainty = &posed.uncertainty;
    let mut body = Body::new(
        &posed.mesh,
        &posed.scenario,
        uncertainty.unknowns(),
        posed.poisson_ratio,
        Observation::Nodes(Vec::new()),
    )
    .map_err(refused)?;
    let mut solve = |at: &[f64]| -> Result<SolvedState, ForecastError> {
        let mut solved = body.solve(at).map_err(refused)?;
        solved.outcome.displacement_mm.truncate(nodes);
        solved.sensitivities.iter_mut().for_each(|slope| slope.truncate(nodes));
        step();
        let (displacement_mm, slopes_mm) = (solved.outcome.displacement_mm, solved.sensitivities);
        Ok(SolvedState { at: at.to_vec(), displacement_mm, slopes_mm })
    };
    let centre = solve(&uncertainty.centre())?;
    let coordinates = Coordinates::new(uncertainty, &centre);
    let mut states = vec![centre];
    for at in coordinates.design() {
        states.push(solve(&at)?);
    }
    let response = Response::fitted(coordinates, &states);
    let draws_mm: Vec<Vec<[f64; 3]>> = (0..draws).into_par_iter().map(|n| response.at(&uncertainty.draw(n))).collect();
    let mut pairs = Vec::new();
    for (n, read) in draws_mm.iter().enumerate().take(checks) {
        let mut solved = body.equilibrium(&uncertainty.draw(n)).map_err(refused)?.displacement_mm;
        solved.truncate(nodes);
        step();
        pairs.push((read.clone(), solved));
    }
    let check = (!pairs.is_empty()).then(|| checked(&posed.supports, &pairs));
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
