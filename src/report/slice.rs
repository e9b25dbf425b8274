//! Slices through a volume as 8-bit pictures, and outlines of masks on them as SVG paths.
//!
//! Slices are shown the radiological way: the reader looks from the feet (axial) or from the front (coronal), so the
//! patient's right is on the left; sagittal slices have anterior on the left. Letters on every tile say so.

use super::picture::grey_png;
use crate::geometry::{Frame, Position};
use crate::image::{Mask, Volume};
use std::collections::BTreeMap;
use std::fmt::Write;

/// The plane of a slice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Plane {
    /// Normal to z.
    Axial,
    /// Normal to y.
    Coronal,
    /// Normal to x.
    Sagittal,
}

/// All planes, in the order a page shows them.
pub const PLANES: [Plane; 3] = [Plane::Axial, Plane::Coronal, Plane::Sagittal];

impl Plane {
    /// The axis it is normal to: 0 x, 1 y, 2 z.
    pub fn axis(self) -> usize {
        match self {
            Self::Axial => 2,
            Self::Coronal => 1,
            Self::Sagittal => 0,
        }
    }

    /// In-plane axes: (horizontal, vertical).
    pub fn in_plane(self) -> (usize, usize) {
        match self {
            Self::Axial => (0, 1),
            Self::Coronal => (0, 2),
            Self::Sagittal => (1, 2),
        }
    }

    /// Word for headings.
    pub fn name(self) -> &'static str {
        match self {
            Self::Axial => "Axial",
            Self::Coronal => "Coronal",
            Self::Sagittal => "Sagittal",
        }
    }

    /// Letters on the left and right side of a tile.
    pub fn sides(self) -> [&'static str; 2] {
        match self {
            Self::Axial | Self::Coronal => ["R", "L"],
            Self::Sagittal => ["A", "P"],
        }
    }
}

/// A rectangle of pixels in a plane: horizontal coordinates fall from left to right (see the module's convention),
/// vertical ones from top to bottom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tile {
    /// Plane.
    pub plane: Plane,
    /// Coordinate along the plane's normal, mm.
    pub at_mm: f64,
    /// In-plane coordinates of the centre of the top left pixel, mm.
    pub corner_mm: [f64; 2],
    /// Pixels.
    pub size: [usize; 2],
    /// Pixel size, mm.
    pub step_mm: f64,
}

impl Tile {
    /// Centre of pixel (x, y); fractions allowed.
    pub fn position<F: Frame>(&self, x: f64, y: f64) -> Position<F> {
        let (h, v) = self.plane.in_plane();
        let mut mm = [0.0; 3];
        mm[self.plane.axis()] = self.at_mm;
        mm[h] = self.corner_mm[0] - x * self.step_mm;
        mm[v] = self.corner_mm[1] - y * self.step_mm;
        Position::new(mm[0], mm[1], mm[2])
    }
}

/// Lowest and highest corner of a mask in mm, or `None` when it is empty.
pub fn bounds_mm<F: Frame>(mask: &Mask<F>) -> Option<[[f64; 3]; 2]> {
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for (n, _) in mask.data.iter().enumerate().filter(|(_, inside)| **inside) {
        let [i, j, k] = mask.grid.voxel(n).map(|x| x as f64);
        let p = mask.grid.position([i, j, k].into()).mm;
        for a in 0..3 {
            bounds[0][a] = bounds[0][a].min(p[a]);
            bounds[1][a] = bounds[1][a].max(p[a]);
        }
    }
    (bounds[0][0] <= bounds[1][0]).then_some(bounds)
}

/// Mean position of a mask's voxels in mm, or `None` when it is empty.
pub fn centroid_mm<F: Frame>(mask: &Mask<F>) -> Option<[f64; 3]> {
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for (n, _) in mask.data.iter().enumerate().filter(|(_, inside)| **inside) {
        let [i, j, k] = mask.grid.voxel(n).map(|x| x as f64);
        let p = mask.grid.position([i, j, k].into()).mm;
        (0..3).for_each(|a| sum[a] += p[a]);
        count += 1.0;
    }
    (count > 0.0).then(|| sum.map(|s| s / count))
}

/// A tile that shows all of `bounds_mm` with a margin, at `at_mm`, pixel centres on whole multiples of the step.
pub fn tile(plane: Plane, at_mm: f64, bounds_mm: [[f64; 3]; 2], margin_mm: f64, step_mm: f64) -> Tile {
    let (h, v) = plane.in_plane();
    let top = |a: usize| ((bounds_mm[1][a] + margin_mm) / step_mm).ceil() * step_mm;
    let count = |a: usize| ((top(a) - (bounds_mm[0][a] - margin_mm)) / step_mm).ceil() as usize + 1;
    Tile { plane, at_mm, corner_mm: [top(h), top(v)], size: [count(h), count(v)], step_mm }
}

