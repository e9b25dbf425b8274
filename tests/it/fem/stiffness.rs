//! Forces and stiffness of whole bodies.

use super::meshes::two_tissue_cube;
use hgm::fem::{Model, Scenario};

const LAWS: &str = "
    fixed = ['z0']
    prescribed = [{ set = 'z1', displacement_mm = [0.0, 0.0, 1.0], components = [false, false, true] }]
    [materials.grey_matter]
    law = 'neo-hookean'
    shear_modulus_pa = 1370.0
    poisson_ratio = 0.45
    [materials.white_matter]
    law = 'ogden'
    terms = [{ mu_pa = -500.0, alpha = -4.0 }]
    poisson_ratio = 0.49
    [solver]
";

/// A field of a few per cent of strain, zero on held components.
fn field(nodes_mm: &[[f64; 3]], phase: f64) -> Vec<[f64; 3]> {
    let wave = |x: [f64; 3], i: usize| (0.13 * x[i] + 0.09 * x[(i + 1) % 3] + phase + i as f64).sin();
    let all: Vec<[f64; 3]> = nodes_mm.iter().map(|&x| [0, 1, 2].map(|i| 0.4 * wave(x, i))).collect();
    let top = nodes_mm.iter().map(|x| x[2]).fold(0.0, f64::max);
    let free = |x: &[f64; 3], i: usize| x[2] > 0.0 && !(i == 2 && x[2] >= top - 1e-9);
    all.iter().zip(nodes_mm).map(|(u, x)| [0, 1, 2].map(|i| if free(x, i) { u[i] } else { 0.0 })).collect()
}

fn plus(a: &[[f64; 3]], factor: f64, b: &[[f64; 3]]) -> Vec<[f64; 3]> {
    a.iter().zip(b).map(|(a, b)| [0, 1, 2].map(|i| a[i] + factor * b[i])).collect()
}

fn dot(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a * b).sum()
}

#[test]
fn stiffness_is_the_slope_of_the_forces_and_symmetric() {
    let mesh = two_tissue_cube(4, 40.0);
    for element in ["tet4", "tet4-nodal", "tet10"] {
        let scenario = Scenario::from_toml(&format!("{LAWS}element = '{element}'\n")).unwrap();
        let model = Model::new(&mesh, &scenario).unwrap();
        let at = |u: &[[f64; 3]]| model.stiffness(&scenario.materials, &model.state(u).unwrap()).unwrap();
        let [here, along, across] = [0.3, 1.7, 4.1].map(|phase| field(mesh.nodes_mm(), phase));
        let (change, step) = (at(&here).times(&along).unwrap(), 1e-4);
        let forces = |factor: f64| at(&plus(&here, factor * step, &along)).internal_force_n();
        let slope: Vec<[f64; 3]> = forces(1.0)
            .iter()
            .zip(forces(-1.0))
            .map(|(a, b)| [0, 1, 2].map(|i| (a[i] - b[i]) / (2.0 * step)))
            .collect();
        let off = plus(&change, -1.0, &slope);
        assert!(dot(&off, &off).sqrt() < 1e-6 * dot(&change, &change).sqrt(), "{element}");
        let crossed = dot(&across, &change);
        let other = dot(&along, &at(&here).times(&across).unwrap());
        assert!((crossed - other).abs() < 1e-10 * crossed.abs().max(other.abs()), "{element}: {crossed} {other}");
    }
}

#[test]
fn at_equilibrium_the_internal_forces_are_the_weight() {
    let mesh = two_tissue_cube(4, 40.0);
    let text =
        LAWS.replace("[solver]", "[loads]\ngravity_m_per_s2 = [0.0, 0.0, -9.81]\n[solver]\nrelative_residual = 1e-10");
    let kept: Vec<&str> = text.lines().filter(|l| !l.contains("prescribed")).collect();
    let text = kept.join("\n");
    let scenario = Scenario::from_toml(&text).unwrap();
    let model = Model::new(&mesh, &scenario).unwrap();
    let (outcome, state) = model.solve(&scenario.materials, None, &|_| ()).unwrap();
    let stiffness = model.stiffness(&scenario.materials, &state).unwrap();
    let forces = stiffness.internal_force_n();
    // The free nodes bear their own weight, the held ones theirs: together with the reactions all of it.
    let weight = -9.81 * 1000.0 * 0.04_f64.powi(3);
    let carried: f64 = outcome.reaction_n.iter().map(|r| r[2]).sum();
    assert!((carried + weight).abs() < 1e-8 * weight.abs());
    let held: Vec<usize> = (0..forces.len()).filter(|&n| mesh.nodes_mm()[n][2] == 0.0).collect();
    assert!(held.iter().all(|&n| forces[n] == [0.0; 3]));
    let own_weight = |n: usize| -> f64 {
        let around = mesh.tets().iter().enumerate().filter(|(_, tet)| tet.contains(&(n as u32)));
        around.map(|(t, _)| -9.81 * 1000.0 * 1e-9 * mesh.volume_mm3(t) / 4.0).sum()
    };
    for n in (0..forces.len()).filter(|n| !held.contains(n)) {
        assert!((forces[n][2] - own_weight(n)).abs() < 1e-8 * weight.abs(), "node {n}");
    }
}
