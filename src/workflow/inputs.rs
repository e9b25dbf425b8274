//! The files a user gives: two scans and masks of their own.

use super::error::{AskedError, InputError, LabelMapError, MaskRole, WorkflowError};
use super::labels::labels_of_tool;
use super::user_file::{read_input, read_text, shown};
use super::warning::{Warning, all_of};
use super::work::Work;
use crate::artefact::{Manifest, Stage, sha256_hex};
use crate::geometry::{Mni, Native, Post, Pre, RigidTransform};
use crate::image::nifti::{self, ReadOptions, encode_u8};
use crate::image::{Grid, LabelMap, Mask, Volume};
use crate::register::transform_text::rigid_from_text;
use crate::segment::disagreement;
use crate::segment::native::mask_on;
use std::path::{Path, PathBuf};

/// A pair of scans, and masks that win over the computed ones.
#[derive(Clone, Debug, Default)]
pub struct Inputs {
    /// The pre-operative T1 (NIfTI).
    pub pre: PathBuf,
    /// The post-operative T1.
    pub post: PathBuf,
    /// A label map of the pre-operative scan, as another tool wrote it: wins over the computed labels.
    pub dseg: Option<PathBuf>,
    /// Whose numbers it holds: a built-in table or a .tsv file; `None` finds out.
    pub labels: Option<String>,
    /// The pose of the pre-operative scan in the MNI frame by hand: a rigid transform as 4x4 text (RAS, mm, maps a point of the
    /// scan) or ITK's.
    pub pose: Option<PathBuf>,
    /// The same, roughly: the pose is looked for from there.
    pub pose_start: Option<PathBuf>,
    /// The brain, in the pre-operative scan's grid.
    pub brain_mask: Option<PathBuf>,
    /// Lateral and third ventricles before the operation, in the grid of either scan.
    pub ventricle_mask: Option<PathBuf>,
    /// The cavity, in the grid of either scan.
    pub cavity_mask: Option<PathBuf>,
    /// The resected tissue, in the grid of either scan.
    pub resected_mask: Option<PathBuf>,
    /// The folder of a prediction of this pre-operative scan: what it has made of the scan is taken from it.
    pub prediction: Option<PathBuf>,
}

impl Inputs {
    /// Two scans and nothing else.
    pub fn pair(pre: impl Into<PathBuf>, post: impl Into<PathBuf>) -> Self {
        Self { pre: pre.into(), post: post.into(), ..Self::default() }
    }

    /// The files among them.
    pub(crate) fn files(&self) -> Vec<&Path> {
        let own = [&self.dseg, &self.pose, &self.pose_start, &self.brain_mask, &self.ventricle_mask];
        let drawn = [&self.cavity_mask, &self.resected_mask];
        let scans = [&self.pre, &self.post];
        scans.into_iter().chain(own.into_iter().chain(drawn).flatten()).map(PathBuf::as_path).collect()
    }
}

/// How far apart two programs may write one voxel of one grid.
const TOLERANCE_MM: f64 = 0.2;

/// A mask on the grid of an image; what is odd about it is added to the warnings.
///
/// # Errors
/// A file that is no mask, or one on another grid.
pub fn read_mask_of(
    path: &Path,
    grid: &Grid<Native>,
    options: &ReadOptions,
    warnings: &mut Vec<Warning>,
) -> Result<Mask<Native>, WorkflowError> {
    let name = path.display().to_string();
    let (mask, odd) = nifti::decode_mask(&read_input(path)?, &name, options)?;
    if !mask.grid.coincides(grid, TOLERANCE_MM) {
        let (path, found, image) = (path.to_path_buf(), mask.grid.dims, grid.dims);
        return Err(InputError::ImageGrid { path, found, image }.into());
    }
    // Warnings are kept in the case, where no folder's name belongs.
    warnings.extend(all_of(&shown(path), &odd));
    Ok(mask)
}

/// Checksums of the two scans' files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScanSums {
    /// Of the pre-operative file.
    pub pre: String,
    /// Of the post-operative file.
    pub post: String,
}

/// The two scans.
#[derive(Debug)]
pub(crate) struct Scans {
    /// Checksums of the files.
    pub sums: ScanSums,
    /// The pre-operative scan.
    pub pre: Volume<f32, Pre>,
    /// The post-operative scan.
    pub post: Volume<f32, Post>,
    /// What the reader noticed.
    pub warnings: Vec<Warning>,
}

impl Scans {
    /// Reads both scans.
    pub fn read(inputs: &Inputs, options: &ReadOptions) -> Result<Self, WorkflowError> {
        let (pre, post) = (&inputs.pre, &inputs.post);
        let (pre_bytes, post_bytes) = (read_input(pre)?, read_input(post)?);
        if pre_bytes == post_bytes {
            return Err(InputError::SameFile { pre: pre.clone(), post: post.clone() }.into());
        }
        let (before, after) = rayon::join(
            || nifti::decode_scan(&pre_bytes, &format!("pre-operative scan {}", shown(pre)), options),
            || nifti::decode_scan(&post_bytes, &format!("post-operative scan {}", shown(post)), options),
        );
        let (before, after) = (before?, after?);
        if before.volume == after.volume {
            return Err(InputError::SameVoxels { pre: pre.clone(), post: post.clone() }.into());
        }
        let warnings = all_of("pre", &before.warnings).chain(all_of("post", &after.warnings)).collect();
        let (pre, post) = (before.volume.relabelled(), after.volume.relabelled());
        let sums = ScanSums { pre: sha256_hex(&pre_bytes), post: sha256_hex(&post_bytes) };
        Ok(Self { sums, pre, post, warnings })
    }
}

