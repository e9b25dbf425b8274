//! What a user may hand to `hgm run` that cannot be used: exit code 3, a message with file, field and remedy, and nothing
//! written.

use crate::job::{CHEAP, contents, output, sample};
use crate::made::prepared_pair;
use hgm::geometry::Native;
use hgm::image::nifti::{ReadOptions, decode, encode_u8};
use hgm::image::{Grid, LabelMap, Volume};
use std::io::{Read, Write};
use std::path::Path;

fn unpacked(bytes: &[u8]) -> Vec<u8> {
    let mut plain = Vec::new();
    flate2::read::GzDecoder::new(bytes).read_to_end(&mut plain).unwrap();
    plain
}

fn packed(bytes: &[u8], level: u32) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::new(level));
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// A copy with some bytes of the header replaced.
fn with(plain: &[u8], at: usize, bytes: &[u8]) -> Vec<u8> {
    let mut copy = plain.to_vec();
    copy[at..at + bytes.len()].copy_from_slice(bytes);
    copy
}

/// The voxels of a 16-bit file, all replaced.
fn filled(plain: &[u8], value: i16) -> Vec<u8> {
    let mut copy = plain[..352].to_vec();
    for _ in 0..(plain.len() - 352) / 2 {
        copy.extend(value.to_le_bytes());
    }
    copy
}

#[test]
fn no_result_is_written_over_what_it_is_made_of_nor_two_into_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::create_dir_all(path("case/anat")).unwrap();
    for name in ["pre.nii.gz", "post.nii.gz", "case/anat/pre_space-MNI_T1w.nii.gz"] {
        std::fs::copy(sample("pre.nii.gz"), path(name)).unwrap();
    }
    std::fs::copy(sample("post.nii.gz"), path("post.nii.gz")).unwrap();
    let (pre, post, new) = (path("pre.nii.gz"), path("post.nii.gz"), path("new.nii.gz"));
    let kept = path("case/anat/pre_space-MNI_T1w.nii.gz");
    let before = contents(folder.path());
    for words in [
        vec!["segment", &pre, "-o", &pre],
        vec!["segment", &pre, "--brain-mask", &post, "-o", &new, "--write-brain-mask", &post],
        vec!["segment", &pre, "-o", &new, "--write-brain-mask", &new],
        vec!["mesh", &pre, "-o", &path("m.vtu"), "--preview", &pre],
        vec!["synth", "--head", &pre, "-o", &path("")],
        vec!["synth", "--head", &pre, "--resected-mask", &post, "-o", &path(".")],
        vec!["run", &kept, &post, "-o", &path("case")],
        vec!["predict", &kept, "--resection-ellipsoid", "0,0,0,5,5,5", "-o", &path("case")],
    ] {
        let ended = output(&words);
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(3), "{words:?}: {said}");
        assert!(said.contains(".nii.gz") && said.contains("another name"), "{words:?}: {said}");
        assert!(contents(folder.path()) == before, "{words:?}");
    }
}

