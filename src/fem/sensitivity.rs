//! How the displacement changes with a parameter: tangent solves at an equilibrium.
//!
//! At equilibrium R(u, theta) = f_int(u, theta) - f_ext(theta) = 0, so K du/dln(theta) = -dR/dln(theta) with the
//! tangent K of the last state (Haftka and Guerdal, "Elements of Structural Optimization", ch. 7). One column costs one
//! linear solve; one scalar of u costs one solve for all its parameters (the adjoint).

use super::equilibrium::largest_ratio;
use super::linear::{LinearSolver, Tangent, Within};
use super::load::Load;
use super::model::{Model, Projected};
use super::scenario::Materials;
use super::solver;
use super::units::millimetres;
use super::{FemError, State, reduce};
use crate::material::law::{Material, Parameter};
use serde::{Deserialize, Serialize};

/// What a displacement is differentiated by: the logarithm of it, but for [`By::CsfLevel`],
/// [`By::Gravity`] and [`By::Gap`].
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum By {
    /// A parameter of the material of a label: `Parameter::Stiffness` of a neo-Hookean tissue is its shear modulus at
    /// fixed Poisson's ratio.
    Material {
        /// Label name, a key of the scenario's materials.
        name: String,
        /// Parameter of its law.
        parameter: Parameter,
    },
    /// ln(lambda / mu) of every material together, which moves between 0 and 1/2 whatever Poisson's ratio is.
    LameRatio,
    /// One load.
    Load(Load),
    /// Density of the tissue, what a fluid carries left as it is.
    TissueDensity,
    /// Density of the fluid of `loads.csf`.
    CsfDensity,
    /// Level of the fluid of `loads.csf`, per mm instead of per logarithm.
    CsfLevel,
    /// Gravity along an axis (0 to 2 for x to z) of the mesh, per m/s2 instead of per logarithm: the way gravity turns.
    Gravity(usize),
    /// The room before a wall, per mm instead of per logarithm: the scenario's `contact` of this number, walls of sliding
    /// supports behind them. Walls that are planes move away from the body.
    Gap(usize),
    /// Everything that moves the body: all loads and all prescribed displacements together.
    AllLoads,
}

/// Relative step of differences in a parameter. Forces are linear in all moduli, so only other numbers of a law, such as
/// Ogden's exponents, see it.
const STEP: f64 = 1.0 / 512.0;

/// How good tangent solves are where nothing else is asked.
const TOLERANCE: Within = Within::Residual(1e-10);

/// Relative residual of a system that would not be solved any better, up to which its answer is taken all the same: a step of a
/// descent, a Fisher matrix and an interval are no better themselves.
const GOOD_ENOUGH: f64 = 1e-4;

impl Model {
    /// du / dln(parameter) at an equilibrium, mm per unit of the logarithm: one vector per node for each entry of
    /// `by`. `materials` are those the state was solved with.
    ///
    /// # Errors
    /// [`FemError::NoParameter`] and [`FemError::UnstableState`].
    pub fn sensitivities(
        &self,
        materials: &Materials,
        state: &State,
        by: &[By],
    ) -> Result<Vec<Vec<[f64; 3]>>, FemError> {
        self.sensitivities_within(TOLERANCE, materials, state, by)
    }

    /// [`Model::sensitivities`] no better than is asked for.
    ///
    /// # Errors
    /// As [`Model::sensitivities`].
    pub(crate) fn sensitivities_within(
        &self,
        within: Within,
        materials: &Materials,
        state: &State,
        by: &[By],
    ) -> Result<Vec<Vec<[f64; 3]>>, FemError> {
        let mut at = Linearised::new(self, materials, state)?;
        by.iter()
            .map(|by| {
                let rhs = self.free_part(&at.driving_force(by)?);
                let within = match (within, by) {
                    // Most of that energy is the wall's own, not the body's.
                    (Within::Energy(part), By::Gap(_)) => Within::Energy(0.01 * part),
                    _ => within,
                };
                let step = at.solve(&rhs, within)?;
                let mut change = vec![[0.0; 3]; state.u.len()];
                if *by == By::AllLoads {
                    self.move_prescribed(&mut change, 1.0);
                }
                self.add_free(&mut change, 1.0, &step);
                Ok(self.to_mesh_mm(&change))
            })
            .collect()
    }

