use super::*;
use crate::mesh::TriMesh;
use crate::mesh::format::gifti::{Space, encode_surface};

fn moved(drawing: &Drawing, by: [f64; 3]) -> Vec<Carried> {
    let to =
        |p: &[f64; 3]| Carried { mm: [0, 1, 2].map(|a| p[a] + by[a]), sd_mm: Some(0.75), state: PointState::Tissue };
    drawing.points_mm.iter().map(to).collect()
}

/// Ten millimetres to the right in every text format, whichever way its axes go; what else it holds stays.
#[test]
fn ten_mm_to_the_right_is_ten_mm_to_the_right_in_every_format() {
    let fcsv = "# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n1,-5,6,7,0,0,0,1,1,1,0,F-1,,vtkMRMLScalarVolumeNode1\n";
    let markups = r#"{"markups": [{"type": "Fiducial", "coordinateSystem": "LPS", "controlPoints": [{"label": "F-1", "position": [-5.0, 6.0, 7.0]}]}]}"#;
    let vtk = "# vtk DataFile Version 4.2\nvtk output SPACE=LPS\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n-5 6 7 \nVERTICES 1 2\n1 0\n";
    let ply = "ply\nformat ascii 1.0\ncomment SPACE=LPS\nelement vertex 1\nproperty uchar red\nproperty float x\nproperty float y\nproperty float z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n9 -5 6 7\n";
    let csv = "name,x,y,z\nF-1,5,-6,7\n";
    let tag = "MNI Tag Point File\nVolumes = 1;\n\nPoints =\n 5 -6 7 \"F-1\";\n";
    let files =
        [("a.fcsv", fcsv), ("a.mrk.json", markups), ("a.vtk", vtk), ("a.ply", ply), ("a.csv", csv), ("a.tag", tag)];
    for (name, text) in files {
        let drawing = Drawing::decode(text.as_bytes(), name).unwrap();
        assert_eq!(drawing.points_mm, [[5.0, -6.0, 7.0]], "{name}");
        let bytes = drawing.encode(&moved(&drawing, [10.0, 0.0, 0.0]));
        let again = Drawing::decode(&bytes, name).unwrap();
        assert_eq!(again.points_mm, [[15.0, -6.0, 7.0]], "{name}");
        assert_eq!(again.names, drawing.names, "{name}");
        let said = String::from_utf8(bytes).unwrap();
        assert!(!said.contains("vtkMRML"), "{name}: {said}");
        let carries_sd = [".csv", ".fcsv", ".json"].iter().any(|end| name.ends_with(end));
        assert_eq!(said.contains("0.75") && said.contains("tissue"), carries_sd, "{name}: {said}");
    }
}

#[test]
fn pairs_of_a_tag_file_are_read_and_a_table_without_names_of_columns_too() {
    let tag = "MNI Tag Point File\nVolumes = 2;\n%Volume: before\n%Volume: after\n\nPoints =\n 1 2 3 4 5 6 \"\"\n 7 8 9 10 11 12 \"\";";
    let drawing = Drawing::decode(tag.as_bytes(), "a.tag").unwrap();
    assert_eq!(drawing.points_mm, [[1.0, 2.0, 3.0], [7.0, 8.0, 9.0]]);
    assert_eq!(drawing.pairs_mm, [[4.0, 5.0, 6.0], [10.0, 11.0, 12.0]]);
    let table = Drawing::decode(b"a, 1, 2, 3\nb, 4, 5, 6\n", "a.csv").unwrap();
    assert_eq!((table.points_mm.len(), table.names), (2, vec!["a".to_owned(), "b".to_owned()]));
}

