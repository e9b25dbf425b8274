//! The synthetic validation: known moduli go in and must come out.

use super::sample::{Sample, Tissue, TissueSample};
use super::setting::{
    LEVELS_RULE, POISSON_RULE, SETS_RULE, SettingError, TISSUES_RULE, first_broken, levels_hold, sets_hold,
};
use crate::fem::{Loads, PatchLoad, Scenario, SolverSettings};
use crate::material::law::Material;
use crate::tag::SETS;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the phantom is made of and how it is loaded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PhantomSettings {
    /// 1: the whole brain one material; 2: grey and white matter apart.
    pub tissues: usize,
    /// Reference shear modulus of the whole brain, Pa (Granados et al. 2021: 333.28).
    pub brain_shear_modulus_pa: f64,
    /// Reference shear modulus of grey matter, Pa (1370).
    pub grey_matter_shear_modulus_pa: f64,
    /// Reference shear modulus of white matter, Pa (990).
    pub white_matter_shear_modulus_pa: f64,
    /// Poisson's ratio of every tissue.
    pub poisson_ratio: f64,
    /// Total force over the superior patch with one tissue, N. The paper's 10 N over the 42 cm2 patch are 2.4 kPa,
    /// which squeezes a 333 Pa brain by 126 mm: 2 N is what the body can bear.
    pub one_tissue_force_n: [f64; 3],
    /// Total force over the superior patch with two tissues, N (the paper's 10 N).
    pub two_tissue_force_n: [f64; 3],
    /// Levels of the prior that are tried, in standard deviations.
    pub sd_levels: Vec<f64>,
    /// Node sets held still.
    pub fixed: Vec<String>,
    /// The set that is pushed.
    pub loaded_set: String,
    /// Also try the reference's own moduli, as a check that the chain has no leak.
    pub include_reference: bool,
    /// Solver.
    pub solver: SolverSettings,
}

impl Default for PhantomSettings {
    fn default() -> Self {
        Self {
            tissues: 1,
            brain_shear_modulus_pa: 333.28,
            grey_matter_shear_modulus_pa: 1370.0,
            white_matter_shear_modulus_pa: 990.0,
            poisson_ratio: 0.45,
            one_tissue_force_n: [0.0, 0.0, -2.0],
            two_tissue_force_n: [0.0, 0.0, -10.0],
            sd_levels: vec![-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0],
            fixed: vec!["base".to_owned(), "falx".to_owned()],
            loaded_set: "superior".to_owned(),
            include_reference: false,
            solver: SolverSettings::default(),
        }
    }
}

impl PhantomSettings {
    /// A block of two tissues on its base, pushed from above: what estimates are tried on.
    #[cfg(test)]
    pub(crate) fn pushed_from_above() -> Self {
        let (two_tissue_force_n, fixed) = ([0.0, 0.0, -0.1], vec!["base".to_owned()]);
        Self { tissues: 2, two_tissue_force_n, fixed, ..Self::default() }
    }

