//! A manufactured solution: the load is computed from a chosen displacement, and the answer must come back.

use super::element::{Elements, Plain};
use super::{Model, Scenario};
use crate::material::law::{Hyperelastic, NeoHookean};
use crate::mesh::TetMesh;
use nalgebra::Matrix3;
use std::f64::consts::PI;

const AMPLITUDE: [f64; 3] = [0.1, -0.08, 0.06];

/// The unit cube (m) of n^3 cells, six tetrahedra each, all faces held.
pub(super) fn cube(n: usize) -> TetMesh {
    let m = n + 1;
    let number = |i: usize, j: usize, k: usize| (i + m * (j + m * k)) as u32;
    let at = |c: usize| 1e3 * c as f64 / n as f64;
    let nodes: Vec<[f64; 3]> = (0..m * m * m).map(|p| [at(p % m), at(p / m % m), at(p / (m * m))]).collect();
    let mut tets = Vec::new();
    for cell in 0..n * n * n {
        let (i, j, k) = (cell % n, cell / n % n, cell / (n * n));
        let lower = [number(i, j, k), number(i + 1, j, k), number(i + 1, j + 1, k), number(i, j + 1, k)];
        let c = [lower, lower.map(|p| p + (m * m) as u32)].concat();
        let split = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]];
        tets.extend(split.map(|t| t.map(|v| c[v])));
    }
    let outer: Vec<u32> = (0..nodes.len() as u32)
        .filter(|&p| nodes[p as usize].iter().any(|&x| !(1e-9..=1e3 - 1e-9).contains(&x)))
        .collect();
    let labels = vec![2; tets.len()];
    let mut mesh = TetMesh::new(nodes, tets, labels).unwrap();
    mesh.set_nodes("faces", outer).unwrap();
    mesh
}

/// u, H = du/dX and the second derivatives of sin sin sin.
fn exact(x: [f64; 3]) -> ([f64; 3], Matrix3<f64>, Matrix3<f64>) {
    let (s, c) = (x.map(|x| (PI * x).sin()), x.map(|x| (PI * x).cos()));
    let factor = |order: [usize; 3]| -> f64 { (0..3).map(|i| [s[i], PI * c[i], -PI * PI * s[i]][order[i]]).product() };
    let unit = |a: usize| -> [usize; 3] { std::array::from_fn(|i| usize::from(i == a)) };
    let second = Matrix3::from_fn(|a, b| factor(std::array::from_fn(|i| unit(a)[i] + unit(b)[i])));
    let h = Matrix3::from_fn(|r, a| AMPLITUDE[r] * factor(unit(a)));
    (AMPLITUDE.map(|v| v * factor([0; 3])), h, second)
}

/// -Div P, N/m3.
fn body_force(law: &NeoHookean, x: [f64; 3]) -> [f64; 3] {
    let (_, h, second) = exact(x);
    let tangent = law.tangent_pa(&h);
    std::array::from_fn(|i| {
        let mut sum = 0.0;
        for j in 0..3 {
            for k in 0..3 {
                for l in 0..3 {
                    sum -= tangent[(i + 3 * j, k + 3 * l)] * AMPLITUDE[k] * second[(l, j)];
                }
            }
        }
        sum
    })
}

/// Barycentric coordinates and weights of the rule with four points.
fn rule() -> [([f64; 4], f64); 4] {
    let (near, far) = (0.585_410_196_624_968_5, 0.138_196_601_125_010_5);
    std::array::from_fn(|q| (std::array::from_fn(|c| if c == q { near } else { far }), 0.25))
}

/// The elements of a model of linear tetrahedra.
fn linear_elements(model: &Model) -> &Elements<4, 1> {
    &model.body.as_any().downcast_ref::<Plain<4, 1>>().expect("linear tetrahedra were asked for").elements
}

/// Relative errors of u in L2 and of H in L2.
fn errors(n: usize) -> [f64; 2] {
    let text = "fixed = ['faces']\n[materials.grey_matter]\nlaw = 'neo-hookean'\nshear_modulus_pa = 1000.0\n\
                poisson_ratio = 0.3\n[solver]\nrelative_residual = 1e-11\n";
    let scenario = Scenario::from_toml(text).unwrap();
    let mesh = cube(n);
    let mut model = Model::new(&mesh, &scenario).unwrap();
    let law = NeoHookean::new(1000.0, 0.3);
    let elements = linear_elements(&model);
    let position = |nodes: &[u32; 4], l: &[f64; 4]| -> [f64; 3] {
        std::array::from_fn(|i| (0..4).map(|c| l[c] * model.nodes_m[nodes[c] as usize][i]).sum())
    };
    let mut load = vec![[0.0; 3]; model.nodes_m.len()];
    for (nodes, point) in elements.nodes.iter().zip(&elements.points) {
        for (l, weight) in rule() {
            let force = body_force(&law, position(nodes, &l));
            for c in 0..4 {
                (0..3).for_each(|i| load[nodes[c] as usize][i] += point[0].weight_m3 * weight * l[c] * force[i]);
            }
        }
    }
    model.load_n = load;
    let (_, state) = model.solve(&scenario.materials, None, &|_| ()).unwrap();
    let elements = linear_elements(&model);
    let position = |nodes: &[u32; 4], l: &[f64; 4]| -> [f64; 3] {
        std::array::from_fn(|i| (0..4).map(|c| l[c] * model.nodes_m[nodes[c] as usize][i]).sum())
    };
    let mut sums = [0.0; 4];
    for (nodes, point) in elements.nodes.iter().zip(&elements.points) {
        let mut h = Matrix3::zeros();
        for (c, g) in point[0].gradients.iter().enumerate() {
            let u = state.u[nodes[c] as usize];
            h += Matrix3::from_fn(|r, k| u[r] * g[k]);
        }
        for (l, weight) in rule() {
            let (u, exact_h, _) = exact(position(nodes, &l));
            let w = weight * point[0].weight_m3;
            let found = |i: usize| (0..4).map(|c| l[c] * state.u[nodes[c] as usize][i]).sum::<f64>();
            sums[0] += w * (0..3).map(|i| (found(i) - u[i]).powi(2)).sum::<f64>();
            sums[1] += w * u.iter().map(|v| v * v).sum::<f64>();
            sums[2] += w * (h - exact_h).norm_squared();
            sums[3] += w * exact_h.norm_squared();
        }
    }
    [sums[0].sqrt(), sums[2].sqrt()]
}

#[test]
fn errors_fall_as_h_squared_and_h() {
    // Errors found by an independent code at n = 4, 8, 16.
    let listed = [[1.3082e-2, 0.13005], [4.0558e-3, 0.06818], [1.1032e-3, 0.03441]];
    let found = [4, 8, 16].map(errors);
    for (found, listed) in found.iter().zip(listed) {
        for (f, l) in found.iter().zip(listed) {
            assert!((f / l - 1.0).abs() < 5e-4, "{found:?} against {listed:?}");
        }
    }
    let rate = |i: usize| (found[1][i] / found[2][i]).log2();
    assert!(rate(0) >= 1.85 && rate(1) >= 0.98, "rates {} and {}", rate(0), rate(1));
}
