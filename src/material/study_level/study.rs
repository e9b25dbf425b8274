//! Curves of the literature as the study-level model takes them: an orthogonal reduction of their points.

use super::basis::{Basis, SIZE};
use crate::material::form::first_uniaxial;
use crate::material::literature::{Curves, LiteratureModel};
use crate::material::task::Task;
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

pub(super) type Coefficients = SVector<f64, SIZE>;
pub(super) type Square = SMatrix<f64, SIZE, SIZE>;

/// One curve: its points, and what a likelihood needs of them. With F the functions at its points and F = Q T, only T and
/// Q^T y matter, and what no function explains.
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
    /// T, upper triangular.
    pub(super) root: Square,
    /// Q^T y.
    pub(super) turned: Coefficients,
    /// |y - Q Q^T y|^2.
    pub(super) unexplained: f64,
}

impl StudyCurve {
    /// From points of a curve.
    pub fn new(id: u32, task: Task, strains: Vec<f64>, log_moduli: Vec<f64>) -> Self {
        // Rows of zeros change nothing, and make T square where there are few points.
        let rows = strains.len().max(SIZE);
        let mut functions = DMatrix::zeros(rows, SIZE);
        for (i, x) in strains.iter().enumerate() {
            functions.set_row(i, &Coefficients::from(Basis.at(*x)).transpose());
        }
        let factors = functions.qr();
        let values = DVector::from_fn(rows, |i, _| log_moduli.get(i).copied().unwrap_or(0.0));
        let (orthogonal, triangle) = factors.unpack();
        let turned = orthogonal.tr_mul(&values);
        let unexplained = (values - &orthogonal * &turned).norm_squared();
        let root = triangle.fixed_view::<SIZE, SIZE>(0, 0).into_owned();
        let turned = turned.fixed_rows::<SIZE>(0).into_owned();
        Self { id, task, strains, log_moduli, root, turned, unexplained }
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
    /// energy is not positive, which no modulus explains. Studies without a citation are a publication each: nothing says that one
    /// laboratory made them.
    pub fn from_literature(models: &[LiteratureModel], curves: Curves) -> Self {
        let mut publications: Vec<(String, Vec<StudyCurve>)> = Vec::new();
        for model in models {
            let curve = model.curve(curves);
            let points = curve.stretches.iter().zip(&curve.energies_pa);
            let seen = points.filter(|(l, w)| (*l - 1.0).abs() > 1e-9 && **w > 0.0);
            let (strains, log_moduli) = seen.map(|(l, w)| (l.ln(), log_modulus(*l, *w))).unzip();
            let study = StudyCurve::new(model.id, model.task, strains, log_moduli);
            let publication = match model.citation.trim() {
                "" => format!("own study {}", model.id),
                citation => citation.to_owned(),
            };
            match publications.iter_mut().find(|(name, _)| *name == publication) {
                Some((_, curves)) => curves.push(study),
                None => publications.push((publication, vec![study])),
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
