//! The simulated states of a sweep as one surface that a slider moves: displacements of its nodes, state by state.

use super::colour::{ColourScale, viridis};
use super::decimation::Decimation;
use super::html::number;
use crate::experiment::outcome::{ESTIMATE, ExperimentOutcome, SampleOutcome};
use crate::mesh::TriMesh;
use base64::Engine;

/// Nodes of the surface times states: bounds what the page carries.
const NODE_STATES: usize = 250_000;
/// Nodes that a surface keeps however many states there are.
const NODES_MIN: usize = 1500;
/// Steps of a displacement between nothing and the largest, either way.
const STEPS: f64 = 32_767.0;

/// What a slider moves along: names of the samples are not part of it.
#[derive(Clone, Debug, PartialEq)]
pub struct SweptTissue {
    /// The tissue.
    pub name: String,
    /// Which slider moves it.
    pub axis: usize,
    /// Its shear modulus at every stop of that slider, Pa.
    pub moduli_pa: Vec<f64>,
}

/// Which samples stand where along one or two sliders.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepGrid {
    /// The tissues, each with its slider.
    pub tissues: Vec<SweptTissue>,
    /// Stops of every slider.
    pub stops: Vec<usize>,
    /// Samples' names, the first slider moving fastest.
    pub samples: Vec<String>,
    /// The stops of the best sample.
    pub best: Vec<usize>,
}

impl SweepGrid {
    /// The samples of a sweep that reached an equilibrium: along one slider where all tissues stiffen together, along two
    /// where two tissues form a whole grid. `None` where there are fewer than two stops or the samples form neither.
    pub fn of(outcome: &ExperimentOutcome) -> Option<Self> {
        let best = outcome.best()?;
        let usable = |s: &&SampleOutcome| s.converged && s.task == best.task && s.id != ESTIMATE;
        let samples: Vec<&SampleOutcome> = outcome.samples.iter().filter(usable).collect();
        let modulus = |s: &SampleOutcome, tissue: &String| s.shear_modulus_pa.get(tissue).copied();
        let moduli = |tissue: &String, samples: &[&SampleOutcome]| -> Option<Vec<f64>> {
            samples.iter().map(|s| modulus(s, tissue)).collect()
        };
        let first = outcome.tissues.first()?;
        let mut along = samples.clone();
        moduli(first, &along)?;
        along.sort_by(|a, b| modulus(a, first).unwrap_or(0.0).total_cmp(&modulus(b, first).unwrap_or(0.0)));
        let columns: Vec<Vec<f64>> = outcome.tissues.iter().map(|t| moduli(t, &along)).collect::<Option<_>>()?;
        let stiffer = |column: &Vec<f64>| column.windows(2).all(|pair| pair[0] < pair[1]);
        if along.len() > 1 && columns.iter().all(stiffer) {
            let tissue =
                |(name, moduli_pa): (&String, Vec<f64>)| SweptTissue { name: name.clone(), axis: 0, moduli_pa };
            return Some(Self {
                tissues: outcome.tissues.iter().zip(columns).map(tissue).collect(),
                stops: vec![along.len()],
                best: vec![along.iter().position(|s| s.id == best.id)?],
                samples: along.iter().map(|s| s.id.clone()).collect(),
            });
        }
        let [a, b] = <[String; 2]>::try_from(outcome.tissues.clone()).ok()?;
        let distinct = |tissue: &String| -> Option<Vec<f64>> {
            let mut values = moduli(tissue, &samples)?;
            values.sort_unstable_by(f64::total_cmp);
            values.dedup();
            (values.len() > 1).then_some(values)
        };
        let axes = [distinct(&a)?, distinct(&b)?];
        let at = |x: f64, y: f64| {
            samples.iter().find(|s| modulus(s, &a) == Some(x) && modulus(s, &b) == Some(y)).map(|s| s.id.clone())
        };
        let cells = axes[1].iter().flat_map(|y| axes[0].iter().map(|x| (*x, *y)));
        let samples: Vec<String> = cells.map(|(x, y)| at(x, y)).collect::<Option<_>>()?;
        let place = samples.iter().position(|id| *id == best.id)?;
        let stops: Vec<usize> = axes.iter().map(Vec::len).collect();
        let [x, y] = axes;
        Some(Self {
            tissues: vec![
                SweptTissue { name: a, axis: 0, moduli_pa: x },
                SweptTissue { name: b, axis: 1, moduli_pa: y },
            ],
            best: vec![place % stops[0], place / stops[0]],
            stops,
            samples,
        })
    }