#[test]
fn each_unusable_file_ends_with_3_and_leaves_nothing_behind() {
    let good = std::fs::read(sample("pre.nii.gz")).unwrap();
    let plain = unpacked(&good);
    let short = |n: i16| n.to_le_bytes().to_vec();
    let float = |x: f32| x.to_le_bytes().to_vec();
    let mut flipped = good.clone();
    let middle = good.len() / 2;
    flipped[middle] ^= 1;
    let mut bad_crc = good.clone();
    let crc = good.len() - 8;
    bad_crc[crc] ^= 1;
    // Offsets of NIfTI-1: dim 40, datatype 70, bitpix 72, pixdim 76, scl_slope 112, form codes 252, srow 280, magic 344.
    let cases: Vec<(&str, Vec<u8>, &[&str])> = vec![
        ("empty.nii.gz", vec![], &["sizeof_hdr", "again"]),
        ("text.nii", b"these are words and not an image at all".repeat(20), &["sizeof_hdr", "dcm2niix"]),
        ("cut.nii.gz", good[..good.len() / 3].to_vec(), &["gzip", "again"]),
        ("cut.nii", plain[..plain.len() - 1000].to_vec(), &["dim", "truncated", "again"]),
        ("flipped.nii.gz", flipped, &["gzip", "again"]),
        ("crc.nii.gz", bad_crc, &["gzip", "again"]),
        ("header.nii", plain[..300].to_vec(), &["sizeof_hdr", "again"]),
        ("magic.nii", with(&plain, 344, b"n+7\0"), &["magic", "again"]),
        ("half.nii", with(&plain, 344, b"ni1\0"), &["magic", ".hdr"]),
        ("rgb.nii", with(&with(&plain, 70, &short(128)), 72, &short(24)), &["datatype", "RGB24"]),
        ("complex.nii", with(&with(&plain, 70, &short(32)), 72, &short(64)), &["datatype", "complex64"]),
        ("volumes.nii", with(&plain, 40, &[short(4), plain[42..48].to_vec(), short(3)].concat()), &["dim", "--volume"]),
        ("negative.nii", with(&plain, 44, &short(-5)), &["dim", "-5"]),
        ("spacing.nii", with(&plain, 80, &float(0.0)), &["pixdim"]),
        ("wide.nii", with(&plain, 80, &float(40.0)), &["pixdim"]),
        ("nowhere.nii", with(&plain, 252, &[0; 4]), &["qform_code and sform_code"]),
        ("forms.nii", with(&plain, 292, &float(77.0)), &["sform and qform", "--prefer"]),
        ("singular.nii", with(&plain, 280, &[0; 48]), &["srow"]),
        ("slope.nii", with(&plain, 112, &float(f32::NAN)), &["scl_slope", "set scl_slope to 1"]),
        ("constant.nii.gz", packed(&filled(&plain, 9), 1), &["voxels", "every voxel is"]),
        ("same.nii.gz", good.clone(), &["the same", "pre-operative"]),
        ("again.nii.gz", packed(&plain, 1), &["same voxels", "surgery"]),
        ("scan.dcm", packed(&plain, 2), &["dcm2niix"]),
    ];
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let pre = path("pre.nii.gz");
    std::fs::write(&pre, &good).unwrap();
    assert!(cases.len() >= 20);
    for (name, bytes, words) in &cases {
        std::fs::write(path(name), bytes).unwrap();
        refuses(&["run", &pre, &path(name), "-o", &path("case")], name, words, &path("case"));
    }
    refuses(&["run", &pre, &path("no.nii"), "-o", &path("case")], "no.nii", &["check the path"], &path("case"));
    refuses(&["run", &pre, &path("."), "-o", &path("case")], "", &["is a folder"], &path("case"));
}

fn refuses(arguments: &[&str], name: &str, words: &[&str], case: &str) {
    let result = output(arguments);
    let message = String::from_utf8_lossy(&result.stderr).into_owned();
    assert_eq!(result.status.code(), Some(3), "{name}: {message}");
    for word in words.iter().chain(&[name]) {
        assert!(message.contains(word), "{name}: {message:?} lacks {word:?}");
    }
    assert_eq!(message.trim().lines().count(), 1, "{message}");
    assert!(!Path::new(case).exists(), "{name}: something was written");
}

