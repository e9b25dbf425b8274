//! Lateral and third ventricles: CSF that is nearer, through CSF, to the template's ventricles than to its cisterns.

use super::brain::at_each;
use super::label::{GREY_MATTER, WHITE_MATTER};
use super::mixture::Mixture;
use super::priors::AtlasPriors;
use super::warning::SegmentWarning;
use crate::geometry::Mni;
use crate::image::components::{Connectivity, fill_holes, without_islands};
use crate::image::gaussian::gaussian;
use crate::image::morphology::{close, dilate, erode};
use crate::image::{LabelMap, Mask, Volume};
use rayon::prelude::*;

/// How the ventricles are told from the other CSF.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct VentricleSettings {
    /// How far the patient's ventricles may reach beyond the template's, in mm.
    pub reach_mm: f64,
    /// CSF at least this far from the template's ventricles, where the template has a cistern or sulcus, is no ventricle.
    pub cistern_clearance_mm: f64,
    /// Choroid plexus and septa thinner than twice this are part of the ventricles.
    pub closing_mm: f64,
}

impl Default for VentricleSettings {
    fn default() -> Self {
        Self { reach_mm: 16.0, cistern_clearance_mm: 4.0, closing_mm: 1.0 }
    }
}

/// Choroid plexus that contrast agent made at least as bright as white matter: inside the template's ventricles, with the
/// mixed voxels around it.
///
/// `t1` has its bias taken out.
pub(super) fn enhanced_plexus(t1: &Volume<f32, Mni>, white_mean: f64, priors: &AtlasPriors) -> Mask<Mni> {
    // The carried ventricles are about a voxel off: nearer to their wall, white matter is bright.
    const DEPTH_MM: f32 = 0.5;
    let bright = at_each(t1, |n| priors.ventricle_mm.data[n] < -DEPTH_MM && f64::from(t1.data[n]) >= white_mean);
    let around = dilate(&bright, 1.5);
    at_each(t1, |n| around.data[n] && priors.ventricle_mm.data[n] < DEPTH_MM)
}

/// What to say of a mask of the ventricles that lies on tissue, or far from the template's.
pub(super) fn not_ventricles(
    given: &Mask<Mni>,
    even: &Volume<f32, Mni>,
    priors: &AtlasPriors,
    model: &Mixture,
) -> Option<SegmentWarning> {
    /// Wide ventricles are followed by the fit, all but this.
    const FAR_MM: f32 = 15.0;
    const NOTED_PERCENT: f64 = 35.0;
    let between = f64::midpoint(model.means[0], model.means[1]);
    let percent = |of: &dyn Fn(usize) -> bool| {
        let drawn = (0..given.data.len()).filter(|&n| given.data[n]);
        let (all, held) = drawn.fold((0usize, 0usize), |(all, held), n| (all + 1, held + usize::from(of(n))));
        100.0 * held as f64 / all.max(1) as f64
    };
    let tissue_percent = percent(&|n| f64::from(even.data[n]) > between);
    let far_percent = percent(&|n| priors.ventricle_mm.data[n] > FAR_MM);
    (tissue_percent.max(far_percent) >= NOTED_PERCENT)
        .then_some(SegmentWarning::NotVentricles { tissue_percent, far_percent })
}

