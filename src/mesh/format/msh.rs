//! MSH 4.1, gmsh's own format, with everything named as gmsh names it.
//!
//! Every label is a physical volume (tag = label, name = the label's name), every facet set a physical surface and
//! every node set a physical point group of point elements. Each group is one entity of its own, so that readers
//! that keep one physical tag per element (meshio) lose nothing where sets overlap. Node and element tags are the
//! numbers of nodes and tetrahedra plus one. Source: the gmsh reference manual, "MSH file format".

use super::{ReadError, WriteError, label_name, line};
use crate::mesh::TetMesh;
use std::collections::BTreeMap;

/// gmsh element types: triangle, tetrahedron, point.
const TRIANGLE: i64 = 2;
const TETRAHEDRON: i64 = 4;
const POINT: i64 = 15;

/// The bytes of an MSH 4.1 text file.
///
/// # Errors
/// [`WriteError::TooMany`] when element tags would pass 32 bits, which gmsh cannot number.
pub fn encode(mesh: &TetMesh) -> Result<Vec<u8>, WriteError> {
    let elements = mesh.tets().len()
        + mesh.facet_sets.values().map(Vec::len).sum::<usize>()
        + mesh.node_sets.values().map(Vec::len).sum::<usize>();
    if i32::try_from(elements).is_err() {
        return Err(WriteError::TooMany { what: "elements".into(), count: elements });
    }
    let mut by_label: BTreeMap<u8, Vec<usize>> = BTreeMap::new();
    for (t, &label) in mesh.labels().iter().enumerate() {
        by_label.entry(label).or_default().push(t);
    }
    // A node belongs to the volume of the first label that uses it; one of no tetrahedron to the first volume.
    // gmsh has no volume 0, so label 0 takes the number after the last.
    let volume_tag = |label: u8| if label == 0 { 256 } else { i64::from(label) };
    let labels: Vec<u8> = by_label.keys().copied().collect();
    let mut owner = vec![labels[0]; mesh.nodes_mm().len()];
    for (&label, tets) in by_label.iter().rev() {
        for &n in tets.iter().flat_map(|&t| &mesh.tets()[t]) {
            owner[n as usize] = label;
        }
    }

    let mut text = String::from("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n");
    line(&mut text, format_args!("{}", mesh.node_sets.len() + mesh.facet_sets.len() + labels.len()));
    for (n, name) in mesh.node_sets.keys().enumerate() {
        line(&mut text, format_args!("0 {} \"{}\"", n + 1, quotable(name)));
    }
    for (n, name) in mesh.facet_sets.keys().enumerate() {
        line(&mut text, format_args!("2 {} \"{}\"", n + 1, quotable(name)));
    }
    for &label in &labels {
        line(&mut text, format_args!("3 {} \"{}\"", volume_tag(label), label_name(label)));
    }
    text += "$EndPhysicalNames\n$Entities\n";
    line(&mut text, format_args!("{} 0 {} {}", mesh.node_sets.len(), mesh.facet_sets.len(), labels.len()));
    for (n, nodes) in mesh.node_sets.values().enumerate() {
        let [x, y, z] = nodes.first().map_or([0.0; 3], |&n| mesh.nodes_mm()[n as usize]);
        line(&mut text, format_args!("{0} {x:?} {y:?} {z:?} 1 {0}", n + 1));
    }
    for (n, facets) in mesh.facet_sets.values().enumerate() {
        let extent = extent(mesh, facets.iter().flatten());
        line(&mut text, format_args!("{0} {extent} 1 {0} 0", n + 1));
    }
    for (&label, tets) in &by_label {
        let extent = extent(mesh, tets.iter().flat_map(|&t| &mesh.tets()[t]));
        line(&mut text, format_args!("{0} {extent} 1 {0} 0", volume_tag(label)));
    }

    text += "$EndEntities\n$Nodes\n";
    let count = mesh.nodes_mm().len();
    let used: Vec<u8> = labels.iter().copied().filter(|label| owner.contains(label)).collect();
    line(&mut text, format_args!("{} {count} 1 {count}", used.len()));
    for &label in &used {
        let nodes: Vec<usize> = (0..count).filter(|&n| owner[n] == label).collect();
        line(&mut text, format_args!("3 {} 0 {}", volume_tag(label), nodes.len()));
        for n in &nodes {
            line(&mut text, format_args!("{}", n + 1));
        }
        for &n in &nodes {
            let [x, y, z] = mesh.nodes_mm()[n];
            line(&mut text, format_args!("{x:?} {y:?} {z:?}"));
        }
    }

    text += "$EndNodes\n$Elements\n";
    let filled = |sets: usize, empty: usize| sets - empty;
    let node_blocks = filled(mesh.node_sets.len(), mesh.node_sets.values().filter(|s| s.is_empty()).count());
    let facet_blocks = filled(mesh.facet_sets.len(), mesh.facet_sets.values().filter(|s| s.is_empty()).count());
    line(&mut text, format_args!("{} {elements} 1 {elements}", node_blocks + facet_blocks + labels.len()));
    let mut tag = mesh.tets().len();
    for (n, nodes) in mesh.node_sets.values().enumerate().filter(|(_, nodes)| !nodes.is_empty()) {
        line(&mut text, format_args!("0 {} {POINT} {}", n + 1, nodes.len()));
        for node in nodes {
            tag += 1;
            line(&mut text, format_args!("{tag} {}", node + 1));
        }
    }
    for (n, facets) in mesh.facet_sets.values().enumerate().filter(|(_, facets)| !facets.is_empty()) {
        line(&mut text, format_args!("2 {} {TRIANGLE} {}", n + 1, facets.len()));
        for [a, b, c] in facets {
            tag += 1;
            line(&mut text, format_args!("{tag} {} {} {}", a + 1, b + 1, c + 1));
        }
    }
    for (&label, tets) in &by_label {
        line(&mut text, format_args!("3 {} {TETRAHEDRON} {}", volume_tag(label), tets.len()));
        for &t in tets {
            let [a, b, c, d] = mesh.tets()[t].map(|n| n + 1);
            line(&mut text, format_args!("{} {a} {b} {c} {d}", t + 1));
        }
    }
    text += "$EndElements\n";
    Ok(text.into_bytes())
}

