//! What a case folder holds: one table of its files, each with what it is, the frame it is in, who makes it and what the
//! Brain Imaging Data Structure (BIDS) calls it. Nothing else in the program spells a path of a case.

mod bids;
mod family;
mod file;
mod table;

pub use bids::{BidsName, Scan, TEMPLATE};
pub use family::Family;
pub use file::{Entry, Maker, Space};
pub use table::{
    BEST_ERRORS, BEST_SURFACE, CAVITY, CAVITY_FOR_SLICER, COMPARISON, ESTIMATE_JSON, ESTIMATE_STATE, LABELS_FOR_SLICER,
    LOCK, MNI_FROM_PRE_ITK, MNI_FROM_PRE_TEXT, NATIVE_CAVITY, NATIVE_RESECTED, OUTCOME, PAGE, POST_BRAIN,
    POST_NATIVE_BRAIN, POST_T1, POST_VENTRICLE, PRE_BRAIN, PRE_FROM_POST_ITK, PRE_FROM_POST_TEXT, PRE_LABELS,
    PRE_NATIVE_BRAIN, PRE_NATIVE_LABELS, PRE_T1, PROVENANCE, REFERENCE_STATE, REFERENCE_SURFACE, REFUSED_PICTURE,
    RESECTED, REST_GMSH, REST_MESH, REST_SURFACE, SAG, SAMPLE_STATE, SAMPLES_SERIES, SAMPLES_TABLE, SETTINGS, TABLE,
    TEMPLATE_DISPLACEMENT,
};
