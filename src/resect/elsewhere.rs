//! Tissue that is gone elsewhere than in the cavity: cuts too thin for a cavity's seed, as of a hemisphere that was
//! disconnected, and second cavities.
//!
//! A cavity is looked for before the brain's sag is known, so only thickly ([`CavitySettings::opening_mm`]): sulci that
//! have opened or moved would be taken for one. Once the sag is known, what it explains is no loss, and what remains may
//! be thin. What the template has no tissue at is no loss either: the falx with contrast agent looks like tissue on one scan and,
//! without, like fluid on the other.

use super::belief::{Evidence, LAYER_MM, median};
use super::cavity::{CavityFinding, CavitySettings, ResectError, grow, settled, side_of, with_fluid_of};
use super::cavity_pair::CavityPair;
use super::sets::{both, either, without};
use crate::geometry::{Mni, Position};
use crate::image::components::{Connectivity, components};
use crate::image::distance::distance_mm;
use crate::image::morphology::{dilate, erode, open};
use crate::image::{Mask, Volume};
use crate::register::deformable::AtlasFit;
use crate::segment::label;

/// What is thinner than twice this once the sag is known is an error of the sag, mm.
const THREAD_MM: f64 = 1.0;
/// So near to the cavity the sag follows its surroundings and is less sure, mm.
const BESIDE_MM: f64 = 1.0;
/// Smaller parts are not looked at, cc: a cut that noise or a vessel has parted is larger.
const LEAST_PART_CC: f64 = 0.25;
/// Of a part, the least share of places that hold tissue by the template: a cut goes through tissue, whatever it touches.
const LEAST_TISSUE: f64 = 0.5;
/// How often the sag is fitted again without what was found: a cut that takes part in a fit is partly explained away.
const MOST_FITS: usize = 3;

/// Where the tissue is after the operation, by the sag.
struct Carried {
    t1: Volume<f32, Mni>,
    tissue: Mask<Mni>,
    brain: Mask<Mni>,
    ventricle: Mask<Mni>,
}

impl Carried {
    fn of(pair: &CavityPair<'_>, sag: &AtlasFit<Mni>) -> Self {
        let [tissue, brain, ventricle] = [
            pair.pre_labels.map(|l| f32::from(label::is_tissue(l))),
            pair.pre_brain.map(f32::from),
            pair.pre_labels.map(|l| f32::from(l == label::VENTRICLE)),
        ];
        let [t1, tissue, brain, ventricle] =
            sag.atlas_from_subject.warp([pair.pre, &tissue, &brain, &ventricle], &pair.pre.grid);
        let most = |share: Volume<f32, Mni>| share.map(|s| s >= 0.5);
        Self { t1, tissue: most(tissue), brain: most(brain), ventricle: most(ventricle) }
    }
}

/// What the sag does not explain.
struct Loss {
    seed: Mask<Mni>,
    evidence: Evidence,
}

/// How much of a part lies where the template has tissue; the template is laid onto the head before the operation.
fn tissue_share(part: &Mask<Mni>, sag: &AtlasFit<Mni>, has_tissue: &impl Fn(Position<Mni>) -> bool) -> f64 {
    let inside = (0..part.data.len()).filter(|&n| part.data[n]);
    let (held, all) = inside.fold((0usize, 0usize), |(held, all), n| {
        let before = sag.atlas_from_subject.apply(part.grid.centre(part.grid.voxel(n)));
        (held + usize::from(has_tissue(before)), all + 1)
    });
    held as f64 / all.max(1) as f64
}

