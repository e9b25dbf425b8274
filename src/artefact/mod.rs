//! Files that appear whole or not at all, checksums, manifests, resume.
//!
//! A stage's outputs are each written to a file of its own, `NAME.PROCESS-CALL.part`, and renamed; the manifest comes last, so a stage
//! whose manifest is there is complete. A stage is skipped when its key (inputs + settings + stage version) is the manifest's and
//! every output still has the bytes the manifest names.

mod apart;
mod manifest;
mod reason;
mod signal;
mod stage;
mod write;

pub use apart::{ApartError, check_apart, moments_called_as, named, place};
pub use manifest::{Manifest, OutputRecord, Provenance};
pub use reason::Reason;
pub use signal::{at_signal, end_between_files};
pub use stage::{Produced, Stage, StageError, StageOutcome};
pub use write::{WriteError, check_writable, sha256_hex, write_whole};
