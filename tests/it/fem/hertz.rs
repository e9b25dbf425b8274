//! A sphere on a rigid plane: Hertz, "Ueber die Beruehrung fester elastischer Koerper", 1881; Johnson, "Contact Mechanics",
//! ch. 4.

use super::meshes::block;
use hgm::fem::{Prescribed, Scenario, simulate};
use hgm::mesh::TetMesh;

const SHEAR_PA: f64 = 1000.0;
const NU: f64 = 0.3;
const SPHERE_MM: f64 = 250.0;
/// Hertz's radius of the contact.
pub const CONTACT_MM: f64 = 5.0;
/// Elements over it, from coarse to fine.
pub const REFINEMENTS: [usize; 3] = [3, 6, 12];
/// The body reaches this many contact radii.
const REACH: f64 = 12.0;

/// Places along an axis: even over one and a half contact radii, then each cell a third longer.
fn places(cells: usize) -> Vec<f64> {
    let mut step = CONTACT_MM / cells as f64;
    let mut places: Vec<f64> = (0..=3 * cells / 2).map(|n| n as f64 * step).collect();
    while places[places.len() - 1] < REACH * CONTACT_MM {
        step *= 1.35;
        places.push(places[places.len() - 1] + step);
    }
    places
}

/// What a force into a half-space moves at a point of it, mm (Boussinesq; Johnson, ch. 3).
fn far_field(force_n: f64, x: [f64; 3]) -> [f64; 3] {
    let e = 2.0 * SHEAR_PA * 1e-6 * (1.0 + NU); // N/mm2
    let factor = force_n * (1.0 + NU) / (2.0 * std::f64::consts::PI * e);
    let r = x.iter().map(|v| v * v).sum::<f64>().sqrt();
    let along = factor * (x[2] * x[2] / r.powi(3) + 2.0 * (1.0 - NU) / r);
    let out = factor * (x[2] / r.powi(3) - (1.0 - 2.0 * NU) / (r * (r + x[2])));
    [out * x[0], out * x[1], along]
}

/// What the wall carries of the sphere.
pub struct Pressed {
    /// Its force, N.
    pub force_n: f64,
    /// Radius of the pressed area, mm.
    pub radius_mm: f64,
    /// Edge of an element there, mm.
    pub edge_mm: f64,
}

/// A quarter of the sphere, `cells` elements over the contact radius; and Hertz's force, N.
pub fn pressed(cells: usize) -> (Pressed, f64) {
    let approach = CONTACT_MM * CONTACT_MM / SPHERE_MM;
    let modulus = 2.0 * SHEAR_PA * 1e-6 * (1.0 + NU) / (1.0 - NU * NU);
    let force = 4.0 / 3.0 * modulus * SPHERE_MM.sqrt() * approach.powf(1.5);
    let at = places(cells);
    let (n, size) = (at.len() - 1, at[at.len() - 1]);
    let index = |v: f64| (v * n as f64).round() as usize;
    let mut mesh: TetMesh = block([n; 3], |x| {
        let [x, y, z] = x.map(|v| at[index(v)]);
        let cap = SPHERE_MM - (SPHERE_MM * SPHERE_MM - x * x - y * y).sqrt();
        [x, y, z + cap * (1.0 - z / size)]
    });
    let count = mesh.nodes_mm().len() as u32;
    let place = |k: u32| {
        let (i, j) = (k as usize % (n + 1), k as usize / (n + 1) % (n + 1));
        [i, j, k as usize / (n + 1).pow(2)]
    };
    let of = |want: &dyn Fn([usize; 3]) -> bool| (0..count).filter(|&k| want(place(k))).collect::<Vec<u32>>();
    mesh.set_nodes("bottom", of(&|p| p[2] == 0)).unwrap();
    let mut scenario = Scenario::from_toml(&format!(
        "[materials.grey_matter]\nlaw = 'neo-hookean'\nshear_modulus_pa = {SHEAR_PA}\npoisson_ratio = {NU}\n\
         [[contact]]\nset = 'bottom'\nwall = {{ shape = 'plane', point_mm = [0, 0, 0], normal = [0, 0, 1] }}\n\
         stiffness_pa_per_mm = 7e4\nsoftness_mm = 5e-4\n"
    ))
    .unwrap();
    for (axis, name) in ["across x", "across y"].into_iter().enumerate() {
        mesh.set_nodes(name, of(&|p| p[axis] == 0)).unwrap();
        let components = [0, 1, 2].map(|i| i == axis);
        scenario.prescribed.push(Prescribed { set: name.into(), displacement_mm: [0.0; 3], components });
    }
    for k in of(&|p| p.contains(&n)) {
        let far = far_field(force, mesh.nodes_mm()[k as usize]);
        mesh.set_nodes(&format!("far {k}"), vec![k]).unwrap();
        let displacement_mm = [far[0], far[1], far[2] - approach];
        scenario.prescribed.push(Prescribed { set: format!("far {k}"), displacement_mm, components: [true; 3] });
    }
    let outcome = simulate(&mesh, &scenario, &|_| ()).unwrap();
    let wall = &outcome.contact[0];
    let pressed = Pressed {
        force_n: 4.0 * wall.force_n[2],
        radius_mm: (4.0 * wall.area_mm2 / std::f64::consts::PI).sqrt(),
        edge_mm: CONTACT_MM / cells as f64,
    };
    (pressed, force)
}

#[test]
fn slow_a_sphere_on_a_plane_carries_what_hertz_says() {
    let mut errors = Vec::new();
    for cells in REFINEMENTS {
        let (found, force) = pressed(cells);
        let error = found.force_n / force - 1.0;
        println!(
            "{cells} elements over the radius: force {:+.2} % of {force:.3e} N, radius {:.3} of {CONTACT_MM} mm",
            100.0 * error,
            found.radius_mm
        );
        assert!((found.radius_mm - CONTACT_MM).abs() < found.edge_mm, "{} within {}", found.radius_mm, found.edge_mm);
        errors.push(error.abs());
    }
    assert!(errors[0] > errors[1] && errors[1] > errors[2], "{errors:?}");
    assert!(errors[2] < 0.02, "{errors:?}");
}
