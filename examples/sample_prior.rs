//! What the literature says of the stiffness of white matter: the generative model at nine levels.
//!
//! ```sh
//! cargo run --release --example sample_prior
//! ```

use hgm::material::Task;
use hgm::material::generative::{SampleSettings, nine_levels, sample_shear_moduli};
use std::error::Error;

/// Shear moduli in Pa, from two standard deviations below the mean to two above.
///
/// # Errors
/// A law that cannot be fitted to a drawn curve.
pub fn run() -> Result<Vec<f64>, Box<dyn Error>> {
    let samples = sample_shear_moduli(Task::HYPERELASTIC_WHITE, &nine_levels(), &SampleSettings::default())?;
    for sample in &samples {
        println!("{:+.1} sd: {:.0} Pa", sample.sd_level, sample.shear_modulus_pa);
    }
    Ok(samples.iter().map(|sample| sample.shear_modulus_pa).collect())
}

#[allow(dead_code, reason = "the tests call `run`")]
fn main() -> Result<(), Box<dyn Error>> {
    run().map(|_| ())
}
