//! The brain shift of a case in any of its states, from what its folder holds.

use super::registration::transforms;
use crate::experiment::depth::depth_mm;
use crate::experiment::estimate::{CorrelatedErrors, EstimateOutcome, MovedNode, SEEN_AT, SEEN_DISPLACEMENT, moved_by};
use crate::experiment::field::{
    BrainShift, Discrepancy, Explained, FieldSettings, Fused, Moved, ShiftField, Surroundings, explained, fused,
    shift_field,
};
use crate::experiment::reach::reach_95;
use crate::geometry::{Frame, Mni, Post, Pre, RigidTransform};
use crate::image::nifti::{self, ReadOptions};
use crate::image::resample::grid_with_spacing;
use crate::image::{Grid, Mask};
use crate::layout::{
    ESTIMATE_JSON, ESTIMATE_STATE, NATIVE_RESECTED, POST_NATIVE_BRAIN, PRE_NATIVE_BRAIN, REST_MESH, SAG, SAMPLE_STATE,
    SHIFT_JSON,
};
use crate::mesh::TetMesh;
use crate::mesh::format::{Field, vtu};
use crate::register::deformable::DisplacementField;
use crate::segment::native::mask_on;
use crate::workflow::case::Case;
use crate::workflow::error::{CaseError, WorkflowError};
use crate::workflow::settings::Settings;
use nalgebra::Matrix4;
use rayon::prelude::*;
use std::cell::OnceCell;

/// Name of the estimate's state.
pub(crate) const ESTIMATE: &str = "estimate";
/// Name of the state that model and images give together.
pub(crate) const FUSED: &str = "fused";
/// Name of the state that the images show.
pub(crate) const OBSERVED: &str = "observed";

/// The displacement of a mesh's nodes with its spread, mm, MNI.
#[derive(Clone, Debug)]
#[allow(clippy::struct_field_names, reason = "the unit is in the name")]
struct Nodes {
    displacement_mm: Vec<[f64; 3]>,
    sd_mm: Vec<f64>,
    reach95_mm: Vec<f64>,
}

/// The model's state.
#[derive(Debug)]
struct Model {
    name: String,
    mesh: TetMesh,
    nodes: Nodes,
    depth_mm: Vec<f64>,
    /// What the images showed of some nodes, the registration's own error taken out; empty where no estimate did that.
    seen: Vec<MovedNode>,
    /// What the rigid registration follows of the state; `None` where it was never shown that, and its own error is in what was seen.
    taken_up: Option<RigidTransform<Mni, Mni>>,
    fused: OnceCell<Fused>,
}

impl Model {
    /// An estimate at rest says that nothing was seen to move.
    fn is_at_rest(&self) -> bool {
        self.name == ESTIMATE && self.nodes.displacement_mm.iter().flatten().all(|u| *u == 0.0)
    }
}

/// How far what the images show is believed.
#[derive(Clone, Debug)]
pub(crate) struct Believed {
    /// From this depth on, mm.
    pub depth_mm: f64,
    /// With these errors.
    pub errors: CorrelatedErrors,
}

impl Believed {
    /// As an estimate believes it.
    pub fn of(settings: &Settings) -> Self {
        let displacement = &settings.estimate.displacement;
        let errors = displacement.errors(settings.resection.registration_error_mm);
        Self { depth_mm: displacement.depth_mm, errors }
    }
}

/// What every state of a case shares.
#[derive(Debug)]
pub(crate) struct CaseShift<'a> {
    case: &'a Case,
    settings: &'a FieldSettings,
    believed: Believed,
    pub post_from_pre: RigidTransform<Pre, Post>,
    pub mni_from_pre: RigidTransform<Pre, Mni>,
    /// Grid of the fields in the post-operative scan's frame.
    pub post_grid: Grid<Post>,
    around: Surroundings,
    seen: DisplacementField<Mni>,
    model: Option<Model>,
    /// The samples of the sweep, for its spread.
    samples: Vec<String>,
}

