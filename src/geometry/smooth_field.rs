//! A field that is twice differentiable everywhere: samples on a regular grid as coefficients of cubic B-splines.
//!
//! The samples are taken as the coefficients themselves (Schoenberg's approximation; de Boor, "A Practical Guide to
//! Splines", ch. 12): linear fields come out exactly, and what varies over less than about two spacings, such as the steps of
//! a distance to voxels, is smoothed instead of overshooting as an interpolation would.

/// Samples on a regular grid. Beyond the grid the field keeps the value at its edge.
#[derive(Clone, Debug, PartialEq)]
pub struct SmoothField {
    origin_mm: [f64; 3],
    spacing_mm: [f64; 3],
    size: [usize; 3],
    samples: Vec<f32>,
}

/// A field at a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FieldPoint {
    /// Value.
    pub value: f64,
    /// First derivatives, per mm.
    pub gradient: [f64; 3],
    /// Second derivatives, per mm2.
    pub hessian: [[f64; 3]; 3],
}

/// The four cubic B-splines around a place between two samples, their first and their second derivatives.
fn basis(t: f64) -> [[f64; 4]; 3] {
    let s = 1.0 - t;
    let (t2, s2) = (t * t, s * s);
    let value = [s2 * s, 3.0 * t2 * t - 6.0 * t2 + 4.0, 3.0 * s2 * s - 6.0 * s2 + 4.0, t2 * t].map(|v| v / 6.0);
    let first = [-0.5 * s2, 1.5 * t2 - 2.0 * t, 2.0 * s - 1.5 * s2, 0.5 * t2];
    let second = [s, 3.0 * t - 2.0, 3.0 * s - 2.0, t];
    [value, first, second]
}

impl SmoothField {
    /// `samples` with the first axis fastest; `None` when there are not as many as the grid has places, or a spacing is not
    /// above zero.
    pub fn new(origin_mm: [f64; 3], spacing_mm: [f64; 3], size: [usize; 3], samples: Vec<f32>) -> Option<Self> {
        let whole = !samples.is_empty() && size.iter().product::<usize>() == samples.len();
        (whole && spacing_mm.iter().all(|h| *h > 0.0)).then_some(Self { origin_mm, spacing_mm, size, samples })
    }