#[test]
fn masks_that_fit_neither_scan_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (pre, post) = (sample("pre.nii.gz"), sample("post.nii.gz"));
    let good = std::fs::read(&pre).unwrap();
    let plain = unpacked(&good);
    // The first voxel lies ten millimetres from where the scan's does.
    let moved = |at: usize, copy: &[u8]| {
        let old = f32::from_le_bytes(copy[at..at + 4].try_into().unwrap());
        with(copy, at, &(old + 10.0).to_le_bytes())
    };
    let masks: [(&str, Vec<u8>, &[&str]); 3] = [
        ("empty.nii.gz", packed(&filled(&plain, 0), 1), &["the mask is empty"]),
        ("elsewhere.nii.gz", packed(&moved(292, &moved(268, &filled(&plain, 1))), 1), &["neither scan", "resample"]),
        ("cut.nii.gz", good[..good.len() / 2].to_vec(), &["gzip", "again"]),
    ];
    for (name, bytes, words) in &masks {
        std::fs::write(path(name), bytes).unwrap();
        for option in ["--brain-mask", "--ventricle-mask", "--cavity-mask", "--resected-mask"] {
            let pair = [pre.to_str().unwrap(), post.to_str().unwrap()];
            let arguments = ["prep", pair[0], pair[1], option, &path(name), "-o", &path("case")];
            refuses(&arguments, name, words, &path("case"));
        }
    }
    // Which of the two would count is not guessed.
    std::fs::write(path("ones.nii.gz"), packed(&filled(&plain, 1), 1)).unwrap();
    for (option, role) in [("--brain-mask", "brain mask"), ("--ventricle-mask", "ventricle mask")] {
        let (pre, post, ones) = (pre.to_str().unwrap(), post.to_str().unwrap(), path("ones.nii.gz"));
        let pair = ["prep", pre, post, "--dseg", &ones, option, &ones, "-o", &path("case")];
        refuses(&pair, role, &["label map", "leave one of the two out"], &path("case"));
        let plan = ["predict", pre, "--resection", &ones, "--dseg", &ones, option, &ones, "-o", &path("case")];
        refuses(&plan, role, &["label map"], &path("case"));
    }
}

#[test]
fn slow_a_mask_outside_the_brain_is_refused_and_no_mask_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (pre, post) = (sample("pre.nii.gz"), sample("post.nii.gz"));
    // All that the scan shows: most of it is no brain.
    let bytes = std::fs::read(&pre).unwrap();
    let scan = decode(&bytes, "pre.nii.gz", &ReadOptions::default()).unwrap().volume;
    std::fs::write(path("head.nii.gz"), encode_u8(&scan.map(|x| u8::from(x > 0.0)))).unwrap();
    let pair = [pre.to_str().unwrap(), post.to_str().unwrap()];
    let words = ["run", pair[0], pair[1], "--resected-mask", &path("head.nii.gz"), "-o", &path("case")];
    let result = output(&[&words[..], &CHEAP[..]].concat());
    let message = String::from_utf8_lossy(&result.stderr).into_owned();
    assert_eq!(result.status.code(), Some(3), "{message}");
    assert!(message.contains("outside the brain") && message.contains("check the masks"), "{message:?}");
    assert!(!folder.path().join("case/anat").exists(), "masks were written");
}

