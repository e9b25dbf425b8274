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
