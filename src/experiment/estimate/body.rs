//! The solver as a forward model: log-moduli in, distances to what was observed out.

use super::levenberg_marquardt::{Forward, Linearisation};
use super::unknown::{Unknown, axes_across};
use crate::experiment::observed::ObservedSurfaces;
use crate::fem::{By, FemError, Load, Loads, Materials, Method, Model, Outcome, Scenario, State, Within};
use crate::material::law::{Material, Parameter, Shape};
use crate::mesh::TetMesh;
use nalgebra::{DMatrix, DVector, Point3, Rotation3, Vector3};
use rayon::prelude::*;
use thiserror::Error;

/// What was observed.
#[derive(Clone, Debug)]
pub enum Observation {
    /// The displacement (mm) of some nodes, all three components.
    Nodes(Vec<(u32, [f64; 3])>),
    /// Surfaces that node sets should lie on; each node is one observation, its signed distance along the surface's
    /// normal (point to plane: sliding along a surface is not seen).
    Surfaces(ObservedSurfaces),
}

/// The body whose parameters are estimated.
pub struct Body<'a> {
    mesh: &'a TetMesh,
    template: Scenario,
    unknowns: Vec<Unknown>,
    poisson_ratio: f64,
    observation: Observation,
    model: Model,
    /// The gravity that turns are counted from, m/s2.
    gravity: Vector3<f64>,
    /// The last point solved.
    last: Option<Last>,
    /// Where the next equilibrium is looked for, if not from the last one.
    start: Option<State>,
    /// How good equilibria are.
    balanced: Within,
    /// How good sensitivities are.
    sensitive: Within,
    /// Solves for an equilibrium so far.
    pub solves: usize,
    /// Linear solves for sensitivities so far.
    pub tangent_solves: usize,
}

/// Why the body cannot be evaluated.
#[derive(Debug, Error)]
pub enum BodyError {
    /// A label of a tissue has no name in the scenario.
    #[error("label {label} of tissue `{tissue}` has no name in the scenario's [labels]")]
    NoName {
        /// The label.
        label: u8,
        /// The tissue.
        tissue: String,
    },
    /// The scenario asks for a motion; equilibria alone have the sensitivities that are needed, and are what is compared.
    #[error(
        "`solver.method` of the scenario asks for a motion, and an estimate or a prediction is of equilibria: give \"static\""
    )]
    Moving,
    /// The solver's own.
    #[error(transparent)]
    Fem(#[from] FemError),
}

/// A point of the parameters, its equilibrium and how that changes.
struct Last {
    log_parameters: Vec<f64>,
    state: State,
    solved: Solved,
}

/// Longest way (of a logarithm) over which sensitivities foretell the next equilibrium better than the last one does: to
/// first order a body of half the stiffness moves by seven tenths more, in truth by twice as much.
const FORETOLD: f64 = 0.7;

/// How many times stiffer a body is tried where it has no equilibrium to begin with.
const STIFFER: [f64; 4] = [1.0, 2.0, 4.0, 8.0];

/// Relative residual of the sensitivities' linear systems: a Gauss-Newton step needs no better ones.
const SENSITIVE: Within = Within::Residual(1e-6);

impl Last {
    /// Where to look for the equilibrium at other parameters.
    fn towards(&self, log_parameters: &[f64], model: &Model) -> State {
        let way: Vec<f64> = log_parameters.iter().zip(&self.log_parameters).map(|(to, from)| to - from).collect();
        if way.iter().any(|step| step.abs() > FORETOLD) {
            return self.state.clone();
        }
        let mut foretold = self.solved.outcome.displacement_mm.clone();
        for (step, change) in way.iter().zip(&self.solved.sensitivities) {
            for (u, s) in foretold.iter_mut().zip(change) {
                (0..3).for_each(|a| u[a] += step * s[a]);
            }
        }
        model.state(&foretold).unwrap_or_else(|_| self.state.clone())
    }
}

/// A solved point with everything the maps need.
#[derive(Clone, Debug)]
pub struct Solved {
    /// The equilibrium.
    pub outcome: Outcome,
    /// du / d ln(unknown), mm, per unknown and node.
    pub sensitivities: Vec<Vec<[f64; 3]>>,
}