    /// dg / dln(parameter) of one scalar g(u) for each entry of `by`, in the unit of g: one linear solve for all of
    /// them. `slope_per_mm` is dg/du, one vector per node of the mesh, per mm.
    ///
    /// # Errors
    /// As [`Model::sensitivities`], and [`FemError::StartLength`] for a slope of another length.
    pub fn adjoint(
        &self,
        materials: &Materials,
        state: &State,
        slope_per_mm: &[[f64; 3]],
        by: &[By],
    ) -> Result<Vec<f64>, FemError> {
        self.state(slope_per_mm)?;
        let slope = self.solver_numbering(&slope_per_mm.iter().map(|v| millimetres(*v)).collect::<Vec<_>>());
        let mut at = Linearised::new(self, materials, state)?;
        let weights = at.solve(&self.free_part(&slope), TOLERANCE)?;
        by.iter()
            .map(|by| {
                let mut sum = reduce::dot(&weights, &self.free_part(&at.driving_force(by)?));
                if *by == By::AllLoads {
                    let mut moved = vec![[0.0; 3]; state.u.len()];
                    self.move_prescribed(&mut moved, 1.0);
                    sum += reduce::dot(&slope, &moved);
                }
                Ok(sum)
            })
            .collect()
    }
}

/// A model with its tangent at a state.
struct Linearised<'a> {
    model: &'a Model,
    materials: &'a Materials,
    u: &'a [[f64; 3]],
    tangent: Tangent,
    solver: Box<dyn LinearSolver>,
}

impl<'a> Linearised<'a> {
    fn new(model: &'a Model, materials: &'a Materials, state: &'a State) -> Result<Self, FemError> {
        let laws = model.laws(materials)?;
        let mut forces = vec![[0.0; 3]; state.u.len()];
        let tangent = model.tangent(&state.u, &laws, &mut forces, Projected::Nothing, None);
        let mut solver = solver::for_model(model, largest_ratio(materials));
        solver.prepare(&tangent);
        Ok(Self { model, materials, u: &state.u, tangent, solver })
    }

    fn solve(&mut self, rhs: &[[f64; 3]], within: Within) -> Result<Vec<[f64; 3]>, FemError> {
        let mut x = vec![[0.0; 3]; rhs.len()];
        let report = self.solver.solve(&self.tangent, rhs, &mut x, within);
        if report.negative_curvature {
            return Err(FemError::UnstableState);
        }
        if !report.reached {
            // Nothing comes after this solve that would mend what it leaves.
            let mut left = vec![[0.0; 3]; rhs.len()];
            self.tangent.product(&x, &mut left);
            left.iter_mut().zip(rhs).for_each(|(l, b)| (0..3).for_each(|i| l[i] -= b[i]));
            let residual = reduce::norm(&left) / reduce::norm(rhs);
            if residual.is_nan() || residual > GOOD_ENOUGH {
                return Err(FemError::NoSensitivity { residual });
            }
        }
        Ok(x)
    }

