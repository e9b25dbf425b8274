//! Where the engines' programs are.

use super::choice::Engine;
use super::error::EngineError;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Where the programs are, by their names; a missing one is not in the list.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EnginePrograms {
    found: BTreeMap<&'static str, PathBuf>,
}

impl EnginePrograms {
    /// Those of the engines' programs that have a place.
    pub fn of(place: impl Fn(&str) -> Option<PathBuf>) -> Self {
        let programs = Engine::all().filter_map(|engine| engine.mesher().program());
        Self { found: programs.filter_map(|program| Some((program.name, place(program.name)?))).collect() }
    }

    /// Where an engine's program is; `None` where it is missing, and for an engine of our own.
    pub fn place(&self, engine: Engine) -> Option<&Path> {
        self.found.get(engine.mesher().program()?.name).map(PathBuf::as_path)
    }

    /// Whether an engine can run.
    pub fn has(&self, engine: Engine) -> bool {
        engine.mesher().program().is_none() || self.place(engine).is_some()
    }

    /// The engine's program; `None` for an engine of our own.
    ///
    /// # Errors
    /// [`EngineError::Missing`] when it is not there.
    pub fn check(&self, engine: Engine) -> Result<Option<&Path>, EngineError> {
        match (engine.mesher().program(), self.place(engine)) {
            (None, _) => Ok(None),
            (Some(_), Some(place)) => Ok(Some(place)),
            (Some(program), None) => Err(EngineError::Missing { engine: engine.name(), program: program.name }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_engine_runs_where_its_program_has_a_place() {
        let programs = EnginePrograms::of(|name| (name == "gmsh").then(|| PathBuf::from("bin/gmsh")));
        assert_eq!(programs.place(Engine::GMSH), Some(Path::new("bin/gmsh")));
        assert!(programs.has(Engine::GMSH) && programs.has(Engine::LATTICE) && !programs.has(Engine::TETGEN));
        assert!(matches!(programs.check(Engine::CGAL), Err(EngineError::Missing { engine: "cgal", .. })));
        let all = EnginePrograms::of(|name| Some(PathBuf::from(name)));
        assert_eq!(all.check(Engine::LATTICE).unwrap(), None);
    }
}
