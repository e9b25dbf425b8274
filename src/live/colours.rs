//! What the surface is coloured by: a number for every node of the whole mesh, negative where nothing is known.

use super::body::LiveBody;
use super::command::Colour;
use super::session::Session;
use crate::fem::{By, FemError, Method, Model};
use crate::material::law::Parameter;
use crate::mesh::{ClosestPoint, TetMesh};

/// Stands for a number that is not known.
const UNKNOWN: f64 = -1.0;

/// A boundary set and the surface that a later scan shows for it.
struct Target {
    nodes: Vec<u32>,
    surface: ClosestPoint,
}

/// What numbers need besides the session.
pub struct Colours {
    targets: Vec<Target>,
    truth_mm: Option<Vec<[f64; 3]>>,
    estimate_sd_mm: Option<Vec<f64>>,
    /// Tissues with the standard deviation of the logarithm of their shear modulus beforehand.
    spreads: Vec<(String, f64)>,
    /// Made when it is first asked for: it takes an equilibrium and a linear system for each tissue.
    prior_sd_mm: Option<Vec<f64>>,
}

impl Colours {
    /// Of a body whose whole mesh is this.
    pub fn of(body: &LiveBody, mesh: &TetMesh) -> Self {
        let target = |(set, surface): &(String, crate::mesh::TriMesh)| {
            Some(Target { nodes: mesh.node_sets.get(set)?.clone(), surface: ClosestPoint::new(surface)? })
        };
        let spread = |tissue: &super::body::LiveTissue| Some((tissue.name.clone(), tissue.prior?.log_sd));
        Self {
            targets: body.sights.targets.iter().filter_map(target).collect(),
            truth_mm: body.sights.truth_mm.clone(),
            estimate_sd_mm: body.sights.estimate_sd_mm.clone(),
            spreads: body.tissues.iter().filter_map(spread).collect(),
            prior_sd_mm: None,
        }
    }

    /// What this body can be coloured by.
    pub fn known(&self) -> Vec<Colour> {
        let all = [Colour::Displacement, Colour::Energy, Colour::Error, Colour::PriorSd, Colour::EstimateSd];
        let known = |colour: &Colour| match colour {
            Colour::Displacement | Colour::Energy => true,
            Colour::Error => self.truth_mm.is_some() || !self.targets.is_empty(),
            Colour::PriorSd => !self.spreads.is_empty(),
            Colour::EstimateSd => self.estimate_sd_mm.is_some(),
        };
        all.into_iter().filter(known).collect()
    }

    /// The place of a colour among those that are known; 0, which every body has, for one that is not.
    pub fn place(&self, colour: Colour) -> u32 {
        self.known().iter().position(|known| *known == colour).unwrap_or_default() as u32
    }

    /// Whether nothing has to be made first.
    pub fn is_ready(&self, colour: Colour) -> bool {
        self.known().contains(&colour) && (colour != Colour::PriorSd || self.prior_sd_mm.is_some())
    }

    /// Makes ready what a colour needs.
    ///
    /// # Errors
    /// Why there is no such colour, in words.
    pub fn choose(&mut self, colour: Colour, body: &LiveBody) -> Result<(), String> {
        if !self.known().contains(&colour) {
            return Err("this body has nothing to be coloured by that".to_owned());
        }
        if colour == Colour::PriorSd && self.prior_sd_mm.is_none() {
            self.prior_sd_mm = Some(prior_sd_mm(body, &self.spreads).map_err(|e| e.to_string())?);
        }
        Ok(())
    }

    /// A number for every node: mm, but of the energy Pa.
    pub fn numbers(&self, session: &Session, colour: Colour) -> Vec<f64> {
        let nodes = session.mesh().nodes_mm();
        let fixed = |known: Option<&Vec<f64>>| {
            // Nodes that a sliding sheet has doubled come last, and nothing is known of them.
            let mut numbers = known.cloned().unwrap_or_default();
            numbers.resize(nodes.len(), UNKNOWN);
            numbers
        };
        match colour {
            Colour::Displacement => session.displacement_mm().iter().map(size).collect(),
            Colour::Energy => nodal_energy_pa(session),
            Colour::PriorSd => fixed(self.prior_sd_mm.as_ref()),
            Colour::EstimateSd => fixed(self.estimate_sd_mm.as_ref()),
            Colour::Error => {
                let moved = session.displacement_mm();
                if let Some(truth) = &self.truth_mm {
                    let apart = |(u, t): (&[f64; 3], &[f64; 3])| size(&[0, 1, 2].map(|i| u[i] - t[i]));
                    return fixed(Some(&moved.iter().zip(truth).map(apart).collect()));
                }
                let mut numbers = vec![UNKNOWN; nodes.len()];
                for target in &self.targets {
                    for n in target.nodes.iter().map(|&n| n as usize) {
                        let at = [0, 1, 2].map(|i| nodes[n][i] + moved[n][i]);
                        numbers[n] = target.surface.find(at).distance_mm;
                    }
                }
                numbers
            }
        }
    }
}

fn size(u: &[f64; 3]) -> f64 {
    u.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Standard deviation of where every node comes to rest under the scenario the session began with, by the priors of the shear
/// moduli, linearised: sqrt(sum over tissues of (sd of ln mu |du/d ln mu|)^2).
fn prior_sd_mm(body: &LiveBody, spreads: &[(String, f64)]) -> Result<Vec<f64>, FemError> {
    let mut scenario = body.scenario.clone();
    scenario.solver.method = Method::Static;
    let model = Model::new(&body.mesh, &scenario)?;
    let (_, state) = model.solve(&scenario.materials, None, &|_| ())?;
    let by: Vec<By> =
        spreads.iter().map(|(name, _)| By::Material { name: name.clone(), parameter: Parameter::Stiffness }).collect();
    let slopes = model.sensitivities(&scenario.materials, &state, &by)?;
    let mut variance = vec![0.0; slopes.first().map_or(0, Vec::len)];
    for (slope, (_, log_sd)) in slopes.iter().zip(spreads) {
        variance.iter_mut().zip(slope).for_each(|(sum, u)| *sum += (log_sd * size(u)).powi(2));
    }
    Ok(variance.into_iter().map(f64::sqrt).collect())
}

/// Energy density around every node, by volume.
fn nodal_energy_pa(session: &Session) -> Vec<f64> {
    let mesh = session.stepper().mesh();
    let (_, energy) = session.stepper().cells();
    let mut sums = vec![[0.0; 2]; mesh.nodes_mm().len()];
    for (cell, tet) in mesh.tets().iter().enumerate() {
        let volume = mesh.volume_mm3(cell);
        for &n in tet {
            sums[n as usize][0] += volume * energy[cell];
            sums[n as usize][1] += volume;
        }
    }
    let mean = |[sum, volume]: [f64; 2]| if volume > 0.0 { [sum / volume, 0.0, 0.0] } else { [0.0; 3] };
    session.on_whole(sums.into_iter().map(mean).collect()).into_iter().map(|[mean, ..]| mean).collect()
}