#[test]
fn what_does_not_move_with_the_points_is_told() {
    let ply = |more: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n{more}end_header\n1 2 3 0 0 1\n"
        )
    };
    let normals = "property float nx\nproperty float ny\nproperty float nz\n";
    let of = |text: &str, name: &str| Drawing::decode(text.as_bytes(), name).unwrap().not_carried();
    assert_eq!(of(&ply(normals), "a.ply"), Some(NotCarried::Directions));
    assert_eq!(of(&ply(&normals.replace('n', "c")), "a.ply"), None);
    let vtk = "# vtk DataFile Version 4.2\nof\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n5 6 7\nVERTICES 1 2\n1 0\n";
    assert_eq!(of(vtk, "a.vtk"), None);
    let with = format!("{vtk}POINT_DATA 1\nNORMALS n float\n0 0 1\n");
    assert_eq!(of(&with, "a.vtk"), Some(NotCarried::Directions));
    let field = |head: &str| format!("{vtk}POINT_DATA 1\nFIELD FieldData 1\n{head}\n0 0 1\n");
    assert_eq!(of(&field("Normals 3 1 float"), "a.vtk"), Some(NotCarried::Directions));
    assert_eq!(of(&field("fa 1 3 float"), "a.vtk"), None);
    let tag = |volumes: usize| format!("MNI Tag Point File\nVolumes = {volumes};\n\nPoints =\n 1 2 3 4 5 6 \"a\";\n");
    assert_eq!(of(&tag(2), "a.tag"), Some(NotCarried::SecondVolume));
    assert_eq!(of(&tag(1), "a.tag"), None);
    let surface = TriMesh { nodes_mm: vec![[0.0; 3], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]], triangles: vec![[0, 1, 2]] };
    let gifti = String::from_utf8(encode_surface(&surface, Space::Scanner, "made")).unwrap();
    assert_eq!(of(&gifti, "a.gii"), None);
    let start = gifti.find("<DataArray ").unwrap();
    let end = gifti.rfind("</GIFTI>").unwrap();
    let shape = gifti[start..end].replace("NIFTI_INTENT_POINTSET", "NIFTI_INTENT_SHAPE");
    let shape = &shape[..shape.find("</DataArray>").unwrap() + "</DataArray>".len()];
    let three = format!("{}{shape}{}", &gifti[..end], &gifti[end..]);
    assert_eq!(of(&three, "a.gii"), Some(NotCarried::Arrays(1)));
}

#[test]
fn a_table_carried_twice_has_its_columns_once_and_one_of_ants_is_not_taken_for_ras() {
    let drawing = Drawing::decode(b"name,x,y,z\nF-1,5,-6,7\n", "a.csv").unwrap();
    let once = drawing.encode(&moved(&drawing, [10.0, 0.0, 0.0]));
    let again = Drawing::decode(&once, "a.csv").unwrap();
    let twice = again.encode(&moved(&again, [10.0, 0.0, 0.0]));
    assert_eq!(String::from_utf8(twice).unwrap(), "name,x,y,z,sd_mm,state\nF-1,25,-6,7,0.75,tissue\n");
    let ants = Drawing::decode(b"x,y,z,t,label\n5,-6,7,0,1\n", "a.csv").unwrap_err().to_string();
    assert!(ants.contains("LPS") && ants.contains("take t away"), "{ants}");
}

/// What is not placed stays where it is, and no point takes its place.
#[test]
fn a_point_that_is_yet_to_be_placed_is_none() {
    let text = r#"{"markups": [{"coordinateSystem": "RAS", "controlPoints": [{"label": "a", "position": [0, 0, 0], "positionStatus": "undefined"}, {"label": "b", "position": [1, 2, 3], "positionStatus": "defined"}]}]}"#;
    let drawing = Drawing::decode(text.as_bytes(), "a.mrk.json").unwrap();
    assert_eq!((&drawing.points_mm[..], &drawing.names[..]), (&[[1.0, 2.0, 3.0]][..], &["b".to_owned()][..]));
    let said = String::from_utf8(drawing.encode(&moved(&drawing, [10.0, 0.0, 0.0]))).unwrap();
    let again = Drawing::decode(said.as_bytes(), "a.mrk.json").unwrap();
    assert!(again.points_mm == [[11.0, 2.0, 3.0]] && said.contains("undefined"), "{said}");
}

#[test]
fn a_label_with_a_comma_is_one_label() {
    let text = "# CoordinateSystem = 0\n1,5,6,7,0,0,0,1,1,1,0,\"STN, L\",said,node\n";
    let drawing = Drawing::decode(text.as_bytes(), "a.fcsv").unwrap();
    assert_eq!(drawing.names, ["STN, L"]);
    let said = String::from_utf8(drawing.encode(&moved(&drawing, [10.0, 0.0, 0.0]))).unwrap();
    assert!(said.contains("1,15,6,7,0,0,0,1,1,1,0,\"STN, L\",tissue sd 0.75 mm,\n"), "{said}");
}

