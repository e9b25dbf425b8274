//! What the program says of itself, made of the plain description of its command line (`clap::Command`), of its settings and of
//! its files: help by task, man pages, the reference pages of the documentation, the descriptor of the BIDS App, the JSON
//! Schema of results. The description is handed in by `cli`, which parses by it.

pub mod boutiques;
pub mod cohort_commands;
pub mod files;
pub mod help;
pub mod man_pages;
pub mod markdown;
pub mod schema;

/// What the program can say of its command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Form {
    /// Man pages, one per command
    Man,
    /// Commands, settings and files of a case as Markdown
    Markdown,
    /// `hgm bids` as a Boutiques descriptor
    Boutiques,
}

impl Form {
    /// The files that say it, with their names.
    ///
    /// # Errors
    /// As a page is written to memory: none.
    pub fn pages(self, hgm: clap::Command) -> std::io::Result<Vec<(String, Vec<u8>)>> {
        Ok(match self {
            Self::Man => {
                man_pages::pages(hgm, "hgm")?.into_iter().map(|(name, page)| (format!("{name}.1"), page)).collect()
            }
            Self::Markdown => markdown::pages(hgm),
            Self::Boutiques => boutiques::descriptor(&hgm).into_iter().collect(),
        })
    }
}
