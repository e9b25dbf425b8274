//! VTU, the unstructured grid of VTK's XML formats: what ParaView, pyvista and meshio open.
//!
//! Labels are the integer cell array `label`; every node set is a `UInt8` point array of 0 and 1 under its name,
//! since VTU has no sets. In our own files such an array says `hgm_set="nodes"` and the file `hgm_sets="marked"`, which
//! other readers pass over: a result that happens to be 0 and 1 is then no set. A facet set is the `UInt8` cell array `facets:NAME`: bit `f` of a tetrahedron is set when
//! its local face `f` (the one opposite corner `f`, see [`TET_FACES`]) belongs to the set. What lies within the cells is one `Float64` cell
//! array for each label, `fraction:NAME` (`fraction:white_matter`; a number for a label without a name). Fields are `Float64`.
//! Reading takes text, base64 and raw bytes, inline or appended, plain or zlib, either byte order and header width.

use super::vtk_array::base64_zlib;
use super::vtu_file::{File, MARKED, SET, VTK_TETRA};
use super::{Field, MeshWithFields, ReadError, WriteError, check_fields, facet_owners};
use crate::mesh::{Fractions, TET_FACES, TetMesh};
use crate::segment::label;
use quick_xml::escape::escape;

const FACETS: &str = "facets:";
const FRACTION: &str = "fraction:";

/// The bytes of a VTU file: `mesh` with labels, sets and the given fields on nodes and tetrahedra.
///
/// # Errors
/// [`WriteError`] for a field of the wrong length or a name that occurs twice.
pub fn encode(mesh: &TetMesh, point_fields: &[Field], cell_fields: &[Field]) -> Result<Vec<u8>, WriteError> {
    let (points, cells) = (mesh.nodes_mm().len(), mesh.tets().len());
    check_fields(point_fields, points, &mesh.node_sets.keys().map(String::as_str).collect::<Vec<_>>())?;
    let facet_names: Vec<String> = mesh.facet_sets.keys().map(|name| format!("{FACETS}{name}")).collect();
    let fractions: Vec<String> = mesh.fractions().keys().map(|&label| fraction_name(label)).collect();
    let taken: Vec<&str> = facet_names.iter().chain(&fractions).map(String::as_str).chain(["label"]).collect();
    check_fields(cell_fields, cells, &taken)?;

    let mut xml = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\" {MARKED}=\"marked\">\n<UnstructuredGrid>\n\
         <Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">\n<Points>\n"
    );
    xml += &array("Float64", "Points", 3, &float_bytes(mesh.nodes_mm().as_flattened()));
    xml += "</Points>\n<Cells>\n";
    let corners = mesh.tets().as_flattened();
    xml += &array("Int64", "connectivity", 1, &bytes_of(corners.iter().map(|&n| i64::from(n).to_le_bytes())));
    xml += &array("Int64", "offsets", 1, &bytes_of((1..=cells as i64).map(|n| (4 * n).to_le_bytes())));
    xml += &array("UInt8", "types", 1, &vec![VTK_TETRA; cells]);
    xml += "</Cells>\n<PointData>\n";
    for (name, nodes) in &mesh.node_sets {
        let mut member = vec![0u8; points];
        for &n in nodes {
            member[n as usize] = 1;
        }
        xml += &array("UInt8", name, 1, &member).replacen(" Name=", &format!(" {}=\"{}\" Name=", SET.0, SET.1), 1);
    }
    for field in point_fields {
        xml += &array("Float64", &field.name, field.components, &float_bytes(&field.values));
    }
    xml += "</PointData>\n<CellData Scalars=\"label\">\n";
    xml += &array("Int32", "label", 1, &bytes_of(mesh.labels().iter().map(|&l| i32::from(l).to_le_bytes())));
    for (name, facets) in facet_names.iter().zip(mesh.facet_sets.values()) {
        let mut faces = vec![0u8; cells];
        for (tet, face) in facet_owners(mesh, facets) {
            faces[tet] |= 1 << face;
        }
        xml += &array("UInt8", name, 1, &faces);
    }
    for (name, of) in fractions.iter().zip(mesh.fractions().values()) {
        xml += &array("Float64", name, 1, &float_bytes(of));
    }
    for field in cell_fields {
        xml += &array("Float64", &field.name, field.components, &float_bytes(&field.values));
    }
    xml += "</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
    Ok(xml.into_bytes())
}

