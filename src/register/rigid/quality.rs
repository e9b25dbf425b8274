//! How far a fit can be trusted.

use serde::Serialize;
use thiserror::Error;

/// Figures that describe a fit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FitQuality {
    /// Mutual information at the finest level, nats.
    pub mutual_information: f64,
    /// Mutual information over the smaller marginal entropy, 0 to 1.
    pub normalised_information: f64,
    /// Fraction of the sampled region that lies in the other image.
    pub overlap: f64,
    /// How many times the information of an ordinary wrong pose the best pose has, at the start level.
    pub distinctness: f64,
    /// Information of the best mirrored pose over that of the fit, at the coarsest level; above 1 the mirror fits
    /// better. `None` when it was not tried.
    pub mirrored_ratio: Option<f64>,
    /// Evaluations of mutual information with gradient.
    pub evaluations: usize,
}

impl FitQuality {
    /// What the figures give reason to look at.
    pub(in crate::register) fn warnings(&self) -> Vec<FitWarning> {
        let mut warnings = Vec::new();
        let Self { normalised_information, overlap, distinctness, mirrored_ratio, .. } = *self;
        if normalised_information < 0.05 || distinctness < 1.5 {
            warnings.push(FitWarning::LowSimilarity { normalised_information, distinctness });
        }
        if overlap < 0.5 {
            warnings.push(FitWarning::LittleOverlap { overlap });
        }
        if let Some(mirrored_ratio) = mirrored_ratio.filter(|&r| r > 1.0) {
            warnings.push(FitWarning::MirrorFitsBetter { mirrored_ratio });
        }
        warnings
    }
}

/// A reason to look at the fit before believing it.
#[derive(Clone, Debug, PartialEq, Error, Serialize)]
pub enum FitWarning {
    /// The best pose hardly stands out.
    #[error(
        "the images hardly resemble each other (similarity {normalised_information:.3} of 1, {distinctness:.2} times \
         that of a wrong pose): look at both images together before using this transform"
    )]
    LowSimilarity {
        /// See [`FitQuality::normalised_information`].
        normalised_information: f64,
        /// See [`FitQuality::distinctness`].
        distinctness: f64,
    },
    /// Little of one image is seen in the other.
    #[error("only {:.0} % of the head lies in both images: check the fields of view", overlap * 100.0)]
    LittleOverlap {
        /// See [`FitQuality::overlap`].
        overlap: f64,
    },
    /// Left and right may be exchanged.
    #[error(
        "the mirror image fits better ({mirrored_ratio:.3} times the information): left and right may be exchanged in one header"
    )]
    MirrorFitsBetter {
        /// See [`FitQuality::mirrored_ratio`].
        mirrored_ratio: f64,
    },
}
