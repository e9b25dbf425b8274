//! How every node answers to the unknowns: a surface through a few equilibria and their sensitivities.
//!
//! A linear-elastic body moves in proportion to C, the load over its stiffness. Before a wall there is one more length, the
//! room: such a body's u / C is the same wherever C over the room is (u of a linear body with room r under load C is r times
//! that of room 1 under C / r). So u = C v, and v hangs mostly on t = ln C - ln room: it is a cubic spline in t through values
//! and slopes of states along a path from little load to much. What else is not known has the slopes of those states, and where
//! states lie off the path a second power (docs/evidence/prediction.md). C is made of the tissues' moduli by their shares of the
//! compliance, in logarithms. Gravity that turns pulls less the old way and some across it: v is multiplied by the cosine of
//! the turn and has slopes in its sine, as a linear body has exactly.

use super::path::{BESIDE, Kind, Path};
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
    /// How it changes with each number, mm per unit; empty where that was not asked.
    pub slopes_mm: Vec<Vec<[f64; 3]>>,
}

/// The coordinates of the surface.
#[derive(Clone, Debug)]
pub struct Coordinates {
    path: Path,
    centre: Vec<f64>,
    sd: Vec<f64>,
    kinds: Vec<Kind>,
}

/// A state beside the path.
#[derive(Clone, Debug, PartialEq)]
pub struct Beside {
    /// The unknowns' numbers.
    pub at: Vec<f64>,
    /// Slopes of which numbers count there.
    pub slopes: Vec<bool>,
}

impl Coordinates {
    /// Coordinates around the state in the middle of the prior, which tells each tissue's share.
    pub fn new(uncertainty: &Uncertainty, path: Path, centre: &SolvedState) -> Self {
        let dot = |a: &[[f64; 3]], b: &[[f64; 3]]| -> f64 {
            a.iter().zip(b).map(|(a, b)| (0..3).map(|i| a[i] * b[i]).sum::<f64>()).sum()
        };
        let share = |n: usize| (-dot(&centre.slopes_mm[n], &centre.displacement_mm)).max(0.0);
        let moduli: Vec<usize> = (0..uncertainty.list.len())
            .filter(|&n| matches!(uncertainty.list[n].unknown, Unknown::ShearModulus(_)))
            .collect();
        let all: f64 = moduli.iter().map(|&n| share(n)).sum();
        let equal = 1.0 / moduli.len().max(1) as f64;
        let part = |n: usize| if all > 0.0 && moduli.contains(&n) { share(n) / all } else { equal };
        let kinds = uncertainty.list.iter().enumerate().map(|(n, u)| Kind::of(&u.unknown, part(n))).collect();
        Self { path, centre: uncertainty.centre(), sd: uncertainty.sds(), kinds }
    }

    /// Where states are needed besides the path: to both sides of what is curved, before walls of gravity's direction as well
    /// (there the slopes by the direction alone, unless there is a fluid), without them with the tissues apart.
    pub fn beside(&self) -> Vec<Beside> {
        let mut points = Vec::new();
        let mut add = |changes: &[(usize, f64)], slopes: Vec<bool>| {
            let mut at = self.centre.clone();
            for &(n, by) in changes {
                at[n] += by * BESIDE * self.sd[n];
            }
            points.push(Beside { at, slopes });
        };
        let all = vec![true; self.kinds.len()];
        let moduli: Vec<usize> = (0..self.kinds.len()).filter(|&n| matches!(self.kinds[n], Kind::Modulus(_))).collect();
        // Each tissue but the first softer, the first stiffer.
        for &n in moduli.iter().skip(1).filter(|_| self.path.tissues_bend()) {
            add(&[(moduli[0], 1.0), (n, -1.0)], all.clone());
        }
        for n in (0..self.kinds.len()).filter(|&n| self.path.bends(self.kinds[n])) {
            let turns = || self.kinds.iter().map(|kind| *kind == Kind::Turn).collect();
            let slopes = if self.kinds[n] == Kind::Turn && !self.path.fluid { turns() } else { all.clone() };
            for side in [1.0, -1.0] {
                add(&[(n, side)], slopes.clone());
            }
        }
        points
    }

