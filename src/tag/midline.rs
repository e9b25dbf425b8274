//! The midline of a brain, which no plane holds: the falx leans and bows by some millimetres, and one hemisphere
//! reaches past the other ("Yakovlevian torque": Toga and Thompson, Nature Reviews Neuroscience 4, 2003).
//!
//! A mesh conforms to the plane x = 0 alone. So labels are straightened, meshed and tagged, and the mesh is bent back:
//! `x = x' + s(y, z) exp(-(x' / 30 mm)^2)`, where `s` is how far the midline lies from the plane. What is 60 mm to the side
//! moves by a fiftieth of that.

use crate::geometry::{Frame, Position};
use crate::image::LabelMap;

/// How far to the side the bending reaches, mm.
const REACH_MM: f64 = 30.0;
/// A midline further from the plane than this is taken as this far, mm: the map stays one to one, its stretch above .7.
const FARTHEST_MM: f64 = 10.0;
/// The falx is taut: what is finer than this is the fit's noise, mm (one standard deviation).
const SMOOTH_MM: f64 = 8.0;
/// First place along y and z, distance between places, and how many there are, mm.
const FIRST_MM: [f64; 2] = [-140.0, -100.0];
const STEP_MM: f64 = 4.0;
const PLACES: [usize; 2] = [66, 56];

/// How far the midline lies from the plane x = 0, by y and z.
#[derive(Clone, Debug)]
pub struct Midline {
    /// mm, y fastest.
    offset_mm: Vec<f64>,
}

impl Midline {
    /// Where `template_from_mesh` (mm) finds the template's plane x = 0 on a patient.
    pub fn of(template_from_mesh: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        let at = |n: usize| {
            let [y, z] = [n % PLACES[0], n / PLACES[0]];
            let [y, z] = [FIRST_MM[0] + STEP_MM * y as f64, FIRST_MM[1] + STEP_MM * z as f64];
            let step = |x: f64| (x - template_from_mesh([x, y, z])[0]).clamp(-FARTHEST_MM, FARTHEST_MM);
            (0..8).fold(0.0, |x, _| step(x))
        };
        let raw: Vec<f64> = (0..PLACES[0] * PLACES[1]).map(at).collect();
        Self { offset_mm: smooth(&raw) }
    }

    /// The offset at a place, mm; level beyond the outermost places.
    fn offset_mm(&self, y: f64, z: f64) -> f64 {
        let place = |x: f64, axis: usize| {
            let at = ((x - FIRST_MM[axis]) / STEP_MM).clamp(0.0, (PLACES[axis] - 1) as f64);
            let low = (at as usize).min(PLACES[axis] - 2);
            (low, at - low as f64)
        };
        let ((j, v), (k, w)) = (place(y, 0), place(z, 1));
        let row = |k: usize| {
            let first = j + PLACES[0] * k;
            (1.0 - v) * self.offset_mm[first] + v * self.offset_mm[first + 1]
        };
        (1.0 - w) * row(k) + w * row(k + 1)
    }

    /// Where a point of the straightened brain lies in the patient's, mm.
    pub fn bent(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        [x + self.offset_mm(y, z) * (-(x / REACH_MM).powi(2)).exp(), y, z]
    }

    /// The straightened labels.
    pub fn straightened<F: Frame>(&self, labels: &LabelMap<F>) -> LabelMap<F> {
        LabelMap::from_fn(labels.grid, |n| {
            let voxel = labels.grid.voxel(n).map(|v| v as f64);
            let [x, y, z] = self.bent(labels.grid.position(voxel.into()).mm.into());
            labels.nearest(Position::new(x, y, z)).unwrap_or(0)
        })
    }
}

