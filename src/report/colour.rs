//! Colours a colour-blind reader can tell apart.
//!
//! Magnitudes: viridis (S. van der Walt, N. Smith, E. Firing, 2015; CC0), 33 stops of the published table joined
//! linearly (within 3/255 of it). Outlines: M. Okabe, K. Ito, "Color universal design", 2008.

/// Red, green, blue, 0 to 255.
pub type Rgb = [u8; 3];

const VIRIDIS: [u32; 33] = [
    0x440154, 0x470d60, 0x48186a, 0x482374, 0x472d7b, 0x453781, 0x424086, 0x3e4989, 0x3b528b, 0x375b8d, 0x33638d,
    0x2f6b8e, 0x2c728e, 0x297a8e, 0x26828e, 0x23898e, 0x21918c, 0x1f988b, 0x1fa088, 0x22a785, 0x28ae80, 0x32b67a,
    0x3fbc73, 0x4ec36b, 0x5ec962, 0x70cf57, 0x84d44b, 0x98d83e, 0xaddc30, 0xc2df23, 0xd8e219, 0xece51b, 0xfde725,
];

/// Grey for what has no value.
pub const NO_VALUE: Rgb = [170, 170, 170];
/// Outline of the brain (Okabe-Ito sky blue).
pub const BRAIN: Rgb = [86, 180, 233];
/// Outline of the ventricles (Okabe-Ito bluish green, lightened for a black ground).
pub const VENTRICLE: Rgb = [38, 196, 148];
/// Outline of the cavity (Okabe-Ito vermillion, lightened for a black ground).
pub const CAVITY: Rgb = [255, 122, 56];
/// Outline of the resected tissue (Okabe-Ito yellow).
pub const RESECTED: Rgb = [240, 228, 66];

/// Viridis at `t` in 0..=1 (clamped); [`NO_VALUE`] for NaN.
pub fn viridis(t: f64) -> Rgb {
    if t.is_nan() {
        return NO_VALUE;
    }
    let x = t.clamp(0.0, 1.0) * 32.0;
    let low = (x.floor() as usize).min(31);
    let w = x - low as f64;
    let channel = |stop: u32, c: usize| f64::from((stop >> (16 - 8 * c)) & 0xff);
    std::array::from_fn(|c| ((1.0 - w) * channel(VIRIDIS[low], c) + w * channel(VIRIDIS[low + 1], c)).round() as u8)
}

/// `#rrggbb`.
pub fn hex(c: Rgb) -> String {
    format!("#{:02x}{:02x}{:02x}", c[0], c[1], c[2])
}

/// A fill for the cells of a label in pictures of meshes.
pub fn of_label(label: u8) -> Rgb {
    match label {
        1 => [146, 186, 210],
        2 => [190, 174, 160],
        3 => [236, 230, 218],
        4 => [60, 160, 190],
        5 => [222, 120, 70],
        6 => [168, 72, 120],
        7 => [206, 160, 190],
        _ => NO_VALUE,
    }
}

/// Values mapped to viridis between two ends, with the unit they are read in.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourScale {
    /// Value at the dark end.
    pub low: f64,
    /// Value at the bright end.
    pub high: f64,
    /// What is shown, with its unit: `RMSE (mm)`.
    pub title: String,
    /// Whether the bright end stands for all that is larger, too.
    pub and_above: bool,
}

impl ColourScale {
    /// A scale over exactly the range of the finite values; `None` when there is none.
    pub fn over(values: impl IntoIterator<Item = f64>, title: &str) -> Option<Self> {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in values.into_iter().filter(|v| v.is_finite()) {
            low = low.min(v);
            high = high.max(v);
        }
        (low <= high).then(|| Self { low, high, title: title.to_owned(), and_above: false })
    }

    /// A scale of sizes from nothing to the 95th percentile of the finite values, so that a few large ones do not darken
    /// all others; `None` when there is no value.
    pub fn to_95(values: impl IntoIterator<Item = f64>, title: &str) -> Option<Self> {
        let mut values: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
        values.sort_unstable_by(f64::total_cmp);
        let last = values.len().checked_sub(1)?;
        let high = values[(0.95 * last as f64).ceil() as usize].max(0.0);
        Some(Self { low: 0.0, high, title: title.to_owned(), and_above: values[last] > high })
    }

    /// Colour of a value.
    pub fn colour(&self, value: f64) -> Rgb {
        let span = self.high - self.low;
        viridis(if span > 0.0 { (value - self.low) / span } else { value * 0.0 })
    }
}

/// Round numbers that divide `low..=high` into about `count` parts.
pub fn ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    if high.partial_cmp(&low) != Some(std::cmp::Ordering::Greater) || !(high - low).is_finite() {
        return vec![low];
    }
    let raw = (high - low) / count.max(1) as f64;
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= raw * 0.999).unwrap_or(power);
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last).map(|n| n as f64 * step).collect()
}

/// A tick's text: as many decimals as the step between ticks needs.
pub fn tick_label(value: f64, step: f64) -> String {
    let decimals = (0..6).find(|&d| {
        let scaled = step * 10f64.powi(d);
        (scaled - scaled.round()).abs() < 1e-6 * scaled.abs().max(1e-9)
    });
    let text = format!("{value:.*}", decimals.unwrap_or(6) as usize);
    if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') {
        text.trim_start_matches('-').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lightness(c: Rgb) -> f64 {
        0.2126 * f64::from(c[0]) + 0.7152 * f64::from(c[1]) + 0.0722 * f64::from(c[2])
    }

    #[test]
    fn viridis_grows_lighter_all_the_way() {
        let light: Vec<f64> = (0..=64).map(|i| lightness(viridis(f64::from(i) / 64.0))).collect();
        assert!(light.windows(2).all(|w| w[1] > w[0]));
        assert_eq!((viridis(0.0), viridis(1.0), viridis(7.0)), ([68, 1, 84], [253, 231, 37], [253, 231, 37]));
        assert_eq!(viridis(f64::NAN), NO_VALUE);
    }

    #[test]
    fn scale_spans_exactly_the_finite_values() {
        let scale = ColourScale::over([0.5, f64::NAN, 2.5, 1.0], "RMSE (mm)").unwrap();
        assert_eq!((scale.low, scale.high), (0.5, 2.5));
        assert_eq!(scale.colour(2.5), [253, 231, 37]);
        assert!(ColourScale::over([f64::NAN], "x").is_none());
        assert_eq!(ColourScale::over([3.0], "x").unwrap().colour(3.0), viridis(0.0));
    }

    #[test]
    fn a_scale_of_sizes_begins_at_nothing_and_a_few_large_ones_do_not_darken_the_others() {
        let values: Vec<f64> = (0..=100).map(f64::from).chain([f64::NAN]).collect();
        let scale = ColourScale::to_95(values, "shift (mm)").unwrap();
        assert_eq!((scale.low, scale.high, scale.and_above), (0.0, 95.0, true));
        assert_eq!(scale.colour(100.0), viridis(1.0));
        assert!(!ColourScale::to_95([2.0, 2.0], "x").unwrap().and_above && ColourScale::to_95([], "x").is_none());
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(0.0, 1.0, 5), [0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0]);
        assert!(ticks(310.0, 2299.0, 5).iter().all(|t| t % 500.0 == 0.0));
        assert_eq!(ticks(2.0, 2.0, 5), [2.0]);
        assert_eq!(tick_label(0.6000000000000001, 0.2), "0.6");
        assert_eq!(tick_label(-0.0, 0.5), "0.0");
    }
}
