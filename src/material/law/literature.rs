//! The published models of brain tissue as they are: the energy of one row of the literature table in three dimensions.

use super::curve::UniaxialCurve;
use super::definition::{Card, Estimated, Law, LawParameter, Range, Role, Values, Volume};
use super::hyperelastic::Hyperelastic;
use super::stability::{Stability, StabilityRange};
use crate::material::form::{Form, Jet, Number, Solid, StretchEnergy};
use crate::material::literature::{Branches, table};
use crate::material::task::stretches;
use std::sync::OnceLock;

/// The law for files and sensitivities. It is not fitted: its numbers are those of its paper.
///
/// `id` is the model's number in the table (`hgm gp studies` lists them). Where a paper fitted compression and tension
/// apart there is no published law that joins the two, and `53-compression` and `53-tension` are the two it has.
///
/// Energies of isochoric stretches get K/2 ln^2 J with K = lambda + 2/3 mu, the volume term of the other laws in their
/// small-strain limit. The scenario's Poisson's ratio rules the change of volume of every model, also of those with a
/// term of their own: published ratios and bulk moduli lie between 0.05 and 0.495, and 2.38 Pa.
pub struct Definition;

impl Law for Definition {
    fn card(&self) -> &'static Card {
        &Card {
            name: "literature",
            formula: "the model's energy of the principal stretches, with K/2 ln^2 J where it is isochoric",
            source: "the model's own, see the literature table",
            parameters: &[
                LawParameter {
                    name: "id",
                    meaning: "literature model",
                    role: Role::Word(ids),
                    range: Range::ANY,
                    default: None,
                },
                LawParameter {
                    name: "scale",
                    meaning: "factor on all stresses; 1: as published",
                    role: Role::Modulus,
                    range: Range::POSITIVE,
                    default: Some(1.0),
                },
            ],
            of_terms: false,
            shear_modulus: "the model's at rest times `scale`",
            continued: false,
        }
    }

    fn shear_modulus_pa(&self, values: &[f64]) -> f64 {
        values[1] * published(values[0]).form.small_strain_shear_modulus_pa()
    }

    fn solid(&self, values: &[f64], volume: Volume) -> Box<dyn Hyperelastic> {
        let form = published(values[0]).form.clone();
        Box::new(Solid { form: InSpace { form, scale: values[1], lame_lambda_pa: volume.lame_lambda_pa } })
    }

    fn curves(&self) -> &'static [&'static dyn UniaxialCurve] {
        &[]
    }

    fn measured(&self, values: &[f64]) -> Option<([f64; 2], Stability)> {
        let Published { form, window, .. } = published(values[0]);
        Some((*window, scan(form, *window)))
    }

    fn estimated(&self) -> Estimated {
        Estimated::Not
    }

    fn examples(&self) -> Vec<Values> {
        (0..all().len()).map(|n| vec![n as f64, 1.0]).collect()
    }
}

/// One set of published parameters.
struct Published {
    form: Form,
    /// Stretches it was measured at.
    window: [f64; 2],
}

/// All sets and their ids, in the order of the table.
fn sets() -> &'static (Vec<String>, Vec<Published>) {
    static SETS: OnceLock<(Vec<String>, Vec<Published>)> = OnceLock::new();
    SETS.get_or_init(|| {
        let (mut ids, mut all) = (Vec::new(), Vec::new());
        for model in table() {
            let [low, high] = model.stretch_window;
            let mut add = |id: String, form: Form, window: [f64; 2]| {
                ids.push(id);
                all.push(Published { form, window });
            };
            match model.branches {
                Branches::One(form) => add(model.id.to_string(), form, [low, high]),
                Branches::Split { compression, tension } => {
                    add(format!("{}-compression", model.id), compression, [low, 1.0]);
                    add(format!("{}-tension", model.id), tension, [1.0, high]);
                }
            }
        }
        (ids, all)
    })
}

fn ids() -> &'static [String] {
    &sets().0
}

fn all() -> &'static [Published] {
    &sets().1
}

/// The set of a place in the list of ids; places come from there, the last one stands for what lies beyond.
fn published(place: f64) -> &'static Published {
    &all()[(place as usize).min(all().len() - 1)]
}

/// Points of the scan over a window.
const SCANNED: usize = 401;

