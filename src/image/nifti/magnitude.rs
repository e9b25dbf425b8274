//! Scans in units of another size than scanners write.

use crate::image::sampling::coprime_stride;

/// What 99 of 100 positive intensities lie below is expected between these: eight bits to sixteen, and float beyond that.
const USUAL: std::ops::Range<f32> = 4.0..131_072.0;
/// Where it is brought to, within a factor of two.
const TARGET: f32 = 1024.0;

/// Multiplies intensities that are all tiny or huge (fractions of one, physical units) by the power of two that makes them as
/// large as a scanner's, and says which factor that was. A power of two changes no digit: the scan is the same in another unit,
/// and what is compared with a small number anywhere means the same for all scans.
pub(super) fn brought_to_a_usual_size(data: &mut [f32]) -> Option<f32> {
    let positive = some_above(data, 0.0);
    let top = *positive.get((positive.len() - positive.len() / 100).checked_sub(1)?)?;
    if USUAL.contains(&top) {
        return None;
    }
    // Of a number below the smallest normal one the power would not be finite.
    let factor = (TARGET / top.max(f32::MIN_POSITIVE)).log2().floor().clamp(-126.0, 126.0).exp2();
    for x in data {
        // A voxel out of all proportion stays a number.
        *x = (*x * factor).clamp(f32::MIN, f32::MAX);
    }
    Some(factor)
}

/// Enough of the values above `least` to tell quantiles by, in order.
pub(super) fn some_above(data: &[f32], least: f32) -> Vec<f32> {
    const ENOUGH: usize = 200_000;
    let stride = coprime_stride(data.len().div_ceil(ENOUGH), data.len());
    let mut some: Vec<f32> = data.iter().copied().step_by(stride).filter(|&x| x > least).collect();
    some.sort_unstable_by(f32::total_cmp);
    some
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan() -> Vec<f32> {
        (0..5000).map(|n| if n % 3 == 0 { 0.0 } else { (n % 251) as f32 }).collect()
    }

    #[test]
    fn a_scan_in_units_of_another_size_is_the_same_scan() {
        let plain = scan();
        for power in [-60, -20, -7, 11, 40, 100] {
            let unit = f32::exp2(power as f32);
            let mut scaled: Vec<f32> = plain.iter().map(|x| x * unit).collect();
            let factor = brought_to_a_usual_size(&mut scaled).unwrap();
            assert!(scaled.iter().zip(&plain).all(|(a, b)| *a == b * unit * factor), "{power}");
            let top = scaled.iter().copied().fold(0.0, f32::max);
            assert!((TARGET / 2.0..2.0 * TARGET).contains(&top), "{power}: {top}");
        }
    }

    #[test]
    fn a_row_as_long_as_the_step_is_no_scan_of_air() {
        // Two voxels of air to a row of 60, and a step of 60 by their number.
        let scan: Vec<f32> = (0..11_999_940).map(|n| if n % 60 < 2 { 0.0 } else { (n % 7) as f32 + 1.0 }).collect();
        assert!(some_above(&scan, 0.0).len() > 150_000);
    }

    #[test]
    fn what_scanners_write_is_left_as_it_is() {
        for unit in [0.1, 1.0, 16.0, 256.0] {
            let plain: Vec<f32> = scan().iter().map(|x| x * unit).collect();
            let mut read = plain.clone();
            assert_eq!(brought_to_a_usual_size(&mut read), None, "{unit}");
            assert_eq!(read, plain);
        }
        assert_eq!(brought_to_a_usual_size(&mut [0.0; 7]), None);
        assert_eq!(brought_to_a_usual_size(&mut []), None);
    }

    #[test]
    fn one_voxel_of_another_size_decides_nothing() {
        let mut with_a_spike = scan();
        with_a_spike[7] = 1e30;
        assert_eq!(brought_to_a_usual_size(&mut with_a_spike), None);
        let mut tiny: Vec<f32> = with_a_spike.iter().map(|x| x * 1e-30).collect();
        tiny[7] = 1e30;
        assert!(brought_to_a_usual_size(&mut tiny).is_some() && tiny.iter().all(|x| x.is_finite()));
    }
}
