//! Why a file that was given cannot be used.

use std::fmt;
use std::path::PathBuf;
use thiserror::Error;

/// A mask of the user's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaskRole {
    /// The brain.
    Brain,
    /// Lateral and third ventricles.
    Ventricle,
    /// The cavity.
    Cavity,
    /// The resected tissue.
    Resected,
    /// Labels of the pre-operative scan.
    Labels,
    /// The pose of the pre-operative scan.
    Pose,
    /// Where its pose is looked for.
    PoseStart,
}

impl MaskRole {
    /// Every one; a stage's manifest names its inputs by them.
    pub(crate) const ALL: [Self; 7] =
        [Self::Brain, Self::Ventricle, Self::Cavity, Self::Resected, Self::Labels, Self::Pose, Self::PoseStart];

    /// Whether a mask lies on the post-operative scan, by whose grid it has (before, after); `None` where it has neither. Where both
    /// scans have it: the cavity is there after the operation alone, all else is drawn on the scan before.
    pub(crate) fn scan_of(self, on: [bool; 2]) -> Option<bool> {
        match on {
            [true, true] => Some(self == Self::Cavity),
            [false, false] => None,
            [_, after] => Some(after),
        }
    }
}

impl fmt::Display for MaskRole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Brain => "brain mask",
            Self::Ventricle => "ventricle mask",
            Self::Cavity => "cavity mask",
            Self::Resected => "resected mask",
            Self::Labels => "label map",
            Self::Pose => "pose",
            Self::PoseStart => "start of the pose",
        })
    }
}

/// Why a file that was given cannot be used.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum InputError {
    #[error("{}: is a folder; name a file", path.display())]
    Folder { path: PathBuf },
    #[error("{}: cannot be read; check the path: {source}", path.display())]
    Unreadable { path: PathBuf, source: std::io::Error },
    #[error("{}: not UTF-8 text; save the file as UTF-8", path.display())]
    NotText { path: PathBuf },
    #[error(
        "{} and {}: the two files are the same; give the pre-operative scan first, the post-operative second",
        pre.display(), post.display()
    )]
    SameFile { pre: PathBuf, post: PathBuf },
    #[error(
        "{} and {}: the two scans have the same voxels; the post-operative one must show the surgery: give another file",
        pre.display(), post.display()
    )]
    SameVoxels { pre: PathBuf, post: PathBuf },
    #[error(
        "a {role} was given beside a label map, which says where brain and ventricles are and would win: leave one of the two out, or \
         draw the mask into the map"
    )]
    BesideLabels { role: MaskRole },
    #[error(
        "{role} {name}: its grid ({} voxels) is that of neither scan (pre-operative {}, post-operative {}){}; resample \
         the mask onto one of them",
        size(*found), size(*pre), size(*post),
        if [pre, post].contains(&found) { ": it lies elsewhere" } else { "" }
    )]
    MaskGrid { role: MaskRole, name: String, found: [usize; 3], pre: [usize; 3], post: [usize; 3] },
    #[error(
        "{}: the mask's grid ({} voxels) is not its image's ({}) or lies elsewhere; resample it onto the image",
        path.display(), size(*found), size(*image)
    )]
    ImageGrid { path: PathBuf, found: [usize; 3], image: [usize; 3] },
}

fn size([x, y, z]: [usize; 3]) -> String {
    format!("{x} x {y} x {z}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_of_roles_leaves_none_out() {
        let after = |role: MaskRole| match role {
            MaskRole::Brain => Some(MaskRole::Ventricle),
            MaskRole::Ventricle => Some(MaskRole::Cavity),
            MaskRole::Cavity => Some(MaskRole::Resected),
            MaskRole::Resected => Some(MaskRole::Labels),
            MaskRole::Labels => Some(MaskRole::Pose),
            MaskRole::Pose => Some(MaskRole::PoseStart),
            MaskRole::PoseStart => None,
        };
        let all: Vec<MaskRole> = std::iter::successors(Some(MaskRole::Brain), |role| after(*role)).collect();
        assert_eq!(all, MaskRole::ALL);
    }

    #[test]
    fn a_mask_on_the_grid_of_both_scans_lies_where_its_role_says() {
        assert_eq!(MaskRole::Cavity.scan_of([true, true]), Some(true));
        assert_eq!(MaskRole::Resected.scan_of([true, true]), Some(false));
        for role in [MaskRole::Cavity, MaskRole::Ventricle] {
            let by_grid = [[true, false], [false, true], [false, false]].map(|on| role.scan_of(on));
            assert_eq!(by_grid, [Some(false), Some(true), None]);
        }
    }
}