/// `count` whole-millimetre positions evenly spread over the middle `share` of the mask's extent along a plane's normal.
pub fn positions_mm(plane: Plane, bounds_mm: [[f64; 3]; 2], count: usize, share: f64) -> Vec<f64> {
    let [low, high] = bounds_mm.map(|b| b[plane.axis()]);
    let (middle, half) = (f64::midpoint(low, high), (high - low) / 2.0 * share);
    let at = |n: usize| middle - half + 2.0 * half * (n as f64 + 0.5) / count as f64;
    (0..count).map(|n| at(n).round()).collect()
}

/// Grey values shown as black and as white, from the 0.5 and 99.5 % quantiles inside a mask; white matter stays below
/// white, so that outlines can be seen on it.
///
/// `None` when the mask is empty or the image is constant in it.
pub fn window<F: Frame>(volume: &Volume<f32, F>, mask: &Mask<F>) -> Option<[f32; 2]> {
    let mut values: Vec<f32> =
        volume.data.iter().zip(&mask.data).filter(|(v, m)| **m && v.is_finite()).map(|(v, _)| *v).collect();
    let last = values.len().checked_sub(1)?;
    let mut at = |q: f64| *values.select_nth_unstable_by((q * last as f64).round() as usize, f32::total_cmp).1;
    let [low, high] = [at(0.005), at(0.995)];
    // Black is kept for what lies outside the mask and for fluid near zero.
    (high > low).then_some([low.min(0.25 * high), high + 0.15 * (high - low)])
}

/// Grey bytes of a tile: the volume at `from_tile(position)`, black where the mask says no. The indirection lets a page
/// show an image as it lay before its registration.
pub fn grey<F: Frame, G: Frame>(
    tile: &Tile,
    volume: &Volume<f32, F>,
    mask: &Mask<F>,
    window: [f32; 2],
    from_tile: impl Fn(Position<G>) -> Position<F>,
) -> Vec<u8> {
    let mut bytes = vec![0u8; tile.size[0] * tile.size[1]];
    for y in 0..tile.size[1] {
        for x in 0..tile.size[0] {
            let p = from_tile(tile.position(x as f64, y as f64));
            if mask.nearest(p) == Some(true) {
                let value = volume.trilinear(p).unwrap_or(0.0);
                let t = (value - window[0]) / (window[1] - window[0]);
                bytes[x + y * tile.size[0]] = (255.0 * t.clamp(0.0, 1.0)).round() as u8;
            }
        }
    }
    bytes
}

/// PNG of [`grey`].
pub fn png<F: Frame, G: Frame>(
    tile: &Tile,
    volume: &Volume<f32, F>,
    mask: &Mask<F>,
    window: [f32; 2],
    from_tile: impl Fn(Position<G>) -> Position<F>,
) -> Vec<u8> {
    grey_png(tile.size[0], tile.size[1], &grey(tile, volume, mask, window, from_tile))
}

/// The mask's outline on a tile as SVG path data, in tenths of a pixel with pixel (0, 0) covering 0..10 (so that the
/// viewBox of the picture is `10 * size`); empty when the tile does not meet the mask. Marching squares at one half of
/// the interpolated mask.
pub fn outline<F: Frame, G: Frame>(
    tile: &Tile,
    mask: &Mask<F>,
    from_tile: impl Fn(Position<G>) -> Position<F>,
) -> String {
    // A border of zeros closes every line.
    let (w, h) = (tile.size[0] + 2, tile.size[1] + 2);
    let mut field = vec![0f32; w * h];
    for y in 0..tile.size[1] {
        for x in 0..tile.size[0] {
            let p = from_tile(tile.position(x as f64, y as f64));
            field[(x + 1) + (y + 1) * w] = fraction_inside(mask, p);
        }
    }
    path(&contours(&field, w, h, 0.5))
}