    /// The field with its derivatives at a point (mm).
    pub fn at(&self, p_mm: [f64; 3]) -> FieldPoint {
        let mut splines = [[[0.0; 4]; 3]; 3];
        let mut places = [[0usize; 4]; 3];
        for axis in 0..3 {
            let last = self.size[axis] as f64 - 1.0;
            // Two samples beyond the edge every spline sees the edge alone.
            let x = ((p_mm[axis] - self.origin_mm[axis]) / self.spacing_mm[axis]).clamp(-3.0, last + 3.0);
            let cell = x.floor();
            splines[axis] = basis(x - cell);
            for (n, place) in places[axis].iter_mut().enumerate() {
                *place = (cell + n as f64 - 1.0).clamp(0.0, last) as usize;
            }
        }
        // Along x first, then y, then z: value and derivatives of each order.
        let [bx, by, bz] = splines;
        let mut point = FieldPoint::default();
        let (mut gradient, mut pure, mut mixed) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        for (k, &z) in places[2].iter().enumerate() {
            let (mut plane, mut plane_x, mut plane_y) = (0.0, 0.0, 0.0);
            let (mut plane_xx, mut plane_yy, mut plane_xy) = (0.0, 0.0, 0.0);
            for (j, &y) in places[1].iter().enumerate() {
                let row = self.size[0] * (y + self.size[1] * z);
                let (mut line, mut line_x, mut line_xx) = (0.0, 0.0, 0.0);
                for (i, &x) in places[0].iter().enumerate() {
                    let sample = f64::from(self.samples[row + x]);
                    line += bx[0][i] * sample;
                    line_x += bx[1][i] * sample;
                    line_xx += bx[2][i] * sample;
                }
                plane += by[0][j] * line;
                plane_x += by[0][j] * line_x;
                plane_xx += by[0][j] * line_xx;
                plane_y += by[1][j] * line;
                plane_xy += by[1][j] * line_x;
                plane_yy += by[2][j] * line;
            }
            point.value += bz[0][k] * plane;
            gradient[0] += bz[0][k] * plane_x;
            gradient[1] += bz[0][k] * plane_y;
            gradient[2] += bz[1][k] * plane;
            pure[0] += bz[0][k] * plane_xx;
            pure[1] += bz[0][k] * plane_yy;
            pure[2] += bz[2][k] * plane;
            mixed[0] += bz[0][k] * plane_xy;
            mixed[1] += bz[1][k] * plane_x;
            mixed[2] += bz[1][k] * plane_y;
        }
        let h = self.spacing_mm;
        let [xy, xz, yz] = [mixed[0] / (h[0] * h[1]), mixed[1] / (h[0] * h[2]), mixed[2] / (h[1] * h[2])];
        let [xx, yy, zz] = [0, 1, 2].map(|i| pure[i] / (h[i] * h[i]));
        point.gradient = [0, 1, 2].map(|i| gradient[i] / h[i]);
        point.hessian = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        point
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampled(f: impl Fn([f64; 3]) -> f64) -> SmoothField {
        let (size, spacing, origin) = ([14, 12, 11], [2.0, 2.5, 3.0], [-10.0, -12.0, -14.0]);
        let mut samples = Vec::new();
        for k in 0..size[2] {
            for j in 0..size[1] {
                for i in 0..size[0] {
                    samples.push(f([0, 1, 2].map(|a| origin[a] + [i, j, k][a] as f64 * spacing[a])) as f32);
                }
            }
        }
        SmoothField::new(origin, spacing, size, samples).unwrap()
    }

    #[test]
    fn a_linear_field_comes_out_exactly() {
        let field = sampled(|p| 3.0 + 0.5 * p[0] - 2.0 * p[1] + 0.25 * p[2]);
        for p in [[0.3, -0.7, 1.9], [4.01, 6.0, 2.0], [-3.9, -4.4, 5.5]] {
            let at = field.at(p);
            assert!((at.value - (3.0 + 0.5 * p[0] - 2.0 * p[1] + 0.25 * p[2])).abs() < 1e-5);
            for (found, wanted) in at.gradient.iter().zip([0.5, -2.0, 0.25]) {
                assert!((found - wanted).abs() < 1e-5);
            }
            assert!(at.hessian.iter().flatten().all(|v| v.abs() < 1e-5));
        }
    }

    #[test]
    fn derivatives_are_those_of_the_value_across_the_borders_of_cells() {
        let field = sampled(|p| (0.2 * p[0]).sin() * (0.3 * p[1]).cos() + 0.01 * p[2] * p[2] + 0.02 * p[0] * p[2]);
        let step = 1e-4;
        // On a sample, on the border of a cell, inside, and beyond the grid.
        for p in [[0.0, 0.5, 1.0], [2.0, 3.0, -2.0], [1.37, -2.9, 4.2], [17.5, 0.4, -14.2]] {
            let here = field.at(p);
            for axis in 0..3 {
                let along = |s: f64| {
                    let mut q = p;
                    q[axis] += s;
                    field.at(q)
                };
                let (above, below) = (along(step), along(-step));
                let slope = (above.value - below.value) / (2.0 * step);
                assert!((slope - here.gradient[axis]).abs() < 1e-7, "{p:?} {axis}");
                for other in 0..3 {
                    let slope = (above.gradient[other] - below.gradient[other]) / (2.0 * step);
                    assert!((slope - here.hessian[axis][other]).abs() < 2e-5, "{p:?} {axis} {other}");
                }
            }
        }
    }

    #[test]
    fn far_beyond_the_grid_the_field_is_even() {
        let field = sampled(|p| p[0]);
        assert!(field.at([1e6, 0.0, 0.0]).gradient.iter().all(|slope| slope.abs() < 1e-12));
        assert!((field.at([1e6, 0.0, 0.0]).value - 16.0).abs() < 1e-6);
    }

    #[test]
    fn samples_that_do_not_fill_the_grid_are_refused() {
        assert_eq!(SmoothField::new([0.0; 3], [1.0; 3], [2, 2, 2], vec![0.0; 7]), None);
        assert_eq!(SmoothField::new([0.0; 3], [1.0, 0.0, 1.0], [1, 1, 1], vec![0.0]), None);
    }
}
