//! Stage `plan`: labels of the pre-operative scan, and the tissue that is to be taken.

use super::anat::{whole_numbers, without_resected};
use super::earlier::HeadFacts;
use super::reading::WithReading;
use super::registration::pose;
use super::shift::mask_of;
use crate::artefact::{Produced, Stage};
use crate::experiment::outcome::ResectionVolumes;
use crate::experiment::predict::{Planned, planned};
use crate::geometry::{Frame, Mni};
use crate::image::nifti::{
    self, ReadOptions, encode_i16, encode_intensities, encode_mask, encode_numbers, encode_u8, encode_vectors,
};
use crate::image::{LabelMap, Mask};
use crate::layout::{
    NATIVE_RESECTED, PRE_BRAIN, PRE_EVEN_T1, PRE_LABELS, PRE_NATIVE_BRAIN, PRE_NATIVE_LABELS, PRE_NATIVE_T1, PRE_T1,
    RESECTED, TEMPLATE_DISPLACEMENT, TEMPLATE_FIT,
};
use crate::register::deformable::DisplacementField;
use crate::resect::{GivenMasks, take_head_apart, template_correlation};
use crate::segment::native::mask_on;
use crate::segment::{PosedScan, ScanQualities, atlas, scan_quality};
use crate::workflow::case::Case;
use crate::workflow::error::{PredictError, WorkflowError};
use crate::workflow::planned_scan::{PlannedScan, once};
use crate::workflow::settings::Settings;
use crate::workflow::stage_name::{StageName, Subject};
use crate::workflow::targets::Targets;
use crate::workflow::warning::{Warning, all_of};
use crate::workflow::work::{Made, Work, facts};
use serde::{Deserialize, Serialize};

/// Raised when the stage's code changes its result.
const VERSION: u32 = 14;
const NAME: StageName = StageName::Plan;
/// Less of a plan outside the brain is drawn generously.
const NOTED_OUTSIDE: f64 = 0.1;

/// What the report says of the plan.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PlanFacts {
    /// Volumes, cc.
    pub volumes: ResectionVolumes,
    /// The head without any plan, but for what the files hold.
    pub head: HeadFacts,
    /// What is to be taken.
    pub plan: Planned,
    /// How good the scan is.
    #[serde(default)]
    pub scans: ScanQualities,
    /// What of its images is not to be believed.
    #[serde(default)]
    pub implausible: Vec<String>,
}

/// What later stages start from, as the case's files hold it.
#[derive(Debug)]
pub(crate) struct PlannedHead {
    /// Labels with the planned tissue as a label of its own: what is meshed.
    pub labels: LabelMap<Mni>,
    /// Labels of the scan, without any plan: what tells skull and fluid.
    pub before: LabelMap<Mni>,
    /// Where a point of the patient lies in the template.
    pub template_from_patient: DisplacementField<Mni>,
}

impl PlannedHead {
    /// Reads them.
    pub fn read(case: &Case) -> Result<Self, WorkflowError> {
        let options = ReadOptions::default();
        let (labels, _) = nifti::decode_labels(&case.read(PRE_LABELS)?, PRE_LABELS, &options)?;
        let (taken, _) = nifti::decode_labels(&case.read(RESECTED)?, RESECTED, &options)?;
        let taken: Mask<Mni> = taken.relabelled::<Mni>().map(|l| l > 0);
        let field = nifti::decode_displacement(&case.read(TEMPLATE_DISPLACEMENT)?, TEMPLATE_DISPLACEMENT)?;
        let before: LabelMap<Mni> = labels.relabelled();
        Ok(Self {
            labels: without_resected(before.clone(), &taken),
            before,
            template_from_patient: DisplacementField::from_displacement(&field.relabelled()),
        })
    }
}

/// The stage of the case of one scan, with its inputs but for the plan and the user's own masks.
pub(crate) fn plan_stage(case: &Case, settings: &Settings, made: &Made, sum: &str) -> Stage {
    let posed = WithReading { settings: &settings.anat, image: settings.image };
    made.stage((case, Subject::Plan), &NAME, VERSION, &posed).input_sha256("pre", sum).frame(Mni::NAME)
}

