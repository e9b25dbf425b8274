//! Where a meta-model is stable on the uniaxial isochoric path.

use super::MetaModel;
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

/// Verdicts, from the analytic regions.
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
    /// Verdict for parameters fitted over a window.
    ///
    /// neo-Hookean: everything holds if and only if mu > 0. Mooney-Rivlin: W'' = 2 l^-4 (c1 g(l) + 3 c2) with
    /// g = l^4 + 2 l rising; W' = 2 (l - l^-2)(c1 + c2 / l); (l W')' = c1 (4 l + 2 l^-2) + c2 (2 + 4 l^-3). Ogden:
    /// W'' = mu l^(-alpha/2 - 2) ((alpha - 1) l^(3 alpha / 2) + alpha / 2 + 1), and the other two hold if and only if
    /// mu alpha > 0.
    pub fn of(model: MetaModel, parameters: &[f64], window: [f64; 2]) -> Self {
        let verdict = |everywhere: bool, window: bool| match (everywhere, window) {
            (true, _) => StabilityRange::Everywhere,
            (false, true) => StabilityRange::Window,
            (false, false) => StabilityRange::Nowhere,
        };
        match model {
            MetaModel::NeoHookean => {
                let all = verdict(parameters[0] > 0.0, false);
                Self { energy_grows: all, convex: all, true_stress_rises: all }
            }
            MetaModel::MooneyRivlin => {
                let (c1, c2) = (parameters[0], parameters[1]);
                let everywhere = c1 >= 0.0 && c2 >= 0.0 && c1 + c2 > 0.0;
                let at_ends = |f: &dyn Fn(f64) -> bool| window.into_iter().all(f);
                let g = |l: f64| l.powi(4) + 2.0 * l;
                // c1 (4 l^4 + 2 l) + c2 (2 l^3 + 4) > 0: the ratio of the two polynomials is monotonic in l.
                let true_stress = |l: f64| c1 * (4.0 * l.powi(4) + 2.0 * l) + c2 * (2.0 * l.powi(3) + 4.0) > 0.0;
                Self {
                    energy_grows: verdict(everywhere, at_ends(&|l| c1 * l + c2 >= 0.0)),
                    convex: verdict(everywhere, at_ends(&|l| c1 * g(l) + 3.0 * c2 > 0.0)),
                    true_stress_rises: verdict(everywhere, at_ends(&true_stress)),
                }
            }
            MetaModel::Ogden | MetaModel::OgdenHigh => {
                let (mu, alpha) = (parameters[0], parameters[1]);
                let sign = verdict(mu * alpha > 0.0, false);
                let everywhere = (mu > 0.0 && alpha >= 1.0) || (mu < 0.0 && alpha <= -2.0);
                // Linear in z = l^(3 alpha / 2), so its sign at both ends decides.
                let bend = |l: f64| mu * ((alpha - 1.0) * l.powf(1.5 * alpha) + 0.5 * alpha + 1.0) > 0.0;
                Self {
                    energy_grows: sign,
                    convex: verdict(everywhere, window.into_iter().all(bend)),
                    true_stress_rises: sign,
                }
            }
        }
    }

    /// Whether all three hold at every stretch.
    pub fn everywhere(&self) -> bool {
        [self.energy_grows, self.convex, self.true_stress_rises].iter().all(|r| *r == StabilityRange::Everywhere)
    }
}
