//! The header of NIfTI-1 and NIfTI-2 files in either byte order.
//!
//! Offsets are those of nifti1.h (Cox, Ashburner et al. 2004) and nifti2.h (2011). The `nifti` crate reads NIfTI-1
//! only, so both headers are read here and the crate is given the voxels.

use super::error::NiftiProblem;
use nifti::{Endianness, NiftiType};

/// Bytes enough for either header.
pub(super) const HEADER_BYTES: usize = 540;

/// More voxels than this are no head scan (0.4 mm voxels of a whole head are 2e8).
const MOST_VOXELS: u64 = 1 << 28;

/// The fields that matter, not yet believed.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub endianness: Endianness,
    pub dim: [i64; 8],
    pub intent: i32,
    pub datatype: i32,
    pub bitpix: i32,
    pub pixdim: [f64; 8],
    pub vox_offset: f64,
    pub scl_slope: f64,
    pub scl_inter: f64,
    pub xyzt_units: i32,
    pub qform_code: i32,
    pub sform_code: i32,
    pub quatern: [f64; 3],
    pub qoffset: [f64; 3],
    pub srow: [[f64; 4]; 3],
    /// 348 or 540.
    pub size: usize,
}

/// Numbers at places of a byte slice, in one byte order. Places are below the length by construction.
struct Fields<'a> {
    bytes: &'a [u8],
    little: bool,
}

impl Fields<'_> {
    fn raw<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut raw = [0; N];
        raw.copy_from_slice(&self.bytes[at..at + N]);
        if !self.little {
            raw.reverse();
        }
        raw
    }
    fn i16(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.raw(at))
    }
    fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.raw(at))
    }
    fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.raw(at))
    }
    fn f32(&self, at: usize) -> f64 {
        f64::from(f32::from_le_bytes(self.raw(at)))
    }
    fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.raw(at))
    }
}

impl Header {
    /// Reads the fields from the first bytes of an (unpacked) file.
    pub fn parse(bytes: &[u8]) -> Result<Self, NiftiProblem> {
        if bytes.len() < 348 {
            return Err(if looks_like(bytes).is_some() { not_nifti(bytes) } else { too_short(bytes) });
        }
        let size_at = |little| Fields { bytes, little }.i32(0);
        let (little, size) = match (size_at(true), size_at(false)) {
            (348, _) => (true, 348),
            (_, 348) => (false, 348),
            (540, _) => (true, 540),
            (_, 540) => (false, 540),
            _ => return Err(not_nifti(bytes)),
        };
        if bytes.len() < size {
            return Err(too_short(bytes));
        }
        let fields = Fields { bytes, little };
        let endianness = if little { Endianness::Little } else { Endianness::Big };
        if size == 348 { Self::version_1(&fields, endianness) } else { Self::version_2(&fields, endianness) }
    }

    fn version_1(f: &Fields, endianness: Endianness) -> Result<Self, NiftiProblem> {
        let magic = &f.bytes[344..348];
        if magic != b"n+1\0" {
            return Err(NiftiProblem::Magic {
                found: printable(magic),
                hint: match magic {
                    b"ni1\0" => {
                        "this is the .hdr half of a header/image pair; join the two into one .nii file (fslchfiletype NIFTI_GZ, or load and save with nibabel)"
                    }
                    [0, 0, 0, 0] => {
                        "this looks like an Analyze 7.5 header, which holds no orientation; convert the original DICOM with dcm2niix"
                    }
                    _ => "a NIfTI-1 file has n+1 there; the header is damaged, export the file again",
                },
            });
        }
        Ok(Self {
            endianness,
            dim: std::array::from_fn(|n| i64::from(f.i16(40 + 2 * n))),
            intent: i32::from(f.i16(68)),
            datatype: i32::from(f.i16(70)),
            bitpix: i32::from(f.i16(72)),
            pixdim: std::array::from_fn(|n| f.f32(76 + 4 * n)),
            vox_offset: f.f32(108),
            scl_slope: f.f32(112),
            scl_inter: f.f32(116),
            xyzt_units: i32::from(f.bytes[123]),
            qform_code: i32::from(f.i16(252)),
            sform_code: i32::from(f.i16(254)),
            quatern: std::array::from_fn(|n| f.f32(256 + 4 * n)),
            qoffset: std::array::from_fn(|n| f.f32(268 + 4 * n)),
            srow: std::array::from_fn(|r| std::array::from_fn(|c| f.f32(280 + 16 * r + 4 * c))),
            size: 348,
        })
    }