/// Tissue that is dark now where the sag says that it should be, away from the cavity and from the brain's rim; `None` where
/// there is less of it than of a cavity, or where it makes no sense as something that was taken out.
fn loss(
    pair: &CavityPair<'_>,
    sag: &AtlasFit<Mni>,
    carried: &Carried,
    cavity: &Mask<Mni>,
    has_tissue: &impl Fn(Position<Mni>) -> bool,
    settings: &CavitySettings,
) -> Option<Loss> {
    let bright = f64::midpoint(pair.csf_grey_border, pair.grey_mean) as f32;
    let near = either(&dilate(cavity, BESIDE_MM), &erode(&carried.brain, settings.rim_mm).map(|deep| !deep));
    let lost = dark(pair, |n| carried.tissue.data[n] && carried.t1.data[n] > bright && !near.data[n]);
    let thick = open(&lost, THREAD_MM);
    let parts = components(&thick, Connectivity::Corners);
    let voxel_cc = pair.pre.grid.voxel_volume_mm3() / 1000.0;
    let labels = Volume::from_fn(pair.pre.grid, |n| if carried.ventricle.data[n] { label::VENTRICLE } else { 0 });
    let depth_mm = distance_mm(&carried.brain.map(|inside| !inside));
    let sagged = CavityPair { pre: &carried.t1, pre_labels: &labels, pre_brain: &carried.brain, ..*pair };
    let mut believed: Vec<(u32, Evidence)> = Vec::new();
    for (part, _) in (1..).zip(&parts.voxels).filter(|(_, voxels)| **voxels as f64 * voxel_cc >= LEAST_PART_CC) {
        let whole = parts.mask(part);
        let evidence = Evidence::of(&whole, &sagged);
        // A layer right under the rim: brain that has sunk, or fluid that stands, further from the skull than the sag says.
        let own = parts.labels.data.iter().zip(&depth_mm.data).filter(|(of, _)| **of == part);
        let depth = median(own.map(|(_, depth)| f64::from(*depth)).collect()).unwrap_or(0.0);
        let at_skull = evidence.radius_mm < LAYER_MM && depth < settings.rim_mm + LAYER_MM;
        if evidence.doubt().is_none() && !at_skull && tissue_share(&whole, sag, has_tissue) >= LEAST_TISSUE {
            believed.push((part, evidence));
        }
    }
    let seed = parts.kept(|part, _| believed.iter().any(|(own, _)| *own == part));
    let (_, largest) = believed.into_iter().max_by(|a, b| a.1.seed_cc.total_cmp(&b.1.seed_cc))?;
    // As far as it goes, thick or thin.
    let seed = holding(&lost, &seed);
    let seed_cc = seed.volume_cc();
    (seed_cc >= settings.smallest_cc).then_some(Loss { seed, evidence: Evidence { seed_cc, ..largest } })
}

/// The connected parts of a mask that hold any of the seed.
fn holding(mask: &Mask<Mni>, seed: &Mask<Mni>) -> Mask<Mni> {
    let parts = components(mask, Connectivity::Faces);
    let mut held = vec![false; parts.voxels.len() + 1];
    parts
        .labels
        .data
        .iter()
        .zip(&seed.data)
        .filter(|(_, seed)| **seed)
        .for_each(|(&part, _)| held[part as usize] = true);
    parts.kept(|part, _| held[part as usize])
}

fn dark(pair: &CavityPair<'_>, and: impl Fn(usize) -> bool + Sync + Send) -> Mask<Mni> {
    let border = pair.csf_grey_border as f32;
    Mask::from_fn(pair.pre.grid, |n| pair.post_known.data[n] && pair.post.data[n] < border && and(n))
}

/// The cavity with what is gone elsewhere, the sag around all of it, and how much is gone elsewhere still, cc. Where no cavity was
/// seen at all (not where one was doubted), a thin cut alone is one. `has_tissue` says whether the template has tissue where a point of
/// the head before the operation lies in it.
///
/// # Errors
/// That of `found`, or of `fit`, which fits the sag around a cavity.
pub(super) fn with_losses_elsewhere<E: From<ResectError>>(
    found: Result<CavityFinding, ResectError>,
    pair: &CavityPair<'_>,
    fit: impl Fn(&Mask<Mni>) -> Result<AtlasFit<Mni>, E>,
    has_tissue: impl Fn(Position<Mni>) -> bool,
    settings: &CavitySettings,
) -> Result<(CavityFinding, AtlasFit<Mni>, Option<f64>), E> {
    let (mut cavity, mut evidence, unseen) = match found {
        Ok(CavityFinding { cavity, evidence, .. }) => (cavity, evidence, None),
        Err(none @ ResectError::NoOperation { doubt: None, .. }) => (pair.pre_brain.map(|_| false), None, Some(none)),
        Err(other) => return Err(other.into()),
    };
    let mut sag = fit(&cavity)?;
    let mut fits = 0;
    let left = loop {
        let carried = Carried::of(pair, &sag);
        let Some(more) = loss(pair, &sag, &carried, &cavity, &has_tissue, settings) else { break None };
        if fits == MOST_FITS {
            break Some(more.evidence.seed_cc);
        }
        fits += 1;
        let way = dark(pair, |n| carried.tissue.data[n] && carried.brain.data[n]);
        let grown = grow(&more.seed, &way, settings.growth_mm);
        let whole = settled(&either(&cavity, &grown), &carried.brain, settings.closing_mm);
        let whole = with_fluid_of(&whole, &carried.tissue, settings.surroundings_mm);
        cavity = either(&cavity, &without(&both(&whole, &carried.brain), &carried.ventricle));
        evidence = evidence.or(Some(more.evidence));
        sag = fit(&cavity)?;
    };
    if let (Some(unseen), None) = (unseen, evidence) {
        return Err(unseen.into());
    }
    let ventricle = pair.pre_labels.map(|l| l == label::VENTRICLE);
    let resected = without(&both(&cavity, pair.pre_brain), &ventricle);
    let side = side_of(&cavity);
    Ok((CavityFinding { cavity, resected, side, evidence }, sag, left))
}