/// Trilinear interpolation of a mask as 0 and 1; outside the grid 0.
fn fraction_inside<F: Frame>(mask: &Mask<F>, p: Position<F>) -> f32 {
    let v = mask.grid.voxel_at(p);
    let base = [v.x.floor(), v.y.floor(), v.z.floor()];
    let part = [v.x - base[0], v.y - base[1], v.z - base[2]];
    let mut sum = 0.0;
    for corner in 0..8usize {
        let at: [usize; 3] = [corner & 1, corner >> 1 & 1, corner >> 2];
        let weight: f64 = (0..3).map(|a| if at[a] == 1 { part[a] } else { 1.0 - part[a] }).product();
        let [i, j, k] = std::array::from_fn(|a| base[a] as isize + at[a] as isize);
        if weight > 0.0 && mask.get(i, j, k) == Some(true) {
            sum += weight;
        }
    }
    sum as f32
}

/// Closed lines of a field at a level, in pixel units (0, 0 at the centre of the first sample). Marching squares with
/// the ambiguous squares separated, so that lines never cross. The field must be below the level on its border.
pub fn contours(field: &[f32], width: usize, height: usize, level: f32) -> Vec<Vec<[f64; 2]>> {
    // A crossing is named by its grid edge: 2 * sample index + (0: towards +x, 1: towards +y). Every crossing has one
    // successor, with the inside on the left.
    let mut next: BTreeMap<usize, usize> = BTreeMap::new();
    let inside = |x: usize, y: usize| field[x + y * width] >= level;
    let edge = |x: usize, y: usize, down: usize| 2 * (x + y * width) + down;
    for y in 0..height.saturating_sub(1) {
        for x in 0..width.saturating_sub(1) {
            let (top, right, bottom, left) = (edge(x, y, 0), edge(x + 1, y, 1), edge(x, y + 1, 0), edge(x, y, 1));
            let case = usize::from(inside(x, y))
                | usize::from(inside(x + 1, y)) << 1
                | usize::from(inside(x + 1, y + 1)) << 2
                | usize::from(inside(x, y + 1)) << 3;
            let steps: &[(usize, usize)] = match case {
                1 => &[(top, left)],
                2 => &[(right, top)],
                3 => &[(right, left)],
                4 => &[(bottom, right)],
                5 => &[(top, left), (bottom, right)],
                6 => &[(bottom, top)],
                7 => &[(bottom, left)],
                8 => &[(left, bottom)],
                9 => &[(top, bottom)],
                10 => &[(right, top), (left, bottom)],
                11 => &[(right, bottom)],
                12 => &[(left, right)],
                13 => &[(top, right)],
                14 => &[(left, top)],
                _ => &[],
            };
            next.extend(steps.iter().copied());
        }
    }
    let point = |id: usize| {
        let (n, down) = (id / 2, id % 2);
        let other = if down == 1 { n + width } else { n + 1 };
        let t = f64::from((level - field[n]) / (field[other] - field[n]));
        let (x, y) = ((n % width) as f64, (n / width) as f64);
        if down == 1 { [x, y + t] } else { [x + t, y] }
    };
    let mut lines = Vec::new();
    while let Some((&start, _)) = next.first_key_value() {
        let (mut line, mut id) = (Vec::new(), start);
        while let Some(following) = next.remove(&id) {
            line.push(point(id));
            id = following;
        }
        lines.push(line);
    }
    lines
}

