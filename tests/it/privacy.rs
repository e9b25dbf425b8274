//! What a scan's file says of the patient besides the voxels goes nowhere.

use crate::job::{CHEAP, contents, output, sample};
use base64::Engine;
use std::io::{Read, Write};

/// Text fields of NIfTI-1 and NIfTI-2 headers: name, offset, length.
const FIELDS_1: [(&str, usize, usize); 5] =
    [("data_type", 4, 10), ("db_name", 14, 18), ("descrip", 148, 80), ("aux_file", 228, 24), ("intent_name", 328, 16)];
const FIELDS_2: [(&str, usize, usize); 4] =
    [("descrip", 240, 80), ("aux_file", 320, 24), ("intent_name", 508, 16), ("unused_str", 525, 15)];

/// A word that stands nowhere by chance, different for every place; ten letters fit every field.
fn word(n: usize) -> String {
    format!("Zq{n:02}Xjkvwq")
}

fn unpacked(name: &str) -> Vec<u8> {
    let mut plain = Vec::new();
    flate2::read::GzDecoder::new(&std::fs::read(sample(name)).unwrap()[..]).read_to_end(&mut plain).unwrap();
    plain
}

fn packed(plain: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(plain).unwrap();
    encoder.finish().unwrap()
}

/// Words into the fields and into one extension per kind (2 DICOM, 4 AFNI, 6 comment), then the voxels.
fn planted(mut header: Vec<u8>, fields: &[(&str, usize, usize)], voxels: &[u8], words: &mut Vec<String>) -> Vec<u8> {
    let mut next = || {
        words.push(word(words.len()));
        words[words.len() - 1].clone()
    };
    for &(name, at, length) in fields {
        let word = next();
        assert!(word.len() <= length, "{name}");
        header[at..at + word.len()].copy_from_slice(word.as_bytes());
    }
    header.extend([1, 0, 0, 0]);
    for code in [2i32, 4, 6] {
        let mut content = next().into_bytes();
        content.resize(24, 0);
        header.extend(32i32.to_le_bytes());
        header.extend(code.to_le_bytes());
        header.extend(content);
    }
    let begin = header.len();
    if header[0] == 0x5c {
        header[108..112].copy_from_slice(&(begin as f32).to_le_bytes());
    } else {
        header[168..176].copy_from_slice(&(begin as i64).to_le_bytes());
    }
    [header, voxels.to_vec()].concat()
}

/// The header of a NIfTI-1 file as NIfTI-2 (https://nifti.nimh.nih.gov/nifti-2).
fn version_2(old: &[u8]) -> Vec<u8> {
    let mut new = vec![0u8; 540];
    let float = |at: usize| f64::from(f32::from_le_bytes(old[at..at + 4].try_into().unwrap()));
    let short = |at: usize| i16::from_le_bytes(old[at..at + 2].try_into().unwrap());
    let mut put = |at: usize, bytes: &[u8]| new[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &540i32.to_le_bytes());
    put(4, b"n+2\0\r\n\x1a\n");
    put(12, &old[70..74]);
    for n in 0..8 {
        put(16 + 8 * n, &i64::from(short(40 + 2 * n)).to_le_bytes());
        put(104 + 8 * n, &float(76 + 4 * n).to_le_bytes());
    }
    put(176, &float(112).to_le_bytes());
    put(184, &float(116).to_le_bytes());
    put(344, &i32::from(short(252)).to_le_bytes());
    put(348, &i32::from(short(254)).to_le_bytes());
    for n in 0..18 {
        put(352 + 8 * n, &float(256 + 4 * n).to_le_bytes());
    }
    put(500, &i32::from(old[123]).to_le_bytes());
    new
}

/// The bytes, and what is packed inside of them: gzip, and base64 in pages and meshes.
fn layers(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut layers = vec![bytes.to_vec()];
    let mut plain = Vec::new();
    // A .seg.nrrd has its gzip behind a blank line.
    let gzip = bytes.windows(3).position(|w| w == [0x1f, 0x8b, 8]);
    if gzip.is_some_and(|at| flate2::read::GzDecoder::new(&bytes[at..]).read_to_end(&mut plain).is_ok()) {
        layers.push(plain);
    }
    let letter = |b: &u8| b.is_ascii_alphanumeric() || matches!(b, b'+' | b'/' | b'=');
    for run in bytes.split(|b| !letter(b)).filter(|run| run.len() >= 40) {
        layers.extend(base64::engine::general_purpose::STANDARD.decode(run));
    }
    layers
}

fn holds(layers: &[Vec<u8>], word: &str) -> bool {
    layers.iter().any(|layer| layer.windows(word.len()).any(|part| part == word.as_bytes()))
}

#[test]
fn words_are_found_wherever_they_hide() {
    let packed_word = packed(word(3).as_bytes());
    let address = base64::engine::general_purpose::STANDARD.encode(format!("{:040}{}", 0, word(3)));
    for hidden in [word(3).into_bytes(), packed_word.clone(), [&b"NRRD\n\n"[..], &packed_word].concat()] {
        assert!(holds(&layers(&hidden), &word(3)) && !holds(&layers(&hidden), &word(4)));
    }
    assert!(holds(&layers(format!("<img src=\"data:image/png;base64,{address}\">").as_bytes()), &word(3)));
}

#[test]
fn slow_no_word_of_a_header_an_extension_or_a_file_name_is_in_any_output() {
    let folder = tempfile::tempdir().unwrap();
    let mut words = vec![word(0), word(1)];
    let (pre, post) = (unpacked("pre.nii.gz"), unpacked("post.nii.gz"));
    let pre = packed(&planted(pre[..348].to_vec(), &FIELDS_1, &pre[352..], &mut words));
    let post = planted(version_2(&post), &FIELDS_2, &post[352..], &mut words);
    let name = |name: String| folder.path().join(name).to_str().unwrap().to_owned();
    let (pre_file, post_file, case) =
        (name(format!("{}.nii.gz", words[0])), name(format!("{}.nii", words[1])), name("case".to_owned()));
    std::fs::write(&pre_file, &pre).unwrap();
    std::fs::write(&post_file, &post).unwrap();
    let (in_pre, in_post) = (layers(&pre), layers(&post));
    assert!(words[2..10].iter().all(|word| holds(&in_pre, word)));
    assert!(words[10..].iter().all(|word| holds(&in_post, word)));

    let run = output(&[&["run", &pre_file, &post_file, "-o", &case, "-vv", "--json"], &CHEAP[..]].concat());
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let mut outputs = contents(folder.path().join("case").as_path());
    assert!(outputs.len() > 80 && outputs.contains_key("report.html") && outputs.contains_key("sim/sample-04.vtu"));
    outputs.insert("standard output".to_owned(), run.stdout);
    outputs.insert("standard error".to_owned(), run.stderr);
    for (file, bytes) in &outputs {
        let layers = layers(bytes);
        for word in &words {
            assert!(!file.contains(word) && !holds(&layers, word), "{file} holds {word}");
        }
    }
}