    fn version_2(f: &Fields, endianness: Endianness) -> Result<Self, NiftiProblem> {
        let magic = &f.bytes[4..12];
        if magic != b"n+2\0\r\n\x1a\n" {
            return Err(NiftiProblem::Magic {
                found: printable(magic),
                hint: if magic.starts_with(b"ni2") {
                    "this is the .hdr half of a header/image pair; join the two into one .nii file (load and save with nibabel)"
                } else {
                    "a NIfTI-2 file has n+2 and a line-end check there; the file was damaged (a text-mode transfer does this), copy it again"
                },
            });
        }
        Ok(Self {
            endianness,
            dim: std::array::from_fn(|n| f.i64(16 + 8 * n)),
            intent: f.i32(504),
            datatype: i32::from(f.i16(12)),
            bitpix: i32::from(f.i16(14)),
            pixdim: std::array::from_fn(|n| f.f64(104 + 8 * n)),
            vox_offset: f.i64(168) as f64,
            scl_slope: f.f64(176),
            scl_inter: f.f64(184),
            xyzt_units: f.i32(500),
            qform_code: f.i32(344),
            sform_code: f.i32(348),
            quatern: std::array::from_fn(|n| f.f64(352 + 8 * n)),
            qoffset: std::array::from_fn(|n| f.f64(376 + 8 * n)),
            srow: std::array::from_fn(|r| std::array::from_fn(|c| f.f64(400 + 32 * r + 8 * c))),
            size: 540,
        })
    }
}

/// Where the chosen volume's voxels lie in the file and what they are, checked.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub dims: [usize; 3],
    pub kind: NiftiType,
    /// First byte of the chosen volume.
    pub first: u64,
    /// Bytes of the chosen volume.
    pub bytes: u64,
    /// One past the last byte of all volumes.
    pub end: u64,
}

impl Header {
    /// Checks dimensions, data type and offset, and picks the volume. `volume` counts from 0.
    pub fn layout(&self, volume: Option<usize>) -> Result<Layout, NiftiProblem> {
        let kind = real_type(self.datatype)?;
        let refuse = |rule: String| NiftiProblem::Dimensions { dim: self.dim, rule };
        if !(1..=7).contains(&self.dim[0]) {
            return Err(refuse(format!("dim[0], the number of dimensions, is {} and must lie in 1 to 7", self.dim[0])));
        }
        let used = self.dim[0] as usize;
        // Dimensions beyond dim[0] are undefined in the file and mean 1.
        let size = |n: usize| if n <= used { self.dim[n] } else { 1 };
        let mut dims = [0; 3];
        let mut voxels = 1u64;
        for a in 0..3 {
            let n = size(a + 1);
            if !(2..=65535).contains(&n) {
                return Err(refuse(format!("dim[{}] is {n}, a volume needs 2 to 65535 voxels along each axis", a + 1)));
            }
            dims[a] = n as usize;
            voxels *= n as u64;
        }
        if voxels > MOST_VOXELS {
            return Err(refuse(format!("{voxels} voxels are more than the {MOST_VOXELS} that are read")));
        }
        let mut volumes = 1u64;
        for n in 4..8 {
            let count = size(n);
            if !(1..=1 << 20).contains(&count) {
                return Err(refuse(format!("dim[{n}] is {count} and must be at least 1")));
            }
            volumes = volumes.saturating_mul(count as u64);
        }
        let chosen = match volume {
            None if volumes > 1 => return Err(NiftiProblem::SeveralVolumes { volumes }),
            None => 0,
            // Beside a file of several, one of a single volume leaves nothing to choose.
            Some(_) if volumes == 1 => 0,
            Some(n) if n as u64 >= volumes => return Err(NiftiProblem::NoSuchVolume { chosen: n as u64, volumes }),
            Some(n) => n as u64,
        };
        // An offset of 0 in a single file is a known slip of writers and can only mean "right after the header".
        let least = self.size as u64;
        let offset = if self.vox_offset == 0.0 { least as f64 + 4.0 } else { self.vox_offset };
        if !(offset >= least as f64 && offset <= 1e15 && offset.fract() == 0.0) {
            return Err(NiftiProblem::VoxelOffset { value: self.vox_offset, least });
        }
        let bytes = voxels * kind.size_of() as u64;
        let too_many = || refuse(format!("{volumes} volumes of {bytes} bytes are more than a file can hold"));
        let end = bytes.checked_mul(volumes).and_then(|all| all.checked_add(offset as u64)).ok_or_else(too_many)?;
        Ok(Layout { dims, kind, first: offset as u64 + chosen * bytes, bytes, end })
    }