#[test]
fn a_damaged_file_is_refused_with_its_place() {
    let refuse = |bytes: &[u8], name: &str| Drawing::decode(bytes, name).unwrap_err().to_string();
    assert!(refuse(b"x,y\n1,2\n", "a.csv").contains("a.csv: the first row: no column is called `z`"));
    assert!(refuse(b"x,y,z\n1,2,up\n", "a.csv").contains("row 2: `up`"));
    assert!(refuse(b"x,y,z\n1,2\n", "a.csv").contains("row 2: it has 2 cells and the rows above it 3"));
    assert!(refuse(b"x,y,z\n1,2,\xff\n", "a.csv").contains("save the file as UTF-8"));
    // Voxels beside millimetres: which are meant is not guessed.
    for header in ["x,y,z,x_mm,y_mm,z_mm", "X,y,z,x"] {
        let row = vec!["1"; header.split(',').count()].join(",");
        let said = refuse(format!("{header}\n{row}\n").as_bytes(), "a.csv");
        assert!(said.contains("two columns may be x") && said.contains("rename the other"), "{said}");
    }
    assert!(refuse(b"x,y,z\n1,2,inf\n", "a.csv").contains("point 0"));
    for text in ["1,-12,-20,-5\n", "1,2,3,4,a\n"] {
        let said = refuse(text.as_bytes(), "a.csv");
        assert!(said.contains("4 columns of numbers and no header") && said.contains("x, y and z"), "{said}");
    }
    for (text, marks) in [
        ("name;x;y;z\nSTN;-12,0;-20,5;-5\n", "semicolons"),
        ("1,5;2;3,5\n", "semicolons"),
        ("x\ty\tz\n1\t2\t3\n", "tabs"),
    ] {
        let said = refuse(text.as_bytes(), "a.csv");
        assert!(said.contains(marks) && said.contains("by commas"), "{said}");
    }
    assert_eq!(Drawing::decode(b"\"a;1;2;3\",1,2,3\n", "a.csv").unwrap().names, ["a;1;2;3"]);
    assert!(refuse(b"", "a.xyz").contains(".mrk.json"));
    assert!(refuse(b"{}", "a.mrk.json").contains("markups"));
    assert!(refuse(b"mrtrix tracks\ndatatype: Float32LE\nfile: . 50\nEND\n", "a.tck").contains("a.tck"));
    assert!(refuse(b"TRACK", "a.trk").contains("TRACK"));
    assert!(refuse(&[0; 100], "a.stl").contains("cut short"));
}

#[test]
fn a_number_sign_begins_a_comment_where_no_point_follows() {
    let read = |text: &str| Drawing::decode(text.as_bytes(), "a.csv").unwrap();
    let table = read("\u{feff}# of Monday\n\n#mm\nname,x,y,z\n#1,5,-6,7\n#2,1,2,3\nb,4,5,6\n");
    assert_eq!((table.points_mm.len(), table.names), (3, ["#1", "#2", "b"].map(str::to_owned).to_vec()));
    let plain = read("# x,y,z\n1,2,3\n4,5,6\n");
    assert_eq!((plain.points_mm.len(), plain.names.len()), (2, 0));
    assert_eq!(read("#1,5,-6,7\n# left out\nb,1,2,3\n").names, ["#1", "b"]);
}

/// Points without names stay without: a number that is made up would be taken for one.
#[test]
fn points_without_names_are_written_without() {
    let drawing =
        Drawing::decode(b"MNI Tag Point File\nVolumes = 1;\nPoints =\n 1 2 3 \"\"\n 4 5 6;\n", "a.tag").unwrap();
    assert!(drawing.names.is_empty());
    let again = Drawing::decode(&drawing.encode(&moved(&drawing, [1.0, 0.0, 0.0])), "a.tag").unwrap();
    assert_eq!(again.points_mm, [[2.0, 2.0, 3.0], [5.0, 5.0, 6.0]]);
    assert!(again.names.is_empty());
}

/// A track of two points and one of one, in a grid of 2 mm that the scanner's axes are the axes of.
fn tracks(declared: i32) -> Vec<u8> {
    let mut bytes = vec![0u8; 1000];
    let mut put = |at: usize, words: &[u8]| bytes[at..at + words.len()].copy_from_slice(words);
    put(0, b"TRACK");
    for axis in 0..3 {
        put(6 + 2 * axis, &10i16.to_le_bytes());
        put(12 + 4 * axis, &2f32.to_le_bytes());
        put(440 + 4 * (5 * axis), &2f32.to_le_bytes());
    }
    put(440 + 60, &1f32.to_le_bytes());
    put(948, b"RAS");
    put(988, &declared.to_le_bytes());
    put(996, &1000i32.to_le_bytes());
    for points in [2i32, 1] {
        bytes.extend(points.to_le_bytes());
        bytes.extend((0..3 * points).flat_map(|n| (n as f32).to_le_bytes()));
    }
    bytes
}

