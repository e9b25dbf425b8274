//! A scan and where it lies in the template's frame.

use super::atlas;
use crate::geometry::{Frame, Mni, Position, RigidTransform};
use crate::image::resample::{Interpolation, Resampled, resample};
use crate::image::{Mask, Padding, Volume, padding};
use std::sync::OnceLock;

/// A scan and its pose. What it shows on the template's grid is asked for by every step after the registration, and is read from
/// the scan once, when it is first asked for.
#[derive(Debug)]
pub struct PosedScan<'a, F: Frame> {
    /// The scan on its own grid.
    pub t1: &'a Volume<f32, F>,
    /// From the scan to the template's frame.
    pub mni_from_t1: RigidTransform<F, Mni>,
    on_template: OnceLock<Resampled<Mni>>,
    padding: OnceLock<Vec<Padding>>,
}

impl<'a, F: Frame> PosedScan<'a, F> {
    /// A scan in its pose.
    pub fn new(t1: &'a Volume<f32, F>, mni_from_t1: &RigidTransform<F, Mni>) -> Self {
        Self { t1, mni_from_t1: *mni_from_t1, on_template: OnceLock::new(), padding: OnceLock::new() }
    }

    fn read(&self) -> &Resampled<Mni> {
        self.on_template.get_or_init(|| {
            // The spline keeps the sharpness that a linear kernel would take from every sulcus.
            let affine = self.mni_from_t1.inverse().to_affine();
            let mut read = resample(self.t1, &atlas::template().grid(), &affine, Interpolation::CubicBSpline, 0.0);
            read.volume = read.volume.map(|x| x.max(0.0));
            if !self.filled_up().is_empty() {
                // What the spline rings there is nothing that was seen.
                let grid = read.volume.grid;
                read.inside = Mask::from_fn(grid, |n| {
                    read.inside.data[n] && self.is_taken(affine.apply(grid.centre(grid.voxel(n))))
                });
                read.volume = Volume::from_fn(grid, |n| if read.inside.data[n] { read.volume.data[n] } else { 0.0 });
            }
            read
        })
    }

    /// What the scan was filled up with where it was not taken.
    pub fn filled_up(&self) -> &[Padding] {
        self.padding.get_or_init(|| padding(self.t1))
    }

    /// Whether the scan was taken at a place, and not filled up there.
    pub fn is_taken(&self, p: Position<F>) -> bool {
        let at: [f64; 3] = self.t1.grid.voxel_at(p).into();
        !self.filled_up().iter().any(|padding| padding.contains(at))
    }

    /// The intensities on the template's grid, not below 0; 0 outside the field of view.
    pub fn on_template(&self) -> &Volume<f32, Mni> {
        &self.read().volume
    }

    /// Where the field of view covers the template's grid; not where the scan was filled up.
    pub fn known(&self) -> &Mask<Mni> {
        &self.read().inside
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use crate::image::Grid;
    use nalgebra::{Point3, Vector3};

    #[test]
    fn a_scan_is_read_once_by_the_spline_and_is_never_below_nothing() {
        let grid = Grid::<Pre>::axis_aligned([24; 3], [3.0; 3], [-34.5; 3]);
        let t1 = Volume::from_voxels(grid, |[i, j, k]| if (i / 3 + j / 4 + k / 5) % 2 == 0 { 90.0 } else { 0.0 });
        let pose = RigidTransform::about(Point3::origin(), Vector3::new(0.1, -0.2, 0.3), Vector3::new(2.0, -9.0, 4.0));
        let scan = PosedScan::new(&t1, &pose);
        let template = atlas::template().grid();
        let read = resample(&t1, &template, &pose.inverse().to_affine(), Interpolation::CubicBSpline, 0.0);
        assert!(read.volume.data.iter().any(|&x| x < -1.0), "the spline overshoots at edges");
        assert_eq!(scan.on_template(), &read.volume.map(|x| x.max(0.0)));
        assert_eq!(scan.known(), &read.inside);
        assert!(std::ptr::eq(scan.on_template(), scan.on_template()));
    }

    #[test]
    fn where_a_scan_was_filled_up_nothing_is_known() {
        let grid = Grid::<Pre>::axis_aligned([48; 3], [3.0; 3], [-70.5; 3]);
        // Taken below a plane only, as a scan that was resampled onto this grid.
        let taken = |v: [usize; 3]| (v[2] as f64) < 30.0 + 0.2 * v[0] as f64;
        let t1 = Volume::from_voxels(grid, |v| if taken(v) { 80.0 + ((v[0] + v[1]) % 7) as f32 } else { 0.0 });
        let pose = RigidTransform::about(Point3::origin(), Vector3::new(0.0, 0.1, 0.0), Vector3::new(2.0, -3.0, 4.0));
        let scan = PosedScan::new(&t1, &pose);
        assert_eq!(scan.filled_up().len(), 1);
        let whole = t1.map(|_| 90.0f32);
        let (known, all) = (scan.known(), PosedScan::new(&whole, &pose).known().clone());
        let there = |n: usize| grid.voxel_at(pose.inverse().apply(known.grid.centre(known.grid.voxel(n))));
        for n in 0..known.data.len() {
            let p = there(n);
            let above = p.z - 30.0 - 0.2 * p.x;
            assert!(!known.data[n] || all.data[n]);
            assert!(!known.data[n] || above < 0.5, "{p}");
            assert!(known.data[n] || !all.data[n] || above > -2.0, "{p}");
            assert!(known.data[n] || scan.on_template().data[n] == 0.0);
        }
    }
}
