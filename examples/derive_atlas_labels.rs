//! Writes atlases/mni152/labels.nii.gz from the template's own maps: `cargo run --release --example derive_atlas_labels`.

use std::io::{Read, Write};

fn main() -> std::io::Result<()> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("atlases/mni152");
    let labels = hgm::segment::atlas::template().derived_labels();
    // The header of the grey matter map, whose grid and type the labels share.
    let grey = std::fs::read(folder.join("mni_icbm152_gm_tal_nlin_sym_09a_converted.nii.gz"))?;
    let mut header = [0u8; 352];
    flate2::read::GzDecoder::new(grey.as_slice()).read_exact(&mut header)?;
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    gzip.write_all(&header)?;
    gzip.write_all(&labels.data)?;
    std::fs::write(folder.join("labels.nii.gz"), gzip.finish()?)
}
