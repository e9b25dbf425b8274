//! How every node answers to the unknowns: a surface through a few equilibria and their sensitivities.
//!
//! A linear-elastic body moves in proportion to load over stiffness; a large shift less, and one that the skull ends hardly
//! any more. So the displacement is u = C w with C, the load over a mean stiffness, and w smooth and almost constant: a
//! polynomial (a polynomial chaos fitted to values and slopes; Xiu, "Numerical Methods for Stochastic Computations", 2010)
//! in s = ln C, in each tissue's share of the compliance, and in what else is not known. Gravity that turns pulls less the
//! old way (a part of C) and some across it. So a linear body is followed exactly where its tissues' compliances add up.

use super::uncertain::Uncertainty;
use crate::experiment::estimate::Unknown;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// A solved state with its slopes.
#[derive(Clone, Debug)]
pub struct SolvedState {
    /// The unknowns' numbers.
    pub at: Vec<f64>,
    /// Displacement of every node, mm.
    pub displacement_mm: Vec<[f64; 3]>,
    /// How it changes with each number, mm per unit.
    pub slopes_mm: Vec<Vec<[f64; 3]>>,
}

/// What a number is to the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// ln(modulus) of a tissue with its share of the compliance.
    Modulus(f64),
    /// ln(density).
    Density,
    /// ln(room): the room itself counts.
    Room,
    /// A turn of gravity, radians, about one of two axes across it.
    Turn,
    /// Anything else, by itself; the second power as well where states lie to both sides.
    Other { curved: bool },
}

/// How many states lie off the centre in a coordinate, and so which powers of it count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bend {
    /// None: slopes alone.
    Straight,
    /// One.
    Once,
    /// To both sides.
    Both,
}

/// The coordinates of the surface.
#[derive(Clone, Debug)]
pub struct Coordinates {
    centre: Vec<f64>,
    sd: Vec<f64>,
    kinds: Vec<Kind>,
    /// Standard deviation of ln C.
    log_sd: f64,
}

/// Highest power of ln C: three values and slopes fix six.
const POWERS: usize = 4;
/// Where states lie, in standard deviations of ln C from the centre. The outer nodes of Gauss and Hermite's rule of three.
const ALONG_LOAD: f64 = 1.732_050_807_568_877_2;
/// Beyond this turn the part across gravity is no small one any more, radians.
const LARGEST_TURN: f64 = 1.2;
/// The same along an unknown whose second power counts.
const ALONG_CURVED: f64 = 1.3;

impl Coordinates {
    /// Coordinates around the state in the middle of the prior, which tells each tissue's share.
    pub fn new(uncertainty: &Uncertainty, centre: &SolvedState) -> Self {
        let dot = |a: &[[f64; 3]], b: &[[f64; 3]]| -> f64 {
            a.iter().zip(b).map(|(a, b)| (0..3).map(|i| a[i] * b[i]).sum::<f64>()).sum()
        };
        let share = |n: usize| (-dot(&centre.slopes_mm[n], &centre.displacement_mm)).max(0.0);
        let moduli: Vec<usize> = (0..uncertainty.list.len())
            .filter(|&n| matches!(uncertainty.list[n].unknown, Unknown::ShearModulus(_)))
            .collect();
        let all: f64 = moduli.iter().map(|&n| share(n)).sum();
        let kind = |n: usize| match &uncertainty.list[n].unknown {
            Unknown::ShearModulus(_) if all > 0.0 => Kind::Modulus(share(n) / all),
            Unknown::ShearModulus(_) => Kind::Modulus(1.0 / moduli.len() as f64),
            Unknown::Density => Kind::Density,
            Unknown::Gap(_) => Kind::Room,
            Unknown::CsfLevel => Kind::Other { curved: true },
            Unknown::GravityTurn(_) => Kind::Turn,
            Unknown::Shape(..) | Unknown::Pressure(_) => Kind::Other { curved: false },
        };
        let kinds: Vec<Kind> = (0..uncertainty.list.len()).map(kind).collect();
        let sd = uncertainty.sds();
        let variance: f64 = kinds
            .iter()
            .zip(&sd)
            .map(|(kind, sd)| match kind {
                Kind::Modulus(share) => (share * sd).powi(2),
                Kind::Density => sd * sd,
                Kind::Room | Kind::Turn | Kind::Other { .. } => 0.0,
            })
            .sum();
        Self { centre: uncertainty.centre(), sd, kinds, log_sd: variance.sqrt().max(1e-9) }
    }

