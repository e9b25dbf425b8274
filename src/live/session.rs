//! The body with all that may be done to it. No clock and no thread: the same commands at the same steps give the same bytes.

use super::body::LiveBody;
use super::command::Command;
use super::parts::Parts;
use crate::fem::live::{Ball, Grip, Manner, StepReport, Stepper};
use crate::fem::{CsfLevel, FemError, PressureLoad, Scenario, Support};
use crate::material::law::{Material, Parameter};
use crate::mesh::TetMesh;

/// A hand takes the surface this far around the node it grips: one node alone would be torn out, mm.
const GRIP_MM: f64 = 12.0;
/// Stiffness of the whole hand, N/mm; tissue of 1 kPa gripped over that radius gives way by about a tenth of it.
const HAND_N_PER_MM: f64 = 0.3;
/// How far from its place at rest a hand takes what it grips, mm.
const REACH_MM: f64 = 60.0;
/// Pressure of the ball per depth: some millimetres of brain tissue push back with 1 kPa, Pa/mm.
const BALL_PA_PER_MM: f64 = 4000.0;
/// Volume ratio below which laws are continued, so that what a hand has turned inside out comes back; a body at rest whose
/// cells keep more than that is the scenario's own.
const CONTINUED_BELOW: f64 = 0.1;
/// Changes that can be taken back.
const UNDOS: usize = 100;
/// Density of cerebrospinal fluid, kg/m3.
const CSF_KG_PER_M3: f64 = 1007.0;
/// Relative residual at which a body without speed counts as being at rest.
const REST_RESIDUAL: f64 = 1e-5;
/// The first length of a step in time, s.
const FIRST_TIME_STEP_S: f64 = 1.0 / 60.0;

/// The name of the tissue that a resection takes out.
const RESECTED: &str = "resected";
const NO_RESECTED: &str = "the mesh has no tissue with the label `resected` that could be taken out or put back";

/// What a hand holds.
#[derive(Clone, Debug)]
struct Hold {
    node: u32,
    /// Gripped nodes with their share of the hand and their displacement when it closed, mm.
    nodes: Vec<(u32, f64, [f64; 3])>,
    /// Where the node was when the hand closed, mm.
    from_mm: [f64; 3],
    /// Where the hand is, mm.
    to_mm: [f64; 3],
}

/// What can be taken back: the scenario, and whether the resected tissue is out.
#[derive(Clone, Debug)]
struct Standing {
    scenario: Scenario,
    removed: bool,
}

/// A body, its scenario now and at the beginning, and hands. Nodes are numbered as in the whole mesh, resected tissue and all.
pub struct Session {
    stepper: Stepper,
    parts: Parts,
    surface: Vec<u32>,
    first: Standing,
    now: Standing,
    undo: Vec<Standing>,
    /// What the last change was of: a slider's many values are one change.
    last_change: String,
    hold: Option<Hold>,
    ball: Option<Ball>,
    steps: u64,
    time_s: f64,
    time_step_s: f64,
    manner: Manner,
    /// Of the last step, if nothing has changed since.
    report: Option<StepReport>,
    recovered: u64,
}

/// Nodes of the boundary, ascending.
fn surface(mesh: &TetMesh) -> Vec<u32> {
    let mut nodes: Vec<u32> = mesh.boundary_facets(|_| true).into_iter().flatten().collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes
}

fn square(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum()
}

fn in_words(error: &FemError) -> String {
    error.to_string()
}

impl Session {
    /// The body undeformed, its loads about to act.
    ///
    /// # Errors
    /// As [`Stepper::new`]: what is wrong with mesh or scenario.
    pub fn open(body: &LiveBody) -> Result<Self, FemError> {
        let mut first = body.scenario.clone();
        for material in first.materials.values_mut() {
            *material = material.clone().continued_below(CONTINUED_BELOW);
        }
        let mut stepper = Stepper::new(&body.mesh, &first)?;
        stepper.set_time_step(FIRST_TIME_STEP_S);
        let surface = surface(stepper.mesh());
        let parts = Parts::new(stepper.mesh().clone(), first.label_number(RESECTED));
        let first = Standing { scenario: first, removed: false };
        Ok(Self {
            stepper,
            parts,
            surface,
            now: first.clone(),
            first,
            undo: Vec::new(),
            last_change: String::new(),
            hold: None,
            ball: None,
            steps: 0,
            time_s: 0.0,
            time_step_s: FIRST_TIME_STEP_S,
            manner: Manner::Moving,
            report: None,
            recovered: 0,
        })
    }

