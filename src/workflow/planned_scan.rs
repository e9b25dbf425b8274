//! The files a user gives before an operation: one scan, the plan, points, masks of their own.

use super::case::Case;
use super::error::{MaskRole, WorkflowError};
use super::inputs::{HandPose, given_labels, labels_alone, read_mask_of};
use super::planned_resection::PlannedResection;
use super::user_file::{read_input, shown};
use super::warning::{Warning, all_of};
use super::work::Work;
use crate::artefact::{ApartError, check_apart, sha256_hex};
use crate::experiment::outcome::RegistrationOutcome;
use crate::geometry::{Mni, Native, Pre, RigidTransform};
use crate::image::nifti::{self, encode_mask};
use crate::image::{Grid, LabelMap, Mask, Volume};
use crate::register::deformable::AtlasFit;
use crate::segment::{Scale, Segmentation};
use std::cell::OnceCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;

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
    /// As for a pair.
    pub pose_start: Option<PathBuf>,
    /// The brain, in the scan's grid.
    pub brain_mask: Option<PathBuf>,
    /// Lateral and third ventricles, in the scan's grid.
    pub ventricle_mask: Option<PathBuf>,
}

impl PlanInputs {
    /// Refuses a file of the case that is to be made: it would be made of what it replaces. The plans are all of the job.
    pub(super) fn check_apart_from(&self, case: &Case, plans: &[&PlannedResection]) -> Result<(), ApartError> {
        let own = [&self.targets, &self.dseg, &self.pose, &self.pose_start, &self.brain_mask, &self.ventricle_mask];
        let plans = plans.iter().filter_map(|plan| plan.path());
        let files: Vec<&Path> =
            own.into_iter().flatten().chain([&self.pre]).map(PathBuf::as_path).chain(plans).collect();
        check_apart(case.own_of(files.iter().copied()), files)
    }
}

/// A mask with the bytes it stands for.
type OwnMask = Option<(Mask<Pre>, Vec<u8>)>;

/// The scan, the plan, and the user's own masks.
#[derive(Clone, Debug)]
pub(crate) struct PlannedScan {
    /// Checksum of the scan's file.
    pub sum: String,
    /// The scan.
    pub pre: Volume<f32, Pre>,
    /// What the reader noticed.
    pub warnings: Vec<Warning>,
    /// What is odd about the plan.
    pub plan_warnings: Vec<Warning>,
    /// The plan's name for messages.
    pub plan: String,
    /// What is to be taken.
    pub resection: Mask<Pre>,
    pub pose: Option<HandPose>,
    pub labels: Option<(LabelMap<Pre>, Vec<u8>)>,
    pub brain: OwnMask,
    pub ventricle: OwnMask,
    /// What does not depend on the plan, made for the first of several.
    pub shared: Rc<Shared>,
}

/// What several plans of one scan share.
#[derive(Debug, Default)]
pub(crate) struct Shared {
    /// Where the scan lies, with what was noticed.
    pub pose: OnceCell<(RigidTransform<Pre, Mni>, RegistrationOutcome, Vec<Warning>)>,
    /// Its tissue, and the template carried onto it.
    pub head: OnceCell<(Segmentation<Pre>, AtlasFit<Mni>, Scale)>,
}

/// What a cell holds, made where it is empty.
pub(crate) fn once<T, E>(cell: &OnceCell<T>, make: impl FnOnce() -> Result<T, E>) -> Result<&T, E> {
    if let Some(value) = cell.get() {
        return Ok(value);
    }
    let value = make()?;
    Ok(cell.get_or_init(|| value))
}

impl PlannedScan {
    /// Reads everything that was given. Comes before any stage: what cannot be used leaves nothing behind.
    pub fn read(inputs: &PlanInputs, work: &Work<'_>) -> Result<Self, WorkflowError> {
        let options = &work.settings.image;
        labels_alone(inputs.dseg.as_deref(), [&inputs.brain_mask, &inputs.ventricle_mask])?;
        let bytes = read_input(&inputs.pre)?;
        let scan = nifti::decode_scan(&bytes, &format!("pre-operative scan {}", shown(&inputs.pre)), options)?;
        let mut warnings: Vec<Warning> = all_of("pre", &scan.warnings).collect();
        let pre: Volume<f32, Pre> = scan.volume.relabelled();
        let grid: Grid<Native> = pre.grid.relabelled();
        let mask = |path: &Path, warnings: &mut Vec<Warning>| -> Result<Mask<Pre>, WorkflowError> {
            Ok(read_mask_of(path, &grid, options, warnings)?.relabelled())
        };
        let plan = inputs.resection.to_string();
        let mut plan_warnings = Vec::new();
        let resection = inputs.resection.mask(&pre.grid, inputs.dseg.as_deref(), options, &mut plan_warnings)?;
        let mut own = |path: &Option<PathBuf>| -> Result<OwnMask, WorkflowError> {
            let Some(path) = path else { return Ok(None) };
            let mask = mask(path, &mut warnings)?;
            let bytes = encode_mask(&mask);
            Ok(Some((mask, bytes)))
        };
        let (brain, ventricle) = (own(&inputs.brain_mask)?, own(&inputs.ventricle_mask)?);
        let labels = inputs.dseg.as_deref().map(|path| given_labels(path, inputs.labels.as_deref(), &pre, work));
        let labels = labels.transpose()?;
        let pose = HandPose::read(inputs.pose.as_deref(), inputs.pose_start.as_deref(), inputs.dseg.as_deref())?;
        let (sum, shared) = (sha256_hex(&bytes), Rc::default());
        Ok(Self { sum, pre, warnings, plan_warnings, plan, resection, pose, labels, brain, ventricle, shared })
    }

    /// The same scan with another plan; `inputs` is what it was read from.
    pub fn with_plan(
        &self,
        plan: &PlannedResection,
        inputs: &PlanInputs,
        work: &Work<'_>,
    ) -> Result<Self, WorkflowError> {
        let mut other = Self { plan_warnings: Vec::new(), ..self.clone() };
        let dseg = inputs.dseg.as_deref();
        other.resection = plan.mask(&self.pre.grid, dseg, &work.settings.image, &mut other.plan_warnings)?;
        other.plan = plan.to_string();
        Ok(other)
    }

    /// What says where the scan lies, by role.
    pub fn posing(&self) -> impl Iterator<Item = (MaskRole, &[u8])> {
        let pose = self.pose.as_ref().map(HandPose::given);
        pose.into_iter().chain(self.labels.as_ref().map(|(_, bytes)| (MaskRole::Labels, bytes.as_slice())))
    }

    /// The user's own masks, by role.
    pub fn given(&self) -> impl Iterator<Item = (MaskRole, &[u8])> {
        let masks = [(MaskRole::Brain, &self.brain), (MaskRole::Ventricle, &self.ventricle)];
        let masks = masks.into_iter().filter_map(|(role, mask)| mask.as_ref().map(|(_, b)| (role, b.as_slice())));
        masks.chain(self.labels.as_ref().map(|(_, bytes)| (MaskRole::Labels, bytes.as_slice())))
    }
}
