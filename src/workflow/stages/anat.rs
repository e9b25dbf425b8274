//! Stage `anat`: both scans in MNI space, brain masks, labels, cavity, resected tissue.

use super::earlier::Earlier;
use super::reading::WithReading;
use super::registration::transforms;
use crate::artefact::{Produced, Stage};
use crate::experiment::outcome::ResectionVolumes;
use crate::experiment::predict::tissue_cc;
use crate::geometry::{Frame, Mni};
use crate::image::nifti::{self, ReadOptions, encode_i16, encode_intensities, encode_mask, encode_u8, encode_vectors};
use crate::image::{LabelMap, Mask, Padding, Volume};
use crate::layout::{
    CAVITY, NATIVE_CAVITY, NATIVE_RESECTED, POST_BRAIN, POST_NATIVE_BRAIN, POST_T1, POST_VENTRICLE, PRE_BRAIN,
    PRE_EVEN_T1, PRE_LABELS, PRE_NATIVE_BRAIN, PRE_NATIVE_LABELS, PRE_NATIVE_T1, PRE_T1, RESECTED, SAG,
    TEMPLATE_DISPLACEMENT,
};
use crate::register::deformable::DisplacementField;
use crate::resect::{GivenMasks, OperatedBrain, Side, midline_shift_mm, take_pair_apart};
use crate::segment::native::mask_on;
use crate::segment::{PosedScan, ScanQualities, ScanQuality, atlas, label, scan_quality};
use crate::workflow::case::Case;
use crate::workflow::error::{CaseError, WorkflowError};
use crate::workflow::inputs::{GivenMask, OwnMasks, ScanSums, Scans};
use crate::workflow::stage_name::StageName;
use crate::workflow::warning::all_of;
use crate::workflow::work::{Made, Work, facts};
use serde::{Deserialize, Serialize};

/// Raised when the stage's code changes its result.
const VERSION: u32 = 33;
const NAME: StageName = StageName::Anat;

/// What the report says of the masks.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct AnatFacts {
    /// Volumes, cc.
    pub volumes: ResectionVolumes,
    /// Hemisphere of the resection.
    pub side: Side,
    /// What the scan after the operation was filled up with where it was not taken, on its own grid.
    #[serde(default)]
    pub post_filled_up: Vec<Padding>,
    /// Largest voxel edge of either scan, mm.
    pub coarsest_voxel_mm: f64,
    /// How good the scans are.
    #[serde(default)]
    pub scans: ScanQualities,
    /// Masks that are not to be believed, a sentence each.
    #[serde(default)]
    pub implausible: Vec<String>,
}

/// The masks a case's later stages start from, as its files hold them.
#[derive(Debug)]
pub(crate) struct Anatomy {
    /// Labels with the resected tissue as a label of its own: what is meshed.
    pub labels: LabelMap<Mni>,
    /// Labels of the scan before the operation: what tells skull and fluid, wherever a mask of what was taken ends.
    pub before: LabelMap<Mni>,
    /// Cavity on the post-operative scan.
    pub cavity: Mask<Mni>,
    /// Ventricles on the post-operative scan, apart from the cavity.
    pub post_ventricle: Mask<Mni>,
    /// Where the brain has moved to, around the cavity.
    pub sag: DisplacementField<Mni>,
    /// Where a point of the patient lies in the template.
    pub template_from_patient: DisplacementField<Mni>,
}

impl Anatomy {
    /// Reads the masks of a case.
    pub fn read(case: &Case) -> Result<Self, WorkflowError> {
        let options = ReadOptions::default();
        let (labels, _) = nifti::decode_labels(&case.read(PRE_LABELS)?, PRE_LABELS, &options)?;
        let mask = |name: &str| -> Result<Mask<Mni>, WorkflowError> {
            let (volume, _) = nifti::decode_labels(&case.read(name)?, name, &options)?;
            Ok(volume.relabelled::<Mni>().map(|l| l > 0))
        };
        let (cavity, resected, post_ventricle) = (mask(CAVITY)?, mask(RESECTED)?, mask(POST_VENTRICLE)?);
        for (name, grid) in [(CAVITY, cavity.grid), (RESECTED, resected.grid), (POST_VENTRICLE, post_ventricle.grid)] {
            if !grid.coincides(&labels.grid.relabelled(), 1e-3) {
                let folder = case.folder().to_path_buf();
                return Err(CaseError::Grid { folder, file: name, other: PRE_LABELS }.into());
            }
        }
        let field = |name: &str| -> Result<DisplacementField<Mni>, WorkflowError> {
            let displacement = nifti::decode_displacement(&case.read(name)?, name)?;
            Ok(DisplacementField::from_displacement(&displacement.relabelled()))
        };
        let before: LabelMap<Mni> = labels.relabelled();
        Ok(Self {
            labels: without_resected(before.clone(), &resected),
            before,
            cavity,
            post_ventricle,
            sag: field(SAG)?,
            template_from_patient: field(TEMPLATE_DISPLACEMENT)?,
        })
    }
}