#[test]
fn settings_that_would_stop_a_later_stage_stop_the_job_before_the_first() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (pre, post) = (sample("pre.nii.gz"), sample("post.nii.gz"));
    let pair = [pre.to_str().unwrap(), post.to_str().unwrap()];
    let settings: [(&str, &[&str]); 8] = [
        ("[registr]\n", &["no table [registr]", "[register]"]),
        ("[resection]\npoisson_ratio = 0.6\n", &["[resection]", "poisson_ratio", "below 0.5"]),
        ("[resection]\nfixed = [\"skull\"]\n", &["[resection]", "skull", "base, falx"]),
        ("[resection]\ntissues = 7\n", &["tissues", "1 (the whole brain) or 2"]),
        (
            "[resection]\ndensity_kg_per_m3 = 300.0\ncsf = {}\n",
            &["[resection]", "density_kg_per_m3", "tissue's own (1040)"],
        ),
        ("[prior]\nstudy = \"mri\"\n", &["[prior]", "mri", "mre"]),
        ("[mesh]\nsize = { cells = 0 }\n", &["[mesh]", "size.cells"]),
        ("[estimate]\nphantom_noise_mm = nan\n", &["[estimate]", "phantom_noise_mm"]),
    ];
    for (text, words) in settings {
        std::fs::write(path("settings.toml"), text).unwrap();
        let config = path("settings.toml");
        let run = ["--config", &config, "run", pair[0], pair[1], "-o", &path("case")];
        refuses(&run, "settings.toml", words, &path("case"));
    }
    std::fs::write(path("settings.toml"), "[resection]\ngravity_m_per_s2 = [0.0, 0.0, 0.0]\n").unwrap();
    let config = path("settings.toml");
    let run = ["--config", &config, "run", pair[0], pair[1], "--estimate", "-o", &path("case")];
    refuses(&run, "there is no load", &["gravity_m_per_s2", "[resection]"], &path("case"));
    std::fs::write(path("settings.toml"), "[resection.solver]\nmethod = \"backward-euler\"\n").unwrap();
    let moving = ["[resection.solver]", "method = \"static\""];
    let run = ["--config", &config, "run", pair[0], pair[1], "--estimate", "-o", &path("case")];
    refuses(&run, "an estimate is of equilibria", &moving, &path("case"));
    let plan = ["--config", &config, "predict", pair[0], "--resection-ellipsoid", "0,0,0,5,5,5", "-o", &path("case")];
    refuses(&plan, "a prediction is of equilibria", &moving, &path("case"));
    let run = ["run", pair[0], pair[1], "--cells", "0", "-o", &path("case")];
    refuses(&run, "--cells", &["1 or more"], &path("case"));
}

#[test]
fn a_comparison_refuses_to_estimate_loads_that_are_not_there_as_an_estimate_does() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    prepared_pair(Path::new(&path("case")));
    let none = "[[resection.pressure]]\nset = \"superior\"\npressure_pa = 0.0\n";
    for given in ["", none] {
        std::fs::write(path("settings.toml"), format!("[estimate]\npressure = true\n{given}")).unwrap();
        for command in ["estimate", "compare"] {
            let ended = output(&["--config", &path("settings.toml"), command, &path("case")]);
            let said = String::from_utf8_lossy(&ended.stderr);
            assert_eq!(ended.status.code(), Some(3), "{command}: {said}");
            assert!(said.contains("`pressure` needs pressures other than 0"), "{command}: {said}");
        }
    }
}

#[test]
fn a_volume_or_an_affine_chosen_on_the_command_line_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let plain = unpacked(&std::fs::read(sample("pre.nii.gz")).unwrap());
    let (three, voxels) = (sample("pre.nii.gz"), &plain[352..]);
    let dims = [&4i16.to_le_bytes()[..], &plain[42..48], &2i16.to_le_bytes()].concat();
    // A volume of noise before the scan itself; the sform lies 60 mm away from the qform.
    let noise: Vec<u8> = (0..voxels.len() / 2).flat_map(|n| ((n * 7919 % 1000) as i16).to_le_bytes()).collect();
    let four = [with(&plain, 40, &dims), noise].concat();
    let four = [&four[..352], &four[plain.len()..], voxels].concat();
    std::fs::write(path("four.nii"), four).unwrap();
    let old = f32::from_le_bytes(plain[292..296].try_into().unwrap());
    std::fs::write(path("forms.nii"), with(&plain, 292, &(old + 60.0).to_le_bytes())).unwrap();
    let register = |moving: &str, more: &[&str]| {
        let (moving, out) = (path(moving), path("xfm.txt"));
        let all = [&["register", &moving, three.to_str().unwrap(), "-o", &out][..], more].concat();
        let ended = output(&all);
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        let text = std::fs::read_to_string(out).unwrap();
        text.split_whitespace().map(|x| x.parse::<f64>().unwrap()).collect::<Vec<_>>()
    };
    // The single volume of the other file leaves nothing to choose.
    let itself = register("four.nii", &["--volume", "1"]);
    assert!((0..12).all(|n| (itself[n] - f64::from(u8::from(n % 5 == 0))).abs() < 0.02), "{itself:?}");
    let by_qform = register("forms.nii", &["--prefer", "qform"]);
    assert!((0..3).all(|row| by_qform[4 * row + 3].abs() < 0.05), "{by_qform:?}");
    let by_sform = register("forms.nii", &["--prefer", "sform"]);
    assert!((0..3).any(|row| by_sform[4 * row + 3].abs() > 50.0), "{by_sform:?}");
}

