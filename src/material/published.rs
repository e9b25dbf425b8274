//! What the paper prints: A. Granados, F. Perez-Garcia, M. Schweiger, V. Vakharia, S. B. Vos, A. Miserocchi, A. W. McEvoy,
//! J. S. Duncan, R. Sparks, S. Ourselin, "A generative model of hyperelastic strain energy density functions for multiple
//! tissue brain deformation", IJCARS 16 (2021) 141-150. Typed in by hand, to be held against what is computed.

use super::task::{Region, StudyKind, Task};

/// A shear modulus of Table 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrintedModulus {
    /// The task that the sample is of.
    pub task: Task,
    /// Standard deviations from the mean; the printed table has lost the minus signs.
    pub sd_level: f64,
    /// As printed, Pa.
    pub shear_modulus_pa: f64,
}

/// The shear moduli of Table 1.
pub fn printed_moduli() -> Vec<PrintedModulus> {
    let linear = |region| Task { kind: StudyKind::Linear, region };
    let rows: [(Task, &[(f64, f64)]); 5] = [
        (
            Task::HYPERELASTIC_GREY,
            &[(-2.0, 525.0), (-1.5, 628.0), (-1.0, 754.0), (-0.5, 912.0), (0.5, 1317.0), (2.0, 2299.0)],
        ),
        (
            Task::HYPERELASTIC_WHITE,
            &[(-2.0, 309.0), (-1.5, 365.0), (-1.0, 440.0), (-0.5, 519.0), (0.0, 610.0), (2.0, 1195.0)],
        ),
        (Task::HYPERELASTIC_HEALTHY, &[(-0.5, 353.0)]),
        (linear(Region::Healthy), &[(-0.5, 465.0)]),
        (linear(Region::Grey), &[(0.0, 2746.0)]),
    ];
    let row = |(task, row): (Task, &[(f64, f64)])| {
        let one = |&(sd_level, shear_modulus_pa): &(f64, f64)| PrintedModulus { task, sd_level, shear_modulus_pa };
        row.iter().map(one).collect::<Vec<_>>()
    };
    rows.into_iter().flat_map(row).collect()
}

/// The statistic H of Kruskal and Wallis' test between three laws, per task.
pub fn printed_kruskal_wallis() -> [(Task, f64); 3] {
    [(Task::HYPERELASTIC_GREY, 14.59), (Task::HYPERELASTIC_WHITE, 20.98), (Task::HYPERELASTIC_HEALTHY, 15.17)]
}
