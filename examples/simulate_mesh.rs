//! A label map meshed and deformed under its own weight: no patient, no files.
//!
//! ```sh
//! cargo run --release --example simulate_mesh
//! ```

use hgm::fem::{Loads, Scenario, simulate};
use hgm::geometry::Native;
use hgm::image::{Grid, LabelMap};
use hgm::material::law::Material;
use hgm::mesh::engine::{EnginePrograms, MeshSettings, MeshSize, mesh_labels};
use hgm::segment::label;
use std::error::Error;

/// The largest displacement of a ball of grey matter of 30 mm that lies on its lowest nodes, mm.
///
/// # Errors
/// A mesh or a scenario that the solver refuses.
pub fn run() -> Result<f64, Box<dyn Error>> {
    let grid = Grid::<Native>::axis_aligned([40, 40, 40], [2.0; 3], [-40.0; 3]);
    let inside = |n: usize| grid.centre(grid.voxel(n)).mm.coords.norm() < 30.0;
    let ball = LabelMap::from_data(grid, (0..grid.len()).map(|n| u8::from(inside(n)) * label::GREY_MATTER).collect());

    let settings = MeshSettings { size: MeshSize::Cells(2000), ..MeshSettings::default() };
    let (mut mesh, _) = mesh_labels(&ball, &settings, &EnginePrograms::default())?;
    let below = |p: &[f64; 3]| p[2] < -25.0;
    let base = (0..).zip(mesh.nodes_mm()).filter(|(_, p)| below(p)).map(|(n, _)| n).collect();
    mesh.set_nodes("base", base)?;

    let mut scenario = Scenario {
        fixed: vec!["base".to_owned()],
        loads: Loads { gravity_m_per_s2: [0.0, 0.0, -9.81], density_kg_per_m3: 100.0, ..Loads::default() },
        ..Scenario::default()
    };
    scenario.materials.insert("grey_matter".to_owned(), Material::neo_hookean(1000.0, 0.45));
    let outcome = simulate(&mesh, &scenario, &|_| {})?;
    let size = |u: &[f64; 3]| u.iter().map(|x| x * x).sum::<f64>().sqrt();
    let largest = outcome.displacement_mm.iter().map(size).fold(0.0, f64::max);
    println!("{} tetrahedra, largest displacement {largest:.2} mm", mesh.tets().len());
    Ok(largest)
}

#[allow(dead_code, reason = "the tests call `run`")]
fn main() -> Result<(), Box<dyn Error>> {
    run().map(|_| ())
}