    /// -dR / dln(parameter) on all nodes, N.
    fn driving_force(&self, by: &By) -> Result<Vec<[f64; 3]>, FemError> {
        match by {
            By::Load(load) => {
                let found = self.model.load_parts.iter().find(|(part, _)| part == load);
                let missing = || FemError::NoParameter { what: format!("load {load:?}") };
                found.map(|(_, forces)| forces.clone()).ok_or_else(missing)
            }
            By::Gravity(axis) => {
                // The weight of a node is its mass times gravity.
                let g = self.model.scenario.loads.gravity_m_per_s2;
                let squared: f64 = g.iter().map(|v| v * v).sum();
                let mut forces = self.driving_force(&By::TissueDensity)?;
                for force in &mut forces {
                    let mass_kg = (0..3).map(|i| force[i] * g[i]).sum::<f64>() / squared;
                    *force = [0, 1, 2].map(|i| if i == *axis { mass_kg } else { 0.0 });
                }
                // The fluid's surface turns with gravity.
                let turning = self.model.buoyancy.iter().flat_map(|b| &b.per_gravity_n[*axis]);
                for (force, more) in forces.iter_mut().zip(turning) {
                    (0..3).for_each(|i| force[i] += more[i]);
                }
                Ok(forces)
            }
            By::TissueDensity => {
                let mut forces = self.driving_force(&By::Load(Load::Weight))?;
                for (force, lift) in forces.iter_mut().zip(self.model.buoyancy.iter().flat_map(|b| &b.lift_n)) {
                    (0..3).for_each(|i| force[i] -= lift[i]);
                }
                Ok(forces)
            }
            By::CsfDensity | By::CsfLevel => {
                let missing = || FemError::NoParameter { what: format!("{by:?} (there is no `loads.csf`)") };
                let fluid = self.model.buoyancy.as_ref().ok_or_else(missing)?;
                Ok(if *by == By::CsfLevel { fluid.per_mm_n.clone() } else { fluid.lift_n.clone() })
            }
            By::Gap(wall) => {
                let missing = || FemError::NoParameter { what: format!("wall number {}", wall + 1) };
                self.model.supports.force_of_gap(*wall, self.u, &self.model.nodes_m).ok_or_else(missing)
            }
            By::AllLoads => {
                if self.model.prescribed.is_empty() {
                    return Ok(self.model.load_n.clone());
                }
                // The part K_fc u_c of moved nodes, by differences of the internal forces along their way.
                let along = |factor: f64| {
                    let mut moved = self.u.to_vec();
                    self.model.move_prescribed(&mut moved, 1.0 + factor);
                    self.forces(self.materials, &moved)
                };
                let slope = derivative(along, 1.0 / 4096.0, true)?;
                let both = self.model.load_n.iter().zip(&slope);
                Ok(both.map(|(l, s)| [0, 1, 2].map(|i| l[i] - s[i])).collect())
            }
            By::LameRatio => {
                // Forces are linear in lambda.
                let stiffer = |material: &Material| {
                    let (mu, lambda) = (material.shear_modulus_pa(), (1.0 + STEP) * material.lame_lambda_pa());
                    material.clone().with_poisson_ratio(0.5 * lambda / (lambda + mu))
                };
                let changed = self.materials.iter().map(|(name, m)| (name.clone(), stiffer(m))).collect();
                let (above, at) = (self.forces(&changed, self.u)?, self.forces(self.materials, self.u)?);
                Ok(above.iter().zip(&at).map(|(a, b)| [0, 1, 2].map(|i| (b[i] - a[i]) / STEP)).collect())
            }
            By::Material { name, parameter } => {
                let what = || format!("parameter {parameter:?} of `{name}`");
                let material = self.materials.get(name).ok_or_else(|| FemError::NoParameter { what: what() })?;
                let with = |factor: f64| {
                    let changed = material.scaled(*parameter, factor);
                    let changed = changed.ok_or_else(|| FemError::NoParameter { what: what() })?;
                    let mut materials = self.materials.clone();
                    materials.insert(name.clone(), changed);
                    self.forces(&materials, self.u)
                };
                let mut slope = match parameter {
                    // Forces are linear in lambda, and lambda is steep in nu close to 1/2.
                    Parameter::PoissonRatio => {
                        let (mu, nu) = (material.shear_modulus_pa(), material.poisson_ratio());
                        let lambda = material.lame_lambda_pa();
                        let step = STEP * (lambda + mu);
                        let ratio = |lambda: f64| 0.5 * lambda / (lambda + mu);
                        let (above, below) = (ratio(lambda + step), ratio(lambda));
                        if nu == 0.0 {
                            return Ok(vec![[0.0; 3]; self.u.len()]);
                        }
                        let (f1, f0) = (with(above / nu)?, with(below / nu)?);
                        let rate = nu * 2.0 * mu / (1.0 - 2.0 * nu).powi(2) / step;
                        f1.iter().zip(&f0).map(|(a, b)| [0, 1, 2].map(|i| rate * (a[i] - b[i]))).collect()
                    }
                    Parameter::Stiffness | Parameter::Own(_) => {
                        derivative(|e| with(1.0 + e), STEP, !material.linear_in(*parameter))?
                    }
                };
                slope.iter_mut().flatten().for_each(|v| *v = -*v);
                Ok(slope)
            }
        }
    }

