//! Stage `labels`: a phantom's labels are the template's; there is nothing to write.

use crate::artefact::Produced;
use crate::segment::atlas;
use crate::workflow::error::WorkflowError;
use crate::workflow::stage_name::StageName;
use crate::workflow::work::{Made, Work};

/// Raised when the stage's code changes its result.
const VERSION: u32 = 4;
const NAME: StageName = StageName::Labels;

/// Notes which template the phantom stands on.
pub(crate) fn labels(work: &Work<'_>, made: &mut Made) -> Result<(), WorkflowError> {
    let stage = work.stage(made, &NAME, VERSION, &()).input("atlas", &atlas::template().labels.data);
    work.run(made, &NAME, &stage, || Ok(Produced::default()))
}