#[test]
fn tracks_with_fewer_lines_than_they_say_or_with_bytes_left_over_were_cut_short() {
    for declared in [0, 2] {
        assert_eq!(Drawing::decode(&tracks(declared), "a.trk").unwrap().streamlines(), Some(2));
    }
    let said = |bytes: &[u8]| Drawing::decode(bytes, "a.trk").unwrap_err().to_string();
    let few = said(&tracks(5));
    assert!(few.contains("n_count") && few.contains("5 lines") && few.contains("cut short"), "{few}");
    // Between two lines, and within the count of the next.
    let whole = tracks(2);
    assert!(said(&whole[..whole.len() - 16]).contains("n_count"));
    assert!(said(&whole[..whole.len() - 14]).contains("2 bytes"));
}

#[test]
fn whole_numbers_are_no_coordinates_of_a_binary_ply_and_places_in_a_picture_no_corners() {
    let head = |kind: &str, format: &str, more: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 3\nproperty {kind} x\nproperty {kind} y\nproperty {kind} z\nelement face 1\nproperty list \
             uchar int vertex_indices\n{more}end_header\n"
        )
    };
    let said = Drawing::decode(head("int", "binary_little_endian", "").as_bytes(), "a.ply").unwrap_err().to_string();
    assert!(said.contains("`x` is int") && said.contains("float or double"), "{said}");
    let picture = "property list uchar float texcoord\nproperty int texnumber\n";
    let corners = [0f32, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 9.0, 0.0];
    let mut binary = head("float", "binary_little_endian", picture).into_bytes();
    binary.extend(corners.iter().flat_map(|x| x.to_le_bytes()));
    binary.push(3);
    binary.extend([0i32, 1, 2].iter().flat_map(|n| n.to_le_bytes()));
    binary.push(6);
    binary.extend([0.5f32; 6].iter().flat_map(|x| x.to_le_bytes()));
    binary.extend(4i32.to_le_bytes());
    let text = head("int", "ascii", picture) + "0 0 0\n9 0 0\n0 9 0\n3 0 1 2 6 0.5 0.5 0.5 0.5 0.5 0.5 4\n";
    for bytes in [&binary[..], text.as_bytes()] {
        let surface = Drawing::decode(bytes, "a.ply").unwrap().surface("a.ply").unwrap().unwrap();
        assert_eq!((surface.nodes_mm[1], surface.triangles), ([9.0, 0.0, 0.0], vec![[0, 1, 2]]));
    }
    let cut = Drawing::decode(&binary[..binary.len() - 8], "a.ply").unwrap().surface("a.ply").unwrap_err();
    assert!(cut.to_string().contains("cut short"));
}

#[test]
fn a_surface_that_says_mni_space_is_not_taken_for_the_scanners_and_says_the_frame_it_is_carried_to() {
    let surface = TriMesh { nodes_mm: vec![[0.0; 3], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]], triangles: vec![[0, 1, 2]] };
    let read = |space: Space| Drawing::decode(&encode_surface(&surface, space, "made"), "a.surf.gii").unwrap();
    let said = read(Space::Mni152).check_of_scanner("a.surf.gii").unwrap_err().to_string();
    assert!(said.contains("a.surf.gii") && said.contains("MNI_152") && said.contains("SCANNER_ANAT"), "{said}");
    for space in [Space::Scanner, Space::Aligned, Space::Talairach] {
        let drawing = read(space);
        assert_eq!(drawing.check_of_scanner("a.surf.gii"), Ok(()));
        assert_eq!(drawing.declared(), Some(space));
        let carried = moved(&drawing, [1.0, 0.0, 0.0]);
        let again = |bytes: Vec<u8>| Drawing::decode(&bytes, "b.surf.gii").unwrap().declared();
        assert_eq!(again(drawing.encode_in(&carried, Space::Mni152)), Some(Space::Mni152));
        assert_eq!(again(drawing.encode(&carried)), Some(Space::Scanner));
    }
}

