//! Computes the atlas labels anew from the template's own maps and compares them with the committed file; `--write`
//! replaces it. `cargo run --release --example derive_atlas_labels [-- --write]`

use hgm::segment::atlas::template;
use std::io::{Read, Write};

fn main() -> std::io::Result<()> {
    let atlas = template();
    let labels = atlas.derived_labels();
    let differing = labels.data.iter().zip(&atlas.labels.data).filter(|(new, old)| new != old).count();
    println!("{differing} of {} voxels differ from atlases/mni152/labels.nii.gz", labels.data.len());
    if std::env::args().any(|word| word == "--write") {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("atlases/mni152");
        // The header of the grey matter map, whose grid and type the labels share.
        let grey = std::fs::read(folder.join("mni_icbm152_gm_tal_nlin_sym_09a_converted.nii.gz"))?;
        let mut header = [0u8; 352];
        flate2::read::GzDecoder::new(grey.as_slice()).read_exact(&mut header)?;
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        gzip.write_all(&header)?;
        gzip.write_all(&labels.data)?;
        std::fs::write(folder.join("labels.nii.gz"), gzip.finish()?)?;
    } else if differing > 0 {
        return Err(std::io::Error::other("file and rules have parted: look why, then run it again with --write"));
    }
    Ok(())
}
