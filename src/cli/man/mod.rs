//! `hgm man`: the program's description of itself, from the command line's own definition: man pages, the reference pages
//! of the documentation, and the descriptor of the BIDS App.

mod boutiques;
mod markdown;

use super::{Failure, Session};
use crate::artefact::write_whole;
use std::path::PathBuf;

/// Write man pages, one per command; or the reference pages of the documentation, or the descriptor of the BIDS App
///
/// Example: hgm man -o ~/.local/share/man/man1
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder to write into
    #[arg(short, long, default_value = "man")]
    output: PathBuf,
    /// What to write
    #[arg(long, value_enum, value_name = "FORM", default_value = "man")]
    form: Form,
}

/// What `hgm man` writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Form {
    /// Man pages, one per command
    Man,
    /// Commands, settings and files of a case as Markdown
    Markdown,
    /// `hgm bids` as a Boutiques descriptor
    Boutiques,
}

pub fn run(args: &Args, hgm: clap::Command, session: &Session) -> Result<(), Failure> {
    let written = match args.form {
        Form::Man => pages(hgm, "hgm")?.into_iter().map(|(name, page)| (format!("{name}.1"), page)).collect(),
        Form::Markdown => markdown::pages(hgm),
        Form::Boutiques => boutiques::descriptor(&hgm).into_iter().collect::<Vec<_>>(),
    };
    let mut files = Vec::new();
    for (name, text) in written {
        let file = args.output.join(name);
        write_whole(&file, &text)?;
        files.push(file.display().to_string());
    }
    session.emit(&serde_json::json!({ "files": files }), "")
}

/// The page of a command, then those of its subcommands: hgm, hgm-gp, hgm-gp-fit.
fn pages(command: clap::Command, name: &str) -> std::io::Result<Vec<(String, Vec<u8>)>> {
    let subcommands: Vec<clap::Command> = command.get_subcommands().cloned().collect();
    let mut page = Vec::new();
    clap_mangen::Man::new(command.name(name.to_owned().leak() as &'static str)).render(&mut page)?;
    let mut all = vec![(name.to_owned(), page)];
    for subcommand in subcommands {
        let name = format!("{name}-{}", subcommand.get_name());
        all.extend(pages(subcommand, &name)?);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Hgm, manual};
    use clap::CommandFactory;

    #[test]
    fn every_command_and_subcommand_has_a_page_with_an_example() {
        let pages = pages(manual::command(Hgm::command()), "hgm").unwrap();
        assert!(pages.iter().any(|(name, _)| name == "hgm-gp-fit"));
        for (name, page) in &pages[1..] {
            let page = String::from_utf8(page.clone()).unwrap();
            assert!(page.contains("Example: "), "{name} has no example");
            assert!(page.contains("input rejected") && page.contains("NO_COLOR"), "{name} tells no exit codes");
        }
    }
}
