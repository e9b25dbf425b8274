//! `hgm predict`: before the operation, how the brain will move.

use super::flags::{MASKS, MeshOptions, OwnLabels, PopulationOption, PriorOptions};
use super::{Failure, Session};
use crate::layout::PLANS_PAGE;
use crate::report::forecast_in_words::plans_table;
use crate::report::in_words::prediction_table;
use crate::workflow::{Case, Layer, PlanInputs, PlannedResection, predict, predict_plans};
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
    /// The tissue that is to be taken: a mask in the scan's grid, or a closed surface in the scanner's frame (mm, RAS+; .stl,
    /// .surf.gii, .ply). Again, or with the two below, for several plans: compared, the one that moves least named
    #[arg(long, value_name = "FILE", required_unless_present_any = ["resection_label", "resection_ellipsoid"])]
    resection: Vec<PathBuf>,
    /// A label of the label map (--dseg), by its number there; several with commas are taken together
    #[arg(long, value_name = "N[,N]", requires = "dseg", allow_hyphen_values = true)]
    resection_label: Vec<String>,
    /// An ellipsoid: centre and half axes in mm of the scanner's frame (RAS+)
    #[arg(long, value_name = "X,Y,Z,RX,RY,RZ", allow_hyphen_values = true)]
    resection_ellipsoid: Vec<String>,
    /// How the head lies: supine, prone, left, right, sitting, or the way down as x,y,z of the scanner (RAS+); again to
    /// compare several [default: supine]
    #[arg(long, value_name = "HOW", allow_hyphen_values = true)]
    head: Vec<String>,
    /// The part of the fluid that will have drained, above 0 to 1, where it can be told [default: not known]
    #[arg(long, value_name = "PART")]
    drained: Option<f64>,
    /// How far below the brain's highest point the fluid will stand, mm along gravity of the way the head lies, where that is known
    /// instead: 0 where the brain is just covered [default: not known]
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    fluid_below: Option<f64>,
    /// Draws Poisson's ratio as well: standard deviation of ln(lambda / mu); 0.7 for 0.35 to 0.49 around 0.45
    /// [default: taken as known]
    #[arg(long, value_name = "SD", allow_hyphen_values = true)]
    poisson_log_sd: Option<f64>,
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
    #[command(flatten)]
    own: OwnLabels,
    /// A mask of the lateral and third ventricles, in the scan's grid (wins over the computed one)
    #[arg(long, help_heading = MASKS, value_name = "FILE")]
    ventricle_mask: Option<PathBuf>,
    #[command(flatten)]
    prior: PriorOptions,
    #[command(flatten)]
    population: PopulationOption,
    #[command(flatten)]
    mesh: MeshOptions,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut flags = Layer::default();
    args.mesh.over(&mut flags);
    args.prior.over(&mut flags);
    args.population.over(&mut flags)?;
    flags.list("predict.heads", &args.head);
    flags.set("predict.drained", args.drained);
    flags.set("predict.fluid_level.below_top_mm", args.fluid_below);
    flags.set("predict.poisson_log_sd", args.poisson_log_sd);
    flags.set("predict.threshold_mm", args.threshold_mm);
    flags.set("predict.draws", args.draws);
    flags.set("predict.checks", args.checks);
    flags.set("predict.tissues", args.tissues);
    let mut plans = PlannedResection::all(&args.resection, &args.resection_label, &args.resection_ellipsoid)?;
    let (settings, place) = (session.settings(flags)?, session.place(&args.output));
    let OwnLabels { dseg, labels, pose, pose_start, brain_mask } = args.own.clone();
    let (pre, resection, targets) = (args.pre.clone(), plans.remove(0), args.targets.clone());
    let ventricle_mask = args.ventricle_mask.clone();
    let inputs = PlanInputs { pre, resection, targets, dseg, labels, pose, pose_start, brain_mask, ventricle_mask };
    if plans.is_empty() {
        let (case, prediction) = predict(&inputs, &place, &settings, &mut *session.listener())?;
        session.emit(&prediction, &(prediction_table(&prediction) + &case.page().display().to_string()))?;
        return Ok(case.quality_gate()?);
    }
    let (cases, comparison) = predict_plans(&inputs, &plans, &place, &settings, &mut *session.listener())?;
    let page = args.output.join(PLANS_PAGE);
    session.emit(&comparison, &(plans_table(&comparison) + &page.display().to_string()))?;
    Ok(cases.iter().try_for_each(Case::quality_gate)?)
}
