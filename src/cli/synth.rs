//! `hgm synth -o DIR`: a synthetic patient.

use super::flags::word;
use super::{Failure, Session};
use crate::experiment::synth::{Lobe, SagKind, Scans};
use crate::segment::atlas::Side;
use crate::workflow::{Layer, SyntheticFiles, results_in_words, synthetic_patient};
use std::path::PathBuf;

/// Make a synthetic patient: pre- and post-operative T1 and the truth behind them
///
/// Example: hgm synth --side left --seed 7 -o patient-07
/// Example: hgm synth --head T1.nii.gz --dseg aseg.mgz --lobe frontal --resection-cc 20 -o patient-08
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Output folder: pre.nii.gz, post.nii.gz, truth/
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// A T1 whose head is operated [default: the template's]
    #[arg(long, value_name = "T1")]
    pub head: Option<PathBuf>,
    /// A label map of that head, made by another tool
    #[arg(long, value_name = "FILE", requires = "head")]
    pub dseg: Option<PathBuf>,
    /// Whose numbers the label map holds [default: found out from the numbers]
    #[arg(long, value_name = "freesurfer|synthseg|charm|gif|muse|hgm|FILE.tsv", requires = "dseg")]
    pub labels: Option<String>,
    /// What is taken out, in the grid of that head [default: part of a lobe]
    #[arg(long, value_name = "FILE", requires = "head", conflicts_with_all = ["lobe", "resection_cc"])]
    pub resected_mask: Option<PathBuf>,
    /// Operated lobe [default: temporal]
    #[arg(long, value_name = "temporal|frontal|parietal|occipital|insular|hemisphere")]
    pub lobe: Option<Lobe>,
    /// Operated side [default: left]
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
    #[arg(long, value_parser = word::<Scans>, value_name = "none|pre|post|both")]
    pub contrast: Option<Scans>,
    /// Scans with zeros where the face was [default: none]
    #[arg(long, value_parser = word::<Scans>, value_name = "none|pre|post|both")]
    pub deface: Option<Scans>,
    /// Scans with zeros outside the brain [default: none]
    #[arg(long, value_parser = word::<Scans>, value_name = "none|pre|post|both")]
    pub strip: Option<Scans>,
    /// Scans with oedema around the resection [default: none]
    #[arg(long, value_parser = word::<Scans>, value_name = "none|pre|post|both")]
    pub oedema: Option<Scans>,
    /// Volume of an old lesion elsewhere, in both scans [default: 0]
    #[arg(long, value_name = "CC")]
    pub old_lesion_cc: Option<f64>,
    /// How many times as large the ventricles are [default: 1]
    #[arg(long, value_name = "FACTOR")]
    pub ventricles: Option<f64>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut flags = Layer::default();
    flags.set("synth.side", args.side);
    flags.set("synth.lobe", args.lobe);
    flags.set("synth.resection_cc", args.resection_cc);
    flags.set("synth.post_oblique_deg", args.oblique_deg);
    flags.set("synth.sag", args.sag);
    flags.switch("synth.blood", args.blood);
    flags.switch("synth.air", args.air);
    flags.set("synth.contrast", args.contrast);
    for (name, scans) in [("defaced", args.deface), ("stripped", args.strip)] {
        flags.set(&format!("synth.pre.{name}"), scans.map(Scans::in_pre));
        flags.set(&format!("synth.post.{name}"), scans.map(Scans::in_post));
    }
    flags.set("synth.pathology.oedema", args.oedema);
    flags.set("synth.pathology.old_lesion_cc", args.old_lesion_cc);
    flags.set("synth.pathology.ventricle_factor", args.ventricles);
    flags.set("synth.spacing_mm", args.spacing_mm);
    let below = session.settings(Layer::default())?.synth;
    let slices = args.spacing_mm.map(|spacing| below.slices_of_voxels_mm(spacing));
    flags.set("synth.post_slice_mm", args.slice_mm.or(slices));
    let settings = session.settings(flags)?;
    let Args { output, head, dseg, labels, resected_mask, .. } = args.clone();
    let files = SyntheticFiles { output, head, dseg, labels, resected_mask };
    let truth = synthetic_patient(&files, &settings, session.options.force, &mut *session.listener())?;
    let text = results_in_words::synthesised(&truth, &files, &settings);
    session.emit(&serde_json::json!({ "folder": args.output.display().to_string(), "truth": truth }), &text)
}
