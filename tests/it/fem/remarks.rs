//! What is allowed but hardly meant is told.

use super::meshes::{block, cube};
use hgm::fem::{FemWarning, Scenario, simulate, simulate_from};
use hgm::mesh::TetMesh;

const GREY: &str = "[materials.grey_matter]\nlaw = 'neo-hookean'\nshear_modulus_pa = 1000.0\npoisson_ratio = 0.45\n";
const WEIGHT: &str = "[loads]\ngravity_m_per_s2 = [0, 0, -9.81]\ndensity_kg_per_m3 = 100.0\n";

fn told(mesh: &TetMesh, text: &str) -> Vec<FemWarning> {
    simulate(mesh, &Scenario::from_toml(text).unwrap(), &|_| ()).unwrap().warnings
}

#[test]
fn a_body_that_nothing_loads_is_told_of_and_one_that_anything_loads_is_not() {
    let mesh = cube(2, 10.0);
    let of = |before: &str, after: &str| told(&mesh, &format!("fixed = ['z0']\n{before}{GREY}{after}"));
    let moved = |z: f64, free: bool| {
        format!("[[prescribed]]\nset = 'z1'\ndisplacement_mm = [0, 0, {z}]\ncomponents = [true, true, {}]\n", !free)
    };
    for (before, after) in [
        (String::new(), ""),
        (moved(0.0, false), ""),
        (moved(0.5, true), ""),
        (String::new(), "[[loads.pressure]]\nset = 'z1'\npressure_pa = 0.0\n"),
    ] {
        assert_eq!(of(&before, after), [FemWarning::Unloaded], "{before}{after}");
    }
    let plane = "[[contact]]\nset = 'z1'\nwall = { shape = 'plane', point_mm = [0, 0, 9.9], normal = [0, 0, -1] }\n";
    for (before, after) in [
        (moved(0.5, false), ""),
        (plane.to_owned(), ""),
        (String::new(), WEIGHT),
        (String::new(), "[[loads.patch]]\nset = 'z1'\nforce_n = [0, 0, -1e-3]\n"),
        (String::new(), "[[loads.pressure]]\nset = 'z1'\npressure_pa = 5.0\n"),
    ] {
        assert!(!of(&before, after).contains(&FemWarning::Unloaded), "{before}{after}");
    }
    // From a start as well.
    let rest = vec![[0.0; 3]; mesh.nodes_mm().len()];
    let scenario = Scenario::from_toml(&format!("fixed = ['z0']\n{GREY}")).unwrap();
    assert_eq!(simulate_from(&mesh, &scenario, &rest, &|_| ()).unwrap().warnings, [FemWarning::Unloaded]);
}

#[test]
fn a_fluid_without_gravity_and_steps_without_motion_are_said_to_have_no_effect() {
    let mesh = cube(2, 10.0);
    let fluid = "csf = { density_kg_per_m3 = 1007.0, level_mm = 5.0 }\n";
    let text = |loads: &str, after: &str| format!("fixed = ['z0']\n{GREY}[loads]\n{loads}{after}");
    let pulled = "patch = [{ set = 'z1', force_n = [0, 0, -1e-3] }]\ndensity_kg_per_m3 = 1040.0\n";
    assert_eq!(told(&mesh, &text(&format!("{pulled}{fluid}"), "")), [FemWarning::FluidWithoutGravity]);
    let heavy = format!("gravity_m_per_s2 = [0, 0, -9.81]\ndensity_kg_per_m3 = 1040.0\n{fluid}");
    assert_eq!(told(&mesh, &text(&heavy, "")), []);
    assert_eq!(told(&mesh, &text(pulled, "[dynamics]\nsteps = 10\n")), [FemWarning::StepsOfNoMotion]);
    assert_eq!(told(&mesh, &text(pulled, "[dynamics]\nsteps = 400\n")), []);
    let motion = told(&mesh, &text(pulled, "[solver]\nmethod = 'backward-euler'\n[dynamics]\nsteps = 10\n"));
    assert!(!motion.contains(&FemWarning::StepsOfNoMotion), "{motion:?}");
}

/// Two blocks side by side along x, whose nodes in the plane between them are two each; the seam's nodes are the set `seam`.
fn two_blocks() -> TetMesh {
    let [left, right] = [-10.0, 0.0].map(|from| {
        // The plane between them is x = -0 of one and x = 0 of the other.
        block([2; 3], move |[x, y, z]| [if from < 0.0 { -(1.0 - x) * 10.0 } else { 10.0 * x }, 10.0 * y, 10.0 * z])
    });
    let behind = left.nodes_mm().len() as u32;
    let nodes = [left.nodes_mm(), right.nodes_mm()].concat();
    let tets = [left.tets().to_vec(), right.tets().iter().map(|tet| tet.map(|n| n + behind)).collect()].concat();
    let labels = vec![2; tets.len()];
    let mut mesh = TetMesh::new(nodes, tets, labels).unwrap();
    for (set, axis) in [("seam", 0), ("base", 2)] {
        let on = |n: &u32| mesh.nodes_mm()[*n as usize][axis] == 0.0;
        let nodes = (0..mesh.nodes_mm().len() as u32).filter(on).collect();
        mesh.set_nodes(set, nodes).unwrap();
    }
    mesh
}

#[test]
fn regions_that_are_not_glued_are_told_of_where_no_set_says_that_they_are_meant_to_be_apart() {
    let mesh = two_blocks();
    let found = told(&mesh, &format!("fixed = ['base']\n{GREY}{WEIGHT}"));
    let [FemWarning::Unglued { facets: 8, at_mm }] = found[..] else { panic!("{found:?}") };
    assert!(at_mm[0] == 0.0 && found[0].to_string().contains("merge their nodes"), "{}", found[0]);
    let contact = "[[contact]]\nset = 'seam'\nwall = { shape = 'own-surface' }\n";
    for meant in [contact, "[supports]\nseam = 'sliding'\n", "[supports]\nseam = 'fixed'\n"] {
        assert_eq!(told(&mesh, &format!("fixed = ['base']\n{meant}{GREY}{WEIGHT}")), [], "{meant}");
    }
}

