//! One bar of an issue: what was asked, what was measured.

/// A named bar with its measured figure.
#[allow(clippy::struct_field_names, reason = "the word of the issues")]
pub struct Bar {
    /// Short name, starting with the room.
    pub name: String,
    /// What was asked, in words.
    pub bar: String,
    /// What was measured, in words, with units.
    pub measured: String,
    /// Whether the measurement meets the bar.
    pub met: bool,
}

impl Bar {
    /// A bar with its measurement.
    pub fn new(name: &str, bar: &str, measured: impl Into<String>, met: bool) -> Self {
        Self { name: name.to_owned(), bar: bar.to_owned(), measured: measured.into(), met }
    }
}

/// The folder with measuring data (`HGM_BENCH_DATA`), or `None`, in which case the caller says what it skips.
pub fn data() -> Option<std::path::PathBuf> {
    std::env::var_os("HGM_BENCH_DATA").map(Into::into)
}
