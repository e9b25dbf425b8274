//! Images and label maps seen through a map of points.

use super::vectors::Cell;
use crate::geometry::Frame;
use crate::image::{Grid, Mask, Volume};
use nalgebra::Point3;
use rayon::prelude::*;

/// How values between voxels are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Between {
    /// Linearly.
    Intensities,
    /// The value with the largest linear weight, the smaller of equals: no value comes out that does not go in.
    Labels,
}

/// The image on `target`: the value of a voxel is the source's where `source_from_target` leads, in voxels of the source. 0 beyond
/// the source, and where that place lies in `removed` tissue.
pub fn seen_through<S: Frame, T: Frame>(
    source: &Volume<f32, S>,
    target: &Grid<T>,
    source_from_target: impl Fn([usize; 3]) -> Option<Point3<f64>> + Sync + Send,
    removed: Option<&Mask<S>>,
    between: Between,
) -> Volume<f32, T> {
    let dims = source.grid.dims;
    let aligned = removed.is_some_and(|mask| mask.grid.coincides(&source.grid, 1e-9));
    let value = |voxel: [usize; 3]| -> Option<f32> {
        let v = source_from_target(voxel)?;
        let centre = Point3::new(v.x.round_ties_even(), v.y.round_ties_even(), v.z.round_ties_even());
        let [i, j, k] = [centre.x as isize, centre.y as isize, centre.z as isize];
        let gone = |mask: &Mask<S>| if aligned { mask.get(i, j, k) } else { mask.nearest(source.grid.position(v)) };
        if removed.and_then(gone) == Some(true) {
            return None;
        }
        // A hair off a centre, by rounding alone, is the centre.
        let near = |a: usize| (v[a] - centre[a]).abs() < 1e-5;
        if near(0) && near(1) && near(2) {
            return source.get(i, j, k);
        }
        let v = Point3::from([0, 1, 2].map(|a| if near(a) { centre[a] } else { v[a] }));
        let corners = Cell::at(dims, &v)?.weighed(&source.data);
        Some(match between {
            Between::Intensities => corners.iter().map(|(x, w)| f64::from(*x) * w).sum::<f64>() as f32,
            Between::Labels => heaviest(&corners),
        })
    };
    Volume::from_voxels(*target, |v| value(v).unwrap_or(0.0))
}

fn heaviest(corners: &[(f32, f64); 8]) -> f32 {
    // Nearly everywhere there is no choice.
    if corners.iter().all(|corner| corner.0 == corners[0].0) {
        return corners[0].0;
    }
    let weight_of = |label: f32| corners.iter().filter(|c| c.0 == label).map(|c| c.1).sum::<f64>();
    let mut best = (f64::NEG_INFINITY, f32::INFINITY);
    for &(label, _) in corners {
        let weight = weight_of(label);
        if weight > best.0 || (weight == best.0 && label < best.1) {
            best = (weight, label);
        }
    }
    best.1
}

/// Whether an image looks like a map of labels: whole numbers of 0 or more that mostly equal their neighbours. In a scan
/// hardly any voxel of the head does.
pub fn looks_like_labels<F: Frame>(volume: &Volume<f32, F>) -> bool {
    if !volume.data.par_iter().all(|x| *x == x.round() && *x >= 0.0) {
        return false;
    }
    let row = volume.grid.dims[0];
    let pairs = volume.data.par_iter().zip(&volume.data[1..]).enumerate();
    let (alike, all) = pairs
        .filter(|(n, (a, _))| (n + 1) % row != 0 && **a != 0.0)
        .map(|(_, (a, b))| (usize::from(a == b), 1usize))
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    2 * alike > all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;

    fn labels() -> Volume<f32, Pre> {
        let grid = Grid::<Pre>::axis_aligned([12, 10, 8], [1.0; 3], [0.0; 3]);
        Volume::from_fn(grid, |n| if grid.voxel(n)[0] < 5 { 2.0 } else { 1035.0 })
    }

    #[test]
    fn labels_stay_labels_and_intensities_are_mixed() {
        let source = labels();
        let grid = source.grid;
        let moved = |v: [usize; 3]| Some(Point3::new(v[0] as f64 - 0.4, v[1] as f64, v[2] as f64));
        let carried = seen_through(&source, &grid, moved, None, Between::Labels);
        assert!(carried.data.iter().all(|l| [0.0, 2.0, 1035.0].contains(l)));
        assert_eq!([carried.at(4, 3, 3), carried.at(5, 3, 3), carried.at(6, 3, 3)], [2.0, 1035.0, 1035.0]);
        let mixed = seen_through(&source, &grid, moved, None, Between::Intensities);
        assert!((mixed.at(5, 3, 3) - (0.4 * 2.0 + 0.6 * 1035.0)).abs() < 1e-2);
        assert!(looks_like_labels(&source));
        assert!(!looks_like_labels(&Volume::from_fn(grid, |n| (n % 97) as f32)));
    }

    #[test]
    fn removed_tissue_is_nowhere_and_standing_still_changes_nothing() {
        let source = labels();
        let grid = source.grid;
        let still = |v: [usize; 3]| Some(Point3::from(v.map(|x| x as f64)));
        let removed = Mask::from_fn(grid, |n| grid.voxel(n)[2] > 5);
        let carried = seen_through(&source, &grid, still, Some(&removed), Between::Intensities);
        for n in 0..grid.len() {
            assert_eq!(carried.data[n], if removed.data[n] { 0.0 } else { source.data[n] });
        }
    }
}
