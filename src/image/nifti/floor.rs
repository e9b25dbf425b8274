//! Scans whose intensities do not begin at zero.

use super::magnitude::some_above;

/// Counts intensities that begin well below zero (standardised, or stored with an offset) from where they begin, and says
/// where that was. Air is dark in magnitude images, and everything that reads a T1 takes zero for nothing.
pub(super) fn counted_from_their_floor(data: &mut [f32]) -> Option<f32> {
    /// Interpolation undershoots edges by a few percent of the range: that is no floor.
    const UNDERSHOOT: f32 = 0.05;
    let lowest = data.iter().copied().fold(f32::INFINITY, f32::min);
    if lowest >= 0.0 {
        return None;
    }
    // Padding has the lowest value of all, however low, and says nothing of the rest.
    let rest = some_above(data, lowest);
    let [floor, top] = [*rest.get(rest.len() / 100)?, *rest.get(rest.len() - 1 - rest.len() / 100)?];
    if floor >= -UNDERSHOOT * (top - floor) {
        return None;
    }
    for x in data {
        *x = (*x - floor).max(0.0);
    }
    Some(floor)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bright ball in air, what becomes of it, and the floor that was found.
    fn counted(of: impl Fn(f32) -> f32) -> (Vec<f32>, Option<f32>) {
        let value = |n: i32| {
            let v = [n % 20, n / 20 % 20, n / 400];
            let from_middle = v.iter().map(|&x| (x as f32 - 9.5).powi(2)).sum::<f32>().sqrt();
            if from_middle < 7.0 { 400.0 + 10.0 * from_middle } else { (v[0] % 3) as f32 }
        };
        let mut data: Vec<f32> = (0..8000).map(|n| of(value(n))).collect();
        let floor = counted_from_their_floor(&mut data);
        (data, floor)
    }

    #[test]
    fn an_offset_is_taken_out_and_told_and_an_undershoot_or_padding_is_left() {
        let (plain, none) = counted(|x| x);
        assert_eq!(none, None);
        for by in [1000.0, 200.0] {
            let (moved, floor) = counted(|x| x - by);
            assert!(floor.is_some_and(|floor| (floor + by).abs() <= 2.0), "{floor:?}");
            assert!(moved.iter().zip(&plain).all(|(a, b)| (a - b).abs() <= 2.0), "{by}");
        }
        let (under, none) = counted(|x| x - 5.0);
        assert!(none.is_none() && under[0] < 0.0);
        let (padded, none) = counted(|x| if x == 0.0 { -32_768.0 } else { x });
        assert!(none.is_none() && padded.iter().any(|&x| x == -32_768.0));
        assert_eq!(counted_from_their_floor(&mut [-1.0; 5]), None);
    }
}