    /// Refuses what no phantom can be made with.
    ///
    /// # Errors
    /// The first setting out of its range.
    pub fn check(&self) -> Result<(), SettingError> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let finite = |x: &[f64]| x.iter().all(|x| x.is_finite());
        let (brain, grey, white) =
            (self.brain_shear_modulus_pa, self.grey_matter_shear_modulus_pa, self.white_matter_shear_modulus_pa);
        let (one, two) = (self.one_tissue_force_n, self.two_tissue_force_n);
        let pushes =
            |tissues: usize, force: &[f64; 3]| finite(force) && (self.tissues != tissues || *force != [0.0; 3]);
        const FORCE_RULE: &str =
            "three numbers, and not all 0 where it is what pushes: a body at rest tells nothing of its stiffness";
        first_broken(&[
            ("tissues", &self.tissues, (1..=2).contains(&self.tissues), TISSUES_RULE),
            ("brain_shear_modulus_pa", &brain, positive(brain), "above 0"),
            ("grey_matter_shear_modulus_pa", &grey, positive(grey), "above 0"),
            ("white_matter_shear_modulus_pa", &white, positive(white), "above 0"),
            ("poisson_ratio", &self.poisson_ratio, (0.0..0.5).contains(&self.poisson_ratio), POISSON_RULE),
            ("one_tissue_force_n", &one, pushes(1, &one), FORCE_RULE),
            ("two_tissue_force_n", &two, pushes(2, &two), FORCE_RULE),
            ("sd_levels", &self.sd_levels, levels_hold(&self.sd_levels), LEVELS_RULE),
            ("fixed", &self.fixed, sets_hold(&self.fixed), SETS_RULE),
            ("loaded_set", &self.loaded_set, SETS.contains(&self.loaded_set.as_str()), SETS_RULE),
        ])
    }

    /// The tissues varied.
    pub fn tissue_list(&self) -> Vec<Tissue> {
        if self.tissues == 1 { Tissue::whole_brain() } else { Tissue::grey_and_white() }
    }

    /// The force on the patch, N.
    pub fn force_n(&self) -> [f64; 3] {
        if self.tissues == 1 { self.one_tissue_force_n } else { self.two_tissue_force_n }
    }

    /// The scenario without its materials.
    pub fn scenario(&self) -> Scenario {
        let patch = vec![PatchLoad { set: self.loaded_set.clone(), force_n: self.force_n() }];
        Scenario {
            fixed: self.fixed.clone(),
            loads: Loads { patch, ..Loads::default() },
            solver: self.solver.clone(),
            ..Scenario::default()
        }
    }

    /// The material whose simulation is the reference.
    pub fn reference_sample(&self) -> Sample {
        let modulus = |tissue: &Tissue| match tissue.name.as_str() {
            "grey_matter" => self.grey_matter_shear_modulus_pa,
            "white_matter" => self.white_matter_shear_modulus_pa,
            _ => self.brain_shear_modulus_pa,
        };
        let tissues = self.tissue_list();
        let material = |t: &Tissue| (t.name.clone(), neo_hookean(0.0, modulus(t), self.poisson_ratio));
        Sample { id: REFERENCE.to_owned(), tissues: tissues.iter().map(material).collect(), task: None }
    }
}

/// A neo-Hookean tissue sample.
pub fn neo_hookean(sd_level: f64, shear_modulus_pa: f64, poisson_ratio: f64) -> TissueSample {
    let material = Material::neo_hookean(shear_modulus_pa, poisson_ratio);
    TissueSample { sd_level, shear_modulus_pa, material }
}

/// The name of the sample with a phantom's own moduli.
pub const REFERENCE: &str = "reference";

/// The sample whose moduli are nearest to the reference's, by the summed squares of the log-ratios.
pub fn nearest_sample<'a>(samples: &'a [Sample], reference: &Sample) -> Option<&'a Sample> {
    let distance = |s: &Sample| -> f64 {
        let pairs = s.tissues.iter().filter_map(|(name, t)| Some((t, reference.tissues.get(name)?)));
        pairs.map(|(t, r)| (t.shear_modulus_pa / r.shear_modulus_pa).ln().powi(2)).sum()
    };
    samples.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