/// The labels with what is taken as a label of its own; a ventricle that is opened stays one, and what lies outside the brain stays
/// outside: a mask that was drawn generously takes no more than an exact one. A sulcus between what is taken goes with it: it would be
/// closed to a sheet of grey matter that stands in the cavity.
pub(super) fn without_resected(mut labels: LabelMap<Mni>, resected: &Mask<Mni>) -> LabelMap<Mni> {
    for (l, taken) in labels.data.iter_mut().zip(&resected.data) {
        if *taken && *l != label::VENTRICLE && *l != label::BACKGROUND {
            *l = label::RESECTED;
        }
    }
    labels
}

/// The stage with its settings and its inputs but for the user's own masks.
pub(crate) fn anat_stage(work: &Work<'_>, made: &Made, sums: &ScanSums) -> Stage {
    let posed = WithReading { settings: &work.settings.anat, image: work.settings.image };
    work.stage(made, &NAME, VERSION, &posed)
        .input_sha256("pre", &sums.pre)
        .input_sha256("post", &sums.post)
        .frame(Mni::NAME)
}

/// Resamples, segments and finds the cavity; a user's own masks win.
pub(crate) fn anat(
    work: &Work<'_>,
    made: &mut Made,
    scans: &Scans,
    own: &OwnMasks,
    earlier: Option<&Earlier>,
) -> Result<AnatFacts, WorkflowError> {
    let stage = anat_stage(work, made, &scans.sums);
    let stage = own.given().fold(stage, |stage, (role, bytes)| stage.input(&role.to_string(), bytes));
    work.run(made, &NAME, &stage, || {
        work.tell(|p| p.begin("images", 6));
        let (pre_from_post, mni_from_pre) = transforms(&work.case)?;
        let mni_from_post = pre_from_post.then(&mni_from_pre);
        let grid = atlas::template().grid();
        let on_mni = |(mask, _): &(GivenMask, Vec<u8>)| mask.on_mni(&grid, &mni_from_pre, &mni_from_post);
        let on_pre = |(mask, _): &(GivenMask, Vec<u8>)| match mask {
            GivenMask::Pre(mask) => mask.clone(),
            GivenMask::Post(mask) => mask_on(mask, &scans.pre.grid, &pre_from_post.inverse()),
        };
        let given = GivenMasks {
            labels: own.labels.as_ref().map(|(labels, _)| labels.clone()),
            brain: own.brain.as_ref().map(on_pre),
            ventricle: own.ventricle.as_ref().map(on_pre),
            cavity: own.cavity.as_ref().map(on_mni),
            resected: own.resected.as_ref().map(on_mni),
            head: earlier.map(|earlier| earlier.head(&scans.pre)).transpose()?,
        };
        let step = |what: &'static str| {
            work.tell(|p| {
                p.step();
                p.doing(what);
            });
        };
        let (pre, post) = (PosedScan::new(&scans.pre, &mni_from_pre), PosedScan::new(&scans.post, &mni_from_post));
        let OperatedBrain {
            pre: before,
            post: after,
            finding: found,
            template_from_patient,
            template_correlation,
            sag,
            post_ventricle,
            post_brain,
            ..
        } = take_pair_apart(&pre, &post, &given, &work.settings.anat, step)?;

        let quality = ScanQualities {
            pre: Some(scan_quality(
                &pre,
                (&before.labels, &before.regions),
                &template_from_patient,
                template_correlation,
            )),
            // Nothing was fitted to the scan after the operation but the brain of the one before.
            post: Some(scan_quality(&post, (&after.labels, &[]), &template_from_patient, None)),
        };
        work.tell(|p| p.doing("writing"));
        let mut produced = Produced::default();
        let mut write = |name: &str, bytes: Vec<u8>| produced.files.push((name.to_owned(), bytes));
        write(PRE_T1, encode_i16(&whole_numbers(pre.on_template())));
        write(POST_T1, encode_i16(&whole_numbers(post.on_template())));
        write(PRE_EVEN_T1, encode_i16(&sixteen_bits(&before.t1_mni)));
        write(PRE_NATIVE_T1, encode_intensities(&scans.pre));
        write(PRE_BRAIN, encode_mask(&before.brain_mni));
        write(POST_BRAIN, encode_mask(&post_brain));
        write(PRE_LABELS, encode_u8(&before.labels_mni));
        write(CAVITY, encode_mask(&found.cavity));
        write(RESECTED, encode_mask(&found.resected));
        write(POST_VENTRICLE, encode_mask(&post_ventricle));
        write(SAG, encode_vectors(&sag.subject_from_atlas.displacement_mm()));
        write(TEMPLATE_DISPLACEMENT, encode_vectors(&template_from_patient.displacement_mm()));
        write(PRE_NATIVE_BRAIN, encode_mask(&before.brain));
        write(PRE_NATIVE_LABELS, encode_u8(&before.labels));
        write(POST_NATIVE_BRAIN, encode_mask(&after.brain));
        let native_cavity = match &own.cavity {
            Some((GivenMask::Post(mask), _)) => mask.clone(),
            _ => mask_on(&found.cavity, &scans.post.grid, &mni_from_post),
        };
        let native_resected = match &own.resected {
            Some((GivenMask::Pre(mask), _)) => mask.clone(),
            _ => mask_on(&found.resected, &scans.pre.grid, &mni_from_pre),
        };
        write(NATIVE_CAVITY, encode_mask(&native_cavity));
        write(NATIVE_RESECTED, encode_mask(&native_resected));
        work.tell(|p| p.end());

        for (whose, warnings, quality) in
            [("pre", &before.warnings, &quality.pre), ("post", &after.warnings, &quality.post)]
        {
            let of_regions = quality.iter().flat_map(ScanQuality::of_regions).collect::<Vec<_>>();
            produced.warn(all_of(whose, warnings).chain(all_of(whose, &of_regions)));
        }
        let spacing = scans.pre.grid.spacing_mm().into_iter().chain(scans.post.grid.spacing_mm());
        produced.facts = facts(&AnatFacts {
            volumes: ResectionVolumes {
                cavity_cc: Some(native_cavity.volume_cc()),
                resected_cc: Some(tissue_cc(&found.resected, &before.labels_mni)),
                ventricle_before_cc: Some(before.volumes.ventricle_cc),
                ventricle_after_cc: Some(post_ventricle.volume_cc()),
                brain_cc: Some(before.volumes.brain_cc),
                midline_shift_mm: midline_shift_mm(&sag.subject_from_atlas, &template_from_patient),
            },
            side: found.side,
            post_filled_up: post.filled_up().to_vec(),
            coarsest_voxel_mm: spacing.fold(0.0, f64::max),
            scans: quality,
            implausible: before
                .warnings
                .iter()
                .chain(&after.warnings)
                .filter(|w| w.belies_the_masks())
                .map(ToString::to_string)
                .collect(),
        });
        Ok(produced)
    })
}

