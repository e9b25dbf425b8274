//! Where a law is stable on the uniaxial isochoric path.

use serde::Serialize;

/// Over which stretches a statement holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum StabilityRange {
    /// Every stretch above zero.
    Everywhere,
    /// The fitted window at least, but not every stretch.
    Window,
    /// Not even the fitted window.
    Nowhere,
}

impl StabilityRange {
    /// From what holds at every stretch and what holds in the window.
    pub fn of(everywhere: bool, window: bool) -> Self {
        match (everywhere, window) {
            (true, _) => Self::Everywhere,
            (false, true) => Self::Window,
            (false, false) => Self::Nowhere,
        }
    }
}

/// Verdicts, from the analytic regions of a law or from a scan of its window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Stability {
    /// Energy grows away from rest: (l - 1) W' >= 0.
    pub energy_grows: StabilityRange,
    /// The reduced energy is convex: W'' > 0, nominal stress rises with stretch.
    pub convex: StabilityRange,
    /// True stress rises with stretch: d(l W')/dl > 0.
    pub true_stress_rises: StabilityRange,
}

impl Stability {
    /// One verdict for all three.
    pub fn all(range: StabilityRange) -> Self {
        Self { energy_grows: range, convex: range, true_stress_rises: range }
    }

    /// What does not even hold in the window, in words.
    pub fn broken(&self) -> Vec<&'static str> {
        let statements = [
            (self.energy_grows, "the energy does not grow away from rest"),
            (self.convex, "nominal stress does not rise with stretch"),
            (self.true_stress_rises, "true stress does not rise with stretch"),
        ];
        statements.into_iter().filter(|(range, _)| *range == StabilityRange::Nowhere).map(|(_, words)| words).collect()
    }

    /// Whether all three hold at every stretch.
    pub fn everywhere(&self) -> bool {
        [self.energy_grows, self.convex, self.true_stress_rises].iter().all(|r| *r == StabilityRange::Everywhere)
    }
}
