//! Brain mask: what has the intensity of tissue, hangs together, and lies where the template expects the brain.

use super::mixture::Mixture;
use super::priors::AtlasPriors;
use crate::geometry::Mni;
use crate::image::components::{Connectivity, fill_holes, largest_component};
use crate::image::gaussian::gaussian;
use crate::image::morphology::{close, dilate, erode};
use crate::image::{Mask, Volume};

/// How the brain is told from its surroundings.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BrainSettings {
    /// How far the patient's pia may lie outside the template's, in mm.
    pub reach_mm: f64,
    /// Bridges to dura, nerves and vessels thinner than twice this are cut.
    pub opening_mm: f64,
    /// Sulci narrower than twice this are part of the brain.
    pub closing_mm: f64,
    /// Deeper than this inside the template's brain, bridges are not looked for, and everything belongs to the brain at
    /// twice the depth.
    pub trusted_depth_mm: f64,
}

impl Default for BrainSettings {
    fn default() -> Self {
        Self { reach_mm: 5.0, opening_mm: 2.0, closing_mm: 5.0, trusted_depth_mm: 5.0 }
    }
}

/// CSF of the template at least this deep, in mm, is a cistern; sulci are narrower than twice this.
const CISTERN_DEPTH_MM: f32 = 2.0;

/// Intensities that tissue may have, by the distance outside the template's surface.
///
/// Inside, from the border of CSF and grey matter to three deviations above white matter (fat and enhanced vessels are
/// brighter). The brain's outermost layer is cortex: what lies outside the expected surface and is brighter than grey matter is
/// marrow, fat or scalp, however well it hangs together with the brain; what is darker, dura or the wall of a sinus.
struct Window {
    low: [f32; 2],
    high: [f32; 2],
}

impl Window {
    /// Over this distance, in mm, the inner window becomes the outer one: the misfit of a good fit.
    const NARROWS_MM: f32 = 2.5;

    fn of(model: &Mixture) -> Self {
        let [_, grey, white] = model.means;
        let border = model.csf_grey_border();
        Self {
            low: [border, border + 0.25 * (grey - border)].map(|x| x as f32),
            high: [white + 3.0 * model.deviations[2], 0.5 * (grey + white) + 0.5 * model.deviations[1]]
                .map(|x| x as f32),
        }
    }

    fn holds(&self, value: f32, outside_mm: f32) -> bool {
        let share = (outside_mm / Self::NARROWS_MM).clamp(0.0, 1.0);
        let at = |ends: [f32; 2]| ends[0] + share * (ends[1] - ends[0]);
        (at(self.low)..at(self.high)).contains(&value)
    }
}

/// The mask of the brain (tissue, ventricles and sulci) on the working grid; may be empty.
///
/// `t1` has its bias taken out. Tissue has an intensity in a window that narrows outwards, see [`Window`].
pub(super) fn brain_mask(
    t1: &Volume<f32, Mni>,
    known: &Mask<Mni>,
    model: &Mixture,
    priors: &AtlasPriors,
    settings: &BrainSettings,
) -> Mask<Mni> {
    let window = Window::of(model);
    let reach = settings.reach_mm as f32;
    let depth = settings.trusted_depth_mm as f32;
    let tissue = at_each(t1, |n| {
        let outside_mm = priors.brain_mm.data[n];
        known.data[n] && outside_mm < reach && window.holds(t1.data[n], outside_mm)
    });
    let core = largest_component(&erode(&tissue, settings.opening_mm), Connectivity::Faces);
    if core.count() == 0 {
        return core;
    }
    let seeds = at_each(t1, |n| core.data[n] || (tissue.data[n] && priors.brain_mm.data[n] < -depth));
    let seeds = largest_component(&seeds, Connectivity::Corners);
    // The opening took a shell of its own radius; gyral crowns and thin folds need a little more to come back.
    let grown = dilate(&seeds, settings.opening_mm + 1.5);
    let tissue = at_each(t1, |n| grown.data[n] && tissue.data[n]);
    let closed = close(&tissue, settings.closing_mm);
    let solid = at_each(t1, |n| {
        known.data[n] && priors.brain_mm.data[n] < reach && (closed.data[n] || priors.brain_mm.data[n] < -2.0 * depth)
    });
    let filled = fill_holes(&solid);
    // Cisterns and the fourth ventricle reach deep between the lobes, wider than any sulcus: the template knows where, the
    // patient's dark voxels how far.
    let wide =
        dilate(&at_each(t1, |n| priors.cistern_mm.data[n] < -CISTERN_DEPTH_MM), f64::from(CISTERN_DEPTH_MM) + 0.5);
    let left_out = |n: usize| !tissue.data[n] && (priors.brain_mm.data[n] >= 0.5 || wide.data[n]);
    let filled = at_each(t1, |n| filled.data[n] && !left_out(n));
    // Stairs and single voxels at the surface carry no information.
    let smooth = gaussian(&filled.map(|inside| f32::from(u8::from(inside))), 0.8);
    let mask = at_each(t1, |n| known.data[n] && smooth.data[n] > 0.5);
    largest_component(&mask, Connectivity::Faces)
}

/// A mask on the grid of `like`.
pub(super) fn at_each(like: &Volume<f32, Mni>, rule: impl Fn(usize) -> bool + Sync + Send) -> Mask<Mni> {
    Volume::from_fn(like.grid, rule)
}
