//! Seeded mishaps of good heads: turned by up to 60 degrees, cropped, of another size, shaded, noisy, with slices missing, inverted,
//! padded. The answer agrees with the one on the unhurt head, or there is none.
//!
//! `HGM_BENCH_MISHAPS` names others than the usual ones, heads with their seeds: `child3y:3,7 gap:20-39`. In the folder
//! `HGM_BENCH_KEEP` the hurt scans and the labels found on them are kept to be looked at.

use crate::bar::{Bar, data, numbers};
use crate::heads::segmented;
use hgm::geometry::{Native, Position, RigidTransform};
use hgm::image::nifti::{ReadOptions, decode, encode_f32};
use hgm::image::resample::{Interpolation, resample};
use hgm::image::{Grid, LabelMap, Mask, Volume};
use hgm::material::random::CounterRng;
use hgm::segment::native::labels_on;
use nalgebra::{Matrix4, Point3, Vector3};
use std::path::Path;

const HEADS: [&str; 2] = ["good_b", "gap"];
/// Mishaps of each head.
const EACH: u64 = 20;
/// Agreement with the answer on the unhurt head that counts as right.
const RIGHT: f64 = 0.93;
/// Share of the mishaps that may come out wrong with exit code 0.
const TOLERATED: f64 = 0.005;

pub fn bars() -> Vec<Bar> {
    let Some(heads) = data().map(|d| d.join("heads")).filter(|d| d.exists()) else {
        println!("skipped: mishaps of real heads (heads/)");
        return Vec::new();
    };
    let temporary = tempfile::tempdir().unwrap();
    let kept = std::env::var_os("HGM_BENCH_KEEP").map(std::path::PathBuf::from);
    let folder = kept.as_deref().unwrap_or(temporary.path());
    let (mut right, mut refused, mut wrong) = (0usize, 0usize, Vec::new());
    let wanted = wanted();
    for (head, seeds) in &wanted {
        let path = heads.join(format!("{head}_t1.nii.gz"));
        let t1 = scan(&path);
        let unhurt = segmented(&path, &folder.join(format!("{head}_dseg.nii.gz")));
        let Some(unhurt) = unhurt.labels else {
            wrong.push(format!("{head} itself refused"));
            continue;
        };
        for &seed in seeds {
            let mishap = Mishap::drawn(&t1, seed, 1.0);
            let name = if kept.is_some() { format!("{head}_{seed}") } else { "hurt".to_owned() };
            let file = folder.join(format!("{name}.nii.gz"));
            std::fs::write(&file, encode_f32(&mishap.scan)).unwrap();
            let found = segmented(&file, &folder.join(format!("{name}_dseg.nii.gz")));
            let said = if let Some(labels) = found.labels {
                let dice = mishap.agreement(&labels, &unhurt);
                if dice >= RIGHT {
                    right += 1;
                } else {
                    wrong.push(format!("{head} {seed}: {dice:.3}"));
                }
                format!("{dice:.3}")
            } else {
                refused += 1;
                "refused".to_owned()
            };
            println!("{head} {seed:<3} {said:<8} {}", mishap.words);
        }
    }
    let all: usize = wanted.iter().map(|(_, seeds)| seeds.len()).sum();
    let said = format!("{right} right, {refused} refused, {} wrong of {all} {wrong:?}", wrong.len());
    let met = wrong.len() as f64 <= TOLERATED * all as f64;
    vec![Bar::new("corruptions of good heads", "Dice >= .93 or refused; wrong <= 0.5 %", said, met)]
}

/// Heads and the seeds of their mishaps.
fn wanted() -> Vec<(String, Vec<u64>)> {
    let Ok(words) = std::env::var("HGM_BENCH_MISHAPS") else {
        return HEADS.map(|head| (head.to_owned(), (0..EACH).collect())).to_vec();
    };
    let of_head = |word: &str| {
        let (head, seeds) = word.split_once(':').expect("HGM_BENCH_MISHAPS: HEAD:SEEDS");
        (head.to_owned(), numbers(seeds))
    };
    words.split_whitespace().map(of_head).collect()
}

pub fn scan(path: &Path) -> Volume<f32, Native> {
    let name = path.display().to_string();
    decode(&std::fs::read(path).unwrap(), &name, &ReadOptions::default()).unwrap().volume
}

/// A hurt scan and the way back.
pub struct Mishap {
    pub scan: Volume<f32, Native>,
    unhurt_from_hurt: RigidTransform<Native, Native>,
    zoom: f64,
    pub words: String,
}