/// Intensities as 16-bit whole numbers, the brightest as 32,000: rounding is far below the noise of the scan that is registered again.
fn sixteen_bits(volume: &Volume<f32, Mni>) -> Volume<i16, Mni> {
    let highest = brightest(volume).max(1e-6);
    volume.map(|x| (x * (32000.0 / highest)).round().clamp(0.0, 32000.0) as i16)
}

/// The largest intensity, but for voxels out of all proportion: beside one a brain would have no grey levels left.
fn brightest(volume: &Volume<f32, Mni>) -> f32 {
    /// What nearly all of a head is no brighter than, and how many times as bright a vessel, fat or skin under a coil may be.
    const NEARLY_ALL: f64 = 0.999;
    const IN_PROPORTION: f32 = 8.0;
    let mut shown: Vec<f32> = volume.data.iter().copied().filter(|x| *x > 0.0).collect();
    let highest = shown.iter().copied().fold(0.0f32, f32::max);
    let rank = (NEARLY_ALL * shown.len() as f64) as usize;
    if rank >= shown.len() {
        return highest;
    }
    let (_, usual, _) = shown.select_nth_unstable_by(rank, f32::total_cmp);
    highest.min(IN_PROPORTION * *usual)
}

/// Intensities as 16-bit whole numbers, scaled so that the brightest keeps three digits.
pub(super) fn whole_numbers(volume: &Volume<f32, Mni>) -> Volume<i16, Mni> {
    let highest = brightest(volume);
    let scale = if (500.0..32000.0).contains(&highest) { 1.0 } else { 4000.0 / highest.max(1e-6) };
    volume.map(|x| (x * scale).round().clamp(0.0, 32000.0) as i16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    #[test]
    fn what_is_taken_is_nothing_outside_the_brain_and_no_ventricle_but_its_sulci() {
        let grid = Grid::<Mni>::axis_aligned([6, 1, 1], [1.0; 3], [0.0; 3]);
        let (outside, fluid, grey, white, ventricle) =
            (label::BACKGROUND, label::CSF, label::GREY_MATTER, label::WHITE_MATTER, label::VENTRICLE);
        let labels = LabelMap::from_data(grid, vec![outside, fluid, grey, white, ventricle, white]);
        let taken = Mask::from_data(grid, vec![true, true, true, true, true, false]);
        let resected = label::RESECTED;
        assert_eq!(without_resected(labels, &taken).data, [outside, resected, resected, resected, ventricle, white]);
    }

    #[test]
    fn one_voxel_out_of_proportion_leaves_the_others_their_grey_levels() {
        let grid = Grid::<Mni>::axis_aligned([20; 3], [1.0; 3], [0.0; 3]);
        let plain = Volume::from_fn(grid, |n| 20.0 + (n % 150) as f32);
        for brightest in [600.0, 1e6] {
            let mut spiked = plain.clone();
            spiked.data[77] = brightest;
            for written in [whole_numbers(&spiked), sixteen_bits(&spiked)] {
                let mut levels = written.data.clone();
                levels.sort_unstable();
                levels.dedup();
                assert!(levels.len() >= 150, "{brightest}: {}", levels.len());
            }
        }
        assert_eq!(sixteen_bits(&plain).data.iter().max(), Some(&32000));
    }
}
