//! `hgm layout`: the files of a case.

use super::{Failure, Session};
use crate::layout::TABLE;

/// Print every file a case holds: what it is, the frame it is in, who makes it, its name in BIDS derivatives
///
/// Example: hgm layout --json
#[derive(Debug, clap::Args)]
pub struct Args {}

pub fn run(_args: &Args, session: &Session) -> Result<(), Failure> {
    let files: Vec<_> = TABLE
        .iter()
        .map(|file| {
            let bids = file.bids.map(|bids| bids.spelt());
            serde_json::json!({
                "path": file.path, "what": file.what, "space": file.space, "maker": file.maker, "bids": bids,
            })
        })
        .collect();
    let text: String = TABLE.iter().map(|file| format!("{:<55} {}\n", file.path, file.what)).collect();
    session.emit(&serde_json::json!({ "files": files }), &text)
}