    /// What a slider is called.
    pub fn label(&self, axis: usize) -> String {
        let moved: Vec<String> =
            self.tissues.iter().filter(|t| t.axis == axis).map(|t| t.name.replace('_', " ")).collect();
        format!("Stiffness of {}", moved.join(" and "))
    }
}

/// The surface with its displacement in every state.
#[derive(Clone, Debug, PartialEq)]
pub struct SweptStates {
    /// Where the states stand.
    pub grid: SweepGrid,
    /// Colours of the size of the displacement, over all states.
    pub scale: ColourScale,
    surface: TriMesh,
    /// Per state, the displacement of every node, mm.
    displacement_mm: Vec<Vec<[f64; 3]>>,
}

/// Gathers the states one after the other, so that only one whole mesh is held at a time.
pub struct SweptStatesBuilder {
    grid: SweepGrid,
    decimation: Decimation,
    displacement_mm: Vec<Vec<[f64; 3]>>,
}

impl SweptStatesBuilder {
    /// Begins with the undeformed surface, made small enough for the number of states.
    pub fn new(grid: SweepGrid, undeformed: &TriMesh) -> Self {
        let nodes = (NODE_STATES / grid.samples.len().max(1)).max(NODES_MIN);
        // A closed surface has about twice as many triangles as nodes.
        Self { grid, decimation: Decimation::of(undeformed, 2 * nodes), displacement_mm: Vec::new() }
    }

    /// The next state, in the order of the grid: the displacement of every node of the undeformed surface, mm.
    pub fn push(&mut self, displacement_mm: &[[f64; 3]]) {
        self.displacement_mm.push(self.decimation.means(displacement_mm));
    }

    /// The states; `None` when one is missing.
    pub fn build(self) -> Option<SweptStates> {
        if self.displacement_mm.len() != self.grid.samples.len() {
            return None;
        }
        let sizes = self.displacement_mm.iter().flatten().map(|u| length(*u));
        let scale = ColourScale::to_95(sizes, "displacement (mm)")?;
        let surface = self.decimation.surface;
        Some(SweptStates { grid: self.grid, scale, surface, displacement_mm: self.displacement_mm })
    }
}

fn length([x, y, z]: [f64; 3]) -> f64 {
    x.hypot(y).hypot(z)
}

impl SweptStates {
    /// What the page's script needs; displacements in whole steps of `step_mm`, 16 bits each.
    pub(super) fn json(&self) -> serde_json::Value {
        let base64 = base64::engine::general_purpose::STANDARD;
        let largest = self.displacement_mm.iter().flatten().flatten().fold(0.0, |m: f64, u| m.max(u.abs()));
        let step_mm = if largest > 0.0 { largest / STEPS } else { 1.0 };
        let whole = |u: &f64| ((u / step_mm).round() as i16).to_le_bytes();
        let state = |u: &Vec<[f64; 3]>| base64.encode(u.iter().flatten().flat_map(whole).collect::<Vec<u8>>());
        let positions: Vec<u8> =
            self.surface.nodes_mm.iter().flatten().flat_map(|x| (*x as f32).to_le_bytes()).collect();
        let triangles: Vec<u8> = self.surface.triangles.iter().flatten().flat_map(|n| n.to_le_bytes()).collect();
        let colours: Vec<u8> = (0..=255).flat_map(|n| viridis(f64::from(n) / 255.0)).collect();
        let tissues: Vec<serde_json::Value> = self
            .grid
            .tissues
            .iter()
            .map(|t| {
                let name = t.name.replace('_', " ");
                serde_json::json!({"name": name, "axis": t.axis, "moduli_pa": t.moduli_pa})
            })
            .collect();
        serde_json::json!({
            "positions": base64.encode(positions),
            "triangles": base64.encode(triangles),
            "states": self.displacement_mm.iter().map(state).collect::<Vec<_>>(),
            "step_mm": step_mm,
            "stops": self.grid.stops,
            "samples": self.grid.samples,
            "tissues": tissues,
            "range_mm": [self.scale.low, self.scale.high],
            "colours": base64.encode(colours),
        })
    }

