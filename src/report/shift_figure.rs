//! The brain shift on a slice: seen, modelled, and what is between them, on one scale.

use super::colour::ColourScale;
use super::page::{CaptionedPicture, PredictionFigure, ShiftFigure};
use super::picture::Picture;
use super::slice::Plane;
use crate::experiment::field::{at, in_tetrahedra};
use crate::geometry::{Mni, Position};
use crate::image::{Grid, Volume};
use crate::mesh::TetMesh;
use nalgebra::Point3;

/// Pixels for each mm.
const SCALE: usize = 2;
/// Distance between arrows, mm, and how many times longer than the shift they are.
const ARROWS_MM: usize = 10;
const LONGER: f64 = 2.0;
/// Share of the colour over the grey of the scan.
const WASH: f64 = 0.6;

/// The axial slice through the model's largest shift; `None` where nothing moves or nothing was seen.
pub fn shift_figure(
    t1: &Volume<f32, Mni>,
    seen: &Volume<[f32; 3], Mni>,
    mesh: &TetMesh,
    displacement_mm: &[[f64; 3]],
) -> Option<ShiftFigure> {
    let grid = slice_through(mesh, largest(displacement_mm)?);
    let model = in_tetrahedra(mesh.tets(), mesh.nodes_mm(), displacement_mm, &grid);
    let shown = |n: usize| -> Option<[[f64; 3]; 2]> {
        let model = model.at(n)?.map(f64::from);
        Some([at(seen, place(&grid, n)).unwrap_or_default(), model])
    };
    let panels: [(&str, &str, Panel<'_>); 3] = [
        ("Seen", "what the images show", &|[seen, _]| seen),
        ("Modelled", "what the model gives", &|[_, model]| model),
        ("Seen less modelled", "what the model leaves unexplained", &|[seen, model]| {
            [0, 1, 2].map(|a| seen[a] - model[a])
        }),
    ];
    let sizes = (0..grid.len()).filter_map(shown).flat_map(|both| both.map(length));
    let scale = ColourScale::to_95(sizes, "displacement (mm)")?;
    let pictures = panels.into_iter().map(|(caption, what, of)| {
        let picture = painted(t1, &grid, &scale, &|n| shown(n).map(of), Length::Shift);
        captioned(&picture, &grid, caption, &format!("{} {what}; {}", COLOUR_OF_SHIFT, lines()))
    });
    Some(ShiftFigure { pictures: pictures.collect(), scale })
}

/// The same slice of a prediction: the expected shift, how far 95 % of the draws go at most, and the standard deviation.
pub fn prediction_figure(
    t1: &Volume<f32, Mni>,
    mesh: &TetMesh,
    mean_mm: &[[f64; 3]],
    reach95_mm: &[f64],
    sd_mm: &[f64],
) -> Option<PredictionFigure> {
    let grid = slice_through(mesh, largest(mean_mm)?);
    let values: Vec<[f64; 5]> =
        (0..mean_mm.len()).map(|n| [mean_mm[n][0], mean_mm[n][1], mean_mm[n][2], reach95_mm[n], sd_mm[n]]).collect();
    let known = in_tetrahedra(mesh.tets(), mesh.nodes_mm(), &values, &grid);
    let shown = |n: usize| known.at(n).map(|v| v.map(f64::from));
    let mean = |n: usize| shown(n).map(|v| [v[0], v[1], v[2]]);
    // What lies between nodes that do not move may be a hair below nothing.
    let sizes = (0..grid.len()).filter_map(shown).flat_map(|v| [length([v[0], v[1], v[2]]), v[3].max(0.0)]);
    let scale = ColourScale::over(sizes.chain([0.0]), "displacement (mm)")?;
    let expected = painted(t1, &grid, &scale, &mean, Length::Shift);
    let reach = painted(t1, &grid, &scale, &|n| shown(n).map(|v| [v[3], 0.0, 0.0]), Length::Plain);
    let spreads = (0..grid.len()).filter_map(shown).map(|v| v[4].max(0.0));
    let of_spread = ColourScale::over(spreads.chain([0.0]), "standard deviation (mm)")?;
    let spread = painted(t1, &grid, &of_spread, &|n| shown(n).map(|v| [v[4], 0.0, 0.0]), Length::Plain);
    let shift = ShiftFigure {
        pictures: vec![
            captioned(
                &expected,
                &grid,
                "Expected shift",
                &format!("{COLOUR_OF_SHIFT} the mean of the draws; {}", lines()),
            ),
            captioned(
                &reach,
                &grid,
                "95 % move less than this",
                "colour is the size that 95 % of the draws do not exceed",
            ),
        ],
        scale,
    };
    let what = "colour is the standard deviation of the displacement";
    let pictures = vec![captioned(&spread, &grid, "How unsure: standard deviation", what)];
    Some(PredictionFigure { shift, spread: ShiftFigure { pictures, scale: of_spread } })
}

/// How descriptions begin.
const COLOUR_OF_SHIFT: &str = "colour is the size of the displacement,";

fn lines() -> String {
    format!("lines lead from a dark dot the way the tissue went, {LONGER} times as far")
}

/// Whether lines are drawn along the vectors.
#[derive(Clone, Copy, PartialEq)]
enum Length {
    Shift,
    Plain,
}

/// The node that moves most; `None` without nodes.
fn largest(displacement_mm: &[[f64; 3]]) -> Option<usize> {
    (0..displacement_mm.len())
        .max_by(|a, b| length(displacement_mm[*a]).total_cmp(&length(displacement_mm[*b])).then(b.cmp(a)))
}

/// The axial slice of voxels of 1 mm through a node.
fn slice_through(mesh: &TetMesh, node: usize) -> Grid<Mni> {
    let level_mm = mesh.nodes_mm()[node][2].round();
    let (low, high) = mesh.nodes_mm().iter().fold(([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]), |(l, h), x| {
        ([l[0].min(x[0]), l[1].min(x[1])], [h[0].max(x[0]), h[1].max(x[1])])
    });
    let size = [0, 1].map(|a| (high[a] - low[a]).ceil().max(1.0) as usize + 8);
    let origin = [low[0].floor() - 4.0, low[1].floor() - 4.0, level_mm];
    Grid::<Mni>::axis_aligned([size[0], size[1], 1], [1.0; 3], origin)
}

fn place(grid: &Grid<Mni>, n: usize) -> Position<Mni> {
    grid.centre(grid.voxel(n))
}

/// The size of vectors as colour over the scan, with lines along them where they are shifts.
fn painted(
    t1: &Volume<f32, Mni>,
    grid: &Grid<Mni>,
    scale: &ColourScale,
    shown: &dyn Fn(usize) -> Option<[f64; 3]>,
    lines: Length,
) -> Picture {
    let size = [grid.dims[0], grid.dims[1]];
    let brightest = (0..grid.len()).filter_map(|n| t1.trilinear(place(grid, n))).fold(1.0f32, f32::max);
    let mut picture = Picture::filled(SCALE * size[0], SCALE * size[1], [0, 0, 0, 0]);
    // The patient's right on the left, the front on top.
    let pixel = |x: f64, y: f64| {
        let column = SCALE as f64 * (size[0] as f64 - 1.0 - x);
        let row = SCALE as f64 * (size[1] as f64 - 1.0 - y);
        [column, row].map(|v| v.max(0.0) as usize)
    };
    for n in 0..grid.len() {
        let Some(u) = shown(n) else { continue };
        let [x, y, _] = grid.voxel(n);
        let grey = 255.0 * f64::from(t1.trilinear(place(grid, n)).unwrap_or(0.0) / brightest);
        let colour = scale.colour(length(u));
        let mixed = colour.map(|c| (WASH * f64::from(c) + (1.0 - WASH) * grey).clamp(0.0, 255.0) as u8);
        let [column, row] = pixel(x as f64, y as f64);
        for k in 0..SCALE * SCALE {
            picture.set(column + k % SCALE, row + k / SCALE, [mixed[0], mixed[1], mixed[2], 255]);
        }
    }
    if lines == Length::Plain {
        return picture;
    }
    for n in (0..grid.len()).filter(|&n| grid.voxel(n)[0] % ARROWS_MM == 5 && grid.voxel(n)[1] % ARROWS_MM == 5) {
        let Some(u) = shown(n) else { continue };
        let [x, y, _] = grid.voxel(n);
        let steps = (4.0 * LONGER * u[0].hypot(u[1])).ceil() as usize;
        for step in 0..=steps {
            let t = LONGER * step as f64 / steps.max(1) as f64;
            let [column, row] = pixel(x as f64 + t * u[0], y as f64 + t * u[1]);
            if column < SCALE * size[0] && row < SCALE * size[1] {
                picture.set(column, row, [255, 255, 255, 255]);
            }
        }
        let [column, row] = pixel(x as f64, y as f64);
        for k in 0..SCALE * SCALE {
            picture.set(column + k % SCALE, row + k / SCALE, [0, 0, 0, 255]);
        }
    }
    picture
}

fn captioned(picture: &Picture, grid: &Grid<Mni>, caption: &str, what: &str) -> CaptionedPicture {
    let level_mm = grid.position(Point3::origin()).mm.z;
    CaptionedPicture {
        png: picture.to_png(),
        size: [SCALE * grid.dims[0], SCALE * grid.dims[1]],
        caption: caption.to_owned(),
        description: format!("Axial slice at z = {level_mm} mm, the patient's right on the left: {what}"),
        sides: Some(Plane::Axial.sides()),
    }
}

/// What a panel shows of the seen and the modelled shift.
type Panel<'a> = &'a dyn Fn([[f64; 3]; 2]) -> [f64; 3];

/// Length of a vector.
pub(super) fn length(u: [f64; 3]) -> f64 {
    u.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_pictures_of_one_size_and_one_scale_that_holds_the_largest_shift() {
        let nodes = vec![[0.0; 3], [60.0, 0.0, 0.0], [0.0, 60.0, 0.0], [0.0, 0.0, 60.0]];
        let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3]], vec![2]).unwrap();
        let grid = Grid::<Mni>::axis_aligned([40; 3], [2.0; 3], [-5.0; 3]);
        let (t1, seen) = (Volume::filled(grid, 100.0f32), Volume::filled(grid, [0.0f32, 3.0, 0.0]));
        let found = shift_figure(&t1, &seen, &mesh, &[[0.0, 5.0, 0.0], [0.0; 3], [0.0; 3], [0.0; 3]]).unwrap();
        assert_eq!(found.pictures.len(), 3);
        assert!(found.pictures.iter().all(|p| p.size == found.pictures[0].size && p.png.starts_with(b"\x89PNG")));
        assert_ne!(found.pictures[0].png, found.pictures[1].png);
    }

    #[test]
    fn a_prediction_has_the_expected_shift_its_reach_on_one_scale_and_its_spread_on_another() {
        let nodes = vec![[0.0; 3], [60.0, 0.0, 0.0], [0.0, 60.0, 0.0], [0.0, 0.0, 60.0]];
        let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3]], vec![2]).unwrap();
        let t1 = Volume::filled(Grid::<Mni>::axis_aligned([40; 3], [2.0; 3], [-5.0; 3]), 100.0f32);
        let mean = [[0.0, 5.0, 0.0], [0.0; 3], [0.0; 3], [0.0; 3]];
        let found = prediction_figure(&t1, &mesh, &mean, &[12.0, 2.0, 2.0, 2.0], &[3.0, 0.5, 0.5, 0.5]).unwrap();
        assert_eq!((found.shift.pictures.len(), found.spread.pictures.len()), (2, 1));
        assert!((found.shift.scale.high - 12.0).abs() < 0.1 && (found.spread.scale.high - 3.0).abs() < 0.1);
        assert!(found.shift.pictures[0].png != found.shift.pictures[1].png);
    }
}
