//! The state as files that `hgm simulate` and ParaView take.

use super::colours::Colours;
use super::command::Colour;
use super::session::Session;
use crate::fem::{Method, Prescribed, Scenario};
use crate::mesh::TetMesh;
use crate::mesh::format::{Field, vtu};

/// The state of a session.
pub struct Export {
    /// The undeformed mesh; nodes under a hand are sets of their own.
    mesh: TetMesh,
    scenario: Scenario,
    removed: bool,
    points: Vec<Field>,
    cells: Vec<Field>,
}

impl Export {
    /// The state as it is. Springs of a hand and the ball stand in no scenario: the nodes they act on are held where they
    /// are, which is the same equilibrium once the body is at rest.
    ///
    /// # Errors
    /// In words, where a hand's sets cannot be made.
    pub fn of(session: &Session) -> Result<Self, String> {
        let stepper = session.stepper();
        let mut mesh = stepper.mesh().clone();
        let mut scenario = session.scenario().clone();
        scenario.solver.method = Method::Static;
        for node in stepper.touched() {
            let set = format!("hand-{node}");
            mesh.set_nodes(&set, vec![node]).map_err(|e| e.to_string())?;
            let displacement_mm = stepper.displacement_of_mm(node);
            scenario.prescribed.push(Prescribed { set, displacement_mm, components: [true; 3] });
        }
        let (jacobian, energy) = stepper.cells();
        let points = vec![Field::vector("displacement", &stepper.displacement_mm())];
        let cells = vec![Field::scalar("jacobian", jacobian), Field::scalar("strain_energy_density_pa", energy)];
        let removed = session.resection() == Some(true);
        Ok(Self { mesh, scenario, removed, points, cells })
    }

    /// With what else the surface can be coloured by on the nodes, mm: distance to the target, standard deviation by the priors
    /// where that was asked for, and by the estimate; -1 where it is not known.
    #[must_use]
    pub fn coloured(mut self, session: &Session, colours: &Colours) -> Self {
        for (colour, name) in [
            (Colour::Error, "target_distance_mm"),
            (Colour::PriorSd, "displacement_sd_prior_mm"),
            (Colour::EstimateSd, "displacement_sd_mm"),
        ] {
            if colours.is_ready(colour) {
                let numbers = session.of_stepped(&colours.numbers(session, colour));
                self.points.push(Field::scalar(name, numbers));
            }
        }
        self
    }

    /// SCENARIO.toml.
    ///
    /// # Errors
    /// In words.
    pub fn scenario_toml(&self) -> Result<String, String> {
        let text = toml::to_string(&self.scenario).map_err(|e| e.to_string())?;
        let mut head =
            "# A state of `hgm live`; repeat it with: hgm simulate MESH.vtu SCENARIO.toml -o OUT.vtu\n".to_owned();
        if !self.scenario.prescribed.is_empty() {
            head += "# What a hand held stands in sets of the VTU exported beside it: give that file as MESH.vtu.\n";
        }
        if self.removed {
            head +=
                "# The resected tissue is out, as it is in the VTU exported beside it: give that file as MESH.vtu.\n";
        }
        Ok(head + &text)
    }

    /// The bytes of a VTU: the undeformed mesh with its sets, displacement, volume ratio and energy.
    ///
    /// # Errors
    /// In words.
    pub fn vtu(&self) -> Result<Vec<u8>, String> {
        vtu::encode(&self.mesh, &self.points, &self.cells).map_err(|e| e.to_string())
    }
}