#[cfg(test)]
pub(super) use tests::block;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::sample::every_combination;
    use crate::experiment::sweep::{Reference, best_sample, solve_sample};
    use crate::mesh::TetMesh;
    use crate::segment::label;

    /// A block of n x n x n cells of 10 mm, grey below and white above, held below and pushed on top.
    pub fn block(n: usize) -> TetMesh {
        let m = n + 1;
        let node = |i: usize, j: usize, k: usize| (i + m * (j + m * k)) as u32;
        let position = |c: usize| [10.0 * (c % m) as f64, 10.0 * (c / m % m) as f64, 10.0 * (c / (m * m)) as f64];
        let nodes: Vec<[f64; 3]> = (0..m * m * m).map(position).collect();
        let (mut tets, mut labels) = (Vec::new(), Vec::new());
        for c in 0..n * n * n {
            let (i, j, k) = (c % n, c / n % n, c / (n * n));
            let corner = |b: usize| node(i + (b & 1), j + (b >> 1 & 1), k + (b >> 2));
            for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
                tets.push([corner(0), corner(a), corner(b), corner(7)]);
                labels.push(if 2 * k < n { label::GREY_MATTER } else { label::WHITE_MATTER });
            }
        }
        let mut mesh = TetMesh::new(nodes, tets, labels).unwrap();
        mesh.set_nodes("base", (0..m * m).map(|n| n as u32).collect()).unwrap();
        mesh.set_nodes("superior", (m * m * n..m * m * m).map(|n| n as u32).collect()).unwrap();
        mesh
    }

    fn settings(tissues: usize) -> PhantomSettings {
        let force = [0.0, 0.0, -0.1];
        PhantomSettings {
            tissues,
            one_tissue_force_n: force,
            two_tissue_force_n: force,
            fixed: vec!["base".to_owned()],
            ..PhantomSettings::default()
        }
    }

    /// The reference's displacement, and the outcomes of the given moduli of the whole brain.
    fn errors_of(settings: &PhantomSettings, samples: &[Sample]) -> Vec<crate::experiment::outcome::SampleOutcome> {
        let (mesh, scenario, tissues) = (block(3), settings.scenario(), settings.tissue_list());
        let rest = Reference::Nodes(vec![[0.0; 3]; mesh.nodes_mm().len()]);
        let solve = |sample: &Sample, reference: &Reference| {
            solve_sample(&mesh, &scenario, &tissues, sample, reference, &|_| {}).unwrap()
        };
        let truth = solve(&settings.reference_sample(), &rest).state.unwrap().0;
        let reference = Reference::Nodes(truth.displacement_mm);
        samples.iter().map(|sample| solve(sample, &reference).record).collect()
    }

    #[test]
    fn the_reference_moduli_explain_the_reference_and_the_nearest_sample_is_best() {
        let settings = settings(1);
        let tissue = Tissue::whole_brain().remove(0);
        let levels = [150.0, 250.0, 360.0, 600.0].map(|mu| neo_hookean(0.0, mu, 0.45)).to_vec();
        let mut samples = every_combination(&[(tissue, levels)]);
        assert_eq!(nearest_sample(&samples, &settings.reference_sample()).unwrap().id, "sample-02");
        samples.push(settings.reference_sample());
        let outcomes = errors_of(&settings, &samples);
        assert!(outcomes[4].rmse_mm["all"] < 1e-6, "the truth leaves no error");
        assert_eq!(best_sample(&outcomes[..4], "all").unwrap().id, "sample-02");
    }

    #[test]
    fn a_phantom_that_nothing_pushes_is_refused() {
        let still = PhantomSettings { one_tissue_force_n: [0.0; 3], ..PhantomSettings::default() };
        assert_eq!(still.check().unwrap_err().name, "one_tissue_force_n");
        assert_eq!(PhantomSettings { tissues: 2, ..still }.check(), Ok(()), "with two tissues the other force pushes");
    }

    #[test]
    fn two_tissues_are_told_apart() {
        let settings = settings(2);
        let of = |mu: [f64; 2]| mu.map(|mu| neo_hookean(0.0, mu, 0.45)).to_vec();
        let [grey, white] = <[Tissue; 2]>::try_from(Tissue::grey_and_white()).unwrap();
        let samples = every_combination(&[(grey, of([1370.0, 990.0])), (white, of([1370.0, 990.0]))]);
        let outcomes = errors_of(&settings, &samples);
        let best = best_sample(&outcomes, "all").unwrap();
        assert_eq!((best.shear_modulus_pa["grey_matter"], best.shear_modulus_pa["white_matter"]), (1370.0, 990.0));
        assert!(best.rmse_mm["all"] < 1e-6);
    }
}