impl<'a> Body<'a> {
    /// A body of neo-Hookean tissues of one Poisson's ratio.
    ///
    /// # Errors
    /// [`BodyError`] when the scenario does not fit the mesh.
    pub fn new(
        mesh: &'a TetMesh,
        template: &Scenario,
        unknowns: Vec<Unknown>,
        poisson_ratio: f64,
        observation: Observation,
    ) -> Result<Self, BodyError> {
        if template.solver.method != Method::Static {
            return Err(BodyError::Moving);
        }
        let mut template = template.clone();
        // Any moduli will do to check the scenario.
        template.materials = materials(&template, &unknowns, &vec![7.0; unknowns.len()], poisson_ratio)?;
        let model = Model::new(mesh, &template)?;
        let gravity = Vector3::from(template.loads.gravity_m_per_s2);
        let balanced = Within::Residual(template.solver.relative_residual);
        Ok(Self {
            mesh,
            template,
            unknowns,
            poisson_ratio,
            observation,
            model,
            gravity,
            last: None,
            start: None,
            balanced,
            sensitive: SENSITIVE,
            solves: 0,
            tangent_solves: 0,
        })
    }

    /// Nodes observed with their displacement (mm); none where surfaces are observed.
    pub(super) fn observed_nodes(&self) -> &[(u32, [f64; 3])] {
        match &self.observation {
            Observation::Nodes(nodes) => nodes,
            Observation::Surfaces(_) => &[],
        }
    }

