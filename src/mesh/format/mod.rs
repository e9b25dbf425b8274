//! Mesh files: bytes in, values out, and back. No function here touches the disk.
//!
//! Labels and boundary sets survive every format in the way its common readers keep them: see each file.

pub mod feb;
pub mod gifti;
mod gifti_space;
pub mod inp;
pub mod msh;
pub mod ply;
pub mod pvd;
pub mod stl;
mod vtk_array;
pub mod vtu;
mod vtu_file;

use super::{MeshError, TET_FACES, TetMesh};
use crate::segment::label;
use std::collections::BTreeSet;
use std::fmt::{Arguments, Write};
use thiserror::Error;

/// Numbers on nodes or on cells, `components` each, in order of node or tetrahedron.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Name in the file; the unit belongs into it (`rmse_mm`).
    pub name: String,
    /// Numbers per node or cell.
    pub components: usize,
    /// `components` times the number of nodes or cells, component fastest.
    pub values: Vec<f64>,
}

impl Field {
    /// One number per node or cell.
    pub fn scalar(name: &str, values: Vec<f64>) -> Self {
        Self { name: name.to_owned(), components: 1, values }
    }

    /// A 3-vector per node or cell.
    pub fn vector(name: &str, values: &[[f64; 3]]) -> Self {
        Self { name: name.to_owned(), components: 3, values: values.as_flattened().to_vec() }
    }

    /// The values as 3-vectors; `None` unless there are three components.
    pub fn vectors(&self) -> Option<Vec<[f64; 3]>> {
        (self.components == 3).then(|| self.values.as_chunks::<3>().0.to_vec())
    }
}

/// A mesh and what its file says of nodes and cells besides labels and sets.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshWithFields {
    /// Tetrahedra, labels, node sets, facet sets.
    pub mesh: TetMesh,
    /// Fields on the nodes.
    pub point_fields: Vec<Field>,
    /// Fields on the tetrahedra.
    pub cell_fields: Vec<Field>,
}

impl MeshWithFields {
    /// The node field of this name.
    pub fn point_field(&self, name: &str) -> Option<&Field> {
        self.point_fields.iter().find(|f| f.name == name)
    }

    /// The cell field of this name.
    pub fn cell_field(&self, name: &str) -> Option<&Field> {
        self.cell_fields.iter().find(|f| f.name == name)
    }
}

/// Why bytes are not a mesh we can use. Every message names the file, the field and the remedy.
#[derive(Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum ReadError {
    #[error("{file}: {field}: {problem}; the file is damaged or was cut short: write or copy it again")]
    Damaged { file: String, field: String, problem: String },
    #[error("{file}: {field}: {problem}")]
    Unsupported { file: String, field: String, problem: String },
    #[error("{file}: cells: {source}")]
    Mesh { file: String, source: MeshError },
}

/// Why values cannot be written.
#[derive(Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum WriteError {
    #[error("field `{field}` has {found} numbers, but {expected} are needed ({components} for each of {places})")]
    FieldLength { field: String, components: usize, places: usize, expected: usize, found: usize },
    #[error("two arrays would be named `{name}`: rename the mesh's set of that name")]
    Duplicate { name: String },
    #[error("{what}: {count} is more than the format can number; mesh it coarser")]
    TooMany { what: String, count: usize },
}

/// Adds one line of text.
fn line(text: &mut String, words: Arguments<'_>) {
    writeln!(text, "{words}").expect("writing to memory does not fail");
}

/// What formats with names call a label: `grey_matter`, or `label_17` for one without a name.
fn label_name(label: u8) -> String {
    label::name(label).map_or_else(|| format!("label_{label}"), str::to_owned)
}

/// A name of letters, digits and underscores that starts with a letter, for formats that take no others.
fn plain_name(name: &str) -> String {
    let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if plain.starts_with(|c: char| c.is_ascii_alphabetic()) { plain } else { format!("set_{plain}") }
}

/// Refuses fields of the wrong length and names that occur twice (`taken` are names the format itself uses).
fn check_fields(fields: &[Field], places: usize, taken: &[&str]) -> Result<(), WriteError> {
    let mut names: BTreeSet<&str> = taken.iter().copied().collect();
    for field in fields {
        let expected = field.components * places;
        if field.values.len() != expected {
            return Err(WriteError::FieldLength {
                field: field.name.clone(),
                components: field.components,
                places,
                expected,
                found: field.values.len(),
            });
        }
        if !names.insert(&field.name) {
            return Err(WriteError::Duplicate { name: field.name.clone() });
        }
    }
    Ok(())
}

/// For every facet of `facets`, the tetrahedron and local face it belongs to (see [`TET_FACES`]); the one that sees
/// the facet outward is preferred, so that a facet inside the mesh keeps its side, and one that is there for either side
/// keeps both: where a sheet that is cut open ends, a facet's two sides may have the same three nodes. Facets of no
/// tetrahedron are left out, and so is what stands there twice.
fn facet_owners(mesh: &TetMesh, facets: &[[u32; 3]]) -> Vec<(usize, usize)> {
    let sorted = |mut f: [u32; 3]| {
        f.sort_unstable();
        f
    };
    let mut wanted: Vec<([u32; 3], usize)> = facets.iter().enumerate().map(|(n, f)| (sorted(*f), n)).collect();
    wanted.sort_unstable();
    let mut is_wanted = vec![false; mesh.nodes_mm().len()];
    for &n in facets.iter().flatten() {
        is_wanted[n as usize] = true;
    }
    let mut owners: Vec<Option<(usize, usize, bool)>> = vec![None; facets.len()];
    for (t, tet) in mesh.tets().iter().enumerate() {
        if tet.iter().filter(|&&n| is_wanted[n as usize]).count() < 3 {
            continue;
        }
        for (f, corners) in TET_FACES.iter().enumerate() {
            let face = corners.map(|c| tet[c]);
            let key = sorted(face);
            let first = wanted.partition_point(|(other, _)| *other < key);
            for &(_, n) in wanted[first..].iter().take_while(|(other, _)| *other == key) {
                let outward = (0..3).any(|s| [face[s], face[(s + 1) % 3], face[(s + 2) % 3]] == facets[n]);
                if owners[n].is_none_or(|(.., was_outward)| outward && !was_outward) {
                    owners[n] = Some((t, f, outward));
                }
            }
        }
    }
    let mut seen = BTreeSet::new();
    owners.into_iter().flatten().map(|(t, f, _)| (t, f)).filter(|owner| seen.insert(*owner)).collect()
}
