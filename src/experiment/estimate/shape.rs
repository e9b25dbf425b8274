//! How far a body's shape may be off, and what that does to its displacement.
//!
//! A brain that slides on the skull has nothing but its outline to lean on: labels wider by about a millimetre made grey matter a
//! fifth stiffer and white matter an eighth softer. A falx that stands two millimetres beside where it is taken to be holds one
//! hemisphere back and lets the other go. One that ends three millimetres higher makes grey matter a tenth stiffer and white
//! matter a tenth softer, a base that ends three millimetres lower makes grey matter a fifth stiffer. A segmentation is good to
//! about half a millimetre, the falx between two hemispheres that touch is hardly seen, and where either support ends is an
//! atlas's word, so all are estimated along with the moduli: by one amount everywhere, and by amounts that change from end to
//! end. What they do is found on a coarse mesh of the body, moved so far and solved again (docs/evidence/estimate.md).

use super::body::{Body, Observation};
use super::falx_place::Sheet;
use super::mesh_error::at_places;
use super::outline::Surface;
use super::support_edge::SupportEdge;
use super::unknown::Unknown;
use super::{LogPrior, Scale};
use crate::fem::Scenario;
use crate::mesh::TetMesh;
use crate::tag::BASE;
use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;

/// Where an amount is counted: everywhere the same, or what changes along an axis of the frame.
const WAYS: [&str; 4] = ["everywhere", "from left to right", "from back to front", "from below to above"];

/// How far the outline is moved out, mm: everywhere, and on top of that at the right, front and upper end.
pub type OutlineAmounts = [f64; 4];

/// How far the falx is moved to the right, mm: everywhere, and on top of that at the front and upper end.
pub type FalxAmounts = [f64; 3];

/// How much farther a support reaches, mm: everywhere, and on top of that at the front end.
pub type EdgeAmounts = [f64; 2];

/// How many steps are tried at most: to either side, halved after both.
const TRIES: i32 = 12;

/// A modulus that is so many times another one moves a body by another amount than what was found of that.
const ANOTHER_BODY: f64 = 1.5;

/// A part of the body that may lie elsewhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// The outline, outwards.
    Outline,
    /// The falx, to the right: it has no width from left to right.
    Falx,
    /// The free edge of the falx, along the falx.
    FalxEdge,
    /// Where the skull's base ends to hold, along the surface.
    BaseEdge,
}

impl Part {
    const ALL: [Self; 4] = [Self::Outline, Self::Falx, Self::FalxEdge, Self::BaseEdge];

    /// Everywhere, and along which axes.
    fn axes(self) -> &'static [Option<usize>] {
        match self {
            Self::Outline => &[None, Some(0), Some(1), Some(2)],
            Self::Falx => &[None, Some(1), Some(2)],
            Self::FalxEdge | Self::BaseEdge => &[None, Some(1)],
        }
    }
}

/// A part of the body that may lie elsewhere, and how: everywhere, or along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Amount(Part, Option<usize>);

impl Amount {
    fn name(self) -> String {
        let part = match self.0 {
            Part::Outline => "outline of the brain, mm farther out",
            Part::Falx => "falx, mm farther to the right",
            Part::FalxEdge => "free edge of the falx, mm deeper",
            Part::BaseEdge => "edge of the base, mm farther up",
        };
        format!("{part} {}", WAYS[self.1.map_or(0, |axis| axis + 1)])
    }
}

/// A body whose shape is not known exactly.
pub struct Shape<'a> {
    /// A coarse mesh of it, with its supports.
    pub mesh: &'a TetMesh,
    /// Loads, supports, solver.
    pub template: &'a Scenario,
    /// What is estimated of it.
    pub unknowns: &'a [Unknown],
    /// Poisson's ratio of every tissue.
    pub poisson_ratio: f64,
    /// How far it may be off.
    pub error: ShapeError,
}

/// How far a body's shape may be off: standard deviation of every amount, mm; 0 for what is known exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShapeError {
    /// Of the outline.
    pub outline_mm: f64,
    /// Of the falx, sideways.
    pub falx_mm: f64,
    /// Of the edges of falx and base, where the base holds it.
    pub support_edges_mm: f64,
}

