//! The states that a surface goes through: a path from stiff and light to soft and heavy, and the functions along it.

use super::uncertain::Uncertainty;
use crate::experiment::estimate::Unknown;

/// What a number is to the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// ln(modulus) of a tissue with its share of the compliance.
    Modulus(f64),
    /// ln(density).
    Density,
    /// ln(room).
    Room,
    /// A turn of gravity, radians, about one of two axes across it.
    Turn,
    /// Anything else, by itself; the second power as well where states lie to both sides.
    Other { curved: bool },
}

impl Kind {
    pub(super) fn of(unknown: &Unknown, share: f64) -> Self {
        match unknown {
            Unknown::ShearModulus(_) => Self::Modulus(share),
            Unknown::Density => Self::Density,
            Unknown::Gap(_) => Self::Room,
            Unknown::CsfLevel | Unknown::Drained(_) | Unknown::PoissonRatio => Self::Other { curved: true },
            Unknown::GravityTurn(_) => Self::Turn,
            Unknown::Shape(..) | Unknown::Pressure(_) => Self::Other { curved: false },
        }
    }
}

/// The states that a surface begins with, from stiff and light to soft and heavy; the middle one is that of the prior.
#[derive(Clone, Debug)]
pub struct Path {
    /// t of every state.
    knots: Vec<f64>,
    /// How much of t is ln C; the rest is less room.
    pub(super) of_load: f64,
    /// There are walls.
    walls: bool,
    /// There is a fluid whose surface turns with gravity.
    pub(super) fluid: bool,
}

/// Standard deviations of t from the centre at which the states of a body without walls lie: the outer nodes of Gauss and
/// Hermite's rule of three.
const FREE: [f64; 3] = [-1.732_050_807_568_877_2, 0.0, 1.732_050_807_568_877_2];
/// Before walls, which a body comes to rest on little by little.
const WALLED: [f64; 5] = [-2.0, -1.0, 0.0, 1.0, 2.0];
/// How far from the path states lie that tell second powers, in standard deviations.
pub(super) const BESIDE: f64 = 1.4;

impl Path {
    /// The path through the prior of a body, before walls or not.
    pub fn new(uncertainty: &Uncertainty, walls: bool) -> Self {
        let moduli = uncertainty.list.iter().filter(|u| matches!(u.unknown, Unknown::ShearModulus(_))).count();
        // Shares of the compliance are not known before a state is.
        let of_kind = |load: f64, room: f64| -> f64 {
            let weight = |unknown: &Unknown| match Kind::of(unknown, 1.0 / moduli.max(1) as f64) {
                Kind::Modulus(share) => -load * share,
                Kind::Density => load,
                Kind::Room => room,
                Kind::Turn | Kind::Other { .. } => 0.0,
            };
            uncertainty.variance(&uncertainty.list.iter().map(|u| weight(&u.unknown)).collect::<Vec<_>>())
        };
        let (load, room) = (of_kind(1.0, 0.0), of_kind(0.0, 1.0));
        let spread = load + room;
        let places: &[f64] = match walls {
            _ if spread == 0.0 => &[0.0],
            true => &WALLED,
            false => &FREE,
        };
        let of_load = if spread > 0.0 { load / spread } else { 1.0 };
        Self { knots: places.iter().map(|place| place * spread.sqrt()).collect(), of_load, walls, fluid: false }
    }

    /// The same for a body in fluid, or in none.
    #[must_use]
    pub fn in_fluid(self, fluid: bool) -> Self {
        Self { fluid, ..self }
    }

    /// Its points in the order of t. For the load over stiffness only moduli are changed, where they are not known: a body of
    /// half the stiffness moves like one of twice the weight.
    pub fn points(&self, uncertainty: &Uncertainty) -> Vec<Vec<f64>> {
        let stiffness = uncertainty.list.iter().any(|u| matches!(u.unknown, Unknown::ShearModulus(_)));
        let at = |t: &f64| {
            let mut point = uncertainty.centre();
            for (x, u) in point.iter_mut().zip(&uncertainty.list) {
                match u.unknown {
                    Unknown::ShearModulus(_) => *x -= self.of_load * t,
                    Unknown::Density if !stiffness => *x += self.of_load * t,
                    Unknown::Gap(_) => *x -= (1.0 - self.of_load) * t,
                    _ => {}
                }
            }
            point
        };
        self.knots.iter().map(at).collect()
    }

    /// Ends it before one of its states.
    pub fn end_before(&mut self, state: usize) {
        self.knots.truncate(state);
    }

