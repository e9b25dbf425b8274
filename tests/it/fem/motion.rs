//! Backward Euler against its own formulas.

use super::meshes::{cube, two_tissue_cube};
use hgm::fem::{Outcome, Scenario, simulate};
use hgm::mesh::TetMesh;

const GREY: &str = "[materials.grey_matter]\nlaw = 'neo-hookean'\nshear_modulus_pa = 1000.0\npoisson_ratio = 0.45\n";

fn moved(mesh: &TetMesh, text: &str) -> Outcome {
    simulate(mesh, &Scenario::from_toml(text).unwrap(), &|_| ()).unwrap()
}

#[test]
fn free_fall_is_exact() {
    // x_n = g h^2 n (n + 1) / 2 with nothing held and no damping, for both masses and all elements.
    let mesh = cube(2, 30.0);
    let (h, n) = (0.02, 5);
    for (mass, element) in [
        ("lumped", "tet4"),
        ("consistent", "tet4"),
        ("lumped", "tet4-nodal"),
        ("consistent", "tet10"),
        ("lumped", "tet10"),
    ] {
        let text = format!(
            "{GREY}[loads]\ngravity_m_per_s2 = [1.0, 2.0, -9.81]\n[solver]\nmethod = 'backward-euler'\n\
             element = '{element}'\nrelative_residual = 1e-12\n[dynamics]\ntime_step_s = {h}\nsteps = {n}\n\
             mass = '{mass}'\nmass_damping_per_s = 0.0\nstiffness_damping_s = 0.0\nnewton_iterations = 0\n"
        );
        let outcome = moved(&mesh, &text);
        let fallen = |g: f64| 1e3 * g * h * h * f64::from(n * (n + 1)) / 2.0;
        for u in &outcome.displacement_mm {
            for (u, g) in u.iter().zip([1.0, 2.0, -9.81]) {
                assert!((u - fallen(g)).abs() <= 1e-7, "{mass} {element}: {u} against {}", fallen(g));
            }
        }
    }
}

#[test]
fn a_linear_mode_follows_the_formula_of_each_step() {
    // One free degree of freedom: a cube of one cell between two plates, all else held; small motion.
    // v+ = (v - h w^2 (x - x_rest)) / (1 + h (a + b w^2) + h^2 w^2); w^2 from the static answer: g = w^2 x_rest.
    let mut mesh = cube(1, 10.0);
    mesh.set_nodes("all", (0..8).collect()).unwrap();
    let held =
        "fixed = ['z0']\n[[prescribed]]\nset = 'all'\ndisplacement_mm = [0, 0, 0]\ncomponents = [true, true, false]\n";
    // All four upper nodes move alike only if their masses and stiffnesses agree; a stiff upper layer is not needed
    // when a single node moves.
    mesh.set_nodes("others", (0..7).collect()).unwrap();
    let (g, h, a, b) = (1e-4, 0.03, 0.7, 0.02);
    let held = held.replace("['z0']", "['others']");
    let common = format!("{held}{GREY}[loads]\ngravity_m_per_s2 = [0, 0, {g}]\n");
    let rest = moved(&mesh, &format!("{common}[solver]\nrelative_residual = 1e-12\n")).displacement_mm[7][2];
    let w2 = 1e3 * g / rest;
    let (mut x, mut v) = (0.0, 0.0);
    for steps in 1..6 {
        v = (v - h * w2 * (x - rest)) / (1.0 + h * (a + b * w2) + h * h * w2);
        x += h * v;
        for iterations in [0, 1] {
            let outcome = moved(
                &mesh,
                &format!(
                    "{common}[solver]\nmethod = 'backward-euler'\nrelative_residual = 1e-12\n[dynamics]\n\
                     time_step_s = {h}\nsteps = {steps}\nmass_damping_per_s = {a}\nstiffness_damping_s = {b}\n\
                     newton_iterations = {iterations}\nrest_speed_mm_per_s = 0.0\n"
                ),
            );
            let found = outcome.displacement_mm[7][2];
            assert!((found - x).abs() < 1e-5 * x.abs(), "step {steps}: {found} against {x}");
        }
    }
}