/// What was found of it, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShapeFound {
    /// Of the outline, where it was looked for.
    pub outline: Option<OutlineAmounts>,
    /// Of the falx, where it was looked for.
    pub falx: Option<FalxAmounts>,
    /// Of the falx's free edge, where it was looked for.
    pub falx_edge: Option<EdgeAmounts>,
    /// Of the base's edge, where it was looked for.
    pub base_edge: Option<EdgeAmounts>,
    /// How many amounts of these nobody knows the effect of: the coarse body has no equilibrium with them.
    pub unsolved: usize,
}

/// Displacement of places for each of the amounts that are looked for.
pub struct ShapeColumns {
    /// How many amounts are not among them: the body has no equilibrium, however little they move it.
    unsolved: usize,
    amounts: Vec<Amount>,
    sd_mm: Vec<f64>,
    /// The body's parameters that this was found at.
    at: Vec<f64>,
    /// Three rows a place, a column an amount: per mm of it.
    pub columns_mm: DMatrix<f64>,
}

impl ShapeColumns {
    /// Whether a body of these parameters is another one than this was found for. A body half as stiff moves twice as far, and so
    /// does what its shape makes of that.
    pub fn is_of_another_body(&self, parameters: &[f64], are_moduli: &[bool]) -> bool {
        let apart = self.at.iter().zip(parameters).zip(are_moduli);
        apart.into_iter().any(|((at, now), is)| *is && (now - at).abs() > ANOTHER_BODY.ln())
    }

    /// Whether it is of the same amounts.
    pub fn of_same_amounts(&self, other: &Self) -> bool {
        self.amounts == other.amounts
    }

    /// How many amounts nobody knows the effect of.
    pub fn unsolved(&self) -> usize {
        self.unsolved
    }

    /// What the amounts make of the logarithm of a pattern's size, one standard deviation.
    pub fn log_sd_of_size(&self, pattern_mm: &DVector<f64>) -> f64 {
        let square = pattern_mm.norm_squared();
        let columns = self.columns_mm.column_iter().zip(&self.sd_mm);
        columns.map(|(column, sd)| (pattern_mm.dot(&column) / square * sd).powi(2)).sum::<f64>().sqrt()
    }

    /// What is known of the amounts beforehand, in mm.
    pub fn priors(&self) -> impl Iterator<Item = LogPrior> {
        self.amounts.iter().zip(&self.sd_mm).map(|(amount, sd)| LogPrior {
            name: amount.name(),
            mean: 0.0,
            sd: Some(*sd),
            scale: Scale::Plain,
            correlation: Vec::new(),
            average: None,
        })
    }

    /// The amounts that came out, by what they are of.
    pub fn found(&self, amounts_mm: &[f64]) -> ShapeFound {
        let at = |amount: Amount| self.amounts.iter().position(|a| *a == amount).map(|n| amounts_mm[n]);
        let of = |part: Part| -> Vec<f64> {
            let found: Vec<Option<f64>> = part.axes().iter().map(|axis| at(Amount(part, *axis))).collect();
            let looked_for = found.iter().any(Option::is_some);
            found.into_iter().filter(|_| looked_for).map(Option::unwrap_or_default).collect()
        };
        ShapeFound {
            unsolved: self.unsolved,
            outline: of(Part::Outline).try_into().ok(),
            falx: of(Part::Falx).try_into().ok(),
            falx_edge: of(Part::FalxEdge).try_into().ok(),
            base_edge: of(Part::BaseEdge).try_into().ok(),
        }
    }
}

/// The parts of a body that may lie elsewhere, where it has them.
struct Parts {
    surface: Option<Surface>,
    sheet: Option<Sheet>,
    falx_edge: Option<SupportEdge>,
    base_edge: Option<SupportEdge>,
}

impl Parts {
    /// What may be off of them.
    fn amounts(&self) -> Vec<Amount> {
        let there = |part: &Part| match part {
            Part::Outline => self.surface.is_some(),
            Part::Falx => self.sheet.is_some(),
            Part::FalxEdge => self.falx_edge.is_some(),
            Part::BaseEdge => self.base_edge.is_some(),
        };
        let parts = Part::ALL.into_iter().filter(there);
        parts.flat_map(|part| part.axes().iter().map(move |axis| Amount(part, *axis))).collect()
    }
}

