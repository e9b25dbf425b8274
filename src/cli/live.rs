//! `hgm live CASE|MESH [SCENARIO]`: a body to pull at in the browser, or a recorded session again.

use super::{Failure, Session};
use crate::artefact::{at_signal, write_whole};
use crate::live::{LiveBody, check_output, replay_to_files, serve};
use crate::workflow::{BodySource, Layer, Resection, posed_case, posed_mesh};
use anyhow::anyhow;
use serde_json::json;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// Pull at the brain in a browser while the solver runs
///
/// Opens a case (the folder of another command) or a mesh with a scenario, prints an address of this machine and opens it:
/// drag tissue, change stiffness, law, gravity, fluid, supports, cut through, and save the state as a scenario that `hgm
/// simulate` repeats. Only this machine can reach it, and only with the address. Ctrl-C ends it.
///
/// Example: hgm live case
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of a case, or a tetrahedral mesh with labels and sets (.vtu or .msh)
    body: PathBuf,
    /// Materials, loads, held sets of a mesh (TOML) [default: the prior's means, held at base and falx]
    scenario: Option<PathBuf>,
    /// Open a case with the resected tissue still in it, so that it can be taken out and put back; it is meshed for that first
    #[arg(long, conflicts_with = "scenario")]
    before_resection: bool,
    /// Port of the loopback address [default: any that is free]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Only print the address
    #[arg(long)]
    no_browser: bool,
    /// Keep what is done, with the step it was done at
    #[arg(long, value_name = "FILE", conflicts_with = "replay")]
    record: Option<PathBuf>,
    /// Do again what a file of --record holds, without a page, and write the state at its end (OUT.vtu) or on its way (OUT.pvd)
    #[arg(long, value_name = "FILE", requires = "output")]
    replay: Option<PathBuf>,
    /// Where --replay writes: the state at the end (.vtu), or a series for ParaView (.pvd, its files beside it)
    #[arg(short, long, value_name = "OUT", requires = "replay")]
    output: Option<PathBuf>,
    /// Steps from one file of a series to the next [default: 30]
    #[arg(long, value_name = "N", requires = "replay", value_parser = clap::value_parser!(u64).range(1..))]
    every: Option<u64>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let given = [Some(&args.body), args.scenario.as_ref(), args.replay.as_ref()];
    let made_of: Vec<_> = given.into_iter().flatten().map(PathBuf::as_path).collect();
    args.record.iter().chain(&args.output).try_for_each(|file| check_output(file, &made_of))?;
    let body = body(args, session)?;
    match (&args.replay, &args.output) {
        (Some(file), Some(output)) => {
            let replayed = replay_to_files(file, &body, (output, args.every), &mut *session.listener())?;
            session.emit(&replayed, &replayed.in_words())
        }
        _ => open(&body, args, session),
    }
}

fn body(args: &Args, session: &Session) -> Result<LiveBody, Failure> {
    let resection = if args.before_resection { Resection::Undone } else { Resection::Done };
    let (settings, posed) = match BodySource::at(&args.body, args.scenario.clone(), resection)? {
        BodySource::Case(resection) => {
            let settings = session.settings_of(&args.body, Layer::default())?;
            let posed = posed_case(&session.place(&args.body), &settings, resection, &mut *session.listener())?;
            (settings, posed)
        }
        BodySource::Mesh(scenario) => {
            let settings = session.settings(Layer::default())?;
            let posed = posed_mesh(&args.body, scenario.as_deref(), &settings)?;
            (settings, posed)
        }
    };
    Ok(LiveBody::of(posed, &settings.prior))
}

fn open(body: &LiveBody, args: &Args, session: &Session) -> Result<(), Failure> {
    let server = serve(body, args.port, args.record.is_some())?;
    at_signal(server.stopper());
    let address = server.address();
    session.emit(&json!({ "address": address }), &format!("{address}\nCtrl-C ends it"))?;
    if !args.no_browser {
        // Without a browser the printed address serves.
        Command::new("xdg-open").arg(&address).stdout(Stdio::null()).stderr(Stdio::null()).spawn().ok();
    }
    let driven = server.wait().ok_or_else(|| anyhow!("the solver's thread has ended early"))?;
    tracing::info!("{} steps, {} frames", driven.measured.steps, driven.measured.frames);
    if let Some(file) = &args.record {
        write_whole(file, driven.recording.to_text().as_bytes())?;
    }
    Ok(())
}
