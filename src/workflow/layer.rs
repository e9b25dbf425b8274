//! A layer of settings that are given one by one: options of a command line, arguments of a call.

use serde::Serialize;

/// Settings given one by one, as a layer over others.
#[derive(Clone, Debug, Default)]
pub struct Layer(pub toml::Table);

impl Layer {
    /// Sets what was given: `path` is the table and the setting, with dots between.
    pub fn set(&mut self, path: &str, value: Option<impl Serialize>) {
        let Some(value) = value.and_then(|value| toml::Value::try_from(value).ok()) else { return };
        let mut names: Vec<&str> = path.split('.').collect();
        let last = names.pop().unwrap_or_default();
        let mut table = &mut self.0;
        for name in names {
            let below = table.entry(name).or_insert_with(|| toml::Value::Table(toml::Table::new()));
            let toml::Value::Table(below) = below else { return };
            table = below;
        }
        table.insert(last.to_owned(), value);
    }

    /// The same for what is there or not.
    pub fn switch(&mut self, path: &str, on: bool) {
        self.set(path, on.then_some(true));
    }

    /// The same for what may be given again and again.
    pub fn list(&mut self, path: &str, values: &[impl Serialize]) {
        self.set(path, (!values.is_empty()).then_some(values));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::meta_model::MetaModel;
    use crate::mesh::engine::{Engine, MeshSize};
    use crate::workflow::Settings;

    #[test]
    fn what_is_given_wins_over_the_file_and_leaves_the_rest_of_it() {
        let file =
            "[mesh]\nengine = \"gmsh\"\n[mesh.size]\nedge_mm = 3.0\n[prior]\npublished = true\n".parse().unwrap();
        let mut given = Layer::default();
        given.set("mesh.size", Some(MeshSize::Cells(8000)));
        given.set("prior.law", Some(MetaModel::OGDEN));
        given.set("prior.study", None::<u8>);
        let settings = Settings::resolve([&file, &given.0]).unwrap();
        assert_eq!((settings.mesh.engine, settings.mesh.size), (Engine::GMSH, MeshSize::Cells(8000)));
        assert!(settings.prior.published && settings.prior.law == MetaModel::OGDEN);
    }
}
