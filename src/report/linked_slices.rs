//! Slices through the scans that follow one cursor: the scans as bytes, and the frames the cursor is told in.

use super::figure::CaseImages;
use super::slice;
use crate::geometry::{Mni, Position, Post, Pre, RigidTransform};
use crate::image::{Mask, Volume};
use base64::Engine;
use flate2::Compression;
use flate2::write::GzEncoder;
use maud::{Markup, html};
use std::io::Write;

/// Distance between the voxels that the page carries, mm.
const STEP_MM: f64 = 1.5;
/// Black around the brain, mm.
const MARGIN_MM: f64 = 6.0;
/// Grey values that are told apart: more would be the scan's noise, and most of the page.
const GREYS: f32 = 63.0;

/// A scan on the page's grid: axes of the template's frame, x fastest, every value from 0 to [`GREYS`].
#[derive(Clone, Debug, PartialEq)]
struct PageScan {
    name: &'static str,
    greys: Vec<u8>,
}

/// Scans with their grid and frames.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkedSlices {
    size: [usize; 3],
    /// Centre of the first voxel, mm.
    corner_mm: [f64; 3],
    /// Where the cursor begins, mm.
    focus_mm: [f64; 3],
    scans: Vec<PageScan>,
    /// Frames beside the template's: name, and the rows of its motion from the template's.
    frames: Vec<(&'static str, [[f64; 4]; 3])>,
}

impl LinkedSlices {
    /// The scans of a case, masked to brain and cavity; `None` where the pre-operative one shows nothing.
    pub fn of(
        images: &CaseImages,
        mni_from_pre: Option<&RigidTransform<Pre, Mni>>,
        pre_from_post: Option<&RigidTransform<Post, Pre>>,
    ) -> Option<Self> {
        let bounds = slice::bounds_mm(&images.pre_brain)?;
        let corner_mm = bounds[0].map(|low| ((low - MARGIN_MM) / STEP_MM).floor() * STEP_MM);
        let size = [0, 1, 2].map(|a| ((bounds[1][a] + MARGIN_MM - corner_mm[a]) / STEP_MM).ceil() as usize + 1);
        let sampled = |scan: &Volume<f32, Mni>, shown: &dyn Fn(Position<Mni>) -> bool, window: [f32; 2]| {
            let mut greys = Vec::with_capacity(size.iter().product());
            for n in 0..size.iter().product::<usize>() {
                let voxel = [n % size[0], n / size[0] % size[1], n / size[0] / size[1]];
                let [x, y, z] = [0, 1, 2].map(|a| corner_mm[a] + STEP_MM * voxel[a] as f64);
                let p = Position::new(x, y, z);
                let value = if shown(p) { scan.trilinear(p).unwrap_or(0.0) } else { window[0] };
                let t = ((value - window[0]) / (window[1] - window[0])).clamp(0.0, 1.0);
                greys.push((GREYS * t).round() as u8);
            }
            greys
        };
        let holds = |mask: Option<&Mask<Mni>>, p| mask.is_some_and(|mask| mask.nearest(p) == Some(true));
        let window = slice::window(&images.pre, &images.pre_brain)?;
        let in_brain = |p| holds(Some(&images.pre_brain), p) || holds(images.resected.as_ref(), p);
        let mut scans = vec![PageScan { name: "before surgery", greys: sampled(&images.pre, &in_brain, window) }];
        if let Some((post, brain)) = &images.post
            && let Some(window) = slice::window(post, brain)
        {
            let shown = |p| holds(Some(brain), p) || holds(images.cavity.as_ref(), p);
            scans.push(PageScan { name: "after surgery, registered", greys: sampled(post, &shown, window) });
        }
        let mut frames = Vec::new();
        if let Some(mni_from_pre) = mni_from_pre {
            let pre_from_mni = mni_from_pre.inverse();
            frames.push(("pre-operative scanner", rows(|p| pre_from_mni.apply(p).mm.coords.into())));
            if let Some(pre_from_post) = pre_from_post {
                let post_from_pre = pre_from_post.inverse();
                let moved = |p| post_from_pre.apply(pre_from_mni.apply(p)).mm.coords.into();
                frames.push(("post-operative scanner", rows(moved)));
            }
        }
        let middle = [0, 1, 2].map(|a| f64::midpoint(bounds[0][a], bounds[1][a]));
        let cut = images.resected.as_ref().or(images.cavity.as_ref());
        let focus_mm = cut.and_then(slice::centroid_mm).unwrap_or(middle).map(f64::round);
        Some(Self { size, corner_mm, focus_mm, scans, frames })
    }

