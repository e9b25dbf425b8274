//! What an estimate was held against, node by node, less what its model gives: where the model fails, and which way.

use super::colour::{ColourScale, NO_VALUE};
use super::page::{CaptionedPicture, ShiftFigure};
use super::picture::Picture;
use super::shift_figure::length;
use super::slice::{PLANES, Plane};

/// Pixels for each mm, and around the body.
const SCALE: f64 = 2.0;
const RIM: usize = 8;
/// Side of a node's square, pixels.
const DOT: usize = 5;
/// Distance between lines, mm, and how many times longer than the residual they are.
const LINES_MM: f64 = 12.0;
const LONGER: f64 = 10.0;
/// How much of the colour what is far from the reader's eye keeps.
const FAR: f64 = 0.45;

/// Three views through a body (nodes, mm) with what is left of the displacement of every observed node: its index and the
/// residual, mm. `None` without any.
pub fn residual_figure(nodes_mm: &[[f64; 3]], residuals_mm: &[(usize, [f64; 3])]) -> Option<ShiftFigure> {
    let sizes = residuals_mm.iter().map(|(_, r)| length(*r));
    let scale = ColourScale::to_95(sizes, "seen less modelled (mm)")?;
    let pictures = PLANES.map(|plane| view(plane, nodes_mm, residuals_mm, &scale));
    Some(ShiftFigure { scale, pictures: pictures.into() })
}

/// Where the reader stands: at the feet, before the face, at the left ear; so that a slice and a view of one plane have the
/// same sides.
fn from(plane: Plane) -> (&'static str, f64) {
    match plane {
        Plane::Axial => ("below", -1.0),
        Plane::Coronal => ("the front", 1.0),
        Plane::Sagittal => ("the left", -1.0),
    }
}

fn view(
    plane: Plane,
    nodes_mm: &[[f64; 3]],
    residuals_mm: &[(usize, [f64; 3])],
    scale: &ColourScale,
) -> CaptionedPicture {
    let (h, v) = plane.in_plane();
    let (from, towards) = from(plane);
    let axes = [h, v, plane.axis()];
    let low = axes.map(|a| nodes_mm.iter().map(|x| x[a]).fold(f64::INFINITY, f64::min));
    let high = axes.map(|a| nodes_mm.iter().map(|x| x[a]).fold(f64::NEG_INFINITY, f64::max));
    let size = [0, 1].map(|a| 2 * RIM + (SCALE * (high[a] - low[a])).ceil() as usize);
    let mut picture = Picture::filled(size[0], size[1], [0, 0, 0, 0]);
    // As on slices, coordinates fall from left to right and from top to bottom.
    let pixel = |x: [f64; 3]| [(high[0] - x[h]), (high[1] - x[v])].map(|mm| RIM as f64 + SCALE * mm);
    let mut square = |at: [f64; 2], side: usize, colour: [u8; 4]| {
        let corner = at.map(|p| (p - side as f64 / 2.0).round().max(0.0) as usize);
        for k in 0..side * side {
            picture.set(corner[0] + k % side, corner[1] + k / side, colour);
        }
    };
    for x in nodes_mm {
        square(pixel(*x), 3, [NO_VALUE[0], NO_VALUE[1], NO_VALUE[2], 70]);
    }
    // The nearest last, over what lies behind them; of two as near, the one of the higher number.
    let near = |n: usize| towards * nodes_mm[n][axes[2]];
    let mut shown: Vec<&(usize, [f64; 3])> = residuals_mm.iter().collect();
    shown.sort_by(|a, b| near(a.0).total_cmp(&near(b.0)).then(a.0.cmp(&b.0)));
    let depth = (high[2] - low[2]).max(1e-9);
    for (n, residual) in &shown {
        let nearness = if towards > 0.0 { near(*n) - low[2] } else { near(*n) + high[2] } / depth;
        let kept = FAR + (1.0 - FAR) * nearness.clamp(0.0, 1.0);
        let faded = scale.colour(length(*residual)).map(|c| (255.0 - kept * (255.0 - f64::from(c))) as u8);
        square(pixel(nodes_mm[*n]), DOT, [faded[0], faded[1], faded[2], 255]);
    }
    // One line for each patch of the picture: the node nearest to the reader.
    let mut taken = std::collections::BTreeSet::new();
    for (n, residual) in shown.iter().rev() {
        let x = nodes_mm[*n];
        if !taken.insert([h, v].map(|a| (x[a] / LINES_MM).floor() as i64)) {
            continue;
        }
        let steps = (2.0 * SCALE * LONGER * residual[h].hypot(residual[v])).ceil() as usize;
        for step in 0..=steps {
            let t = LONGER * step as f64 / steps.max(1) as f64;
            square(pixel([0, 1, 2].map(|a| x[a] + t * residual[a])), 2, [190, 30, 90, 255]);
        }
        square(pixel(x), 4, [0, 0, 0, 255]);
    }
    CaptionedPicture {
        png: picture.to_png(),
        size,
        caption: format!("From {from}"),
        description: format!(
            "The body seen through from {from}; every node that the estimate was held against has the colour of what the \
             model leaves of its displacement; lines lead from a dark dot along it, {LONGER} times as far"
        ),
        sides: Some(plane.sides()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_residual_is_drawn_on_every_view_in_its_own_colour_and_none_makes_no_figure() {
        let nodes = [[0.0; 3], [40.0, 0.0, 0.0], [0.0, 60.0, 0.0], [0.0, 0.0, 50.0]];
        let one = residual_figure(&nodes, &[(1, [0.0, 1.0, 0.0]), (3, [0.0, 0.0, 2.0])]).unwrap();
        assert_eq!(one.pictures.iter().map(|p| p.size).collect::<Vec<_>>(), [[96, 136], [96, 116], [136, 116]]);
        let other = residual_figure(&nodes, &[(1, [0.0, -1.0, 0.0]), (3, [0.0, 0.0, 2.0])]).unwrap();
        // The line of the first node turns over where y is drawn, and only there.
        let same: Vec<bool> = (0..3).map(|n| one.pictures[n].png == other.pictures[n].png).collect();
        assert_eq!(same, [false, true, false]);
        assert!(residual_figure(&nodes, &[]).is_none());
    }
}