/// A quote would end the name, and gmsh knows no escape.
fn quotable(name: &str) -> String {
    name.replace('"', "'")
}

fn extent<'a>(mesh: &TetMesh, nodes: impl Iterator<Item = &'a u32>) -> String {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for &n in nodes {
        for (axis, &x) in mesh.nodes_mm()[n as usize].iter().enumerate() {
            low[axis] = low[axis].min(x);
            high[axis] = high[axis].max(x);
        }
    }
    let words = |p: [f64; 3]| p.map(|x| format!("{:?}", if x.is_finite() { x } else { 0.0 })).join(" ");
    format!("{} {}", words(low), words(high))
}

/// A mesh from the bytes of an MSH 4.1 file, text or binary; `name` is what messages call the file.
///
/// Labels are the tags of the physical volumes. Physical points become node sets, physical surfaces facet sets (turned
/// outwards where they are part of the outer surface), and, where no physical point group has the same name, node sets too.
/// Nodes and tetrahedra come in order of their tags.
///
/// # Errors
/// [`ReadError`] for another version, a damaged file, tetrahedra without a physical volume, elements of volume that
/// are not linear tetrahedra, and whatever [`TetMesh::new`] refuses.
pub fn decode(bytes: &[u8], name: &str) -> Result<TetMesh, ReadError> {
    let mut file = File { name, rest: bytes, binary: false, section: "MeshFormat" };
    let (mut names, mut groups) = (BTreeMap::new(), BTreeMap::new());
    let (mut nodes, mut elements, mut ended) = (Vec::new(), Elements::default(), false);
    while let Some(section) = file.next_section()? {
        match section {
            "MeshFormat" => file.read_format()?,
            "PhysicalNames" => names = file.read_names()?,
            "Entities" => groups = file.read_entities()?,
            "Nodes" => nodes = file.read_nodes()?,
            "Elements" => {
                elements = file.read_elements()?;
                ended = true;
            }
            "PartitionedEntities" => {
                return Err(file.unsupported("the mesh is partitioned; save it as one part".to_owned()));
            }
            _ => {}
        }
        file.skip_to_end(section)?;
    }
    file.section = "Elements";
    if !ended {
        return Err(file.damaged("the section is missing".to_owned()));
    }
    assemble(&file, &names, &groups, nodes, elements)
}

