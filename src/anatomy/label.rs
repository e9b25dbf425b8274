//! The integers of a label map.

/// Outside the brain.
pub const BACKGROUND: u8 = 0;
/// Cerebrospinal fluid outside the ventricles.
pub const CSF: u8 = 1;
/// Grey matter.
pub const GREY_MATTER: u8 = 2;
/// White matter.
pub const WHITE_MATTER: u8 = 3;
/// Lateral and third ventricles.
pub const VENTRICLE: u8 = 4;
/// Resected tissue: a label of its own before meshing, so that the margin is smooth and conforming.
pub const RESECTED: u8 = 5;
/// Tumour: tissue with a modulus of its own.
pub const TUMOUR: u8 = 6;
/// Oedema around a tumour: tissue with a modulus of its own.
pub const OEDEMA: u8 = 7;

/// The name a scenario uses for a label; `None` for an unknown one.
pub fn name(label: u8) -> Option<&'static str> {
    Some(match label {
        CSF => "csf",
        GREY_MATTER => "grey_matter",
        WHITE_MATTER => "white_matter",
        VENTRICLE => "ventricle",
        RESECTED => "resected",
        TUMOUR => "tumour",
        OEDEMA => "oedema",
        _ => return None,
    })
}

/// The label with this name, or with this number in digits.
pub fn number(word: &str) -> Option<u8> {
    word.parse().ok().or_else(|| (0..=u8::MAX).find(|&l| name(l) == Some(word)))
}

/// Whether the label is tissue that carries load: neither fluid nor what was taken out.
pub fn is_tissue(label: u8) -> bool {
    matches!(label, GREY_MATTER | WHITE_MATTER | TUMOUR | OEDEMA)
}