impl Mishap {
    /// Noise and shading are `severity` times what they are in the usual mishap.
    pub fn drawn(t1: &Volume<f32, Native>, seed: u64, severity: f64) -> Self {
        let rng = CounterRng::new(seed, 77);
        let draw = |n: u64| 2.0 * rng.uniform(n) - 1.0;
        let happens = |n: u64, share: f64| rng.uniform(n) < share;
        let direction = |n: u64| Vector3::new(draw(n), draw(n + 1), draw(n + 2)).normalize();
        let degrees = 60.0 * rng.uniform(20);
        let middle = t1.grid.position(Point3::from(t1.grid.dims.map(|n| n as f64 / 2.0))).mm;
        let unhurt_from_hurt = RigidTransform::about(middle, direction(0) * degrees.to_radians(), direction(3) * 25.0);
        let centre = unhurt_from_hurt.inverse().apply(Position::from_point(middle)).mm;
        let padded = happens(21, 0.2);
        let spacing_mm = 1.2;
        let mut dims = if padded { [260, 270, 260] } else { [180, 210, 210] };
        let mut origin = [0, 1, 2].map(|a| centre[a] - 0.5 * spacing_mm * dims[a] as f64);
        let cut = if happens(22, 0.4) { (60.0 * rng.uniform(23) / spacing_mm) as usize } else { 0 };
        let axis = (3.0 * rng.uniform(24)) as usize % 3;
        dims[axis] -= cut;
        if happens(25, 0.5) {
            origin[axis] += spacing_mm * cut as f64;
        }
        let grid = Grid::axis_aligned(dims, [spacing_mm; 3], origin);
        let mut scan = resample(t1, &grid, &unhurt_from_hurt.to_affine(), Interpolation::Linear, 0.0).volume;
        let brightest = scan.data.iter().copied().fold(0.0f32, f32::max);
        let inverted = happens(26, 0.1);
        let (shade, gain) = (direction(6), severity * 0.7 * rng.uniform(27));
        let noise_sd = severity * 0.04 * rng.uniform(28) * f64::from(brightest);
        let missing = if happens(29, 0.2) { 1 + (5.0 * rng.uniform(30)) as usize } else { 0 };
        let first_missing = dims[2] / 4 + (rng.uniform(31) * dims[2] as f64 / 2.0) as usize;
        for n in 0..scan.data.len() {
            let voxel = grid.voxel(n);
            let p = grid.position(Point3::from(voxel.map(|v| v as f64))).mm;
            let noise: f64 = (0..4).map(|c| rng.uniform(1000 + 4 * n as u64 + c) - 0.5).sum::<f64>() * 3f64.sqrt();
            let plain = if inverted && scan.data[n] > 0.0 { brightest - scan.data[n] } else { scan.data[n] };
            let shaded = f64::from(plain) * (gain * shade.dot(&(p - centre)) / 90.0).exp();
            let gone = (first_missing..first_missing + missing).contains(&voxel[2]);
            scan.data[n] = if gone { 0.0 } else { (shaded + noise_sd * noise).max(0.0) as f32 };
        }
        let zoom = 1.0 + 0.2 * draw(9);
        let zoomed = Grid::new(dims, Matrix4::new_scaling(zoom) * grid.mm_from_voxel).expect("a zoomed grid");
        let words = format!(
            "turned {degrees:.0} deg, zoom {zoom:.2}, gain {gain:.2}, noise {:.1} %, cut {cut} of axis {axis}, missing {missing}{}{}",
            100.0 * noise_sd / f64::from(brightest),
            if inverted { ", inverted" } else { "" },
            if padded { ", padded" } else { "" },
        );
        Self { scan: Volume::from_data(zoomed, scan.data), unhurt_from_hurt, zoom, words }
    }

    /// Dice of the brains, on the hurt scan.
    fn agreement(&self, found: &LabelMap<Native>, unhurt: &LabelMap<Native>) -> f64 {
        let grid = self.scan.grid;
        let expected = self.on_hurt(unhurt);
        let brain = |l: &LabelMap<Native>| Mask::from_data(grid, l.data.iter().map(|&l| l > 0).collect());
        brain(found).dice(&brain(&expected))
    }

    /// Labels of the unhurt head, on the hurt scan.
    pub fn on_hurt(&self, unhurt: &LabelMap<Native>) -> LabelMap<Native> {
        let grid = self.scan.grid;
        let true_size = Grid::new(grid.dims, Matrix4::new_scaling(1.0 / self.zoom) * grid.mm_from_voxel);
        let labels = labels_on(unhurt, &true_size.expect("a grid"), &self.unhurt_from_hurt);
        Volume::from_data(grid, labels.data)
    }

    /// Where a place of the hurt scan lies on the unhurt head.
    pub fn unhurt_place(&self, p: Position<Native>) -> Position<Native> {
        self.unhurt_from_hurt.apply(Position::from_point(p.mm / self.zoom))
    }
}
