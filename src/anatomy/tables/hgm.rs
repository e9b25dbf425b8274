//! hgm's own numbers.

use crate::anatomy::label;
use crate::anatomy::table::{LabelTable, Tissue};

pub(super) fn table() -> LabelTable {
    let structures = Tissue::ALL.map(|t| (u32::from(t.label()), t.name().to_owned(), t));
    let needed: [&[u32]; 2] = [&[u32::from(label::GREY_MATTER)], &[u32::from(label::WHITE_MATTER)]];
    LabelTable::new(
        "hgm",
        "the label maps of `hgm segment` and `hgm prep`",
        "src/anatomy/label.rs",
        structures,
        &needed,
    )
}
