//! The stages of a case, a file for each.
//!
//! Every stage reads what it needs from files and writes files: a stage that was skipped and one that was run leave the
//! next one the same bytes to start from.

mod anat;
mod brain_shift;
mod compare;
mod earlier;
mod estimate;
mod fields;
mod held_body;
mod held_by;
mod labels;
mod mesh;
mod plan;
mod pose;
mod predict;
mod predicted_draws;
mod reading;
mod reference;
mod registration;
mod samples;
mod shift;

pub use anat::AnatFacts;
pub use mesh::mesh_outcome;
pub use registration::RegistrationFacts;

pub(crate) use anat::{Anatomy, anat, anat_stage};
pub(crate) use brain_shift::SeenShift;
pub(crate) use compare::compare;
pub(crate) use earlier::Earlier;
pub(crate) use estimate::{EstimateInput, estimate, estimate_stage, present_estimate};
pub(crate) use fields::{FieldsInput, fields, fields_stage};
pub(crate) use held_body::HeldBody;
pub(crate) use labels::labels;
pub(crate) use mesh::{LARGE_ISLAND_MM3, coarser_mesh, mesh, mesh_before_resection, mesh_stage, mesh_stage_of};
pub(crate) use plan::{PlanFacts, PlannedHead, plan, plan_stage};
pub(crate) use pose::{PoseFacts, pose, pose_stage};
pub(crate) use predict::{PredictInput, fluid_of_head, planned_body, predict};
pub(crate) use predicted_draws::{Predicted, read_draws};
pub(crate) use reading::WithReading;
pub(crate) use reference::{
    error_at_rest, known_state, observed_surfaces, phantom_reference, phantom_reference_stage, reference,
    reference_stage,
};
pub(crate) use registration::{
    OF_POSE, mni_from_gravity_frame, pose as mni_from_pre, registration, registration_stage, transforms,
};
pub(crate) use samples::{SampleMode, Sweep, lesions, present_samples, sample_stage, samples, with_held_tissues};
pub(crate) use shift::{Believed, CaseShift, FUSED, OBSERVED, brain_shift, grid_of, mask_of};