/// Path data of contour lines of a field with a border of one sample.
fn path(lines: &[Vec<[f64; 2]>]) -> String {
    let mut data = String::new();
    for line in lines {
        // Sample n of the bordered field is pixel n - 1, whose centre lies at 10 n - 5 tenths.
        let tenths: Vec<[i64; 2]> = line.iter().map(|p| p.map(|x| (10.0 * x - 5.0).round() as i64)).collect();
        let count = tenths.len();
        let mut at = [0i64; 2];
        let mut first = true;
        for n in 0..count {
            let [before, here, after] = [tenths[(n + count - 1) % count], tenths[n], tenths[(n + 1) % count]];
            let turn = (here[0] - before[0]) * (after[1] - here[1]) - (here[1] - before[1]) * (after[0] - here[0]);
            if turn == 0 && !first {
                continue;
            }
            if first {
                let _ = write!(data, "M{} {}", here[0], here[1]);
                first = false;
            } else {
                let _ = write!(data, "l{} {}", here[0] - at[0], here[1] - at[1]);
            }
            at = here;
        }
        data.push('z');
    }
    data
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;

    fn ball(radius: f64) -> Mask<Mni> {
        let grid = Grid::axis_aligned([24, 26, 28], [1.0; 3], [-12.0, -13.0, -14.0]);
        let inside = |n: usize| {
            let [i, j, k] = grid.voxel(n).map(|x| x as f64);
            grid.position([i, j, k].into()).mm.coords.norm() <= radius
        };
        Mask::from_data(grid, (0..grid.len()).map(inside).collect())
    }

    fn area(line: &[[f64; 2]]) -> f64 {
        (0..line.len())
            .map(|n| (line[n], line[(n + 1) % line.len()]))
            .map(|(a, b)| (a[0] * b[1] - b[0] * a[1]) / 2.0)
            .sum::<f64>()
    }

    #[test]
    fn contour_encloses_the_disc_and_orients_the_hole_the_other_way() {
        let (w, h) = (41, 41);
        let ring = |n: usize| {
            let r = ((n % w) as f32 - 20.0).hypot((n / w) as f32 - 20.0);
            if (6.0..=15.0).contains(&r) { 1.0 } else { 0.0 }
        };
        let field: Vec<f32> = (0..w * h).map(ring).collect();
        let areas: Vec<f64> = contours(&field, w, h, 0.5).iter().map(|l| area(l)).collect();
        assert_eq!(areas.len(), 2);
        let pi = std::f64::consts::PI;
        let (outer, inner) = (areas[0].abs().max(areas[1].abs()), areas[0].abs().min(areas[1].abs()));
        assert!((outer / (pi * 225.0) - 1.0).abs() < 0.04 && (inner / (pi * 32.0) - 1.0).abs() < 0.1, "{areas:?}");
        assert!(areas[0] * areas[1] < 0.0);
    }

    #[test]
    fn squares_that_touch_at_a_corner_give_two_lines() {
        let mut field = vec![0.0; 36];
        (field[7], field[14]) = (1.0, 1.0);
        let lines = contours(&field, 6, 6, 0.5);
        assert_eq!(lines.len(), 2);
        assert!(lines.iter().all(|l| l.len() == 4));
    }

    #[test]
    fn patients_right_is_on_the_left() {
        let bounds = bounds_mm(&ball(8.0)).unwrap();
        assert_eq!(bounds, [[-8.0; 3], [8.0; 3]]);
        let axial = tile(Plane::Axial, 2.0, bounds, 1.0, 1.0);
        assert_eq!(axial.position::<Mni>(0.0, 0.0).mm, [9.0, 9.0, 2.0].into());
        let last = axial.position::<Mni>((axial.size[0] - 1) as f64, (axial.size[1] - 1) as f64);
        assert_eq!(last.mm, [-9.0, -9.0, 2.0].into());
        let sagittal = tile(Plane::Sagittal, 0.0, bounds, 0.0, 0.5);
        assert_eq!(sagittal.position::<Mni>(2.0, 0.0).mm, [0.0, 7.0, 8.0].into());
    }

    #[test]
    fn outline_and_grey_cover_the_same_pixels() {
        let mask = ball(8.0);
        let tile = tile(Plane::Coronal, 0.0, bounds_mm(&mask).unwrap(), 2.0, 1.0);
        let volume = mask.map(|inside| if inside { 2.0f32 } else { 9.0 });
        let bytes = grey::<Mni, Mni>(&tile, &volume, &mask, [0.0, 2.0], |p| p);
        assert_eq!(bytes.iter().filter(|b| **b == 255).count(), bytes.iter().filter(|b| **b > 0).count());
        let inside = bytes.iter().filter(|b| **b > 0).count() as f64;
        let data = outline::<Mni, Mni>(&tile, &mask, |p| p);
        let mut corners: Vec<[f64; 2]> = Vec::new();
        for step in data.trim_start_matches('M').trim_end_matches('z').split('l') {
            let (x, y) = step.split_once(' ').unwrap();
            let step: [f64; 2] = [x.parse().unwrap(), y.parse().unwrap()];
            let from = corners.last().copied().unwrap_or([0.0; 2]);
            corners.push([from[0] + step[0], from[1] + step[1]]);
        }
        assert!((area(&corners).abs() / 100.0 / inside - 1.0).abs() < 0.06, "{} {inside}", area(&corners));
    }

    #[test]
    fn an_empty_mask_has_no_outline_bounds_or_window() {
        let mask = ball(-1.0);
        assert!(bounds_mm(&mask).is_none() && centroid_mm(&mask).is_none());
        assert!(window(&mask.map(|_| 1.0f32), &mask).is_none());
        let tile = tile(Plane::Axial, 0.0, [[-5.0; 3], [5.0; 3]], 0.0, 1.0);
        assert_eq!(outline::<Mni, Mni>(&tile, &mask, |p| p), "");
    }
}