#[test]
fn a_mesh_that_was_cut_open_along_a_sheet_that_slides_is_not_called_unglued() {
    let mut mesh = block([4, 2, 2], |[x, y, z]| [40.0 * x, 20.0 * y, 20.0 * z]);
    for (set, axis, at) in [("sheet", 0, 20.0), ("base", 2, 0.0)] {
        let on = |n: &u32| mesh.nodes_mm()[*n as usize][axis] == at;
        let nodes = (0..mesh.nodes_mm().len() as u32).filter(on).collect();
        mesh.set_nodes(set, nodes).unwrap();
    }
    let text = format!("fixed = ['base']\n[supports]\nsheet = 'sliding'\n{GREY}{WEIGHT}");
    let cut = Scenario::from_toml(&text).unwrap().body(&mesh).unwrap().into_owned();
    assert!(cut.nodes_mm().len() > mesh.nodes_mm().len());
    for mesh in [&mesh, &cut] {
        assert_eq!(told(mesh, &text), []);
    }
}

#[test]
fn a_model_that_is_stretched_beyond_what_it_was_measured_at_is_told_of_and_by_how_much() {
    let mesh = cube(2, 10.0);
    let side = |set: &str, to: [f64; 3], of: &str| {
        format!("[[prescribed]]\nset = '{set}'\ndisplacement_mm = {to:?}\ncomponents = {of}\n")
    };
    // Free to the sides, as in a test between plates without friction.
    let told_at = |law: &str, stretch: f64, element: &str| {
        let planes = [("x0", "[true, false, false]"), ("y0", "[false, true, false]"), ("z0", "[false, false, true]")];
        let planes = planes.map(|(set, of)| side(set, [0.0; 3], of)).concat();
        let plate = side("z1", [0.0, 0.0, 10.0 * (stretch - 1.0)], "[false, false, true]");
        let text = format!(
            "{planes}{plate}[materials.grey_matter]\n{law}\npoisson_ratio = 0.45\n[solver]\nelement = '{element}'\n"
        );
        told(&mesh, &text)
    };
    for element in ["tet4", "tet4-nodal", "tet10"] {
        for (id, stretch, inside) in [
            ("53-tension", 1.09, true),
            ("53-tension", 1.105, true),
            ("53-tension", 1.2, false),
            ("53-tension", 0.995, true),
            ("53-tension", 0.93, false),
            ("53-compression", 0.91, true),
            ("53-compression", 0.8, false),
            ("53-compression", 1.07, false),
        ] {
            let found = told_at(&format!("law = 'literature'\nid = '{id}'"), stretch, element);
            let expected = |warning: &FemWarning| {
                let FemWarning::OutsideMeasured { material, cells: 48, of: 48, least, most, .. } = warning else {
                    return false;
                };
                // Every cell is stretched as the plates are apart.
                material == "grey_matter" && (least - stretch).abs() < 1e-6 && (most - stretch).abs() < 1e-6
            };
            let as_expected = if inside { found.is_empty() } else { found.len() == 1 && expected(&found[0]) };
            assert!(as_expected, "{element} {id} {stretch}: {found:?}");
        }
        // A law of one's own makes no claim.
        assert_eq!(told_at("law = 'neo-hookean'\nshear_modulus_pa = 500.0", 0.8, element), []);
    }
    let said = told_at("law = 'literature'\nid = '53-tension'", 0.93, "tet4")[0].to_string();
    assert!(said.contains("stretches of 1 to 1.1") && said.contains("0.930"), "{said}");
}

#[test]
fn a_corner_that_is_stretched_more_than_a_model_was_measured_at_says_nothing_of_the_body() {
    let mut mesh = cube(6, 10.0);
    let nodes = mesh.nodes_mm();
    let corner = (0..nodes.len() as u32).filter(|&n| nodes[n as usize].iter().all(|x| *x > 9.9)).collect();
    mesh.set_nodes("corner", corner).unwrap();
    // How much longer the edge that is stretched most has become, which a cell of it is stretched by at least; and what is told.
    let pulled = |mm: f64| {
        let text = format!(
            "fixed = ['x0']\n[[prescribed]]\nset = 'corner'\ndisplacement_mm = [{mm:?}, 0.0, 0.0]\n\
             [materials.grey_matter]\nlaw = 'literature'\nid = '1'\npoisson_ratio = 0.45\n"
        );
        let found = simulate(&mesh, &Scenario::from_toml(&text).unwrap(), &|_| ()).unwrap();
        let length = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
        let place = |n: u32| mesh.nodes_mm()[n as usize];
        let moved = |n: u32| [0, 1, 2].map(|i| place(n)[i] + found.displacement_mm[n as usize][i]);
        let edges =
            mesh.tets().iter().flat_map(|t| [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]].map(|e| e.map(|c| t[c])));
        let stretches = edges.map(|[a, b]| length(moved(a), moved(b)) / length(place(a), place(b)));
        (stretches.fold(0.0, f64::max), found.warnings)
    };
    // Measured up to 1.1; a few of 1296 cells are beyond it.
    let (longest, warnings) = pulled(0.7);
    assert!(longest > 1.13 && warnings.is_empty(), "{longest} {warnings:?}");
    let (_, warnings) = pulled(2.5);
    assert!(matches!(warnings[..], [FemWarning::OutsideMeasured { cells: 13.., of: 1296, .. }]), "{warnings:?}");
}
