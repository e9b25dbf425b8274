//! What moves the places besides the model's own parameters: patterns of a known spread whose amounts are estimated along with
//! the moduli (nuisance parameters), so that neither takes what is the other's.

use super::projection::Projection;
use super::rigid_remainder::RigidModes;
use super::{Forward, Linearisation, LogPrior};
use nalgebra::{DMatrix, DVector};

/// Patterns over the places, the rigid registration's remainder first.
#[derive(Clone, Debug)]
pub struct Nuisance {
    /// Displacement of every place, three components each, per unit of an amount.
    pub columns_mm: DMatrix<f64>,
    /// What is known of the amounts beforehand.
    pub priors: Vec<LogPrior>,
}

impl Nuisance {
    /// The rigid registration's remainder alone.
    pub fn rigid(rigid: &RigidModes) -> Self {
        Self { columns_mm: rigid.columns_mm.clone(), priors: rigid.priors().collect() }
    }

    /// With more patterns behind these.
    #[must_use]
    pub fn with(mut self, columns_mm: &DMatrix<f64>, priors: impl IntoIterator<Item = LogPrior>) -> Self {
        let before = self.columns_mm.ncols();
        self.columns_mm = DMatrix::from_fn(self.columns_mm.nrows(), before + columns_mm.ncols(), |r, c| {
            if c < before { self.columns_mm[(r, c)] } else { columns_mm[(r, c - before)] }
        });
        self.priors.extend(priors);
        self
    }

    /// How many they are.
    pub fn count(&self) -> usize {
        self.columns_mm.ncols()
    }

    /// A model's residuals and Jacobian with these added, in mm.
    pub fn added_to(&self, plain: &Linearisation, amounts: &[f64]) -> Linearisation {
        let own = plain.jacobian_mm.ncols();
        let residuals_mm = &plain.residuals_mm + &self.columns_mm * DVector::from_column_slice(amounts);
        let jacobian_mm = DMatrix::from_fn(plain.jacobian_mm.nrows(), own + self.count(), |r, c| {
            if c < own { plain.jacobian_mm[(r, c)] } else { self.columns_mm[(r, c - own)] }
        });
        Linearisation { residuals_mm, jacobian_mm }
    }
}

/// A model held against the part of what was seen that it could do itself, with the amounts of other patterns behind its own
/// parameters: residuals are independent and of standard deviation 1.
pub struct Weighted<'a, M> {
    /// The model.
    pub model: &'a mut M,
    /// The other patterns.
    pub nuisance: &'a Nuisance,
    /// What it could do.
    pub projection: &'a Projection,
    /// The model's own parameters and linearisations, in mm, in the order they were asked for.
    pub plain: Vec<(Vec<f64>, Linearisation)>,
}

/// The same, independent and of standard deviation 1.
fn whitened(linear: &Linearisation, projection: &Projection) -> Linearisation {
    let residuals = DMatrix::from_column_slice(linear.residuals_mm.len(), 1, linear.residuals_mm.as_slice());
    let residuals_mm = projection.whiten(&residuals).column(0).into_owned();
    Linearisation { residuals_mm, jacobian_mm: projection.whiten(&linear.jacobian_mm) }
}

impl<M: Forward> Forward for Weighted<'_, M> {
    type Error = M::Error;

    fn linearise(&mut self, parameters: &[f64]) -> Result<Linearisation, M::Error> {
        let (own, amounts) = parameters.split_at(parameters.len() - self.nuisance.count());
        let plain = self.model.linearise(own)?;
        let white = whitened(&self.nuisance.added_to(&plain, amounts), self.projection);
        self.plain.push((own.to_vec(), plain));
        Ok(white)
    }
}
