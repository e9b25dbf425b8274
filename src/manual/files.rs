//! The files of a case, from the table of them.

use crate::layout::{Entry, TABLE};
use serde_json::{Value, json};

/// Every file with all that is known of it.
pub fn list() -> Vec<Value> {
    let file = |file: &Entry| {
        let bids = file.bids.map(|bids| bids.spelt());
        json!({"path": file.path, "what": file.what, "space": file.space, "maker": file.maker, "bids": bids})
    };
    TABLE.iter().map(file).collect()
}

/// A line for each file.
pub fn lines() -> String {
    let line = |file: &Entry| format!("{:<55} {}\n", file.path, file.what);
    TABLE.iter().map(line).collect()
}
