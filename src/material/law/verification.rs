//! Stresses tabulated by hand and by other codes: mu = 1000 Pa, nu = .45; Mooney-Rivlin C1 = 300, C2 = 200 Pa; Ogden
//! alpha = -4, mu1 = -500 Pa.

use super::{
    Estimated, Hyperelastic, LAWS, Material, MooneyRivlin, NeoHookean, Ogden, OgdenTerm, Shape,
    check_hyperelastic_within,
};
use nalgebra::{Matrix3, Vector3};

fn laws() -> [(&'static str, Box<dyn Hyperelastic>); 3] {
    let ogden = Ogden::new(vec![OgdenTerm { alpha: -4.0, mu_pa: -500.0 }], 0.45);
    [
        ("neo-Hookean", Box::new(NeoHookean::new(1000.0, 0.45))),
        ("Mooney-Rivlin", Box::new(MooneyRivlin::new(300.0, 200.0, 0.45))),
        ("Ogden", Box::new(ogden)),
    ]
}

fn diagonal(a: f64, b: f64, c: f64) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(a - 1.0, b - 1.0, c - 1.0))
}

fn is(found: f64, listed: f64) {
    assert!((found - listed).abs() <= 1e-9 * listed.abs().max(100.0), "{found} against {listed}");
}

#[test]
fn stresses_are_those_tabulated() {
    let stretched = [
        (1734.078342621326, 1640.894011145592),
        (1880.745009287993, 1816.894011145592),
        (1583.139556613096, 1640.894011145592),
    ];
    let squeezed = [-3371.9265808459, -3593.171025290344, -3452.014304600747];
    for (n, (_, law)) in laws().iter().enumerate() {
        let p = law.first_piola_kirchhoff_pa(&diagonal(1.2, 1.0, 1.0));
        is(p[(0, 0)], stretched[n].0);
        is(p[(1, 1)], stretched[n].1);
        is(law.first_piola_kirchhoff_pa(&diagonal(0.9, 0.9, 0.9))[(2, 2)], squeezed[n]);
    }
    let mut shear = Matrix3::zeros();
    shear[(0, 1)] = 0.5;
    let listed = [
        [[0.0, 500.0, 0.0], [500.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
        [[0.0, 500.0, 0.0], [500.0, 0.0, 0.0], [0.0, 0.0, 100.0]],
        [[-406.25, 562.5, 0.0], [765.625, -406.25, 0.0], [0.0, 0.0, 0.0]],
    ];
    for ((name, law), listed) in laws().iter().zip(listed) {
        let p = law.first_piola_kirchhoff_pa(&shear);
        for r in 0..3 {
            for c in 0..3 {
                assert!((p[(r, c)] - listed[r][c]).abs() < 1e-9 * 500.0, "{name} ({r}, {c}): {p}");
            }
        }
    }
}

#[test]
fn bars_with_free_sides_stretch_as_tabulated() {
    let listed = [
        (0.7, [(1.1708525469, -1258.42240949), (1.1672148782, -1426.92717052), (1.1793001881, -2605.65500738)]),
        (0.9, [(1.0483132490, -321.06740889), (1.0483340209, -333.83252695), (1.0490050572, -387.96098451)]),
        (1.1, [(0.9578444644, 265.93998365), (0.9572266285, 258.07410162), (0.9583839169, 228.32899688)]),
        (1.3, [(0.8874685818, 694.15347415), (0.8847033775, 637.25957505), (0.8913980891, 474.50735598)]),
    ];
    for (stretch, of_laws) in listed {
        for ((name, law), (lateral, stress)) in laws().iter().zip(of_laws) {
            // The side's stress grows with the lateral stretch: bisection.
            let (mut low, mut high) = (0.5_f64, 1.5_f64);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                let side = law.first_piola_kirchhoff_pa(&diagonal(stretch, middle, middle))[(1, 1)];
                if side < 0.0 { low = middle } else { high = middle }
            }
            assert!((low - lateral).abs() < 1e-9, "{name} at {stretch}: {low} against {lateral}");
            let found = law.first_piola_kirchhoff_pa(&diagonal(stretch, low, low))[(0, 0)];
            assert!((found - stress).abs() < 1e-8 * stress.abs().max(1000.0), "{name}: {found} against {stress}");
        }
    }
}

#[test]
fn every_law_of_the_list_obeys_the_laws_of_hyperelasticity() {
    for law in LAWS {
        assert!(!law.examples().is_empty(), "{law:?} has no numbers to be tested with");
        for values in law.examples() {
            let material = Material::new(law, values, 0.45);
            assert_eq!(material.check(), Ok(()), "{material:?}");
            // Half of what a law was measured at, the battery's own stretches being up to 1.2.
            let size = material.measured().map_or(1.0, |([low, high], _)| (1.0 - low).max(high - 1.0) / 0.4);
            check_hyperelastic_within(&material.law(), size.min(1.0));
        }
    }
}

/// Numbers on either side of the middle of every scale; an exponent must not be 0.
const NUMBERS: [f64; 3] = [-3.0, 0.4, 1.7];

fn shapes() -> impl Iterator<Item = &'static Shape> {
    LAWS.into_iter().filter_map(|law| match law.estimated() {
        Estimated::Shaped(shape) => Some(shape),
        Estimated::Modulus | Estimated::Not => None,
    })
}

#[test]
fn modulus_and_shape_come_back_from_the_parameters_they_give() {
    for shape in shapes() {
        for number in NUMBERS {
            let material = Material::new(shape.law, (shape.values)(670.0, number), 0.45);
            assert_eq!(material.check(), Ok(()), "{shape:?}");
            assert!((material.shear_modulus_pa() / 670.0 - 1.0).abs() < 1e-12, "{shape:?} at {number}");
            assert!(((shape.number)(&material.values) - number).abs() < 1e-9, "{shape:?} at {number}");
        }
    }
}

#[test]
fn slopes_are_those_of_the_stress_by_the_shape() {
    let h = Matrix3::new(0.02, -0.01, 0.03, 0.01, -0.02, 0.01, -0.02, 0.01, 0.03);
    let step = 1e-5;
    for shape in shapes() {
        for number in NUMBERS {
            let at = |number: f64| Material::new(shape.law, (shape.values)(670.0, number), 0.45);
            let stress = |material: &Material| material.law().first_piola_kirchhoff_pa(&h);
            let whole = (stress(&at(number + step)) - stress(&at(number - step))) / (2.0 * step);
            // lambda hangs on the modulus, which stays as it is: parameters are moved together.
            let mut moved = [at(number), at(number)];
            for (name, slope) in (shape.slopes)(number) {
                let parameter = moved[0].parameter(name, 0).unwrap_or_else(|| panic!("{shape:?}: {name}"));
                for (material, way) in moved.iter_mut().zip([1.0, -1.0]) {
                    *material = material.scaled(parameter, (way * step * slope).exp()).unwrap();
                }
            }
            let by_parts = (stress(&moved[0]) - stress(&moved[1])) / (2.0 * step);
            let off = (whole - by_parts).abs().max();
            assert!(off < 1e-4 * whole.abs().max().max(1e-3), "{shape:?} at {number}: {off}");
        }
    }
}

#[test]
fn every_law_that_is_fitted_can_be_estimated() {
    let fitted = LAWS.into_iter().filter(|law| !law.curves().is_empty());
    assert!(fitted.clone().count() > 3);
    fitted.for_each(|law| assert_ne!(law.estimated(), Estimated::Not, "{law:?}"));
}
