//! `hgm synth -o DIR`: a synthetic patient.

use super::flags::{Flags, word};
use super::{Failure, Session};
use crate::artefact::{Produced, Stage, StageError};
use crate::experiment::synth::{Contrast, SagKind, SynthError, synthesize};
use crate::segment::atlas::Side;
use std::path::PathBuf;

/// Make a synthetic patient: pre- and post-operative T1 and the truth behind them
///
/// Example: hgm synth --side left --seed 7 -o patient-07
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Output folder: pre.nii.gz, post.nii.gz, truth/
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Operated temporal lobe [default: left]
    #[arg(long, value_parser = word::<Side>, value_name = "left|right")]
    pub side: Option<Side>,
    /// Volume to resect [default: 35]
    #[arg(long, value_name = "CC")]
    pub resection_cc: Option<f64>,
    /// Voxel size of both scans [default: 1]
    #[arg(long, value_name = "MM")]
    pub spacing_mm: Option<f64>,
    /// Slice thickness of the post-operative scan [default: the voxel size]
    #[arg(long, value_name = "MM")]
    pub slice_mm: Option<f64>,
    /// Tilt of the post-operative slices [default: 0]
    #[arg(long, value_name = "DEG")]
    pub oblique_deg: Option<f64>,
    /// How the brain sags: none, smooth (analytic) or fem (finite elements) [default: smooth]
    #[arg(long, value_parser = word::<SagKind>, value_name = "none|smooth|fem")]
    pub sag: Option<SagKind>,
    /// Blood in the cavity
    #[arg(long)]
    pub blood: bool,
    /// Air in the cavity
    #[arg(long)]
    pub air: bool,
    /// Scans taken after gadolinium [default: none]
    #[arg(long, value_parser = word::<Contrast>, value_name = "none|pre|post|both")]
    pub contrast: Option<Contrast>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut flags = Flags::default();
    flags.set("synth.side", args.side);
    flags.set("synth.resection_cc", args.resection_cc);
    flags.set("synth.post_oblique_deg", args.oblique_deg);
    flags.set("synth.sag", args.sag);
    flags.switch("synth.blood", args.blood);
    flags.switch("synth.air", args.air);
    flags.set("synth.contrast", args.contrast);
    flags.set("synth.spacing_mm", args.spacing_mm);
    // Slices are never thinner than the voxels asked for.
    let slices = session.settings(Flags::default())?.synth.post_slice_mm;
    flags.set("synth.post_slice_mm", args.slice_mm.or(args.spacing_mm.map(|spacing| slices.max(spacing))));
    let settings = session.settings(flags)?.synth;

    let stage = Stage::new("synth", 3, &args.output, &settings).frame("pre, post").seed(settings.seed);
    let outcome = stage.run(session.options.force, || {
        let patient = synthesize(&settings)?;
        let facts = serde_json::to_value(&patient.truth).unwrap_or_default();
        Ok::<_, SynthError>(Produced { files: patient.files(), facts, ..Produced::default() })
    });
    let outcome = outcome.map_err(|error| match error {
        StageError::Compute(asked @ (SynthError::Setting { .. } | SynthError::LobeTooSmall { .. })) => {
            Failure::Rejected(asked.into())
        }
        other => Failure::Failed(other.into()),
    })?;
    let figure = |name: &str| outcome.manifest.facts[name].as_f64().unwrap_or(f64::NAN);
    let text = format!(
        "{}: {} lobe, resected {:.1} cc, cavity {:.1} cc, brain shift up to {:.1} mm, head turned by {:.1} degrees between the scans",
        args.output.display(),
        settings.side,
        figure("resected_cc"),
        figure("cavity_cc"),
        figure("largest_displacement_mm"),
        figure("rotation_deg"),
    );
    session.emit(
        &serde_json::json!({ "folder": args.output.display().to_string(), "truth": outcome.manifest.facts }),
        &text,
    )
}
