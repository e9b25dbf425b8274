//! Some of many values, evenly from everywhere.

/// The next step from `least` on that has no factor in common with a number of voxels: an image's, i fastest, or that of its row. A step as
/// long as a row would look at one column of the image only, which may be air.
pub fn coprime_stride(least: usize, values: usize) -> usize {
    let least = least.max(1);
    // One of as many steps in a row leaves 1 when divided by their number.
    let mut steps = least..least.saturating_add(values.max(1));
    steps.find(|step| greatest_common_divisor(*step, values) == 1).unwrap_or(least)
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_meets_every_column_of_an_image_of_any_size() {
        for [nx, ny, nz] in [[256usize, 416, 480], [256, 256, 192], [131, 163, 147], [240, 240, 155], [7, 5, 3]] {
            let values = nx * ny * nz;
            let least = values.div_ceil(200_000);
            let stride = coprime_stride(least, values);
            assert!((least..least + 5).contains(&stride), "{nx}: {stride}");
            let (mut columns, mut rows) = (vec![0usize; nx], vec![0usize; ny]);
            for n in (0..values).step_by(stride) {
                columns[n % nx] += 1;
                rows[n / nx % ny] += 1;
            }
            let even = |counts: &[usize]| {
                let mean = counts.iter().sum::<usize>() as f64 / counts.len() as f64;
                counts.iter().all(|count| (*count as f64) > 0.5 * mean && (*count as f64) < 2.0 * mean)
            };
            assert!(even(&columns) && even(&rows), "{nx} {ny}: {stride}");
        }
    }

    #[test]
    fn of_few_or_no_values_all_are_looked_at() {
        assert_eq!([0, 1, 17, 200_000].map(|values: usize| coprime_stride(values.div_ceil(200_000), values)), [1; 4]);
    }
}