/// The three statements at points of the window; where the derivatives are no number they do not hold.
fn scan(form: &Form, [low, high]: [f64; 2]) -> Stability {
    let mut holds = [true; 3];
    let scale = form.small_strain_shear_modulus_pa().abs();
    for l in stretches(low, high, SCANNED) {
        let Jet { gradient: [slope, ..], hessian: [[bend, ..], ..], .. } = form.uniaxial_energy_pa(Jet::variable(l, 0));
        // At rest the slope of forms with large coefficients is rounding.
        holds[0] &= (l - 1.0) * slope >= -1e-9 * scale;
        holds[1] &= bend > 0.0;
        holds[2] &= slope + l * bend > 0.0;
    }
    let [energy_grows, convex, true_stress_rises] = holds.map(|h| StabilityRange::of(false, h));
    Stability { energy_grows, convex, true_stress_rises }
}

/// A form in three dimensions whose change of volume is ruled by lambda.
struct InSpace {
    form: Form,
    scale: f64,
    lame_lambda_pa: f64,
}

impl StretchEnergy for InSpace {
    fn uniaxial_energy_pa<N: Number>(&self, stretch: N) -> N {
        self.form.uniaxial_energy_pa(stretch) * self.scale
    }

    fn energy_pa<N: Number>(&self, stretches: [N; 3]) -> N {
        self.form.energy_with_lambda_pa(stretches, self.lame_lambda_pa / self.scale) * self.scale
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        self.form.small_strain_shear_modulus_pa() * self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::law::volume::lame_lambda_pa;
    use nalgebra::{Matrix3, Vector3};

    fn law(id: &str, scale: f64) -> Box<dyn Hyperelastic> {
        law_with_ratio(id, scale, 0.45)
    }

    fn law_with_ratio(id: &str, scale: f64, poisson_ratio: f64) -> Box<dyn Hyperelastic> {
        let place = ids().iter().position(|known| known == id).unwrap();
        let values = [place as f64, scale];
        let lame_lambda_pa = lame_lambda_pa(Definition.shear_modulus_pa(&values), poisson_ratio);
        Definition.solid(&values, Volume { lame_lambda_pa, inversion_threshold: 0.0 })
    }

    #[test]
    fn every_row_of_the_table_has_its_solids() {
        let halves = table().iter().filter(|m| matches!(m.branches, Branches::Split { .. })).count();
        assert_eq!((table().len(), halves, ids().len()), (73, 20, 93));
    }

    #[test]
    fn an_isochoric_stretch_costs_what_the_paper_says() {
        for model in table() {
            let compared = match &model.branches {
                Branches::One(form) => vec![(model.id.to_string(), form)],
                Branches::Split { compression, tension } => {
                    vec![(format!("{}-compression", model.id), compression), (format!("{}-tension", model.id), tension)]
                }
            };
            for (id, form) in compared {
                for l in [0.97, 1.02] {
                    let side = 1.0 / f64::sqrt(l);
                    let h = Matrix3::from_diagonal(&Vector3::new(l - 1.0, side - 1.0, side - 1.0));
                    // Hooke's law sees the trace of the strain on this path, under the paper's own Poisson's ratio.
                    let nu = if let Form::Linear(hooke) = form { hooke.poisson_ratio } else { 0.45 };
                    let solid = law_with_ratio(&id, 2.0, nu).energy_density_pa(&h);
                    let curve = 2.0 * form.uniaxial_energy_pa(l);
                    assert!((solid - curve).abs() <= 1e-8 * curve, "{id} at {l}: {solid} {curve}");
                }
            }
        }
    }

    #[test]
    fn an_energy_is_a_number_or_infinite_at_any_deformation() {
        for id in ids() {
            let law = law(id, 1.0);
            for (a, b, c) in
                [(1e-3, 1.0, 1.0), (5.0, 0.2, 1.0), (40.0, 40.0, 40.0), (1e-3, 1e-3, 1e-3), (-1.0, 1.0, 1.0)]
            {
                let h = Matrix3::from_diagonal(&Vector3::new(a - 1.0, b - 1.0, c - 1.0));
                assert!(!law.energy_density_pa(&h).is_nan(), "{id} at {a} {b} {c}");
            }
        }
    }

    #[test]
    fn verdicts_name_the_models_that_are_not_stable_where_they_were_measured() {
        let unstable = |n: &usize| {
            let (_, s) = Definition.measured(&[*n as f64, 1.0]).unwrap();
            [s.energy_grows, s.convex, s.true_stress_rises].contains(&StabilityRange::Nowhere)
        };
        let found: Vec<&str> = (0..ids().len()).filter(unstable).map(|n| ids()[n].as_str()).collect();
        // As an independent scan of the table finds.
        assert_eq!(found, ["45", "46", "47", "48", "49"]);
    }
}
