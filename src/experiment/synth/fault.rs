//! What is wrong with one scan of a synthetic patient: what coil, gradient and console do to the signal, and what was done to the
//! file before it came here.

use super::frame::centre;
use super::ghost;
use super::head_side::{HeadSide, axis_along};
use crate::geometry::Frame;
use crate::image::{Grid, Mask, Volume, VoxelBox};
use crate::material::random::CounterRng;
use nalgebra::Vector3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is wrong with one scan; by default nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ScanFaults {
    /// Ghost: the share of the signal that appears half the field of view further along the phase direction, front to back (up to 0.5).
    pub ghost_fraction: f64,
    /// Surface coil: how many times brighter the head is at the coil's side than at the other. 1 is an even coil (up to 8).
    pub coil_gain: f64,
    /// Where the surface coil lies.
    pub coil_side: HeadSide,
    /// The share of white matter that is stored at the scan's largest value (up to 0.95).
    pub saturated_fraction: f64,
    /// Another weighting than T1: fluid bright, white matter dark.
    pub t2_like: bool,
    /// Slices that are missing: zeros, at places that the seed chooses in the middle of the scan (up to 20).
    pub missing_slices: usize,
    /// Zeros where face and eyes were.
    pub defaced: bool,
    /// Zeros everywhere outside the brain; the cavity stays in.
    pub stripped: bool,
    /// How much of the field of view is cut off, in mm. Its edge lies 1 to 3 cm outside of the head (up to 120).
    pub cut_mm: f64,
    /// From which side.
    pub cut_side: HeadSide,
}

impl Default for ScanFaults {
    fn default() -> Self {
        Self {
            ghost_fraction: 0.0,
            coil_gain: 1.0,
            coil_side: HeadSide::Left,
            saturated_fraction: 0.0,
            t2_like: false,
            missing_slices: 0,
            defaced: false,
            stripped: false,
            cut_mm: 0.0,
            cut_side: HeadSide::Top,
        }
    }
}

/// What is where in a scan.
pub struct Seen<F: Frame> {
    /// What skull stripping leaves.
    pub brain: Mask<F>,
    /// White matter.
    pub white: Mask<F>,
    /// What defacing takes; never brain.
    pub face: Mask<F>,
}

