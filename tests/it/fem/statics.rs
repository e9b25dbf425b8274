//! Static equilibrium.

use super::meshes::{cube, two_tissue_cube};
use hgm::fem::{Model, Outcome, Scenario, simulate};
use hgm::mesh::TetMesh;

const TWO_TISSUES: &str = "
    fixed = ['z0']
    [materials.grey_matter]
    law = 'neo-hookean'
    shear_modulus_pa = 1370.0
    poisson_ratio = 0.45
    [materials.white_matter]
    law = 'neo-hookean'
    shear_modulus_pa = 990.0
    poisson_ratio = 0.45
    [loads]
    gravity_m_per_s2 = [3.0, -4.0, -8.0]
    [solver]
    relative_residual = 1e-12
";

fn solved(mesh: &TetMesh, text: &str) -> Outcome {
    simulate(mesh, &Scenario::from_toml(text).unwrap(), &|_| ()).unwrap()
}

fn largest_difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    // Large enough for the coarse correction and for work to be shared.
    let mesh = two_tissue_cube(12, 80.0);
    for solver in
        ["", "element = 'tet4-nodal'", "linear = 'direct'", "method = 'backward-euler'\n[dynamics]\nsteps = 3"]
    {
        let text = format!("{TWO_TISSUES}{solver}\n").replace("1e-12", "1e-9");
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| solved(&mesh, &text))
        };
        let one = with(1);
        assert_eq!(one, with(2), "{solver}");
        assert_eq!(one, with(3), "{solver}");
    }
}

#[test]
fn twice_the_load_on_twice_the_modulus_changes_nothing() {
    let mesh = two_tissue_cube(5, 80.0);
    let doubled = TWO_TISSUES
        .replace("1370.0", "2740.0")
        .replace("990.0", "1980.0")
        .replace("[3.0, -4.0, -8.0]", "[6.0, -8.0, -16.0]");
    let (a, b) = (solved(&mesh, TWO_TISSUES), solved(&mesh, &doubled));
    let scale = a.displacement_mm.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
    assert!(scale > 1.0);
    assert!(largest_difference(&a.displacement_mm, &b.displacement_mm) < 1e-10 * scale);
}

#[test]
fn reactions_carry_the_weight() {
    let mesh = two_tissue_cube(4, 80.0);
    let outcome = solved(&mesh, TWO_TISSUES);
    let mass = 1000.0 * 0.08_f64.powi(3);
    for (i, g) in [3.0, -4.0, -8.0].into_iter().enumerate() {
        let sum: f64 = outcome.reaction_n.iter().map(|r| r[i]).sum();
        assert!((sum + mass * g).abs() < 1e-9 * mass * 9.0, "{sum} against {}", -mass * g);
    }
}

#[test]
fn uniaxial_stretch_is_the_closed_form() {
    // mu = 1000 Pa, nu = .45, stretch 1.3: lateral stretch .8874685818, P11 = 694.15347415 Pa, in every element.
    let mesh = cube(3, 10.0);
    let outcome = solved(
        &mesh,
        "
        [[prescribed]]
        set = 'x0'
        displacement_mm = [0, 0, 0]
        components = [true, false, false]
        [[prescribed]]
        set = 'x1'
        displacement_mm = [3, 0, 0]
        components = [true, false, false]
        [[prescribed]]
        set = 'y0'
        displacement_mm = [0, 0, 0]
        components = [false, true, false]
        [[prescribed]]
        set = 'z0'
        displacement_mm = [0, 0, 0]
        components = [false, false, true]
        [materials.grey_matter]
        law = 'neo-hookean'
        shear_modulus_pa = 1000.0
        poisson_ratio = 0.45
        [solver]
        relative_residual = 1e-12
    ",
    );
    let lateral = 0.8874685818;
    for (x, u) in mesh.nodes_mm().iter().zip(&outcome.displacement_mm) {
        let exact = [0.3 * x[0], (lateral - 1.0) * x[1], (lateral - 1.0) * x[2]];
        for i in 0..3 {
            assert!((u[i] - exact[i]).abs() < 1e-8, "{u:?} at {x:?}");
        }
    }
    let pull: f64 = mesh.node_sets["x1"].iter().map(|&n| outcome.reaction_n[n as usize][0]).sum();
    assert!((pull / 1e-4 - 694.15347415).abs() < 1e-6, "{}", pull / 1e-4);
    assert!(outcome.jacobian.iter().all(|j| (j - 1.3 * lateral * lateral).abs() < 1e-8));
}

#[test]
fn a_warm_start_finds_the_same_equilibrium_in_fewer_iterations() {
    let mesh = two_tissue_cube(6, 80.0);
    let scenario = Scenario::from_toml(TWO_TISSUES).unwrap();
    let model = Model::new(&mesh, &scenario).unwrap();
    let mut softer = scenario.materials.clone();
    softer.insert("grey_matter".into(), hgm::material::law::Material::neo_hookean(1300.0, 0.45));
    let (_, state) = model.solve(&scenario.materials, None, &|_| ()).unwrap();
    let (cold, _) = model.solve(&softer, None, &|_| ()).unwrap();
    let (warm, _) = model.solve(&softer, Some(&state), &|_| ()).unwrap();
    assert!(largest_difference(&cold.displacement_mm, &warm.displacement_mm) < 1e-8);
    assert!(warm.convergence.linear_iterations() < cold.convergence.linear_iterations());
}

#[test]
fn pressure_on_all_faces_squeezes_evenly() {
    // Confined on three sides, p = 500 Pa on the others: F = s I with P = 2 terms of the law; found by bisection.
    let mesh = cube(2, 10.0);
    let held = ["x0", "y0", "z0"].iter().enumerate().map(|(axis, set)| {
        let components = [0, 1, 2].map(|i| i == axis);
        format!("[[prescribed]]\nset = '{set}'\ndisplacement_mm = [0, 0, 0]\ncomponents = {components:?}\n")
    });
    let pushed = ["x1", "y1", "z1"].map(|set| format!("[[loads.pressure]]\nset = '{set}'\npressure_pa = 500.0\n"));
    let law = "[materials.grey_matter]\nlaw = 'neo-hookean'\nshear_modulus_pa = 1000.0\npoisson_ratio = 0.45\n";
    let text = held.collect::<String>() + law + &pushed.concat() + "[solver]\nrelative_residual = 1e-12\n";
    let outcome = solved(&mesh, &text);
    let stress = |s: f64| 1000.0 * (s - 1.0 / s) + 9000.0 * 3.0 * s.ln() / s;
    let (mut low, mut high) = (0.8, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if stress(middle) < -500.0 { low = middle } else { high = middle }
    }
    assert!(outcome.jacobian.iter().all(|j| (j - low.powi(3)).abs() < 1e-9), "{:?} {low}", outcome.jacobian[0]);
}
