//! An engine as settings and manifests name it.

use super::ENGINES;
use super::{cgal, gmsh, lattice, mesher::Mesher, tetgen};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// One of the engines.
#[derive(Clone, Copy)]
pub struct Engine(&'static dyn Mesher);

impl Engine {
    /// Our body-centred lattice; always there.
    pub const LATTICE: Self = Self(&lattice::Lattice);
    /// CGAL's Mesh_3 through our small program.
    pub const CGAL: Self = Self(&cgal::Cgal);
    /// gmsh, inside our own interface surface.
    pub const GMSH: Self = Self(&gmsh::Gmsh);
    /// TetGen, inside our own interface surface.
    pub const TETGEN: Self = Self(&tetgen::Tetgen);

    /// Every engine.
    pub fn all() -> impl Iterator<Item = Self> {
        ENGINES.into_iter().map(Self)
    }

    /// The engine of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().find(|engine| engine.name() == name)
    }

    /// The names of all engines, `cgal, lattice, ... or tetgen`.
    pub fn names() -> String {
        let names = ENGINES.map(Mesher::name);
        let (last, others) = names.split_last().map_or(("", &[][..]), |(last, others)| (*last, others));
        format!("{} or {last}", others.join(", "))
    }

    /// The name used on the command line and in manifests.
    pub fn name(self) -> &'static str {
        self.0.name()
    }

    /// What it can.
    pub(crate) fn mesher(self) -> &'static dyn Mesher {
        self.0
    }
}

impl PartialEq for Engine {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for Engine {}

impl std::fmt::Debug for Engine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Engine {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Engine {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::named(&name).ok_or_else(|| {
            let known = ENGINES.map(|engine| format!("`{}`", engine.name())).join(", ");
            D::Error::custom(format!("unknown variant `{name}`, expected one of {known}"))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_engine_is_read_back_by_its_name() {
        for engine in Engine::all() {
            let text = serde_json::to_string(&engine).unwrap();
            assert_eq!(serde_json::from_str::<Engine>(&text).unwrap(), engine);
        }
        let error = serde_json::from_str::<Engine>("\"netgen\"").unwrap_err().to_string();
        assert!(error.contains("`netgen`, expected one of `cgal`, `lattice`, `gmsh`, `tetgen`"), "{error}");
        assert_eq!(Engine::names(), "cgal, lattice, gmsh or tetgen");
    }
}
