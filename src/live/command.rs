//! What a page may ask for, and within which bounds.

use serde::{Deserialize, Serialize};

/// What changes the body. Lengths in mm, moduli and pressures in Pa.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Command {
    /// Takes hold of the surface around a node, or moves the hand that has.
    Drag {
        /// Node of the mesh.
        node: u32,
        /// Where the hand is.
        to_mm: [f64; 3],
    },
    /// Lets go.
    Release {},
    /// Puts a ball there, or moves it.
    Ball {
        /// Its centre.
        centre_mm: [f64; 3],
        /// Its radius.
        radius_mm: f64,
    },
    /// Takes the ball away.
    Lift {},
    /// Another gravity.
    Gravity {
        /// Acceleration.
        m_per_s2: [f64; 3],
    },
    /// Another density of the tissue.
    Density {
        /// Density.
        kg_per_m3: f64,
    },
    /// Fluid up to a level, or none.
    Csf {
        /// Height of the surface against gravity; none: no fluid.
        level_mm: Option<f64>,
    },
    /// A pressure on a set.
    Pressure {
        /// Facet set or node set.
        set: String,
        /// Pressure, positive pushing into the tissue.
        pa: f64,
    },
    /// Another shear modulus.
    Modulus {
        /// Tissue.
        tissue: String,
        /// Shear modulus at rest.
        pa: f64,
    },
    /// Another law with the same shear modulus at rest.
    Law {
        /// Tissue.
        tissue: String,
        /// Name of the law in files.
        law: String,
    },
    /// Another Poisson's ratio.
    PoissonRatio {
        /// Tissue.
        tissue: String,
        /// nu.
        ratio: f64,
    },
    /// A node set held where it is at rest, or let go.
    Support {
        /// Node set.
        set: String,
        /// Held or not.
        held: bool,
    },
    /// The tissue with the label `resected` taken out, or put back.
    Resection {
        /// Out or in place.
        removed: bool,
    },
    /// Steps in time, or without time towards equilibrium.
    Manner {
        /// Without time.
        quasi_static: bool,
    },
    /// Length of the steps in time, given by the clock.
    TimeStep {
        /// Seconds.
        s: f64,
    },
    /// The last change of materials, loads or supports taken back.
    Undo {},
    /// Everything as it was at the beginning.
    Reset {},
}

/// What the surface is coloured by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Colour {
    /// How far every node has moved, mm.
    #[default]
    Displacement,
    /// Stored energy per volume, Pa, averaged around every node.
    Energy,
    /// How far nodes are from where a later scan, or a phantom's known state, has them, mm.
    Error,
    /// Standard deviation of the displacement by the priors of the shear moduli, mm.
    PriorSd,
    /// The same by the case's estimate, mm.
    EstimateSd,
}

/// What changes only what is shown, and when steps are taken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum View {
    /// A frame has come.
    Ack {},
    /// No steps, or steps again.
    Pause {
        /// Whether none are taken.
        paused: bool,
    },
    /// One step of a body that is paused.
    Step {},
    /// What the surface is coloured by.
    Colour {
        /// One of those that this body has.
        by: Colour,
    },
    /// The state as a scenario that `hgm simulate` repeats.
    ExportScenario {},
    /// The state as a VTU.
    ExportVtu {},
}

/// Names of what only changes the view.
const VIEWS: [&str; 6] = ["ack", "pause", "step", "colour", "export_scenario", "export_vtu"];

/// A message of the page, read.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// For the body.
    Command(Command),
    /// For the view.
    View(View),
}

impl Message {
    /// Reads a message.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn read(text: &str) -> Result<Self, String> {
        let value: serde_json::Value = serde_json::from_str(text).map_err(|e| format!("not JSON: {e}"))?;
        let name =
            value.get("do").and_then(serde_json::Value::as_str).ok_or("`do` is missing: it names the command")?;
        let wrong = |e: serde_json::Error| e.to_string();
        if VIEWS.contains(&name) {
            return serde_json::from_value(value).map(Self::View).map_err(wrong);
        }
        let command: Command = serde_json::from_value(value).map_err(wrong)?;
        command.check()?;
        Ok(Self::Command(command))
    }
}

fn within(name: &str, value: f64, [low, high]: [f64; 2]) -> Result<(), String> {
    if (low..=high).contains(&value) { Ok(()) } else { Err(format!("`{name}` is {value}: it must be {low} to {high}")) }
}

impl Command {
    /// Refuses numbers that no session needs: further out the solver would only lose its way.
    ///
    /// # Errors
    /// The first that is out of its bounds, in words.
    pub fn check(&self) -> Result<(), String> {
        let place = |name: &str, at: &[f64; 3]| at.iter().try_for_each(|&x| within(name, x, [-1e3, 1e3]));
        match self {
            Self::Drag { to_mm, .. } => place("to_mm", to_mm),
            Self::Ball { centre_mm, radius_mm } => {
                place("centre_mm", centre_mm)?;
                within("radius_mm", *radius_mm, [1.0, 60.0])
            }
            Self::Gravity { m_per_s2 } => m_per_s2.iter().try_for_each(|&g| within("m_per_s2", g, [-20.0, 20.0])),
            Self::Density { kg_per_m3 } => within("kg_per_m3", *kg_per_m3, [1.0, 2000.0]),
            Self::Csf { level_mm } => level_mm.map_or(Ok(()), |level| within("level_mm", level, [-500.0, 500.0])),
            Self::Pressure { pa, .. } => within("pa", *pa, [-5000.0, 5000.0]),
            Self::Modulus { pa, .. } => within("pa", *pa, [10.0, 100_000.0]),
            Self::PoissonRatio { ratio, .. } => within("ratio", *ratio, [0.0, 0.499]),
            Self::TimeStep { s } => within("s", *s, [0.001, 0.2]),
            Self::Release {}
            | Self::Lift {}
            | Self::Law { .. }
            | Self::Support { .. }
            | Self::Resection { .. }
            | Self::Manner { .. }
            | Self::Undo {}
            | Self::Reset {} => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_of_a_view_is_one_and_what_is_neither_is_refused_by_name() {
        for name in VIEWS {
            let text = match name {
                "pause" => r#"{"do":"pause","paused":true}"#.to_owned(),
                "colour" => r#"{"do":"colour","by":"energy"}"#.to_owned(),
                _ => format!(r#"{{"do":"{name}"}}"#),
            };
            assert!(matches!(Message::read(&text), Ok(Message::View(_))), "{text}");
        }
        for (text, word) in [
            ("", "JSON"),
            ("[]", "`do`"),
            (r#"{"do":"format_disk"}"#, "format_disk"),
            (r#"{"do":"modulus","tissue":"a"}"#, "pa"),
            (r#"{"do":"modulus","tissue":"a","pa":1e9}"#, "100000"),
            (r#"{"do":"gravity","m_per_s2":[0,0,1e999]}"#, "JSON"),
            (r#"{"do":"undo","too":1}"#, "too"),
            (r#"{"do":"drag","node":-1,"to_mm":[0,0,0]}"#, "-1"),
        ] {
            let said = Message::read(text).unwrap_err();
            assert!(said.contains(word), "{text}: {said}");
        }
    }
}