    /// The mesh.
    pub(super) fn mesh(&self) -> &'a TetMesh {
        self.mesh
    }

    /// Which of the unknowns are shear moduli.
    pub(super) fn are_moduli(&self) -> Vec<bool> {
        self.unknowns.iter().map(|unknown| matches!(unknown, Unknown::ShearModulus(_))).collect()
    }

    /// Compares with another observation from now on.
    pub(super) fn observe(&mut self, observation: Observation) {
        self.observation = observation;
    }

    /// The scenario's loads with these parameters.
    fn loads(&self, parameters: &[f64]) -> Loads {
        let mut loads = self.template.loads.clone();
        for (unknown, &value) in self.unknowns.iter().zip(parameters) {
            match unknown {
                Unknown::ShearModulus(_)
                | Unknown::Shape(..)
                | Unknown::PoissonRatio
                | Unknown::GravityTurn(_)
                | Unknown::Gap(_) => {}
                Unknown::Density => loads.density_kg_per_m3 = value.exp(),
                Unknown::CsfLevel => {
                    if let Some(csf) = &mut loads.csf {
                        csf.level_mm = value;
                    }
                }
                Unknown::Drained(levels) => {
                    if let Some(csf) = &mut loads.csf {
                        [csf.level_mm, _] = levels.at_number(value);
                    }
                }
                Unknown::Pressure(n) => {
                    let pressure = &mut loads.pressure[*n].pressure_pa;
                    *pressure = value.exp().copysign(*pressure);
                }
            }
        }
        loads.gravity_m_per_s2 = self.turned(parameters).into();
        loads
    }

    /// Gravity turned by the parameters that are turns, m/s2.
    fn turned(&self, parameters: &[f64]) -> Vector3<f64> {
        let axes = axes_across(self.gravity);
        let mut turn = Vector3::zeros();
        for (unknown, &angle) in self.unknowns.iter().zip(parameters) {
            if let Unknown::GravityTurn(about) = unknown {
                turn += axes[*about as usize] * angle;
            }
        }
        Rotation3::new(turn) * self.gravity
    }

    /// d gravity / d parameter, m/s2 per unit, by central differences: exact to 1e-10 of a rotation this smooth.
    fn turning(&self, parameters: &[f64], number: usize) -> Vector3<f64> {
        const STEP: f64 = 1e-5;
        let at = |step: f64| {
            let mut moved = parameters.to_vec();
            moved[number] += step;
            self.turned(&moved)
        };
        (at(STEP) - at(-STEP)) / (2.0 * STEP)
    }

    /// The same with equilibria and sensitivities no better than that.
    #[must_use]
    pub(in crate::experiment) fn within(mut self, balanced: Within, sensitive: Within) -> Self {
        (self.balanced, self.sensitive) = (balanced, sensitive);
        self
    }

    /// The next equilibrium is looked for from this displacement (mm, every node of the mesh), if it is a possible one.
    pub(in crate::experiment) fn start_from(&mut self, displacement_mm: &[[f64; 3]]) {
        self.start = self.model.state(displacement_mm).ok();
    }

    /// Equilibrium alone at these parameters.
    ///
    /// # Errors
    /// The solver's.
    pub fn equilibrium(&mut self, log_parameters: &[f64]) -> Result<Outcome, BodyError> {
        self.balanced(log_parameters).map(|(_, outcome, _)| outcome)
    }

    /// Equilibrium with the materials behind it and the solver's own state.
    fn balanced(&mut self, log_parameters: &[f64]) -> Result<(Materials, Outcome, State), BodyError> {
        let loads = self.loads(log_parameters);
        if loads != self.template.loads {
            self.template.loads = loads;
            self.model = Model::new(self.mesh, &self.template)?;
        }
        for (unknown, &value) in self.unknowns.iter().zip(log_parameters) {
            if let Unknown::Gap(wall) = unknown {
                self.model.set_gap(*wall, value.exp());
            }
        }
        let materials = materials(&self.template, &self.unknowns, log_parameters, self.poisson_ratio)?;
        let last = || self.last.as_ref().map(|last| last.towards(log_parameters, &self.model));
        let start = self.start.take().or_else(last);
        let (outcome, state) = self.model.solve_within(self.balanced, &materials, start.as_ref(), &|_| {})?;
        self.solves += 1;
        Ok((materials, outcome, state))
    }

    /// Where a descent can begin: these parameters, or the same with stiffer tissue where a body this soft has no equilibrium
    /// (a brain at the prior's mean may be folded by a load that the patient's own bears). The first ones again where a
    /// stiffer one has none either.
    pub(super) fn start(&mut self, log_parameters: &[f64]) -> Vec<f64> {
        let stiffer = |by: f64| -> Vec<f64> {
            let moved = self.unknowns.iter().zip(log_parameters);
            moved.map(|(unknown, p)| if matches!(unknown, Unknown::ShearModulus(_)) { p + by } else { *p }).collect()
        };
        let starts: Vec<Vec<f64>> = STIFFER.iter().map(|factor: &f64| stiffer(factor.ln())).collect();
        let first = starts.into_iter().find(|start| self.solve(start).is_ok());
        first.unwrap_or_else(|| log_parameters.to_vec())
    }

    /// Equilibrium and sensitivities at these parameters (logarithms, or angles).
    ///
    /// # Errors
    /// The solver's.
    pub fn solve(&mut self, log_parameters: &[f64]) -> Result<Solved, BodyError> {
        if let Some(last) = self.last.as_ref().filter(|last| last.log_parameters == log_parameters) {
            return Ok(last.solved.clone());
        }
        let all = vec![true; self.unknowns.len()];
        let (state, solved) = self.solve_by(log_parameters, &all)?;
        self.last = Some(Last { log_parameters: log_parameters.to_vec(), state, solved: solved.clone() });
        Ok(solved)
    }

    /// Equilibrium and the sensitivities to some of the unknowns; those of the others are empty.
    ///
    /// # Errors
    /// The solver's.
    pub(in crate::experiment) fn solve_partly(
        &mut self,
        log_parameters: &[f64],
        wanted: &[bool],
    ) -> Result<Solved, BodyError> {
        self.solve_by(log_parameters, wanted).map(|(_, solved)| solved)
    }

    fn solve_by(&mut self, log_parameters: &[f64], wanted: &[bool]) -> Result<(State, Solved), BodyError> {
        let (materials, outcome, state) = self.balanced(log_parameters)?;
        // A turn of gravity needs weight along all three axes, of which the weight of a denser tissue is a sum.
        let turns = self.unknowns.iter().zip(wanted).any(|(u, wanted)| *wanted && matches!(u, Unknown::GravityTurn(_)));
        let along_axes = turns && self.template.loads.csf.is_none();
        // What to differentiate by, with the unknown it belongs to and its weight there.
        let mut by = Vec::new();
        for (n, unknown) in self.unknowns.iter().enumerate().filter(|(n, _)| wanted[*n]) {
            match unknown {
                Unknown::Density if along_axes => {
                    let gravity = self.turned(log_parameters);
                    by.extend((0..3).map(|axis| (By::Gravity(axis), n, gravity[axis])));
                }
                Unknown::Density => by.push((By::Load(Load::Weight), n, 1.0)),
                Unknown::PoissonRatio => by.push((By::LameRatio, n, 1.0)),
                Unknown::CsfLevel => by.push((By::CsfLevel, n, 1.0)),
                // By the level itself.
                Unknown::Drained(levels) => by.push((By::CsfLevel, n, levels.at_number(log_parameters[n])[1])),
                Unknown::Pressure(number) => by.push((By::Load(Load::Pressure(*number)), n, 1.0)),
                // By the gap itself, not by its logarithm.
                Unknown::Gap(wall) => by.push((By::Gap(*wall), n, log_parameters[n].exp())),
                Unknown::GravityTurn(_) => {
                    let turning = self.turning(log_parameters, n);
                    by.extend((0..3).map(|axis| (By::Gravity(axis), n, turning[axis])));
                }
                Unknown::Shape(tissue, shape) => {
                    for name in tissue.labels.iter().filter_map(|&l| self.template.label_name(l)) {
                        let own = materials.get(name);
                        for (parameter, weight) in (shape.slopes)(log_parameters[n]) {
                            let parameter = own.and_then(|material| material.parameter(parameter, 0));
                            by.extend(
                                parameter.map(|p| (By::Material { name: name.to_owned(), parameter: p }, n, weight)),
                            );
                        }
                    }
                }
                Unknown::ShearModulus(tissue) => {
                    let names = tissue.labels.iter().filter_map(|&l| self.template.label_name(l));
                    by.extend(
                        names.map(|name| {
                            (By::Material { name: name.to_owned(), parameter: Parameter::Stiffness }, n, 1.0)
                        }),
                    );
                }
            }
        }
        let mut different: Vec<By> = by.iter().map(|(by, ..)| by.clone()).collect();
        different.sort_unstable();
        different.dedup();
        let parts = self.model.sensitivities_within(self.sensitive, &materials, &state, &different)?;
        self.tangent_solves += different.len();
        let nodes = outcome.displacement_mm.len();
        let mut sensitivities: Vec<Vec<[f64; 3]>> =
            wanted.iter().map(|wanted| if *wanted { vec![[0.0; 3]; nodes] } else { Vec::new() }).collect();
        for (by, n, weight) in by {
            let part = parts.iter().zip(&different).find(|(_, b)| **b == by).map_or(&[][..], |(part, _)| part);
            for (sum, s) in sensitivities[n].iter_mut().zip(part) {
                for a in 0..3 {
                    sum[a] += weight * s[a];
                }
            }
        }
        Ok((state, Solved { outcome, sensitivities }))
    }

    /// Distances (mm) from what was observed to where the body is before anything moves.
    pub(super) fn residuals_at_rest(&self) -> DVector<f64> {
        self.residuals(&vec![[0.0; 3]; self.mesh.nodes_mm().len()], &[]).residuals_mm
    }

    /// Of a displacement, and how they change with each unknown whose sensitivities are given.
    fn residuals(&self, displacement_mm: &[[f64; 3]], sensitivities: &[Vec<[f64; 3]>]) -> Linearisation {
        let rows: Vec<(f64, Vec<f64>)> = match &self.observation {
            Observation::Nodes(observed) => observed
                .iter()
                .flat_map(|(n, target)| {
                    let n = *n as usize;
                    (0..3).map(move |a| {
                        let row = sensitivities.iter().map(|s| s[n][a]).collect();
                        (displacement_mm[n][a] - target[a], row)
                    })
                })
                .collect(),
            Observation::Surfaces(surfaces) => surfaces
                .surfaces()
                .flat_map(|(set, surface, tree)| {
                    let nodes = &self.mesh.node_sets[set];
                    nodes
                        .par_iter()
                        .map(|&n| {
                            let n = n as usize;
                            let (x, u) = (Vector3::from(self.mesh.nodes_mm()[n]), displacement_mm[n]);
                            let at = x + Vector3::from(u);
                            let hit = tree.find(at.into());
                            let normal = normal_of(
                                surface.triangles[hit.triangle as usize]
                                    .map(|c| Point3::from(surface.nodes_mm[c as usize])),
                            );
                            let away = at - hit.point_mm.coords;
                            // Past an edge the closest point lies askew: then the way to it is the direction.
                            let direction = if away.norm() > 1e-6 && away.normalize().dot(&normal).abs() < 0.9 {
                                away.normalize()
                            } else {
                                normal
                            };
                            let row = sensitivities.iter().map(|s| direction.dot(&Vector3::from(s[n]))).collect();
                            (direction.dot(&away), row)
                        })
                        .collect::<Vec<_>>()
                })
                .collect(),
        };
        Linearisation {
            residuals_mm: DVector::from_iterator(rows.len(), rows.iter().map(|r| r.0)),
            jacobian_mm: DMatrix::from_fn(rows.len(), sensitivities.len(), |r, c| rows[r].1[c]),
        }
    }
}