#[test]
fn lines_keep_their_lengths_and_their_numbers() {
    let (mut at, mut bytes) =
        (0, b"mrtrix tracks\ndatatype: Float32LE\ntimestamp: 1\ncount: 2\nfile: . 100\nEND\n".to_vec());
    bytes.resize(100, b' ');
    for length in [3, 2] {
        for _ in 0..length {
            at += 1;
            bytes.extend([at as f32, 0.5, -1.0].iter().flat_map(|x: &f32| x.to_le_bytes()));
        }
        bytes.extend([f32::NAN; 3].iter().flat_map(|x| x.to_le_bytes()));
    }
    bytes.extend([f32::INFINITY; 3].iter().flat_map(|x| x.to_le_bytes()));
    let drawing = Drawing::decode(&bytes, "a.tck").unwrap();
    assert_eq!((drawing.points_mm.len(), drawing.streamlines()), (5, Some(2)));
    let carried = drawing.encode(&moved(&drawing, [0.0, 0.0, 4.0]));
    assert!(!String::from_utf8_lossy(&carried[..60]).contains("timestamp"));
    let again = Drawing::decode(&carried, "a.tck").unwrap();
    assert_eq!((again.points_mm[4], again.streamlines()), ([5.0, 0.5, 3.0], Some(2)));
}

/// A tetrahedron in every format of surfaces, text and binary: the same four faces.
#[test]
fn a_surface_has_the_same_triangles_in_every_format() {
    use crate::mesh::TriMesh;
    use crate::mesh::format::{ply, stl};
    let solid = TriMesh {
        nodes_mm: vec![[0.0; 3], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    };
    let read = |bytes: &[u8], name: &str| Drawing::decode(bytes, name).unwrap().surface(name).unwrap().unwrap();
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 4\nproperty uchar \
                red\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n10 0 0\n0 10 0\n0 0 10\n9 3 0 2 1\n9 3 0 1 3\n9 3 0 3 2\n9 3 1 2 3\n";
    for found in [
        read(text.as_bytes(), "a.ply"),
        read(&ply::encode(&solid, &[]).unwrap(), "b.ply"),
        read(&encode_surface(&solid, Space::Scanner, "c"), "c.surf.gii"),
    ] {
        assert_eq!(found, solid);
    }
    let facets = read(&stl::encode(&solid), "d.stl");
    assert_eq!((facets.triangles.len(), facets.nodes_mm.len()), (4, 12));
    assert!((facets.enclosed_volume_mm3() - solid.enclosed_volume_mm3()).abs() < 1e-3);
    // A square is two triangles; what is cut short or names a vertex that is not there is refused.
    let square = text.replace("element face 4", "element face 1").replace("9 3 0 2 1\n", "9 4 0 1 2 3\n");
    assert_eq!(read(square.as_bytes(), "e.ply").triangles, [[0, 1, 2], [0, 2, 3]]);
    let refused =
        |text: &str| Drawing::decode(text.as_bytes(), "f.ply").unwrap().surface("f.ply").unwrap_err().to_string();
    assert!(refused(&text.replace("9 3 1 2 3\n", "9 3 1")).contains("cut short"));
    assert!(refused(&text.replace("9 3 1 2 3", "9 3 1 2 7")).contains("vertex 7 of 4"));
    let points = Drawing::decode(b"x,y,z\n1,2,3\n", "g.csv").unwrap();
    assert!(points.surface("g.csv").unwrap().is_none());
}

/// What carries a place in a way that is not read is refused, never read as if it were not there.
#[test]
fn places_in_other_units_axes_or_more_than_points_are_refused() {
    let refused = |text: &str, name: &str| Drawing::decode(text.as_bytes(), name).unwrap_err().to_string();
    let markups = |of: &str| format!("{{\"markups\": [{{{of}, \"controlPoints\": [{{\"position\": [1, 2, 3]}}]}}]}}");
    let said = refused(&markups("\"type\": \"ROI\""), "a.mrk.json");
    assert!(said.contains("ROI") && said.contains("points"), "{said}");
    let said = refused(&markups("\"type\": \"Line\", \"coordinateUnits\": \"m\""), "a.mrk.json");
    assert!(said.contains("coordinateUnits") && said.contains("mm"), "{said}");
    let row = "1,5,6,7,0,0,0,1,1,1,0,F-1,,\n";
    let said = refused(&format!("# columns = label,z,y,x\n{row}"), "a.fcsv");
    assert!(said.contains("columns"), "{said}");
    for system in ["# CoordinateSystem=LPS", "#CoordinateSystem = LPS", "# coordinatesystem = LPS"] {
        let read = Drawing::decode(format!("{system}\n{row}").as_bytes(), "a.fcsv").unwrap();
        assert_eq!(read.points_mm, [[-5.0, -6.0, 7.0]], "{system}");
    }
}