/// The numbers of a case's fields, where there are any.
pub(crate) fn brain_shift(case: &Case) -> Result<Option<BrainShift>, WorkflowError> {
    if !case.path(SHIFT_JSON).exists() {
        return Ok(None);
    }
    let damaged = |_| CaseError::Damaged {
        folder: case.folder().to_path_buf(),
        file: SHIFT_JSON.to_owned(),
        subject: case.subject(),
    };
    Ok(Some(serde_json::from_str(&case.read_text(SHIFT_JSON)?).map_err(damaged)?))
}

/// A mask of the case on a grid.
pub(crate) fn mask_of<F: Frame>(case: &Case, name: &str, grid: &Grid<F>) -> Result<Mask<F>, WorkflowError> {
    let (labels, _) = nifti::decode_labels(&case.read(name)?, name, &ReadOptions::default())?;
    let mask: Mask<F> = labels.relabelled::<F>().map(|l| l > 0);
    Ok(if mask.grid.coincides(grid, 1e-3) { mask } else { mask_on(&mask, grid, &RigidTransform::identity()) })
}

/// The grid of an image of the case.
pub(crate) fn grid_of<F: Frame>(case: &Case, name: &str) -> Result<Grid<F>, WorkflowError> {
    Ok(nifti::decode_grid(&case.read(name)?, name)?.relabelled())
}

pub(super) fn spaced<F: Frame>(grid: Grid<F>, spacing_mm: f64) -> Grid<F> {
    if spacing_mm > 0.0 { grid_with_spacing(&grid, [spacing_mm; 3]) } else { grid }
}

