//! Curves of the literature as the study-level model takes them: sums over their points.

use super::basis::{Basis, SIZE};
use crate::material::form::first_uniaxial;
use crate::material::literature::{Curves, LiteratureModel};
use crate::material::task::Task;
use nalgebra::{SMatrix, SVector};

pub(super) type Coefficients = SVector<f64, SIZE>;
pub(super) type Square = SMatrix<f64, SIZE, SIZE>;

/// One curve: its points and the sums that a likelihood needs.
#[derive(Clone, Debug)]
pub struct StudyCurve {
    /// Number of the literature model.
    pub id: u32,
    /// Kind and region.
    pub task: Task,
    /// Hencky strains of its points, without those at rest.
    pub strains: Vec<f64>,
    /// ln of the effective shear modulus there, ln Pa.
    pub log_moduli: Vec<f64>,
    pub(super) squares: Square,
    pub(super) products: Coefficients,
    pub(super) sum_of_squares: f64,
}

impl StudyCurve {
    /// From points of a curve.
    pub fn new(id: u32, task: Task, strains: Vec<f64>, log_moduli: Vec<f64>) -> Self {
        let (mut squares, mut products, mut sum_of_squares) = (Square::zeros(), Coefficients::zeros(), 0.0);
        for (x, y) in strains.iter().zip(&log_moduli) {
            let row = Coefficients::from(Basis.at(*x));
            squares += row * row.transpose();
            products += row * *y;
            sum_of_squares += y * y;
        }
        Self { id, task, strains, log_moduli, squares, products, sum_of_squares }
    }
}

/// Curves by publication, in the order of the table.
#[derive(Clone, Debug)]
pub struct Studies {
    /// Name of each publication and its curves.
    pub publications: Vec<(String, Vec<StudyCurve>)>,
}

impl Studies {
    /// From literature models. Points at rest, where W is zero, say nothing and are left out; so is a point whose
    /// energy is not positive, which no modulus explains.
    pub fn from_literature(models: &[LiteratureModel], curves: Curves) -> Self {
        let mut publications: Vec<(String, Vec<StudyCurve>)> = Vec::new();
        for model in models {
            let curve = model.curve(curves);
            let points = curve.stretches.iter().zip(&curve.energies_pa);
            let seen = points.filter(|(l, w)| (*l - 1.0).abs() > 1e-9 && **w > 0.0);
            let (strains, log_moduli) = seen.map(|(l, w)| (l.ln(), log_modulus(*l, *w))).unzip();
            let study = StudyCurve::new(model.id, model.task, strains, log_moduli);
            match publications.iter_mut().find(|(name, _)| *name == model.citation) {
                Some((_, curves)) => curves.push(study),
                None => publications.push((model.citation.clone(), vec![study])),
            }
        }
        Self { publications }
    }

    /// Without one publication.
    #[must_use]
    pub fn without(&self, publication: usize) -> Self {
        let mut rest = self.clone();
        rest.publications.remove(publication);
        rest
    }

    /// Points of all curves.
    pub fn points(&self) -> usize {
        self.publications.iter().flat_map(|(_, curves)| curves).map(|curve| curve.strains.len()).sum()
    }
}

/// ln(2 W / (I1 - 3)), ln Pa, of a stretch away from 1.
pub fn log_modulus(stretch: f64, energy_pa: f64) -> f64 {
    (2.0 * energy_pa / first_uniaxial(stretch)).ln()
}
