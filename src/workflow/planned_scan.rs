//! The files a user gives before an operation: one scan, the plan, points, masks of their own.

use super::error::{MaskRole, PredictError, WorkflowError};
use super::inputs::{given_labels, given_pose, read_mask_of};
use super::user_file::{read_input, shown};
use super::work::Work;
use crate::artefact::sha256_hex;
use crate::experiment::predict::{PlannedError, ellipsoid_mask};
use crate::geometry::{Mni, Native, Pre, RigidTransform};
use crate::image::nifti::{self, encode_mask};
use crate::image::{Grid, LabelMap, Mask, Volume};
use std::path::{Path, PathBuf};

/// What is to be taken out.
#[derive(Clone, Debug, PartialEq)]
pub enum PlannedResection {
    /// A mask in the scan's grid.
    Mask(PathBuf),
    /// An ellipsoid along the axes of the scanner's frame: centre and half axes, mm.
    Ellipsoid([f64; 6]),
}

impl std::str::FromStr for PlannedResection {
    type Err = PredictError;

    /// An ellipsoid as `x,y,z,rx,ry,rz`.
    fn from_str(text: &str) -> Result<Self, PredictError> {
        let wrong = || PredictError::Ellipsoid { given: text.to_owned() };
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|x| x.trim().parse()).collect();
        let six: [f64; 6] = numbers.map_err(|_| wrong())?.try_into().map_err(|_| wrong())?;
        let kept = six.iter().all(|x| x.is_finite()) && six[3..].iter().all(|r| *r > 0.0);
        if kept { Ok(Self::Ellipsoid(six)) } else { Err(wrong()) }
    }
}

/// A scan before an operation, and what is to be taken.
#[derive(Clone, Debug)]
pub struct PlanInputs {
    /// The pre-operative T1 (NIfTI).
    pub pre: PathBuf,
    /// What is to be taken.
    pub resection: PlannedResection,
    /// Points that are asked for, in the scanner's frame.
    pub targets: Option<PathBuf>,
    /// As for a pair ([`super::Inputs`]).
    pub dseg: Option<PathBuf>,
    /// As for a pair.
    pub labels: Option<String>,
    /// As for a pair.
    pub pose: Option<PathBuf>,
    /// The brain, in the scan's grid.
    pub brain_mask: Option<PathBuf>,
    /// Lateral and third ventricles, in the scan's grid.
    pub ventricle_mask: Option<PathBuf>,
}

/// A mask with the bytes it stands for.
type OwnMask = Option<(Mask<Pre>, Vec<u8>)>;

/// The scan, the plan, and the user's own masks.
#[derive(Debug)]
pub(crate) struct PlannedScan {
    /// Checksum of the scan's file.
    pub sum: String,
    /// The scan.
    pub pre: Volume<f32, Pre>,
    /// What the reader noticed.
    pub warnings: Vec<String>,
    /// The plan's name for messages.
    pub plan: String,
    /// What is to be taken.
    pub resection: Mask<Pre>,
    pub pose: Option<(RigidTransform<Pre, Mni>, Vec<u8>)>,
    pub labels: Option<(LabelMap<Pre>, Vec<u8>)>,
    pub brain: OwnMask,
    pub ventricle: OwnMask,
}

impl PlannedScan {
    /// Reads everything that was given. Comes before any stage: what cannot be used leaves nothing behind.
    pub fn read(inputs: &PlanInputs, work: &Work<'_>) -> Result<Self, WorkflowError> {
        let options = &work.settings.image;
        let bytes = read_input(&inputs.pre)?;
        let scan = nifti::decode(&bytes, &format!("pre-operative scan {}", shown(&inputs.pre)), options)?;
        let mut warnings: Vec<String> = scan.warnings.iter().map(|w| format!("pre: {w}")).collect();
        let pre: Volume<f32, Pre> = scan.volume.relabelled();
        let grid: Grid<Native> = pre.grid.relabelled();
        let mask = |path: &Path, warnings: &mut Vec<String>| -> Result<Mask<Pre>, WorkflowError> {
            Ok(read_mask_of(path, &grid, options, warnings)?.relabelled())
        };
        let (plan, resection) = match &inputs.resection {
            PlannedResection::Mask(path) => (shown(path), mask(path, &mut warnings)?),
            PlannedResection::Ellipsoid([x, y, z, rx, ry, rz]) => {
                let name = format!("the ellipsoid at ({x}, {y}, {z}) mm");
                (name, ellipsoid_mask(&pre.grid, [*x, *y, *z], [*rx, *ry, *rz]))
            }
        };
        if resection.count() == 0 {
            return Err(PredictError::Plan(PlannedError::Empty { plan }).into());
        }
        let mut own = |path: &Option<PathBuf>| -> Result<OwnMask, WorkflowError> {
            let Some(path) = path else { return Ok(None) };
            let mask = mask(path, &mut warnings)?;
            let bytes = encode_mask(&mask);
            Ok(Some((mask, bytes)))
        };
        let (brain, ventricle) = (own(&inputs.brain_mask)?, own(&inputs.ventricle_mask)?);
        let labels = inputs.dseg.as_deref().map(|path| given_labels(path, inputs.labels.as_deref(), &pre, work));
        let labels = labels.transpose()?;
        let pose = inputs.pose.as_deref().map(given_pose).transpose()?;
        Ok(Self { sum: sha256_hex(&bytes), pre, warnings, plan, resection, pose, labels, brain, ventricle })
    }

    /// What says where the scan lies, by role.
    pub fn posing(&self) -> impl Iterator<Item = (MaskRole, &[u8])> {
        let pose = self.pose.as_ref().map(|(_, bytes)| (MaskRole::Pose, bytes.as_slice()));
        pose.into_iter().chain(self.labels.as_ref().map(|(_, bytes)| (MaskRole::Labels, bytes.as_slice())))
    }

    /// The user's own masks, by role.
    pub fn given(&self) -> impl Iterator<Item = (MaskRole, &[u8])> {
        let masks = [(MaskRole::Brain, &self.brain), (MaskRole::Ventricle, &self.ventricle)];
        let masks = masks.into_iter().filter_map(|(role, mask)| mask.as_ref().map(|(_, b)| (role, b.as_slice())));
        masks.chain(self.labels.as_ref().map(|(_, bytes)| (MaskRole::Labels, bytes.as_slice())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ellipsoid_is_six_numbers_with_sizes() {
        assert_eq!(
            "10,-20,30,5,6,7".parse::<PlannedResection>().unwrap(),
            PlannedResection::Ellipsoid([10.0, -20.0, 30.0, 5.0, 6.0, 7.0])
        );
        for wrong in ["", "1,2,3", "1,2,3,4,5,0", "1,2,3,4,5,-1", "1,2,nan,4,5,6", "a,b,c,d,e,f", "1,2,3,4,5,6,7"] {
            assert!(wrong.parse::<PlannedResection>().unwrap_err().to_string().contains("x,y,z,rx,ry,rz"), "{wrong}");
        }
    }
}