/// Segments the scan as a pair's would be, and looks whether the plan can be followed and the targets lie in the head: what is
/// refused replaces nothing.
pub(crate) fn plan(
    work: &Work<'_>,
    made: &mut Made,
    scan: &PlannedScan,
    targets: Option<&Targets>,
) -> Result<PlanFacts, WorkflowError> {
    let stage = plan_stage(&work.case, work.settings, made, &scan.sum);
    let stage = stage.input("resection", &encode_mask(&scan.resection));
    let stage = scan.given().fold(stage, |stage, (role, bytes)| stage.input(&role.to_string(), bytes));
    let facts = work.run(made, &NAME, &stage, || {
        work.tell(|p| p.begin("images", 2));
        work.tell(|p| p.doing("pre-operative tissue"));
        let mni_from_pre = pose(&work.case)?;
        let grid = atlas::template().grid();
        let given = GivenMasks {
            labels: scan.labels.as_ref().map(|(labels, _)| labels.clone()),
            brain: scan.brain.as_ref().map(|(mask, _)| mask.clone()),
            ventricle: scan.ventricle.as_ref().map(|(mask, _)| mask.clone()),
            ..GivenMasks::default()
        };
        let pre = PosedScan::new(&scan.pre, &mni_from_pre);
        let (before, template, scale) =
            once(&scan.shared.head, || Ok::<_, WorkflowError>(take_head_apart(&pre, &given, &work.settings.anat)?))?;
        let correlation = template_correlation(&given, template);
        let quality = scan_quality(&pre, (&before.labels, &before.regions), &template.atlas_from_subject, correlation);
        work.tell(|p| p.step());
        work.tell(|p| p.doing("writing"));
        let resected = mask_on(&scan.resection, &grid, &mni_from_pre.inverse());
        let drawn_mm3 = scan.resection.count() as f64 * scan.resection.grid.voxel_volume_mm3();
        let found = planned(&scan.plan, drawn_mm3, &resected, &before.labels_mni).map_err(PredictError::Plan)?;
        targets.map_or(Ok(()), |targets| targets.check_inside(&before.brain))?;
        let mut produced = Produced::default();
        produced.warn(&scan.plan_warnings);
        if found.outside > NOTED_OUTSIDE {
            produced.warn([Warning::PlanOutsideBrain { plan: scan.plan.clone(), percent: 100.0 * found.outside }]);
        }
        let mut write = |name: &str, bytes: Vec<u8>| produced.files.push((name.to_owned(), bytes));
        write(PRE_T1, encode_i16(&whole_numbers(pre.on_template())));
        write(PRE_NATIVE_T1, encode_intensities(&scan.pre));
        write(PRE_BRAIN, encode_mask(&before.brain_mni));
        write(PRE_LABELS, encode_u8(&before.labels_mni));
        write(RESECTED, encode_mask(&resected));
        write(TEMPLATE_DISPLACEMENT, encode_vectors(&template.atlas_from_subject.displacement_mm()));
        let (fit, deformation) = template.atlas_from_subject.parts();
        write(TEMPLATE_FIT, encode_vectors(&deformation));
        write(PRE_EVEN_T1, encode_numbers(&before.t1_mni.grid, |[i, j, k]| before.t1_mni.at(i, j, k)));
        write(PRE_NATIVE_BRAIN, encode_mask(&before.brain));
        write(PRE_NATIVE_LABELS, encode_u8(&before.labels));
        write(NATIVE_RESECTED, encode_mask(&scan.resection));
        work.tell(|p| p.end());
        produced.warn(all_of("pre", &before.warnings).chain(all_of("pre", &quality.of_regions())));
        produced.facts = facts(&PlanFacts {
            volumes: ResectionVolumes {
                cavity_cc: None,
                resected_cc: Some(found.resected_cc),
                ventricle_before_cc: Some(before.volumes.ventricle_cc),
                ventricle_after_cc: None,
                brain_cc: Some(before.volumes.brain_cc),
                midline_shift_mm: None,
            },
            head: HeadFacts {
                tissue_means: before.tissue_means,
                csf_grey_border: before.csf_grey_border,
                volumes: before.volumes,
                regions: before.regions.clone(),
                warnings: before.warnings.clone(),
                scale: *scale,
                fit,
                template_correlation: correlation,
            },
            plan: found,
            scans: ScanQualities { pre: Some(quality), post: None },
            implausible: before.warnings.iter().filter(|w| w.belies_the_masks()).map(ToString::to_string).collect(),
        });
        Ok(produced)
    })?;
    // Of labels that were there already.
    if let Some(targets) = targets {
        targets.check_inside(&mask_of(&work.case, PRE_NATIVE_BRAIN, &scan.pre.grid)?)?;
    }
    Ok(facts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::predict::{Head, KnownLevel, PredictSettings};
    use crate::experiment::supports::{SkullSettings, level_when_drained};
    use crate::image::{Grid, Volume};
    use crate::segment::label;

    /// A brain of 24 mm around its ventricle, under 5 mm of fluid in front, with nothing around it.
    fn labels() -> LabelMap<Mni> {
        let grid = Grid::<Mni>::axis_aligned([60, 60, 60], [1.5; 3], [-44.25; 3]);
        LabelMap::from_fn(grid, |n| {
            let p = grid.centre(grid.voxel(n)).mm;
            match p.coords.norm() {
                r if r < 8.0 => label::VENTRICLE,
                r if r < 20.0 => label::WHITE_MATTER,
                r if r < 24.0 => label::GREY_MATTER,
                r if r < 29.0 && p.y > 0.0 => label::CSF,
                _ => label::BACKGROUND,
            }
        })
    }

    /// The case of a plan, as its stages read it.
    fn head(taken: &Mask<Mni>) -> PlannedHead {
        let folder = tempfile::tempdir().unwrap();
        let still = Volume::filled(taken.grid, [0.0f32; 3]);
        let files = [
            (PRE_LABELS, encode_u8(&labels())),
            (RESECTED, encode_mask(taken)),
            (TEMPLATE_DISPLACEMENT, encode_vectors(&still)),
        ];
        for (file, bytes) in files {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
        }
        PlannedHead::read(&Case::at(folder.path())).unwrap()
    }

    #[test]
    fn fluid_and_skull_are_those_of_the_scan_however_far_out_a_plan_is_drawn() {
        let labels = labels();
        let grid = labels.grid;
        let box_up_to = |top_mm: f64| {
            Mask::from_fn(grid, |n| {
                let p = grid.centre(grid.voxel(n)).mm;
                p.x.abs() < 6.0 && p.z.abs() < 6.0 && (12.0..top_mm).contains(&p.y)
            })
        };
        // 15 mm out of the fluid, and no higher than the cortex, whose tissue is the same.
        let [out, exact] = [44.0, 24.0].map(|top_mm| head(&box_up_to(top_mm)));
        let down = [0.0, -9.81, 0.0];
        let known = PredictSettings {
            fluid_level: Some(KnownLevel { below_top_mm: 5.0, sd_mm: 2.0 }),
            ..PredictSettings::default()
        };
        let found = |labels: &LabelMap<Mni>| {
            let (fluid, top_at) = known.fluid_of_head(&Head::Supine, labels, down).unwrap().unwrap();
            let drained = [0.2, 0.5].map(|part| level_when_drained(labels, down, part).unwrap());
            (fluid, top_at.mm, drained)
        };
        let skull =
            |labels: &LabelMap<Mni>| SkullSettings::default().distance(labels).unwrap().at([0.0, 22.0, 0.0]).value;
        for head in [&out, &exact] {
            assert_eq!(found(&head.before), found(&labels));
            assert_eq!(skull(&head.before), skull(&labels));
        }
        // What is meshed ends where the brain does.
        let resected = |head: &PlannedHead| head.labels.map(|l| l == label::RESECTED);
        let inside = resected(&out);
        assert!(inside.count() > resected(&exact).count());
        assert!((0..grid.len()).all(|n| !inside.data[n] || labels.data[n] != label::BACKGROUND));
    }
}