impl ScanFaults {
    /// Fields with value and range, in the order of the struct.
    pub(super) fn ranges(&self) -> [(&'static str, f64, f64, f64); 5] {
        [
            ("ghost_fraction", self.ghost_fraction, 0.0, 0.5),
            ("coil_gain", self.coil_gain, 1.0, 8.0),
            ("saturated_fraction", self.saturated_fraction, 0.0, 0.95),
            ("missing_slices", self.missing_slices as f64, 0.0, 20.0),
            ("cut_mm", self.cut_mm, 0.0, 120.0),
        ]
    }

    /// The intensity of what is `intensity` bright on a T1, both in the head's units.
    pub(super) fn weighted(&self, intensity: f64) -> f64 {
        /// Bone stays dark; fluid, grey matter, white matter and fat as on a T2 of a spin echo.
        const CURVE: [(f64, f64); 7] =
            [(0.0, 0.0), (16.0, 16.0), (48.0, 240.0), (146.0, 150.0), (210.0, 105.0), (232.0, 140.0), (300.0, 140.0)];
        if !self.t2_like {
            return intensity;
        }
        let upper = CURVE.iter().position(|&(x, _)| intensity < x).unwrap_or(CURVE.len() - 1).max(1);
        let ((x0, y0), (x1, y1)) = (CURVE[upper - 1], CURVE[upper]);
        (y0 + (y1 - y0) * (intensity - x0) / (x1 - x0)).max(0.0)
    }

    /// What coil and gradients do to the signal, before noise is added.
    pub(super) fn on_signal<F: Frame>(&self, mut signal: Volume<f64, F>) -> Volume<f64, F> {
        if self.coil_gain > 1.0 {
            let grid = signal.grid;
            let middle = grid.position(grid.dims.map(|n| 0.5 * (n as f64 - 1.0)).into()).mm;
            let side = self.coil_side.direction();
            // Half a head along each axis.
            let half_mm = side.abs().dot(&Vector3::new(75.0, 95.0, 85.0));
            signal.data.par_iter_mut().enumerate().for_each(|(n, value)| {
                let offset = (centre(&grid, n) - middle).dot(&side) / half_mm;
                *value *= self.coil_gain.powf(0.5 * offset.clamp(-1.3, 1.3));
            });
        }
        if self.ghost_fraction > 0.0 {
            let (axis, _) = axis_along(&signal.grid, &Vector3::y());
            signal = ghost::ghosted(&signal, axis, self.ghost_fraction);
        }
        signal
    }

    /// What storing the scan, and those who had it before, did to it.
    pub(super) fn on_stored<F: Frame>(&self, scan: &mut Volume<i16, F>, seen: &Seen<F>, rng: CounterRng) {
        if self.saturated_fraction > 0.0 {
            let mut white: Vec<i16> =
                scan.data.iter().zip(&seen.white.data).filter(|(_, white)| **white).map(|(&x, _)| x).collect();
            white.sort_unstable();
            let ceiling = white.get(((1.0 - self.saturated_fraction) * white.len() as f64) as usize).copied();
            scan.data.iter_mut().for_each(|x| *x = (*x).min(ceiling.unwrap_or(i16::MAX)));
        }
        let [nx, ny, nz] = scan.grid.dims;
        for k in missing(nz, self.missing_slices, rng) {
            scan.data[k * nx * ny..(k + 1) * nx * ny].fill(0);
        }
        for (n, x) in scan.data.iter_mut().enumerate() {
            if (self.defaced && seen.face.data[n]) || (self.stripped && !seen.brain.data[n]) {
                *x = 0;
            }
        }
    }

    /// The part of the field of view that is left; `None` where it is whole.
    pub(super) fn field_of_view<F: Frame>(&self, grid: &Grid<F>) -> Option<VoxelBox> {
        let (axis, upwards) = axis_along(grid, &self.cut_side.direction());
        let slices = (self.cut_mm / grid.spacing_mm()[axis]).round() as usize;
        // Something must be left to be a scan.
        let slices = slices.min(grid.dims[axis] - grid.dims[axis].min(2));
        let mut left = VoxelBox { first: [0; 3], end: grid.dims };
        if upwards {
            left.end[axis] -= slices;
        } else {
            left.first[axis] += slices;
        }
        (slices > 0).then_some(left)
    }
}

/// Which of `of` slices are missing: `count` of the middle seven tenths, or as many as there are.
fn missing(of: usize, count: usize, rng: CounterRng) -> Vec<usize> {
    let mut middle: Vec<usize> = (of * 15 / 100..of * 85 / 100).collect();
    let mut chosen = Vec::new();
    while chosen.len() < count && !middle.is_empty() {
        let at = (rng.uniform(chosen.len() as u64) * middle.len() as f64) as usize;
        chosen.push(middle.swap_remove(at.min(middle.len() - 1)));
    }
    chosen
}

/// Whether defacing takes what lies at a point of the template, `skull_mm` from the skull's inner surface: below a plane from the
/// brow to the angle of the jaw, and outside of the bone.
pub fn is_face([_, y, z]: [f64; 3], skull_mm: f64) -> bool {
    skull_mm > 3.0 && 75.0 * (y - 20.0) > 70.0 * (z + 70.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;

    const SIDES: [HeadSide; 6] =
        [HeadSide::Left, HeadSide::Right, HeadSide::Front, HeadSide::Back, HeadSide::Top, HeadSide::Bottom];

    fn signal() -> Volume<f64, Pre> {
        let grid = Grid::axis_aligned([20, 30, 24], [8.0; 3], [-76.0, -116.0, -92.0]);
        Volume::from_fn(grid, |n| 50.0 + (n % 97) as f64)
    }

    fn seen(white: impl Fn(usize) -> bool + Sync + Send) -> Seen<Pre> {
        let grid = signal().grid;
        Seen {
            brain: Mask::from_fn(grid, |n| n % 3 == 0),
            white: Mask::from_fn(grid, white),
            face: Mask::from_fn(grid, |n| n % 3 == 1 && n % 2 == 0),
        }
    }

    #[test]
    fn a_scan_without_faults_is_as_it_was() {
        let none = ScanFaults::default();
        let (before, rng) = (signal(), CounterRng::new(1, 2));
        let after = none.on_signal(before.clone());
        assert!(after == before && none.field_of_view(&before.grid).is_none());
        let mut stored = before.map(|x| x as i16);
        none.on_stored(&mut stored, &seen(|n| n % 2 == 0), rng);
        assert!(stored == before.map(|x| x as i16));
        assert!([0.0, 33.0, 210.0].into_iter().all(|x| none.weighted(x) == x));
    }

    #[test]
    fn a_surface_coil_is_brighter_on_its_side_by_its_gain_and_leaves_the_middle() {
        let even = signal().map(|_| 100.0);
        for coil_side in SIDES {
            let faults = ScanFaults { coil_gain: 3.0, coil_side, ..ScanFaults::default() };
            let uneven = faults.on_signal(even.clone());
            let at = |mm: Vector3<f64>| {
                f64::from(uneven.map(|x| x as f32).trilinear(crate::geometry::Position::from_point(mm.into())).unwrap())
            };
            let edge = coil_side.direction().component_mul(&Vector3::new(75.0, 95.0, 85.0));
            assert!((at(Vector3::zeros()) - 100.0).abs() < 1.0, "{}", at(Vector3::zeros()));
            assert!((at(edge) / at(-edge) - 3.0).abs() < 0.1, "{coil_side:?}: {}", at(edge) / at(-edge));
        }
    }

    #[test]
    fn the_asked_share_of_white_matter_has_the_largest_value_and_nothing_exceeds_it() {
        for saturated_fraction in [0.1, 0.5, 0.9] {
            let mut scan = signal().map(|x| x as i16);
            let seen = seen(|n| n % 5 == 0);
            ScanFaults { saturated_fraction, ..ScanFaults::default() }.on_stored(
                &mut scan,
                &seen,
                CounterRng::new(1, 2),
            );
            let largest = scan.data.iter().copied().max().unwrap();
            let white: Vec<i16> = (0..scan.data.len()).filter(|&n| seen.white.data[n]).map(|n| scan.data[n]).collect();
            let share = white.iter().filter(|&&x| x == largest).count() as f64 / white.len() as f64;
            assert!((saturated_fraction..saturated_fraction + 0.02).contains(&share), "{share}");
        }
    }

    #[test]
    fn missing_slices_are_as_many_as_asked_and_the_others_are_untouched() {
        let whole = signal().map(|x| x as i16);
        for missing_slices in [1, 4, 20] {
            let faults = ScanFaults { missing_slices, ..ScanFaults::default() };
            let slices = |seed| {
                let mut scan = whole.clone();
                faults.on_stored(&mut scan, &seen(|_| false), CounterRng::new(seed, 2));
                let size = scan.grid.dims[0] * scan.grid.dims[1];
                let pairs = scan.data.chunks(size).zip(whole.data.chunks(size)).enumerate();
                let gone: Vec<usize> = pairs
                    .filter(|(_, (a, b))| a != b)
                    .map(|(k, (a, _))| {
                        assert!(a.iter().all(|&x| x == 0));
                        k
                    })
                    .collect();
                gone
            };
            // Of 24 slices 17 are in the middle.
            assert_eq!(slices(1).len(), missing_slices.min(17));
            assert!(missing_slices == 20 || slices(1) != slices(2), "the seed chooses");
        }
    }

    #[test]
    fn defacing_and_stripping_make_zeros_outside_the_brain_and_leave_it() {
        let whole = signal().map(|x| x as i16);
        let seen = seen(|_| false);
        for (defaced, stripped) in [(true, false), (false, true), (true, true)] {
            let mut scan = whole.clone();
            let faults = ScanFaults { defaced, stripped, ..ScanFaults::default() };
            faults.on_stored(&mut scan, &seen, CounterRng::new(1, 2));
            for n in 0..scan.data.len() {
                let gone = (defaced && seen.face.data[n]) || (stripped && !seen.brain.data[n]);
                assert_eq!(scan.data[n], if gone { 0 } else { whole.data[n] });
            }
        }
    }

    #[test]
    fn cutting_takes_what_was_asked_from_the_side_that_was_asked_whichever_way_the_grid_runs() {
        // Sagittal slices from right to left: i to the back, j up, k to the left.
        let turned = nalgebra::Matrix4::new(
            0.0, 0.0, -2.0, 80.0, -1.0, 0.0, 0.0, 100.0, 0.0, 1.0, 0.0, -90.0, 0.0, 0.0, 0.0, 1.0,
        );
        for grid in [signal().grid, Grid::<Pre>::new([200, 180, 80], turned).unwrap()] {
            for cut_side in SIDES {
                let faults = ScanFaults { cut_mm: 40.0, cut_side, ..ScanFaults::default() };
                let left = grid.cropped(&faults.field_of_view(&grid).unwrap());
                let far = |grid: &Grid<Pre>, side: &Vector3<f64>| {
                    let corners = (0..8).map(|c| {
                        let at = [0, 1, 2].map(|a| if c >> a & 1 == 1 { grid.dims[a] - 1 } else { 0 });
                        grid.centre(at).mm.coords.dot(side)
                    });
                    corners.fold(f64::NEG_INFINITY, f64::max)
                };
                for side in SIDES {
                    let cut = far(&grid, &side.direction()) - far(&left, &side.direction());
                    let wanted = if side == cut_side { 40.0 } else { 0.0 };
                    assert!((cut - wanted).abs() < 1e-9, "{cut_side:?}, {side:?}: {cut}");
                }
            }
        }
    }

    #[test]
    fn another_weighting_turns_the_order_of_fluid_grey_and_white_matter() {
        let t2 = ScanFaults { t2_like: true, ..ScanFaults::default() };
        let [fluid, grey, white] = [48.0, 146.0, 210.0].map(|x| t2.weighted(x));
        assert!(fluid > grey && grey > white && white > t2.weighted(14.0), "{fluid} {grey} {white}");
    }
}
