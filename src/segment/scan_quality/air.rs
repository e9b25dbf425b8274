//! The air around the head: its noise, and what lies in it that is none.
//!
//! Mortamet et al., "Automatic quality assessment in structural brain magnetic resonance imaging", MRM 62(2), 2009, as MRIQC does
//! it: what is above the noise by ten deviations and stays under an opening, above the plane through nasion and cerebellum
//! (below it lie mouth, neck and what a defacing takes).

use super::super::label;
use super::super::posed_scan::PosedScan;
use super::block::Blocks;
use crate::geometry::{Frame, Mni, Position};
use crate::image::components::{Connectivity, fill_holes, largest_component};
use crate::image::morphology::dilate;
use crate::image::{LabelMap, Mask, Volume};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the air around the head can tell of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Air {
    /// Air with its noise is in the field of view.
    Seen,
    /// Most of it is of one value: the scan was stripped, masked or defaced, or its noise was cut off. What lay there cannot be told.
    Blank,
    /// Hardly any air above the skull's base lies in the field of view.
    Outside,
}

/// The head is brighter than this share of white matter, averaged over blocks; ghosts are darker.
const HEAD: f64 = 0.25;
/// Skull and scalp are within this distance of the brain, however dark a coil shows them.
const SKULL_MM: f64 = 15.0;
/// What is as near as this to the head is none of the air: padding, the spread of fat.
const MARGIN_MM: f64 = 10.0;
/// Fewer voxels of air than this say nothing.
const LEAST: usize = 5000;
/// Values within this share of white matter from the least one are blank.
const BLANK: f64 = 1e-4;
/// An air of which more than this share is blank was cut out.
const MOSTLY: f64 = 0.5;
/// Voxels above the median of the air by so many deviations are no noise.
const DEVIATIONS: f32 = 10.0;
/// Median absolute deviation of noise over its median (Rayleigh): that of whole numbers can be 0.
const NOISE: f32 = 0.38;

/// The noise of the air, in the scan's units, and what is none.
pub(super) struct Noise {
    /// Standard deviation, from the median absolute deviation.
    pub deviation: f64,
    /// Share of the air that is no noise, percent.
    pub artefact_percent: f64,
}

/// What the air says.
pub(super) struct SeenAir {
    pub air: Air,
    /// Where it is seen.
    pub noise: Option<Noise>,
}

/// Looks at the air; `white` is the brightness of white matter, `blocks` those of the scan.
pub(super) fn seen<F: Frame>(scan: &PosedScan<'_, F>, labels: &LabelMap<F>, blocks: &Blocks<F>, white: f64) -> SeenAir {
    let place = air_of(scan, labels, blocks, white);
    let t1 = scan.t1;
    let all: Vec<u32> = (0..t1.data.len() as u32).filter(|&n| place.data[n as usize]).collect();
    if all.len() < LEAST || white <= 0.0 {
        return SeenAir { air: Air::Outside, noise: None };
    }
    let least = all.iter().map(|&n| t1.data[n as usize]).fold(f32::INFINITY, f32::min);
    let blank = least + (BLANK * white) as f32;
    let values: Vec<f32> = all.iter().map(|&n| t1.data[n as usize]).filter(|x| *x > blank).collect();
    if (values.len() as f64) < (1.0 - MOSTLY) * all.len() as f64 {
        return SeenAir { air: Air::Blank, noise: None };
    }
    let (median, deviation) = median_and_deviation(values);
    let bright = median + DEVIATIONS * deviation.max(NOISE * median);
    let hot = Mask::from_fn(t1.grid, |n| place.data[n] && t1.data[n] > bright);
    let artefact_percent = 100.0 * opened(&hot, &all) as f64 / all.len() as f64;
    SeenAir { air: Air::Seen, noise: Some(Noise { deviation: 1.4826 * f64::from(deviation), artefact_percent }) }
}

/// The voxels of air above the base of the skull.
fn air_of<F: Frame>(scan: &PosedScan<'_, F>, labels: &LabelMap<F>, blocks: &Blocks<F>, white: f64) -> Mask<F> {
    let grid = scan.t1.grid;
    let mean = blocks.means(|n| scan.t1.data[n]);
    let brain = blocks.means(|n| f32::from(u8::from(labels.data[n] != label::BACKGROUND)));
    let bright = largest_component(&mean.map(|x| f64::from(x) > HEAD * white), Connectivity::Faces);
    let around = dilate(&brain.map(|share| share > 0.0), SKULL_MM);
    let head = fill_holes(&Volume::from_fn(mean.grid, |n| bright.data[n] || around.data[n]));
    let near = dilate(&head, MARGIN_MM);
    let air = Mask::from_fn(mean.grid, |n| {
        !near.data[n] && above_the_base(scan.mni_from_t1.apply(mean.grid.centre(mean.grid.voxel(n))))
    });
    Volume::from_voxels(grid, |voxel| air.data[blocks.place(voxel)])
}

/// Above the plane through the nasion and the cerebellum's lowest point, from ear to ear.
fn above_the_base(p: Position<Mni>) -> bool {
    const NASION_MM: [f64; 2] = [84.0, -44.0];
    const CEREBELLUM_MM: [f64; 2] = [-60.0, -62.0];
    let slope = (NASION_MM[1] - CEREBELLUM_MM[1]) / (NASION_MM[0] - CEREBELLUM_MM[0]);
    p.mm.z > NASION_MM[1] + slope * (p.mm.y - NASION_MM[0])
}

/// Median and median absolute deviation; there is at least one value.
fn median_and_deviation(mut values: Vec<f32>) -> (f32, f32) {
    let middle = values.len() / 2;
    let median = *values.select_nth_unstable_by(middle, f32::total_cmp).1;
    for x in &mut values {
        *x = (*x - median).abs();
    }
    (median, *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// Voxels of a mask that a cross of seven covers without leaving the mask; `among` holds all that can be in it.
fn opened<F: Frame>(mask: &Mask<F>, among: &[u32]) -> usize {
    let cross = |n: u32| {
        let [i, j, k] = mask.grid.voxel(n as usize).map(|v| v as isize);
        [[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
            .map(|[a, b, c]| [i + a, j + b, k + c])
    };
    let is_in = |[i, j, k]: [isize; 3]| mask.get(i, j, k) == Some(true);
    let middles = among.iter().filter(|&&n| mask.data[n as usize] && cross(n).into_iter().all(is_in));
    let mut covered: Vec<usize> =
        middles.flat_map(|&n| cross(n)).map(|[i, j, k]| mask.grid.index(i as usize, j as usize, k as usize)).collect();
    covered.sort_unstable();
    covered.dedup();
    covered.len()
}
