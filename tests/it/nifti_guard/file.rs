//! A NIfTI file made byte by byte, so that any field can be spoilt.

/// A header and voxels to spoil, written in version 1 or 2 and either byte order.
#[derive(Clone)]
pub struct File {
    pub version: u8,
    pub big: bool,
    pub magic: Vec<u8>,
    pub dim: [i64; 8],
    pub datatype: i16,
    pub bitpix: i16,
    pub pixdim: [f64; 8],
    pub vox_offset: f64,
    pub slope: f64,
    pub inter: f64,
    pub qform_code: i16,
    pub sform_code: i16,
    pub quatern: [f64; 3],
    pub qoffset: [f64; 3],
    pub srow: [[f64; 4]; 3],
    /// Voxels as numbers, stored by `datatype`.
    pub voxels: Vec<f64>,
    pub text: bool,
}

impl File {
    /// 4 x 3 x 2 voxels of 1 x 2 x 3 mm, int16, values 0..24, sform and qform agreeing.
    pub fn sound() -> Self {
        Self {
            version: 1,
            big: false,
            magic: b"n+1\0".to_vec(),
            dim: [3, 4, 3, 2, 1, 1, 1, 1],
            datatype: 4,
            bitpix: 16,
            pixdim: [1.0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0],
            vox_offset: 352.0,
            slope: 1.0,
            inter: 0.0,
            qform_code: 1,
            sform_code: 1,
            quatern: [0.0; 3],
            qoffset: [10.0, -20.0, 30.0],
            srow: [[1.0, 0.0, 0.0, 10.0], [0.0, 2.0, 0.0, -20.0], [0.0, 0.0, 3.0, 30.0]],
            voxels: (0..24).map(f64::from).collect(),
            text: false,
        }
    }

    pub fn with(change: impl FnOnce(&mut Self)) -> Vec<u8> {
        let mut file = Self::sound();
        change(&mut file);
        file.bytes()
    }

    pub fn version_2(mut self) -> Self {
        self.version = 2;
        self.magic = b"n+2\0\r\n\x1a\n".to_vec();
        self.vox_offset = 544.0;
        self
    }

    pub fn bytes(&self) -> Vec<u8> {
        let mut out = vec![0u8; if self.version == 1 { 352 } else { 544 }];
        let put = |out: &mut Vec<u8>, at: usize, little: &[u8]| {
            let mut raw = little.to_vec();
            if self.big {
                raw.reverse();
            }
            out[at..at + raw.len()].copy_from_slice(&raw);
        };
        if self.version == 1 {
            put(&mut out, 0, &348i32.to_le_bytes());
            for n in 0..8 {
                put(&mut out, 40 + 2 * n, &(self.dim[n] as i16).to_le_bytes());
                put(&mut out, 76 + 4 * n, &(self.pixdim[n] as f32).to_le_bytes());
            }
            put(&mut out, 70, &self.datatype.to_le_bytes());
            put(&mut out, 72, &self.bitpix.to_le_bytes());
            for (n, x) in [self.vox_offset, self.slope, self.inter].into_iter().enumerate() {
                put(&mut out, 108 + 4 * n, &(x as f32).to_le_bytes());
            }
            put(&mut out, 252, &self.qform_code.to_le_bytes());
            put(&mut out, 254, &self.sform_code.to_le_bytes());
            for (n, x) in self.quatern.iter().chain(&self.qoffset).chain(self.srow.iter().flatten()).enumerate() {
                put(&mut out, 256 + 4 * n, &(*x as f32).to_le_bytes());
            }
            out[344..348].copy_from_slice(&self.magic[..4]);
            if self.text {
                out[148..158].copy_from_slice(b"JANE ROE 1");
            }
        } else {
            put(&mut out, 0, &540i32.to_le_bytes());
            out[4..12].copy_from_slice(&self.magic);
            put(&mut out, 12, &self.datatype.to_le_bytes());
            put(&mut out, 14, &self.bitpix.to_le_bytes());
            for n in 0..8 {
                put(&mut out, 16 + 8 * n, &self.dim[n].to_le_bytes());
                put(&mut out, 104 + 8 * n, &self.pixdim[n].to_le_bytes());
            }
            put(&mut out, 168, &(self.vox_offset as i64).to_le_bytes());
            put(&mut out, 176, &self.slope.to_le_bytes());
            put(&mut out, 184, &self.inter.to_le_bytes());
            put(&mut out, 344, &i32::from(self.qform_code).to_le_bytes());
            put(&mut out, 348, &i32::from(self.sform_code).to_le_bytes());
            for (n, x) in self.quatern.iter().chain(&self.qoffset).chain(self.srow.iter().flatten()).enumerate() {
                put(&mut out, 352 + 8 * n, &x.to_le_bytes());
            }
        }
        for &x in &self.voxels {
            let mut raw = match self.datatype {
                2 => vec![x as u8],
                256 => vec![x as i8 as u8],
                4 => (x as i16).to_le_bytes().to_vec(),
                512 => (x as u16).to_le_bytes().to_vec(),
                8 => (x as i32).to_le_bytes().to_vec(),
                768 => (x as u32).to_le_bytes().to_vec(),
                1024 => (x as i64).to_le_bytes().to_vec(),
                1280 => (x as u64).to_le_bytes().to_vec(),
                16 => (x as f32).to_le_bytes().to_vec(),
                64 => x.to_le_bytes().to_vec(),
                128 => vec![x as u8; 3],
                2304 => vec![x as u8; 4],
                _ => vec![0; 16],
            };
            if self.big {
                raw.reverse();
            }
            out.extend(raw);
        }
        out
    }
}