    /// Where states are needed besides the centre: softer and stiffer, tissues apart, and to both sides of what is curved. Only moduli are
    /// changed for the load over stiffness: a body of half the stiffness moves like one of twice the weight.
    pub fn design(&self) -> Vec<Vec<f64>> {
        let mut points = Vec::new();
        for side in [1.0, -1.0] {
            let mut point = self.centre.clone();
            for (x, kind) in point.iter_mut().zip(&self.kinds) {
                if matches!(kind, Kind::Modulus(_)) {
                    *x -= side * ALONG_LOAD * self.log_sd;
                }
            }
            points.push(point);
        }
        // Each tissue but the first softer, the first stiffer.
        let moduli: Vec<usize> = (0..self.kinds.len()).filter(|&n| matches!(self.kinds[n], Kind::Modulus(_))).collect();
        for &n in moduli.iter().skip(1) {
            let mut point = self.centre.clone();
            point[moduli[0]] += ALONG_CURVED * self.sd[moduli[0]];
            point[n] -= ALONG_CURVED * self.sd[n];
            points.push(point);
        }
        for n in (0..self.kinds.len()).filter(|&n| self.is_curved(n)) {
            for side in [1.0, -1.0] {
                let mut point = self.centre.clone();
                point[n] += side * ALONG_CURVED * self.sd[n];
                points.push(point);
            }
        }
        points
    }

    fn is_curved(&self, n: usize) -> bool {
        matches!(self.kinds[n], Kind::Room | Kind::Other { curved: true })
    }

    /// By how much gravity has turned, radians.
    fn turned(&self, point: &[f64]) -> f64 {
        let turns = point.iter().zip(&self.kinds).filter(|(_, kind)| **kind == Kind::Turn);
        turns.map(|(x, _)| x * x).sum::<f64>().sqrt().min(LARGEST_TURN)
    }

    /// C at a point.
    fn compliance(&self, point: &[f64]) -> f64 {
        let (mut soft, mut load) = (0.0, self.turned(point).cos());
        for ((x, centre), kind) in point.iter().zip(&self.centre).zip(&self.kinds) {
            match kind {
                Kind::Modulus(share) => soft += share * (centre - x).exp(),
                Kind::Density => load *= (x - centre).exp(),
                Kind::Room | Kind::Turn | Kind::Other { .. } => {}
            }
        }
        soft * load
    }

    /// C times every term of the polynomial, at a point.
    fn features(&self, point: &[f64]) -> Vec<f64> {
        let (compliance, turned) = (self.compliance(point), self.turned(point));
        // The part of gravity across its old way for each radian, over the part along it.
        let across = if turned > 0.0 { turned.tan() / turned } else { 1.0 };
        let s = compliance.ln() / self.log_sd;
        let soft: f64 = point
            .iter()
            .zip(&self.centre)
            .zip(&self.kinds)
            .map(|((x, centre), kind)| if let Kind::Modulus(share) = kind { share * (centre - x).exp() } else { 0.0 })
            .sum();
        let mut others: Vec<(f64, Bend)> = Vec::new();
        let mut first = true;
        for (n, kind) in self.kinds.iter().enumerate() {
            let away = point[n] - self.centre[n];
            match kind {
                // The shares sum to one: the first says nothing new.
                Kind::Modulus(_) if std::mem::take(&mut first) => {}
                Kind::Modulus(share) => others.push((share * ((-away).exp() / soft - 1.0), Bend::Once)),
                Kind::Density => {}
                Kind::Turn => others.push((across * away / self.sd[n], Bend::Straight)),
                Kind::Room => others.push((away.exp() - 1.0, Bend::Both)),
                Kind::Other { curved: true } => others.push((away / self.sd[n], Bend::Both)),
                Kind::Other { curved: false } => others.push((away / self.sd[n], Bend::Straight)),
            }
        }
        let mut terms: Vec<f64> = (0..=POWERS).map(|p| s.powi(p as i32)).collect();
        for (n, &(y, bend)) in others.iter().enumerate() {
            terms.extend([y, s * y, s * s * y]);
            match bend {
                Bend::Straight => {}
                Bend::Once => terms.push(y * y),
                Bend::Both => terms.extend([y * y, s * y * y]),
            }
            // A state off the centre in either of two tells what they do together.
            let pairs = others[..n].iter().filter(|(_, other)| bend != Bend::Straight || *other != Bend::Straight);
            terms.extend(pairs.map(|(other, _)| y * other));
        }
        terms.into_iter().map(|term| term * compliance).collect()
    }

