//! Numbers and pictures for a page, and text that is safe where the page's templates (maud, which escapes by itself) do not
//! reach: inside the SVG of our charts and in inline scripts.

/// Text for element content and quoted attributes.
///
/// ```
/// assert_eq!(hgm::report::html::escape("<b>\"5 & 6\"</b>"), "&lt;b&gt;&quot;5 &amp; 6&quot;&lt;/b&gt;");
/// ```
pub fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            // Control characters are not allowed in HTML, whatever a header or a warning brings along.
            c if c.is_control() && c != '\n' && c != '\t' => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

/// A page without control characters, which HTML does not allow, whatever a header or a warning brought along.
pub fn without_control_characters(page: String) -> String {
    let unwanted = |c: char| c.is_control() && c != '\n' && c != '\t';
    if page.contains(unwanted) { page.replace(unwanted, "\u{fffd}") } else { page }
}

/// JSON for a `<script type="application/json">`: `<`, `>`, `&` as escapes, so that neither `</script` nor `<!--`
/// can end or hide the element (HTML standard, "restrictions for contents of script elements").
pub fn script_json(value: &serde_json::Value) -> String {
    let text = value.to_string();
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '<' => safe.push_str("\\u003c"),
            '>' => safe.push_str("\\u003e"),
            '&' => safe.push_str("\\u0026"),
            '\u{2028}' => safe.push_str("\\u2028"),
            '\u{2029}' => safe.push_str("\\u2029"),
            c => safe.push(c),
        }
    }
    safe
}

/// A `data:` address holding a PNG.
pub fn png_address(png: &[u8]) -> String {
    use base64::Engine;
    format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(png))
}

/// A whole number, thousands apart with a thin space; from a hundred thousand on to three digits.
pub fn count(n: usize) -> String {
    let digits = n.max(1).ilog10() as usize + 1;
    let step = if digits > 5 { 10usize.pow(digits as u32 - 3) } else { 1 };
    number(((n + step / 2) / step * step) as f64, digits)
}

/// A share with its standard deviation in per cent; one that rounding would make nothing is told as a bound.
pub fn percent(share: f64, sd: f64) -> String {
    let (share, sd) = (100.0 * share, 100.0 * sd);
    match sd {
        sd if sd >= 0.5 => format!("{} \u{b1} {} %", fixed(share, 0), fixed(sd, 0)),
        sd if sd >= 0.05 => format!("{} \u{b1} {} %", fixed(share, 1), fixed(sd, 1)),
        _ => format!("{} % (standard deviation below 0.1 %)", fixed(share, 1)),
    }
}

/// A number with a fixed count of decimals and a true minus sign.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    if zero { text.replace('-', "") } else { text.replace('-', "\u{2212}") }
}

/// Figures beyond this stand for infinity, which JSON has not; none that is told is as large.
pub const INFINITE: f64 = 1e15;

/// A number for a reader: `digits` significant digits, thousands apart with a thin space, no exponent; infinity beyond
/// [`INFINITE`].
pub fn number(value: f64, digits: usize) -> String {
    if value.is_nan() {
        return "–".to_owned();
    }
    if value.abs() > INFINITE {
        return if value > 0.0 { "∞" } else { "\u{2212}∞" }.to_owned();
    }
    let magnitude = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    let decimals = (digits as i32 - 1 - magnitude).clamp(0, 9) as usize;
    let text = format!("{:.*}", decimals, value.abs());
    let (whole, fraction) = text.split_once('.').map_or((text.as_str(), None), |(w, f)| (w, Some(f)));
    let mut grouped = String::new();
    for (n, c) in whole.chars().enumerate() {
        if n > 0 && (whole.len() - n) % 3 == 0 && whole.len() > 4 {
            grouped.push('\u{2009}');
        }
        grouped.push(c);
    }
    let sign = if value < 0.0 && text.chars().any(|c| c.is_ascii_digit() && c != '0') { "\u{2212}" } else { "" };
    fraction.map_or_else(|| format!("{sign}{grouped}"), |f| format!("{sign}{grouped}.{f}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn script_json_cannot_close_its_element() {
        let value = serde_json::json!({"note": "</script><!-- & \u{2028}"});
        let text = script_json(&value);
        assert!(!text.contains('<') && !text.contains('\u{2028}'));
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }

    #[test]
    fn no_share_is_told_without_an_error_because_of_rounding() {
        assert_eq!(percent(0.8, 0.05), "80 \u{b1} 5 %");
        assert_eq!(percent(0.9412, 0.003), "94.1 \u{b1} 0.3 %");
        assert_eq!(percent(0.9412, 0.0001), "94.1 % (standard deviation below 0.1 %)");
    }

    #[test]
    fn control_characters_never_pass() {
        for pass in [escape as fn(&str) -> String, |text| without_control_characters(text.to_owned())] {
            assert_eq!(pass("a\u{0}b\u{1b}c\nd"), "a\u{fffd}b\u{fffd}c\nd");
        }
    }

    #[test]
    fn numbers_keep_their_significant_digits() {
        assert_eq!(number(0.012345, 3), "0.0123");
        assert_eq!(number(333.28, 4), "333.3");
        assert_eq!(number(61234.0, 3), "61\u{2009}234");
        assert_eq!(number(-2.5, 2), "\u{2212}2.5");
        assert_eq!(number(f64::NAN, 3), "–");
        assert_eq!((number(f64::MAX, 3), number(f64::NEG_INFINITY, 3)), ("∞".into(), "\u{2212}∞".into()));
        assert_eq!(number(0.0, 3), "0.00");
        assert_eq!((count(0), count(644), count(152052)), ("0".into(), "644".into(), "152\u{2009}000".into()));
        assert_eq!((fixed(-0.04, 1), fixed(-1.25, 1)), ("0.0".into(), "\u{2212}1.2".into()));
    }
}
