//! The level at which fluid stands, by how much of it has drained.

use super::Scale;

/// The level of the fluid by the part that has drained, from none to all in even steps.
///
/// Between the steps a cubic that rises and falls as they do (Fritsch and Butland, SIAM Journal on Scientific and Statistical
/// Computing 5, 1984): a descent needs a slope without jumps.
#[derive(Clone, Debug, PartialEq)]
pub struct FluidLevels {
    level_mm: Vec<f64>,
    /// Per step.
    slopes_mm: Vec<f64>,
}

impl FluidLevels {
    /// Levels (mm against gravity, from the origin) when 0, 1/n, 2/n ... 1 of the fluid has drained; two or more.
    pub fn new(level_mm: Vec<f64>) -> Option<Self> {
        let rises: Vec<f64> = level_mm.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let (first, last) = (*rises.first()?, *rises.last()?);
        let between = rises.windows(2).map(|r| if r[0] * r[1] > 0.0 { 2.0 * r[0] * r[1] / (r[0] + r[1]) } else { 0.0 });
        let slopes_mm = std::iter::once(first).chain(between).chain([last]).collect();
        Some(Self { level_mm, slopes_mm })
    }

    /// The level when this part has drained, mm, and what it changes by per part.
    pub fn at(&self, part: f64) -> [f64; 2] {
        let steps = self.level_mm.len() - 1;
        let place = part.clamp(0.0, 1.0) * steps as f64;
        let n = (place as usize).min(steps - 1);
        let t = place - n as f64;
        let ([a, b], [sa, sb]) = ([self.level_mm[n], self.level_mm[n + 1]], [self.slopes_mm[n], self.slopes_mm[n + 1]]);
        let (square, cube) = (t * t, t * t * t);
        let level = a * (2.0 * cube - 3.0 * square + 1.0)
            + sa * (cube - 2.0 * square + t)
            + b * (3.0 * square - 2.0 * cube)
            + sb * (cube - square);
        let slope = 6.0 * (a - b) * (square - t) + sa * (3.0 * square - 4.0 * t + 1.0) + sb * (3.0 * square - 2.0 * t);
        [level, slope * steps as f64]
    }

    /// The level where the odds of the part drained have this logarithm, mm, and what it changes by per unit of that.
    pub fn at_number(&self, number: f64) -> [f64; 2] {
        let part = Scale::Share.value(number);
        let [level, slope] = self.at(part);
        [level, slope * part * (1.0 - part)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn levels() -> FluidLevels {
        FluidLevels::new(vec![60.0, 41.0, 30.0, 29.5, 12.0, -3.0, -40.0]).unwrap()
    }

    #[test]
    fn the_level_never_rises_with_the_part_and_its_slope_is_that_of_differences() {
        let levels = levels();
        let step = 1e-6;
        for n in 1..600 {
            let part = f64::from(n) / 600.0;
            let [[below, _], [at, slope], [above, _]] = [part - step, part, part + step].map(|p| levels.at(p));
            assert!(above <= at && at <= below, "{part}");
            assert!(((above - below) / (2.0 * step) - slope).abs() < 1e-3 * slope.abs().max(1.0), "{part}");
        }
        assert_eq!([levels.at(0.0)[0], levels.at(0.5)[0], levels.at(1.0)[0]], [60.0, 29.5, -40.0]);
        let [[low, _], [_, slope], [high, _]] = [-0.4 - step, -0.4, -0.4 + step].map(|x| levels.at_number(x));
        assert!(((high - low) / (2.0 * step) - slope).abs() < 1e-4 * slope.abs());
        assert_eq!(FluidLevels::new(vec![3.0]), None);
    }
}
