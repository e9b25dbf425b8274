//! A law of your own, simulated: two terms of Yeoh's series (Rubber Chem. Technol. 66, 1993) with a compressible part.
//!
//! A law that others should have too goes into a file of `src/material/law/` and into its list; one that is tried out
//! needs neither.
//!
//! ```sh
//! cargo run --release --example add_a_law
//! ```

use hgm::fem::{Loads, Scenario, simulate};
use hgm::geometry::Native;
use hgm::image::{Grid, LabelMap};
use hgm::material::law::{
    Card, Estimated, Hyperelastic, Law, LawParameter, Material, Range, Role, Stability, Tangent, UniaxialCurve, Values,
    Volume, check_hyperelastic,
};
use hgm::mesh::engine::{EnginePrograms, MeshSettings, MeshSize, mesh_labels};
use hgm::segment::label;
use nalgebra::Matrix3;
use std::error::Error;

/// What files, fits and sensitivities need to know of the law.
struct Definition;

impl Law for Definition {
    fn card(&self) -> &'static Card {
        &Card {
            name: "yeoh",
            formula: "mu/2 (I1 - 3) + c (I1 - 3)^2 - mu ln J + lambda/2 ln^2 J",
            source: "Yeoh, Rubber Chem. Technol. 66, 1993",
            parameters: &[
                LawParameter {
                    name: "shear_modulus_pa",
                    meaning: "shear modulus mu at rest, Pa",
                    role: Role::Modulus,
                    range: Range::POSITIVE,
                    default: None,
                },
                LawParameter {
                    name: "stiffening_pa",
                    meaning: "c, Pa",
                    role: Role::Modulus,
                    range: Range { holds: |v| v >= 0.0, rule: "0 or more" },
                    default: Some(0.0),
                },
            ],
            of_terms: false,
            shear_modulus: "`shear_modulus_pa`",
            continued: false,
        }
    }

    fn shear_modulus_pa(&self, values: &[f64]) -> f64 {
        values[0]
    }

    fn solid(&self, values: &[f64], volume: Volume) -> Box<dyn Hyperelastic> {
        Box::new(Yeoh { mu: values[0], c: values[1], lambda: volume.lame_lambda_pa })
    }

    /// It is not fitted to curves here; see `src/material/law/gent.rs` for one that is.
    fn curves(&self) -> &'static [&'static dyn UniaxialCurve] {
        &[]
    }

    fn measured(&self, _values: &[f64]) -> Option<([f64; 2], Stability)> {
        None
    }

    fn estimated(&self) -> Estimated {
        Estimated::Not
    }

    fn examples(&self) -> Vec<Values> {
        vec![vec![1000.0, 400.0]]
    }
}

/// Psi of [`Definition`], Pa; infinite for J <= 0.
struct Yeoh {
    mu: f64,
    c: f64,
    lambda: f64,
}

/// I1 - 3 = 2 tr H + |H|^2, without forming F: small strains keep their digits.
fn first(h: &Matrix3<f64>) -> f64 {
    2.0 * h.trace() + h.norm_squared()
}

impl Hyperelastic for Yeoh {
    fn energy_density_pa(&self, h: &Matrix3<f64>) -> f64 {
        let j = (Matrix3::identity() + h).determinant();
        if j <= 0.0 {
            return f64::INFINITY;
        }
        let (x, ln_j) = (first(h), j.ln());
        0.5 * self.mu * x + self.c * x * x - self.mu * ln_j + 0.5 * self.lambda * ln_j * ln_j
    }

    fn first_piola_kirchhoff_pa(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        let f = Matrix3::identity() + h;
        let inverse = f.try_inverse().unwrap_or_else(Matrix3::zeros).transpose();
        f * (self.mu + 4.0 * self.c * first(h)) + inverse * (self.lambda * f.determinant().ln() - self.mu)
    }

    fn tangent_pa(&self, h: &Matrix3<f64>) -> Tangent {
        let f = Matrix3::identity() + h;
        let inverse = f.try_inverse().unwrap_or_else(Matrix3::zeros).transpose();
        let pressure = self.lambda * f.determinant().ln() - self.mu;
        // d(F^-T)_ab / dF_cd = -(F^-T)_ad (F^-T)_cb.
        Tangent::from_fn(|row, col| {
            let (a, b, c, d) = (row % 3, row / 3, col % 3, col / 3);
            let same = if row == col { self.mu + 4.0 * self.c * first(h) } else { 0.0 };
            same + 8.0 * self.c * f[(a, b)] * f[(c, d)] + self.lambda * inverse[(a, b)] * inverse[(c, d)]
                - pressure * inverse[(a, d)] * inverse[(c, b)]
        })
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        self.mu
    }
}

/// The largest displacement (mm) of a ball of 30 mm that lies on its lowest nodes: of the neo-Hookean law, of this law
/// without stiffening and of this law with it.
///
/// # Errors
/// A mesh or a scenario that the solver refuses.
pub fn run() -> Result<[f64; 3], Box<dyn Error>> {
    // The battery that every law of the house goes through; it panics with the law of nature that is broken.
    check_hyperelastic(Material::new(&Definition, vec![1000.0, 400.0], 0.45).law().as_ref());

    let grid = Grid::<Native>::axis_aligned([40, 40, 40], [2.0; 3], [-40.0; 3]);
    let inside = |n: usize| {
        let p = grid.voxel(n).map(|v| 2.0 * v as f64 - 40.0);
        p.iter().map(|x| x * x).sum::<f64>() < 900.0
    };
    let ball = LabelMap::from_data(grid, (0..grid.len()).map(|n| u8::from(inside(n)) * label::GREY_MATTER).collect());
    let settings = MeshSettings { size: MeshSize::Cells(2000), ..MeshSettings::default() };
    let (mut mesh, _) = mesh_labels(&ball, &settings, &EnginePrograms::default())?;
    let base = (0..).zip(mesh.nodes_mm()).filter(|(_, p)| p[2] < -25.0).map(|(n, _)| n).collect();
    mesh.set_nodes("base", base)?;

    let mut scenario = Scenario {
        fixed: vec!["base".to_owned()],
        loads: Loads { gravity_m_per_s2: [0.0, 0.0, -9.81], density_kg_per_m3: 300.0, ..Loads::default() },
        ..Scenario::default()
    };
    let mut largest = |material: Material| -> Result<f64, Box<dyn Error>> {
        scenario.materials.insert("grey_matter".to_owned(), material);
        let outcome = simulate(&mesh, &scenario, &|_| {})?;
        let size = |u: &[f64; 3]| u.iter().map(|x| x * x).sum::<f64>().sqrt();
        Ok(outcome.displacement_mm.iter().map(size).fold(0.0, f64::max))
    };
    let sunk = [
        largest(Material::neo_hookean(1000.0, 0.45))?,
        largest(Material::new(&Definition, vec![1000.0, 0.0], 0.45))?,
        largest(Material::new(&Definition, vec![1000.0, 2000.0], 0.45))?,
    ];
    println!("neo-Hookean {:.3} mm, Yeoh without stiffening {:.3} mm, with it {:.3} mm", sunk[0], sunk[1], sunk[2]);
    Ok(sunk)
}

#[allow(dead_code, reason = "the tests call `run`")]
fn main() -> Result<(), Box<dyn Error>> {
    run().map(|_| ())
}
