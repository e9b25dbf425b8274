//! Rules that settings must keep, so that a slip is refused by name before anything is computed.

use crate::tag::SETS;
use thiserror::Error;

/// A setting out of its range.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("`{name}` is {value}: it must be {rule}")]
pub struct SettingError {
    /// The setting, as the settings file calls it.
    pub name: &'static str,
    /// What it is.
    pub value: String,
    /// What it must be.
    pub rule: &'static str,
}

/// One rule: the setting's name and value, whether the rule holds, and the rule in words.
pub(super) type Rule<'a> = (&'static str, &'a dyn std::fmt::Debug, bool, &'static str);

/// The first rule that does not hold.
pub(super) fn first_broken(rules: &[Rule<'_>]) -> Result<(), SettingError> {
    match rules.iter().find(|(_, _, holds, _)| !holds) {
        None => Ok(()),
        Some((name, value, _, rule)) => Err(SettingError { name, value: format!("{value:?}"), rule }),
    }
}

/// Levels of the prior: as far as a Gaussian's tail means anything.
pub(super) fn levels_hold(levels: &[f64]) -> bool {
    !levels.is_empty() && levels.iter().all(|level| (-6.0..=6.0).contains(level))
}

/// Boundary sets that meshes of ours can have.
pub(super) fn sets_hold(names: &[String]) -> bool {
    names.iter().all(|name| SETS.contains(&name.as_str()))
}

pub(super) const SETS_RULE: &str = "of the sets base, falx, ventricle, superior, margin, tentorium";
pub(super) const LEVELS_RULE: &str = "a list of one or more numbers of standard deviations from -6 to 6";
pub(super) const TISSUES_RULE: &str = "1 (the whole brain) or 2 (grey and white matter)";
pub(super) const POISSON_RULE: &str = "at least 0 and below 0.5";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_of_sets_names_every_set() {
        assert!(SETS.iter().all(|set| SETS_RULE.contains(set)));
    }
}
