//! Names of the Neuromorphometrics cortex that MUSE and GIF share.

/// Offset of the right gyrus from the first cortical number (100 in MUSE, 101 in GIF) and its abbreviation; the left one
/// has the next number.
pub(super) const CORTEX: [(u32, &str); 49] = [
    (0, "ACgG"),
    (2, "AIns"),
    (4, "AOrG"),
    (6, "AnG"),
    (8, "Calc"),
    (12, "CO"),
    (14, "Cun"),
    (16, "Ent"),
    (18, "FO"),
    (20, "FRP"),
    (22, "FuG"),
    (24, "GRe"),
    (28, "IOG"),
    (32, "ITG"),
    (34, "LiG"),
    (36, "LOrG"),
    (38, "MCgG"),
    (40, "MFC"),
    (42, "MFG"),
    (44, "MOG"),
    (46, "MOrG"),
    (48, "MPoG"),
    (50, "MPrG"),
    (52, "MSFG"),
    (54, "MTG"),
    (56, "OCP"),
    (60, "OFuG"),
    (62, "OpIFG"),
    (64, "OrIFG"),
    (66, "PCgG"),
    (68, "PCu"),
    (70, "PHG"),
    (72, "PIns"),
    (74, "PO"),
    (76, "PoG"),
    (78, "POrG"),
    (80, "PP"),
    (82, "PrG"),
    (84, "PT"),
    (86, "SCA"),
    (90, "SFG"),
    (92, "SMC"),
    (94, "SMG"),
    (96, "SOG"),
    (98, "SPL"),
    (100, "STG"),
    (102, "TMP"),
    (104, "TrIFG"),
    (106, "TTG"),
];

/// Both gyri of every pair, numbered from `first`.
pub(super) fn gyri(first: u32) -> impl Iterator<Item = (u32, String)> {
    CORTEX.into_iter().flat_map(move |(offset, name)| {
        [(first + offset, format!("Right {name}")), (first + offset + 1, format!("Left {name}"))]
    })
}