/// Where the pre-operative scan lies in the MNI frame, as a hand has laid it, with the bytes of its file.
#[derive(Clone, Debug)]
pub(crate) struct HandPose {
    pub mni_from_pre: RigidTransform<Pre, Mni>,
    /// It is where the search begins, and not its end.
    pub start: bool,
    bytes: Vec<u8>,
}

impl HandPose {
    /// Reads the one that was given.
    pub fn read(pose: Option<&Path>, start: Option<&Path>, dseg: Option<&Path>) -> Result<Option<Self>, WorkflowError> {
        let (path, start) = match (pose, start) {
            (Some(_), Some(_)) => return Err(AskedError::PoseAndStart.into()),
            (None, Some(_)) if dseg.is_some() => return Err(AskedError::StartBesideLabels.into()),
            (Some(pose), None) => (pose, false),
            (None, Some(start)) => (start, true),
            (None, None) => return Ok(None),
        };
        let text = read_text(path)?;
        Ok(Some(Self { mni_from_pre: rigid_from_text(&text, &shown(path))?, start, bytes: text.into_bytes() }))
    }

    /// What it is, and its file.
    pub fn given(&self) -> (MaskRole, &[u8]) {
        (if self.start { MaskRole::PoseStart } else { MaskRole::Pose }, &self.bytes)
    }
}

/// The user's own masks with the bytes of their files.
#[derive(Debug)]
pub(crate) struct OwnMasks {
    pub pose: Option<HandPose>,
    pub labels: Option<(LabelMap<Pre>, Vec<u8>)>,
    pub brain: Option<(GivenMask, Vec<u8>)>,
    pub ventricle: Option<(GivenMask, Vec<u8>)>,
    pub cavity: Option<(GivenMask, Vec<u8>)>,
    pub resected: Option<(GivenMask, Vec<u8>)>,
}

impl OwnMasks {
    /// Reads those that were given. Comes before any stage: a mask that fits neither scan leaves nothing behind.
    pub fn read(inputs: &Inputs, scans: &Scans, work: &Work<'_>) -> Result<Self, WorkflowError> {
        let read = |role: MaskRole, path: &Option<PathBuf>| {
            path.as_deref().map(|path| given_mask(role, path, scans, work)).transpose()
        };
        labels_alone(inputs.dseg.as_deref(), [&inputs.brain_mask, &inputs.ventricle_mask])?;
        let labels = inputs.dseg.as_deref().map(|path| given_labels(path, inputs.labels.as_deref(), &scans.pre, work));
        Ok(Self {
            pose: HandPose::read(inputs.pose.as_deref(), inputs.pose_start.as_deref(), inputs.dseg.as_deref())?,
            labels: labels.transpose()?,
            brain: read(MaskRole::Brain, &inputs.brain_mask)?,
            ventricle: read(MaskRole::Ventricle, &inputs.ventricle_mask)?,
            cavity: read(MaskRole::Cavity, &inputs.cavity_mask)?,
            resected: read(MaskRole::Resected, &inputs.resected_mask)?,
        })
    }

    /// What says where the pre-operative scan lies, by role.
    pub fn posing(&self) -> impl Iterator<Item = (MaskRole, &[u8])> {
        let pose = self.pose.as_ref().map(HandPose::given);
        pose.into_iter().chain(self.labels.as_ref().map(|(_, bytes)| (MaskRole::Labels, bytes.as_slice())))
    }

    /// Those that were given, by role.
    pub fn given(&self) -> impl Iterator<Item = (MaskRole, &[u8])> {
        let masks = [
            (MaskRole::Brain, &self.brain),
            (MaskRole::Ventricle, &self.ventricle),
            (MaskRole::Cavity, &self.cavity),
            (MaskRole::Resected, &self.resected),
        ];
        let masks =
            masks.into_iter().filter_map(|(role, mask)| mask.as_ref().map(|(_, bytes)| (role, bytes.as_slice())));
        masks.chain(self.labels.as_ref().map(|(_, bytes)| (MaskRole::Labels, bytes.as_slice())))
    }
}

/// The stage with the files of the user's own that it was made with before: masks, a label map, a pose or where to look for it.
pub(crate) fn with_own_masks_of(stage: Stage, earlier: &Manifest) -> Stage {
    stage.inputs_of(earlier, |input| MaskRole::ALL.iter().any(|role| role.to_string() == input))
}

