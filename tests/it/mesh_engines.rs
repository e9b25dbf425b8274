//! The meshing engines that are programs, hard label maps, and `hgm mesh` itself.

use hgm::geometry::Mni;
use hgm::image::nifti::encode_u8;
use hgm::image::{Grid, LabelMap};
use hgm::mesh::TetMesh;
use hgm::mesh::engine::{Engine, EngineError, EnginePrograms, Limits, MeshSettings, MeshSize, mesh_labels};
use hgm::mesh::format::vtu;
use hgm::mesh::quality::{fidelity, shape_quality};
use std::process::Command;

fn programs() -> EnginePrograms {
    hgm::workflow::Programs::look_up(None, |name| std::env::var_os(name)).engines()
}

/// A map at 1 mm around the origin, `n` voxels along each axis, by a rule in mm from the middle.
fn map(n: usize, label: impl Fn([f64; 3]) -> u8) -> LabelMap<Mni> {
    let half = (n - 1) as f64 / 2.0;
    let grid = Grid::axis_aligned([n; 3], [1.0; 3], [-half; 3]);
    let data = (0..grid.len()).map(|v| label(grid.voxel(v).map(|c| c as f64 - half))).collect();
    LabelMap::from_data(grid, data)
}

fn norm(p: [f64; 3]) -> f64 {
    p.iter().map(|c| c * c).sum::<f64>().sqrt()
}

fn ball_in_shell() -> LabelMap<Mni> {
    map(44, |p| if norm(p) < 12.0 { 3 } else { 2 * u8::from(norm(p) < 20.0) })
}

fn settings(engine: Engine, cells: usize) -> MeshSettings {
    MeshSettings { engine, size: MeshSize::Cells(cells), ..MeshSettings::default() }
}

fn assert_shape(mesh: &TetMesh, what: &str) {
    let shape = shape_quality(mesh);
    assert!(shape.dihedral_min_deg >= 10.0 && shape.dihedral_percentile_1_deg >= 15.0, "{what}: {shape:?}");
    assert!(shape.radius_ratio_min >= 0.1 && shape.scaled_jacobian_min >= 0.05, "{what}: {shape:?}");
    assert_eq!((shape.non_manifold_outer_edges, shape.crossing_facets), (0, 0), "{what}");
}

#[test]
fn every_engine_meshes_a_ball_in_a_shell_well_and_twice_the_same() {
    let programs = programs();
    for engine in Engine::all().filter(|engine| programs.has(*engine)) {
        let map = ball_in_shell();
        let make = || mesh_labels(&map, &settings(engine, 6000), &programs).unwrap().0;
        let mesh = make();
        let count = mesh.tets().len() as f64;
        assert!((count / 6000.0 - 1.0).abs() < 0.15, "{}: {count} tets", engine.name());
        assert_shape(&mesh, engine.name());
        for label in fidelity(&mesh, &map, &[]).labels {
            assert!(label.volume_error_percent.abs() < 1.0 && label.dice > 0.95, "{}: {label:?}", engine.name());
        }
        assert!(mesh == make(), "{} gives another mesh the second time", engine.name());
    }
}

#[test]
fn engines_that_take_too_long_are_stopped_by_name() {
    let programs = programs();
    let limits = Limits { time_s: 1e-3, ..Limits::default() };
    for engine in [Engine::GMSH, Engine::TETGEN].into_iter().filter(|engine| programs.has(*engine)) {
        let settings = MeshSettings { limits, ..settings(engine, 3000) };
        let error = mesh_labels(&ball_in_shell(), &settings, &programs).unwrap_err();
        let message = error.to_string();
        assert!(message.contains(engine.name()) && message.contains("stopped after"), "{message}");
    }
    let error = mesh_labels(&ball_in_shell(), &settings(Engine::TETGEN, 3000), &EnginePrograms::default()).unwrap_err();
    assert!(matches!(&error, EngineError::Missing { engine: "tetgen", .. }), "{error}");
}

