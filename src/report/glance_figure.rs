//! Three slices through the cavity with the seen shift in colour: the first thing a reader looks at.

use super::colour::ColourScale;
use super::figure::{CaseImages, Structure, TileFigure};
use super::picture::Picture;
use super::slice::{self, PLANES, Tile};
use crate::experiment::field::at;
use crate::geometry::{Mni, Position};
use crate::image::{Mask, Volume};

/// Pixel size of the slices, mm.
const STEP_MM: f64 = 1.0;
/// How much of the colour covers the grey of the scan, of 255.
const WASH: u8 = 140;

/// The slices, and what their colours mean.
#[derive(Clone, Debug, PartialEq)]
pub struct GlanceFigure {
    /// One slice for each plane; a second layer has the colours.
    pub tiles: Vec<TileFigure>,
    /// Sizes of the shift, mm; absent where no shift was followed.
    pub scale: Option<ColourScale>,
    /// What is outlined.
    pub structures: Vec<Structure>,
}

/// Slices of the pre-operative scan where most was taken out (the middle of the brain where nothing was).
pub fn glance_figure(images: &CaseImages, seen: Option<&Volume<[f32; 3], Mni>>) -> Option<GlanceFigure> {
    let bounds = slice::bounds_mm(&images.pre_brain)?;
    let window = slice::window(&images.pre, &images.pre_brain)?;
    let cut = images.resected.as_ref().or(images.cavity.as_ref());
    let middle = [0, 1, 2].map(|a| f64::midpoint(bounds[0][a], bounds[1][a]));
    let focus_mm = cut.and_then(slice::centroid_mm).unwrap_or(middle).map(f64::round);
    let tiles = PLANES.map(|plane| slice::tile(plane, focus_mm[plane.axis()], bounds, 4.0, STEP_MM));
    let left = |p: Position<Mni>| {
        let inside = |mask: &Mask<Mni>| mask.nearest(p) == Some(true);
        inside(&images.pre_brain) && !images.resected.as_ref().is_some_and(inside)
    };
    let size_mm = |p: Position<Mni>| -> Option<f64> {
        let [x, y, z] = at(seen?, p)?;
        left(p).then(|| x.hypot(y).hypot(z))
    };
    let sizes: Vec<Vec<Option<f64>>> = tiles.iter().map(|tile| pixels(tile).map(size_mm).collect()).collect();
    let scale = ColourScale::to_95(sizes.iter().flatten().flatten().copied(), "shift seen between the scans (mm)");
    let mut masks = vec![(Structure::Brain, &images.pre_brain)];
    masks.extend(images.resected.as_ref().map(|mask| (Structure::Resected, mask)));
    let drawn = tiles.iter().zip(&sizes).map(|(tile, sizes)| {
        let mut layers = vec![slice::png::<Mni, Mni>(tile, &images.pre, &images.pre_brain, window, |p| p)];
        layers.extend(scale.as_ref().map(|scale| coloured(tile, sizes, scale)));
        let outline =
            |(structure, mask): &(Structure, &Mask<Mni>)| (*structure, slice::outline::<Mni, Mni>(tile, mask, |p| p));
        let outlines = masks.iter().map(outline).filter(|(_, path)| !path.is_empty()).collect();
        TileFigure { tile: *tile, layers, outlines }
    });
    let tiles: Vec<TileFigure> = drawn.collect();
    let structures =
        masks.iter().map(|(s, _)| *s).filter(|s| tiles.iter().any(|t| t.outlines.iter().any(|o| o.0 == *s)));
    Some(GlanceFigure { structures: structures.collect(), tiles, scale })
}

/// The positions of a tile's pixels, row by row.
fn pixels(tile: &Tile) -> impl Iterator<Item = Position<Mni>> + '_ {
    let [width, height] = tile.size;
    (0..width * height).map(move |n| tile.position((n % width) as f64, (n / width) as f64))
}

/// A layer of colours, clear where there is no shift to show.
fn coloured(tile: &Tile, sizes_mm: &[Option<f64>], scale: &ColourScale) -> Vec<u8> {
    let [width, height] = tile.size;
    let mut picture = Picture::filled(width, height, [0; 4]);
    for (n, size) in sizes_mm.iter().enumerate() {
        if let Some(size) = size {
            let [r, g, b] = scale.colour(*size);
            picture.set(n % width, n / width, [r, g, b, WASH]);
        }
    }
    picture.to_png()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    fn images() -> CaseImages {
        let grid = Grid::<Mni>::axis_aligned([30, 36, 24], [4.0; 3], [-58.0, -70.0, -40.0]);
        let inside = |radius_mm: f64, middle: [f64; 3]| {
            Mask::from_fn(grid, |n| {
                let p = grid.position(grid.voxel(n).map(|v| v as f64).into()).mm;
                (0..3).map(|a| (p[a] - middle[a]).powi(2)).sum::<f64>() < radius_mm * radius_mm
            })
        };
        CaseImages {
            pre: Volume::from_fn(grid, |n| 50.0 + grid.voxel(n)[0] as f32),
            pre_brain: inside(44.0, [0.0; 3]),
            post: None,
            labels: None,
            resected: Some(inside(14.0, [20.0, 8.0, 12.0])),
            cavity: None,
            registered_from_scanned: None,
        }
    }

    #[test]
    fn slices_go_through_what_was_taken_out_and_are_coloured_only_where_a_shift_was_seen() {
        let images = images();
        let plain = glance_figure(&images, None).unwrap();
        assert!(plain.scale.is_none() && plain.tiles.iter().all(|t| t.layers.len() == 1));
        let middle = slice::centroid_mm(images.resected.as_ref().unwrap()).unwrap();
        for tile in &plain.tiles {
            assert!((tile.tile.at_mm - middle[tile.tile.plane.axis()]).abs() < 1.0);
            assert!(tile.outlines.iter().any(|o| o.0 == Structure::Resected));
        }
        let seen = Volume::filled(images.pre.grid, [0.0f32, -3.0, 4.0]);
        let shown = glance_figure(&images, Some(&seen)).unwrap();
        assert!((shown.scale.unwrap().high - 5.0).abs() < 1e-6 && shown.tiles.iter().all(|t| t.layers.len() == 2));
    }
}
