//! Stage `fields`: the brain shift as displacement fields of the scans, and the pre-operative images carried by it.

use super::shift::{Believed, CaseShift, FUSED, OBSERVED};
use crate::artefact::{Manifest, Produced, Stage};
use crate::experiment::field::{Between, BrainShift, ShiftField, Source, StateShift, at, seen_through};
use crate::geometry::{Frame, Post, Pre, RigidTransform};
use crate::image::nifti::{
    self, ReadOptions, encode_displacement, encode_intensities, encode_mask, encode_numbers, encode_u8,
};
use crate::image::{Grid, Mask, Volume};
use crate::layout::{
    NATIVE_RESECTED, POST_FROM_PRE_FIELD, PRE_FROM_POST_FIELD, PRE_NATIVE_LABELS, PRE_NATIVE_T1, SHIFT, SHIFT_BACK,
    SHIFT_JSON, SHIFT_MASK, SHIFT_REACH, SHIFT_SD, WARPED_LABELS, WARPED_T1,
};
use crate::workflow::error::WorkflowError;
use crate::workflow::stage_name::StageName;
use crate::workflow::warning::Warning;
use crate::workflow::work::{Made, Work, facts};
use nalgebra::{Point3, Vector3};

/// Raised when the stage's code changes its result.
const VERSION: u32 = 12;
const NAME: StageName = StageName::Fields;

/// What the fields are made from.
#[derive(Debug)]
pub(crate) struct FieldsInput<'a> {
    /// The state of the model, where one converged.
    pub model: Option<String>,
    /// Manifests of the samples.
    pub samples: &'a [Manifest],
}

/// The stage with its settings and inputs.
pub(crate) fn fields_stage(work: &Work<'_>, made: &Made, input: &FieldsInput<'_>) -> Stage {
    let settings = &work.settings.fields;
    let believed = Believed::of(work.settings);
    let of_images = serde_json::json!({ "displacement": work.settings.estimate.displacement, "rigid_mm": believed.errors.rigid_mm });
    let posed = serde_json::json!({ "fields": settings, "model": input.model, "believed": of_images });
    let mut stage = work.stage(made, &NAME, VERSION, &posed).frame(Pre::NAME);
    if let Some(estimate) = made.get(&StageName::Estimate) {
        stage = stage.after(estimate);
    }
    input.samples.iter().fold(stage, Stage::after)
}

/// Writes (or skips) the fields of every state that is asked for.
pub(crate) fn fields(work: &Work<'_>, made: &mut Made, input: &FieldsInput<'_>) -> Result<BrainShift, WorkflowError> {
    let settings = &work.settings.fields;
    let stage = fields_stage(work, made, input);
    work.run(made, &NAME, &stage, || {
        work.tell(|p| p.begin("fields", 1 + settings.states.len()));
        let ids = input.samples.iter().filter_map(|m| match StageName::parse(&m.stage) {
            Some(StageName::Sample(id)) if !m.outputs.is_empty() => Some(id),
            _ => None,
        });
        let case = CaseShift::read(
            &work.case,
            input.model.as_deref(),
            ids.collect(),
            (settings, Believed::of(work.settings)),
        )?;
        let mut produced = Produced::default();
        let mut shift = BrainShift {
            model: input.model.clone(),
            explained: case.explained(),
            discrepancy: case.discrepancy(),
            ..BrainShift::default()
        };
        for source in &settings.states {
            let state = match (source, &input.model) {
                (Source::Model, Some(model)) => model.as_str(),
                (Source::Fused, Some(_)) => FUSED,
                (Source::Observed, _) => OBSERVED,
                (Source::Model | Source::Fused, None) => continue,
            };
            work.tell(|p| p.doing(state));
            let field = case.state(state)?;
            shift.states.push(StateShift::of(state, &field));
            produced.files.extend(files(state, &field, (&case.post_grid, &case.post_from_pre)));
            if *source == Source::Model {
                carried(work, &field, &mut produced)?;
            }
            work.tell(|p| p.step());
        }
        let folded = shift.states.iter().filter(|state| state.smoothed_voxels > 0);
        let folds = |s: &StateShift| Warning::Folds { state: s.state.clone(), voxels: s.smoothed_voxels };
        produced.warn(folded.map(folds));
        let json = serde_json::to_string_pretty(&shift).expect("figures are plain data") + "\n";
        produced.files.push((SHIFT_JSON.to_owned(), json.into_bytes()));
        produced.facts = facts(&shift);
        work.tell(|p| p.end());
        Ok(produced)
    })
}