impl Shape<'_> {
    fn parts(&self) -> Parts {
        let ShapeError { outline_mm, falx_mm, support_edges_mm } = self.error;
        // On a brain that slides they told nothing (docs/evidence/estimate.md).
        let edges = support_edges_mm > 0.0 && self.template.fixed.iter().any(|set| set == BASE);
        Parts {
            surface: (outline_mm > 0.0).then(|| Surface::new(self.mesh)).flatten(),
            sheet: (falx_mm > 0.0).then(|| Sheet::new(self.mesh)).flatten(),
            falx_edge: edges.then(|| SupportEdge::of_falx(self.mesh)).flatten(),
            base_edge: edges.then(|| SupportEdge::of_base(self.mesh)).flatten(),
        }
    }

    /// How many amounts may be off.
    pub fn amounts(&self) -> usize {
        self.parts().amounts().len()
    }

    /// What the amounts do to the places at these parameters; `None` where nothing may be off. Amounts with which the body has no
    /// equilibrium are left out, and counted.
    pub fn columns(&self, parameters: &[f64], places_mm: &[[f64; 3]]) -> Option<ShapeColumns> {
        let at = |mesh: &TetMesh| -> Option<Vec<[f64; 3]>> {
            let nothing = Observation::Nodes(Vec::new());
            let mut body = Body::new(mesh, self.template, self.unknowns.to_vec(), self.poisson_ratio, nothing).ok()?;
            let found = body.equilibrium(parameters).ok()?;
            Some(at_places(mesh, &found.displacement_mm, places_mm))
        };
        let ShapeError { outline_mm, falx_mm, support_edges_mm } = self.error;
        let parts = self.parts();
        let amounts = parts.amounts();
        if amounts.is_empty() {
            return None;
        }
        let ends = ends(self.mesh);
        let share = |axis: Option<usize>, x: Vector3<f64>| {
            // All of it everywhere, or from -1 to 1 along an axis.
            axis.map_or(1.0, |axis| 2.0 * (x[axis] - ends[axis][0]) / (ends[axis][1] - ends[axis][0]) - 1.0)
        };
        let moved = |Amount(part, axis): Amount, step_mm: f64| {
            let by_mm = |x| step_mm * share(axis, x);
            match part {
                Part::Outline => parts.surface.as_ref()?.moved(self.mesh, by_mm),
                Part::Falx => parts.sheet.as_ref()?.moved(self.mesh, by_mm),
                Part::FalxEdge => parts.falx_edge.as_ref()?.moved(self.mesh, by_mm),
                Part::BaseEdge => parts.base_edge.as_ref()?.moved(self.mesh, by_mm),
            }
        };
        let sd_of = |amount: &Amount| match amount.0 {
            Part::Outline => outline_mm,
            Part::Falx => falx_mm,
            Part::FalxEdge | Part::BaseEdge => support_edges_mm,
        };
        // By one standard deviation, to the other side or by less where the mesh or the equilibrium does not bear it.
        let moved_by = |amount: &Amount| {
            (0..TRIES).find_map(|n| {
                let step_mm = sd_of(amount) * 0.5f64.powi(n / 2) * if n % 2 == 0 { 1.0 } else { -1.0 };
                Some((at(&moved(*amount, step_mm)?)?, step_mm))
            })
        };
        let (still, moved) = rayon::join(
            || at(self.mesh),
            || amounts.par_iter().map(|amount| Some((*amount, moved_by(amount)?))).collect::<Vec<_>>(),
        );
        let (all, at) = (amounts.len(), parameters.to_vec());
        let Some(still) = still else {
            let columns_mm = DMatrix::zeros(3 * places_mm.len(), 0);
            return Some(ShapeColumns { unsolved: all, amounts: Vec::new(), sd_mm: Vec::new(), at, columns_mm });
        };
        let (amounts, found): (Vec<Amount>, Vec<_>) = moved.into_iter().flatten().unzip();
        let columns_mm = DMatrix::from_fn(3 * places_mm.len(), amounts.len(), |row, k| {
            let (there, step_mm) = &found[k];
            (there[row / 3][row % 3] - still[row / 3][row % 3]) / step_mm
        });
        let unsolved = all - amounts.len();
        Some(ShapeColumns { unsolved, sd_mm: amounts.iter().map(sd_of).collect(), amounts, at, columns_mm })
    }
}

