//! Multi-task Gaussian process over the literature: intrinsic coregionalisation with a Matern 3/2 kernel, exact and in
//! time linear in the number of studies.

mod dense;
mod draws;
mod filter;
mod fit;
mod gradient;
mod hyperparameters;
mod matern;
mod smoother;

pub use dense::{dense_negative_log_likelihood, dense_posterior};
pub use draws::{JointPosterior, Spread, joint_posterior};
pub use filter::negative_log_likelihood;
pub use fit::{FitRefusal, FitSettings, FitWarning, HyperparameterFit, StartRecord, fit_hyperparameters};
pub use gradient::{LikelihoodGradient, negative_log_likelihood_and_gradient};
pub use hyperparameters::{Hyperparameters, HyperparametersError, TaskMatrix};
pub use smoother::{TissuePrior, posterior};

#[cfg(test)]
mod tests;
