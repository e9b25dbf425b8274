//! hgm: from a pre- and post-operative T1 pair to a biomechanical answer: how the brain deformed, which tissue stiffness
//! explains it, and how sure that is.
//!
//! # The whole job
//! [`workflow::run`] takes two scans through registration, segmentation, masks, mesh, simulation and report into a case
//! folder. It resumes: what is there and unchanged is not made again. [`workflow::Case`] reads a folder back.
//!
//! ```no_run
//! use hgm::workflow::{self, Case, Inputs, Place, Settings, Silent};
//!
//! # fn main() -> Result<(), workflow::WorkflowError> {
//! let mut settings = Settings::default();
//! settings.resection.tissues = 2;
//! let inputs = Inputs::pair("pre.nii.gz", "post.nii.gz");
//! workflow::run(&inputs, &Place::from("case"), &settings, &mut Silent)?;
//!
//! let case = Case::open("case")?;
//! let outcome = case.outcome()?;
//! println!("best sample {:?}: {:?} mm", outcome.best_sample, outcome.best().map(|best| &best.rmse_mm));
//! let displacement_mm = case.field("displacement")?.vectors().unwrap_or_default();
//! println!("the first node moves by {:?} mm", displacement_mm.first());
//! # Ok(())
//! # }
//! ```
//!
//! Every setting stands in [`workflow::Settings`], a field for each room, each with its default; a settings file is a layer
//! over them ([`workflow::Settings::layer`]). [`workflow::plan`] tells which stages a job has, [`layout`] which files it
//! leaves, [`workflow::why`] what would be made again. A [`workflow::Progress`] of your own listens.
//!
//! # Parts of it
//! `src/` is a row of rooms in the order the data flows; each module below is one room, and `tests/it/rooms.rs` holds the
//! table of who may import whom. Every room can be used alone:
//!
//! - [`image`]: volumes with an affine, NIfTI, filters; [`register`]: rigid and deformable registration.
//! - [`segment`], [`resect`]: tissue labels of a T1, the cavity and what filled it.
//! - [`mesh`], [`tag`]: a label map to tetrahedra with boundary sets; formats and quality.
//! - [`material`]: hyperelastic laws, 73 literature models and the Gaussian process over them.
//! - [`overlay`]: what other tools draw on a scan: points, streamlines, surfaces.
//! - [`fem`]: [`fem::simulate`] deforms a mesh by a [`fem::Scenario`].
//! - [`experiment`]: samples against a target, the estimate with its intervals.
//!
//! ```
//! use hgm::material::Task;
//! use hgm::material::generative::{SampleSettings, sample_shear_moduli};
//!
//! // The literature's white matter at its mean, one standard deviation below and one above.
//! let white = sample_shear_moduli(Task::HYPERELASTIC_WHITE, &[-1.0, 0.0, 1.0], &SampleSettings::default())?;
//! assert!(white[0].shear_modulus_pa < white[1].shear_modulus_pa);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The programs in `examples/` are short and run by the tests: a pair to a report, a mesh simulated, the prior sampled.
//!
//! # Conventions
//! Positions and files are in mm, RAS+; moduli in Pa; only `fem::units` converts to SI. The same inputs and settings give the
//! same bytes, on any number of threads. Errors are values that name file, value and rule; nothing but `cli` prints. Research
//! software, not a medical device.
//!
//! The science follows Granados et al., "A generative model of hyperelastic strain energy density functions for
//! multiple tissue brain deformation", IJCARS 2021.

pub mod anatomy;
pub mod artefact;
pub mod cli;
pub mod experiment;
pub mod fem;
pub mod geometry;
pub mod image;
pub mod layout;
pub mod live;
pub mod manual;
pub mod material;
pub mod mesh;
pub mod overlay;
pub mod register;
pub mod report;
pub mod resect;
pub mod segment;
pub mod tag;
pub mod workflow;