/// How much tissue is gone elsewhere than in this cavity, cc; `None` where nothing to speak of.
pub(super) fn lost_elsewhere_cc(
    pair: &CavityPair<'_>,
    sag: &AtlasFit<Mni>,
    cavity: &Mask<Mni>,
    has_tissue: impl Fn(Position<Mni>) -> bool,
    settings: &CavitySettings,
) -> Option<f64> {
    loss(pair, sag, &Carried::of(pair, sag), cavity, &has_tissue, settings).map(|lost| lost.evidence.seed_cc)
}

#[cfg(test)]
mod tests {
    use super::super::belief::Doubt;
    use super::super::cavity_pair::MadePair;
    use super::super::find_cavity;
    use super::*;
    use crate::image::{Grid, LabelMap};
    use crate::register::deformable::{DeformableQuality, DisplacementField};
    use nalgebra::{Point3, Vector3};

    /// A ball of folded tissue of radius 40 mm with a ventricle of 8 mm in it, in voxels of 1 mm; `gone` says what is fluid on the
    /// second scan, `moved_mm` how far what lies around the sulcus has moved along x on it.
    /// A sheet of fluid of 4 mm, as thick as a deep sulcus.
    fn sulcus(p: Point3<f64>) -> bool {
        (p.x - 16.0).abs() < 2.0 && p.y.abs() < 16.0 && p.z.abs() < 16.0
    }

    /// Displacement of what lies around the sulcus.
    fn sagged(p: Point3<f64>, by_mm: f64) -> Vector3<f64> {
        Vector3::new(if p.x > 12.0 { by_mm } else { 0.0 }, 0.0, 0.0)
    }

    fn head(gone: impl Fn(Point3<f64>) -> bool + Sync + Send, moved_mm: f64) -> MadePair {
        let grid = Grid::axis_aligned([90; 3], [1.0; 3], [-44.5; 3]);
        let at = |n: usize| grid.position(grid.voxel(n).map(|c| c as f64).into()).mm;
        let label_at = |p: Point3<f64>| match p.coords.norm() {
            r if r < 8.0 => label::VENTRICLE,
            r if r < 40.0 && sulcus(p) => label::CSF,
            r if r < 40.0 => label::WHITE_MATTER,
            _ => label::BACKGROUND,
        };
        let value_at = |p: Point3<f64>| match label_at(p) {
            label::WHITE_MATTER => 100.0 + 8.0 * (0.9 * p.y).sin() as f32,
            _ => 25.0,
        };
        let gone = Mask::from_fn(grid, |n| label_at(at(n)) == label::WHITE_MATTER && gone(at(n)));
        let before = |n: usize| at(n) - sagged(at(n), moved_mm);
        MadePair {
            pre: Volume::from_data(grid, (0..grid.len()).map(|n| value_at(at(n))).collect()),
            labels: LabelMap::from_data(grid, (0..grid.len()).map(|n| label_at(at(n))).collect()),
            brain: Mask::from_data(grid, (0..grid.len()).map(|n| label_at(at(n)) != label::BACKGROUND).collect()),
            post: Volume::from_data(
                grid,
                (0..grid.len()).map(|n| if gone.data[n] { 25.0 } else { value_at(before(n)) }).collect(),
            ),
            gone,
        }
    }

    fn found(h: &MadePair, sag_mm: f64) -> Result<CavityFinding, ResectError> {
        found_by(h, sag_mm, |_| true)
    }

    /// What is found where the template has tissue at these places.
    fn found_by(
        h: &MadePair,
        sag_mm: f64,
        has_tissue: impl Fn(Position<Mni>) -> bool,
    ) -> Result<CavityFinding, ResectError> {
        let known = h.brain.map(|_| true);
        let pair = h.pair(&known);
        let by = |x: f64| {
            let grid = h.pre.grid;
            let moved = |n: usize| sagged(grid.position(grid.voxel(n).map(|c| c as f64).into()).mm, x);
            DisplacementField::from_displacement(&Volume::from_fn(grid, |n| [moved(n).x as f32, 0.0, 0.0]))
        };
        let fit = |_: &Mask<Mni>| {
            let quality = DeformableQuality {
                correlation: [1.0; 2],
                smallest_jacobian: 1.0,
                largest_jacobian: 1.0,
                round_trip_mm: 0.0,
                iterations: Vec::new(),
            };
            Ok(AtlasFit { atlas_from_subject: by(-sag_mm), subject_from_atlas: by(sag_mm), quality })
        };
        let settings = CavitySettings::default();
        let seen = find_cavity(&pair, &settings);
        with_losses_elsewhere(seen, &pair, fit, has_tissue, &settings).map(|(found, ..)| found)
    }

