//! Moduli and tissues as a text has them, and how a sentence begins.

/// A modulus for readers: three digits, thousands apart.
pub fn pa(value: f64) -> String {
    let digits = value.abs().max(1e-9).log10().floor() as i32;
    let step = 10f64.powi((digits - 2).max(0));
    let rounded = ((value / step).round() * step).round() as i64;
    let text = rounded.to_string();
    let head = text.len() % 3;
    let mut parts: Vec<&str> = if head > 0 { vec![&text[..head]] } else { Vec::new() };
    parts.extend((head..text.len()).step_by(3).map(|n| &text[n..n + 3]));
    parts.join(",")
}

/// A modulus with its interval, or how near it is known where rounding leaves no interval: "1,370 Pa (to within 0.3 Pa)".
pub fn with_interval(mode_pa: f64, [low, high]: [f64; 2]) -> String {
    let [mode, low_text, high_text] = [mode_pa, low, high].map(pa);
    if low_text != high_text {
        return format!("{mode} Pa ({low_text} to {high_text})");
    }
    let reach = (high - mode_pa).max(mode_pa - low).max(1e-9);
    let step = 10f64.powf(reach.log10().floor());
    let decimals = (-step.log10()).clamp(0.0, 9.0) as usize;
    format!("{mode} Pa (to within {:.decimals$} Pa)", (reach / step).ceil() * step)
}

/// A range of moduli; one value where rounding leaves no range.
pub fn range([low, high]: [f64; 2]) -> String {
    let [low, high] = [low, high].map(pa);
    if low == high { format!("{low} Pa") } else { format!("{low} to {high} Pa") }
}

/// `grey_matter` as a text has it.
pub(super) fn words(tissue: &str) -> String {
    tissue.replace('_', " ")
}

/// With a large letter first.
pub(super) fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_below_rounding_is_told_as_what_it_is() {
        assert_eq!(with_interval(1370.0, [1369.8, 1370.2]), "1,370 Pa (to within 0.3 Pa)");
        assert_eq!(with_interval(1370.0, [1280.0, 1460.0]), "1,370 Pa (1,280 to 1,460)");
        assert_eq!((range([317.4, 317.4]), range([300.0, 900.0])), ("317 Pa".into(), "300 to 900 Pa".into()));
    }

    #[test]
    fn figures_have_three_digits_and_thousands_apart() {
        assert_eq!(
            [0.4, 49.3, 801.2, 1169.6, 41526.0, 1.2e6].map(pa),
            ["0", "49", "801", "1,170", "41,500", "1,200,000"]
        );
    }
}
