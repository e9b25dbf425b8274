//! A ghost: part of the signal comes out half the field of view further along the phase direction, as where every other line of
//! k-space is read out a little differently.

use crate::geometry::Frame;
use crate::image::Volume;

/// The signal with `fraction` of it moved by half the field of view along `axis`; what leaves at one edge comes in at the other.
pub fn ghosted<F: Frame>(signal: &Volume<f64, F>, axis: usize, fraction: f64) -> Volume<f64, F> {
    let dims = signal.grid.dims;
    Volume::from_voxels(signal.grid, |voxel| {
        let mut from = voxel;
        from[axis] = (voxel[axis] + dims[axis] / 2) % dims[axis];
        let [own, other] = [voxel, from].map(|[i, j, k]| signal.at(i, j, k));
        (1.0 - fraction) * own + fraction * other
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use crate::image::Grid;

    #[test]
    fn a_ghost_keeps_the_sum_of_every_line_along_the_phase_direction_and_two_halves_make_both_halves_alike() {
        let grid = Grid::<Pre>::axis_aligned([6, 9, 8], [2.0; 3], [0.0; 3]);
        let signal = Volume::from_fn(grid, |n| f64::from((n * 31 % 17) as u32));
        for axis in 0..3 {
            let ghosted = ghosted(&signal, axis, 0.2);
            let lines = |volume: &Volume<f64, Pre>| {
                let mut sums = vec![0.0; grid.len()];
                for n in 0..grid.len() {
                    let mut line = grid.voxel(n);
                    line[axis] = 0;
                    sums[grid.index(line[0], line[1], line[2])] += volume.data[n];
                }
                sums
            };
            assert!(lines(&signal).iter().zip(lines(&ghosted)).all(|(a, b)| (a - b).abs() < 1e-9));
            assert!(ghosted != signal);
        }
        let half = ghosted(&signal, 2, 0.5);
        assert!((0..4).all(|k| (half.at(3, 4, k) - half.at(3, 4, k + 4)).abs() < 1e-12));
    }
}
