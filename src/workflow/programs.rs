//! The programs of other people that hgm can use: looked up here and nowhere else.

use crate::mesh::engine::{Engine, EnginePrograms, Program};
use serde::Serialize;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// A program that hgm can use.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    /// Its file's name.
    pub name: &'static str,
    /// What it is used for.
    pub used_for: &'static str,
    /// The command that installs it.
    pub install: &'static str,
    /// The variable of the environment that may name it.
    pub variable: Option<&'static str>,
}

/// Every program that hgm can use, those of the mesh engines first; it needs none of them.
pub fn known() -> impl Iterator<Item = Known> {
    let engines = Engine::all().filter_map(|engine| engine.mesher().program());
    let engine = |p: &Program| Known { name: p.name, used_for: p.used_for, install: p.install, variable: p.variable };
    engines.map(engine).chain(OTHERS)
}

const OTHERS: [Known; 3] = [
    Known {
        name: "python3",
        used_for: "renderer, cross-checks and cohorts in pipelines/",
        install: "sudo apt-get install python3 python3-venv",
        variable: None,
    },
    Known {
        name: "snakemake",
        used_for: "cohorts",
        install: "pip install snakemake snakemake-executor-plugin-slurm",
        variable: None,
    },
    Known { name: "chromium", used_for: "tests of the page", install: "sudo apt-get install chromium", variable: None },
];

/// Where the programs of this machine are.
#[derive(Clone, Debug, Default)]
pub struct Programs {
    found: Vec<(&'static str, PathBuf)>,
}

impl Programs {
    /// Looks for every program: where its variable says, beside the `executable` (and where `./run engines` builds), then
    /// on the `PATH` that `variable` gives.
    pub fn look_up(executable: Option<&Path>, variable: impl Fn(&str) -> Option<OsString>) -> Self {
        let path = variable("PATH").unwrap_or_default();
        let beside = executable.and_then(Path::parent).map(|d| [d.to_path_buf(), d.join("../engines")]);
        let folders: Vec<PathBuf> = beside.into_iter().flatten().chain(std::env::split_paths(&path)).collect();
        let place = |known: Known| {
            let named = known.variable.and_then(&variable).map(PathBuf::from);
            let places = named.into_iter().chain(folders.iter().map(|folder| folder.join(known.name)));
            places.into_iter().find(|file| file.is_file()).map(|file| (known.name, file))
        };
        Self { found: known().filter_map(place).collect() }
    }

    /// Where a program is.
    pub fn find(&self, name: &str) -> Option<&Path> {
        self.found.iter().find(|(known, _)| *known == name).map(|(_, file)| file.as_path())
    }

    /// Those that make meshes.
    pub fn engines(&self) -> EnginePrograms {
        EnginePrograms::of(|name| self.find(name).map(Path::to_path_buf))
    }
}

/// One program that hgm can use but does not need, and whether it is there.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// Its file's name.
    pub what: &'static str,
    /// What it is used for.
    pub used_for: &'static str,
    /// Whether it was found.
    pub found: bool,
    /// Where.
    pub location: Option<String>,
    /// The command that installs it.
    pub install: &'static str,
}

impl Programs {
    /// Every program that hgm can use, with where it is.
    pub fn findings(&self) -> Vec<Finding> {
        let finding = |known: Known| {
            let location = self.find(known.name).map(|path| path.display().to_string());
            let Known { name: what, used_for, install, .. } = known;
            Finding { what, used_for, found: location.is_some(), location, install }
        };
        known().map(finding).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_named_program_wins_over_one_beside_and_that_over_the_path() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str| {
            let file = folder.path().join(name);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(&file, "").unwrap();
            file
        };
        let path = folder.path().join("path");
        let on_path = put("path/hgm-cgal-mesher");
        let look_up = |named: Option<&Path>| {
            let variable = |name: &str| match name {
                "PATH" => Some(path.clone().into_os_string()),
                "HGM_CGAL_MESHER" => named.map(|file| file.as_os_str().to_owned()),
                _ => None,
            };
            let executable = folder.path().join("release/hgm");
            Programs::look_up(Some(&executable), variable).engines().place(Engine::CGAL).map(Path::to_path_buf)
        };
        assert_eq!(look_up(None), Some(on_path));
        std::fs::create_dir_all(folder.path().join("release")).unwrap();
        put("engines/hgm-cgal-mesher");
        assert_eq!(look_up(None), Some(folder.path().join("release/../engines/hgm-cgal-mesher")));
        let own = put("own/mesher");
        assert_eq!(look_up(Some(&own)), Some(own));
        assert_eq!(Programs::look_up(None, |_| None).find("gmsh"), None);
    }
}