/// The cell array that says which part of every cell a label fills.
pub fn fraction_name(label: u8) -> String {
    let name = label::name(label).map_or_else(|| label.to_string(), str::to_owned);
    format!("{FRACTION}{name}")
}

fn array(number: &str, name: &str, components: usize, bytes: &[u8]) -> String {
    let name = escape(name);
    // Only where there are several: meshio makes a table of one column of a scalar that says `1`.
    let width = if components == 1 { String::new() } else { format!(" NumberOfComponents=\"{components}\"") };
    let payload = base64_zlib(bytes);
    format!("<DataArray type=\"{number}\" Name=\"{name}\"{width} format=\"binary\">\n{payload}\n</DataArray>\n")
}

fn float_bytes(values: &[f64]) -> Vec<u8> {
    bytes_of(values.iter().map(|v| v.to_le_bytes()))
}

fn bytes_of<const N: usize>(words: impl Iterator<Item = [u8; N]>) -> Vec<u8> {
    words.flatten().collect()
}

/// A mesh from the bytes of a VTU file; `name` is what messages call the file.
///
/// The cell array `label` (or gmsh's `gmsh:physical`) gives the labels. A point array of one component that holds
/// only 0 and 1 becomes a node set: in our own files if it is marked as one, in others always (a float array only if it
/// holds a 1). All others are returned as fields, those of cells for the tetrahedra only. Vertices, lines and polygons are passed over; nodes keep the file's order, so
/// nodes of no tetrahedron stay.
///
/// # Errors
/// [`ReadError`] for a damaged file, a cell that is neither a linear tetrahedron nor of lower dimension, a missing
/// or unusable label, and whatever [`TetMesh::new`] refuses.
pub fn decode(bytes: &[u8], name: &str) -> Result<MeshWithFields, ReadError> {
    let file = File::parse(bytes, name)?;
    let nodes_mm = file.numbers("Points", None, 3, file.points)?.as_chunks::<3>().0.to_vec();
    let (tets, cell_numbers) = file.tets()?;
    let labels = file.labels(&cell_numbers)?;
    let mut mesh =
        TetMesh::new(nodes_mm, tets, labels).map_err(|source| ReadError::Mesh { file: name.to_owned(), source })?;

    let mut point_fields = Vec::new();
    for raw in file.arrays.iter().filter(|a| a.section == "PointData") {
        let Some(field) = file.field(raw, file.points)? else { continue };
        let binary = field.components == 1 && field.values.iter().all(|&v| v == 0.0 || v == 1.0);
        let set = if file.marked { raw.is_set } else { raw.is_integer() || field.values.contains(&1.0) };
        if binary && set {
            let nodes = (0..file.points).filter(|&n| field.values[n] == 1.0).map(|n| n as u32).collect();
            mesh.node_sets.insert(field.name, nodes);
        } else {
            point_fields.push(field);
        }
    }
    let (mut cell_fields, mut fractions) = (Vec::new(), Fractions::new());
    for raw in file.arrays.iter().filter(|a| a.section == "CellData" && a.name != "label") {
        let Some(mut field) = file.field(raw, file.cells)? else { continue };
        let width = field.components;
        field.values = cell_numbers.iter().flat_map(|&c| &field.values[c * width..(c + 1) * width]).copied().collect();
        if let Some(set) = field.name.strip_prefix(FACETS)
            && raw.is_integer()
            && width == 1
        {
            let faces = field
                .values
                .iter()
                .enumerate()
                .flat_map(|(t, &bits)| (0..4).filter(move |f| bits as u8 >> f & 1 == 1).map(move |f| (t, f)));
            let facets = faces.map(|(t, f): (usize, usize)| TET_FACES[f].map(|c| mesh.tets()[t][c])).collect();
            mesh.facet_sets.insert(set.to_owned(), facets);
        } else if let Some(word) = field.name.strip_prefix(FRACTION)
            && width == 1
        {
            let Some(label) = label::number(word) else {
                let problem = format!("`{word}` is no label: name a tissue (white_matter) or give its number");
                return Err(file.unsupported(&field.name, problem));
            };
            fractions.insert(label, field.values);
        } else {
            cell_fields.push(field);
        }
    }
    mesh.set_fractions(fractions).map_err(|source| ReadError::Mesh { file: name.to_owned(), source })?;
    Ok(MeshWithFields { mesh, point_fields, cell_fields })
}