    /// The whole mesh, cut open where sheets slide, resected tissue and all; the stepper's own is what is stepped.
    pub fn mesh(&self) -> &TetMesh {
        self.parts.whole()
    }

    /// Whether the mesh has resected tissue, and whether that is out.
    pub fn resection(&self) -> Option<bool> {
        self.parts.label().map(|_| self.now.removed)
    }

    /// The mesh with and without the resected tissue.
    pub(super) fn parts(&self) -> &Parts {
        &self.parts
    }

    /// Numbers of the stepped mesh's nodes at those of the whole one; 0 where tissue is out.
    pub(super) fn on_whole(&self, of_nodes: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
        self.parts.on_whole(self.now.removed, of_nodes)
    }

    /// Of numbers at the nodes of the whole mesh those of the nodes that are stepped.
    pub(super) fn of_stepped(&self, of_whole: &[f64]) -> Vec<f64> {
        let nodes = 0..self.stepper.mesh().nodes_mm().len() as u32;
        nodes.map(|n| of_whole[self.parts.whole_of(self.now.removed, n) as usize]).collect()
    }

    /// The scenario as it is now, without hands.
    pub fn scenario(&self) -> &Scenario {
        &self.now.scenario
    }

    /// The body itself.
    pub fn stepper(&self) -> &Stepper {
        &self.stepper
    }

    /// Displacement of every node, mm; of nodes that are out none.
    pub fn displacement_mm(&self) -> Vec<[f64; 3]> {
        self.on_whole(self.stepper.displacement_mm())
    }

    /// Displacement of one node, mm.
    fn moved_mm(&self, node: u32) -> [f64; 3] {
        let stepped = self.parts.stepped_of(self.now.removed, node);
        stepped.map_or([0.0; 3], |n| self.stepper.displacement_of_mm(n))
    }

    /// Steps taken.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Time that has gone by for the body, s.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Length of a step in time, s.
    pub fn time_step_s(&self) -> f64 {
        self.time_step_s
    }

    /// Whether steps go towards equilibrium without time.
    pub fn is_quasi_static(&self) -> bool {
        self.manner == Manner::QuasiStatic
    }

    /// How often the body has lost its way and was put back to rest.
    pub fn recovered(&self) -> u64 {
        self.recovered
    }

    /// The last step, where nothing has changed since.
    pub fn report(&self) -> Option<StepReport> {
        self.report
    }

    /// Nothing moves any more: further steps would change nothing that counts.
    pub fn is_at_rest(&self) -> bool {
        let goal = self.now.scenario.solver.relative_residual.max(REST_RESIDUAL);
        let speed = self.now.scenario.dynamics.rest_speed_mm_per_s;
        self.report.is_some_and(|r| r.relative_residual <= goal && r.fastest_mm_per_s <= speed && !r.recovered)
    }

    /// One step.
    pub fn step(&mut self) -> StepReport {
        let report = self.stepper.step();
        self.steps += 1;
        if self.manner == Manner::Moving {
            self.time_s += self.time_step_s;
        }
        self.recovered += u64::from(report.recovered);
        self.report = Some(report);
        report
    }

    /// Does what a command says.
    ///
    /// # Errors
    /// Why not, in words; nothing has changed then.
    pub fn apply(&mut self, command: &Command) -> Result<(), String> {
        command.check()?;
        match command {
            Command::Drag { node, to_mm } => self.drag(*node, *to_mm)?,
            Command::Release {} => self.hold = None,
            Command::Ball { centre_mm, radius_mm } => {
                let (centre_mm, radius_mm) = (*centre_mm, *radius_mm);
                self.ball = Some(Ball { centre_mm, radius_mm, stiffness_pa_per_mm: BALL_PA_PER_MM });
            }
            Command::Lift {} => self.ball = None,
            Command::Manner { quasi_static } => {
                self.manner = if *quasi_static { Manner::QuasiStatic } else { Manner::Moving };
                self.stepper.set_manner(self.manner);
            }
            Command::TimeStep { s } => {
                self.time_step_s = *s;
                self.stepper.set_time_step(*s);
            }
            Command::Undo {} => {
                let before = self.undo.pop().ok_or("there is nothing to take back")?;
                self.put(before)?;
                self.last_change.clear();
            }
            Command::Reset {} => self.reset()?,
            change => {
                let (next, what) = match change {
                    Command::Resection { removed } => self.resected(*removed)?,
                    _ => self.changed(change)?,
                };
                let before = self.now.clone();
                self.put(next)?;
                if what != self.last_change {
                    self.undo.push(before);
                    if self.undo.len() > UNDOS {
                        self.undo.remove(0);
                    }
                    self.last_change = what;
                }
            }
        }
        self.hand_over();
        self.report = None;
        Ok(())
    }

