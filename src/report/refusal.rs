//! A picture of what a step saw when it gave up: it stands alone, for whoever reads the message.
//!
//! No face: in the template's frame only what lies around the brain is shown, and a scan without a pose only in axial slices.

use super::colour::Rgb;
use super::lettering;
use super::picture::Picture;
use super::slice::{self, Plane, Tile};
use crate::geometry::{Frame, Mni, RigidTransform};
use crate::image::morphology::dilate;
use crate::image::resample::{Interpolation, resample};
use crate::image::{Mask, Volume};
use crate::segment::atlas;

/// What is shown around the mean head's brain, mm: the rim in which a brain taken for another would end.
const AROUND_MM: f64 = 8.0;
/// Pixel size, mm.
const STEP_MM: f64 = 1.0;
/// Pixels between the slices.
const GAP: usize = 6;
/// Of the letters that tell the patient's sides.
const INK: Rgb = [201, 209, 216];

/// Grey slices of one scan, left to right.
pub type Row = Vec<(Tile, Vec<u8>)>;

/// Slices of a scan that has a pose, as the template lies; the same places for every scan.
pub fn posed<F: Frame>(scan: &Volume<f32, F>, mni_from_scan: &RigidTransform<F, Mni>) -> Row {
    let brain = &atlas::mean_head().brain;
    let shown = dilate(brain, AROUND_MM);
    let seen = resample(scan, &brain.grid, &mni_from_scan.inverse().to_affine(), Interpolation::Linear, 0.0);
    let Some(bounds) = slice::bounds_mm(&shown) else { return Row::new() };
    let tiles = [Plane::Axial, Plane::Coronal, Plane::Sagittal].into_iter().flat_map(|plane| {
        slice::positions_mm(plane, bounds, 2, 0.5)
            .into_iter()
            .map(move |at| slice::tile(plane, at, bounds, 2.0, STEP_MM))
    });
    row(&seen.volume, &shown, tiles)
}

/// Axial slices of a scan as its header says it lies.
pub fn as_scanned<F: Frame>(scan: &Volume<f32, F>) -> Row {
    let whole = Mask::filled(scan.grid, true);
    let Some(bounds) = slice::bounds_mm(&whole) else { return Row::new() };
    let at = slice::positions_mm(Plane::Axial, bounds, 4, 0.8);
    row(scan, &whole, at.into_iter().map(|at| slice::tile(Plane::Axial, at, bounds, 0.0, STEP_MM)))
}

fn row<F: Frame>(scan: &Volume<f32, F>, shown: &Mask<F>, tiles: impl Iterator<Item = Tile>) -> Row {
    let Some(window) = slice::window(scan, shown) else { return Row::new() };
    tiles.map(|tile| (tile, slice::grey::<F, F>(&tile, scan, shown, window, |p| p))).collect()
}

/// The rows below each other as a PNG, with its size in pixels; `None` where nothing can be shown.
pub fn picture(rows: &[Row]) -> Option<(Vec<u8>, [usize; 2])> {
    let high = |row: &Row| row.iter().map(|t| t.0.size[1]).max().unwrap_or(0);
    let wide = |row: &Row| row.iter().map(|t| t.0.size[0] + GAP).sum::<usize>();
    let width = rows.iter().map(wide).max()?.checked_sub(GAP)?;
    let height = (rows.iter().map(|r| high(r) + GAP).sum::<usize>()).checked_sub(GAP)?;
    let mut picture = Picture::filled(width, height, [0, 0, 0, 255]);
    let mut y = 0;
    for row in rows {
        let mut x = 0;
        for (tile, grey) in row {
            let ([w, h], [left, right]) = (tile.size, tile.plane.sides());
            let rgba = grey.iter().flat_map(|&g| [g, g, g, 255]).collect();
            picture.paste(&Picture { width: w, height: h, rgba }, x, y);
            lettering::write(&mut picture, left, [x + 4, y + 4], 2, INK);
            let far = (x + w).saturating_sub(4 + lettering::width(right, 2));
            lettering::write(&mut picture, right, [far, y + 4], 2, INK);
            x += w + GAP;
        }
        y += high(row) + GAP;
    }
    Some((picture.to_png(), [width, height]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_lie_below_each_other_and_nothing_gives_no_picture() {
        let head = atlas::mean_head();
        let rows = [posed(&head.t1, &RigidTransform::identity()), as_scanned(&head.t1)];
        let (png, [width, height]) = picture(&rows).unwrap();
        assert!(png.starts_with(b"\x89PNG") && width > 500 && height > 300, "{width} x {height}");
        let tile = &rows[0][0];
        assert!(tile.1[0] == 0 && tile.1.iter().any(|g| *g > 100), "black around the head, bright in it");
        assert_eq!(picture(&[]), None);
        assert_eq!(picture(&[as_scanned(&head.t1.map(|_| 3.0))]), None);
    }
}