#[test]
fn momentum_grows_by_the_force_times_time() {
    // A free body under a patch load: sum m v = F t whatever happens inside.
    let mesh = two_tissue_cube(3, 60.0);
    let (h, n) = (0.01, 6);
    let text = format!(
        "{GREY}{}[[loads.patch]]\nset = 'z1'\nforce_n = [0.1, -0.2, 0.3]\n[solver]\nmethod = 'backward-euler'\n\
         relative_residual = 1e-11\n[dynamics]\ntime_step_s = {h}\nsteps = {n}\nmass_damping_per_s = 0.0\n\
         stiffness_damping_s = 0.05\nnewton_iterations = 0\nkeep_every = 1\n",
        GREY.replace("grey", "white").replace("1000.0", "700.0")
    );
    let motion = moved(&mesh, &text).motion.unwrap();
    assert_eq!(motion.frames.len(), n);
    let mut mass = vec![0.0; mesh.nodes_mm().len()];
    for (t, tet) in mesh.tets().iter().enumerate() {
        for &n in tet {
            mass[n as usize] += 250.0 * mesh.volume_mm3(t) * 1e-9;
        }
    }
    let centre = |frame: usize, i: usize| -> f64 {
        let u = &motion.frames[frame].displacement_mm;
        u.iter().zip(&mass).map(|(u, m)| m * u[i] * 1e-3).sum()
    };
    for (i, force) in [0.1, -0.2, 0.3].into_iter().enumerate() {
        let momentum = (centre(n - 1, i) - centre(n - 2, i)) / h;
        assert!((momentum - force * n as f64 * h).abs() < 1e-8, "{momentum}");
    }
}

#[test]
fn a_damped_body_rests_at_the_static_solution() {
    let mesh = two_tissue_cube(3, 60.0);
    let text = format!(
        "fixed = ['z0']\n{GREY}{}[loads]\ngravity_m_per_s2 = [0, 0, -9.81]\n[solver]\nrelative_residual = 1e-10\n",
        GREY.replace("grey", "white").replace("1000.0", "700.0")
    );
    let rest = moved(&mesh, &text);
    for element in ["tet4", "tet4-nodal"] {
        let rest =
            if element == "tet4" { rest.clone() } else { moved(&mesh, &format!("{text}element = '{element}'\n")) };
        let outcome = moved(&mesh, &format!("{text}element = '{element}'\nmethod = 'backward-euler'\n"));
        let motion = outcome.motion.as_ref().unwrap();
        assert!(motion.rested, "{motion:?}");
        for (a, b) in outcome.displacement_mm.iter().flatten().zip(rest.displacement_mm.iter().flatten()) {
            assert!((a - b).abs() < 1e-3, "{a} against {b}");
        }
    }
}

/// Nothing that is only slow is at rest: much damping, or steps of no length.
#[test]
fn a_body_out_of_balance_is_not_at_rest_however_slow_it_is() {
    let mesh = two_tissue_cube(2, 60.0);
    let white = GREY.replace("grey", "white");
    for dynamics in ["stiffness_damping_s = 1e5\ntime_step_s = 10.0\nsteps = 3", "time_step_s = 1e-8\nsteps = 3"] {
        let text = format!(
            "fixed = ['z0']\n{GREY}{white}[loads]\ngravity_m_per_s2 = [0, 0, -9.81]\n[solver]\nmethod = 'backward-euler'\n\
             [dynamics]\n{dynamics}\n"
        );
        let outcome = moved(&mesh, &text);
        let motion = outcome.motion.as_ref().unwrap();
        assert!(!motion.rested && outcome.convergence.relative_residual > 0.1, "{dynamics}: {motion:?}");
        assert!(outcome.warnings.iter().any(|said| said.to_string().contains("still moves")), "{:?}", outcome.warnings);
    }
}

#[test]
fn a_face_that_is_moved_takes_the_body_along_however_many_iterations_are_asked_for() {
    let mesh = cube(2, 30.0);
    let text = |iterations: usize| {
        format!(
            "fixed = ['z0']\n[[prescribed]]\nset = 'z1'\ndisplacement_mm = [0, 0, 1]\n{GREY}[solver]\nmethod = 'backward-euler'\n\
             [dynamics]\nsteps = 200\nnewton_iterations = {iterations}\n"
        )
    };
    let [until, three] = [0, 3].map(|iterations| moved(&mesh, &text(iterations)));
    let inner = |found: &Outcome| -> Vec<f64> {
        let held = |n: &u32| ["z0", "z1"].iter().any(|set| mesh.node_sets[*set].contains(n));
        (0..mesh.nodes_mm().len() as u32).filter(|n| !held(n)).map(|n| found.displacement_mm[n as usize][2]).collect()
    };
    for (a, b) in inner(&until).iter().zip(inner(&three)) {
        assert!(b > 0.2 && (a - b).abs() < 1e-4, "{a} instead of {b}");
    }
}