    fn reset(&mut self) -> Result<(), String> {
        self.put(self.first.clone())?;
        (self.hold, self.ball) = (None, None);
        self.undo.clear();
        self.last_change.clear();
        self.manner = Manner::Moving;
        self.stepper.set_manner(self.manner);
        self.stepper.rest();
        self.time_s = 0.0;
        Ok(())
    }

    /// Another scenario in the place of this one; only what must is made again.
    fn put(&mut self, next: Standing) -> Result<(), String> {
        let (scenario, now) = (&next.scenario, &self.now.scenario);
        if next.removed != self.now.removed {
            self.put_mesh(&next)?;
        } else if scenario.fixed != now.fixed || scenario.supports != now.supports {
            self.stepper.set_scenario(scenario).map_err(|e| in_words(&e))?;
        } else {
            if scenario.materials != now.materials {
                self.stepper.set_materials(&scenario.materials).map_err(|e| in_words(&e))?;
            }
            if scenario.loads != now.loads {
                self.stepper.set_loads(&scenario.loads).map_err(|e| in_words(&e))?;
            }
        }
        self.now = next;
        Ok(())
    }

    /// A body with more tissue or less, which goes on from where this one is; a hand lets go, what it held may be gone.
    fn put_mesh(&mut self, next: &Standing) -> Result<(), String> {
        let mesh = self.parts.mesh(next.removed).ok_or(NO_RESECTED)?;
        let mut fresh = Stepper::new(mesh, &next.scenario).map_err(|e| in_words(&e))?;
        let whole_mm = self.displacement_mm();
        let carried = self.parts.carried(self.now.removed, next.removed, whole_mm);
        fresh.start_from(&carried).map_err(|e| in_words(&e))?;
        fresh.set_manner(self.manner);
        fresh.set_time_step(self.time_step_s);
        self.surface = surface(mesh).into_iter().map(|n| self.parts.whole_of(next.removed, n)).collect();
        self.stepper = fresh;
        self.hold = None;
        Ok(())
    }

    /// The resected tissue out, or back.
    fn resected(&self, removed: bool) -> Result<(Standing, String), String> {
        self.parts.label().ok_or(NO_RESECTED)?;
        Ok((Standing { removed, ..self.now.clone() }, format!("resection {removed}")))
    }