#[test]
fn a_mesh_of_the_same_file_by_its_other_affine_is_made_again_and_its_surfaces_are_the_scanners() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let grid = Grid::axis_aligned([24; 3], [2.0; 3], [0.0; 3]);
    let ball: LabelMap<Native> = Volume::from_fn(grid, |n| {
        let apart = grid.voxel(n).map(|v| v as f64 - 11.5);
        2 * u8::from(apart.iter().map(|x| x * x).sum::<f64>() < 81.0)
    });
    let plain = unpacked(&encode_u8(&ball));
    let x = f32::from_le_bytes(plain[292..296].try_into().unwrap());
    std::fs::write(path("ball.nii"), with(&plain, 292, &(x + 60.0).to_le_bytes())).unwrap();
    let middle = |prefer: &str| {
        let (file, mesh, surfaces) = (path("ball.nii"), path("ball.vtu"), path("surfaces"));
        let asked = ["mesh", &file, "-o", &mesh, "--cells", "800", "--prefer", prefer];
        // Surfaces are asked for beside the first alone: they make a mesh again whatever has changed.
        let more = if prefer == "qform" { &["--surfaces", &surfaces][..] } else { &[] };
        let ended = output(&[&asked[..], more].concat());
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        let mesh = hgm::mesh::format::vtu::decode(&std::fs::read(&mesh).unwrap(), "ball.vtu").unwrap().mesh;
        mesh.nodes_mm().iter().map(|p| p[0]).sum::<f64>() / mesh.nodes_mm().len() as f64
    };
    let (by_qform, by_sform) = (middle("qform"), middle("sform"));
    assert!((by_sform - by_qform - 60.0).abs() < 1.0, "{by_qform} {by_sform}");
    let surface = std::fs::read_to_string(path("surfaces/pial.surf.gii")).unwrap();
    assert!(surface.contains("SCANNER_ANAT") && !surface.contains("MNI_152"));
}

#[test]
fn folders_of_another_kind_are_named_for_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::create_dir(path("empty")).unwrap();
    for command in ["sweep", "reduce", "estimate"] {
        let ended = output(&[command, &path("empty")]);
        let message = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(3), "{message}");
        assert!(message.contains(&path("empty")) && message.contains("not a case folder"), "{message}");
    }
    std::fs::create_dir_all(path("phantom/.stages")).unwrap();
    std::fs::write(path("phantom/.stages/labels.manifest.json"), "{}").unwrap();
    let ended = output(&["sweep", &path("phantom")]);
    let message = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(ended.status.code() == Some(3) && message.contains("this is a phantom"), "{message}");
}

#[test]
fn words_that_do_not_go_together_are_refused_with_the_option_to_leave_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (inside, out) = (folder.path().to_str().unwrap(), path("out"));
    let scan = sample("pre.nii.gz").display().to_string();
    for (arguments, words) in [
        (&["live", inside, "s.toml"][..], &["own scenario", "SCENARIO"][..]),
        (&["live", &path("brain.vtu"), "--before-resection"], &["brain.vtu", "label 5", "--before-resection"]),
        (&["segment", &scan, "-o", &path("out")], &["out", ".nii.gz", "--write-brain-mask"]),
        (&["register", &scan, "MNI", "--moving-mask", "m.nii.gz", "-o", &out], &["template", "--moving-mask"]),
        (&["register", &scan, &scan, "-o", inside], &["is a folder", "name a file"]),
        (&["register", &scan, &scan, "-o", &path("out.nii.gz")], &["out.nii.gz", "name of an image", ".txt", "-o"]),
    ] {
        refuses(arguments, "", words, &out);
    }
}