#[test]
fn hard_label_maps_are_meshed_within_the_bars_or_refused_by_name() {
    let thin_gyrus =
        map(40, |p| 2 * u8::from(norm(p) < 10.0 || (p[0].abs() < 0.6 && p[1].abs() < 6.0 && p[2].abs() < 17.0)));
    let corner =
        map(24, |p| 2 * u8::from((p.iter().all(|&c| c > 0.0) || p.iter().all(|&c| c < 0.0)) && norm(p) < 10.0));
    let hole = map(40, |p| 2 * u8::from((12.0..16.0).contains(&norm(p)) && (p[0].hypot(p[1]) > 3.0 || p[2] < 0.0)));
    let mut slices = ball_in_shell();
    let mut matrix = slices.grid.mm_from_voxel;
    matrix[(2, 2)] = 5.0;
    slices.grid = Grid::new(slices.grid.dims, matrix).unwrap();
    let cut = map(30, |p| 2 + u8::from(norm(p) < 12.0));
    let islands = map(40, |p| {
        let speck = norm([p[0] - 16.0, p[1] - 16.0, p[2]]) < 1.2 || norm([p[0] - 5.0, p[1], p[2]]) < 1.2;
        if speck { 4 } else { 2 * u8::from(norm(p) < 14.0) }
    });
    let cases = [
        ("a gyrus of one voxel", thin_gyrus),
        ("regions that touch at a corner", corner),
        ("a hole in a shell", hole),
        ("slices of 5 mm", slices),
        ("a brain cut at the volume's edge", cut),
        ("islands", islands),
    ];
    let programs = programs();
    for engine in [Engine::LATTICE, Engine::CGAL].into_iter().filter(|engine| programs.has(*engine)) {
        for (what, map) in &cases {
            let what = format!("{what} with {}", engine.name());
            match mesh_labels(map, &settings(engine, 5000), &programs) {
                Ok((mesh, _)) => assert_shape(&mesh, &what),
                Err(error) => panic!("{what}: {error}"),
            }
        }
        // One voxel has no room for tets of a size that five thousand would have elsewhere: meshed well, or refused by place.
        let one = map(9, |p| 2 * u8::from(norm(p) < 0.5));
        match mesh_labels(&one, &MeshSettings { size: MeshSize::EdgeMm(4.0), ..settings(engine, 1) }, &programs) {
            Ok((mesh, _)) => assert_shape(&mesh, "one voxel"),
            Err(error) => assert!(error.to_string().contains("near [0.0, 0.0, 0.0]"), "{error}"),
        }
        let empty = mesh_labels(&map(9, |_| 0), &settings(engine, 100), &programs).unwrap_err();
        assert!(empty.to_string().contains("no voxel carries a label"), "{empty}");
    }
}

fn hgm(arguments: &[&str]) -> std::process::Output {
    let program = std::env::var_os("HGM_PROGRAM").unwrap_or_else(|| env!("CARGO_BIN_EXE_hgm").into());
    Command::new(program).args(arguments).output().unwrap()
}

#[test]
fn the_command_writes_every_format_with_pictures_and_the_same_bytes_on_two_threads() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(at("ball_dseg.nii.gz"), encode_u8(&ball_in_shell())).unwrap();
    for format in ["vtu", "msh", "inp", "feb"] {
        let out = at(&format!("ball.{format}"));
        let options = ["--cells", "3000", "--mesher", "lattice", "--sets", "none", "--json", "--threads", "1"];
        let done = hgm(&[["mesh", &at("ball_dseg.nii.gz"), "-o", &out].as_slice(), &options].concat());
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let said: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
        assert!(
            said["dihedral_min_deg"].as_f64().unwrap() > 10.0 && said["dice"]["white_matter"].as_f64().unwrap() > 0.9
        );
    }
    let (again, preview) = (at("again.vtu"), at("ball.png"));
    let options = ["--cells", "3000", "--mesher", "lattice", "--sets", "none", "--threads", "2", "--preview", &preview];
    let done = hgm(&[["mesh", &at("ball_dseg.nii.gz"), "-o", &again].as_slice(), &options].concat());
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let bytes = std::fs::read(&again).unwrap();
    assert!(bytes == std::fs::read(at("ball.vtu")).unwrap(), "another mesh on two threads");
    assert!(vtu::decode(&bytes, "again.vtu").unwrap().mesh.labels().contains(&3));
    assert!(std::fs::read(preview).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn the_command_refuses_unknown_formats_and_gates_sets_that_are_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(at("ball_dseg.nii.gz"), encode_u8(&ball_in_shell())).unwrap();
    let refused = hgm(&["mesh", &at("ball_dseg.nii.gz"), "-o", &at("ball.obj")]);
    assert_eq!(refused.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&refused.stderr).contains(".vtu, .msh, .inp or .feb"));
    // A ball of 4 cm in MNI space has no falx, base and superior patch of an adult's size.
    let options = ["--cells", "2000", "--mesher", "lattice", "--sets", "mni"];
    let gated = hgm(&[["mesh", &at("ball_dseg.nii.gz"), "-o", &at("ball.vtu")].as_slice(), &options].concat());
    let said = String::from_utf8_lossy(&gated.stderr).into_owned();
    assert_eq!(gated.status.code(), Some(4), "{said}");
    assert!(said.contains("boundary set") && folder.path().join("ball.vtu").exists(), "{said}");
}
