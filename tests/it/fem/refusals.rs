//! Bad input is refused by name.

use super::meshes::{cube, two_tissue_cube};
use hgm::fem::{FemError, Scenario, simulate};
use hgm::mesh::TetMesh;

const GREY: &str = "[materials.grey_matter]\nlaw = 'neo-hookean'\nshear_modulus_pa = 1000.0\npoisson_ratio = 0.45\n";

fn refusal(mesh: &TetMesh, text: &str) -> (FemError, String) {
    let scenario = Scenario::from_toml(text).unwrap();
    let error = simulate(mesh, &scenario, &|_| ()).unwrap_err();
    let message = error.to_string();
    (error, message)
}

#[test]
fn unknown_sets_are_refused_with_those_that_exist() {
    let mesh = cube(2, 10.0);
    let (error, message) = refusal(&mesh, &format!("fixed = ['base']\n{GREY}"));
    assert!(matches!(error, FemError::UnknownSet { .. }));
    assert!(message.contains("`base`") && message.contains("x0, x1, y0"), "{message}");
    let patch = format!("fixed = ['z0']\n{GREY}[[loads.patch]]\nset = 'superior'\nforce_n = [0, 0, -1]");
    assert!(refusal(&mesh, &patch).1.contains("`superior`"));
}

#[test]
fn a_body_that_nothing_holds_is_refused() {
    assert!(matches!(refusal(&cube(1, 10.0), GREY).0, FemError::NothingHeld));
    let two = TetMesh::new(
        vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [5.0, 0.0, 0.0],
            [6.0, 0.0, 0.0],
            [5.0, 1.0, 0.0],
            [5.0, 0.0, 1.0],
        ],
        vec![[0, 1, 2, 3], [4, 5, 6, 7]],
        vec![2, 2],
    );
    let mut two = two.unwrap();
    two.set_nodes("one", vec![0, 1, 2]).unwrap();
    let (error, _) = refusal(&two, &format!("fixed = ['one']\n{GREY}"));
    assert!(matches!(error, FemError::Loose { nodes: 4, node: 4 }), "{error}");
}

#[test]
fn labels_without_name_or_material_are_refused() {
    let mesh = two_tissue_cube(2, 10.0);
    let (error, message) = refusal(&mesh, &format!("fixed = ['z0']\n{GREY}"));
    assert!(matches!(error, FemError::NoMaterial { .. }));
    assert!(message.contains("[materials.white_matter]"), "{message}");
    let (error, message) = refusal(&mesh, &format!("fixed = ['z0']\n{GREY}[labels]\nwhite_matter = 7\n"));
    assert!(matches!(error, FemError::UnnamedLabel { label: 3, .. }), "{message}");
    let strange = GREY.replace("grey_matter", "gray");
    assert!(matches!(refusal(&mesh, &format!("fixed = ['z0']\n{strange}")).0, FemError::UnknownLabel { .. }));
}

#[test]
fn bad_numbers_are_refused_by_key() {
    let mesh = cube(1, 10.0);
    for (from, to, key) in [
        ("1000.0", "-5.0", "shear_modulus_pa"),
        ("0.45", "0.5", "poisson_ratio"),
        ("1000.0", "nan", "shear_modulus_pa"),
    ] {
        let (error, message) = refusal(&mesh, &format!("fixed = ['z0']\n{}", GREY.replace(from, to)));
        assert!(matches!(error, FemError::Material { .. }));
        assert!(message.contains(key) && message.contains("grey_matter"), "{message}");
    }
    let density = format!("fixed = ['z0']\n{GREY}[loads]\ndensity_kg_per_m3 = -1.0");
    assert!(refusal(&mesh, &density).1.contains("density_kg_per_m3"));
}