/// One field of the points of a VTU file, without what else it holds; `None` where there is none of that name.
///
/// # Errors
/// [`ReadError`] for a damaged file.
pub fn decode_point_field(bytes: &[u8], name: &str, field: &str) -> Result<Option<Field>, ReadError> {
    let file = File::parse(bytes, name)?;
    let raw = file.arrays.iter().find(|a| a.section == "PointData" && a.name == field);
    raw.map_or(Ok(None), |raw| file.field(raw, file.points))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_tets() -> TetMesh {
        let nodes =
            vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0], [7.0, 0.1, 0.2]];
        let mut mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4]], vec![2, 3]).unwrap();
        mesh.set_nodes("base & <cut>", vec![0, 4]).unwrap();
        mesh.set_nodes("nothing", vec![]).unwrap();
        mesh.facet_sets.insert("falx".into(), vec![[1, 2, 3]]);
        mesh
    }

    fn ascii(cells: &str, label: &str) -> String {
        format!(
            "<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\"><UnstructuredGrid>\
             <Piece NumberOfPoints=\"4\" NumberOfCells=\"2\"><Points>\
             <DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 0 1 0 0 0 1</DataArray>\
             </Points><Cells>{cells}</Cells><CellData>{label}</CellData>\
             <PointData><DataArray type=\"Float64\" Name=\"w\" format=\"ascii\">0 0.5 1 nan</DataArray></PointData>\
             </Piece></UnstructuredGrid></VTKFile>"
        )
    }

    const CELLS: &str = "<DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">0 1 2 0 1 2 3</DataArray>\
         <DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">3 7</DataArray>\
         <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">5 10</DataArray>";
    const LABEL: &str = "<DataArray type=\"Int32\" Name=\"label\" format=\"ascii\">9 3</DataArray>";

    #[test]
    fn what_is_written_is_read_back_equal() {
        let mesh = two_tets();
        let u = Field::vector("displacement", &[[0.1, -0.2, 1e-300]; 6]);
        let (j, e) = (Field::scalar("jacobian", vec![1.0, f64::MAX]), Field::scalar("rmse_mm", vec![0.0; 6]));
        let bytes = encode(&mesh, &[u.clone(), e.clone()], std::slice::from_ref(&j)).unwrap();
        let back = decode(&bytes, "a.vtu").unwrap();
        // A facet inside is stored on one side; which nodes it has is what survives here.
        let facet = |m: &TetMesh| {
            let mut f = m.facet_sets["falx"][0];
            f.sort_unstable();
            f
        };
        assert_eq!(facet(&back.mesh), facet(&mesh));
        assert_eq!(back.mesh.node_sets, mesh.node_sets);
        assert_eq!(
            (back.mesh.nodes_mm(), back.mesh.tets(), back.mesh.labels()),
            (mesh.nodes_mm(), mesh.tets(), mesh.labels())
        );
        assert_eq!((back.point_fields, back.cell_fields), (vec![u, e], vec![j]));
        assert_eq!(encode(&mesh, &[], &[]), encode(&mesh, &[], &[]));
    }

    #[test]
    fn a_facet_that_is_there_for_either_side_is_read_back_for_both() {
        let mut mesh = two_tets();
        let sides = vec![[1, 2, 3], [1, 3, 2]];
        mesh.facet_sets.insert("falx".into(), [sides.clone(), vec![sides[0]]].concat());
        let back = decode(&encode(&mesh, &[], &[]).unwrap(), "a.vtu").unwrap().mesh;
        // In any order, and beginning with any node.
        let turns = |facets: &[[u32; 3]]| {
            let mut turns: Vec<_> = facets.iter().map(|&f| mesh.area_vector_mm2(f).x.signum() as i8).collect();
            turns.sort_unstable();
            turns
        };
        assert_eq!(turns(&back.facet_sets["falx"]), turns(&sides));
        assert_eq!(turns(&sides), [-1, 1]);
    }

    #[test]
    fn fractions_are_read_back_to_the_bit_and_refused_where_they_make_no_whole() {
        let mut mesh = two_tets();
        let thirds = Fractions::from([(3, vec![1.0 / 3.0, 0.0]), (17, vec![2.0 / 3.0, 1.0])]);
        mesh.set_fractions(thirds.clone()).unwrap();
        let back = decode(&encode(&mesh, &[], &[]).unwrap(), "a.vtu").unwrap();
        assert_eq!((back.mesh.fractions(), back.cell_fields.len()), (&thirds, 0));
        let array = |name: &str, values: &str| {
            format!("{LABEL}<DataArray type=\"Float32\" Name=\"fraction:{name}\" format=\"ascii\">{values}</DataArray>")
        };
        let read =
            |more: &str| decode(ascii(CELLS, more).as_bytes(), "a.vtu").map(|read| read.mesh.fractions().clone());
        assert_eq!(read(&array("white_matter", "0 1")), Ok(Fractions::from([(3, vec![1.0])])));
        let refused = read(&array("white_matter", "0 0.5")).unwrap_err().to_string();
        assert!(refused.contains("a.vtu") && refused.contains("they make 0.5"), "{refused}");
        let refused = read(&array("white", "0 1")).unwrap_err().to_string();
        assert!(refused.contains("a.vtu: fraction:white") && refused.contains("no label"), "{refused}");
    }

    #[test]
    fn a_field_alone_is_the_one_that_is_read_with_all_else() {
        let fields = [Field::vector("u", &[[0.1, -0.2, 1e-300]; 6]), Field::scalar("w", vec![0.5; 6])];
        let bytes = encode(&two_tets(), &fields, &[]).unwrap();
        for field in &fields {
            assert_eq!(decode_point_field(&bytes, "a.vtu", &field.name).unwrap().as_ref(), Some(field));
        }
        assert_eq!(decode_point_field(&bytes, "a.vtu", "label").unwrap(), None);
        assert!(decode_point_field(&bytes[..bytes.len() / 2], "a.vtu", "u").is_err());
    }

    #[test]
    fn zeros_and_ones_are_a_set_where_they_say_so_or_the_file_is_not_ours() {
        let seen = Field::scalar("seen", vec![0.0, 1.0, 1.0, 0.0, 0.0, 1.0]);
        let bytes = encode(&two_tets(), std::slice::from_ref(&seen), &[]).unwrap();
        let ours = decode(&bytes, "a.vtu").unwrap();
        assert_eq!((ours.point_fields, ours.mesh.node_sets.len()), (vec![seen], 2));
        // As another program writes it again: without what it does not know.
        let text = String::from_utf8(bytes).unwrap();
        let foreign = text.replace(" hgm_sets=\"marked\"", "").replace(" hgm_set=\"nodes\"", "");
        assert_ne!(foreign, text);
        let foreign = decode(foreign.as_bytes(), "a.vtu").unwrap();
        assert_eq!(foreign.mesh.node_sets["seen"], [1, 2, 5]);
        assert_eq!((foreign.mesh.node_sets.len(), foreign.point_fields.len()), (3, 0));
    }

    #[test]
    fn triangles_beside_tetrahedra_are_passed_over() {
        let read = decode(ascii(CELLS, LABEL).as_bytes(), "a.vtu").unwrap();
        assert_eq!((read.mesh.tets(), read.mesh.labels()), ([[0, 1, 2, 3]].as_slice(), [3].as_slice()));
        assert_eq!(read.point_field("w").unwrap().values[1], 0.5);
        assert!(read.mesh.node_sets.is_empty());
    }

    #[test]
    fn an_array_of_strings_among_the_others_hides_none_of_them() {
        let words = "<Array type=\"String\" Name=\"who\" format=\"ascii\">72 105 0</Array>";
        let text = ascii(CELLS, &format!("{words}{LABEL}")).replace("<PointData>", &format!("<PointData>{words}"));
        let read = decode(text.as_bytes(), "a.vtu").unwrap();
        assert_eq!((read.mesh.labels(), read.point_field("w").unwrap().values[1]), ([3].as_slice(), 0.5));
    }

    #[test]
    fn every_refusal_names_file_and_field() {
        let refuse = |text: String| decode(text.as_bytes(), "bad.vtu").unwrap_err().to_string();
        let says = |text: String, words: &[&str]| {
            let message = refuse(text);
            assert!(words.iter().all(|w| message.contains(w)) && message.starts_with("bad.vtu: "), "{message}");
        };
        let good = ascii(CELLS, LABEL);
        says(ascii(CELLS, ""), &["label", "cell arrays: none", "add an integer cell array"]);
        says(ascii(CELLS, &LABEL.replace("label", "mat")), &["label", "cell arrays: mat"]);
        says(ascii(CELLS, &LABEL.replace("9 3", "9 300")), &["cell 1 has label 300"]);
        says(ascii(CELLS, &LABEL.replace("9 3", "9 nan")), &["cell 1 has label NaN"]);
        says(ascii(CELLS, &LABEL.replace("9 3", "3")), &["label", "1 numbers for 2 cells"]);
        says(ascii(&CELLS.replace("5 10", "5 24"), LABEL), &["types", "cell 1 has VTK type 24"]);
        says(ascii(&CELLS.replace("0 1 2 3", "0 2 1 3"), LABEL), &["tetrahedron 0", "inverted or flat"]);
        says(ascii(&CELLS.replace("0 1 2 3", "0 1 1 3"), LABEL), &["tetrahedron 0", "inverted or flat"]);
        says(ascii(&CELLS.replace("0 1 2 3", "0 1 2 8"), LABEL), &["names node 8"]);
        says(ascii(&CELLS.replace("0 1 2 3", "0 1 2 -3"), LABEL), &["connectivity", "cell 1"]);
        says(ascii(&CELLS.replace("3 7", "7 3"), LABEL), &["connectivity"]);
        says(good.replace("0 0 1</", "0 0 nan</"), &["node 3", "not a finite number"]);
        says(good.replace("0 0 1</", "0 0 x</"), &["Points", "`x` is not a number"]);
        says(good.replace("0 0 1</", "0 0</"), &["Points", "11 numbers, not 12"]);
        says(good.replace("UnstructuredGrid\" byte", "PolyData\" byte"), &["VTKFile", "PolyData"]);
        says(good.replace("\"LittleEndian\"", "\"LittleEndian\" compressor=\"vtkLZ4DataCompressor\""), &["zlib"]);
        says(good.replace("NumberOfCells=\"2\"", "NumberOfCells=\"two\""), &["Piece", "`two`"]);
        says(String::new(), &["XML", "ends before"]);
    }

    #[test]
    fn a_file_cut_anywhere_is_refused() {
        let whole = encode(&two_tets(), &[Field::scalar("w", vec![0.5; 6])], &[]).unwrap();
        let end = whole.len() - "</VTKFile>\n".len();
        for length in (0..=end).step_by(7) {
            assert!(decode(&whole[..length], "cut.vtu").is_err(), "cut at {length} of {}", whole.len());
        }
    }

    #[test]
    fn fields_that_do_not_fit_are_not_written() {
        let short = Field::scalar("w", vec![0.0; 5]);
        assert!(matches!(encode(&two_tets(), &[short], &[]), Err(WriteError::FieldLength { found: 5, .. })));
        let twice = Field::scalar("label", vec![0.0; 2]);
        assert!(matches!(encode(&two_tets(), &[], &[twice]), Err(WriteError::Duplicate { .. })));
    }
}