/// The ventricles among the voxels of `csf`, on the working grid; may be empty.
///
/// Two fronts start together and advance through CSF at one voxel a step: one from the CSF deep in the template's
/// ventricles, one from the CSF in its cisterns and sulci; where they meet, they stop. Enlarged ventricles grow into
/// what is tissue in the template, where no cistern starts. Choroid plexus that contrast agent made bright is passed like
/// CSF.
pub(super) fn ventricles(
    csf: &Mask<Mni>,
    plexus: &Mask<Mni>,
    brain: &Mask<Mni>,
    priors: &AtlasPriors,
    settings: &VentricleSettings,
) -> Mask<Mni> {
    const VENTRICLE: u8 = 1;
    const CISTERN: u8 = 2;
    /// A temporal horn is nowhere deep, in the template and in most heads: there it is enough that no cistern is near.
    const CLEAR_MM: f32 = 2.0;
    let (reach, clearance) = (settings.reach_mm as f32, settings.cistern_clearance_mm as f32);
    let deep = erode(csf, 1.0);
    let csf = &at_each(&priors.ventricle_mm, |n| csf.data[n] || plexus.data[n]);
    let mut owner = Volume::from_fn(csf.grid, |n| {
        let from_ventricle = priors.ventricle_mm.data[n];
        if !csf.data[n] {
            0
        } else if from_ventricle < -0.5
            && (deep.data[n] || from_ventricle < -1.5 || priors.cistern_mm.data[n] > CLEAR_MM)
        {
            VENTRICLE
        } else if from_ventricle > clearance && priors.cistern_mm.data[n] < 0.0 || from_ventricle > 2.0 * reach {
            CISTERN
        } else {
            0
        }
    })
    .data;
    let mut front: Vec<u32> = (0..owner.len() as u32).into_par_iter().filter(|&n| owner[n as usize] > 0).collect();
    let [nx, ny, _] = csf.grid.dims;
    let strides = [1, nx, nx * ny];
    while !front.is_empty() {
        let mut next = Vec::new();
        for &n in &front {
            let n = n as usize;
            let voxel = csf.grid.voxel(n);
            for a in 0..3 {
                let below = (voxel[a] > 0).then(|| n - strides[a]);
                let above = (voxel[a] + 1 < csf.grid.dims[a]).then(|| n + strides[a]);
                for m in below.into_iter().chain(above) {
                    if owner[m] == 0 && csf.data[m] {
                        owner[m] = owner[n];
                        next.push(m as u32);
                    }
                }
            }
        }
        front = next;
    }
    let ventricle = at_each(&priors.ventricle_mm, |n| owner[n] == VENTRICLE && priors.ventricle_mm.data[n] < reach);
    let ventricle = without_islands(&ventricle, Connectivity::Faces, 30);
    let closed = fill_holes(&close(&ventricle, settings.closing_mm));
    // A closing may not reach over to a cistern or leave the brain.
    Mask::from_fn(csf.grid, |n| closed.data[n] && brain.data[n] && owner[n] != CISTERN)
}

/// The ventricles with the voxels of their wall that are more than half full of CSF.
///
/// A voxel shared by CSF and white matter looks like grey matter, and the mixture, which knows no border of CSF and white matter,
/// calls it so. Here the tissue beyond the wall says what a half-full voxel looks like.
pub(super) fn with_shared_wall(
    ventricle: &Mask<Mni>,
    t1: &Volume<f32, Mni>,
    brain: &Mask<Mni>,
    model: &Mixture,
) -> Mask<Mni> {
    const SIGMA_MM: f64 = 1.5;
    let Some(found) = ventricle.bounding_box() else { return ventricle.clone() };
    let around = found.grown(&ventricle.grid, 8.0);
    let (inside, t1, brain) = (ventricle.cropped(&around), t1.cropped(&around), brain.cropped(&around));
    let deep = erode(&inside, 1.0);
    let full: Vec<f32> = (0..t1.data.len()).filter(|&n| deep.data[n]).map(|n| t1.data[n]).collect();
    let csf = if full.len() < 500 { model.means[0] as f32 } else { full.iter().sum::<f32>() / full.len() as f32 };
    let rim = dilate(&inside, 1.9);
    let border = model.csf_grey_border() as f32;
    let beyond = at_each(&t1, |n| brain.data[n] && !rim.data[n] && t1.data[n] > border);
    let count = gaussian(&beyond.map(|x| f32::from(u8::from(x))), SIGMA_MM);
    let sum = gaussian(&Volume::from_fn(t1.grid, |n| if beyond.data[n] { t1.data[n] } else { 0.0 }), SIGMA_MM);
    let next = dilate(&inside, 1.0);
    let wide = at_each(&t1, |n| {
        let half = 0.5 * (csf + sum.data[n] / count.data[n].max(1e-6));
        inside.data[n] || (next.data[n] && brain.data[n] && count.data[n] > 0.02 && t1.data[n] < half)
    });
    let mut out = ventricle.clone();
    out.paste(&wide, &around);
    out
}

