//! What the supports carry tells what was loaded.

use super::meshes::cube;
use hgm::fem::{FemError, Scenario, simulate};
use hgm::mesh::TetMesh;

const GREY: &str = "[materials.grey_matter]\nlaw = 'neo-hookean'\nshear_modulus_pa = 3000.0\npoisson_ratio = 0.4\n";

/// Force on the held nodes together, N.
fn carried(mesh: &TetMesh, held: &str, loads: &str) -> [f64; 3] {
    let text = format!("fixed = ['{held}']\n{GREY}[solver]\nrelative_residual = 1e-11\n[loads]\n{loads}");
    let outcome = simulate(mesh, &Scenario::from_toml(&text).unwrap(), &|_| ()).unwrap();
    [0, 1, 2].map(|i| outcome.reaction_n.iter().map(|r| r[i]).sum())
}

fn close(a: [f64; 3], b: [f64; 3]) {
    for i in 0..3 {
        assert!((a[i] - b[i]).abs() < 1e-8, "{a:?} against {b:?}");
    }
}

#[test]
fn tissue_below_the_fluid_level_weighs_what_the_fluid_leaves() {
    // 4 cells of 10 mm along each axis: planes of nodes carry 1/8, 1/4, 1/4, 1/4, 1/8 of the volume.
    let mesh = cube(4, 40.0);
    let volume = 64e-6;
    let csf = |level: f64| format!("csf = {{ density_kg_per_m3 = 1007.0, level_mm = {level} }}\n");
    for (level, submerged) in [(-1.0, 0.0), (15.0, 0.375), (35.0, 0.875), (41.0, 1.0)] {
        let loads = format!("gravity_m_per_s2 = [0, 0, -9.81]\ndensity_kg_per_m3 = 1040.0\n{}", csf(level));
        let weight = 9.81 * volume * (1040.0 - 1007.0 * submerged);
        close(carried(&mesh, "z0", &loads), [0.0, 0.0, weight]);
    }
    // The head turned: gravity along +x, the surface at x = 25 mm is 25 mm below the origin.
    let loads = format!("gravity_m_per_s2 = [9.81, 0, 0]\ndensity_kg_per_m3 = 1040.0\n{}", csf(-25.0));
    close(carried(&mesh, "x0", &loads), [-9.81 * volume * (1040.0 - 1007.0 * 0.375), 0.0, 0.0]);
}

#[test]
fn pressure_pushes_along_the_inward_normal_with_the_area() {
    let mesh = cube(3, 40.0);
    let area = 16e-4;
    close(carried(&mesh, "z0", "pressure = [{ set = 'x1', pressure_pa = 200.0 }]"), [200.0 * area, 0.0, 0.0]);
    close(carried(&mesh, "z0", "pressure = [{ set = 'y0', pressure_pa = -100.0 }]"), [0.0, 100.0 * area, 0.0]);
}

#[test]
fn a_patch_force_is_carried_whole() {
    let mesh = cube(3, 40.0);
    close(carried(&mesh, "z0", "patch = [{ set = 'z1', force_n = [0.2, -0.3, 0.4] }]"), [-0.2, 0.3, -0.4]);
}

fn refused(mesh: &TetMesh, loads: &str) -> FemError {
    simulate(mesh, &Scenario::from_toml(&format!("fixed = ['z0']\n{GREY}[loads]\n{loads}")).unwrap(), &|_| ())
        .unwrap_err()
}

const BOTH: [&str; 2] =
    ["patch = [{ set = 'drawn', force_n = [0.2, -0.3, 0.4] }]", "pressure = [{ set = 'drawn', pressure_pa = 200.0 }]"];

#[test]
fn facets_of_no_cell_bear_no_load_and_are_refused() {
    let mut mesh = cube(2, 40.0);
    let top = mesh.node_sets["z1"].clone();
    let mut drawn = mesh.boundary_facets(|_| true);
    drawn.retain(|f| f.iter().all(|n| top.binary_search(n).is_ok()));
    mesh.facet_sets.insert("drawn".into(), drawn.clone());
    close(carried(&mesh, "z0", BOTH[0]), [-0.2, 0.3, -0.4]);
    close(carried(&mesh, "z0", BOTH[1]), [0.0, 0.0, 200.0 * 16e-4]);
    // A node set that is loaded beside it has the facets of the boundary.
    let beside = format!("{}\npressure = [{{ set = 'x1', pressure_pa = 200.0 }}]", BOTH[0]);
    close(carried(&mesh, "z0", &beside), [200.0 * 16e-4 - 0.2, 0.3, -0.4]);
    // Three corners of the cube are no facet of a cell.
    drawn.push([0, 2, 6]);
    mesh.facet_sets.insert("drawn".into(), drawn);
    for loads in BOTH {
        let error = refused(&mesh, loads);
        assert!(matches!(error, FemError::StrayFacets { stray: 1, of: 9, .. }), "{error}");
        assert!(error.to_string().contains("`drawn`") && error.to_string().contains("take them out"), "{error}");
    }
}