/// The names of the physical volumes by their tags; none where the file has no such section.
pub fn volume_names(bytes: &[u8]) -> BTreeMap<u8, String> {
    let mut file = File { name: "", rest: bytes, binary: false, section: "MeshFormat" };
    let mut names = Names::new();
    while let Ok(Some(section)) = file.next_section() {
        if section == "PhysicalNames" {
            names = file.read_names().unwrap_or_default();
            break;
        }
        if file.skip_to_end(section).is_err() {
            break;
        }
    }
    let volumes = names.into_iter().filter(|((dimension, _), _)| *dimension == 3);
    volumes.filter_map(|((_, tag), name)| Some((u8::try_from(tag).ok()?, name))).collect()
}

type Names = BTreeMap<(i64, i64), String>;
type Groups = BTreeMap<(i64, i64), Vec<i64>>;

/// Elements by kind: tag, entity, node tags.
#[derive(Default)]
struct Elements {
    points: Vec<(i64, u64)>,
    triangles: Vec<(i64, [u64; 3])>,
    tets: Vec<(u64, i64, [u64; 4])>,
}

fn assemble(
    file: &File<'_>,
    names: &Names,
    groups: &Groups,
    mut nodes: Vec<(u64, [f64; 3])>,
    mut elements: Elements,
) -> Result<TetMesh, ReadError> {
    nodes.sort_by_key(|n| n.0);
    if let Some(pair) = nodes.windows(2).find(|p| p[0].0 == p[1].0) {
        return Err(file.damaged(format!("node {} is there twice", pair[0].0)));
    }
    let number = |tag: u64| -> Result<u32, ReadError> {
        let found = nodes.binary_search_by_key(&tag, |n| n.0);
        found.map(|n| n as u32).map_err(|_| file.damaged(format!("an element names node {tag}, which is not there")))
    };
    elements.tets.sort_by_key(|t| t.0);
    let (mut tets, mut labels) = (Vec::new(), Vec::new());
    for &(tag, entity, [a, b, c, d]) in &elements.tets {
        tets.push([number(a)?, number(b)?, number(c)?, number(d)?]);
        let of_volume = groups.get(&(3, entity)).map_or(&[][..], Vec::as_slice);
        if let Some([first, second]) = of_volume.windows(2).find(|pair| pair[0] != pair[1]) {
            return Err(file.unsupported(format!(
                "tetrahedron {tag} lies in volume {entity}, which is in the physical groups {first} and {second}: leave it in the one \
                 that is its tissue"
            )));
        }
        let group = of_volume.first().ok_or_else(|| {
            file.unsupported(format!(
                "tetrahedron {tag} lies in volume {entity}, which is in no physical group; \
                 add `Physical Volume(\"grey_matter\", 2) = {{...}};` and the like"
            ))
        })?;
        let label = if *group == 256 { 0 } else { *group };
        labels.push(u8::try_from(label).map_err(|_| {
            file.unsupported(format!("physical volume {group} is no label: number the groups from 1 to 255"))
        })?);
    }
    let points = elements.points.iter().map(|&(entity, n)| Ok((entity, number(n)?))).collect::<Result<Vec<_>, _>>()?;
    let triangles = elements
        .triangles
        .iter()
        .map(|&(entity, [a, b, c])| Ok((entity, [number(a)?, number(b)?, number(c)?])))
        .collect::<Result<Vec<_>, _>>()?;
    let nodes_mm = nodes.iter().map(|n| n.1).collect();
    let mut mesh = TetMesh::new(nodes_mm, tets, labels)
        .map_err(|source| ReadError::Mesh { file: file.name.to_owned(), source })?;

    let name_of = |dimension: i64, tag: i64| {
        let unnamed = || format!("{}_{tag}", if dimension == 0 { "points" } else { "surface" });
        names.get(&(dimension, tag)).cloned().unwrap_or_else(unnamed)
    };
    for (&(dimension, entity), tags) in groups.iter().filter(|(key, _)| key.0 == 0 || key.0 == 2) {
        for &tag in tags {
            let set = name_of(dimension, tag);
            if dimension == 0 {
                let nodes = points.iter().filter(|p| p.0 == entity).map(|p| p.1);
                mesh.node_sets.entry(set).or_default().extend(nodes);
            } else {
                let facets = triangles.iter().filter(|t| t.0 == entity).map(|t| t.1);
                mesh.facet_sets.entry(set).or_default().extend(facets);
            }
        }
    }
    mesh.turn_facets_outwards();
    for (set, facets) in &mesh.facet_sets {
        if !mesh.node_sets.contains_key(set) {
            mesh.node_sets.insert(set.clone(), facets.as_flattened().to_vec());
        }
    }
    for nodes in mesh.node_sets.values_mut() {
        nodes.sort_unstable();
        nodes.dedup();
    }
    Ok(mesh)
}