/// The files of one state; `post_grid` and `post_from_pre` lead to the post-operative scan.
fn files(
    state: &str,
    field: &ShiftField,
    (post_grid, post_from_pre): (&Grid<Post>, &RigidTransform<Pre, Post>),
) -> Vec<(String, Vec<u8>)> {
    let whole = &field.whole;
    let forward = || (SHIFT.of(state), encode_displacement(whole, |v| field.forward_at(v)));
    let back = || (SHIFT_BACK.of(state), encode_displacement(whole, |v| field.inverse_at(v)));
    let to_post = || (POST_FROM_PRE_FIELD.of(state), encode_displacement(whole, field.to_post(post_from_pre)));
    let to_pre = || {
        let value = field.to_pre(post_grid, &post_from_pre.inverse());
        (PRE_FROM_POST_FIELD.of(state), encode_displacement(post_grid, value))
    };
    let sd = || (SHIFT_SD.of(state), encode_numbers(whole, |v| field.value_at(&field.sd_mm, v)));
    let reach = || (SHIFT_REACH.of(state), encode_numbers(whole, |v| field.value_at(&field.reach95_mm, v)));
    // Two at a time: what one waits for the other can use, and no more has to be held at once.
    let pairs = [rayon::join(forward, back), rayon::join(to_post, to_pre), rayon::join(sd, reach)];
    let mask = (SHIFT_MASK.of(state), encode_mask(&field.on_whole(&field.believed)));
    pairs.into_iter().flat_map(|(a, b)| [a, b]).chain([mask]).collect()
}

/// The pre-operative scan and its labels carried to the deformed state, on the scan's own grid.
pub(super) fn carried(work: &Work<'_>, field: &ShiftField, produced: &mut Produced) -> Result<(), WorkflowError> {
    let options = ReadOptions::default();
    let [t1, labels] = [work.case.read(PRE_NATIVE_T1)?, work.case.read(PRE_NATIVE_LABELS)?];
    let (t1, labels) = rayon::join(
        || nifti::decode(&t1, PRE_NATIVE_T1, &options),
        || nifti::decode_labels(&labels, PRE_NATIVE_LABELS, &options),
    );
    let t1: Volume<f32, Pre> = t1?.volume.relabelled();
    let labels: Volume<f32, Pre> = labels?.0.relabelled::<Pre>().map(f32::from);
    let (taken, _) = nifti::decode_labels(&work.case.read(NATIVE_RESECTED)?, NATIVE_RESECTED, &options)?;
    let taken: Mask<Pre> = taken.relabelled::<Pre>().map(|l| l > 0);
    let grid = t1.grid;
    // Fields on the scan's own grid need not be interpolated.
    let same = grid.coincides(&field.whole, 1e-9);
    let back = |voxel: [usize; 3]| Some(moved_back(field, (&grid, same), voxel));
    // As whole as the scan: between whole numbers there is nothing to be known.
    let whole = t1.data.iter().all(|x| *x == x.round());
    let t1 = seen_through(&t1, &grid, back, Some(&taken), Between::Intensities);
    let t1 = if whole { t1.map(f32::round) } else { t1 };
    let labels = seen_through(&labels, &grid, back, Some(&taken), Between::Labels);
    produced.files.push((WARPED_T1.to_owned(), encode_intensities(&t1)));
    produced.files.push((WARPED_LABELS.to_owned(), encode_u8(&labels.map(|l| l as u8))));
    Ok(())
}

/// Where the tissue at a voxel came from, in voxels.
fn moved_back(field: &ShiftField, (grid, same): (&Grid<Pre>, bool), voxel: [usize; 3]) -> Point3<f64> {
    let d = if same {
        field.inverse_at(voxel).map(f64::from)
    } else {
        at(&field.inverse, grid.centre(voxel)).unwrap_or_default()
    };
    let voxel = Point3::from(voxel.map(|x| x as f64));
    if d == [0.0; 3] { voxel } else { voxel + grid.voxel_from_mm().fixed_view::<3, 3>(0, 0) * Vector3::from(d) }
}