/// Where a mesh begins and ends along every axis, mm.
fn ends(mesh: &TetMesh) -> [[f64; 2]; 3] {
    [0, 1, 2].map(|a| {
        let along = mesh.nodes_mm().iter().map(|x| x[a]);
        along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::{PhantomSettings, block};
    use crate::experiment::sample::Tissue;
    use crate::tag;

    /// A block that hangs on a sheet in its middle and on nothing else: a place in either half, and what its shape does to them.
    fn hung(error: ShapeError) -> (Vec<[f64; 3]>, Option<ShapeColumns>) {
        held(&[tag::FALX], 0.0, error)
    }

    /// The same by a solver that stops before it has found an equilibrium.
    fn unsolved(error: ShapeError) -> Option<ShapeColumns> {
        of(&[tag::FALX], 0.0, error, 1).1
    }

    /// The same held by these sets; the sheet ends so far above its base, which holds in front alone.
    fn held(by: &[&str], sheet_ends_mm: f64, error: ShapeError) -> (Vec<[f64; 3]>, Option<ShapeColumns>) {
        of(by, sheet_ends_mm, error, 50)
    }

    /// The same with no more Newton iterations than these.
    fn of(
        by: &[&str],
        sheet_ends_mm: f64,
        error: ShapeError,
        iterations: usize,
    ) -> (Vec<[f64; 3]>, Option<ShapeColumns>) {
        let mut mesh = block(6);
        let at = |n: &u32| mesh.nodes_mm()[*n as usize];
        let in_sheet = |n: &u32| (at(n)[0] - 30.0).abs() < 1e-9 && at(n)[2] > sheet_ends_mm - 1e-9;
        let sheet: Vec<u32> = (0..mesh.nodes_mm().len() as u32).filter(in_sheet).collect();
        let front: Vec<u32> = mesh.node_sets[BASE].iter().copied().filter(|n| at(n)[1] < 10.0 + 1e-9).collect();
        for (set, nodes) in [(tag::FALX, sheet), (BASE, front)] {
            let in_set = |facet: &[u32; 3]| facet.iter().all(|n| nodes.contains(n));
            let facets = mesh.facets().into_iter().map(|(facet, ..)| facet).filter(in_set).collect();
            mesh.facet_sets.insert(set.to_owned(), facets);
            mesh.node_sets.insert(set.to_owned(), nodes);
        }
        let settings = PhantomSettings {
            tissues: 2,
            two_tissue_force_n: [0.0, 0.0, -0.02],
            fixed: by.iter().map(|set| (*set).to_owned()).collect(),
            ..PhantomSettings::default()
        };
        let unknowns: Vec<Unknown> = Tissue::grey_and_white().into_iter().map(Unknown::ShearModulus).collect();
        let mut template = settings.scenario();
        (template.solver.newton_iterations, template.solver.smallest_load_step) = (iterations, 1.0);
        let shape = Shape { mesh: &mesh, template: &template, unknowns: &unknowns, poisson_ratio: 0.45, error };
        let places = vec![[10.0, 30.0, 30.0], [50.0, 30.0, 30.0]];
        let found = shape.columns(&[1370f64.ln(), 990f64.ln()], &places);
        (places, found)
    }

    #[test]
    fn a_falx_farther_to_the_right_lets_the_left_go_and_holds_the_right() {
        let (places, found) = hung(ShapeError { falx_mm: 1.0, ..ShapeError::default() });
        let found = found.unwrap();
        assert_eq!(found.columns_mm.shape(), (3 * places.len(), 3));
        // Pushed down: farther down is more.
        let down = |place: usize, amount: usize| -found.columns_mm[(3 * place + 2, amount)];
        assert!(down(0, 0) > 0.001 && down(1, 0) < -0.001, "{}", found.columns_mm);
        // Mirrored halves answer alike, and half-way from end to end nothing is moved.
        assert!((down(0, 0) + down(1, 0)).abs() < 0.3 * down(0, 0), "{}", found.columns_mm);
        assert!(down(0, 1).abs() < 0.3 * down(0, 0), "{}", found.columns_mm);
        let amounts = found.found(&[0.4, -0.1, 0.2]);
        assert_eq!(amounts, ShapeFound { falx: Some([0.4, -0.1, 0.2]), ..ShapeFound::default() });
    }

    #[test]
    fn what_is_known_exactly_has_no_amounts_and_what_is_not_has_each_with_its_own_spread() {
        assert!(hung(ShapeError::default()).1.is_none());
        let both = hung(ShapeError { outline_mm: 0.5, falx_mm: 1.0, support_edges_mm: 0.0 }).1.unwrap();
        let sd: Vec<f64> = both.priors().map(|prior| prior.sd.unwrap()).collect();
        assert_eq!(sd, [0.5, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0]);
        let found = both.found(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        assert_eq!((found.outline, found.falx), (Some([1.0, 2.0, 3.0, 4.0]), Some([5.0, 6.0, 7.0])));
    }

    #[test]
    fn amounts_without_an_equilibrium_are_counted_and_leave_the_others() {
        let mut both = hung(ShapeError { outline_mm: 0.5, falx_mm: 1.0, support_edges_mm: 0.0 }).1.unwrap();
        assert_eq!(both.found(&[1.0; 7]).unsolved, 0);
        // The outline's second amount has none.
        (both.unsolved, both.columns_mm) = (1, both.columns_mm.remove_column(1));
        both.amounts.remove(1);
        both.sd_mm.remove(1);
        let found = both.found(&[1.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        assert_eq!((found.outline, found.falx), (Some([1.0, 0.0, 3.0, 4.0]), Some([5.0, 6.0, 7.0])));
        assert_eq!(found.unsolved, 1);
    }

    #[test]
    fn what_the_shape_does_is_of_another_body_from_half_as_stiff_again_on_whatever_else_has_changed() {
        let found = hung(ShapeError { falx_mm: 1.0, ..ShapeError::default() }).1.unwrap();
        let apart = |grey: f64, other: f64, are_moduli: [bool; 2]| {
            found.is_of_another_body(&[(1370.0 * grey).ln(), (990.0 * other).ln()], &are_moduli)
        };
        assert!(!apart(1.4, 0.7, [true, true]) && !apart(1.0, 5.0, [true, false]));
        assert!(apart(1.6, 1.0, [true, true]) && apart(1.0, 0.6, [true, true]));
    }

    #[test]
    fn amounts_that_nobody_knows_of_add_in_the_square_to_what_is_not_known_of_a_size() {
        let mut found = hung(ShapeError { falx_mm: 2.0, ..ShapeError::default() }).1.unwrap();
        let pattern = DVector::from_vec(vec![0.0, 0.1, -0.4, 0.0, 0.2, -0.3]);
        // Per mm a twentieth more of it, a tenth less, and nothing that is like it.
        let across = DVector::from_vec(vec![7.0, 0.0, 0.0, 3.0, 0.0, 0.0]);
        found.columns_mm = DMatrix::from_columns(&[&pattern * 0.05, &pattern * -0.1, across]);
        assert!((found.log_sd_of_size(&pattern) - 0.1f64.hypot(0.2)).abs() < 1e-12);
    }

    #[test]
    fn a_body_that_cannot_be_solved_leaves_every_amount_of_its_shape_unsolved() {
        let found = unsolved(ShapeError { outline_mm: 0.5, ..ShapeError::default() }).unwrap();
        assert_eq!((found.unsolved, found.columns_mm.ncols()), (4, 0));
        assert_eq!(found.found(&[]), ShapeFound { unsolved: 4, ..ShapeFound::default() });
    }

    #[test]
    fn supports_that_reach_farther_hold_more_and_are_looked_for_where_the_base_holds() {
        let error = ShapeError { support_edges_mm: 2.0, ..ShapeError::default() };
        let (places, found) = held(&[BASE, tag::FALX], 30.0, error);
        let found = found.unwrap();
        // Pushed down, both places go less far beside a sheet that ends lower, and with a base that reaches farther back.
        for place in 0..places.len() {
            let up = |amount: usize| found.columns_mm[(3 * place + 2, amount)];
            assert!(up(0) > 5e-5 && up(2) > 5e-5, "{}", found.columns_mm);
        }
        let amounts = found.found(&[1.0, 2.0, 3.0, 4.0]);
        let wanted = ShapeFound { falx_edge: Some([1.0, 2.0]), base_edge: Some([3.0, 4.0]), ..ShapeFound::default() };
        assert_eq!(amounts, wanted);
        assert!(held(&[tag::FALX], 30.0, error).1.is_none());
    }
}
