//! How the user's files are read, as part of a stage's settings.

use crate::image::nifti::ReadOptions;
use serde::Serialize;

/// A stage's settings with how the user's files are read: another volume of the same file is another scan.
#[derive(Serialize)]
pub(crate) struct WithReading<'a, S> {
    #[serde(flatten)]
    pub settings: &'a S,
    pub image: ReadOptions,
}
