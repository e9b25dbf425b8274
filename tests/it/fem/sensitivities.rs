//! Derivatives against differences of solutions.

use super::meshes::two_tissue_cube;
use hgm::fem::{By, Load, Model, Scenario};
use hgm::material::law::Parameter;
use hgm::mesh::TetMesh;

const SCENARIO: &str = "
    fixed = ['z0']
    [materials.grey_matter]
    law = 'neo-hookean'
    shear_modulus_pa = 1370.0
    poisson_ratio = 0.45
    [materials.white_matter]
    law = 'ogden'
    terms = [{ alpha = -4.0, mu_pa = -400.0 }, { alpha = 2.0, mu_pa = 200.0 }]
    poisson_ratio = 0.4
    [loads]
    gravity_m_per_s2 = [3.0, -4.0, -8.0]
    [[loads.patch]]
    set = 'z1'
    force_n = [0.0, 1.0, -1.0]
    [[loads.pressure]]
    set = 'x1'
    pressure_pa = 50.0
    [solver]
    relative_residual = 1e-12
";

const MOVED: &str = "
    [[prescribed]]
    set = 'x0'
    displacement_mm = [2.0, 0.0, -1.0]
    components = [true, false, true]
";

fn all() -> Vec<By> {
    let grey = |parameter| By::Material { name: "grey_matter".into(), parameter };
    let white = |parameter| By::Material { name: "white_matter".into(), parameter };
    vec![
        grey(Parameter::Stiffness),
        grey(Parameter::PoissonRatio),
        white(Parameter::Stiffness),
        white(Parameter::Own(1)),
        white(Parameter::Own(0)),
        By::Load(Load::Weight),
        By::Load(Load::Patch(0)),
        By::Load(Load::Pressure(0)),
        By::Gravity(0),
        By::Gravity(2),
        By::AllLoads,
        By::LameRatio,
    ]
}

/// The scenario with one parameter multiplied by a factor; to gravity, levels and gaps the factor's logarithm is added.
fn changed(scenario: &Scenario, by: &By, factor: f64) -> Scenario {
    let mut s = scenario.clone();
    match by {
        By::Material { name, parameter } => {
            let material = s.materials[name].scaled(*parameter, factor).unwrap();
            s.materials.insert(name.clone(), material);
        }
        By::LameRatio => {
            for material in s.materials.values_mut() {
                let ratio = factor * material.lame_lambda_pa() / material.shear_modulus_pa();
                *material = material.clone().with_poisson_ratio(0.5 * ratio / (1.0 + ratio));
            }
        }
        By::Load(Load::Weight) => s.loads.gravity_m_per_s2 = s.loads.gravity_m_per_s2.map(|g| g * factor),
        By::Load(Load::Patch(n)) => s.loads.patch[*n].force_n = s.loads.patch[*n].force_n.map(|f| f * factor),
        By::Load(Load::Pressure(n)) => s.loads.pressure[*n].pressure_pa *= factor,
        By::Gravity(axis) => s.loads.gravity_m_per_s2[*axis] += factor.ln(),
        By::TissueDensity => s.loads.density_kg_per_m3 *= factor,
        By::CsfDensity => s.loads.csf.as_mut().unwrap().density_kg_per_m3 *= factor,
        By::CsfLevel => s.loads.csf.as_mut().unwrap().level_mm += factor.ln(),
        By::Gap(wall) => s.contact[*wall].gap_mm += factor.ln(),
        By::AllLoads => {
            for load in [Load::Weight, Load::Patch(0), Load::Pressure(0)] {
                s = changed(&s, &By::Load(load), factor);
            }
            for p in &mut s.prescribed {
                p.displacement_mm = p.displacement_mm.map(|u| u * factor);
            }
        }
    }
    s
}

fn agree_with_differences(text: &str) {
    agree_on(&two_tissue_cube(3, 60.0), text);
}

fn agree_on(mesh: &TetMesh, text: &str) {
    let scenario = Scenario::from_toml(text).unwrap();
    let model = Model::new(mesh, &scenario).unwrap();
    let (outcome, state) = model.solve(&scenario.materials, None, &|_| ()).unwrap();
    let columns = model.sensitivities(&scenario.materials, &state, &all()).unwrap();
    let step: f64 = 1e-3;
    let slope: Vec<[f64; 3]> = (0..columns[0].len()).map(|n| [0, 1, 2].map(|i| (7 * n + i) as f64 % 5.0)).collect();
    let adjoint = model.adjoint(&scenario.materials, &state, &slope, &all()).unwrap();
    for ((by, column), adjoint) in all().iter().zip(&columns).zip(adjoint) {
        let at = |factor: f64| {
            let scenario = changed(&scenario, by, factor);
            let model = Model::new(mesh, &scenario).unwrap();
            let start = model.state(&outcome.displacement_mm).unwrap();
            model.solve(&scenario.materials, Some(&start), &|_| ()).unwrap().0.displacement_mm
        };
        let [near_above, near_below] = [at(step.exp()), at((-step).exp())];
        let [far_above, far_below] = [at((2.0 * step).exp()), at((-2.0 * step).exp())];
        let scale = column.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
        assert!(scale > 1e-3, "{by:?}");
        for n in 0..column.len() {
            for i in 0..3 {
                let near = (near_above[n][i] - near_below[n][i]) / (2.0 * step);
                let far = (far_above[n][i] - far_below[n][i]) / (4.0 * step);
                let difference = (4.0 * near - far) / 3.0;
                assert!((difference - column[n][i]).abs() < 1e-6 * scale, "{by:?}: {difference} {}", column[n][i]);
            }
        }
        let sum: f64 = slope.iter().flatten().zip(column.iter().flatten()).map(|(a, b)| a * b).sum();
        assert!((sum - adjoint).abs() < 1e-7 * scale * slope.len() as f64, "{by:?}: {sum} {adjoint}");
    }
}

