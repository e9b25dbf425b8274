//! Whether a label map lies on the scan that it is said to label, whatever the scan's contrast.

use crate::anatomy::label;
use crate::geometry::{Frame, Position};
use crate::image::{LabelMap, Volume};
use nalgebra::Vector3;
use thiserror::Error;

/// What speaks against a label map being that of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum Disagreement {
    /// Where it lies the map explains the scan hardly better than beside it.
    #[error(
        "it does not lie on this scan: its labels explain {here_percent:.0} % of the scan's variance where they lie and \
         {beside_percent:.0} % when moved {ASIDE_MM:.0} mm aside; it is another scan's map, or it was turned, mirrored or moved: \
         give the map made from this very scan, as the tool wrote it"
    )]
    Aside {
        /// Share of the variance of intensities that the labels explain, percent.
        here_percent: f64,
        /// The most they explain anywhere beside, percent.
        beside_percent: f64,
    },
    /// The ventricles look like tissue.
    #[error(
        "its ventricles look like tissue in this scan (their median is {ventricle:.0}, grey matter's {grey:.0}, white matter's \
         {white:.0}): labels are mixed up, or the scan does not tell fluid from tissue"
    )]
    VentriclesOfTissue {
        /// Median intensity of the ventricles, in the scan's units.
        ventricle: f64,
        /// Of grey matter.
        grey: f64,
        /// Of white matter.
        white: f64,
    },
}

/// How far a map is moved to see whether it lies better there, mm: farther than cortex is thick.
const ASIDE_MM: f64 = 8.0;
/// A map lies on its scan when it explains so many times what it explains beside. Maps of six scans, among them thick slices
/// and a surface coil's, explain 6.9 to 11 times as much; mirrored left to right 2.0 times.
const TIMES: f64 = 2.5;
/// Fluid lies outside what grey and white matter span by at least this share of their distance.
const BEYOND: f64 = 0.25;
/// Fewer voxels than this say nothing.
const FEW: usize = 200;
/// One labelled voxel in so many is looked at.
const STRIDE: usize = 11;

/// What is wrong with a map (in hgm's numbers, on any grid of the scan's frame) as that of a scan, if anything is.
pub fn disagreement<F: Frame>(scan: &Volume<f32, F>, labels: &LabelMap<F>) -> Option<Disagreement> {
    let places: Vec<(Position<F>, u8)> = (0..labels.data.len())
        .filter(|&n| labels.data[n] != label::BACKGROUND)
        .step_by(STRIDE)
        .map(|n| (labels.grid.centre(labels.grid.voxel(n)), labels.data[n]))
        .collect();
    let here = sampled(scan, &places, Vector3::zeros());
    let beside = (0..6).map(|way| {
        let mut by = Vector3::zeros();
        by[way / 2] = if way % 2 == 0 { ASIDE_MM } else { -ASIDE_MM };
        explained(&sampled(scan, &places, by))
    });
    let (at_home, elsewhere) = (explained(&here), beside.fold(0.0, f64::max));
    if at_home < TIMES * elsewhere {
        return Some(Disagreement::Aside { here_percent: 100.0 * at_home, beside_percent: 100.0 * elsewhere });
    }
    let [ventricle, grey, white] =
        [label::VENTRICLE, label::GREY_MATTER, label::WHITE_MATTER].map(|l| median(&here, l));
    let (Some(ventricle), Some(grey), Some(white)) = (ventricle, grey, white) else { return None };
    let room = BEYOND * (white - grey).abs();
    let tissue = grey.min(white) - room..=grey.max(white) + room;
    tissue.contains(&ventricle).then_some(Disagreement::VentriclesOfTissue { ventricle, grey, white })
}

/// Intensities with labels, as the map lies when moved.
fn sampled<F: Frame>(scan: &Volume<f32, F>, places: &[(Position<F>, u8)], by: Vector3<f64>) -> Vec<(f64, u8)> {
    let read = |&(place, label): &(Position<F>, u8)| {
        let value = scan.nearest(Position::new(place.mm.x + by.x, place.mm.y + by.y, place.mm.z + by.z))?;
        Some((f64::from(value), label))
    };
    places.iter().filter_map(read).collect()
}