/// Refuses masks of brain and ventricles beside a label map that says both.
pub(super) fn labels_alone(dseg: Option<&Path>, [brain, ventricle]: [&Option<PathBuf>; 2]) -> Result<(), InputError> {
    let mut beside = [(MaskRole::Brain, brain), (MaskRole::Ventricle, ventricle)].into_iter();
    match beside.find(|(_, mask)| mask.is_some()).filter(|_| dseg.is_some()) {
        Some((role, _)) => Err(InputError::BesideLabels { role }),
        None => Ok(()),
    }
}

/// Reads a label map of the pre-operative scan. Another grid in the scanner's coordinates will do: FreeSurfer and SynthSeg
/// write their own.
pub(super) fn given_labels(
    path: &Path,
    whose: Option<&str>,
    pre: &Volume<f32, Pre>,
    work: &Work<'_>,
) -> Result<(LabelMap<Pre>, Vec<u8>), WorkflowError> {
    /// A map of this scan lies in its field of view, but for a rim.
    const LEAST_PERCENT: f64 = 90.0;
    let labels = work.tell(|p| labels_of_tool(path, whose, &work.settings.image, p))?;
    let labels: LabelMap<Pre> = labels.relabelled();
    let labelled = (0..labels.data.len()).filter(|&n| labels.data[n] > 0).step_by(7);
    let (mut seen, mut all) = (0.0, 0.0);
    for n in labelled {
        let p = labels.grid.position(labels.grid.voxel(n).map(|v| v as f64).into());
        all += 1.0;
        seen += f64::from(u8::from(pre.nearest(p).is_some()));
    }
    let percent = 100.0 * seen / f64::max(all, 1.0);
    if percent < LEAST_PERCENT {
        return Err(LabelMapError::Elsewhere { name: shown(path), percent }.into());
    }
    on_scan(pre, &labels, path)?;
    let bytes = encode_u8(&labels);
    Ok((labels, bytes))
}

/// Refuses a label map that is not the scan's.
pub(super) fn on_scan(scan: &Volume<f32, Pre>, labels: &LabelMap<Pre>, path: &Path) -> Result<(), WorkflowError> {
    match disagreement(scan, labels) {
        Some(source) => Err(LabelMapError::OffScan { name: shown(path), source }.into()),
        None => Ok(()),
    }
}

/// A mask in the frame of the scan whose grid it has.
#[derive(Debug)]
pub(crate) enum GivenMask {
    /// On the pre-operative grid.
    Pre(Mask<Pre>),
    /// On the post-operative grid.
    Post(Mask<Post>),
}

/// Reads a mask and finds whose grid it is on.
fn given_mask(
    role: MaskRole,
    path: &Path,
    scans: &Scans,
    work: &Work<'_>,
) -> Result<(GivenMask, Vec<u8>), WorkflowError> {
    let bytes = read_input(path)?;
    let name = format!("{role} {}", shown(path));
    let (mask, odd): (Mask<Native>, _) = nifti::decode_mask(&bytes, &name, &work.settings.image)?;
    let pre: Grid<Native> = scans.pre.grid.relabelled();
    let post: Grid<Native> = scans.post.grid.relabelled();
    let on = [&pre, &post].map(|grid| mask.grid.coincides(grid, TOLERANCE_MM));
    let lies = role.scan_of(on);
    if let ([true, true], Some(after)) = (on, lies) {
        let which = if after { "post" } else { "pre" };
        work.tell(|p| {
            p.taken_for(&format!("{name}: both scans have its grid; it is taken to lie on the {which}-operative one"));
        });
    }
    let given = if let Some(after) = lies {
        if after { GivenMask::Post(mask.relabelled()) } else { GivenMask::Pre(mask.relabelled()) }
    } else {
        let (found, name) = (mask.grid.dims, shown(path));
        return Err(InputError::MaskGrid { role, name, found, pre: pre.dims, post: post.dims }.into());
    };
    for warning in odd {
        work.tell(|p| p.odd(&name, &warning.to_string()));
    }
    Ok((given, bytes))
}

impl GivenMask {
    /// The mask on the MNI grid.
    pub fn on_mni(
        &self,
        grid: &Grid<Mni>,
        mni_from_pre: &RigidTransform<Pre, Mni>,
        mni_from_post: &RigidTransform<Post, Mni>,
    ) -> Mask<Mni> {
        match self {
            Self::Pre(mask) => mask_on(mask, grid, &mni_from_pre.inverse()),
            Self::Post(mask) => mask_on(mask, grid, &mni_from_post.inverse()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::artefact::{Produced, Reason};
    use std::convert::Infallible;

    #[test]
    fn a_stage_takes_up_every_file_of_the_users_own_and_no_other_scan() {
        let folder = tempfile::tempdir().unwrap();
        let of = |scan: &[u8]| Stage::new("registration", 1, folder.path(), &()).input("pre", scan);
        let given = MaskRole::ALL.iter().fold(of(b"scan"), |stage, role| stage.input(&role.to_string(), b"own"));
        let earlier = given.run(false, || Ok::<_, Infallible>(Produced::default())).unwrap().manifest;
        assert_eq!(with_own_masks_of(of(b"scan"), &earlier).why(), []);
        assert_eq!(with_own_masks_of(of(b"another"), &earlier).why(), [Reason::Input { role: "pre".to_owned() }]);
    }
}