#[test]
fn sensitivities_are_the_slopes_of_solutions() {
    agree_with_differences(SCENARIO);
}

#[test]
fn sensitivities_with_moved_nodes_are_the_slopes_of_solutions() {
    agree_with_differences(&format!("fixed = ['z0']\n{MOVED}{}", SCENARIO.replacen("fixed = ['z0']", "", 1)));
}

#[test]
fn sensitivities_of_averaged_deformation_are_the_slopes_of_solutions() {
    agree_with_differences(&format!("{SCENARIO}element = 'tet4-nodal'\n"));
}

#[test]
fn sensitivities_of_mixed_cells_are_the_slopes_of_solutions() {
    let mut mesh = two_tissue_cube(3, 60.0);
    let white: Vec<f64> = (0..mesh.tets().len()).map(|t| (t % 5) as f64 / 4.0).collect();
    let grey = white.iter().map(|f| 1.0 - f).collect();
    mesh.set_fractions([(2, grey), (3, white)].into()).unwrap();
    for element in ["tet4", "tet4-nodal"] {
        agree_on(&mesh, &format!("{SCENARIO}element = '{element}'\n"));
    }
}

#[test]
fn doubling_moduli_and_loads_together_moves_nothing() {
    // The scaling identity as a sum of columns.
    let mesh = two_tissue_cube(4, 60.0);
    let scenario = Scenario::from_toml(SCENARIO).unwrap();
    let model = Model::new(&mesh, &scenario).unwrap();
    let (_, state) = model.solve(&scenario.materials, None, &|_| ()).unwrap();
    let columns = model.sensitivities(&scenario.materials, &state, &[all()[0].clone(), all()[2].clone(), By::AllLoads]);
    let columns = columns.unwrap();
    let scale = columns[2].iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
    for n in 0..columns[0].len() {
        for i in 0..3 {
            assert!((columns[0][n][i] + columns[1][n][i] + columns[2][n][i]).abs() < 1e-7 * scale);
        }
    }
}

#[test]
fn what_the_law_does_not_have_is_refused() {
    let mesh = two_tissue_cube(2, 60.0);
    let scenario = Scenario::from_toml(SCENARIO).unwrap();
    let model = Model::new(&mesh, &scenario).unwrap();
    let (_, state) = model.solve(&scenario.materials, None, &|_| ()).unwrap();
    for by in [
        By::Material { name: "grey_matter".into(), parameter: Parameter::Own(7) },
        By::Material { name: "skull".into(), parameter: Parameter::Stiffness },
        By::Load(Load::Patch(1)),
    ] {
        assert!(model.sensitivities(&scenario.materials, &state, &[by]).is_err());
    }
}

/// Tissue half out of its fluid, gravity askew.
#[test]
fn sensitivities_to_a_fluid_are_the_slopes_of_solutions() {
    let mesh = two_tissue_cube(3, 60.0);
    let csf = "csf = { density_kg_per_m3 = 900.0, level_mm = 21.0 }\n[[loads.patch]]";
    let scenario = Scenario::from_toml(&SCENARIO.replacen("[[loads.patch]]", csf, 1)).unwrap();
    let model = Model::new(&mesh, &scenario).unwrap();
    let (outcome, state) = model.solve(&scenario.materials, None, &|_| ()).unwrap();
    let by = [By::TissueDensity, By::CsfDensity, By::CsfLevel, By::Gravity(0), By::Gravity(2), By::Load(Load::Weight)];
    let columns = model.sensitivities(&scenario.materials, &state, &by).unwrap();
    for (by, column) in by.iter().zip(&columns) {
        let step: f64 = 1e-3;
        let at = |step: f64| {
            let s = changed(&scenario, by, step.exp());
            let model = Model::new(&mesh, &s).unwrap();
            let start = model.state(&outcome.displacement_mm).unwrap();
            model.solve(&s.materials, Some(&start), &|_| ()).unwrap().0.displacement_mm
        };
        let [above, below] = [at(step), at(-step)];
        let scale = column.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
        for (n, slope) in column.iter().enumerate() {
            for i in 0..3 {
                let difference = (above[n][i] - below[n][i]) / (2.0 * step);
                assert!((difference - slope[i]).abs() < 1e-5 * scale, "{by:?}: {difference} {}", slope[i]);
            }
        }
    }
}
