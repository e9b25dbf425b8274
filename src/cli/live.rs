//! `hgm live CASE|MESH [SCENARIO]`: a body to pull at in the browser, or a recorded session again.

use super::flags::Flags;
use super::session::at_signal;
use super::{Failure, Reject, Session};
use crate::artefact::{check_writable, write_whole};
use crate::live::{Colours, Export, LiveBody, Recording, Series, ServeError, serve};
use crate::workflow::{Resection, Settings, posed_case, posed_mesh, read_text};
use anyhow::{Context, anyhow};
use serde::Serialize;
use std::path::{Path, PathBuf};
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

/// Steps between files of a series: two or three a second of a body of five thousand nodes.
const EVERY: u64 = 30;

/// What `--json` prints.
#[derive(Serialize)]
#[serde(untagged)]
enum Printed {
    Open { address: String },
    Replayed { output: String, files: usize, steps: u64, commands: usize, displacement_max_mm: f64, at_rest: bool },
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let body = body(args, session)?;
    match (&args.replay, &args.output) {
        (Some(file), Some(output)) => replay(&body, file, (output, args.every), session),
        _ => open(&body, args, session),
    }
}

fn body(args: &Args, session: &Session) -> Result<LiveBody, Failure> {
    let folder = args.body.is_dir();
    if folder && args.scenario.is_some() {
        return Err(anyhow!("{}: a case brings its own scenario; leave SCENARIO out", args.body.display())).reject();
    }
    if args.before_resection && !folder {
        return Err(anyhow!(
            "{}: --before-resection is for the folder of a case; a mesh has its resected tissue where it has label 5",
            args.body.display()
        ))
        .reject();
    }
    let settings: Settings =
        if folder { session.settings_of(&args.body, Flags::default())? } else { session.settings(Flags::default())? };
    let posed = if folder {
        let resection = if args.before_resection { Resection::Undone } else { Resection::Done };
        posed_case(&session.place(&args.body), &settings, resection, &mut session.listener())?
    } else {
        posed_mesh(&args.body, args.scenario.as_deref(), &settings)?
    };
    Ok(LiveBody::of(posed, &settings.prior))
}

fn open(body: &LiveBody, args: &Args, session: &Session) -> Result<(), Failure> {
    if let Some(file) = &args.record {
        check_writable(file)?;
    }
    let server = match serve(body, args.port, args.record.is_some()) {
        Ok(server) => server,
        Err(ServeError::Fem(source)) => return Err(anyhow!("{}: {source}", args.body.display())).reject(),
        Err(error @ ServeError::Port { .. }) => return Err(error).reject(),
        Err(error) => return Err(anyhow!(error).into()),
    };
    at_signal(server.stopper());
    let address = server.address();
    session.emit(&Printed::Open { address: address.clone() }, &format!("{address}\nCtrl-C ends it"))?;
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

fn replay(
    body: &LiveBody,
    file: &Path,
    (output, every): (&Path, Option<u64>),
    session: &Session,
) -> Result<(), Failure> {
    check_writable(output)?;
    let in_series = output.extension().is_some_and(|e| e.eq_ignore_ascii_case("pvd"));
    if every.is_some() && !in_series {
        return Err(anyhow!("{}: --every is for a series; name a .pvd file", output.display())).reject();
    }
    let name = || file.display().to_string();
    let recording = Recording::from_text(&read_text(file)?).with_context(name).reject()?;
    let bar = session.progress(recording.steps, "steps");
    let stem = output.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let mut series = Series::new(&stem, every.unwrap_or(EVERY));
    let mut colours = None;
    let write = |(name, bytes): (String, Vec<u8>)| write_whole(&output.with_file_name(name), &bytes);
    // The first that cannot be made or written.
    let mut failed: Option<anyhow::Error> = None;
    let replayed = recording.replay(body, &mut |seen| {
        bar.set_position(seen.steps());
        let colours = &*colours.get_or_insert_with(|| Colours::of(body, seen.mesh()));
        if in_series && failed.is_none() {
            let due = series.due(seen, colours).map_err(|reason| anyhow!(reason));
            failed = due.and_then(|due| Ok(due.map_or(Ok(()), write)?)).err();
        }
    });
    let replayed = replayed.with_context(name).reject()?;
    bar.finish_and_clear();
    if let Some(error) = failed {
        return Err(error.into());
    }
    let colours = colours.unwrap_or_else(|| Colours::of(body, replayed.mesh()));
    if in_series {
        write(series.last(&replayed, &colours).map_err(|reason| anyhow!(reason))?)?;
        write_whole(output, &series.list())?;
    } else {
        let state = Export::of(&replayed).map(|state| state.coloured(&replayed, &colours));
        write_whole(output, &state.and_then(|state| state.vtu()).map_err(|reason| anyhow!(reason))?)?;
    }
    let files = if in_series { series.len() } else { 1 };
    let largest = replayed.displacement_mm().iter().map(|u| u.iter().map(|x| x * x).sum::<f64>()).fold(0.0, f64::max);
    let displacement_max_mm = largest.sqrt();
    let (steps, commands, at_rest) = (replayed.steps(), recording.commands.len(), replayed.is_at_rest());
    let text = format!(
        "{}: {commands} commands, {steps} steps, moved by {displacement_max_mm:.3} mm at most",
        output.display()
    );
    let output = output.display().to_string();
    session.emit(&Printed::Replayed { output, files, steps, commands, displacement_max_mm, at_rest }, &text)
}