impl<'a> CaseShift<'a> {
    /// Reads what every state shares. `model` is the model's state, `samples` those that were tried beside it.
    pub fn read(
        case: &'a Case,
        model: Option<&str>,
        samples: Vec<String>,
        (settings, believed): (&'a FieldSettings, Believed),
    ) -> Result<Self, WorkflowError> {
        let (pre_from_post, mni_from_pre) = transforms(case)?;
        let pre_grid: Grid<Pre> = grid_of(case, PRE_NATIVE_BRAIN)?;
        let grid = spaced(pre_grid, settings.spacing_mm);
        let around = Surroundings {
            brain: mask_of(case, PRE_NATIVE_BRAIN, &grid)?,
            resected: mask_of(case, NATIVE_RESECTED, &grid)?,
        };
        let seen = nifti::decode_displacement(&case.read(SAG)?, SAG)?;
        let mut shift = Self {
            case,
            settings,
            believed,
            post_from_pre: pre_from_post.inverse(),
            mni_from_pre,
            post_grid: spaced(grid_of(case, POST_NATIVE_BRAIN)?, settings.spacing_mm),
            around,
            seen: DisplacementField::from_displacement(&seen.relabelled()),
            model: None,
            samples,
        };
        shift.model = model.map(|name| shift.state_of_model(name)).transpose()?;
        Ok(shift)
    }

    fn state_of_model(&self, name: &str) -> Result<Model, WorkflowError> {
        let file = if name == ESTIMATE { ESTIMATE_STATE.to_owned() } else { SAMPLE_STATE.of(name) };
        let state = vtu::decode(&self.case.read(&file)?, &file)?;
        let no_field =
            |array: &str| CaseError::NoField { folder: self.case.folder().to_path_buf(), name: array.to_owned() };
        let vectors = |field: &str| state.point_field(field).and_then(Field::vectors);
        let displacement_mm = vectors("displacement").ok_or_else(|| no_field("displacement"))?;
        let scalar = |field: &str| state.point_field(field).map(|field| field.values.clone());
        let (sd_mm, reach95_mm) = match (scalar("displacement_sd"), scalar("displacement_95")) {
            (Some(sd), Some(reach)) => (sd, reach),
            _ => self.spread_of_samples(&displacement_mm)?,
        };
        let depth_mm = depth_mm(&state.mesh);
        let seen = match (scalar(SEEN_AT), vectors(SEEN_DISPLACEMENT)) {
            (Some(at), Some(u)) => at
                .iter()
                .zip(&u)
                .enumerate()
                .filter(|(_, (at, _))| **at == 1.0)
                .map(|(n, (_, u))| (n as u32, *u))
                .collect(),
            _ => Vec::new(),
        };
        let nodes = Nodes { displacement_mm, sd_mm, reach95_mm };
        let taken_up = if name == ESTIMATE { self.taken_up_of_estimate()? } else { None };
        Ok(Model { name: name.to_owned(), mesh: state.mesh, nodes, depth_mm, seen, taken_up, fused: OnceCell::new() })
    }

    /// What the rigid registration follows of the estimate's state; `None` where it was never shown that.
    fn taken_up_of_estimate(&self) -> Result<Option<RigidTransform<Mni, Mni>>, WorkflowError> {
        let damaged = || CaseError::Damaged {
            folder: self.case.folder().to_path_buf(),
            file: ESTIMATE_JSON.to_owned(),
            subject: self.case.subject(),
        };
        let outcome: EstimateOutcome =
            serde_json::from_str(&self.case.read_text(ESTIMATE_JSON)?).map_err(|_| damaged())?;
        let Some(rows) = outcome.rigid_taken_up else { return Ok(None) };
        let matrix = Matrix4::from_fn(|row, column| rows[row][column]);
        Ok(Some(RigidTransform::from_matrix(&matrix).map_err(|_| damaged())?))
    }

    /// How far the samples of the sweep lie apart at every node, and the reach with it, mm.
    fn spread_of_samples(&self, mean: &[[f64; 3]]) -> Result<(Vec<f64>, Vec<f64>), WorkflowError> {
        let (case, mut sums) = (self.case, vec![([0.0; 3], 0.0); mean.len()]);
        let read = |id: &String| -> Result<Vec<[f64; 3]>, WorkflowError> {
            let file = SAMPLE_STATE.of(id);
            let field = vtu::decode_point_field(&case.read(&file)?, &file, "displacement")?;
            Ok(field.as_ref().and_then(Field::vectors).unwrap_or_default())
        };
        let read: Vec<_> = self.samples.par_iter().map(read).collect();
        let mut count = 0.0;
        for u in read {
            let u = u?;
            if u.len() != mean.len() {
                continue;
            }
            count += 1.0;
            for ((sum, squares), u) in sums.iter_mut().zip(&u) {
                (0..3).for_each(|a| sum[a] += u[a]);
                *squares += u.iter().map(|x| x * x).sum::<f64>();
            }
        }
        let n = f64::max(count, 1.0);
        let sd = |(sum, squares): &([f64; 3], f64)| {
            let of_mean: f64 = sum.iter().map(|s| (s / n).powi(2)).sum();
            ((squares / n - of_mean).max(0.0) * n / f64::max(n - 1.0, 1.0)).sqrt()
        };
        let sd: Vec<f64> = sums.iter().map(sd).collect();
        let reach = reaches(mean, &sd);
        Ok((sd, reach))
    }

    /// The field of a state by its name.
    pub fn state(&self, name: &str) -> Result<ShiftField, WorkflowError> {
        match (name, &self.model) {
            (OBSERVED, _) | (FUSED, None) => self.observed(),
            (FUSED, Some(model)) => {
                let found = self.put_right(model);
                Ok(self.field(
                    &model.mesh,
                    &found.displacement_mm,
                    (&found.sd_mm, &reaches(&found.displacement_mm, &found.sd_mm)),
                    None,
                ))
            }
            (_, Some(model)) if model.name == name => Ok(self.of_model(model)),
            _ => {
                let other = self.state_of_model(name)?;
                Ok(self.of_model(&other))
            }
        }
    }

    fn of_model(&self, model: &Model) -> ShiftField {
        let Nodes { displacement_mm, sd_mm, reach95_mm } = &model.nodes;
        // The spread of moduli is not the error of a field: what the model leaves of the seen displacement counts too.
        let found = self.put_right(model);
        if found.left.is_none() {
            return self.field(&model.mesh, displacement_mm, (sd_mm, reach95_mm), None);
        }
        let sd_mm = &found.model_sd_mm;
        self.field(&model.mesh, displacement_mm, (sd_mm, &reaches(displacement_mm, sd_mm)), None)
    }

    fn observed(&self) -> Result<ShiftField, WorkflowError> {
        let own;
        let (mesh, depth) = if let Some(model) = &self.model {
            (&model.mesh, model.depth_mm.clone())
        } else {
            own = vtu::decode(&self.case.read(REST_MESH)?, REST_MESH)?.mesh;
            (&own, depth_mm(&own))
        };
        let displacement_mm: Vec<[f64; 3]> = mesh.nodes_mm().iter().map(|x| moved_by(&self.seen, *x)).collect();
        let sd_mm: Vec<f64> = depth.iter().map(|d| 3f64.sqrt() * self.settings.seen_noise_at(*d)).collect();
        let reach95_mm = reaches(&displacement_mm, &sd_mm);
        let seen = &self.seen;
        Ok(self.field(mesh, &displacement_mm, (&sd_mm, &reach95_mm), Some(&|x| moved_by(seen, x))))
    }

    fn field(
        &self,
        mesh: &TetMesh,
        displacement_mm: &[[f64; 3]],
        (sd_mm, reach95_mm): (&[f64], &[f64]),
        seen: Option<&(dyn Fn([f64; 3]) -> [f64; 3] + Sync)>,
    ) -> ShiftField {
        let state = Moved { tets: mesh.tets(), nodes_mm: mesh.nodes_mm(), displacement_mm, sd_mm, reach95_mm };
        shift_field(&state, seen, &self.mni_from_pre.inverse(), &self.around, self.settings)
    }

    /// What the images show in the depth of the brain.
    fn seen_nodes(&self, model: &Model) -> Vec<MovedNode> {
        if !model.seen.is_empty() {
            return model.seen.clone();
        }
        let nodes = model.mesh.nodes_mm().iter().zip(&model.depth_mm).enumerate();
        let deep = nodes.filter(|(_, (_, depth))| **depth >= self.believed.depth_mm);
        deep.map(|(n, (x, _))| (n as u32, moved_by(&self.seen, *x))).collect()
    }

    /// The share of the seen shift that the model explains, in the depth of the brain.
    pub fn explained(&self) -> Option<Explained> {
        let model = self.model.as_ref()?;
        let deep = (0..model.depth_mm.len()).filter(|&n| model.depth_mm[n] >= self.believed.depth_mm);
        Some(explained(deep.map(|n| {
            let x = model.mesh.nodes_mm()[n];
            let noise_mm = self.settings.seen_noise_at(model.depth_mm[n]);
            (x, moved_by(&self.seen, x), model.nodes.displacement_mm[n], noise_mm)
        })))
    }

    /// The process over what the model leaves.
    pub fn discrepancy(&self) -> Option<Discrepancy> {
        let found = self.put_right(self.model.as_ref()?);
        found.left.as_ref().map(Discrepancy::of)
    }

    /// The model put right by what was seen.
    fn put_right<'m>(&self, model: &'m Model) -> &'m Fused {
        let Nodes { displacement_mm, sd_mm, .. } = &model.nodes;
        model.fused.get_or_init(|| {
            if model.is_at_rest() {
                return Fused::at_rest(sd_mm, self.believed.errors.rigid_mm);
            }
            let seen = self.seen_nodes(model);
            let believed = self.believed.errors;
            let (noise, taken_up) = match model.taken_up {
                Some(taken_up) => (self.settings.seen_corrected_noise(), taken_up),
                None => (believed.noise, RigidTransform::identity()),
            };
            let errors = CorrelatedErrors { noise, ..believed };
            fused(model.mesh.nodes_mm(), displacement_mm, sd_mm, &seen, &errors, &taken_up)
        })
    }
}

/// The 95 % reach of every node, of a spread that is alike in all directions, mm.
fn reaches(displacement_mm: &[[f64; 3]], sd_mm: &[f64]) -> Vec<f64> {
    displacement_mm.iter().zip(sd_mm).map(|(u, sd)| reach_95(length(u), *sd)).collect()
}

fn length(u: &[f64; 3]) -> f64 {
    u.iter().map(|x| x * x).sum::<f64>().sqrt()
}
