//! The entropy focus criterion: a sharp image has its energy in few voxels, ghosts and blur spread it over many.
//!
//! Atkinson et al., "Automatic correction of motion artifacts in magnetic resonance images using an entropy focus criterion",
//! IEEE TMI 16(6), 1997; over the largest value that so many voxels can have, as MRIQC takes it.

use crate::geometry::Frame;
use crate::image::Volume;
use rayon::prelude::*;

/// Values to a task.
const AT_ONCE: usize = 1 << 16;

/// 0 for all energy in one voxel, 1 for the same in all; voxels of 0 are a frame and do not count. `None` without two voxels.
pub(super) fn entropy_focus<F: Frame>(t1: &Volume<f32, F>) -> Option<f64> {
    let parts: Vec<[f64; 4]> = t1.data.par_chunks(AT_ONCE).map(sums).collect();
    let all = parts.iter().fold([0.0; 4], |all, part| [0, 1, 2, 3].map(|m| all[m] + part[m]));
    let [count, total, square, own_logarithm] = all;
    let (energy, largest) = (square.sqrt(), count.sqrt() * count.sqrt().ln());
    // -sum of x/b ln(x/b) with b the root of the energy, written so that one pass is enough.
    (energy > 0.0 && largest > 0.0).then(|| (total * energy.ln() - own_logarithm) / energy / largest)
}

/// Number, sum, sum of squares and sum of x ln x of what is above 0.
fn sums(values: &[f32]) -> [f64; 4] {
    values.iter().filter(|x| **x > 0.0).fold([0.0; 4], |[n, sum, square, own], x| {
        let wide = f64::from(*x);
        [n + 1.0, sum + wide, square + wide * wide, own + wide * f64::from(x.ln())]
    })
}