    fn cut(p: Point3<f64>) -> bool {
        (p.x + 18.0).abs() < 2.0 && p.y.abs() < 18.0 && p.z.abs() < 18.0
    }

    #[test]
    fn a_cut_too_thin_for_a_cavity_is_found_once_the_sag_is_known() {
        let h = head(cut, 0.0);
        let found = found(&h, 0.0).unwrap();
        assert!(found.cavity.dice(&h.gone) > 0.9, "{}", found.cavity.dice(&h.gone));
        assert!(found.resected.dice(&h.gone) > 0.9 && found.evidence.is_some_and(|e| e.doubt().is_none()));
    }

    #[test]
    fn a_sheet_that_is_dark_now_where_the_template_has_a_fissure_is_no_cut() {
        let h = head(cut, 0.0);
        let found = found_by(&h, 0.0, |p| (p.mm.x + 18.0).abs() > 3.0);
        assert!(matches!(found, Err(ResectError::NoOperation { .. })));
    }

    #[test]
    fn a_cavity_at_the_skull_ends_with_the_brain_with_a_cut_elsewhere_too() {
        let at_skull = |p: Point3<f64>| (p - Point3::new(30.0, -20.0, 0.0)).norm() < 12.0;
        let h = head(|p| at_skull(p) || cut(p), 0.0);
        let cavity = found(&h, 0.0).unwrap().cavity;
        assert!(cavity.dice(&h.gone) > 0.9, "{}", cavity.dice(&h.gone));
        assert_eq!(without(&cavity, &h.brain).count(), 0);
    }

    #[test]
    fn two_cavities_and_the_cut_between_them_are_all_found() {
        let ball = |p: Point3<f64>, y: f64| (p - Point3::new(-18.0, y, 0.0)).norm() < 8.0;
        let h = head(
            |p| ball(p, -18.0) || ball(p, 18.0) || ((p.x + 18.0).abs() < 2.0 && p.y.abs() < 18.0 && p.z.abs() < 6.0),
            0.0,
        );
        let found = found(&h, 0.0).unwrap();
        assert!(found.cavity.dice(&h.gone) > 0.9, "{}", found.cavity.dice(&h.gone));
    }

    #[test]
    fn what_the_sag_explains_is_no_loss_and_what_it_does_not_is() {
        let h = head(|_| false, 4.0);
        assert!(matches!(found(&h, 4.0), Err(ResectError::NoOperation { doubt: None, .. })));
        let lost = found(&h, 0.0).unwrap().cavity;
        let fluid = |moved_mm: f64| {
            Mask::from_fn(lost.grid, |n| {
                let p = lost.grid.position(lost.grid.voxel(n).map(|c| c as f64).into()).mm;
                sulcus(p - sagged(p, moved_mm))
            })
        };
        // Where the sulcus is now; where it was, beside that, fluid belongs to what is lost around it.
        let (now, before) = (fluid(4.0), fluid(0.0));
        assert!(both(&lost, &now).count() * 10 > 9 * now.count());
        assert!(both(&lost, &either(&now, &before)).count() * 10 > 9 * lost.count());
    }

    #[test]
    fn fluid_under_the_skull_where_the_brain_has_sunk_further_than_the_sag_says_is_no_cut() {
        let h = head(|p| p.z > 0.0 && (34.5..37.5).contains(&p.coords.norm()), 0.0);
        assert!(h.gone.volume_cc() > 10.0);
        assert!(matches!(found(&h, 0.0), Err(ResectError::NoOperation { .. })));
    }

    #[test]
    fn what_was_doubted_stays_doubted_and_ventricles_that_have_grown_a_little_are_no_cut() {
        let grown = |r: f64| head(move |p| p.coords.norm() < r, 0.0);
        let thick = found(&grown(12.0), 0.0).map(|f| f.cavity.count()).unwrap_err();
        assert!(matches!(thick, ResectError::NoOperation { doubt: Some(Doubt::Ventricle { .. }), .. }), "{thick}");
        let thin = found(&grown(10.5), 0.0).map(|f| f.cavity.count()).unwrap_err();
        assert!(matches!(thin, ResectError::NoOperation { .. }), "{thin}");
    }
}
