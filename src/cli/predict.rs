//! `hgm predict`: before the operation, how the brain will move.

use super::flags::{Flags, MeshOptions, PopulationOption, PriorOptions};
use super::{Failure, Session};
use crate::report::in_words::prediction_table;
use crate::workflow::{PlanInputs, PlannedResection, PredictError, WorkflowError, predict};
use std::path::PathBuf;

/// Before the operation, from one scan and a plan: expected brain shift, how sure it is, where targets will lie
///
/// Example: hgm predict pre.nii.gz -o case --resection plan.nii.gz --head supine --head left --targets targets.fcsv
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Pre-operative T1 (.nii or .nii.gz)
    pre: PathBuf,
    /// The case folder
    #[arg(short, long, value_name = "CASE", default_value = "case")]
    output: PathBuf,
    /// A mask of the tissue that is to be taken, in the scan's grid
    #[arg(long, value_name = "FILE", required_unless_present = "resection_ellipsoid")]
    resection: Option<PathBuf>,
    /// An ellipsoid instead: centre and half axes in mm of the scanner's frame (RAS+)
    #[arg(long, value_name = "X,Y,Z,RX,RY,RZ", conflicts_with = "resection", allow_hyphen_values = true)]
    resection_ellipsoid: Option<String>,
    /// How the head lies: supine, prone, left, right, sitting, or the way down as x,y,z of the scanner (RAS+); again to
    /// compare several [default: supine]
    #[arg(long, value_name = "HOW", allow_hyphen_values = true)]
    head: Vec<String>,
    /// The part of the fluid that will have drained, above 0 to 1, where it can be told [default: not known]
    #[arg(long, value_name = "PART")]
    drained: Option<f64>,
    /// Points whose place is asked for (.csv, .fcsv, .mrk.json), in the scanner's frame
    #[arg(long, value_name = "FILE")]
    targets: Option<PathBuf>,
    /// What counts as a shift, mm [default: 2]
    #[arg(long, value_name = "MM")]
    threshold_mm: Option<f64>,
    /// Draws from the priors for each way of supporting the brain [default: 128]
    #[arg(long, value_name = "N")]
    draws: Option<usize>,
    /// Draws that are also solved whole, to tell how far the others are off [default: 2]
    #[arg(long, value_name = "N")]
    checks: Option<usize>,
    /// 1: the whole brain one material; 2: grey and white matter apart [default: 2]
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=2))]
    tissues: Option<u8>,
    /// A label map of the scan made by another tool (.nii.gz, .mgz): wins over the computed labels
    #[arg(long, value_name = "FILE")]
    dseg: Option<PathBuf>,
    /// Whose numbers the label map holds [default: found out from the numbers]
    #[arg(long, value_name = "freesurfer|synthseg|charm|gif|muse|hgm|FILE.tsv", requires = "dseg")]
    labels: Option<String>,
    /// The pose of the scan by hand: a rigid transform to the MNI frame (4x4 text in RAS, or .tfm)
    #[arg(long, value_name = "FILE")]
    pose: Option<PathBuf>,
    /// A brain mask of your own, in the scan's grid (wins over the computed one)
    #[arg(long, value_name = "FILE")]
    brain_mask: Option<PathBuf>,
    /// A mask of the lateral and third ventricles, in the scan's grid (wins over the computed one)
    #[arg(long, value_name = "FILE")]
    ventricle_mask: Option<PathBuf>,
    #[command(flatten)]
    prior: PriorOptions,
    #[command(flatten)]
    population: PopulationOption,
    #[command(flatten)]
    mesh: MeshOptions,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut flags = Flags::default();
    args.mesh.over(&mut flags);
    args.prior.over(&mut flags);
    args.population.over(&mut flags)?;
    flags.list("predict.heads", &args.head);
    flags.set("predict.drained", args.drained);
    flags.set("predict.threshold_mm", args.threshold_mm);
    flags.set("predict.draws", args.draws);
    flags.set("predict.checks", args.checks);
    flags.set("predict.tissues", args.tissues);
    let resection = match (&args.resection, &args.resection_ellipsoid) {
        (Some(path), _) => PlannedResection::Mask(path.clone()),
        (None, Some(text)) => text.parse().map_err(WorkflowError::Predict)?,
        (None, None) => return Err(WorkflowError::Predict(PredictError::NoPlan).into()),
    };
    let inputs = PlanInputs {
        pre: args.pre.clone(),
        resection,
        targets: args.targets.clone(),
        dseg: args.dseg.clone(),
        labels: args.labels.clone(),
        pose: args.pose.clone(),
        brain_mask: args.brain_mask.clone(),
        ventricle_mask: args.ventricle_mask.clone(),
    };
    let (settings, place) = (session.settings(flags)?, session.place(&args.output));
    let (case, prediction) = predict(&inputs, &place, &settings, &mut session.listener())?;
    session.emit(&prediction, &(prediction_table(&prediction) + &case.page().display().to_string()))?;
    Ok(case.quality_gate()?)
}