impl Forward for Body<'_> {
    type Error = BodyError;

    fn linearise(&mut self, log_parameters: &[f64]) -> Result<Linearisation, BodyError> {
        let solved = self.solve(log_parameters)?;
        Ok(self.residuals(&solved.outcome.displacement_mm, &solved.sensitivities))
    }
}

fn materials(
    template: &Scenario,
    unknowns: &[Unknown],
    log_parameters: &[f64],
    poisson_ratio: f64,
) -> Result<Materials, BodyError> {
    // Tissues that are not estimated keep the template's.
    let mut materials = template.materials.clone();
    let drawn = unknowns.iter().zip(log_parameters).find(|(unknown, _)| **unknown == Unknown::PoissonRatio);
    let drawn = drawn.map(|(unknown, number)| unknown.scale().value(*number));
    if let Some(ratio) = drawn {
        for material in materials.values_mut() {
            *material = material.clone().with_poisson_ratio(ratio);
        }
    }
    let poisson_ratio = drawn.unwrap_or(poisson_ratio);
    for (unknown, log) in unknowns.iter().zip(log_parameters) {
        if let Unknown::ShearModulus(tissue) = unknown {
            let shape = unknowns.iter().zip(log_parameters).find_map(|(other, value)| match other {
                Unknown::Shape(of, shape) if of == tissue => Some((*shape, *value)),
                _ => None,
            });
            for &label in &tissue.labels {
                let missing = || BodyError::NoName { label, tissue: tissue.name.clone() };
                let name = template.label_name(label).ok_or_else(missing)?;
                materials.insert(name.to_owned(), material(log.exp(), shape, poisson_ratio));
            }
        }
    }
    Ok(materials)
}

