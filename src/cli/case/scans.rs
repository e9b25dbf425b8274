//! The files a user gives: two scans and masks of their own.

use super::{Failure, Reject, shown};
use crate::artefact::sha256_hex;
use crate::cli::Session;
use crate::cli::session::read_input;
use crate::geometry::{Mni, Native, Post, Pre, RigidTransform};
use crate::image::nifti;
use crate::image::{Grid, Mask, Volume};
use crate::segment::native::mask_on;
use anyhow::anyhow;
use std::path::{Path, PathBuf};

/// Masks that win over the computed ones. Each may be in the grid of either scan.
#[derive(Clone, Debug, Default, clap::Args)]
#[allow(clippy::struct_field_names, reason = "the options' names")]
pub struct Overrides {
    /// A brain mask of your own, in the pre-operative scan's grid (wins over the computed one)
    #[arg(long, value_name = "FILE")]
    pub brain_mask: Option<PathBuf>,
    /// A mask of the lateral and third ventricles before the operation, in the grid of either scan (wins over the computed one)
    #[arg(long, value_name = "FILE")]
    pub ventricle_mask: Option<PathBuf>,
    /// A mask of the cavity, in the grid of either scan (wins over the computed one)
    #[arg(long, value_name = "FILE")]
    pub cavity_mask: Option<PathBuf>,
    /// A mask of the resected tissue, in the grid of either scan (wins over the computed one)
    #[arg(long, value_name = "FILE")]
    pub resected_mask: Option<PathBuf>,
}

/// Checksums of the two files.
#[derive(Clone, Debug)]
pub struct ScanSums {
    /// Of the pre-operative file.
    pub pre: String,
    /// Of the post-operative file.
    pub post: String,
}

/// The two scans.
#[derive(Debug)]
pub struct Scans {
    /// Checksums of the files.
    pub sums: ScanSums,
    /// The pre-operative scan.
    pub pre: Volume<f32, Pre>,
    /// The post-operative scan.
    pub post: Volume<f32, Post>,
    /// What the reader noticed.
    pub warnings: Vec<String>,
}

impl Scans {
    /// Reads both scans.
    ///
    /// # Errors
    /// Rejected with file, field and remedy; also when both files are the same.
    pub fn read(pre: &Path, post: &Path, session: &Session) -> Result<Self, Failure> {
        let options = session.reading()?;
        let (pre_bytes, post_bytes) = (read_input(pre)?, read_input(post)?);
        if pre_bytes == post_bytes {
            return Err(Failure::Rejected(anyhow!(
                "{} and {}: the two files are the same; give the pre-operative scan first, the post-operative second",
                pre.display(),
                post.display()
            )));
        }
        let before = nifti::decode(&pre_bytes, &format!("pre-operative scan {}", shown(pre)), &options).reject()?;
        let after = nifti::decode(&post_bytes, &format!("post-operative scan {}", shown(post)), &options).reject()?;
        if before.volume == after.volume {
            return Err(Failure::Rejected(anyhow!(
                "{} and {}: the two scans have the same voxels; the post-operative one must show the surgery: give \
                 another file",
                pre.display(),
                post.display()
            )));
        }
        let mut warnings: Vec<String> = before.warnings.iter().map(|w| format!("pre: {w}")).collect();
        warnings.extend(after.warnings.iter().map(|w| format!("post: {w}")));
        let (pre, post) = (before.volume.relabelled(), after.volume.relabelled());
        let sums = ScanSums { pre: sha256_hex(&pre_bytes), post: sha256_hex(&post_bytes) };
        Ok(Self { sums, pre, post, warnings })
    }
}

/// The user's own masks with the bytes of their files.
#[derive(Debug)]
pub struct OwnMasks {
    /// The brain.
    pub brain: Option<(GivenMask, Vec<u8>)>,
    /// Lateral and third ventricles.
    pub ventricle: Option<(GivenMask, Vec<u8>)>,
    /// The cavity.
    pub cavity: Option<(GivenMask, Vec<u8>)>,
    /// The resected tissue.
    pub resected: Option<(GivenMask, Vec<u8>)>,
}

impl OwnMasks {
    /// Reads those that were given. Comes before any stage: a mask that fits neither scan leaves nothing behind.
    ///
    /// # Errors
    /// Rejected when one is on neither scan's grid, empty, or not a mask.
    pub fn read(overrides: &Overrides, scans: &Scans, session: &Session) -> Result<Self, Failure> {
        let read = |option: &str, path: &Option<PathBuf>| {
            path.as_deref().map(|path| given_mask(option, path, scans, session)).transpose()
        };
        Ok(Self {
            brain: read("--brain-mask", &overrides.brain_mask)?,
            ventricle: read("--ventricle-mask", &overrides.ventricle_mask)?,
            cavity: read("--cavity-mask", &overrides.cavity_mask)?,
            resected: read("--resected-mask", &overrides.resected_mask)?,
        })
    }
}

/// A mask in the frame of the scan whose grid it has.
#[derive(Debug)]
pub enum GivenMask {
    /// On the pre-operative grid.
    Pre(Mask<Pre>),
    /// On the post-operative grid.
    Post(Mask<Post>),
}

/// Reads a mask and finds whose grid it is on.
fn given_mask(option: &str, path: &Path, scans: &Scans, session: &Session) -> Result<(GivenMask, Vec<u8>), Failure> {
    // Half a voxel is what two programs may disagree about an origin; more is another grid.
    const TOLERANCE_MM: f64 = 0.1;
    let options = session.reading()?;
    let bytes = read_input(path)?;
    let name = format!("{option} {}", shown(path));
    let (mask, odd): (Mask<Native>, _) = nifti::decode_mask(&bytes, &name, &options).reject()?;
    let pre: Grid<Native> = scans.pre.grid.relabelled();
    let post: Grid<Native> = scans.post.grid.relabelled();
    let given = if mask.grid.coincides(&pre, TOLERANCE_MM) {
        GivenMask::Pre(mask.relabelled())
    } else if mask.grid.coincides(&post, TOLERANCE_MM) {
        GivenMask::Post(mask.relabelled())
    } else {
        let size = |d: [usize; 3]| format!("{} x {} x {}", d[0], d[1], d[2]);
        let same = [pre.dims, post.dims].contains(&mask.grid.dims);
        return Err(Failure::Rejected(anyhow!(
            "{name}: its grid ({} voxels) is that of neither scan (pre-operative {}, post-operative {}){}; resample \
             the mask onto one of them",
            size(mask.grid.dims),
            size(pre.dims),
            size(post.dims),
            if same { ": it lies elsewhere" } else { "" }
        )));
    };
    for warning in odd {
        tracing::warn!("{name}: {warning}");
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
