//! What is stated of each part of the brain against what is right there: heads with known labels, hurt and unhurt.
//!
//! A voxel is right when it is grey matter, white matter, ventricle or neither in both, over what either calls one of the three. Right is
//! what the known labels say: FreeSurfer's of its head, the template's own, those of a case with its truth (`cases/`), and for
//! heads without any what was found on them unhurt. In the folder `HGM_BENCH_KEEP` the figures of every region are kept as a table.

use crate::bar::{Bar, data};
use crate::corruptions::{Mishap, scan};
use crate::heads::mgz;
use hgm::geometry::{Native, Position};
use hgm::image::resample::{Interpolation, resample};
use hgm::image::{LabelMap, Volume};
use hgm::register::deformable::DeformableSettings;
use hgm::segment::{
    PosedScan, Region, RegionEvidence, SegmentOverrides, SegmentSettings, atlas, label, pose_of_head, segment_head,
};
use std::fmt::Write;
use std::path::Path;

/// Hurts of each head: how much worse than the usual mishaps their noise and shading are, and the seed.
const HURTS: [(f64, u64); 3] = [(1.0, 101), (2.0, 121), (3.0, 134)];

/// A head with the labels that count as right.
struct Known {
    name: &'static str,
    t1: Volume<f32, Native>,
    /// `None`: what is found on it unhurt.
    labels: Option<LabelMap<Native>>,
}

/// What was found on a scan.
struct Found {
    labels: LabelMap<Native>,
    regions: Vec<RegionEvidence>,
    /// The region of a place of the scan.
    region_at: Box<dyn Fn(Position<Native>) -> Region + Sync>,
}

fn taken_apart(t1: &Volume<f32, Native>) -> Option<Found> {
    let pose = pose_of_head(t1).ok()?.fixed_from_moving;
    let scan = PosedScan::new(t1, &pose);
    let overrides = SegmentOverrides::default();
    let (found, fit) =
        segment_head(&scan, &overrides, &DeformableSettings::default(), &SegmentSettings::default()).ok()?;
    let template_from_patient = fit.atlas_from_subject;
    let region_at = move |p| Region::at(template_from_patient.apply(pose.apply(p)));
    Some(Found { labels: found.labels, regions: found.regions, region_at: Box::new(region_at) })
}

/// Of each region how many voxels count and how many of them are right.
fn right(found: &LabelMap<Native>, known: &LabelMap<Native>, region_at: impl Fn(usize) -> Region) -> Vec<[usize; 2]> {
    let tissue = |l: u8| if [label::GREY_MATTER, label::WHITE_MATTER, label::VENTRICLE].contains(&l) { l } else { 0 };
    let mut of = vec![[0usize; 2]; Region::ALL.len()];
    for n in 0..found.data.len() {
        let (here, there) = (tissue(found.data[n]), tissue(known.data[n]));
        if here != 0 || there != 0 {
            let [all, right] = &mut of[region_at(n) as usize];
            *all += 1;
            *right += usize::from(here == there);
        }
    }
    of
}

pub fn bars() -> Vec<Bar> {
    let Some(data) = data().filter(|d| d.join("heads").exists()) else {
        println!("skipped: confidence by regions (heads/)");
        return Vec::new();
    };
    let mut table = String::from("head\thurt\tregion\tseparation\tstated\tright\tvoxels\twords\n");
    for Known { name, t1, labels } in known(&data) {
        let Some(unhurt) = taken_apart(&t1) else {
            println!("{name} itself refused");
            continue;
        };
        let of_unhurt = |n: usize| (unhurt.region_at)(t1.grid.centre(t1.grid.voxel(n)));
        if let Some(labels) = &labels {
            lines(&mut table, name, "unhurt", &unhurt.regions, &right(&unhurt.labels, labels, of_unhurt), "");
        }
        let truth = labels.as_ref().unwrap_or(&unhurt.labels);
        for (severity, seed) in HURTS {
            let mishap = Mishap::drawn(&t1, seed, severity);
            let Some(found) = taken_apart(&mishap.scan) else {
                println!("{name} {seed}: refused ({})", mishap.words);
                continue;
            };
            let (grid, known) = (mishap.scan.grid, mishap.on_hurt(truth));
            let of_hurt = |n: usize| (unhurt.region_at)(mishap.unhurt_place(grid.centre(grid.voxel(n))));
            let counts = right(&found.labels, &known, of_hurt);
            lines(&mut table, name, &seed.to_string(), &found.regions, &counts, &mishap.words);
        }
    }
    if let Some(folder) = std::env::var_os("HGM_BENCH_KEEP") {
        std::fs::write(Path::new(&folder).join("confidence.tsv"), &table).unwrap();
    }
    Vec::new()
}

fn lines(table: &mut String, name: &str, hurt: &str, regions: &[RegionEvidence], counts: &[[usize; 2]], words: &str) {
    for part in regions {
        let region = part.region;
        let [all, right] = counts[region as usize];
        let share = right as f64 / all.max(1) as f64;
        let figures = format!("{:.2}\t{:.3}\t{share:.3}\t{all}", part.separation, part.confidence());
        println!("{name}\t{hurt}\t{region}\t{figures}\t{words}");
        writeln!(table, "{name}\t{hurt}\t{region}\t{figures}\t{words}").unwrap();
    }
}

fn known(data: &Path) -> Vec<Known> {
    let heads = data.join("heads");
    let mut all = Vec::new();
    if let (Some(t1), Some(aseg)) =
        (mgz(&heads.join("labels_freesurfer_brain_t1.mgz")), mgz(&heads.join("labels_freesurfer_aseg.mgz")))
    {
        let own = aseg.map(|code| match code as i32 {
            3 | 42 | 8 | 47 | 10 | 49 | 11 | 50 | 12 | 51 | 13 | 52 | 17 | 53 | 18 | 54 | 26 | 58 => label::GREY_MATTER,
            2 | 41 | 7 | 46 | 16 | 28 | 60 | 77 | 85 | 251..=255 => label::WHITE_MATTER,
            4 | 43 | 5 | 44 | 14 | 31 | 63 => label::VENTRICLE,
            _ => label::BACKGROUND,
        });
        all.push(Known { name: "freesurfer", t1, labels: Some(own) });
    }
    let template = atlas::template();
    let own = template.labels.clone().relabelled();
    all.push(Known { name: "template", t1: template.t1_f32().relabelled(), labels: Some(own) });
    let case = data.join("cases/A_colin_L_mild");
    if case.exists() {
        let t1 = scan(&case.join("pre.nii.gz"));
        let tissue = scan(&case.join("truth/tissue_pre.nii.gz"));
        let ventricle = scan(&case.join("truth/ventricles_clean_pre.nii.gz"));
        let onto = |v: &Volume<f32, Native>| {
            resample(v, &t1.grid, &hgm::geometry::AffineTransform::identity(), Interpolation::Nearest, 0.0).volume
        };
        let (tissue, ventricle) = (onto(&tissue), onto(&ventricle));
        let labels =
            Volume::from_fn(t1.grid, |n| if ventricle.data[n] > 0.5 { label::VENTRICLE } else { tissue.data[n] as u8 });
        all.push(Known { name: "case A", t1, labels: Some(labels) });
    }
    for name in ["good_b", "gap"] {
        all.push(Known { name, t1: scan(&heads.join(format!("{name}_t1.nii.gz"))), labels: None });
    }
    all
}
