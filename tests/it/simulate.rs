//! `hgm simulate` from the command line: files in, files out, refusals by name.

use hgm::mesh::TetMesh;
use hgm::mesh::format::{Field, msh, vtu};
use std::path::Path;
use std::process::{Command, Output};

const SCENARIO: &str = "
fixed = ['base']
[materials.grey_matter]
law = 'neo-hookean'
shear_modulus_pa = 1370.0
poisson_ratio = 0.45
[loads]
gravity_m_per_s2 = [0.0, 0.0, -9.81]
";

fn simulate(folder: &Path, arguments: &[&str]) -> Output {
    let program = std::env::var_os("HGM_PROGRAM").unwrap_or_else(|| env!("CARGO_BIN_EXE_hgm").into());
    Command::new(program).current_dir(folder).arg("simulate").args(arguments).output().unwrap()
}

/// A bar of 3 x 3 x 6 cells of 10 mm with the set `base`.
fn bar() -> TetMesh {
    let node = |i: usize, j: usize, k: usize| (i + 4 * (j + 4 * k)) as u32;
    let nodes = (0..112).map(|n| [n % 4, n / 4 % 4, n / 16].map(|x| 10.0 * f64::from(x))).collect();
    let mut tets = Vec::new();
    for cell in 0..54 {
        let (i, j, k) = (cell % 3, cell / 3 % 3, cell / 9);
        let corner = |b: usize| node(i + (b & 1), j + (b >> 1 & 1), k + (b >> 2));
        for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
            tets.push([corner(0), corner(a), corner(b), corner(7)]);
        }
    }
    let labels = vec![2; tets.len()];
    let mut mesh = TetMesh::new(nodes, tets, labels).unwrap();
    mesh.set_nodes("base", (0..16).collect()).unwrap();
    mesh
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bar.vtu"), vtu::encode(&bar(), &[], &[]).unwrap()).unwrap();
    std::fs::write(folder.path().join("s.toml"), SCENARIO).unwrap();
    folder
}

