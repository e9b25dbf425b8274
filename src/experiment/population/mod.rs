//! What a cohort says of people: the moduli of many patients, each with its uncertainty, to the mean and spread of a population.
//!
//! A patient's estimate is a Gaussian in ln(modulus) under a prior. With that prior divided out it is what this patient's scans
//! alone say ([`Moments`]); of all patients together a hierarchy is inferred ([`Population`]): a patient's logarithms are normal
//! about the population's mean, and the scans' say is a noisy reading of them. [`PopulationFile`] holds the moments, from which
//! everything else follows: two cohorts' files merge as if they had been one.

mod file;
mod grid;
mod hierarchy;
mod kind;
mod learnt;
mod mixture;
mod moments;
#[cfg(test)]
mod tests;

pub use file::{Literature, MergeError, PopulationFile, PopulationFileError, Taught, merged};
pub use hierarchy::{Inferred, MOST_PARAMETERS, Population, Shrunken, TooMany};
pub use kind::Kind;
pub use learnt::{LearntPrior, PopulationPrior};
pub use moments::Moments;
