//! From a body whose unknowns have priors to draws of its displacement.

use super::check::{Check, checked};
use super::path::Path;
use super::response::{Coordinates, Response, SolvedState};
use super::uncertain::Uncertainty;
use crate::experiment::estimate::{Body, BodyError, Observation, Solved};
use crate::fem::{Scenario, Within};
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

    /// How many steps [`forecast`] tells of.
    pub fn steps(&self, (draws, checks): (usize, usize)) -> usize {
        let path = self.path();
        path.points(&self.uncertainty).len() + path.beside(&self.uncertainty) + self.solved_of(draws) + checks
    }

    fn is_in_fluid(&self) -> bool {
        self.scenario.loads.csf.is_some()
    }

    /// The path of its surface.
    fn path(&self) -> Path {
        Path::new(&self.uncertainty, self.has_walls()).in_fluid(self.is_in_fluid())
    }

    /// How many of so many draws are solved instead of read from the surface.
    fn solved_of(&self, draws: usize) -> usize {
        // A level cuts the brain now here, now there: no surface of a few states follows that (docs/evidence/prediction.md).
        if self.is_in_fluid() {
            draws
        } else if self.has_walls() {
            draws / SOLVED
        } else {
            0
        }
    }
}

/// What one way of supporting a body comes to.
#[derive(Clone, Debug)]
pub struct Forecast {
    /// The surface.
    pub response: Response,
    /// Displacement of every node in each draw, mm.
    pub draws_mm: Vec<Vec<[f64; 3]>>,
    /// How far the draws are off; `None` where nothing was solved to tell.
    pub check: Option<Check>,
    /// Equilibria that were solved, checks apart.
    pub states: usize,
    /// Draws that were solved themselves; the others are read from the surface.
    pub solved: usize,
    /// Draws that were to be solved and have no equilibrium, so heavy and soft are they; they are read from the surface.
    pub unbalanced: usize,
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

/// How good a surface's equilibria are; checks are solved as the scenario asks.
const BALANCED: Within = Within::Energy(0.01);
/// How good its sensitivities are.
const SENSITIVE: Within = Within::Energy(0.01);

/// Before walls one draw of so many is solved, those of most load over stiffness: most of what the surface is off is theirs
/// (docs/evidence/prediction.md).
const SOLVED: usize = 16;

/// Solves the states of a surface, reads `draws` from it and solves the first `checks` of them whole, those that have an
/// equilibrium. `step` is called after each of them. Where a state of the surface has none the draws are solved.
///
/// # Errors
/// [`ForecastError`] where a state in the middle of the prior, or a lighter one, has no equilibrium.
pub fn forecast(
    posed: &Posed,
    nodes: usize,
    (draws, checks): (usize, usize),
    step: &(dyn Fn() + Sync),
) -> Result<Forecast, ForecastError> {
    let refused = |source| ForecastError { supports: posed.supports.clone(), source };
    let uncertainty = &posed.uncertainty;
    let body = || {
        let nothing = Observation::Nodes(Vec::new());
        Body::new(&posed.mesh, &posed.scenario, uncertainty.unknowns(), posed.poisson_ratio, nothing).map_err(refused)
    };
    let mut rough = body()?.within(BALANCED, SENSITIVE);
    let solved = |at: Vec<f64>, found: Solved| SolvedState {
        at,
        displacement_mm: found.outcome.displacement_mm,
        slopes_mm: found.sensitivities,
    };
    // From stiff and light to soft and heavy, each from the one before it.
    let mut path = posed.path();
    let (along, middle) = (path.points(uncertainty), path.middle());
    let mut states = Vec::new();
    for (n, at) in along.iter().enumerate() {
        let found = rough.solve(at);
        step();
        match found {
            Ok(found) => states.push(solved(at.clone(), found)),
            // So soft and heavy a body has no equilibrium, or is about to lose it: the path ends before.
            Err(_) if n > middle => {
                path.end_before(n);
                break;
            }
            Err(source) => return Err(refused(source)),
        }
    }
    let coordinates = Coordinates::new(uncertainty, path, &states[middle]);
    let first = Response::fitted(coordinates.clone(), &states);
    let aside = coordinates.beside();
    let wanted = along.len() + aside.len();
    for beside in aside {
        rough.start_from(&first.at(&beside.at));
        if let Ok(found) = rough.solve_partly(&beside.at, &beside.slopes) {
            states.push(solved(beside.at, found));
        }
        step();
    }
    let response = Response::fitted(coordinates, &states);
    let points: Vec<Vec<f64>> = (0..draws).map(|n| uncertainty.draw(n)).collect();
    let mut draws_mm: Vec<Vec<[f64; 3]>> = points.par_iter().map(|point| response.at(point)).collect();
    let mut heaviest: Vec<usize> = (0..draws).collect();
    heaviest.sort_by(|&a, &b| response.load_at(&points[b]).total_cmp(&response.load_at(&points[a])));
    // A surface that lacks a state is no surface to read from.
    let solved_draws = if states.len() == wanted { posed.solved_of(draws) } else { draws };
    let mut unbalanced = 0;
    for &n in heaviest.iter().take(solved_draws) {
        rough.start_from(&draws_mm[n]);
        match rough.equilibrium(&points[n]) {
            Ok(found) => draws_mm[n] = found.displacement_mm,
            Err(_) => unbalanced += 1,
        }
        step();
    }
    // Nodes that the supports have added come last.
    for u in &mut draws_mm {
        u.truncate(nodes);
    }
    let mut pairs = Vec::new();
    if checks > 0 {
        let mut exact = body()?;
        for (point, told) in points.iter().zip(&draws_mm).take(checks) {
            exact.start_from(&response.at(point));
            if let Ok(solved) = exact.equilibrium(point) {
                pairs.push((told.clone(), solved.displacement_mm[..nodes].to_vec()));
            }
            step();
        }
    }
    let check = (!pairs.is_empty()).then(|| checked(&posed.supports, &pairs));
    let response = response.thinned(&(0..nodes).collect::<Vec<_>>());
    let solved = solved_draws - unbalanced;
    Ok(Forecast { response, draws_mm, check, states: states.len() + solved, solved, unbalanced })
}

#[cfg(test)]
mod tests {
    use super::super::uncertain::{Cause, Reading, Uncertain};
    use super::*;
    use crate::experiment::estimate::{Scale, Turn, Unknown};
    use crate::experiment::phantom::block;
    use crate::experiment::sample::Tissue;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A block of two tissues that stands on its base under its own weight.
    fn posed(sd: f64) -> Posed {
        let mesh = block(4);
        let scenario = Scenario::from_toml(
            "fixed = ['base']\n[loads]\ngravity_m_per_s2 = [0.0, 0.0, -9.81]\n[solver]\nelement = 'tet4-nodal'\n",
        )
        .unwrap();
        let unknown = |unknown: Unknown, mean: f64, sd: f64, cause| {
            let prior = unknown.prior(mean, sd);
            Uncertain { unknown, prior, cause, reading: Reading::Itself }
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

    /// The same block hanging, its top free or before a wall that many draws come to rest on.
    fn hanging(wall: bool) -> Posed {
        let contact = "[[contact]]\nset = 'superior'\nwall = { shape = 'own-surface' }\ngap_mm = 0.3\n";
        let text = format!(
            "fixed = ['base']\n[loads]\ngravity_m_per_s2 = [0.0, 0.0, 9.81]\n{}[solver]\nelement = 'tet4-nodal'\n",
            if wall { contact } else { "" }
        );
        let posed = Posed { scenario: Scenario::from_toml(&text).unwrap(), ..posed(1.0) };
        let unknown = Unknown::Gap(0);
        let prior = unknown.prior(0.3f64.ln(), 0.5);
        let room = Uncertain { unknown, prior, cause: Cause::Room, reading: Reading::Itself };
        let list = posed.uncertainty.list.iter().cloned().chain(wall.then_some(room)).collect();
        Posed { uncertainty: Uncertainty::new(list), ..posed }
    }

    #[test]
    fn draws_of_a_body_that_a_wall_ends_are_those_of_full_solves() {
        let told = AtomicUsize::new(0);
        let found = |posed: &Posed| {
            let step = || {
                told.fetch_add(1, Ordering::Relaxed);
            };
            forecast(posed, posed.mesh.nodes_mm().len(), (16, 16), &step).unwrap()
        };
        let (walled, free) = (hanging(true), hanging(false));
        let (ended, unended) = (found(&walled), found(&free));
        assert_eq!(told.into_inner(), walled.steps((16, 16)) + free.steps((16, 16)));
        let top = |u: &Vec<[f64; 3]>| u[u.len() - 1][2];
        let stopped = ended.draws_mm.iter().zip(&unended.draws_mm).filter(|(e, u)| top(e) < 0.8 * top(u));
        assert!((4..=12).contains(&stopped.count()));
        // What is asked of the spread of patients; of the mean that is half as much (docs/evidence/prediction.md).
        let check = ended.check.unwrap();
        assert!(check.mean_off_95.unwrap() < 0.06 && check.sd_off_95.unwrap() < 0.08, "{check:?}");
        // One in sixteen is solved, the heaviest.
        let load = |n: usize| ended.response.load_at(&walled.uncertainty.draw(n));
        let heaviest = (0..16).max_by(|&a, &b| load(a).total_cmp(&load(b))).unwrap();
        let read = |n: usize| ended.response.at(&walled.uncertainty.draw(n)) == ended.draws_mm[n];
        assert!((0..16).all(|n| read(n) == (n != heaviest)));
        assert_eq!((ended.solved, unended.solved), (1, 0));
    }

    /// A block of one tissue that is pressed on top and can give way along z alone.
    fn confined() -> Posed {
        let mut mesh = block(3);
        mesh.set_nodes("all", (0..mesh.nodes_mm().len() as u32).collect()).unwrap();
        let text = "fixed = ['base']\n[[prescribed]]\nset = 'all'\ndisplacement_mm = [0.0, 0.0, 0.0]\ncomponents = [true, true, false]\n\
                    [[loads.pressure]]\nset = 'superior'\npressure_pa = 1.0\n[solver]\nelement = 'tet4'\n";
        let list = [
            (Unknown::ShearModulus(Tissue::whole_brain().remove(0)), 1000f64.ln(), 0.4, Cause::Stiffness),
            (Unknown::PoissonRatio, Scale::LameRatio.number(0.45), 0.7, Cause::Poisson),
        ];
        let uncertain = |(unknown, mean, sd, cause): (Unknown, f64, f64, Cause)| {
            let prior = unknown.prior(mean, sd);
            Uncertain { unknown, prior, cause, reading: Reading::Itself }
        };
        let uncertainty = Uncertainty::new(list.into_iter().map(uncertain).collect());
        let scenario = Scenario::from_toml(text).unwrap();
        Posed { supports: "fixed".to_owned(), weight: 1.0, mesh, scenario, poisson_ratio: 0.45, uncertainty }
    }

    #[test]
    fn draws_of_poissons_ratio_move_a_confined_column_as_its_modulus_has_it() {
        let posed = confined();
        let nodes = posed.mesh.nodes_mm().len();
        let found = forecast(&posed, nodes, (64, 64), &|| ()).unwrap();
        // 30 mm under 1 Pa give way by 30 / M mm with M = mu (lambda / mu + 2) = E (1 - nu) / ((1 + nu) (1 - 2 nu)).
        let formula = |n: usize| {
            let point = posed.uncertainty.draw(n);
            30.0 / (point[0].exp() * (point[1].exp() + 2.0))
        };
        let pairs: Vec<_> = (0..64)
            .map(|n| {
                let top = found.draws_mm[n][nodes - 1];
                (vec![top], vec![[0.0, 0.0, -formula(n)]])
            })
            .collect();
        let against = checked("fixed", &pairs);
        assert!(against.mean_off_95.unwrap() < 0.03 && against.sd_off_95.unwrap() < 0.08, "{against:?}");
        // Solved whole the column is the formula, but for strains that are not quite small.
        let check = found.check.unwrap();
        let (told, formula) = (check.mean_off_95.unwrap(), against.mean_off_95.unwrap());
        assert!((told - formula).abs() < 1e-3, "{check:?} {against:?}");
    }

    /// The block with its lower half in fluid whose level is not known.
    fn half_in_fluid() -> Posed {
        let text = "fixed = ['base']\n[loads]\ngravity_m_per_s2 = [0.0, 0.0, -9.81]\ndensity_kg_per_m3 = 1040.0\n[loads.csf]\n\
                    density_kg_per_m3 = 1007.0\nlevel_mm = 30.0\n[solver]\nelement = 'tet4-nodal'\n";
        let posed = Posed { scenario: Scenario::from_toml(text).unwrap(), ..posed(0.5) };
        let unknown = Unknown::CsfLevel;
        let prior = unknown.prior(10.0, 1.5);
        let level = Uncertain { unknown, prior, cause: Cause::Load, reading: Reading::Below(40.0) };
        let known = posed.uncertainty.list.iter().filter(|u| u.cause != Cause::Load).cloned();
        Posed { uncertainty: Uncertainty::new(known.chain([level]).collect()), ..posed }
    }

    #[test]
    fn draws_of_a_level_under_gravity_that_turns_are_those_of_full_solves() {
        let posed = half_in_fluid();
        let nodes = posed.mesh.nodes_mm().len();
        let found = forecast(&posed, nodes, (32, 32), &|| ()).unwrap();
        let check = found.check.unwrap();
        assert!(check.mean_off_95.unwrap() < 1e-3 && check.sd_off_95.unwrap() < 1e-3, "{check:?}");
        // The surface alone, which variance shares are read from, would be off by more.
        let read: Vec<_> = (0..32).map(|n| found.response.at(&posed.uncertainty.draw(n))).collect();
        let pairs: Vec<_> = read.into_iter().zip(found.draws_mm).collect();
        let alone = checked("fixed", &pairs).mean_off_95.unwrap();
        assert!((0.01..0.06).contains(&alone), "{alone}");
    }

    #[test]
    fn a_body_too_heavy_for_the_end_of_its_path_has_every_draw_solved() {
        let mut posed = posed(1.0);
        posed.scenario.loads.gravity_m_per_s2 = [0.0, 0.0, -28.0 * 9.81];
        let nodes = posed.mesh.nodes_mm().len();
        let found = forecast(&posed, nodes, (16, 16), &|| ()).unwrap();
        // Two of three states of the path, one with the tissues apart, and the draws.
        assert_eq!((found.states + found.unbalanced, posed.path().points(&posed.uncertainty).len()), (2 + 1 + 16, 3));
        assert_eq!(found.solved + found.unbalanced, 16);
        let check = found.check.unwrap();
        assert!(check.solves == 16 && check.mean_off_95.unwrap() < 0.01, "{check:?}");
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