struct File<'a> {
    name: &'a str,
    rest: &'a [u8],
    binary: bool,
    section: &'a str,
}

impl<'a> File<'a> {
    fn damaged(&self, problem: String) -> ReadError {
        ReadError::Damaged { file: self.name.to_owned(), field: format!("${}", self.section), problem }
    }

    fn unsupported(&self, problem: String) -> ReadError {
        ReadError::Unsupported { file: self.name.to_owned(), field: format!("${}", self.section), problem }
    }

    fn line(&mut self) -> &'a str {
        let end = self.rest.iter().position(|&b| b == b'\n');
        let (line, rest) = self.rest.split_at(end.map_or(self.rest.len(), |e| e + 1));
        self.rest = rest;
        std::str::from_utf8(line).unwrap_or("").trim()
    }

    /// Moves behind the next `$Section` line.
    fn next_section(&mut self) -> Result<Option<&'a str>, ReadError> {
        while !self.rest.is_empty() {
            let line = self.line();
            if let Some(section) = line.strip_prefix('$') {
                self.section = section;
                return Ok(Some(section));
            }
            if !line.is_empty() {
                return Err(self.damaged("this is not an MSH file, or there is text between its sections".to_owned()));
            }
        }
        Ok(None)
    }

    fn skip_to_end(&mut self, section: &str) -> Result<(), ReadError> {
        let marker = format!("$End{section}");
        let found = self.rest.windows(marker.len()).position(|w| w == marker.as_bytes());
        let at = found.ok_or_else(|| self.damaged(format!("`{marker}` is missing")))?;
        self.rest = &self.rest[at + marker.len()..];
        Ok(())
    }

    fn read_format(&mut self) -> Result<(), ReadError> {
        let line = self.line();
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["4.1", kind @ ("0" | "1"), "8"] => self.binary = *kind == "1",
            _ => {
                return Err(self.unsupported(format!(
                    "`{line}` is not version 4.1; convert with `gmsh IN.msh -save -format msh41 -o OUT.msh`"
                )));
            }
        }
        if self.binary && self.take(4)? != 1i32.to_le_bytes() {
            return Err(self.unsupported("the bytes are big-endian; save the file as text".to_owned()));
        }
        Ok(())
    }

    fn read_names(&mut self) -> Result<Names, ReadError> {
        let count: usize = self.line().parse().map_err(|_| self.damaged("there is no count".to_owned()))?;
        let mut names = Names::new();
        for _ in 0..count {
            let line = self.line();
            let mut words = line.splitn(3, ' ');
            let mut number = || words.next().and_then(|w| w.parse::<i64>().ok());
            let (Some(dimension), Some(tag)) = (number(), number()) else {
                return Err(self.damaged(format!("`{line}` is not a dimension, a tag and a name")));
            };
            names.insert((dimension, tag), words.next().unwrap_or("").trim().trim_matches('"').to_owned());
        }
        Ok(names)
    }

    /// Physical tags of every entity, by dimension and entity tag.
    fn read_entities(&mut self) -> Result<Groups, ReadError> {
        let counts = [self.size()?, self.size()?, self.size()?, self.size()?];
        let mut groups = Groups::new();
        for (dimension, &count) in counts.iter().enumerate() {
            for _ in 0..count {
                let tag = self.int()?;
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    self.double()?;
                }
                let mut physical = Vec::new();
                for _ in 0..self.size()? {
                    // The sign says how the entity is turned in the group.
                    physical.push(self.int()?.abs());
                }
                if dimension > 0 {
                    for _ in 0..self.size()? {
                        self.int()?;
                    }
                }
                groups.insert((dimension as i64, tag), physical);
            }
        }
        Ok(groups)
    }

    fn read_nodes(&mut self) -> Result<Vec<(u64, [f64; 3])>, ReadError> {
        let blocks = self.size()?;
        for _ in 0..3 {
            self.size()?;
        }
        let mut nodes = Vec::new();
        for _ in 0..blocks {
            let (dimension, _, parametric) = (self.int()?, self.int()?, self.int()?);
            let first = nodes.len();
            for _ in 0..self.size()? {
                nodes.push((self.size()?, [0.0; 3]));
            }
            for n in first..nodes.len() {
                nodes[n].1 = [self.double()?, self.double()?, self.double()?];
                for _ in 0..if parametric == 0 { 0 } else { dimension } {
                    self.double()?;
                }
            }
        }
        Ok(nodes)
    }

    fn read_elements(&mut self) -> Result<Elements, ReadError> {
        let blocks = self.size()?;
        for _ in 0..3 {
            self.size()?;
        }
        let mut elements = Elements::default();
        for _ in 0..blocks {
            let (dimension, entity, kind) = (self.int()?, self.int()?, self.int()?);
            // Nodes of the flat elements we only step over: line, quadrangle, and their quadratic kin.
            let nodes = match kind {
                POINT | TRIANGLE | TETRAHEDRON => 0,
                1 => 2,
                3 | 26 => 4,
                8 => 3,
                9 => 6,
                10 => 9,
                16 => 8,
                _ => {
                    return Err(self.unsupported(format!(
                        "entity {entity} of dimension {dimension} has elements of gmsh type {kind}; \
                         only linear tetrahedra (4) make a mesh here: mesh with order 1 and without recombination"
                    )));
                }
            };
            for _ in 0..self.size()? {
                let tag = self.size()?;
                match kind {
                    POINT => elements.points.push((entity, self.size()?)),
                    TRIANGLE => elements.triangles.push((entity, [self.size()?, self.size()?, self.size()?])),
                    TETRAHEDRON => {
                        let corners = [self.size()?, self.size()?, self.size()?, self.size()?];
                        elements.tets.push((tag, entity, corners));
                    }
                    _ => {
                        for _ in 0..nodes {
                            self.size()?;
                        }
                    }
                }
            }
        }
        Ok(elements)
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], ReadError> {
        let cut = || self.damaged("the file ends inside the section".to_owned());
        let (taken, rest) = self.rest.split_at_checked(count).ok_or_else(cut)?;
        self.rest = rest;
        Ok(taken)
    }

    fn word<T: std::str::FromStr>(&mut self) -> Result<T, ReadError> {
        let start = self.rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(self.rest.len());
        let rest = &self.rest[start..];
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        let (word, rest) = rest.split_at(end);
        self.rest = rest;
        let word = std::str::from_utf8(word).unwrap_or("?");
        if word.is_empty() {
            return Err(self.damaged("the file ends inside the section".to_owned()));
        }
        word.parse().map_err(|_| self.damaged(format!("`{word}` is not the number that belongs there")))
    }

    fn size(&mut self) -> Result<u64, ReadError> {
        if !self.binary {
            return self.word();
        }
        let bytes = self.take(8)?;
        Ok(u64::from_le_bytes(std::array::from_fn(|n| bytes[n])))
    }

    fn int(&mut self) -> Result<i64, ReadError> {
        if !self.binary {
            return self.word();
        }
        let bytes = self.take(4)?;
        Ok(i64::from(i32::from_le_bytes(std::array::from_fn(|n| bytes[n]))))
    }

    fn double(&mut self) -> Result<f64, ReadError> {
        if !self.binary {
            return self.word();
        }
        let bytes = self.take(8)?;
        Ok(f64::from_le_bytes(std::array::from_fn(|n| bytes[n])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_tets() -> TetMesh {
        let nodes = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.1, 1e-7, 1.0], [1.0, 1.0, 1.0]];
        let mut mesh = TetMesh::new(nodes, vec![[1, 2, 3, 4], [0, 1, 2, 3]], vec![3, 2]).unwrap();
        mesh.set_nodes("base of the brain", vec![0, 4]).unwrap();
        mesh.set_nodes("nothing", vec![]).unwrap();
        mesh.set_nodes("falx", vec![1, 2]).unwrap();
        mesh.facet_sets.insert("falx".into(), vec![[1, 2, 3]]);
        mesh
    }

    #[test]
    fn what_is_written_is_read_back_equal() {
        let mesh = two_tets();
        assert_eq!(decode(&encode(&mesh).unwrap(), "a.msh").unwrap(), mesh);
    }

    #[test]
    fn surfaces_of_gmsh_are_turned_outwards_and_its_volumes_have_their_names() {
        let mut mesh = two_tets();
        let outer = mesh.boundary_facets(|_| true);
        mesh.facet_sets.insert("pial".into(), outer.clone());
        let mut drawn = mesh.clone();
        let as_drawn = outer.iter().enumerate().map(|(n, &[a, b, c])| if n % 2 == 0 { [b, a, c] } else { [c, a, b] });
        // One of them twice, as where two surfaces of a group overlap.
        drawn.facet_sets.insert("pial".into(), as_drawn.chain([outer[0]]).collect());
        let bytes = encode(&drawn).unwrap();
        let read = decode(&bytes, "a.msh").unwrap();
        let areas =
            |mesh: &TetMesh| -> Vec<_> { mesh.facet_sets["pial"].iter().map(|f| mesh.area_vector_mm2(*f)).collect() };
        assert_eq!(areas(&read).len(), outer.len());
        assert!(areas(&read).iter().zip(areas(&mesh)).all(|(a, b)| (a - b).norm() < 1e-12));
        let names = volume_names(&bytes);
        assert_eq!((names[&2].as_str(), names[&3].as_str(), names.len()), ("grey_matter", "white_matter", 2));
    }

    #[test]
    fn every_refusal_names_file_and_section() {
        let good = String::from_utf8(encode(&two_tets()).unwrap()).unwrap();
        let says = |text: String, words: &[&str]| {
            let message = decode(text.as_bytes(), "bad.msh").unwrap_err().to_string();
            assert!(words.iter().all(|w| message.contains(w)) && message.starts_with("bad.msh: "), "{message}");
        };
        says(good.replace("4.1 0 8", "2.2 0 8"), &["$MeshFormat", "2.2", "-format msh41"]);
        says(good.replace("\n2 1 2 3 4", "\n2 1 3 2 4"), &["inverted or flat"]);
        says(good.replace("\n2 1 2 3 4", "\n2 1 2 3 9"), &["$Elements", "node 9"]);
        says(good.replace("\n2 1 2 3 4", "\n2 1 2 x 4"), &["$Elements", "`x`"]);
        says(good.replace("1 3 0\n$EndEnt", "2 3 2 0\n$EndEnt"), &["volume 3", "groups 3 and 2"]);
        says(good.replace("1 3 0\n$EndEnt", "0 0\n$EndEnt"), &["volume 3", "no physical group"]);
        says(good.replace("1 3 0\n$EndEnt", "1 999 0\n$EndEnt"), &["999", "1 to 255"]);
        says(good.replace("3 2 4 1", "3 2 5 1"), &["$Elements", "gmsh type 5"]);
        says(good.replace("0.1 1e-7 1.0", "nan 1e-7 1.0"), &["node 3", "not a finite number"]);
        says("solid cube".into(), &["not an MSH file"]);
    }

    #[test]
    fn a_file_cut_anywhere_is_refused() {
        let whole = encode(&two_tets()).unwrap();
        for length in 0..whole.len() - 2 {
            assert!(decode(&whole[..length], "cut.msh").is_err(), "cut at {length} of {}", whole.len());
        }
    }
}