/// A Gaussian along y, then along z; level beyond the ends.
fn smooth(raw: &[f64]) -> Vec<f64> {
    let sigma = SMOOTH_MM / STEP_MM;
    let reach = (3.0 * sigma).ceil() as isize;
    let weights: Vec<f64> = (-reach..=reach).map(|d| (-0.5 * (d as f64 / sigma).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    let along = |values: &[f64], axis: usize| -> Vec<f64> {
        let value = |n: usize| {
            let at = [n % PLACES[0], n / PLACES[0]];
            let near = |d: isize| {
                let mut place = at;
                place[axis] = at[axis].saturating_add_signed(d).min(PLACES[axis] - 1);
                values[place[0] + PLACES[0] * place[1]]
            };
            (-reach..=reach).zip(&weights).map(|(d, w)| w * near(d)).sum::<f64>() / sum
        };
        (0..values.len()).map(value).collect()
    };
    along(&along(raw, 0), 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;
    use crate::mesh::engine::{EnginePrograms, MeshSettings, MeshSize, mesh_labels};
    use crate::segment::label::GREY_MATTER;
    use crate::tag::{FALX, SetForm, TagSettings, falx_sheet, tag_boundary_sets_with};

    #[test]
    fn a_straight_midline_moves_nothing() {
        let midline = Midline::of(|p| p);
        for p in [[0.0, 3.0, -7.0], [41.0, -80.0, 55.0]] {
            assert_eq!(midline.bent(p), p);
        }
    }

    #[test]
    fn the_plane_of_the_template_is_found_where_a_head_leans_and_bows() {
        let own = |y: f64, z: f64| 2.0 + 0.03 * y - 0.02 * z + 3.0 * (y / 60.0).sin();
        let midline = Midline::of(|[x, y, z]| [0.95 * (x - own(y, z)), y, z]);
        for (y, z) in [(0.0, 0.0), (-70.0, 30.0), (50.0, -20.0), (-20.0, 60.0)] {
            let [x, ..] = midline.bent([0.0, y, z]);
            assert!((x - own(y, z)).abs() < 0.1, "{x} at {y}, {z}: {}", own(y, z));
            assert!((midline.bent([75.0, y, z])[0] - 75.0).abs() < 0.02);
        }
    }

    #[test]
    fn straightened_labels_part_at_the_plane() {
        let grid = Grid::<Mni>::axis_aligned([41, 31, 31], [1.0; 3], [-20.0, -15.0, -15.0]);
        let own = |y: f64| 4.0 + 0.1 * y;
        let side = |n: usize| {
            let p = grid.position(grid.voxel(n).map(|v| v as f64).into()).mm;
            if p.x < own(p.y) { 1 } else { 2 }
        };
        let straight = Midline::of(|[x, y, z]| [x - own(y), y, z]).straightened(&LabelMap::from_fn(grid, side));
        let wrong = |n: &usize| {
            let x = grid.voxel(*n)[0] as f64 - 20.0;
            x.abs() > 0.6 && x.abs() < 12.0 && straight.data[*n] != if x < 0.0 { 1 } else { 2 }
        };
        assert_eq!((0..grid.len()).filter(wrong).count(), 0);
    }

    #[test]
    fn the_falx_of_a_mesh_lies_where_the_midline_does_and_the_brain_keeps_its_place() {
        let grid = Grid::<Mni>::axis_aligned([80, 100, 86], [2.0; 3], [-79.0, -115.0, -80.0]);
        let inside = |n: usize| {
            let p = grid.position(grid.voxel(n).map(|v| v as f64).into()).mm;
            let at = [p.x / 71.0, (p.y + 16.0) / 90.0, (p.z - 5.0) / 76.5];
            if at.iter().map(|x| x * x).sum::<f64>() < 1.0 { GREY_MATTER } else { 0 }
        };
        let labels = LabelMap::from_fn(grid, inside);
        let own = |y: f64, z: f64| 3.0 + 0.04 * y + 2.5 * (z / 50.0).sin();
        let template = |[x, y, z]: [f64; 3]| [x - own(y, z), y, z];
        let midline = Midline::of(template);
        let settings = MeshSettings { size: MeshSize::Cells(12_000), split: Some(falx_sheet()), ..Default::default() };
        let straight = midline.straightened(&labels);
        let (mut mesh, _) = mesh_labels(&straight, &settings, &EnginePrograms::default()).unwrap();
        let tags = TagSettings { plausible_area_mm2: std::collections::BTreeMap::new(), ..TagSettings::default() };
        let report = tag_boundary_sets_with(&mut mesh, &tags, |p| template(midline.bent(p))).unwrap();
        assert_eq!(report.set(FALX).unwrap().form, SetForm::Sheet);
        let mesh = mesh.moved(|p| midline.bent(p)).unwrap();
        let off = |n: &u32| template(mesh.nodes_mm()[*n as usize])[0].abs();
        let falx = &mesh.node_sets[FALX];
        let close = falx.iter().filter(|n| off(n) < 0.2).count();
        assert!(falx.len() > 100 && close as f64 > 0.98 * falx.len() as f64, "{close} of {}", falx.len());
        let volume_cc = (0..mesh.tets().len()).map(|t| mesh.volume_mm3(t)).sum::<f64>() / 1000.0;
        assert!((volume_cc / labels.map(|l| l > 0).volume_cc() - 1.0).abs() < 0.02, "{volume_cc}");
    }
}