    /// How the terms change with each number, by central differences: they are smooth formulas, good to ten digits.
    fn slopes(&self, point: &[f64]) -> Vec<Vec<f64>> {
        let slope = |n: usize| {
            let step = 1e-5 * self.sd[n].max(1e-6);
            let at = |side: f64| {
                let mut moved = point.to_vec();
                moved[n] += side * step;
                self.features(&moved)
            };
            at(1.0).iter().zip(at(-1.0)).map(|(a, b)| (a - b) / (2.0 * step)).collect()
        };
        (0..point.len()).map(slope).collect()
    }
}

/// The surface of every node.
#[derive(Clone, Debug)]
pub struct Response {
    coordinates: Coordinates,
    /// Of each term, every node, mm.
    coefficients_mm: Vec<Vec<[f64; 3]>>,
}

impl Response {
    /// The surface nearest to values and slopes of all states, each by its own size.
    pub fn fitted(coordinates: Coordinates, states: &[SolvedState]) -> Self {
        let mut rows: Vec<Vec<f64>> = Vec::new();
        // Of which state each row is, of which slope, and by what it is weighed.
        let mut data: Vec<(&[[f64; 3]], f64)> = Vec::new();
        for state in states {
            let weight = 1.0 / coordinates.compliance(&state.at);
            let scaled = |row: Vec<f64>, by: f64| row.into_iter().map(|x| x * by).collect::<Vec<f64>>();
            rows.push(scaled(coordinates.features(&state.at), weight));
            data.push((&state.displacement_mm, weight));
            for (n, row) in coordinates.slopes(&state.at).into_iter().enumerate() {
                let weight = weight * coordinates.sd[n];
                rows.push(scaled(row, weight));
                data.push((&state.slopes_mm[n], weight));
            }
        }
        let terms = rows.first().map_or(0, Vec::len);
        let design = DMatrix::from_fn(rows.len(), terms, |r, c| rows[r][c]);
        let svd = design.svd(true, true);
        let largest = svd.singular_values.iter().copied().fold(0.0, f64::max);
        // What no state says anything of stays 0.
        let inverse = svd.pseudo_inverse(1e-9 * largest).unwrap_or_else(|_| DMatrix::zeros(terms, rows.len()));
        let nodes = states.first().map_or(0, |state| state.displacement_mm.len());
        let coefficient = |term: usize| -> Vec<[f64; 3]> {
            let mut sum = vec![[0.0; 3]; nodes];
            for (r, (values, weight)) in data.iter().enumerate() {
                let by = inverse[(term, r)] * weight;
                for (sum, value) in sum.iter_mut().zip(*values) {
                    (0..3).for_each(|i| sum[i] += by * value[i]);
                }
            }
            sum
        };
        let coefficients_mm = (0..terms).into_par_iter().map(coefficient).collect();
        Self { coordinates, coefficients_mm }
    }

    /// The same for some of the nodes.
    #[must_use]
    pub fn thinned(&self, nodes: &[usize]) -> Self {
        let of = |all: &Vec<[f64; 3]>| nodes.iter().map(|&n| all[n]).collect();
        Self { coordinates: self.coordinates.clone(), coefficients_mm: self.coefficients_mm.iter().map(of).collect() }
    }