    /// The scenario with a change, and what the change is of.
    fn changed(&self, command: &Command) -> Result<(Standing, String), String> {
        let now = &self.now.scenario;
        let mut next = now.clone();
        let known = |tissue: &String| {
            let names: Vec<&str> = now.materials.keys().map(String::as_str).collect();
            format!("there is no tissue `{tissue}`; there is {}", names.join(", "))
        };
        let what = match command {
            Command::Gravity { m_per_s2 } => {
                next.loads.gravity_m_per_s2 = *m_per_s2;
                "gravity".to_owned()
            }
            Command::Density { kg_per_m3 } => {
                next.loads.density_kg_per_m3 = *kg_per_m3;
                "density".to_owned()
            }
            Command::Csf { level_mm } => {
                let density_kg_per_m3 = now.loads.csf.map_or(CSF_KG_PER_M3, |csf| csf.density_kg_per_m3);
                next.loads.csf = level_mm.map(|level_mm| CsfLevel { density_kg_per_m3, level_mm });
                "csf".to_owned()
            }
            Command::Pressure { set, pa } => {
                next.loads.pressure.retain(|load| load.set != *set);
                if *pa != 0.0 {
                    next.loads.pressure.push(PressureLoad { set: set.clone(), pressure_pa: *pa });
                }
                format!("pressure {set}")
            }
            Command::Modulus { tissue, pa } => {
                let material = next.materials.get_mut(tissue).ok_or_else(|| known(tissue))?;
                *material = with_modulus(material, *pa)?;
                format!("modulus {tissue}")
            }
            Command::Law { tissue, law } => {
                let material = next.materials.get_mut(tissue).ok_or_else(|| known(tissue))?;
                let named = Material::law_named(law).ok_or_else(|| format!("there is no law `{law}`"))?;
                let values = named.examples().into_iter().next().ok_or("the law has no example to begin with")?;
                let fresh = Material::new(named, values, material.poisson_ratio()).continued_below(CONTINUED_BELOW);
                *material = with_modulus(&fresh, material.shear_modulus_pa())?;
                format!("law {tissue} {law}")
            }
            Command::PoissonRatio { tissue, ratio } => {
                let material = next.materials.get_mut(tissue).ok_or_else(|| known(tissue))?;
                *material = material.clone().with_poisson_ratio(*ratio);
                format!("ratio {tissue}")
            }
            Command::Support { set, held } => {
                if !self.mesh().node_sets.contains_key(set) {
                    return Err(format!("there is no node set `{set}` in the mesh"));
                }
                next.fixed.retain(|name| name != set);
                next.supports.retain(|name, support| !(name == set && *support == Support::Fixed));
                if *held {
                    next.fixed.push(set.clone());
                    next.fixed.sort_unstable();
                }
                format!("support {set} {held}")
            }
            _ => return Err("this command changes no scenario".to_owned()),
        };
        Ok((Standing { scenario: next, removed: self.now.removed }, what))
    }

    fn drag(&mut self, node: u32, to_mm: [f64; 3]) -> Result<(), String> {
        if self.surface.binary_search(&node).is_err() {
            return Err(format!("node {node} is not on the surface: a hand takes hold of the surface only"));
        }
        let at = self.mesh().nodes_mm()[node as usize];
        // Within the reach of the place at rest.
        let far = square(to_mm, at).sqrt();
        let part = if far > REACH_MM { REACH_MM / far } else { 1.0 };
        let to_mm = [0, 1, 2].map(|i| at[i] + part * (to_mm[i] - at[i]));
        match &mut self.hold {
            Some(hold) if hold.node == node => hold.to_mm = to_mm,
            _ => {
                let shares = self.gripped(at);
                let nodes = shares.into_iter().map(|(n, share)| (n, share, self.moved_mm(n))).collect();
                let moved = self.moved_mm(node);
                let from_mm = [0, 1, 2].map(|i| at[i] + moved[i]);
                self.hold = Some(Hold { node, nodes, from_mm, to_mm });
            }
        }
        Ok(())
    }

    /// Surface nodes around a place at rest, with their share of a hand.
    fn gripped(&self, at: [f64; 3]) -> Vec<(u32, f64)> {
        let nodes = self.mesh().nodes_mm();
        let near = |&n: &u32| {
            let part = 1.0 - square(nodes[n as usize], at) / (GRIP_MM * GRIP_MM);
            (part > 0.0).then_some((n, part * part))
        };
        let mut gripped: Vec<(u32, f64)> = self.surface.iter().filter_map(near).collect();
        let whole: f64 = gripped.iter().map(|(_, share)| share).sum();
        for (_, share) in &mut gripped {
            *share /= whole;
        }
        gripped
    }

    /// Tells the body what hands do.
    fn hand_over(&mut self) {
        let grips: Vec<Grip> = self
            .hold
            .iter()
            .flat_map(|hold| {
                hold.nodes.iter().filter_map(|&(node, share, was)| {
                    Some(Grip {
                        node: self.parts.stepped_of(self.now.removed, node)?,
                        to_mm: [0, 1, 2].map(|i| was[i] + hold.to_mm[i] - hold.from_mm[i]),
                        stiffness_n_per_mm: share * HAND_N_PER_MM,
                    })
                })
            })
            .collect();
        self.stepper.set_hands(&grips, self.ball);
    }
}

/// A material with another shear modulus, everything stress-like in proportion.
fn with_modulus(material: &Material, pa: f64) -> Result<Material, String> {
    let scaled = material.scaled(Parameter::Stiffness, pa / material.shear_modulus_pa());
    scaled.ok_or_else(|| "this law has no modulus".to_owned())
}
