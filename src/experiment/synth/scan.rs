//! From a head to a scan: pose, field of view, slice profile, bias field, noise, storage.

use super::frame::Patient;
use super::head;
use crate::geometry::{Frame, Position, RigidTransform};
use crate::image::{Grid, Volume};
use crate::material::random::CounterRng;
use nalgebra::{Matrix3, Matrix4, Point3, UnitQuaternion, Vector3};
use rayon::prelude::*;

/// The head's pose in a scanner: up to the given rotation about any axis and shift in any direction, at least half of it.
pub fn pose<F: Frame>(rng: CounterRng, rotation_deg: f64, translation_mm: f64) -> RigidTransform<Patient, F> {
    let angle = (rotation_deg * rng.between(0, 0.5, 1.0)).to_radians();
    let shift = translation_mm * rng.between(1, 0.5, 1.0);
    let (axis, direction) = (Vector3::from(rng.direction(10)), Vector3::from(rng.direction(20)));
    // About a point near the head's middle, so that the shift is that of the head.
    RigidTransform::about(Point3::new(0.0, -18.0, 0.0), axis * angle, direction * shift)
}

/// The order in which a scan's axes are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// i to the right, j to the front, k up: axial slices.
    Axial,
    /// i to the front, j up, k to the right: sagittal slices, as a T1 gradient echo is often stored.
    Sagittal,
}

/// A grid that covers the head in its pose, with the technologist's small error of centring.
pub fn field_of_view<F: Frame>(
    scan_from_patient: &RigidTransform<Patient, F>,
    spacing_mm: [f64; 3],
    oblique_deg: f64,
    storage: Storage,
    rng: CounterRng,
) -> Grid<F> {
    let middle = scan_from_patient.apply(Position::new(0.0, -16.0, -8.0)).mm;
    let off = Vector3::new(rng.between(30, -4.0, 4.0), rng.between(31, -4.0, 4.0), rng.between(32, -4.0, 4.0));
    let middle = (middle.coords + off).map(f64::round);
    let extent_mm = match storage {
        Storage::Axial => [196.0, 244.0, 220.0],
        Storage::Sagittal => [244.0, 220.0, 196.0],
    };
    let axes = match storage {
        Storage::Axial => Matrix3::identity(),
        Storage::Sagittal => Matrix3::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0),
    };
    let tilt_axis = Vector3::new(1.0, rng.between(33, -0.4, 0.4), rng.between(34, -0.2, 0.2)).normalize();
    let tilt = UnitQuaternion::from_scaled_axis(tilt_axis * oblique_deg.to_radians());
    let linear = tilt.to_rotation_matrix().matrix() * axes * Matrix3::from_diagonal(&Vector3::from(spacing_mm));
    let dims = [0, 1, 2].map(|a| (extent_mm[a] / spacing_mm[a]).round() as usize);
    let half = Vector3::from(dims.map(|n| 0.5 * (n as f64 - 1.0)));
    let mut affine: Matrix4<f64> = linear.to_homogeneous();
    // Rounded to a micrometre, so that the header's 32 bits say what is meant.
    let origin = (middle - linear * half).map(|x| (x * 1000.0).round() / 1000.0);
    affine.fixed_view_mut::<3, 1>(0, 3).copy_from(&origin);
    // Rotation times positive spacings: invertible.
    Grid::new(dims, affine).unwrap_or_else(|| Grid::axis_aligned(dims, spacing_mm, origin.into()))
}

/// A smooth multiplicative shading, 1 +- `fraction` over the head: a random polynomial of second order.
pub struct Bias {
    coefficient: [f64; 9],
    scale: f64,
}

impl Bias {
    /// A random shading.
    pub fn new(rng: CounterRng, fraction: f64) -> Self {
        let coefficient = std::array::from_fn(|n| rng.normal(40 + n as u64) * if n < 3 { 1.0 } else { 0.7 });
        let unscaled = Self { coefficient, scale: 1.0 };
        let steps = || (-4..=4).map(|n| f64::from(n) * 0.25);
        let largest = steps()
            .flat_map(|x| steps().flat_map(move |y| steps().map(move |z| [x, y, z])))
            .map(|u| unscaled.polynomial(u).abs())
            .fold(0.0, f64::max);
        Self { coefficient, scale: fraction / largest.max(1e-9) }
    }

    fn polynomial(&self, [x, y, z]: [f64; 3]) -> f64 {
        let third = 1.0 / 3.0;
        let terms = [x, y, z, x * y, x * z, y * z, x * x - third, y * y - third, z * z - third];
        self.scale * terms.iter().zip(self.coefficient).map(|(t, c)| t * c).sum::<f64>()
    }

    /// The factor at an offset in mm from the head's middle.
    pub fn at(&self, offset_mm: Vector3<f64>) -> f64 {
        1.0 + self
            .polynomial([offset_mm.x / 95.0, offset_mm.y / 120.0, offset_mm.z / 110.0].map(|u| u.clamp(-1.2, 1.2)))
    }
}

/// The signal without noise: at every voxel the mean of `value` over the voxel, shaded.
///
/// `value` is the head's intensity at a point of the patient.
pub fn signal<F: Frame>(
    grid: Grid<F>,
    patient_from_scan: &RigidTransform<F, Patient>,
    value: impl Fn(Point3<f64>) -> f64 + Sync,
    bias: &Bias,
) -> Volume<f64, F> {
    // The head is known to 1 mm: larger voxels average it.
    let samples = grid.spacing_mm().map(|s| (s.round() as usize).max(1));
    let offsets: Vec<Vector3<f64>> = (0..samples.iter().product::<usize>())
        .map(|n| {
            let index = [n % samples[0], n / samples[0] % samples[1], n / (samples[0] * samples[1])];
            Vector3::from([0, 1, 2].map(|a| (index[a] as f64 + 0.5) / samples[a] as f64 - 0.5))
        })
        .collect();
    let middle = grid.position(Point3::from(grid.dims.map(|n| 0.5 * (n as f64 - 1.0)))).mm;
    let data = (0..grid.len())
        .into_par_iter()
        .map(|n| {
            let voxel = Vector3::from(grid.voxel(n).map(|v| v as f64));
            let mean = offsets
                .iter()
                .map(|offset| value(patient_from_scan.apply(grid.position(Point3::from(voxel + offset))).mm))
                .sum::<f64>()
                / offsets.len() as f64;
            mean * bias.at(grid.position(Point3::from(voxel)).mm - middle)
        })
        .collect();
    Volume::from_data(grid, data)
}

/// The scan of a signal: with Rician noise, rounded to whole numbers. The noise of a voxel depends on its number only.
pub fn stored<F: Frame>(signal: &Volume<f64, F>, noise: (CounterRng, f64)) -> Volume<i16, F> {
    let (rng, sigma) = (noise.0, noise.1 * f64::from(head::WHITE));
    Volume::from_fn(signal.grid, |n| {
        // Magnitude of a complex signal with Gaussian noise in both channels.
        let [real, imaginary] = rng.normal_pair(n as u64);
        ((signal.data[n] + sigma * real).hypot(sigma * imaginary)).round().clamp(0.0, 32767.0) as i16
    })
}