/// White matter for the grey voxels of the ventricles' wall behind which white matter lies, in place.
///
/// A voxel less than half full of CSF, the rest white matter, looks like grey matter too, and the mixture lines the ventricles
/// with a film of it that no brain has. Where nuclei or cortex do reach the wall, they lie behind it as well.
pub(super) fn with_white_walls(labels: &mut LabelMap<Mni>, ventricle: &Mask<Mni>, deep_grey: &Volume<f32, Mni>) {
    /// The wall is one voxel thick; what lies behind it is looked at around it, nearer voxels more.
    const WALL_MM: f64 = 1.0;
    const SIGMA_MM: f64 = 1.5;
    /// White matter must clearly prevail, and be there at all.
    const TIMES_GREY: f32 = 2.0;
    const LEAST: f32 = 0.02;
    let Some(found) = ventricle.bounding_box() else { return };
    let around = found.grown(&ventricle.grid, 8.0);
    let (part, deep) = (labels.cropped(&around), deep_grey.cropped(&around));
    let wall = dilate(&ventricle.cropped(&around), WALL_MM);
    let behind = |l: u8| {
        let full = Volume::from_fn(part.grid, |n| f32::from(u8::from(!wall.data[n] && part.data[n] == l)));
        gaussian(&full, SIGMA_MM)
    };
    let (grey, white) = (behind(GREY_MATTER), behind(WHITE_MATTER));
    let turned = Volume::from_fn(part.grid, |n| {
        let film = part.data[n] == GREY_MATTER && wall.data[n] && deep.data[n] <= 0.5;
        if film && white.data[n] > LEAST.max(TIMES_GREY * grey.data[n]) { WHITE_MATTER } else { part.data[n] }
    });
    labels.paste(&turned, &around);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;
    use crate::segment::label::VENTRICLE;

    /// A ventricle between white matter on the left and a nucleus 6 mm thick on the right, lined by one voxel that looks grey.
    fn lined(deep: f32) -> (LabelMap<Mni>, Mask<Mni>, Volume<f32, Mni>) {
        let grid = Grid::<Mni>::axis_aligned([40, 24, 24], [1.0; 3], [0.0; 3]);
        let labels = Volume::from_fn(grid, |n| match grid.voxel(n)[0] {
            16..22 => VENTRICLE,
            15 | 22..28 => GREY_MATTER,
            _ => WHITE_MATTER,
        });
        (labels.clone(), labels.map(|l| l == VENTRICLE), Volume::filled(grid, deep))
    }

    #[test]
    fn a_ventricle_is_not_lined_with_grey_matter_and_a_nucleus_at_its_wall_stays() {
        let (mut labels, ventricle, deep) = lined(0.0);
        with_white_walls(&mut labels, &ventricle, &deep);
        assert_eq!(labels.at(15, 12, 12), WHITE_MATTER);
        assert_eq!(labels.at(16, 12, 12), VENTRICLE);
        for i in 22..28 {
            assert_eq!(labels.at(i, 12, 12), GREY_MATTER, "{i}");
        }
    }

    #[test]
    fn what_the_template_knows_for_a_nucleus_is_no_film() {
        let (mut labels, ventricle, deep) = lined(0.9);
        let before = labels.clone();
        with_white_walls(&mut labels, &ventricle, &deep);
        assert_eq!(labels, before);
    }
}
