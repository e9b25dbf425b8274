//! What a wall's soft layer stores per area, as a function of the gap: twice differentiable.

/// A penalty that sets in smoothly.
///
/// With e = w/2 - g the pressure is k e^2 / 2w within the layer (0 < e < w) and k (e - w/2) = -k g beyond it: the
/// pressure and its slope are continuous, nothing is pressed further than half of w before the wall, and behind the
/// layer the depth is pressure over k.
#[derive(Clone, Copy, Debug)]
pub(super) struct Potential {
    /// k, Pa/m.
    pub stiffness: f64,
    /// w, m.
    pub softness_m: f64,
}

impl Potential {
    /// So many times softer and thicker: the same pressure, that much further before and behind the wall.
    pub(super) fn softer(&self, times: f64) -> Self {
        Self { stiffness: self.stiffness / times, softness_m: self.softness_m * times }
    }

    /// Energy (J/m2), pressure (Pa) and stiffness (Pa/m) at a gap (m).
    pub(super) fn at(&self, gap_m: f64) -> [f64; 3] {
        let (k, w) = (self.stiffness, self.softness_m);
        let e = 0.5 * w - gap_m;
        if e <= 0.0 {
            [0.0; 3]
        } else if e < w {
            [k * e * e * e / (6.0 * w), 0.5 * k * e * e / w, k * e / w]
        } else {
            let depth = -gap_m;
            [k * (0.5 * depth * depth + w * w / 24.0), k * depth, k]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pressure_is_the_slope_of_the_energy_and_stiffness_that_of_the_pressure() {
        let potential = Potential { stiffness: 4e7, softness_m: 1e-4 };
        let step = 1e-9;
        for gap in [-3e-4, -5e-5, -4.99e-5, 0.0, 3e-5, 5e-5, 6e-5] {
            let [[e1, p1, _], [e0, p0, _]] = [potential.at(gap + step), potential.at(gap - step)];
            let [_, pressure, stiffness] = potential.at(gap);
            assert!(((e0 - e1) / (2.0 * step) - pressure).abs() < 1e-3 * (1.0 + pressure), "{gap}");
            // At the two ends of the layer the stiffness has a kink, no jump.
            assert!(((p0 - p1) / (2.0 * step) - stiffness).abs() < 1e-4 * 4e7, "{gap}");
        }
    }

    #[test]
    fn behind_the_layer_depth_is_pressure_over_stiffness() {
        let potential = Potential { stiffness: 4e7, softness_m: 1e-4 };
        assert!((potential.at(-1e-4)[1] - 4000.0).abs() < 1e-9);
        assert_eq!(potential.at(5.01e-5), [0.0; 3]);
    }
}
