//! The guard of the NIfTI reader: what is refused and with which words, what is read all the same, and that nothing
//! anyone feeds it makes it panic.

mod arbitrary;
mod file;
mod orientation;
mod reading;
mod refusals;
mod writing;

use file::File;
use hgm::image::nifti::{NiftiImage, ReadOptions, decode};

const NAME: &str = "scan.nii.gz";

fn read(bytes: &[u8]) -> NiftiImage {
    decode(bytes, NAME, &ReadOptions::default()).unwrap()
}

/// Gzip as any other program writes it.
fn gzip(bytes: &[u8]) -> Vec<u8> {
    use std::io::Write;
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}
