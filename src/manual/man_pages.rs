//! Man pages, one per command.

use clap::Command;

/// The page of a command, then those of its subcommands, with their names: hgm, hgm-gp, hgm-gp-fit.
///
/// # Errors
/// As a page is written to memory: none.
pub fn pages(mut command: Command, name: &str) -> std::io::Result<Vec<(String, Vec<u8>)>> {
    // Only then has a command what its parents hand down: common options, and its whole name in the synopsis.
    command.build();
    let subcommands: Vec<Command> = command.get_subcommands().filter(|sub| sub.get_name() != "help").cloned().collect();
    let mut page = Vec::new();
    clap_mangen::Man::new(command.name(name.to_owned().leak() as &'static str)).render(&mut page)?;
    let mut all = vec![(name.to_owned(), page)];
    for subcommand in subcommands {
        let name = format!("{name}-{}", subcommand.get_name());
        all.extend(pages(subcommand, &name)?);
    }
    Ok(all)
}
