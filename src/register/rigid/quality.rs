//! How far a fit can be trusted.

use super::{RegisterError, RelativeSize};
use serde::Serialize;
use thiserror::Error;

/// Two scans of one head differ less in size than this, percent, whatever was taken out, has sunk, or was scanned how
/// (docs/evidence/choices.md).
const NOTED_PERCENT: f64 = 2.0;
/// The mirror image has less than this of the information where both scans are of one head, in whatever size.
const ONE_HEAD: f64 = 0.9;

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
    /// How much longer the head is in one of two scans of it; `None` where none or only parts of them were compared so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<RelativeSize>,
    /// Local correlation of a head with the mean head, 0 to 1, less where little of it is seen; `None` for two scans.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub likeness: Option<f64>,
}

impl FitQuality {
    /// Where one head differs in length by more than this, percent: along, the moving image's voxel axis, and by how much the
    /// fixed image's is longer. Two heads have two sizes by right.
    fn other_size(&self, most: f64) -> Option<(&'static str, char, f64)> {
        let size = self.size.filter(|_| self.mirrored_ratio.is_none_or(|ratio| ratio < ONE_HEAD))?;
        let worst = size.worst();
        let percent = size.longer_percent[worst];
        (percent.abs() > most).then_some((size.along[worst], ['i', 'j', 'k'][worst], percent))
    }

    /// Refuses scans of one head that no motion takes onto each other.
    pub(in crate::register) fn check_size(&self, most: f64) -> Result<(), RegisterError> {
        self.other_size(most).map_or(Ok(()), |(along, axis, percent)| {
            Err(RegisterError::OtherSize { percent: percent.abs(), longer: percent > 0.0, along, axis, most })
        })
    }

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
        if let Some((along, _, percent)) = self.other_size(NOTED_PERCENT) {
            warnings.push(FitWarning::OtherSize { along, percent });
        }
        if let Some(mirrored_ratio) = mirrored_ratio.filter(|&r| r > 1.0) {
            warnings.push(FitWarning::MirrorFitsBetter { mirrored_ratio });
        }
        warnings
    }
}

impl FitWarning {
    /// Whether the transform is not to be believed as it stands.
    pub fn denies_the_fit(&self) -> bool {
        /// Two heads come near to 1 ([`ONE_HEAD`]); the mirror image of the sample reaches 1.5.
        const CLEARLY_MIRRORED: f64 = 1.05;
        match self {
            Self::LowSimilarity { .. } => true,
            Self::MirrorFitsBetter { mirrored_ratio } => *mirrored_ratio > CLEARLY_MIRRORED,
            Self::LittleOverlap { .. } | Self::OtherSize { .. } | Self::HardlyAHead { .. } => false,
        }
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
    /// What was found looks little like a head.
    #[error(
        "what was found looks little like the mean head ({likeness:.2} of 1, a good scan .6 and more): look at it in its pose before \
         relying on that"
    )]
    HardlyAHead {
        /// See [`FitQuality::likeness`].
        likeness: f64,
    },
    /// One head in two sizes.
    #[error(
        "from {along} the head is {:.1} % {} in the fixed image than in the moving one: check the voxel size and the slice spacing \
         in both headers, lengths may be off by as much",
        percent.abs(),
        if *percent > 0.0 { "longer" } else { "shorter" }
    )]
    OtherSize {
        /// Where the axis runs in the head.
        along: &'static str,
        /// How much longer, percent.
        percent: f64,
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