#[test]
fn a_deformation_is_written_with_fields_record_and_manifest_and_skipped_the_second_time() {
    let folder = folder();
    let done = simulate(folder.path(), &["bar.vtu", "s.toml", "-o", "out.vtu", "--json"]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let json: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    assert!(json["convergence"]["relative_residual"].as_f64().unwrap() <= 1e-8);
    assert!(json["convergence"]["worst_volume_ratio"].as_f64().unwrap() < 1.0);
    assert!(!json["convergence"]["iterations"].as_array().unwrap().is_empty());
    let weight = 1e3 * 9.81 * 0.03 * 0.03 * 0.06;
    assert!((json["reaction_n"][2].as_f64().unwrap() - weight).abs() < 1e-6 * weight);
    let bytes = std::fs::read(folder.path().join("out.vtu")).unwrap();
    let out = vtu::decode(&bytes, "out.vtu").unwrap();
    assert!(out.point_field("displacement").unwrap().vectors().unwrap().iter().any(|u| u[2] < -0.1));
    for (name, found) in [("reaction_n", out.point_field("reaction_n")), ("jacobian", out.cell_field("jacobian"))] {
        assert!(found.is_some(), "{name}");
    }
    assert!(out.cell_field("strain_energy_density_pa").unwrap().values.iter().all(|&w| w >= 0.0));
    assert!(folder.path().join("out.vtu.manifest.json").exists());

    let modified = || std::fs::metadata(folder.path().join("out.vtu")).unwrap().modified().unwrap();
    let before = modified();
    let again = simulate(folder.path(), &["bar.vtu", "s.toml", "-o", "out.vtu", "--json"]);
    assert_eq!(again.stdout, done.stdout);
    assert_eq!(modified(), before);
    let forced = simulate(folder.path(), &["bar.vtu", "s.toml", "-o", "out.vtu", "--force", "--threads", "2"]);
    assert!(forced.status.success());
    assert_eq!(std::fs::read(folder.path().join("out.vtu")).unwrap(), bytes);
}

#[test]
fn a_result_is_a_start_and_a_reference_and_gmsh_meshes_give_the_same() {
    let folder = folder();
    assert!(simulate(folder.path(), &["bar.vtu", "s.toml", "-o", "a.vtu"]).status.success());
    let warm = ["bar.vtu", "s.toml", "-o", "b.vtu", "--start", "a.vtu", "--reference", "a.vtu", "--json"];
    let json: serde_json::Value = serde_json::from_slice(&simulate(folder.path(), &warm).stdout).unwrap();
    assert_eq!(json["convergence"]["iterations"].as_array().unwrap().len(), 0);
    assert_eq!(json["rmse_mm"], 0.0);
    std::fs::write(folder.path().join("bar.msh"), msh::encode(&bar()).unwrap()).unwrap();
    let gmsh = ["bar.msh", "s.toml", "-o", "c.vtu", "--reference", "a.vtu", "--json"];
    let done = simulate(folder.path(), &gmsh);
    let json: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    assert!(json["rmse_mm"].as_f64().unwrap() < 1e-5, "{json}");
}

#[test]
fn nodes_of_no_tetrahedron_thin_no_mean_out() {
    let folder = folder();
    let mut nodes = bar().nodes_mm().to_vec();
    nodes.extend((0..300).map(|n| [200.0 + f64::from(n), 0.0, 0.0]));
    let mut with_more = TetMesh::new(nodes, bar().tets().to_vec(), bar().labels().to_vec()).unwrap();
    with_more.node_sets = bar().node_sets.clone();
    std::fs::write(folder.path().join("more.vtu"), vtu::encode(&with_more, &[], &[]).unwrap()).unwrap();
    let light = SCENARIO.replace("-9.81", "-8.81");
    std::fs::write(folder.path().join("light.toml"), light).unwrap();
    let figures = |mesh: &str| {
        let reference = format!("light-{mesh}");
        let done = simulate(folder.path(), &[mesh, "light.toml", "-o", &reference]);
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let out = format!("out-{mesh}");
        let done = simulate(folder.path(), &[mesh, "s.toml", "-o", &out, "--reference", &reference, "--json"]);
        let json: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
        ["displacement_rms_mm", "rmse_mm"].map(|figure| json[figure].as_f64().unwrap())
    };
    let (alone, more) = (figures("bar.vtu"), figures("more.vtu"));
    assert!(alone.iter().zip(&more).all(|(a, b)| *a > 0.01 && (a - b).abs() < 1e-4 * a), "{alone:?} {more:?}");
}

#[test]
fn a_motion_gets_a_series() {
    let folder = folder();
    let motion = "[solver]\nmethod = 'backward-euler'\n[dynamics]\nsteps = 6\nkeep_every = 2\n";
    std::fs::write(folder.path().join("m.toml"), format!("{SCENARIO}{motion}")).unwrap();
    let done = simulate(folder.path(), &["bar.vtu", "m.toml", "-o", "m.vtu", "--json"]);
    let json: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(json["motion"]["steps"], 6);
    assert_eq!(json["series"], "m.pvd");
    let series = std::fs::read_to_string(folder.path().join("m.pvd")).unwrap();
    for n in 1..=3 {
        let name = format!("m-{n:04}.vtu");
        assert!(series.contains(&name));
        assert!(vtu::decode(&std::fs::read(folder.path().join(&name)).unwrap(), &name).is_ok());
    }
}

#[test]
fn what_cannot_be_simulated_is_refused_by_file_and_key() {
    let folder = folder();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let vtu_text = |points: &str, corners: &str, label: &str| {
        format!(
            "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\"><UnstructuredGrid>\
             <Piece NumberOfPoints=\"4\" NumberOfCells=\"1\"><Points><DataArray type=\"Float64\" Name=\"Points\" \
             NumberOfComponents=\"3\" format=\"ascii\">{points}</DataArray></Points><Cells>\
             <DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">{corners}</DataArray>\
             <DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">4</DataArray>\
             <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">10</DataArray></Cells>\
             <PointData><DataArray type=\"UInt8\" Name=\"base\" format=\"ascii\">1 1 1 0</DataArray></PointData>\
             <CellData>{label}</CellData></Piece></UnstructuredGrid></VTKFile>"
        )
    };
    let label = "<DataArray type=\"Int32\" Name=\"label\" format=\"ascii\">2</DataArray>";
    let (points, corners) = ("0 0 0 1 0 0 0 1 0 0 0 1", "0 1 2 3");
    write("good.vtu", &vtu_text(points, corners, label));
    write("inverted.vtu", &vtu_text(points, "0 2 1 3", label));
    write("flat.vtu", &vtu_text("0 0 0 1 0 0 0 1 0 1 1 0", corners, label));
    write("nan.vtu", &vtu_text("0 0 0 1 0 0 0 1 0 0 0 nan", corners, label));
    write("unlabelled.vtu", &vtu_text(points, corners, ""));
    assert!(simulate(folder.path(), &["good.vtu", "s.toml", "-o", "x.vtu"]).status.success());

    let scenarios = [
        ("loose.toml", SCENARIO.replace("fixed = ['base']", "")),
        ("set.toml", SCENARIO.replace("'base'", "'skull'")),
        ("nu.toml", SCENARIO.replace("0.45", "0.5")),
        ("modulus.toml", SCENARIO.replace("1370.0", "-1370.0")),
        ("label.toml", SCENARIO.replace("grey_matter", "white_matter")),
        ("key.toml", SCENARIO.replace("poisson_ratio", "poisson")),
    ];
    for (name, text) in &scenarios {
        write(name, text);
    }
    for (mesh, scenario, words) in [
        ("inverted.vtu", "s.toml", ["inverted.vtu", "tetrahedron 0"]),
        ("flat.vtu", "s.toml", ["flat.vtu", "tetrahedron 0"]),
        ("nan.vtu", "s.toml", ["nan.vtu", "node 3"]),
        ("unlabelled.vtu", "s.toml", ["unlabelled.vtu", "label"]),
        ("good.vtu", "loose.toml", ["loose.toml", "fixed"]),
        ("good.vtu", "set.toml", ["set.toml", "`skull`"]),
        ("good.vtu", "nu.toml", ["nu.toml", "poisson_ratio"]),
        ("good.vtu", "modulus.toml", ["modulus.toml", "shear_modulus_pa"]),
        ("good.vtu", "label.toml", ["label.toml", "cell 0"]),
        ("good.vtu", "key.toml", ["key.toml", "poisson"]),
        ("good.vtu", "none.toml", ["none.toml", "read"]),
        ("good.stl", "s.toml", ["good.stl", "read"]),
    ] {
        let refused = simulate(folder.path(), &[mesh, scenario, "-o", "y.vtu"]);
        let message = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(refused.status.code(), Some(3), "{mesh} {scenario}: {message}");
        assert!(words.iter().all(|w| message.contains(w)), "{mesh} {scenario}: {message}");
        assert!(!folder.path().join("y.vtu").exists());
    }
}

#[test]
fn what_a_result_is_made_of_is_not_written_over_and_no_cell_counts_twice() {
    let folder = folder();
    let before = std::fs::read(folder.path().join("bar.vtu")).unwrap();
    let over = simulate(folder.path(), &["bar.vtu", "s.toml", "-o", "bar.vtu", "--force"]);
    assert_eq!(over.status.code(), Some(3), "{}", String::from_utf8_lossy(&over.stderr));
    assert_eq!(std::fs::read(folder.path().join("bar.vtu")).unwrap(), before);
    let twice = TetMesh::new(
        bar().nodes_mm().to_vec(),
        bar().tets().iter().chain(&bar().tets()[..1]).copied().collect(),
        bar().labels().iter().chain(&bar().labels()[..1]).copied().collect(),
    );
    std::fs::write(folder.path().join("twice.vtu"), vtu::encode(&twice.unwrap(), &[], &[]).unwrap()).unwrap();
    let said = simulate(folder.path(), &["twice.vtu", "s.toml", "-o", "out.vtu"]);
    assert_eq!(said.status.code(), Some(3), "{}", String::from_utf8_lossy(&said.stderr));
    assert!(String::from_utf8_lossy(&said.stderr).contains("same nodes"));
}

#[test]
fn a_mesh_is_not_written_over_by_its_own_results_whatever_they_are_called() {
    let folder = folder();
    let said = |mesh: &str, output: &str| {
        std::fs::copy(folder.path().join("bar.vtu"), folder.path().join(mesh)).unwrap();
        let ended = simulate(folder.path(), &[mesh, "s.toml", "-o", output]);
        (ended.status.code(), String::from_utf8_lossy(&ended.stderr).into_owned())
    };
    for mesh in ["m-0001.vtu", "m.vtu"] {
        let (code, text) = said(mesh, "m.vtu");
        assert!(code == Some(3) && text.contains(mesh) && text.contains("another name"), "{text}");
    }
    let (code, text) = said("in.vtu", "in.vtu.vtu");
    assert!(code == Some(0) && folder.path().join("in.vtu.vtu").exists(), "{text}");
    assert_eq!(
        std::fs::read(folder.path().join("in.vtu")).unwrap(),
        std::fs::read(folder.path().join("bar.vtu")).unwrap()
    );
}

#[test]
fn a_reference_with_its_nodes_elsewhere_is_refused_and_a_volume_called_otherwise_is_told() {
    let folder = folder();
    let run = |arguments: &[&str]| {
        let ended = simulate(folder.path(), arguments);
        (ended.status.code(), String::from_utf8_lossy(&ended.stderr).into_owned())
    };
    assert_eq!(run(&["bar.vtu", "s.toml", "-o", "out.vtu"]).0, Some(0));
    let nodes: Vec<[f64; 3]> = bar().nodes_mm().iter().rev().copied().collect();
    let last = nodes.len() as u32 - 1;
    let tets = bar().tets().iter().map(|tet| tet.map(|n| last - n)).collect();
    let turned = TetMesh::new(nodes, tets, bar().labels().to_vec()).unwrap();
    let still = vec![[0.0; 3]; turned.nodes_mm().len()];
    let field = [Field::vector("displacement", &still)];
    std::fs::write(folder.path().join("other.vtu"), vtu::encode(&turned, &field, &[]).unwrap()).unwrap();
    let (code, text) = run(&["bar.vtu", "s.toml", "-o", "r.vtu", "--reference", "other.vtu"]);
    assert!(code == Some(3) && text.contains("other.vtu: node 0") && text.contains("same mesh"), "{text}");

    let mesh = String::from_utf8(msh::encode(&bar()).unwrap()).unwrap();
    std::fs::write(folder.path().join("named.msh"), mesh.replace("\"grey_matter\"", "\"white_matter\"")).unwrap();
    let (code, text) = run(&["named.msh", "s.toml", "-o", "n.vtu"]);
    assert!(code == Some(0) && text.contains("volume 2 is called `white_matter`"), "{text}");
    let (_, text) = run(&["bar.vtu", "s.toml", "-o", "m.vtu"]);
    assert!(!text.contains("is called"), "{text}");
}
