//! Where in a TOML text a reader stopped: materials, scenarios and settings are such texts.

/// The line, from 1, that an error of the TOML reader points at.
///
/// ```
/// let text = "a = 1\nb = \n";
/// let error = toml::from_str::<toml::Table>(text).unwrap_err();
/// assert_eq!(hgm::material::toml_text::line_of(&error, text), 2);
/// ```
pub fn line_of(error: &toml::de::Error, text: &str) -> usize {
    let before = error.span().map_or("", |span| text.get(..span.start).unwrap_or(""));
    1 + before.matches('\n').count()
}
