//! What a parameter is called to a reader.

/// A parameter's name in words, and its unit; `shear_modulus_pa of grey_matter` is "shear modulus of grey matter" in Pa.
pub fn in_words(name: &str) -> (String, &'static str) {
    if let Some(angle) = name.strip_suffix(", degrees") {
        return (angle.to_owned(), "°");
    }
    if let Some(length) = name.strip_suffix(", mm") {
        return (length.to_owned(), "mm");
    }
    let units = [("_kg_per_m3", "kg/m³"), ("_pa", "Pa"), ("_mm", "mm")];
    // A share of two moduli has no unit.
    let unit = units.into_iter().find(|(suffix, _)| !name.starts_with("share") && name.contains(suffix));
    let bare = unit.map_or_else(|| name.to_owned(), |(suffix, _)| name.replacen(suffix, "", 1));
    (bare.replace('_', " "), unit.map_or("", |(_, unit)| unit))
}

/// The same with the unit behind it.
pub fn with_unit(name: &str) -> String {
    let (name, unit) = in_words(name);
    if unit.is_empty() { name } else { format!("{name} ({unit})") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_is_called_as_a_reader_would_with_its_unit() {
        let said = with_unit;
        assert_eq!(said("shear_modulus_pa of grey_matter"), "shear modulus of grey matter (Pa)");
        assert_eq!(said("effective density_kg_per_m3"), "effective density (kg/m³)");
        assert_eq!(said("gap_mm between cortex and skull"), "gap between cortex and skull (mm)");
        assert_eq!(said("turn of gravity across that, degrees"), "turn of gravity across that (°)");
        assert_eq!(said("fluid below the brain's highest point, mm"), "fluid below the brain's highest point (mm)");
        assert_eq!(said("share of c1_pa in c1_pa + c2_pa of brain"), "share of c1 pa in c1 pa + c2 pa of brain");
    }
}
