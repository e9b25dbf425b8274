//! The maps of points that a case, or a field of the user's own, stands for.

use super::case::Case;
use super::error::{CaseError, WorkflowError};
use super::facts::MeshFacts;
use super::made_files::MadeFiles;
use super::settings::Settings;
use super::stage_name::{StageName, Subject};
use super::stages::{Believed, CaseShift, FUSED, OBSERVED, brain_shift, grid_of, lesions, transforms};
use crate::artefact::Reason;
use crate::experiment::field::{ShiftField, carried, inverse};
use crate::geometry::{AffineTransform, Frame, Native, Position, Post, Pre};
use crate::image::nifti::{self, ReadOptions, decode_displacement};
use crate::image::{Grid, Mask, Volume};
use crate::layout::{
    ESTIMATE_STATE, MNI_FROM_PRE_TEXT, NATIVE_RESECTED, OUTCOME, POST_FROM_PRE_FIELD, POST_NATIVE_BRAIN,
    PRE_FROM_POST_FIELD, PRE_FROM_POST_TEXT, PRE_NATIVE_BRAIN, SHIFT, SHIFT_BACK, SHIFT_JSON, SHIFT_MASK, SHIFT_SD,
};
use crate::overlay::{Carried, PointState};
use crate::segment::atlas;
use serde::Deserialize;

/// Where something of a patient is carried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum WarpTo {
    /// From the pre-operative scan to the post-operative one.
    Post,
    /// From the pre-operative scan to the deformed state, in the pre-operative scan's frame.
    Deformed,
    /// From the post-operative scan back to the pre-operative one.
    Pre,
    /// From the pre-operative scan to MNI space: a rigid motion, without any brain shift.
    Mni,
}

/// A map of points with what is known of them. All frames are that of what is carried, or of where it goes.
#[derive(Debug)]
pub(crate) struct Map {
    /// Displacement of points, mm; `None` for a rigid motion alone.
    forward: Option<Volume<[f32; 3], Native>>,
    /// The same for images: from where they go back to where they were.
    back: Option<Volume<[f32; 3], Native>>,
    /// The rigid part alone, of points.
    rigid: AffineTransform<Native, Native>,
    /// Standard deviation, mm, in the pre-operative scan's frame.
    sd: Option<Volume<f32, Native>>,
    /// Where the displacement is believed, in the same frame.
    believed: Option<Mask<Native>>,
    /// The tissue that was taken, in the same frame.
    resected: Option<Mask<Native>>,
    /// Whether the pre-operative scan is where points arrive.
    backwards: bool,
    /// Where images go.
    pub grid: Option<Grid<Native>>,
}

/// Which part of a map is needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    Points,
    Images,
}

fn native<T: Copy, F: Frame>(volume: Volume<T, F>) -> Volume<T, Native> {
    volume.relabelled()
}

impl Map {
    /// A field of the user's own: it moves points; images go through its inverse.
    pub fn of_field(field: Volume<[f32; 3], Native>, part: Part) -> Self {
        let back = (part == Part::Images).then(|| inverse(&field));
        Self { forward: Some(field), back, ..Self::still() }
    }

    /// The map of a case in a state.
    pub fn of_case(case: &Case, state: Option<&str>, to: WarpTo, part: Part) -> Result<(Self, String), WorkflowError> {
        let made = MadeFiles::of(case);
        for file in [PRE_FROM_POST_TEXT, MNI_FROM_PRE_TEXT] {
            made.read(file)?;
        }
        let (pre_from_post, mni_from_pre) = transforms(case)?;
        if to == WarpTo::Mni {
            // No state moves what goes to MNI space; a name that is none's is refused all the same.
            if state.is_some() {
                named_state(case, state)?;
            }
            let rigid = AffineTransform::from_matrix(&mni_from_pre.to_matrix());
            let map = Self { forward: None, rigid, grid: Some(atlas::template().grid().relabelled()), ..Self::still() };
            return Ok((map, "rigid".to_owned()));
        }
        let state = named_state(case, state)?;
        let (points, images) = match to {
            WarpTo::Post => (POST_FROM_PRE_FIELD, PRE_FROM_POST_FIELD),
            WarpTo::Pre => (PRE_FROM_POST_FIELD, POST_FROM_PRE_FIELD),
            WarpTo::Deformed | WarpTo::Mni => (SHIFT, SHIFT_BACK),
        };
        let family = if part == Part::Points { points } else { images };
        let file = family.of(&state);
        let options = ReadOptions::default();
        let mask_of = |file: &str| -> Result<Mask<Native>, WorkflowError> {
            let (mask, _) = nifti::decode_labels(&made.read(file)?, file, &options)?;
            Ok(mask.map(|l| l > 0))
        };
        let taken = || mask_of(NATIVE_RESECTED);
        let ((field, sd, believed), taken) = if case.path(&file).exists() {
            let vectors = || -> Result<_, WorkflowError> { Ok(decode_displacement(&made.read(&file)?, &file)?) };
            let others = || -> Result<_, WorkflowError> {
                let of = SHIFT_SD.of(&state);
                let sd = (part == Part::Points).then(|| -> Result<_, WorkflowError> {
                    Ok(nifti::decode_intensities(&made.read(&of)?, &of, &options)?.0)
                });
                Ok((sd.transpose()?, mask_of(&SHIFT_MASK.of(&state))?, taken()?))
            };
            let (field, others) = rayon::join(vectors, others);
            let (sd, mask, taken) = others?;
            ((field?, sd, mask), taken)
        } else {
            made.check()?;
            (computed(case, &state, family, to)?, taken()?)
        };
        let rigid = match to {
            WarpTo::Post => pre_from_post.inverse().to_matrix(),
            WarpTo::Pre => pre_from_post.to_matrix(),
            WarpTo::Deformed | WarpTo::Mni => nalgebra::Matrix4::identity(),
        };
        let grid: Grid<Native> = match to {
            WarpTo::Post => grid_of::<Post>(case, POST_NATIVE_BRAIN)?.relabelled(),
            _ => grid_of::<Pre>(case, PRE_NATIVE_BRAIN)?.relabelled(),
        };
        let (forward, back) = if part == Part::Points { (Some(field), None) } else { (None, Some(field)) };
        let map = Self {
            forward,
            back,
            rigid: AffineTransform::from_matrix(&rigid),
            sd,
            believed: Some(believed),
            resected: Some(taken),
            backwards: to == WarpTo::Pre,
            grid: Some(grid),
        };
        Ok((map, state))
    }