/// The material of a shear modulus at rest (Pa) and what else its law has.
pub fn material(shear_modulus_pa: f64, shape: Option<(&Shape, f64)>, poisson_ratio: f64) -> Material {
    match shape {
        Some((shape, number)) => Material::new(shape.law, (shape.values)(shear_modulus_pa, number), poisson_ratio),
        None => Material::neo_hookean(shear_modulus_pa, poisson_ratio),
    }
}

fn normal_of([a, b, c]: [Point3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vector3::x)
}

#[cfg(test)]
mod tests {
    use super::super::unknown::Turn;
    use super::*;
    use crate::experiment::phantom::block;
    use crate::experiment::sample::Tissue;

    #[test]
    fn a_denser_body_sags_as_much_more_whether_or_not_gravity_may_turn_and_what_is_not_asked_is_empty() {
        let mesh = block(3);
        let scenario = Scenario::from_toml(
            "fixed = ['base']\n[loads]\ngravity_m_per_s2 = [1.0, 2.0, -9.0]\ndensity_kg_per_m3 = 100.0\n",
        )
        .unwrap();
        let body = |more: &[Unknown]| {
            let list = [&[Unknown::ShearModulus(Tissue::whole_brain().remove(0)), Unknown::Density], more].concat();
            Body::new(&mesh, &scenario, list, 0.45, Observation::Nodes(Vec::new())).unwrap()
        };
        let (modulus, density) = (700f64.ln(), 120f64.ln());
        let straight = body(&[]).solve(&[modulus, density]).unwrap().sensitivities;
        let turns = [Unknown::GravityTurn(Turn::Nodding), Unknown::GravityTurn(Turn::Rolling)];
        let turned = body(&turns).solve(&[modulus, density, 0.0, 0.0]).unwrap().sensitivities;
        let largest = straight[1].iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
        let off = straight[1].iter().flatten().zip(turned[1].iter().flatten());
        assert!(largest > 0.1 && off.fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) < 1e-5 * largest);
        let partly = body(&turns).solve_partly(&[modulus, density, 0.0, 0.0], &[false, false, true, false]).unwrap();
        assert!([0, 1, 3].iter().all(|&n| partly.sensitivities[n].is_empty()));
        let off = partly.sensitivities[2].iter().flatten().zip(turned[2].iter().flatten());
        assert!(off.fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) < 1e-5 * largest);
    }

    #[test]
    fn a_motion_is_no_body_of_an_estimate() {
        let mesh = block(1);
        let mut scenario = Scenario { fixed: vec!["base".to_owned()], ..Scenario::default() };
        let posed = |scenario: &Scenario| {
            let list = vec![Unknown::ShearModulus(Tissue::whole_brain().remove(0))];
            Body::new(&mesh, scenario, list, 0.45, Observation::Nodes(Vec::new())).map(|_| ())
        };
        posed(&scenario).unwrap();
        scenario.solver.method = Method::BackwardEuler;
        assert!(matches!(posed(&scenario), Err(BodyError::Moving)));
    }

    #[test]
    fn equilibria_and_sensitivities_good_to_a_part_by_energy_are_so_in_a_body_pressed_on_its_wall() {
        let mesh = block(5);
        let scenario = Scenario::from_toml(
            "fixed = ['base']\n[loads]\ngravity_m_per_s2 = [1.0, 2.0, 9.0]\ndensity_kg_per_m3 = 100.0\n\
             [[contact]]\nset = 'superior'\nwall = { shape = 'own-surface' }\ngap_mm = 0.3\n\
             [solver]\nelement = 'tet4-nodal'\n",
        )
        .unwrap();
        let list = [Unknown::ShearModulus(Tissue::whole_brain().remove(0)), Unknown::Density, Unknown::Gap(0)];
        let body = || Body::new(&mesh, &scenario, list.to_vec(), 0.45, Observation::Nodes(Vec::new())).unwrap();
        let point = [700f64.ln(), 120f64.ln(), 0.3f64.ln()];
        let exact = body().solve(&point).unwrap();
        assert!(exact.outcome.contact[0].area_mm2 > 0.0);
        let rough = body().within(Within::Energy(0.01), Within::Energy(0.01)).solve(&point).unwrap();
        let size = |v: &[[f64; 3]]| v.iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
        let off = |rough: &[[f64; 3]], exact: &[[f64; 3]]| {
            let apart: Vec<[f64; 3]> = rough.iter().zip(exact).map(|(r, e)| [0, 1, 2].map(|i| r[i] - e[i])).collect();
            size(&apart) / size(exact)
        };
        let moved = off(&rough.outcome.displacement_mm, &exact.outcome.displacement_mm);
        assert!((1e-9..0.01).contains(&moved), "{moved}");
        assert!(rough.outcome.convergence.iterations.len() < exact.outcome.convergence.iterations.len());
        for (rough, exact) in rough.sensitivities.iter().zip(&exact.sensitivities) {
            let off = off(rough, exact);
            assert!((1e-9..0.02).contains(&off), "{off}");
        }
    }
}
