//! The frames a point can live in.

/// A coordinate frame, RAS+ in millimetres. Frames are types without values.
pub trait Frame: Copy + std::fmt::Debug + Send + Sync + 'static {
    /// The frame's name in manifests and file names.
    const NAME: &'static str;
}

/// Scanner coordinates of the pre-operative image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pre;
/// Scanner coordinates of the post-operative image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Post;
/// The MNI152NLin2009aSym template's frame. Patients reach it rigidly: sizes stay the patient's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mni;
/// Scanner coordinates of an image whose role is not known (yet): what the NIfTI reader returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Native;

impl Frame for Pre {
    const NAME: &'static str = "pre";
}
impl Frame for Post {
    const NAME: &'static str = "post";
}
impl Frame for Mni {
    const NAME: &'static str = "MNI";
}
impl Frame for Native {
    const NAME: &'static str = "native";
}
