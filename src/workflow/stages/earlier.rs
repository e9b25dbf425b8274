//! What a prediction has made of the pre-operative scan, for the pair that has the same one: the same bytes follow.

use crate::artefact::{Manifest, Produced};
use crate::experiment::outcome::RegistrationOutcome;
use crate::geometry::{Mni, Pre, RigidTransform};
use crate::image::nifti::{self, ReadOptions};
use crate::image::resample::{Interpolation, resample};
use crate::image::{LabelMap, Mask, Volume};
use crate::layout::{PRE_BRAIN, PRE_EVEN_T1, PRE_LABELS, PRE_NATIVE_BRAIN, PRE_NATIVE_LABELS, TEMPLATE_FIT};
use crate::register::deformable::{DisplacementField, FieldFrame};
use crate::resect::HeadApart;
use crate::segment::{RegionEvidence, Scale, SegmentWarning, Segmentation, TissueVolumes, atlas};
use crate::workflow::case::Case;
use crate::workflow::error::{CaseError, WorkflowError};
use crate::workflow::stage_name::Subject;
use serde::{Deserialize, Serialize};

/// What no file of a prediction holds of its [`HeadApart`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct HeadFacts {
    pub tissue_means: [f64; 3],
    pub csf_grey_border: f64,
    pub volumes: TissueVolumes,
    #[serde(default)]
    pub regions: Vec<RegionEvidence>,
    pub warnings: Vec<SegmentWarning>,
    pub scale: Scale,
    pub fit: FieldFrame,
    pub template_correlation: Option<f64>,
}

/// A prediction of the scan at hand, made with the settings at hand.
#[derive(Debug)]
pub(crate) struct Earlier {
    pub case: Case,
    pub mni_from_pre: RigidTransform<Pre, Mni>,
    /// How the pose was found, and what was odd about it.
    pub fit: (RegistrationOutcome, Vec<String>),
    pub head: HeadFacts,
    /// The labels that its mesh was made of, with the mesh, where that is the one that would be made of them.
    pub meshed: Option<(LabelMap<Mni>, Manifest)>,
}

impl Earlier {
    /// The head as the prediction has taken it apart.
    pub fn head(&self, pre: &Volume<f32, Pre>) -> Result<HeadApart, WorkflowError> {
        let grid = atlas::template().grid();
        let HeadFacts { tissue_means, csf_grey_border, volumes, regions, warnings, scale, fit, template_correlation } =
            &self.head;
        let labels_mni = self.on_mni(self.labels(PRE_LABELS)?, PRE_LABELS)?;
        let brain_mni = self.on_mni(self.labels(PRE_BRAIN)?, PRE_BRAIN)?.map(|l| l > 0);
        let (even, _) = nifti::decode_intensities(&self.case.read(PRE_EVEN_T1)?, PRE_EVEN_T1, &ReadOptions::default())?;
        let t1_mni = self.on_mni(even.data, PRE_EVEN_T1)?;
        let of_pre = |name: &str| -> Result<LabelMap<Pre>, WorkflowError> {
            let data = self.labels(name)?;
            if data.len() == pre.grid.len() { Ok(Volume::from_data(pre.grid, data)) } else { Err(self.damaged(name)) }
        };
        let (labels, brain): (_, Mask<Pre>) = (of_pre(PRE_NATIVE_LABELS)?, of_pre(PRE_NATIVE_BRAIN)?.map(|l| l > 0));
        let deformation = nifti::decode_displacement(&self.case.read(TEMPLATE_FIT)?, TEMPLATE_FIT)?;
        let template_from_patient = DisplacementField::from_parts(fit, &deformation.data);
        let to_pre = self.mni_from_pre.inverse().to_affine();
        let pre = Segmentation {
            brain,
            labels,
            t1_mni,
            known_mni: resample(pre, &grid, &to_pre, Interpolation::Nearest, 0.0).inside,
            brain_mni,
            labels_mni,
            tissue_means: *tissue_means,
            csf_grey_border: *csf_grey_border,
            volumes: *volumes,
            regions: regions.clone(),
            warnings: warnings.clone(),
        };
        let template_from_patient = template_from_patient.ok_or_else(|| self.damaged(TEMPLATE_FIT))?;
        Ok(HeadApart { pre, template_from_patient, scale: *scale, template_correlation: *template_correlation })
    }

    /// The mesh as the prediction has made it; nothing where it was made of other labels than these.
    pub fn mesh(&self, labels: &LabelMap<Mni>) -> Result<Option<Produced>, WorkflowError> {
        let Some((_, made)) = self.meshed.as_ref().filter(|(of, _)| of.data == labels.data) else { return Ok(None) };
        let files = made.outputs.keys().map(|name| Ok((name.clone(), self.case.read(name)?)));
        let files = files.collect::<Result<Vec<_>, WorkflowError>>()?;
        Ok(Some(Produced { files, warnings: made.warnings.clone(), facts: made.facts.clone() }))
    }

    fn labels(&self, name: &str) -> Result<Vec<u8>, WorkflowError> {
        Ok(nifti::decode_labels(&self.case.read(name)?, name, &ReadOptions::default())?.0.data)
    }

    fn on_mni<T: Copy>(&self, data: Vec<T>, name: &str) -> Result<Volume<T, Mni>, WorkflowError> {
        let grid = atlas::template().grid();
        if data.len() == grid.len() { Ok(Volume::from_data(grid, data)) } else { Err(self.damaged(name)) }
    }

    fn damaged(&self, name: &str) -> WorkflowError {
        let (folder, file) = (self.case.folder().to_path_buf(), name.to_owned());
        CaseError::Damaged { folder, file, subject: Some(Subject::Plan) }.into()
    }
}
