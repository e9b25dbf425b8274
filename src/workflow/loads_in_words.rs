//! What loads and holds a patient's brain, in words for the methods paragraph.

use crate::experiment::estimate::Unknown;
use crate::experiment::resection::ResectionSettings;
use crate::fem::Scenario;

/// Loads and supports of the body that these settings pose (gravity in the frame of its mesh, the sets that are held: by its scenario);
/// with each of them that is `open` it is said how it is: `estimated along`.
pub(crate) fn loads_in_words(
    settings: &ResectionSettings,
    scenario: &Scenario,
    (open, how): (&[Unknown], &str),
) -> String {
    let mark = |what: &str, is: &dyn Fn(&Unknown) -> bool| {
        if open.iter().any(is) { format!(" ({what} {how})") } else { String::new() }
    };
    let [gx, gy, gz] = scenario.loads.gravity_m_per_s2;
    let direction = mark("direction", &|unknown| matches!(unknown, Unknown::GravityTurn(_)));
    let density = mark("density", &|unknown| matches!(unknown, Unknown::Density));
    let pressures = settings.pressure.iter().enumerate().map(|(n, load)| {
        let size = mark("size", &|unknown| matches!(unknown, Unknown::Pressure(of) if *of == n));
        format!(" and {} Pa on the {}{size}", to_a_tenth(load.pressure_pa), load.set)
    });
    let room = mark("room before the skull", &|unknown| matches!(unknown, Unknown::Gap(_)));
    let fluid = match &settings.csf {
        None => String::new(),
        Some(_) if open.iter().any(|unknown| matches!(unknown, Unknown::Drained(_))) => {
            format!(", with a part of the fluid drained that was {how}")
        }
        Some(csf) => format!(", {:.0} % of the fluid drained", 100.0 * csf.drained),
    };
    format!(
        "gravity ({gx:.2}, {gy:.2}, {gz:.2}) m/s2{direction} on tissue of {} kg/m3{density}{}, with {} held{}{room}{fluid}",
        to_a_tenth(settings.density_kg_per_m3),
        pressures.collect::<String>(),
        scenario.fixed.join(" and "),
        settings.supports_in_words(),
    )
}

/// A given number may have more digits than anybody reads.
fn to_a_tenth(value: f64) -> f64 {
    (10.0 * value).round() / 10.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::estimate::Turn;
    use crate::experiment::resection::{CsfSettings, Supports};
    use crate::fem::PressureLoad;
    use nalgebra::UnitQuaternion;

    #[test]
    fn every_load_that_is_given_is_told_and_which_of_them_was_estimated() {
        let pressure = [("ventricle", 200.0), ("margin", -50.0)];
        let pressure = pressure.map(|(set, pressure_pa)| PressureLoad { set: set.to_owned(), pressure_pa }).to_vec();
        let given = ResectionSettings { density_kg_per_m3: 191.978_052, ..ResectionSettings::default() };
        let settings = ResectionSettings { pressure, supports: Supports::Fixed, ..given };
        let scenario = settings.scenario(&UnitQuaternion::identity());
        let said = |open: &[Unknown]| loads_in_words(&settings, &scenario, (open, "estimated along"));
        assert_eq!(
            said(&[]),
            "gravity (0.00, 0.00, -9.81) m/s2 on tissue of 192 kg/m3 and 200 Pa on the ventricle and -50 Pa on the margin, with base and \
             falx held"
        );
        let open = [Unknown::Density, Unknown::GravityTurn(Turn::Nodding), Unknown::Pressure(1)];
        assert_eq!(
            said(&open),
            "gravity (0.00, 0.00, -9.81) m/s2 (direction estimated along) on tissue of 192 kg/m3 (density estimated along) and 200 Pa on \
             the ventricle and -50 Pa on the margin (size estimated along), with base and falx held"
        );
    }

    #[test]
    fn a_body_that_slides_in_fluid_is_not_told_to_be_held_at_its_base() {
        let settings = ResectionSettings {
            supports: Supports::Sliding,
            csf: Some(CsfSettings::default()),
            ..ResectionSettings::default()
        };
        let fixed = vec!["falx".to_owned(), "brainstem".to_owned()];
        let scenario = Scenario { fixed, ..settings.scenario(&UnitQuaternion::identity()) };
        let said = loads_in_words(&settings, &scenario, (&[Unknown::Gap(0)], "estimated along"));
        assert!(said.contains("with falx and brainstem held, sliding on a skull") && !said.contains("base"), "{said}");
        assert!(said.ends_with(" (room before the skull estimated along), 30 % of the fluid drained"), "{said}");
    }
}
