//! Stage `registration`: post to pre with the skull on, pre to MNI with the template's mask dilated.

use super::{Case, Failure, MNI_FROM_PRE, PRE_FROM_POST, Reject, ScanSums, Scans, WithReading, facts};
use crate::artefact::{Manifest, Produced, Stage};
use crate::cli::Session;
use crate::experiment::outcome::RegistrationOutcome;
use crate::experiment::resection::GravityFrame;
use crate::geometry::{Frame, Mni, Post, Pre, RigidTransform};
use crate::image::Grid;
use crate::register::transform_text::{rigid_from_text, to_itk_text, to_matrix_text};
use crate::register::{RigidFit, RigidMasks, RigidSettings, register_rigid, register_to_template};
use crate::segment::atlas;
use anyhow::Context;
use nalgebra::{Point3, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// Raised when the stage's code changes its result.
const VERSION: u32 = 1;

/// What the report says of the two fits.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RegistrationFacts {
    /// Post to pre, then pre to MNI.
    pub fits: Vec<RegistrationOutcome>,
}

/// The stage with its settings and inputs.
///
/// # Errors
/// A settings table that does not fit.
pub fn registration_stage(case: &Case, sums: &ScanSums, session: &Session) -> Result<(Stage, RigidSettings), Failure> {
    let settings: RigidSettings = session.settings("register")?;
    let posed = WithReading { settings: &settings, image: session.reading()? };
    let stage = Stage::new("registration", VERSION, &case.folder, &posed)
        .input_sha256("pre", &sums.pre)
        .input_sha256("post", &sums.post)
        .frame(Mni::NAME);
    Ok((stage, settings))
}

/// Fits both scans and writes both transforms as text and as ITK .tfm.
///
/// # Errors
/// Rejected scans (nothing in common, a constant image) and what the disk refuses.
pub fn registration(case: &Case, scans: &Scans, session: &Session) -> Result<(Manifest, RegistrationFacts), Failure> {
    let (stage, settings) = registration_stage(case, &scans.sums, session)?;
    case.run(&stage, "registration", || {
        let bar = session.progress(2, "registration");
        bar.set_message("post to pre");
        let pre_from_post = register_rigid(&scans.post, &scans.pre, RigidMasks::default(), &settings)
            .context("registering the post-operative scan (moving) onto the pre-operative one (fixed)")
            .reject()?;
        bar.inc(1);
        bar.set_message("pre to MNI");
        let mni_from_pre = register_to_template(&scans.pre, &atlas::template().t1_f32(), &settings)
            .context("registering the pre-operative scan (moving) onto the MNI template (fixed)")
            .reject()?;
        bar.finish_and_clear();
        let mut produced = Produced::default();
        produced.warnings.extend(scans.warnings.iter().cloned());
        produced.warnings.extend(pre_from_post.warnings.iter().map(|w| format!("post to pre: {w}")));
        produced.warnings.extend(mni_from_pre.warnings.iter().map(|w| format!("pre to MNI: {w}")));
        write_transform(&mut produced, PRE_FROM_POST, &pre_from_post.fixed_from_moving);
        write_transform(&mut produced, MNI_FROM_PRE, &mni_from_pre.fixed_from_moving);
        let fits = vec![outcome(&pre_from_post, &scans.post.grid), outcome(&mni_from_pre, &scans.pre.grid)];
        produced.facts = facts(&RegistrationFacts { fits })?;
        Ok(produced)
    })
}

/// Post to pre, and pre to MNI.
type Poses = (RigidTransform<Post, Pre>, RigidTransform<Pre, Mni>);

/// The two transforms of a case, as the files hold them.
///
/// # Errors
/// Rejected when a file is missing or not a rigid matrix.
pub fn transforms(case: &Case) -> Result<Poses, Failure> {
    let text = |name: &str| case.read_text(&format!("{name}.txt"));
    let pre_from_post = rigid_from_text(&text(PRE_FROM_POST)?, &format!("{PRE_FROM_POST}.txt")).reject()?;
    let mni_from_pre = rigid_from_text(&text(MNI_FROM_PRE)?, &format!("{MNI_FROM_PRE}.txt")).reject()?;
    Ok((pre_from_post, mni_from_pre))
}

/// What turns a vector of the frame that gravity is given in to the MNI frame.
///
/// # Errors
/// As [`transforms`].
pub fn mni_from_gravity_frame(case: &Case, frame: GravityFrame) -> Result<UnitQuaternion<f64>, Failure> {
    let (pre_from_post, mni_from_pre) = transforms(case)?;
    Ok(match frame {
        GravityFrame::Mni => UnitQuaternion::identity(),
        GravityFrame::Pre => mni_from_pre.rotation,
        GravityFrame::Post => pre_from_post.then(&mni_from_pre).rotation,
    })
}

fn write_transform<M: Frame, F: Frame>(produced: &mut Produced, name: &str, transform: &RigidTransform<M, F>) {
    produced.files.push((format!("{name}.txt"), to_matrix_text(transform).into_bytes()));
    produced.files.push((format!("{name}.tfm"), to_itk_text(transform).into_bytes()));
}

fn outcome<M: Frame, F: Frame>(fit: &RigidFit<M, F>, moving: &Grid<M>) -> RegistrationOutcome {
    let centre = moving.position(Point3::from(moving.dims.map(|n| (n as f64 - 1.0) / 2.0)));
    let moved = fit.fixed_from_moving.apply(centre).mm - centre.mm;
    RegistrationOutcome {
        moving: M::NAME.to_owned(),
        fixed: F::NAME.to_owned(),
        rotation_deg: fit.fixed_from_moving.rotation.angle().to_degrees(),
        translation_mm: moved.into(),
        similarity: "Mattes mutual information (nats)".to_owned(),
        similarity_before: None,
        similarity_after: Some(fit.quality.mutual_information),
    }
}
