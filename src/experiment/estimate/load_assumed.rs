//! What an estimate takes of the load as given.

use super::unknown::Unknown;
use crate::experiment::verdict::Reason;
use crate::fem::{Loads, PressureLoad};

/// What of the load is taken as given where the body's weight is a part of it: moduli go with all of it.
pub(super) fn load_assumed(loads: &Loads, unknowns: &[Unknown]) -> Option<Reason> {
    let weighs = loads.gravity_m_per_s2.iter().any(|g| *g != 0.0);
    if !weighs || unknowns.iter().any(|u| matches!(u, Unknown::Density | Unknown::Drained(_))) {
        return None;
    }
    let found = |of: usize| unknowns.iter().any(|u| matches!(u, Unknown::Pressure(n) if *n == of));
    let pressed = |(n, load): (usize, &PressureLoad)| load.pressure_pa != 0.0 && !found(n);
    Some(if !loads.patch.is_empty() || loads.pressure.iter().enumerate().any(pressed) {
        Reason::LoadsAssumed
    } else if loads.csf.is_some() {
        Reason::LevelAssumed
    } else {
        Reason::LoadAssumed
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::CsfLevel;

    #[test]
    fn weight_is_told_beside_whatever_else_is_given_and_not_where_it_is_found() {
        let pressure = |pressure_pa| PressureLoad { set: "ventricle".to_owned(), pressure_pa };
        let of = |pressures: &[f64], unknowns: &[Unknown]| {
            let pressure = pressures.iter().map(|pa| pressure(*pa)).collect();
            load_assumed(&Loads { gravity_m_per_s2: [0.0, 0.0, -9.81], pressure, ..Loads::default() }, unknowns)
        };
        assert_eq!(of(&[], &[]), Some(Reason::LoadAssumed));
        assert_eq!(of(&[0.0], &[]), Some(Reason::LoadAssumed), "a pressure of nothing");
        assert_eq!(of(&[5.0], &[]), Some(Reason::LoadsAssumed));
        assert_eq!(of(&[5.0], &[Unknown::Pressure(0)]), Some(Reason::LoadAssumed), "a pressure that is found");
        assert_eq!(of(&[5.0], &[Unknown::Density]), None);
        assert_eq!(load_assumed(&Loads::default(), &[]), None, "nothing weighs");
        let csf = Some(CsfLevel { density_kg_per_m3: 1000.0, level_mm: 0.0 });
        let wet = Loads { gravity_m_per_s2: [0.0, 0.0, -9.81], csf, ..Loads::default() };
        assert_eq!(load_assumed(&wet, &[]), Some(Reason::LevelAssumed));
    }
}