    /// Displacement of every node at a point, mm.
    pub fn at(&self, point: &[f64]) -> Vec<[f64; 3]> {
        let mut sum = vec![[0.0; 3]; self.coefficients_mm.first().map_or(0, Vec::len)];
        for (term, coefficients) in self.coordinates.features(point).iter().zip(&self.coefficients_mm) {
            for (sum, c) in sum.iter_mut().zip(coefficients) {
                (0..3).for_each(|i| sum[i] += term * c[i]);
            }
        }
        sum
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::uncertain::tests::of_two_tissues;
    use super::*;

    /// A formula as a body: nodes that grey matter, white matter or both let move, under gravity that turns.
    pub fn linear_body(point: &[f64]) -> Vec<[f64; 3]> {
        let load = point[2].exp();
        let (grey, white) = (load * (-point[0]).exp(), load * (-point[1]).exp());
        let turn = point[3].hypot(point[4]).max(1e-12);
        let across = turn.sin() / turn;
        let node = |a: f64, b: f64| {
            let size = a * grey + b * white;
            [2.0 * size * point[3] * across, size * turn.cos(), 0.5 * size * point[4] * across]
        };
        vec![node(40.0, 0.0), node(0.0, 25.0), node(10.0, 10.0)]
    }

    pub fn solved(body: &dyn Fn(&[f64]) -> Vec<[f64; 3]>, at: &[f64]) -> SolvedState {
        let slope = |n: usize| {
            let shifted = |by: f64| {
                let mut point = at.to_vec();
                point[n] += by;
                body(&point)
            };
            let both = shifted(1e-5).into_iter().zip(shifted(-1e-5));
            both.map(|(a, b)| [0, 1, 2].map(|i| (a[i] - b[i]) / 2e-5)).collect()
        };
        SolvedState { at: at.to_vec(), displacement_mm: body(at), slopes_mm: (0..at.len()).map(slope).collect() }
    }

    pub fn response(body: &dyn Fn(&[f64]) -> Vec<[f64; 3]>, uncertainty: &Uncertainty) -> Response {
        let centre = solved(body, &uncertainty.centre());
        let coordinates = Coordinates::new(uncertainty, &centre);
        let mut states = vec![centre];
        states.extend(coordinates.design().iter().map(|at| solved(body, at)));
        Response::fitted(coordinates, &states)
    }

    fn worst(body: &dyn Fn(&[f64]) -> Vec<[f64; 3]>, sd: f64) -> f64 {
        let uncertainty = of_two_tissues(sd);
        let surface = response(body, &uncertainty);
        let off = |n: usize| {
            let point = uncertainty.draw(n);
            let (found, truth) = (surface.at(&point), body(&point));
            let square = |u: &[f64; 3]| u.iter().map(|x| x * x).sum::<f64>();
            let errors =
                found.iter().zip(&truth).map(|(f, t)| (square(&[0, 1, 2].map(|i| f[i] - t[i])) / square(t)).sqrt());
            errors.fold(0.0, f64::max)
        };
        (0..64).map(off).fold(0.0, f64::max)
    }

    #[test]
    fn a_linear_body_is_followed_exactly_however_large_the_spread() {
        assert!(worst(&linear_body, 1.0) < 1e-6, "{}", worst(&linear_body, 1.0));
    }

    #[test]
    fn a_body_that_a_wall_ends_is_followed_and_exactly_so_in_the_limit_of_a_small_spread() {
        let ended = |point: &[f64]| -> Vec<[f64; 3]> {
            let softly = |u: [f64; 3]| {
                let size = u.iter().map(|x| x * x).sum::<f64>().sqrt();
                u.map(|x| x / (1.0 + size / 10.0))
            };
            linear_body(point).into_iter().map(softly).collect()
        };
        let [large, half, quarter] = [1.0, 0.5, 0.25].map(|sd| worst(&ended, sd));
        assert!(large < 0.25, "{large}");
        assert!(half < large / 3.0 && quarter < half / 3.0, "{large} {half} {quarter}");
    }
}
