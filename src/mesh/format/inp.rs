//! Abaqus input (.inp): nodes, C3D4 elements, one ELSET per label, one NSET per node set, one SURFACE per facet set.
//!
//! Names keep letters, digits and underscores; other characters become underscores. Source: Abaqus Keywords
//! Reference (*NODE, *ELEMENT, *ELSET, *NSET, *SURFACE) and Elements Guide (faces of C3D4).

use super::{WriteError, facet_owners, label_name, line, plain_name};
use crate::mesh::TetMesh;
use std::collections::{BTreeMap, BTreeSet};

/// Abaqus' face number (S1..S4) of our local face `f`, the one opposite corner `f`:
/// S1 = 1-2-3, S2 = 1-4-2, S3 = 2-4-3, S4 = 3-4-1.
const ABAQUS_FACE: [usize; 4] = [3, 4, 2, 1];

/// The bytes of an Abaqus input file.
///
/// # Errors
/// [`WriteError::Duplicate`] when two sets get the same name.
pub fn encode(mesh: &TetMesh) -> Result<Vec<u8>, WriteError> {
    let mut text = String::from("*HEADING\ntetrahedra in mm, RAS+\n*NODE\n");
    for (n, [x, y, z]) in mesh.nodes_mm().iter().enumerate() {
        line(&mut text, format_args!("{}, {x:?}, {y:?}, {z:?}", n + 1));
    }
    text += "*ELEMENT, TYPE=C3D4\n";
    for (t, tet) in mesh.tets().iter().enumerate() {
        let [a, b, c, d] = tet.map(|n| n + 1);
        line(&mut text, format_args!("{}, {a}, {b}, {c}, {d}", t + 1));
    }
    let mut by_label: BTreeMap<u8, Vec<usize>> = BTreeMap::new();
    for (t, &label) in mesh.labels().iter().enumerate() {
        by_label.entry(label).or_default().push(t + 1);
    }
    for (&label, tets) in &by_label {
        line(&mut text, format_args!("*ELSET, ELSET={}", label_name(label)));
        numbers(&mut text, tets);
    }
    let mut names = BTreeSet::new();
    for (name, nodes) in &mesh.node_sets {
        let name = unique(name, &mut names)?;
        line(&mut text, format_args!("*NSET, NSET={name}"));
        numbers(&mut text, &nodes.iter().map(|&n| n as usize + 1).collect::<Vec<_>>());
    }
    names.clear();
    for (name, facets) in &mesh.facet_sets {
        let name = unique(name, &mut names)?;
        line(&mut text, format_args!("*SURFACE, TYPE=ELEMENT, NAME={name}"));
        for (tet, face) in facet_owners(mesh, facets) {
            line(&mut text, format_args!("{}, S{}", tet + 1, ABAQUS_FACE[face]));
        }
    }
    Ok(text.into_bytes())
}

fn unique(name: &str, names: &mut BTreeSet<String>) -> Result<String, WriteError> {
    let plain = plain_name(name);
    // Abaqus does not tell capitals apart.
    if names.insert(plain.to_ascii_uppercase()) { Ok(plain) } else { Err(WriteError::Duplicate { name: plain }) }
}

/// At most 16 numbers a line, as the format demands.
fn numbers(text: &mut String, numbers: &[usize]) {
    for row in numbers.chunks(16) {
        line(text, format_args!("{}", row.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TET_FACES;

    #[test]
    fn abaqus_faces_are_the_faces_we_mean() {
        let abaqus = [[1, 2, 3], [1, 4, 2], [2, 4, 3], [3, 4, 1]];
        for (ours, face) in TET_FACES.iter().enumerate() {
            let sorted = |mut f: [usize; 3]| {
                f.sort_unstable();
                f
            };
            assert_eq!(sorted(face.map(|c| c + 1)), sorted(abaqus[ABAQUS_FACE[ours] - 1]));
        }
    }

    #[test]
    fn names_that_fall_together_are_refused() {
        let nodes = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3]], vec![2]).unwrap();
        mesh.set_nodes("a b", vec![0]).unwrap();
        mesh.facet_sets.insert("a b".into(), vec![[0, 2, 1]]);
        assert!(String::from_utf8(encode(&mesh).unwrap()).unwrap().contains("NAME=a_b\n1, S1\n"));
        mesh.set_nodes("A_b", vec![1]).unwrap();
        assert_eq!(encode(&mesh), Err(WriteError::Duplicate { name: "a_b".into() }));
    }
}
