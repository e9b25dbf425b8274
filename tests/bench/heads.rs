//! Bars of real heads that took no part in building: the program's answer on each.

use crate::bar::{Bar, Finished, data, run_hgm};
use hgm::geometry::Native;
use hgm::image::nifti::{ReadOptions, decode_labels, encode_f32};
use hgm::image::{Grid, LabelMap, Volume};
use hgm::segment::label;
use nalgebra::{Matrix4, Vector3};
use std::io::Read;
use std::path::Path;

/// Scans by their names; the volume of the brain (cc) where one has been found by hand or by another way.
const HEADS: [(&str, Option<f64>); 15] = [
    ("good_a", None),
    ("good_b", None),
    ("gap", None),
    ("clipped", Some(1261.0)),
    ("child3y", Some(1250.0)),
    ("stroke_cavity", None),
    ("bias_a", None),
    ("bias_b", None),
    ("stranger_a", None),
    ("stranger_b", None),
    ("twovisits_1", None),
    ("twovisits_2", None),
    ("postures_HFS", None),
    ("postures_HFP", None),
    ("postures_HFDL", None),
];
/// Known volumes must be met within this share.
const VOLUME_TOLERANCE: f64 = 0.08;

pub fn bars() -> Vec<Bar> {
    let Some(heads) = data().map(|d| d.join("heads")).filter(|d| d.exists()) else {
        println!("skipped: real heads (heads/)");
        return Vec::new();
    };
    let folder = tempfile::tempdir().unwrap();
    let mut bars = Vec::new();
    let mut passed = 0;
    println!("head            exit   CPU-s    GB   brain cc   ventricles cc");
    for (name, known_cc) in HEADS {
        let found = segmented(&heads.join(format!("{name}_t1.nii.gz")), &folder.path().join(format!("{name}.nii.gz")));
        let Some(labels) = &found.labels else {
            println!("{name:<15} refused");
            continue;
        };
        passed += 1;
        let (brain, ventricle) = (labels.map(|l| l > 0).volume_cc(), labels.map(|l| l == label::VENTRICLE).volume_cc());
        println!(
            "{name:<15} 0      {:5.1}  {:4.2}   {brain:8.0}   {ventricle:8.1}",
            found.run.cpu_s, found.run.peak_gb
        );
        if let Some(cc) = known_cc {
            let percent = 100.0 * (brain / cc - 1.0);
            let met = percent.abs() <= 100.0 * VOLUME_TOLERANCE;
            bars.push(Bar::new(&format!("heads {name} brain volume"), "within 8 %", format!("{percent:+.1} %"), met));
        }
        if name == "good_b" {
            bars.push(cost(&found.run));
        }
    }
    let all = HEADS.len();
    bars.push(Bar::new("heads segmented", "all", format!("{passed} of {all}"), passed == all));
    bars.extend(against_freesurfer(&heads, folder.path()));
    bars
}

/// The program's answer on a scan.
pub struct Segmented {
    run: Finished,
    /// Its labels; `None` when it was refused.
    pub labels: Option<LabelMap<Native>>,
}

/// Runs `hgm segment` on a scan.
pub fn segmented(scan: &Path, out: &Path) -> Segmented {
    let (scan, out_name) = (scan.display().to_string(), out.display().to_string());
    let run = run_hgm(&["segment", "-q", "--force", "--threads", "1", &scan, "-o", &out_name]);
    let labels = if run.ok { labels(&std::fs::read(out).unwrap(), &out_name) } else { None };
    Segmented { run, labels }
}

fn labels(bytes: &[u8], name: &str) -> Option<LabelMap<Native>> {
    decode_labels(bytes, name, &ReadOptions::default()).ok().map(|read| read.0)
}

fn cost(run: &Finished) -> Bar {
    let met = run.cpu_s <= 12.0 && run.peak_gb <= 1.0;
    Bar::new(
        "heads segment at 1 mm",
        "<= 12 CPU-s, 1 GB",
        format!("{:.1} CPU-s, {:.2} GB", run.cpu_s, run.peak_gb),
        met,
    )
}

/// A scan with FreeSurfer's labels of the same head.
fn against_freesurfer(heads: &Path, folder: &Path) -> Vec<Bar> {
    let (Some(t1), Some(aseg)) =
        (mgz(&heads.join("labels_freesurfer_brain_t1.mgz")), mgz(&heads.join("labels_freesurfer_aseg.mgz")))
    else {
        println!("skipped: FreeSurfer's labels");
        return Vec::new();
    };
    let scan = folder.join("freesurfer.nii.gz");
    std::fs::write(&scan, encode_f32(&t1)).unwrap();
    let found = segmented(&scan, &folder.join("freesurfer_dseg.nii.gz"));
    let Some(labels) = found.labels else {
        return vec![Bar::new("heads FreeSurfer's head", "segmented", "refused", false)];
    };
    let dice = |mine: u8, theirs: &[i32]| labels.map(|l| l == mine).dice(&aseg.map(|x| theirs.contains(&(x as i32))));
    let grey = dice(label::GREY_MATTER, &[3, 42, 8, 47, 10, 49, 11, 50, 12, 51, 13, 52, 17, 53, 18, 54, 26, 58]);
    let white = dice(label::WHITE_MATTER, &[2, 41, 7, 46, 16, 28, 60, 77, 85, 251, 252, 253, 254, 255]);
    let ventricle = dice(label::VENTRICLE, &[4, 43, 5, 44, 14, 31, 63]);
    let bar = |what: &str, least: f64, dice: f64| {
        Bar::new(
            &format!("heads FreeSurfer's {what} Dice"),
            &format!(">= {least}"),
            format!("{dice:.3}"),
            dice >= least,
        )
    };
    vec![bar("grey matter", 0.90, grey), bar("white matter", 0.93, white), bar("ventricle", 0.88, ventricle)]
}

/// A volume of bytes or 32-bit integers in FreeSurfer's MGH format (big endian; a header of 284 bytes), gzipped.
pub fn mgz(path: &Path) -> Option<Volume<f32, Native>> {
    let mut bytes = Vec::new();
    flate2::read::GzDecoder::new(std::fs::File::open(path).ok()?).read_to_end(&mut bytes).ok()?;
    let whole = |at: usize| i32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    let real = |at: usize| f64::from(f32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()));
    let dims = [4, 8, 12].map(|at| whole(at) as usize);
    let count: usize = dims.iter().product();
    let spacing = [30, 34, 38].map(real);
    // Direction cosines of the three axes, then the centre of the volume.
    let column = |a: usize| Vector3::new(real(42 + 12 * a), real(46 + 12 * a), real(50 + 12 * a)) * spacing[a];
    let centre = Vector3::new(real(78), real(82), real(86));
    let corner = centre - (0..3).map(|a| column(a) * (dims[a] as f64 / 2.0)).sum::<Vector3<f64>>();
    let mut affine = Matrix4::identity();
    for a in 0..3 {
        affine.fixed_view_mut::<3, 1>(0, a).copy_from(&column(a));
    }
    affine.fixed_view_mut::<3, 1>(0, 3).copy_from(&corner);
    let data = match whole(20) {
        0 => bytes[284..284 + count].iter().map(|&b| f32::from(b)).collect(),
        1 => (0..count).map(|n| whole(284 + 4 * n) as f32).collect(),
        _ => return None,
    };
    Some(Volume::from_data(Grid::new(dims, affine)?, data))
}
