//! Why a NIfTI file is refused: always the file, the field and the remedy.

use thiserror::Error;

/// A refused file.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{file}: {problem}")]
pub struct NiftiError {
    /// The name the caller knows the file by.
    pub file: String,
    /// What is wrong with it.
    pub problem: NiftiProblem,
}

/// What is wrong with a file, the header field it is wrong in, and what to do about it.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum NiftiProblem {
    /// The name does not end as a NIfTI file does.
    #[error("file name: only .nii, .nii.gz, .mgz and .mgh are read; {hint}")]
    Extension {
        /// How to convert what the name suggests.
        hint: &'static str,
    },
    /// Numbers are missing within the image.
    #[error(
        "voxels: {cc:.1} cc within the image are NaN or infinite, so that nothing is known of what lies there; export the scan again \
         without masking or resampling it"
    )]
    Hole {
        /// Their volume.
        cc: f64,
    },
    /// Too short to hold any header.
    #[error("sizeof_hdr: the file holds {bytes} bytes, a NIfTI header needs 348; copy or export the file again")]
    TooShort {
        /// Bytes found (after decompression).
        bytes: usize,
    },
    /// Not a NIfTI file at all.
    #[error("sizeof_hdr is {found}, not 348 (NIfTI-1) or 540 (NIfTI-2): {hint}")]
    NotNifti {
        /// The first four bytes as a number.
        found: i32,
        /// What the content looks like and how to convert it.
        hint: &'static str,
    },
    /// The header has the right size and another magic.
    #[error("magic is {found:?}: {hint}")]
    Magic {
        /// The magic bytes, printable.
        found: String,
        /// What that means and how to convert it.
        hint: &'static str,
    },
    /// The gzip stream is damaged.
    #[error("gzip stream: {reason}; the file was damaged in storage or transfer, copy or export it again")]
    Gzip {
        /// The decoder's words.
        reason: String,
    },
    /// Fewer bytes than the header declares.
    #[error(
        "dim and datatype declare {declared} bytes of header and voxels, the file holds {found}: it is truncated; copy \
         or export it again"
    )]
    Truncated {
        /// Bytes up to the last voxel.
        declared: u64,
        /// Bytes there are, or an upper bound for a compressed file that was not unpacked for that reason.
        found: u64,
    },
    /// A great deal more than the header declares.
    #[error(
        "dim and datatype declare {declared} bytes, the file goes on beyond {found}: the header does not belong to \
         this data; export it again"
    )]
    TooLong {
        /// Bytes up to the last voxel.
        declared: u64,
        /// Bytes read when it was given up.
        found: u64,
    },
    /// Dimensions that no volume has.
    #[error("dim is {dim:?}: {rule}; export the file again as one three-dimensional volume")]
    Dimensions {
        /// `dim[0..8]`.
        dim: [i64; 8],
        /// The rule broken.
        rule: String,
    },
    /// Several volumes and no choice.
    #[error("dim: the file holds {volumes} volumes; choose one (0 to {})", .volumes - 1)]
    SeveralVolumes {
        /// Number of volumes.
        volumes: u64,
    },
    /// The chosen volume does not exist.
    #[error("dim: volume {chosen} was asked for and the file holds {volumes}, counted from 0; choose 0 to {}", .volumes - 1)]
    NoSuchVolume {
        /// The volume asked for.
        chosen: u64,
        /// Number of volumes.
        volumes: u64,
    },
    /// Voxels that are not one real number each.
    #[error("datatype is {code} ({kind}): {remedy}")]
    DataType {
        /// The NIfTI code.
        code: i32,
        /// Its name.
        kind: &'static str,
        /// What to do.
        remedy: &'static str,
    },
    /// Intensity scaling that is not a number.
    #[error(
        "{field} is {value}: intensities cannot be scaled by it; set scl_slope to 1 and scl_inter to 0, or export again"
    )]
    Scaling {
        /// `scl_slope` or `scl_inter`.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// Where the voxels begin makes no sense.
    #[error("vox_offset is {value}: voxels must begin at or after byte {least}; export the file again")]
    VoxelOffset {
        /// The value found.
        value: f64,
        /// The least that the header's own size allows.
        least: u64,
    },
    /// A voxel size outside of what a head scan has.
    #[error(
        "{field}: voxel size along {axis} is {value} mm, it must lie between 0.01 and 10 mm; correct the header or export \
         the scan again"
    )]
    Spacing {
        /// `pixdim` or the affine it comes from.
        field: &'static str,
        /// i, j or k.
        axis: char,
        /// The size.
        value: f64,
    },
    /// Nothing says where the patient's left is.
    #[error(
        "qform_code and sform_code are both 0: the orientation is not known and left could be taken for right; convert the \
         original DICOM again (dcm2niix) or set the orientation you are sure of"
    )]
    NoOrientation,
    /// sform and qform put the voxels at different places.
    #[error(
        "sform and qform disagree by up to {difference_mm:.3} mm (allowed: {allowed_mm:.3} mm): choose the one you trust"
    )]
    OrientationsDisagree {
        /// Largest distance between the two positions of a corner.
        difference_mm: f64,
        /// Half the smallest voxel size.
        allowed_mm: f64,
    },
    /// The affine is not finite or cannot be inverted.
    #[error("{field}: the affine is {state}; correct the header or convert the original DICOM again")]
    Affine {
        /// `srow_x/y/z` or `quatern_b/c/d`.
        field: &'static str,
        /// What is wrong.
        state: String,
    },
    /// All voxels equal.
    #[error("voxels: every voxel is {value}: there is no image; export the scan again")]
    Constant {
        /// The one value.
        value: f32,
    },
    /// A label map holds something else than small integers.
    #[error("voxels: {count} values are not whole numbers from 0 to 255, the first is {first}; give a label map")]
    NotLabels {
        /// How many.
        count: usize,
        /// The first of them.
        first: f32,
    },
    /// A label map holds something else than whole numbers.
    #[error("voxels: {count} values are not whole numbers from 0 to 16777216, the first is {first}; give a label map")]
    NotCodes {
        /// How many.
        count: usize,
        /// The first of them.
        first: f32,
    },
    /// A label map where a mask is wanted.
    #[error(
        "voxels: it holds several whole numbers ({}) besides 0, so it is a label map and no mask; make a mask of the label \
         you mean (one number, 0 elsewhere), or give it as a label map",
        .numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
    )]
    NotMask {
        /// The first of them, ascending.
        numbers: Vec<i64>,
    },
    /// Named as FreeSurfer's and something else.
    #[error(
        "MGH header: version is {version} and must be 1 ({bytes} bytes were looked at, a header has 284): this is no .mgz or \
         .mgh file, or it is damaged; copy or export it again"
    )]
    NotMgh {
        /// Bytes looked at.
        bytes: usize,
        /// The first number.
        version: i32,
    },
    /// FreeSurfer's file without orientation.
    #[error(
        "goodRASFlag is not 1: the orientation is not known and left could be taken for right; convert the original scan \
         again with mri_convert"
    )]
    NoRas,
    /// A mask without a voxel inside.
    #[error("voxels: the mask is empty (every voxel is 0); draw it, or leave the option out")]
    EmptyMask,
}