/// The correlation ratio: the share of the variance of intensities that lies between labels. What is brighter than all but
/// one in a hundred counts as no brighter than that: a vessel is not worth a thousand voxels.
fn explained(values: &[(f64, u8)]) -> f64 {
    let mut sorted: Vec<f64> = values.iter().map(|v| v.0).collect();
    if sorted.len() < FEW {
        return 0.0;
    }
    sorted.sort_unstable_by(f64::total_cmp);
    let (low, high) = (sorted[sorted.len() / 100], sorted[sorted.len() - 1 - sorted.len() / 100]);
    let mut of_label = [[0.0f64; 3]; 256];
    for &(value, label) in values {
        let value = value.clamp(low, high);
        for (sum, term) in of_label[usize::from(label)].iter_mut().zip([1.0, value, value * value]) {
            *sum += term;
        }
    }
    let about_mean = |[count, sum, squares]: [f64; 3]| squares - sum * sum / count.max(1.0);
    let whole = of_label.iter().fold([0.0; 3], |all, one| [all[0] + one[0], all[1] + one[1], all[2] + one[2]]);
    let within: f64 = of_label.into_iter().map(about_mean).sum();
    if about_mean(whole) > 0.0 { 1.0 - within / about_mean(whole) } else { 0.0 }
}

fn median(values: &[(f64, u8)], label: u8) -> Option<f64> {
    let mut own: Vec<f64> = values.iter().filter(|v| v.1 == label).map(|v| v.0).collect();
    let middle = own.len() / 2;
    (own.len() >= FEW / STRIDE).then(|| *own.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Mni, Pre};
    use crate::image::Grid;
    use crate::segment::atlas;

    /// The template as a scan of some contrast, and its labels.
    fn scan(contrast: impl Fn(f32) -> f32 + Sync + Send) -> (Volume<f32, Pre>, LabelMap<Pre>) {
        let template = atlas::template();
        let t1: Volume<f32, Mni> = template.t1_f32().map(|x| if x > 0.0 { contrast(x) } else { 0.0 });
        (t1.relabelled(), template.labels.clone().relabelled())
    }

    fn mirrored(labels: &LabelMap<Pre>, axis: usize) -> LabelMap<Pre> {
        let dims = labels.grid.dims;
        Volume::from_fn(labels.grid, |n| {
            let mut voxel = labels.grid.voxel(n);
            voxel[axis] = dims[axis] - 1 - voxel[axis];
            labels.data[labels.grid.index(voxel[0], voxel[1], voxel[2])]
        })
    }

    #[test]
    fn a_scans_own_map_is_believed_whatever_the_contrast_and_a_mirrored_or_moved_one_is_not() {
        for contrast in [|x| x, |x| 260.0 - x] {
            let (t1, labels) = scan(contrast);
            assert_eq!(disagreement(&t1, &labels), None);
            // The template is symmetric from left to right.
            for axis in [1, 2] {
                let found = disagreement(&t1, &mirrored(&labels, axis));
                assert!(matches!(found, Some(Disagreement::Aside { .. })), "{axis}: {found:?}");
            }
            let mut askew = labels.grid.mm_from_voxel;
            askew[(2, 3)] += 6.0;
            let moved = LabelMap::from_data(Grid::new(labels.grid.dims, askew).unwrap(), labels.data.clone());
            assert!(matches!(disagreement(&t1, &moved), Some(Disagreement::Aside { .. })));
        }
    }

    #[test]
    fn nuclei_called_ventricles_are_told() {
        let (t1, labels) = scan(|x| x);
        let deep = atlas::deep_grey();
        let mixed = Volume::from_fn(labels.grid, |n| match (labels.data[n], deep.data[n]) {
            (label::VENTRICLE, _) => label::GREY_MATTER,
            (_, true) => label::VENTRICLE,
            (other, false) => other,
        });
        assert!(matches!(disagreement(&t1, &mixed), Some(Disagreement::VentriclesOfTissue { .. })));
    }

    #[test]
    fn a_scan_without_any_contrast_is_not_that_of_a_map() {
        let (t1, labels) = scan(|_| 100.0);
        assert!(disagreement(&t1, &labels).is_some());
    }
}
