//! Stage `anat`: both scans in MNI space, brain masks, labels, cavity, resected tissue.

use super::registration::transforms;
use super::scans::GivenMask;
use super::{Case, Failure, OwnMasks, Reject, ScanSums, Scans, WithReading, facts};
use crate::artefact::{Manifest, Produced, Stage};
use crate::cli::Session;
use crate::experiment::outcome::ResectionVolumes;
use crate::geometry::{Frame, Mni};
use crate::image::nifti::{self, ReadOptions, encode_i16, encode_mask, encode_u8, encode_vectors};
use crate::image::resample::{Interpolation, resample};
use crate::image::{LabelMap, Mask, Volume};
use crate::register::deformable::DisplacementField;
use crate::resect::{GivenMasks, OperatedBrain, PairSettings, Side, midline_shift_mm, take_pair_apart};
use crate::segment::native::mask_on;
use crate::segment::{atlas, label};
use anyhow::anyhow;
use serde::{Deserialize, Serialize};

/// Raised when the stage's code changes its result.
const VERSION: u32 = 5;
/// The pre-operative scan and its brain.
pub const PRE_T1: &str = "anat/pre_space-MNI_T1w.nii.gz";
pub const PRE_BRAIN: &str = "anat/pre_space-MNI_desc-brain_mask.nii.gz";
const PRE_DSEG: &str = "anat/pre_space-MNI_dseg.nii.gz";
const CAVITY: &str = "anat/post_space-MNI_label-cavity_mask.nii.gz";
const RESECTED: &str = "anat/pre_space-MNI_label-resected_mask.nii.gz";
/// How far the brain has moved from one scan to the other, mm; read where it was before.
const SAG: &str = "anat/pre_space-MNI_desc-sag_displacement.nii.gz";
/// How far a point of the patient lies from its like in the template, mm.
const TO_TEMPLATE: &str = "anat/pre_space-MNI_desc-template_displacement.nii.gz";
const POST_VENTRICLE: &str = "anat/post_space-MNI_label-ventricle_mask.nii.gz";

/// What the report says of the masks.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct AnatFacts {
    /// Volumes, cc.
    pub volumes: ResectionVolumes,
    /// Hemisphere of the resection.
    pub side: Side,
    /// Largest voxel edge of either scan, mm.
    pub coarsest_voxel_mm: f64,
}

/// The masks a case's later stages start from, as its files hold them.
#[derive(Debug)]
pub struct Anatomy {
    /// Labels with the resected tissue as a label of its own.
    pub labels: LabelMap<Mni>,
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
    ///
    /// # Errors
    /// Rejected when a file is missing or damaged.
    pub fn read(case: &Case) -> Result<Self, Failure> {
        let options = ReadOptions::default();
        let (labels, _) = nifti::decode_labels(&case.read(PRE_DSEG)?, PRE_DSEG, &options).reject()?;
        let mask = |name: &str| -> Result<Mask<Mni>, Failure> {
            let (volume, _) = nifti::decode_labels(&case.read(name)?, name, &options).reject()?;
            Ok(volume.relabelled::<Mni>().map(|l| l > 0))
        };
        let (cavity, resected, post_ventricle) = (mask(CAVITY)?, mask(RESECTED)?, mask(POST_VENTRICLE)?);
        for (name, grid) in [(CAVITY, cavity.grid), (RESECTED, resected.grid), (POST_VENTRICLE, post_ventricle.grid)] {
            if !grid.coincides(&labels.grid.relabelled(), 1e-3) {
                return Err(Failure::Rejected(anyhow!(
                    "{}: {name} is not on the grid of {PRE_DSEG}: one of the two is not this case's; run `hgm prep PRE \
                     POST -o {0}` again (--cavity-mask and --resected-mask take masks of your own)",
                    case.folder.display()
                )));
            }
        }
        let field = |name: &str| -> Result<DisplacementField<Mni>, Failure> {
            let displacement = nifti::decode_vectors(&case.read(name)?, name).reject()?;
            Ok(DisplacementField::from_displacement(&displacement.relabelled()))
        };
        let mut labels: LabelMap<Mni> = labels.relabelled();
        for (l, taken) in labels.data.iter_mut().zip(&resected.data) {
            if *taken && *l != label::VENTRICLE {
                *l = label::RESECTED;
            }
        }
        Ok(Self { labels, cavity, post_ventricle, sag: field(SAG)?, template_from_patient: field(TO_TEMPLATE)? })
    }
}

/// The stage with its settings and its inputs but for the user's own masks.
///
/// # Errors
/// A settings table that does not fit.
pub fn anat_stage(
    case: &Case,
    sums: &ScanSums,
    after: &Manifest,
    session: &Session,
) -> Result<(Stage, PairSettings), Failure> {
    let settings: PairSettings = session.settings("anat")?;
    let posed = WithReading { settings: &settings, image: session.reading()? };
    let stage = Stage::new("anat", VERSION, &case.folder, &posed)
        .input_sha256("pre", &sums.pre)
        .input_sha256("post", &sums.post)
        .after(after)
        .frame(Mni::NAME);
    Ok((stage, settings))
}