    /// How many states lie beside it ([`super::Coordinates::beside`]).
    pub fn beside(&self, uncertainty: &Uncertainty) -> usize {
        let kinds: Vec<Kind> = uncertainty.list.iter().map(|u| Kind::of(&u.unknown, 1.0)).collect();
        let tissues = kinds.iter().filter(|kind| matches!(kind, Kind::Modulus(_))).count().saturating_sub(1);
        let apart = if self.tissues_bend() { tissues } else { 0 };
        apart + 2 * kinds.iter().filter(|kind| self.bends(**kind)).count()
    }

    /// States lie to both sides in such a number.
    pub(super) fn bends(&self, kind: Kind) -> bool {
        match kind {
            // Weight alone turns exactly as the surface has it.
            Kind::Turn => self.walls || self.fluid,
            Kind::Other { curved } => curved,
            Kind::Modulus(_) | Kind::Density | Kind::Room => false,
        }
    }

    /// A state lies off the path in the tissues' ratio. Before walls that changed nothing.
    pub(super) fn tissues_bend(&self) -> bool {
        !self.walls
    }

    /// The number of the state in the middle of the prior.
    pub fn middle(&self) -> usize {
        self.knots.len() / 2
    }

    /// The functions that are 1 at one knot or have slope 1 there (Hermite's cubics, straight on beyond the ends): values,
    /// then slopes.
    pub(super) fn hermite(&self, t: f64) -> (Vec<f64>, Vec<f64>) {
        let knots = &self.knots;
        let (mut values, mut slopes) = (vec![0.0; knots.len()], vec![0.0; knots.len()]);
        let last = knots.len() - 1;
        if t <= knots[0] || t >= knots[last] {
            let end = if t <= knots[0] { 0 } else { last };
            (values[end], slopes[end]) = (1.0, t - knots[end]);
            return (values, slopes);
        }
        let k = knots.partition_point(|knot| *knot <= t) - 1;
        let step = knots[k + 1] - knots[k];
        let x = (t - knots[k]) / step;
        let (x2, x3) = (x * x, x * x * x);
        (values[k], values[k + 1]) = (2.0 * x3 - 3.0 * x2 + 1.0, 3.0 * x2 - 2.0 * x3);
        (slopes[k], slopes[k + 1]) = ((x3 - 2.0 * x2 + x) * step, (x3 - x2) * step);
        (values, slopes)
    }

    /// The functions that are 1 at one knot and 0 at the others, smooth (Catmull and Rom's) and the same beyond the ends.
    pub(super) fn cardinal(&self, t: f64) -> Vec<f64> {
        let last = self.knots.len() - 1;
        let (mut values, slopes) = self.hermite(t.clamp(self.knots[0], self.knots[last]));
        for (k, slope) in slopes.into_iter().enumerate() {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
            if after > before {
                let by = slope / (self.knots[after] - self.knots[before]);
                values[after] += by;
                values[before] -= by;
            }
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::super::uncertain::tests::of_two_tissues;
    use super::*;

    #[test]
    fn functions_along_a_path_follow_a_cubic_between_knots_and_a_line_beyond() {
        let path = Path::new(&of_two_tissues(1.0), true);
        let (cubic, slope) = (|t: f64| 1.0 + t - 2.0 * t.powi(3), |t: f64| 1.0 - 6.0 * t * t);
        let at = |t: f64| -> f64 {
            let (values, slopes) = path.hermite(t);
            let of = path.knots.iter().zip(values).zip(slopes);
            of.map(|((knot, value), by)| value * cubic(*knot) + by * slope(*knot)).sum()
        };
        let last = path.knots[path.knots.len() - 1];
        for t in [-0.9 * last, -0.2, 0.0, 0.61 * last, last] {
            assert!((at(t) - cubic(t)).abs() < 1e-12, "{t}");
        }
        assert!((at(last + 0.5) - cubic(last) - 0.5 * slope(last)).abs() < 1e-12);
        for (n, knot) in path.knots.iter().enumerate() {
            let there = path.cardinal(*knot);
            assert!(there.iter().enumerate().all(|(k, x)| (x - f64::from(u8::from(k == n))).abs() < 1e-12));
        }
        // A line is followed too, and what lies beyond the ends is what is there.
        let line = |t: f64| -> f64 { path.cardinal(t).iter().zip(&path.knots).map(|(x, knot)| x * knot).sum() };
        assert!((line(0.3) - 0.3).abs() < 1e-12 && (line(last + 1.0) - last).abs() < 1e-12);
    }
}