    /// In words, for a slider that stands on a sample.
    pub(super) fn said(&self, stops: &[usize]) -> String {
        let index = stops.first().copied().unwrap_or(0) + stops.get(1).map_or(0, |y| y * self.grid.stops[0]);
        let moduli: Vec<String> = self
            .grid
            .tissues
            .iter()
            .map(|t| format!("{} {} Pa", t.name.replace('_', " "), number(t.moduli_pa[stops[t.axis]], 3)))
            .collect();
        format!("{}: {}, simulated", self.grid.samples[index], moduli.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn sample(n: usize, moduli: &[(&str, f64)]) -> SampleOutcome {
        let shear_modulus_pa: BTreeMap<String, f64> = moduli.iter().map(|(t, m)| ((*t).to_owned(), *m)).collect();
        SampleOutcome { id: format!("sample-{n:02}"), converged: true, shear_modulus_pa, ..SampleOutcome::default() }
    }

    fn outcome(samples: Vec<SampleOutcome>, tissues: &[&str], best: &str) -> ExperimentOutcome {
        ExperimentOutcome {
            samples,
            tissues: tissues.iter().map(|t| (*t).to_owned()).collect(),
            best_sample: Some(best.to_owned()),
            ..ExperimentOutcome::default()
        }
    }

    #[test]
    fn tissues_that_stiffen_together_have_one_slider_in_the_order_of_stiffness() {
        let both = |n: usize, m: f64| sample(n, &[("grey_matter", m), ("white_matter", 0.7 * m)]);
        let mut failed = both(3, 400.0);
        failed.converged = false;
        let samples = vec![both(0, 300.0), both(1, 100.0), both(2, 200.0), failed];
        let grid = SweepGrid::of(&outcome(samples, &["grey_matter", "white_matter"], "sample-02")).unwrap();
        assert_eq!(grid.samples, ["sample-01", "sample-02", "sample-00"]);
        assert_eq!((grid.stops, grid.best), (vec![3], vec![1]));
        assert!(grid.tissues.iter().all(|t| t.axis == 0 && t.moduli_pa.len() == 3));
    }

    #[test]
    fn a_whole_grid_of_two_tissues_has_two_sliders_and_one_with_a_hole_none() {
        let cell = |n: usize| sample(n, &[("a", [1.0, 2.0, 4.0][n % 3]), ("b", [10.0, 20.0][n / 3])]);
        let mut samples: Vec<SampleOutcome> = (0..6).map(cell).collect();
        let grid = SweepGrid::of(&outcome(samples.clone(), &["a", "b"], "sample-05")).unwrap();
        assert_eq!((grid.stops.as_slice(), grid.best.as_slice()), ([3, 2].as_slice(), [2, 1].as_slice()));
        assert_eq!(grid.samples[4], "sample-04");
        samples.remove(2);
        assert!(SweepGrid::of(&outcome(samples, &["a", "b"], "sample-05")).is_none());
        assert!(SweepGrid::of(&outcome(vec![cell(0)], &["a", "b"], "sample-00")).is_none());
    }

    #[test]
    fn a_state_comes_back_from_its_steps() {
        let samples = vec![sample(0, &[("brain", 100.0)]), sample(1, &[("brain", 200.0)])];
        let grid = SweepGrid::of(&outcome(samples, &["brain"], "sample-00")).unwrap();
        let nodes_mm = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mut states = SweptStatesBuilder::new(grid, &TriMesh { nodes_mm, triangles: vec![[0, 1, 2]] });
        states.push(&[[0.0, -3.0, 1.0], [0.5, 0.25, 0.0], [0.0; 3]]);
        let last = [[0.0; 3], [0.0, 4.0, 0.0], [1.0, 1.0, 1.0]];
        states.push(&last);
        let states = states.build().unwrap();
        let json = states.json();
        let step = json["step_mm"].as_f64().unwrap();
        let bytes = base64::engine::general_purpose::STANDARD.decode(json["states"][1].as_str().unwrap()).unwrap();
        let back: Vec<f64> =
            bytes.chunks_exact(2).map(|b| step * f64::from(i16::from_le_bytes([b[0], b[1]]))).collect();
        assert!(back.iter().zip(last.iter().flatten()).all(|(a, b)| (a - b).abs() <= 0.5 * step + 1e-12), "{back:?}");
        assert_eq!(states.said(&[1]), "sample-01: brain 200 Pa, simulated");
    }
}