/// Resamples, segments and finds the cavity; a user's own masks win.
///
/// # Errors
/// Rejected scans and masks.
pub fn anat(
    case: &Case,
    scans: &Scans,
    own: &OwnMasks,
    after: &Manifest,
    session: &Session,
) -> Result<(Manifest, AnatFacts), Failure> {
    let (mut stage, settings) = anat_stage(case, &scans.sums, after, session)?;
    for (role, mask) in [
        ("brain mask", &own.brain),
        ("ventricle mask", &own.ventricle),
        ("cavity mask", &own.cavity),
        ("resected mask", &own.resected),
    ] {
        if let Some((_, bytes)) = mask {
            stage = stage.input(role, bytes);
        }
    }

    case.run(&stage, "anat", || {
        let bar = session.progress(6, "images");
        let (pre_from_post, mni_from_pre) = transforms(case)?;
        let mni_from_post = pre_from_post.then(&mni_from_pre);
        let grid = atlas::template().grid();
        let on_mni = |(mask, _): &(GivenMask, Vec<u8>)| mask.on_mni(&grid, &mni_from_pre, &mni_from_post);
        let on_pre = |(mask, _): &(GivenMask, Vec<u8>)| match mask {
            GivenMask::Pre(mask) => mask.clone(),
            GivenMask::Post(mask) => mask_on(mask, &scans.pre.grid, &pre_from_post.inverse()),
        };
        let given = GivenMasks {
            brain: own.brain.as_ref().map(on_pre),
            ventricle: own.ventricle.as_ref().map(on_pre),
            cavity: own.cavity.as_ref().map(on_mni),
            resected: own.resected.as_ref().map(on_mni),
        };
        let step = |what: &'static str| {
            bar.inc(1);
            bar.set_message(what);
        };
        let OperatedBrain { pre: before, post: after, finding: found, template, sag, post_ventricle, post_brain } =
            take_pair_apart(&scans.pre, &scans.post, &pre_from_post, &mni_from_pre, &given, &settings, step)
                .reject()?;

        bar.set_message("writing");
        let mut produced = Produced::default();
        let mut write = |name: &str, bytes: Vec<u8>| produced.files.push((name.to_owned(), bytes));
        let pre_t1 = resample(&scans.pre, &grid, &mni_from_pre.inverse().to_affine(), Interpolation::CubicBSpline, 0.0);
        let post_t1 =
            resample(&scans.post, &grid, &mni_from_post.inverse().to_affine(), Interpolation::CubicBSpline, 0.0);
        write(PRE_T1, encode_i16(&whole_numbers(&pre_t1.volume)));
        write("anat/post_space-MNI_T1w.nii.gz", encode_i16(&whole_numbers(&post_t1.volume)));
        write(PRE_BRAIN, encode_mask(&before.brain_mni));
        write("anat/post_space-MNI_desc-brain_mask.nii.gz", encode_mask(&post_brain));
        write(PRE_DSEG, encode_u8(&before.labels_mni));
        write(CAVITY, encode_mask(&found.cavity));
        write(RESECTED, encode_mask(&found.resected));
        write(POST_VENTRICLE, encode_mask(&post_ventricle));
        write(SAG, encode_vectors(&sag.subject_from_atlas.displacement_mm()));
        write(TO_TEMPLATE, encode_vectors(&template.atlas_from_subject.displacement_mm()));
        write("anat/pre_space-native_desc-brain_mask.nii.gz", encode_mask(&before.brain));
        write("anat/pre_space-native_dseg.nii.gz", encode_u8(&before.labels));
        write("anat/post_space-native_desc-brain_mask.nii.gz", encode_mask(&after.brain));
        let native_cavity = match &own.cavity {
            Some((GivenMask::Post(mask), _)) => mask.clone(),
            _ => mask_on(&found.cavity, &scans.post.grid, &mni_from_post),
        };
        let native_resected = match &own.resected {
            Some((GivenMask::Pre(mask), _)) => mask.clone(),
            _ => mask_on(&found.resected, &scans.pre.grid, &mni_from_pre),
        };
        write("anat/post_space-native_label-cavity_mask.nii.gz", encode_mask(&native_cavity));
        write("anat/pre_space-native_label-resected_mask.nii.gz", encode_mask(&native_resected));
        bar.finish_and_clear();

        produced.warnings.extend(before.warnings.iter().map(|w| format!("pre: {w}")));
        produced.warnings.extend(after.warnings.iter().map(|w| format!("post: {w}")));
        let spacing = scans.pre.grid.spacing_mm().into_iter().chain(scans.post.grid.spacing_mm());
        produced.facts = facts(&AnatFacts {
            volumes: ResectionVolumes {
                cavity_cc: Some(native_cavity.volume_cc()),
                resected_cc: Some(native_resected.volume_cc()),
                ventricle_before_cc: Some(before.volumes.ventricle_cc),
                ventricle_after_cc: Some(post_ventricle.volume_cc()),
                brain_cc: Some(before.volumes.brain_cc),
                midline_shift_mm: midline_shift_mm(&sag.subject_from_atlas, &template.atlas_from_subject),
            },
            side: found.side,
            coarsest_voxel_mm: spacing.fold(0.0, f64::max),
        })?;
        Ok(produced)
    })
}

/// Intensities as 16-bit whole numbers, scaled so that the brightest keeps three digits.
fn whole_numbers(volume: &Volume<f32, Mni>) -> Volume<i16, Mni> {
    let highest = volume.data.iter().copied().fold(0.0f32, f32::max);
    let scale = if (500.0..32000.0).contains(&highest) { 1.0 } else { 4000.0 / highest.max(1e-6) };
    volume.map(|x| (x * scale).round().clamp(0.0, 32000.0) as i16)
}