#[test]
fn pressure_on_facets_within_the_body_acts_on_the_side_they_are_turned_to_or_is_refused() {
    let mut mesh = cube(2, 40.0);
    let middle = |n: u32| (mesh.nodes_mm()[n as usize][0] - 20.0).abs() < 1e-9;
    let turned_to_x = |f: [u32; 3]| if mesh.area_vector_mm2(f).x > 0.0 { f } else { [f[0], f[2], f[1]] };
    let mut drawn: Vec<[u32; 3]> =
        mesh.facets().into_iter().map(|f| f.0).filter(|f| f.iter().all(|&n| middle(n))).map(turned_to_x).collect();
    mesh.facet_sets.insert("drawn".into(), drawn.clone());
    close(carried(&mesh, "z0", BOTH[1]), [200.0 * 16e-4, 0.0, 0.0]);
    drawn[3].swap(0, 1);
    mesh.facet_sets.insert("drawn".into(), drawn);
    let error = refused(&mesh, BOTH[1]);
    assert!(matches!(error, FemError::NoSide { .. }), "{error}");
    assert!(error.to_string().contains("`drawn`") && error.to_string().contains("turn all its facets"), "{error}");
    // A force has its own direction.
    close(carried(&mesh, "z0", BOTH[0]), [-0.2, 0.3, -0.4]);
}

#[test]
fn what_holds_presses_and_pulls_balances_the_loads() {
    let mesh = cube(3, 40.0);
    let weight = [1.5, -0.7, -9.81].map(|g| g * 64e-6 * 400.0);
    let springs = "[[tethers]]\nset = 'x1'\nstiffness_pa_per_mm = 300.0\n\
                   [[tethers]]\nset = 'y1'\nstiffness_pa_per_mm = 20.0\nonly_normal = true\n";
    let wall = "[[contact]]\nset = 'z0'\nwall = { shape = 'plane', point_mm = [0, 0, 0.1], normal = [0, 0, 1] }\n";
    let moved = "[[prescribed]]\nset = 'x0'\ndisplacement_mm = [0.5, 0, 0]\ncomponents = [true, false, true]\n";
    for (held, parts) in [
        ("fixed = ['x0']\n".to_owned() + springs + wall, [true, true, true]),
        (moved.to_owned() + springs, [true, true, false]),
        (springs.to_owned() + wall, [false, true, true]),
        (springs.to_owned(), [false, true, false]),
    ] {
        for element in ["tet4", "tet4-nodal", "tet10"] {
            let text = format!(
                "{held}{GREY}[solver]\nelement = '{element}'\nrelative_residual = 1e-11\n[loads]\n\
                 gravity_m_per_s2 = [1.5, -0.7, -9.81]\ndensity_kg_per_m3 = 400.0\n"
            );
            let outcome = simulate(&mesh, &Scenario::from_toml(&text).unwrap(), &|_| ()).unwrap();
            let sum = |forces: &[[f64; 3]]| [0, 1, 2].map(|i| forces.iter().map(|f| f[i]).sum::<f64>());
            let reaction = sum(&outcome.reaction_n);
            let of_walls = sum(&outcome.contact.iter().map(|wall| wall.force_n).collect::<Vec<_>>());
            let of_springs = sum(&outcome.tethers.iter().map(|springs| springs.force_n).collect::<Vec<_>>());
            close([0, 1, 2].map(|i| reaction[i] + of_walls[i] + of_springs[i] + weight[i]), [0.0; 3]);
            assert_eq!([reaction, of_springs, of_walls].map(|force| force != [0.0; 3]), parts, "{element}: {held}");
            // One entry for each, in the scenario's order; those along the normal pull along it alone.
            let sets: Vec<&str> = outcome.tethers.iter().map(|springs| springs.set.as_str()).collect();
            assert_eq!(sets, ["x1", "y1"]);
            assert!(outcome.tethers[1].force_n[0].abs().max(outcome.tethers[1].force_n[2].abs()) < 1e-12);
            let farthest = |set: &str| {
                let moved = mesh.node_sets[set].iter().map(|&n| outcome.displacement_mm[n as usize]);
                moved.map(|u| u.iter().map(|x| x * x).sum::<f64>().sqrt()).fold(0.0, f64::max)
            };
            if element != "tet10" {
                assert!((outcome.tethers[0].stretch_mm - farthest("x1")).abs() < 1e-9);
            }
        }
    }
    let alone = simulate(&mesh, &Scenario::from_toml(&format!("fixed = ['z0']\n{GREY}")).unwrap(), &|_| ()).unwrap();
    assert_eq!(alone.tethers, []);
}