    fn still() -> Self {
        Self {
            forward: None,
            back: None,
            rigid: AffineTransform::identity(),
            sd: None,
            believed: None,
            resected: None,
            backwards: false,
            grid: None,
        }
    }

    /// Carries a point (mm). Its standard deviation is told in tissue alone: elsewhere nothing is believed of the field.
    pub fn carry(&self, x_mm: [f64; 3]) -> Carried {
        let x = Position::new(x_mm[0], x_mm[1], x_mm[2]);
        let rigid: [f64; 3] = self.rigid.apply(x).mm.into();
        let Some(field) = &self.forward else {
            return Carried { mm: rigid, sd_mm: None, state: PointState::Rigid };
        };
        let Some(mm) = carried(field, x_mm) else {
            return Carried { mm: rigid, sd_mm: None, state: PointState::Outside };
        };
        let at_rest = if self.backwards { Position::new(mm[0], mm[1], mm[2]) } else { x };
        let is = |mask: &Option<Mask<Native>>| mask.as_ref().map(|mask| mask.nearest(at_rest) == Some(true));
        if is(&self.resected) == Some(true) {
            return Carried { mm: rigid, sd_mm: None, state: PointState::Removed };
        }
        let still = (0..3).all(|a| (mm[a] - rigid[a]).abs() < 2e-3);
        let state = match is(&self.believed) {
            Some(true) => PointState::Tissue,
            None => PointState::Moved,
            Some(false) if still => PointState::Outside,
            Some(false) => PointState::Fluid,
        };
        // Of the very voxel that says it is tissue: those beside it that were taken hold 0, and those of fluid a continuation.
        let sd_mm = self.sd.as_ref().filter(|_| state == PointState::Tissue).and_then(|sd| sd.nearest(at_rest));
        Carried { mm, sd_mm: sd_mm.map(f64::from), state }
    }

    /// Where the place of an image at a point (mm) was before it was carried.
    pub fn source(&self, y: Position<Native>) -> Option<Position<Native>> {
        match &self.back {
            None => self.rigid.inverse().ok().map(|back| back.apply(y)),
            Some(field) => carried(field, y.mm.into()).map(|x| Position::new(x[0], x[1], x[2])),
        }
    }

    /// Whether the image at a point was taken: `from` where it was, `to` where it is.
    pub fn removed(&self, from: Position<Native>, to: Position<Native>) -> bool {
        let at_rest = if self.backwards { to } else { from };
        self.resected.as_ref().is_some_and(|mask| mask.nearest(at_rest) == Some(true))
    }
}

/// The state of a case that is meant where none is named: the estimate, else the best sample.
///
/// # Errors
/// A case without any.
pub fn default_state(case: &Case) -> Result<String, WorkflowError> {
    named_state(case, None)
}

/// The state that is meant: the one named, else that of the model that the outcome was made with. One that the outcome was made
/// without is none of the case, named or not.
///
/// # Errors
/// As [`Case::outcome`]; a state that another job has left in the folder, and a case without any where none is named.
pub fn named_state(case: &Case, state: Option<&str>) -> Result<String, WorkflowError> {
    if let Some(state) = state {
        match state {
            // What the images alone tell is of no model.
            OBSERVED => case.check_outcome()?,
            FUSED => case.check_made_with(SHIFT_JSON)?,
            model => case.check_state(model).map_err(|error| match error {
                WorkflowError::Case(CaseError::NoState { folder, state, mut states }) => {
                    let of_images = [(OBSERVED, OUTCOME), (FUSED, SHIFT_JSON)].into_iter();
                    states.extend(
                        of_images.filter(|(_, file)| case.path(file).exists()).map(|(name, _)| name.to_owned()),
                    );
                    CaseError::NoState { folder, state, states }.into()
                }
                error => error,
            })?,
        }
        return Ok(state.to_owned());
    }
    let (folder, file) = (case.folder().to_path_buf(), ESTIMATE_STATE.to_owned());
    let left_behind = case.path(ESTIMATE_STATE).exists();
    let none = || match case.subject() {
        Some(Subject::Patient) if left_behind => {
            let reasons = vec![Reason::Input { role: OUTCOME.to_owned() }];
            CaseError::Stale { folder, what: file, reasons }
        }
        subject => CaseError::Missing { folder, file, subject },
    };
    Ok(case.model()?.ok_or_else(none)?)
}