    /// Three slices, what is shown on them, and where the cursor is.
    pub(super) fn section(&self) -> Markup {
        // Widths as the slices' own, so that all three have one scale.
        let [x, y, z] = self.size;
        let slices = [("axial", x, y, "R", "L"), ("coronal", x, z, "R", "L"), ("sagittal", y, z, "A", "P")];
        let columns = format!("grid-template-columns: {x}fr {x}fr {y}fr");
        html! {
            p {
                "Click into a slice or the surface to move the cursor; the other slices and the lines in the 3-D view follow. With a \
                 slice in focus the arrow keys move the cursor in it by 1 mm, Page Up and Page Down across it."
            }
            @if self.scans.len() > 1 {
                div class="controls" role="group" aria-label="Scan" {
                    @for (n, scan) in self.scans.iter().enumerate() {
                        button type="button" data-scan=(n) aria-pressed=(if n == 0 { "true" } else { "false" }) { (scan.name) }
                    }
                }
            }
            div class="linked" style=(columns) {
                @for (plane, width, height, left, right) in slices {
                    div class="picture" {
                        canvas class="slice" data-plane=(plane) width=(4 * width) height=(4 * height) tabindex="0" role="img"
                            aria-label={ (plane) " slice at the cursor; arrow keys and Page Up, Page Down move it" } {}
                        span class="side" { (left) } span class="side right" { (right) }
                    }
                }
            } "\n"
            noscript { p { "The slices need JavaScript; the mosaics above show the same scans without it." } }
            p class="where" { output id="cursor" {} }
            ul class="legend" aria-label="Lines on the slices" {
                li { svg viewBox="0 0 280 60" width="28" height="6" aria-hidden="true" { path class="o-rest" d="M0 30h280" {} } "undeformed" }
                li { svg viewBox="0 0 280 60" width="28" height="6" aria-hidden="true" { path class="o-shown" d="M0 30h280" {} } "surface chosen below" }
            } "\n"
        }
    }

    /// What the page's script needs.
    pub(super) fn json(&self) -> serde_json::Value {
        let base64 = base64::engine::general_purpose::STANDARD;
        let scans: Vec<serde_json::Value> = self
            .scans
            .iter()
            .map(|scan| serde_json::json!({"name": scan.name, "gzip": base64.encode(packed(&scan.greys))}))
            .collect();
        let frames: Vec<serde_json::Value> =
            self.frames.iter().map(|(name, rows)| serde_json::json!({"name": name, "from_mni": rows})).collect();
        serde_json::json!({
            "size": self.size, "corner_mm": self.corner_mm, "step_mm": STEP_MM, "focus_mm": self.focus_mm, "greys": GREYS,
            "scans": scans, "frames": frames,
        })
    }
}

/// The rows of an affine motion, from where it carries the origin and the axes.
fn rows(moved: impl Fn(Position<Mni>) -> [f64; 3]) -> [[f64; 4]; 3] {
    let origin = moved(Position::new(0.0, 0.0, 0.0));
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|[x, y, z]| moved(Position::new(x, y, z)));
    [0, 1, 2].map(|row| {
        let along = |a: usize| axes[a][row] - origin[row];
        [along(0), along(1), along(2), origin[row]]
    })
}

/// Compressed without a time or a name, so that the same scan gives the same bytes.
fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::new(6));
    // Writing to memory does not fail.
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;
    use std::io::Read;

    fn images() -> CaseImages {
        let grid = Grid::<Mni>::axis_aligned([24, 28, 20], [4.0; 3], [-46.0, -54.0, -38.0]);
        let at = |n: usize| grid.position(grid.voxel(n).map(|v| v as f64).into()).mm;
        let pre_brain = Mask::from_fn(grid, |n| at(n).coords.norm() < 30.0);
        CaseImages {
            // Brighter to the right.
            pre: Volume::from_fn(grid, |n| 200.0 + at(n).x as f32),
            post: None,
            labels: None,
            resected: None,
            cavity: None,
            registered_from_scanned: None,
            pre_brain,
        }
    }

    #[test]
    fn the_packed_scan_is_the_scan_where_its_grid_says() {
        let slices = LinkedSlices::of(&images(), None, None).unwrap();
        let json = slices.json();
        let gzip = json["scans"][0]["gzip"].as_str().unwrap();
        let gzip = base64::engine::general_purpose::STANDARD.decode(gzip).unwrap();
        let mut greys = Vec::new();
        flate2::read::GzDecoder::new(gzip.as_slice()).read_to_end(&mut greys).unwrap();
        assert_eq!(greys.len(), slices.size.iter().product::<usize>());
        let at = |mm: [f64; 3]| {
            let v = [0, 1, 2].map(|a| ((mm[a] - slices.corner_mm[a]) / STEP_MM).round() as usize);
            greys[v[0] + slices.size[0] * (v[1] + slices.size[1] * v[2])]
        };
        assert!(at([20.0, 0.0, 0.0]) > at([0.0; 3]) && at([0.0; 3]) > at([-20.0, 0.0, 0.0]));
        assert_eq!(at([31.0, 0.0, 0.0]), 0, "nothing outside the brain");
        assert!(greys.iter().all(|g| f32::from(*g) <= GREYS));
    }

    #[test]
    fn a_frame_is_the_inverse_of_its_motion() {
        let rigid = |text: &str| crate::register::transform_text::rigid_from_text(text, "x").unwrap();
        let mni_from_pre: RigidTransform<Pre, Mni> = rigid("0 -1 0 5\n1 0 0 0\n0 0 1 -2\n0 0 0 1\n");
        let text = "1 0 0 10\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
        let pre_from_post: RigidTransform<Post, Pre> =
            crate::register::transform_text::rigid_from_text(text, "x").unwrap();
        let slices = LinkedSlices::of(&images(), Some(&mni_from_pre), Some(&pre_from_post)).unwrap();
        let apply = |rows: &[[f64; 4]; 3], p: [f64; 3]| rows.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3]);
        let there = mni_from_pre.apply(Position::new(1.0, 2.0, 3.0)).mm;
        let [pre, post] = [0, 1].map(|n| apply(&slices.frames[n].1, there.coords.into()));
        assert!((0..3).all(|a| (pre[a] - [1.0, 2.0, 3.0][a]).abs() < 1e-12), "{pre:?}");
        assert!((0..3).all(|a| (post[a] - [-9.0, 2.0, 3.0][a]).abs() < 1e-12), "{post:?}");
    }
}