    /// Slope and intercept, (1, 0) where the header asks for none (slope 0 means that).
    pub fn scaling(&self) -> Result<(f64, f64), NiftiProblem> {
        if self.scl_slope == 0.0 {
            return Ok((1.0, 0.0));
        }
        for (field, value) in [("scl_slope", self.scl_slope), ("scl_inter", self.scl_inter)] {
            if !value.is_finite() {
                return Err(NiftiProblem::Scaling { field, value });
            }
        }
        Ok((self.scl_slope, self.scl_inter))
    }
}

fn real_type(code: i32) -> Result<NiftiType, NiftiProblem> {
    let colour = "give a grey-scale T1 (one number per voxel), not a screenshot or a colour overlay";
    let complex = "give the magnitude image";
    let (kind, remedy) = match code {
        2 => return Ok(NiftiType::Uint8),
        4 => return Ok(NiftiType::Int16),
        8 => return Ok(NiftiType::Int32),
        16 => return Ok(NiftiType::Float32),
        64 => return Ok(NiftiType::Float64),
        256 => return Ok(NiftiType::Int8),
        512 => return Ok(NiftiType::Uint16),
        768 => return Ok(NiftiType::Uint32),
        1024 => return Ok(NiftiType::Int64),
        1280 => return Ok(NiftiType::Uint64),
        1 => ("one bit per voxel", "save it with 8 bits per voxel"),
        32 => ("complex64", complex),
        1792 => ("complex128", complex),
        2048 => ("complex256", complex),
        128 => ("RGB24", colour),
        2304 => ("RGBA32", colour),
        1536 => ("float128", "save it as float32"),
        0 => ("unknown", "the header does not say what a voxel is; export the file again"),
        _ => ("not a NIfTI code", "the header is damaged; export the file again"),
    };
    Err(NiftiProblem::DataType { code, kind, remedy })
}

fn printable(magic: &[u8]) -> String {
    magic.iter().map(|&b| if b.is_ascii_graphic() { char::from(b) } else { '.' }).collect()
}

fn too_short(bytes: &[u8]) -> NiftiProblem {
    NiftiProblem::TooShort { bytes: bytes.len() }
}

fn not_nifti(bytes: &[u8]) -> NiftiProblem {
    let mut found = [0; 4];
    found.copy_from_slice(&bytes[..4]);
    NiftiProblem::NotNifti {
        found: i32::from_le_bytes(found),
        hint: looks_like(bytes).unwrap_or("this is no NIfTI file; convert the scan with dcm2niix"),
    }
}

/// A guess at what a file that is no NIfTI file is. Needs four bytes.
fn looks_like(bytes: &[u8]) -> Option<&'static str> {
    if bytes.get(128..132) == Some(b"DICM") {
        return Some("this is a DICOM file; convert the series with dcm2niix");
    }
    [
        (&b"NRRD"[..], "this is an NRRD file; save it as NIfTI (3D Slicer does)"),
        (b"version https://git-lfs", "this is a Git LFS pointer, not the image; run `git lfs pull`"),
        (b"/annex/", "this is a git-annex pointer, not the image; run `git annex get`"),
        (b"PK\x03\x04", "this is a ZIP archive; unpack it first"),
        (b"\x89PNG", "this is a PNG picture; give the volume it was made from"),
        (b"<", "this is a web page or XML file, not an image; download it again"),
    ]
    .into_iter()
    .find(|(start, _)| bytes.len() >= 4 && bytes.starts_with(start))
    .map(|(_, hint)| hint)
}