/// Displacement, standard deviation and mask.
type Known = (Volume<[f32; 3], Native>, Option<Volume<f32, Native>>, Mask<Native>);

/// A state whose fields are not kept in the folder.
fn computed(case: &Case, state: &str, family: crate::layout::Family, to: WarpTo) -> Result<Known, WorkflowError> {
    let settings = Settings::resolve([&case.settings()?])?;
    let own = !matches!(state, FUSED | OBSERVED);
    let model = if own { Some(state.to_owned()) } else { brain_shift(case)?.and_then(|shift| shift.model) };
    let (_, meshed): (_, MeshFacts) = case.stage(&StageName::Mesh)?;
    let samples = super::plan::samples(&settings, Subject::Patient, &lesions(&meshed.mesh))?;
    let samples =
        samples.into_iter().map(|s| s.id).filter(|id| case.path(&crate::layout::SAMPLE_STATE.of(id)).exists());
    let believed = Believed::of(&settings);
    let of_case = CaseShift::read(case, model.as_deref(), samples.collect(), (&settings.fields, believed))?;
    let field: ShiftField = of_case.state(state)?;
    let vectors = if family == PRE_FROM_POST_FIELD {
        let value = field.to_pre(&of_case.post_grid, &of_case.post_from_pre.inverse());
        native(Volume::from_voxels(of_case.post_grid, value))
    } else if family == POST_FROM_PRE_FIELD {
        native(Volume::from_voxels(field.whole, field.to_post(&of_case.post_from_pre)))
    } else if to == WarpTo::Deformed && family == SHIFT {
        native(Volume::from_voxels(field.whole, |v| field.forward_at(v)))
    } else {
        native(Volume::from_voxels(field.whole, |v| field.inverse_at(v)))
    };
    let sd = native(field.on_whole(&field.sd_mm));
    Ok((vectors, Some(sd), native(field.on_whole(&field.believed))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_nobody_knows_of_tissue_none_is_claimed() {
        assert_eq!(Map::still().carry([1.0, 2.0, 3.0]).state, PointState::Rigid);
        let grid = Grid::<Native>::axis_aligned([4, 4, 4], [1.0; 3], [0.0; 3]);
        let map = Map::of_field(Volume::from_voxels(grid, |_| [0.5, 0.0, 0.0]), Part::Points);
        assert_eq!(map.carry([1.0; 3]), Carried { mm: [1.5, 1.0, 1.0], sd_mm: None, state: PointState::Moved });
        assert_eq!(map.carry([9.0; 3]).state, PointState::Outside);
    }

    /// Voxels of 1 mm along x, all moved by a third of a mm: two of tissue that was taken, four of tissue, two of fluid.
    fn margin() -> Map {
        let grid = Grid::<Native>::axis_aligned([8, 2, 2], [1.0; 3], [0.0; 3]);
        let x = |n: usize| grid.voxel(n)[0];
        let tissue = |n: usize| (2..6).contains(&x(n));
        // Beside the tissue the field goes on, and falls to nothing.
        let sd = |n: usize| match x(n) {
            0 | 1 => 0.0,
            6 => 0.4,
            7 => 0.1,
            _ => 0.8,
        };
        Map {
            forward: Some(Volume::from_voxels(grid, |_| [0.0, 0.0, 0.3])),
            sd: Some(Volume::from_data(grid, (0..grid.len()).map(sd).collect())),
            believed: Some(Mask::from_fn(grid, tissue)),
            resected: Some(Mask::from_fn(grid, |n| x(n) < 2)),
            ..Map::still()
        }
    }

    #[test]
    fn a_point_of_tissue_has_the_tissues_spread_however_near_to_what_was_taken_or_to_fluid() {
        let map = margin();
        for x in [1.55, 2.0, 3.3, 5.45] {
            let carried = map.carry([x, 0.5, 0.5]);
            assert_eq!(carried.state, PointState::Tissue, "{x}");
            assert!((carried.sd_mm.unwrap() - 0.8).abs() < 1e-6, "{x}: {carried:?}");
        }
    }

    #[test]
    fn a_point_in_fluid_or_in_what_was_taken_has_no_spread() {
        let map = margin();
        for (x, state) in [(1.45, PointState::Removed), (5.55, PointState::Fluid), (6.0, PointState::Fluid)] {
            let carried = map.carry([x, 0.5, 0.5]);
            assert_eq!((carried.state, carried.sd_mm), (state, None), "{x}");
        }
    }
}
