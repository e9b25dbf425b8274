//! Landmarks of a synthetic patient: points of the tissue that stays, with where they are after the operation.

use super::SyntheticPatient;
use crate::geometry::{Position, Pre};
use crate::material::random::CounterRng;
use crate::segment::label;
use nalgebra::Vector3;

/// Where a point is before and after, mm.
type Pair = ([f64; 3], [f64; 3]);

/// How many there are.
const COUNT: usize = 200;

impl SyntheticPatient {
    /// The landmarks on both scans, each in its scanner's frame, mm.
    pub fn landmarks(&self) -> Vec<Pair> {
        let grid = self.tissue_pre.grid;
        let tissue = |n: &usize| {
            let l = self.tissue_pre.data[*n];
            (l == label::GREY_MATTER || l == label::WHITE_MATTER) && !self.resected_pre.data[*n]
        };
        let places: Vec<usize> = (0..grid.len()).filter(tissue).collect();
        let rng = CounterRng::new(self.truth.settings.seed, 601);
        let mut chosen: Vec<usize> =
            (0..COUNT as u64).map(|n| (rng.uniform(n) * places.len() as f64) as usize).collect();
        chosen.sort_unstable();
        chosen.dedup();
        let of = |at: usize| {
            let n = places[at.min(places.len() - 1)];
            let x: Position<Pre> = grid.centre(grid.voxel(n));
            let moved = x.mm + Vector3::from(self.displacement_pre.data[n].map(f64::from));
            let y = self.post_from_pre.apply(Position::from_point(moved));
            (x.mm.into(), y.mm.into())
        };
        if places.is_empty() { Vec::new() } else { chosen.into_iter().map(of).collect() }
    }

    /// The same as two tables.
    pub(super) fn landmark_tables(&self) -> [Vec<u8>; 2] {
        let landmarks = self.landmarks();
        let table = |of: &dyn Fn(&Pair) -> [f64; 3]| {
            let row = |(n, pair): (usize, &Pair)| {
                let [x, y, z] = of(pair);
                format!("{},{x:.3},{y:.3},{z:.3}\n", n + 1)
            };
            let rows: String = landmarks.iter().enumerate().map(row).collect();
            ("name,x,y,z\n".to_owned() + &rows).into_bytes()
        };
        [table(&|p| p.0), table(&|p| p.1)]
    }
}
