//! Why a stage is made again.

use serde::{Serialize, Serializer};
use serde_json::Value;
use std::fmt;

/// One difference between what a stage was made from and what it would be made from now.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// It has not been made before.
    NotFinished,
    /// Another input of this role.
    Input {
        /// The role.
        role: String,
    },
    /// Another value of a setting.
    Setting {
        /// Its name, with dots between the tables.
        name: String,
        /// What it was.
        old: Value,
        /// What it is.
        new: Value,
    },
    /// An output that is not there.
    OutputMissing {
        /// The file.
        file: String,
    },
    /// An output that is not as it was written.
    OutputChanged {
        /// The file.
        file: String,
    },
    /// Another program, another version of the stage's code or another seed.
    Program,
    /// A stage before it is made again, and may make something else.
    Follows {
        /// Those stages.
        stages: Vec<String>,
    },
}

impl Reason {
    /// The same without values, which may be long.
    pub fn in_short(&self) -> String {
        match self {
            Self::Setting { name, .. } => format!("setting `{name}`"),
            other => other.to_string(),
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinished => write!(f, "it has not finished before"),
            Self::Input { role } => write!(f, "input `{role}` changed"),
            Self::Setting { name, old, new } => write!(f, "setting `{name}` changed from {old} to {new}"),
            Self::OutputMissing { file } => write!(f, "output `{file}` is missing"),
            Self::OutputChanged { file } => write!(f, "output `{file}` was changed"),
            Self::Program => write!(f, "the program, the stage's code or the seed changed"),
            Self::Follows { stages } => {
                write!(f, "it follows {}, unless that makes the same again", stages.join(" and "))
            }
        }
    }
}

impl Serialize for Reason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