    fn forces(&self, materials: &Materials, u: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, FemError> {
        let laws = self.model.unchecked_laws(materials)?;
        let mut forces = vec![[0.0; 3]; u.len()];
        self.model.body.assemble(u, &laws, &self.model.partition, &mut forces, None, false);
        Ok(forces)
    }
}

/// df/dx at 0 by central differences; of fourth order when f is not linear.
fn derivative(
    f: impl Fn(f64) -> Result<Vec<[f64; 3]>, FemError>,
    step: f64,
    fourth_order: bool,
) -> Result<Vec<[f64; 3]>, FemError> {
    let slope = |step: f64| -> Result<Vec<[f64; 3]>, FemError> {
        let (above, below) = (f(step)?, f(-step)?);
        Ok(above.iter().zip(&below).map(|(a, b)| [0, 1, 2].map(|i| (a[i] - b[i]) / (2.0 * step))).collect())
    };
    let near = slope(step)?;
    if !fourth_order {
        return Ok(near);
    }
    let far = slope(2.0 * step)?;
    Ok(near.iter().zip(&far).map(|(n, f)| [0, 1, 2].map(|i| (4.0 * n[i] - f[i]) / 3.0)).collect())
}

#[cfg(test)]
mod tests {
    use super::super::linear::LinearReport;
    use super::super::manufactured::cube;
    use super::*;
    use crate::fem::Scenario;

    /// A solver that gives up with this part of the answer.
    struct GivesUp {
        with: f64,
        solver: Box<dyn LinearSolver>,
    }

    impl LinearSolver for GivesUp {
        fn prepare(&mut self, tangent: &Tangent) {
            self.solver.prepare(tangent);
        }

        fn solve(&mut self, tangent: &Tangent, rhs: &[[f64; 3]], x: &mut [[f64; 3]], within: Within) -> LinearReport {
            let report = self.solver.solve(tangent, rhs, x, within);
            x.iter_mut().flatten().for_each(|v| *v *= self.with);
            LinearReport { reached: false, ..report }
        }
    }

    #[test]
    fn what_a_solver_gives_up_on_is_no_sensitivity() {
        let scenario = Scenario::from_toml(
            "fixed = ['faces']\n[materials.grey_matter]\nlaw = 'neo-hookean'\nshear_modulus_pa = 1000.0\npoisson_ratio = 0.45\n\
             [loads]\ngravity_m_per_s2 = [0.0, 0.0, -9.81]\ndensity_kg_per_m3 = 100.0\n",
        )
        .unwrap();
        let mesh = cube(3);
        let model = Model::new(&mesh, &scenario).unwrap();
        let state = model.state(&vec![[0.0; 3]; mesh.nodes_mm().len()]).unwrap();
        let solved = |with: f64| {
            let mut at = Linearised::new(&model, &scenario.materials, &state).unwrap();
            let rhs = model.free_part(&at.driving_force(&By::Load(Load::Weight)).unwrap());
            let solver = std::mem::replace(&mut at.solver, solver::for_model(&model, 0.0));
            at.solver = Box::new(GivesUp { with, solver });
            at.solve(&rhs, TOLERANCE)
        };
        assert!(solved(1.0).is_ok(), "as good as it can be");
        assert!(matches!(solved(0.9), Err(FemError::NoSensitivity { residual }) if (residual - 0.1).abs() < 1e-6));
    }
}