    /// ln C at a point.
    fn log_compliance(&self, point: &[f64]) -> f64 {
        let mut sum = 0.0;
        for ((x, centre), kind) in point.iter().zip(&self.centre).zip(&self.kinds) {
            match kind {
                Kind::Modulus(share) => sum += share * (centre - x),
                Kind::Density => sum += x - centre,
                Kind::Room | Kind::Turn | Kind::Other { .. } => {}
            }
        }
        sum
    }

    /// C times every term of the polynomial, at a point.
    fn features(&self, point: &[f64]) -> Vec<f64> {
        let away = |n: usize| point[n] - self.centre[n];
        let of = |kind: Kind| (0..self.kinds.len()).filter(move |&n| self.kinds[n] == kind);
        let log_compliance = self.log_compliance(point);
        let log_room: f64 = of(Kind::Room).map(away).sum();
        let t = log_compliance - log_room;
        let turned = of(Kind::Turn).map(|n| away(n).powi(2)).sum::<f64>().sqrt();
        let sine = if turned > 0.0 { turned.sin() / turned } else { 1.0 };
        let soft: f64 = (0..self.kinds.len())
            .map(|n| if let Kind::Modulus(share) = self.kinds[n] { -share * away(n) } else { 0.0 })
            .sum();
        // What hangs on t only by slopes, and whether it bends.
        let mut others: Vec<(f64, bool)> = Vec::new();
        let mut first = true;
        for (n, kind) in self.kinds.iter().enumerate() {
            match kind {
                // The shares sum to one: the first says nothing new.
                Kind::Modulus(_) if std::mem::take(&mut first) => {}
                Kind::Modulus(_) => others.push((-away(n) - soft, self.path.tissues_bend())),
                Kind::Density => {}
                Kind::Turn => others.push((sine * away(n) / self.sd[n], self.path.bends(*kind))),
                // Off the path: on it the room is less where the load is more.
                Kind::Room => others.push((away(n) + (1.0 - self.path.of_load) * t, false)),
                Kind::Other { .. } => others.push((away(n) / self.sd[n], self.path.bends(*kind))),
            }
        }
        let (values, slopes) = self.path.hermite(t);
        let mut terms: Vec<f64> = values.into_iter().chain(slopes).map(|x| x * turned.cos()).collect();
        let cardinal = self.path.cardinal(t);
        for (n, &(y, bends)) in others.iter().enumerate() {
            terms.extend(cardinal.iter().map(|x| y * x));
            if bends {
                terms.push(y * y);
            }
            // A state off the path in either of two tells what they do together.
            terms.extend(others[..n].iter().filter(|(_, other)| bends || *other).map(|(other, _)| y * other));
        }
        let compliance = log_compliance.exp();
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
            let weight = (-coordinates.log_compliance(&state.at)).exp();
            let scaled = |row: Vec<f64>, by: f64| row.into_iter().map(|x| x * by).collect::<Vec<f64>>();
            rows.push(scaled(coordinates.features(&state.at), weight));
            data.push((&state.displacement_mm, weight));
            let known = |n: &usize| !state.slopes_mm[*n].is_empty();
            for (n, row) in coordinates.slopes(&state.at).into_iter().enumerate().filter(|(n, _)| known(n)) {
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

    /// Load over stiffness at a point, of that in the middle of the prior.
    pub fn load_at(&self, point: &[f64]) -> f64 {
        self.coordinates.log_compliance(point).exp()
    }

    /// Displacement of every node at a point, mm.
    pub fn at(&self, point: &[f64]) -> Vec<[f64; 3]> {
        let mut sum = vec![[0.0; 3]; self.coefficients_mm.first().map_or(0, Vec::len)];
        // Most knots are far away.
        let terms = self.coordinates.features(point).into_iter().zip(&self.coefficients_mm);
        for (term, coefficients) in terms.filter(|(term, _)| *term != 0.0) {
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
    use super::super::uncertain::{Cause, Reading, Uncertain};
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

    /// The state with the slopes that count beside the path.
    fn partly(mut state: SolvedState, beside: &Beside) -> SolvedState {
        let slopes = state.slopes_mm.iter_mut().zip(&beside.slopes);
        slopes.filter(|(_, counts)| !**counts).for_each(|(slope, _)| slope.clear());
        state
    }

    pub fn response(body: &dyn Fn(&[f64]) -> Vec<[f64; 3]>, uncertainty: &Uncertainty) -> Response {
        before(false, body, uncertainty)
    }

    /// The surface of a body before walls, or of one without.
    fn before(walls: bool, body: &dyn Fn(&[f64]) -> Vec<[f64; 3]>, uncertainty: &Uncertainty) -> Response {
        let path = Path::new(uncertainty, walls);
        let mut states: Vec<SolvedState> = path.points(uncertainty).iter().map(|at| solved(body, at)).collect();
        let middle = path.middle();
        let number = path.beside(uncertainty);
        let coordinates = Coordinates::new(uncertainty, path, &states[middle]);
        assert_eq!(coordinates.beside().len(), number);
        states.extend(coordinates.beside().iter().map(|beside| partly(solved(body, &beside.at), beside)));
        Response::fitted(coordinates, &states)
    }

    fn worst(body: &dyn Fn(&[f64]) -> Vec<[f64; 3]>, sd: f64) -> f64 {
        worst_of(false, body, &of_two_tissues(sd))
    }

    fn worst_of(walls: bool, body: &dyn Fn(&[f64]) -> Vec<[f64; 3]>, uncertainty: &Uncertainty) -> f64 {
        let surface = before(walls, body, uncertainty);
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
    fn a_linear_body_is_followed_exactly_but_for_its_tissues_however_large_the_spread() {
        // Load, direction and all stiffness together; of tissues apart the surface has the second power.
        let together = |point: &[f64]| {
            let mean = 0.5 * (point[0] + point[1]);
            linear_body(&[&[mean, mean], &point[2..]].concat())
        };
        assert!(worst(&together, 1.0) < 1e-6, "{}", worst(&together, 1.0));
        let [large, half] = [1.0, 0.5].map(|sd| worst(&linear_body, sd));
        assert!(large < 0.2 && half < large / 5.0, "{large} {half}");
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

    #[test]
    fn before_a_wall_load_and_room_in_proportion_move_a_linear_body_in_proportion() {
        let of_spread = |sd: f64| {
            let unknown = Unknown::Gap(0);
            let prior = unknown.prior(0.0, 0.5 * sd);
            let room = Uncertain { unknown, prior, cause: Cause::Room, reading: Reading::Itself };
            Uncertainty::new(of_two_tissues(sd).list.into_iter().chain([room]).collect())
        };
        let uncertainty = of_spread(1.0);
        // Each node goes as far as its load, and ever less beyond its room.
        let walled = |point: &[f64]| -> Vec<[f64; 3]> {
            let room = point[5].exp();
            let mean = 0.5 * (point[0] + point[1]);
            let node = |part: f64| {
                let x = part * (point[2] - mean).exp() * 10.0 / room;
                [0.0, room * (x.powi(-2) + 1.0).powf(-0.5), 0.0]
            };
            [0.5, 1.0, 2.0].map(node).into()
        };
        let surface = before(true, &walled, &uncertainty);
        let [load, room] = [2, 5].map(|n| uncertainty.sds()[n]);
        let of = |by: f64, load_over_room: f64| {
            let mut point = uncertainty.centre();
            (point[2], point[5]) = (point[2] + by + load_over_room, point[5] + by);
            surface.at(&point)[1][1]
        };
        for over in [-load, 0.0, load] {
            let grown = of(room, over) / of(0.0, over);
            assert!((grown / room.exp() - 1.0).abs() < 2e-3, "{over} {grown}");
        }
        // The worst draws lie beyond the ends of the path, where the surface goes straight on.
        let [large, half] = [1.0, 0.5].map(|sd| worst_of(true, &walled, &of_spread(sd)));
        assert!(large < 0.12 && half < large / 3.0, "{large} {half}");
    }
}
