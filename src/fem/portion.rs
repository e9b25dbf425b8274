//! A part of a cell, as elements are made of it.

/// The part of a cell that one material fills.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Portion {
    pub cell: u32,
    pub material: u16,
    /// Part of the cell's volume; those of a cell sum to one.
    pub share: f64,
}
