//! Blood in the cavity: as bright as tissue, but without the folds that were there.
//!
//! Beside the dark part of a cavity what the second scan shows has four accounts: the tissue that was there; that tissue with
//! oedema, which darkens white matter and leaves grey matter as it was; that tissue made brighter, as contrast agent does with the
//! wall of a bed; and blood, which is even. Oedema can hide all folds, and a window of grey matter has none to lose. So blood is
//! believed where, of all that has changed, enough is explained by none of the others.

use super::belief::median;
use super::cavity::{CavitySettings, grow, settled, with_fluid_of};
use super::sets::{both, either};
use super::window::Window;
use crate::geometry::Mni;
use crate::image::distance::distance_mm;
use crate::image::morphology::dilate;
use crate::image::{Mask, Volume};
use crate::segment::SegmentWarning;

/// Noise is smoothed with this first, mm; folds are wider.
const NOISE_MM: f64 = 1.0;
/// Windows in which the accounts are held against the second scan, standard deviation in mm.
const ACCOUNT_MM: f64 = 1.5;
/// Windows in which the folds of both scans are compared, standard deviation in mm.
const FOLDS_MM: f64 = 2.5;
/// What is left of the difference in gain changes over this distance, mm.
const GAIN_MM: f64 = 12.0;
/// Mean square that every account may leave for nothing: a share of the squared contrast between grey and white matter,
const FLOOR: f64 = 0.03;
/// and this many times what the tissue leaves unexplained in the middle away from the cavity, where nothing has happened: thick
/// slices, ghosts and noise are no blood.
const USUAL: f64 = 8.0;
/// An account is better than another if it leaves less than this share of what the other leaves.
const LESS: f64 = 0.5;
/// Oedema takes from white matter up to this much of what it is brighter than grey matter.
const MOST_OEDEMA: f32 = 1.3;
/// Of what has changed, the least share of which blood leaves clearly less than what oedema and brighter tissue leave, for any of it
/// to be blood: oedema, with contrast agent in the bed or without, came to .12 at most where the rules below do not tell it, blood
/// to .20 and more, amid oedema to .13 once (docs/evidence/synthetic-faults.md).
const LEAST_BEYOND_BOTH: f64 = 0.16;
/// See [`LEAST_BEYOND_BOTH`].
const CLEARLY_LESS: f64 = 0.7;
/// The least share that oedema must leave unexplained for all of it to be blood; of less, those windows and what lies
/// [`AROUND_MM`] around them are. Blood alone came to .31 and more, blood amid oedema to less.
const LEAST_BEYOND_OEDEMA: f64 = 0.30;
/// White matter under blood is explained by oedema as well; blood goes on this far from where it is not, mm.
const AROUND_MM: f64 = 2.0;
/// The same of brighter tissue, if those windows are as large as a cavity must be; else those windows alone are. Contrast agent in the
/// bed came to .20, and to .41 of what was .6 cc at most; blood to .28 and more, but on grey matter alone or where oedema was there
/// before to as little as .09: there a part of it is found.
const LEAST_BEYOND_BRIGHTER: f64 = 0.25;

/// The tissue within this distance of the dark part is its wall, mm.
const WALL_MM: f64 = 6.0;
/// A wall along more of which blood could not be told is told of, percent (docs/evidence/synthetic-faults.md).
const NOTED_BLIND_WALL: f64 = 90.0;

/// Both scans where the post-operative one was taken, the pre-operative one moved with the sag.
#[derive(Clone, Copy, Debug)]
pub(super) struct SaggedPair<'a> {
    /// Pre-operative intensities, carried along.
    pub pre: &'a Volume<f32, Mni>,
    /// Pre-operative grey and white matter, carried along.
    pub tissue: &'a Mask<Mni>,
    /// Pre-operative brain, carried along.
    pub brain: &'a Mask<Mni>,
    /// Post-operative intensities on the pre-operative scale.
    pub post: &'a Volume<f32, Mni>,
    /// Where the post-operative scan looked.
    pub post_known: &'a Mask<Mni>,
    /// Intensity between CSF and grey matter.
    pub csf_grey_border: f64,
    /// Grey matter's mean intensity.
    pub grey_mean: f64,
    /// White matter's mean intensity less grey matter's.
    pub grey_white_contrast: f64,
}

/// A cavity with the blood that lies in it.
pub(super) struct WithBlood {
    /// The cavity.
    pub cavity: Mask<Mni>,
    /// What has changed beside it and is left out, as oedema or contrast agent would explain it, cc.
    pub in_doubt_cc: f64,
    /// Share of the wall of the dark part that has no folds to lose, or none that these scans show: blood there would have been
    /// taken for tissue.
    pub blind_share: f64,
}

impl WithBlood {
    /// What a reader should know: of a doubt from the size that a cavity must have.
    pub fn told(&self, smallest_cc: f64) -> impl Iterator<Item = SegmentWarning> {
        let (cc, percent) = (self.in_doubt_cc, 100.0 * self.blind_share);
        let changed = (cc >= smallest_cc).then_some(SegmentWarning::ChangedBeside { cc });
        let untold = (percent > NOTED_BLIND_WALL).then_some(SegmentWarning::BloodUntold { percent });
        changed.into_iter().chain(untold)
    }
}

/// The cavity with the blood that lies in it, found beside the dark part.
pub(super) fn with_blood(cavity: &Mask<Mni>, pair: &SaggedPair<'_>, settings: &CavitySettings) -> WithBlood {
    let dark = pair.post.map(|x| f64::from(x) < pair.csf_grey_border);
    let edge_of_dark = dilate(&dark, 1.0);
    let comparable =
        Mask::from_fn(dark.grid, |n| pair.brain.data[n] && pair.post_known.data[n] && !edge_of_dark.data[n]);
    let left = Unexplained::of(pair, &comparable, settings.folds_kept as f32);
    let to_cavity_mm = distance_mm(cavity);
    let away =
        |n: &usize| comparable.data[*n] && pair.tissue.data[*n] && f64::from(to_cavity_mm.data[*n]) > settings.blood_mm;
    let usual = median((0..dark.data.len()).filter(away).map(|n| f64::from(left.tissue.data[n])).collect());
    let floor = FLOOR * pair.grey_white_contrast.powi(2);
    let floor_of_change = floor + USUAL * usual.unwrap_or(0.0);
    let changed = both(&comparable, &left.less_by_blood(&left.tissue, LESS, floor_of_change));
    let beside = |n: usize| to_cavity_mm.data[n] > 0.0 && f64::from(to_cavity_mm.data[n]) < WALL_MM;
    let wall = Mask::from_fn(dark.grid, |n| comparable.data[n] && beside(n));
    // Blood of one brightness leaves nothing, the tissue that was there at least its own folds.
    let blind = left.folds.map(|square| LESS * (f64::from(square) + floor_of_change) <= floor_of_change);
    let blind_share = both(&wall, &blind).count() as f64 / wall.count().max(1) as f64;

    // Between the dark part and the blood lies a rim of mixed voxels.
    let start = dilate(cavity, 1.0);
    let along = |windows: &Mask<Mni>| {
        let passable = either(&dilate(windows, 1.0), &edge_of_dark);
        grow(&both(&start, &passable), &both(&passable, pair.brain), settings.blood_mm)
    };
    let reached = both(&changed, &along(&changed));
    let believed = left.believed(&reached, floor, settings.smallest_cc);
    let grown = along(&believed);
    let found = both(&believed, &grown);
    let blood = both(&grown, &dilate(&found, 1.5));
    if blood.volume_cc() < settings.smallest_cc {
        return WithBlood { cavity: cavity.clone(), in_doubt_cc: reached.volume_cc(), blind_share };
    }
    let in_doubt_cc = reached.volume_cc() - found.volume_cc();
    // The carried brain can end short of the dark part where the sag is known least.
    let within = either(pair.brain, cavity);
    let settled = settled(&either(&blood, cavity), &within, settings.closing_mm);
    let cavity = both(&with_fluid_of(&settled, pair.tissue, settings.surroundings_mm), &within);
    WithBlood { cavity, in_doubt_cc, blind_share }
}

/// What each account leaves of the second scan, and the folds that were there: mean squares over windows.
struct Unexplained {
    folds: Volume<f32, Mni>,
    tissue: Volume<f32, Mni>,
    oedema: Volume<f32, Mni>,
    brighter: Volume<f32, Mni>,
    blood: Volume<f32, Mni>,
}

impl Unexplained {
    fn of(pair: &SaggedPair<'_>, comparable: &Mask<Mni>, kept: f32) -> Self {
        let noise = Window::new(comparable, NOISE_MM);
        let (before, after) = (noise.mean(pair.pre), noise.mean(pair.post));
        let gain = gain_left(pair, comparable, &before, &after, kept);
        let before = product(&before, &gain);
        let grey = pair.grey_mean as f32;
        let above_grey = before.map(|x| (x - grey).max(0.0));
        let change = Volume::from_fn(before.grid, |n| after.data[n] - before.data[n]);
        let window = Window::new(comparable, ACCOUNT_MM);
        let (mean, mean_change) = (window.mean(&after), window.mean(&change));
        let [tissue, with, most, square] =
            [(&change, &change), (&change, &above_grey), (&above_grey, &above_grey), (&after, &after)]
                .map(|(x, y)| window.mean(&product(x, y)));
        // The depth of oedema that explains the most, by least squares.
        let oedema = Volume::from_fn(before.grid, |n| {
            let depth = (-with.data[n] / most.data[n].max(f32::MIN_POSITIVE)).clamp(0.0, MOST_OEDEMA);
            (tissue.data[n] + depth * (2.0 * with.data[n] + depth * most.data[n])).max(0.0)
        });
        let brighter = Volume::from_fn(before.grid, |n| {
            let by = mean_change.data[n].max(0.0);
            (tissue.data[n] - by * by).max(0.0)
        });
        let blood = variance(&square, &mean);
        let folds = variance(&window.mean(&product(&before, &before)), &window.mean(&before));
        Self { folds, tissue, oedema, brighter, blood }
    }

    /// Where blood leaves less than this share of what an account leaves.
    fn less_by_blood(&self, account: &Volume<f32, Mni>, share: f64, floor: f64) -> Mask<Mni> {
        let less = |n: usize| f64::from(self.blood.data[n]) + floor < share * (f64::from(account.data[n]) + floor);
        Mask::from_fn(account.grid, less)
    }

    /// Of what has changed, what is believed to be blood: all of it, what lies beyond one of the other accounts, or nothing.
    fn believed(&self, changed: &Mask<Mni>, floor: f64, smallest_cc: f64) -> Mask<Mni> {
        let share = |of: &Mask<Mni>| both(changed, of).count() as f64 / changed.count().max(1) as f64;
        let beyond = |account: &Volume<f32, Mni>, share: f64| both(changed, &self.less_by_blood(account, share, floor));
        let clearly = both(&beyond(&self.oedema, CLEARLY_LESS), &beyond(&self.brighter, CLEARLY_LESS));
        if share(&clearly) < LEAST_BEYOND_BOTH {
            return changed.map(|_| false);
        }
        let mut believed = changed.clone();
        let (oedema, brighter) = (beyond(&self.oedema, LESS), beyond(&self.brighter, LESS));
        if share(&oedema) < LEAST_BEYOND_OEDEMA {
            believed = both(&believed, &dilate(&oedema, AROUND_MM));
        }
        if share(&brighter) < LEAST_BEYOND_BRIGHTER || brighter.volume_cc() < smallest_cc {
            believed = both(&believed, &brighter);
        }
        believed
    }
}

/// The gain that is left between the scans, by the grey matter whose folds are still there: blood has none, and oedema leaves grey
/// matter as it was. Windows whose folds had less than a sixth of the contrast between grey and white matter (as standard
/// deviation) had nothing to lose and say nothing.
fn gain_left(
    pair: &SaggedPair<'_>,
    comparable: &Mask<Mni>,
    before: &Volume<f32, Mni>,
    after: &Volume<f32, Mni>,
    kept: f32,
) -> Volume<f32, Mni> {
    let window = Window::new(comparable, FOLDS_MM);
    let (mean_a, mean_b) = (window.mean(before), window.mean(after));
    let [aa, bb, ab] = [(before, before), (after, after), (before, after)].map(|(x, y)| window.mean(&product(x, y)));
    let least = (pair.grey_white_contrast / 6.0).powi(2) as f32;
    let grey = (pair.csf_grey_border as f32)..((pair.grey_mean + pair.grey_white_contrast / 3.0) as f32);
    let same = Mask::from_fn(before.grid, |n| {
        let (ma, mb) = (mean_a.data[n], mean_b.data[n]);
        let (var_a, var_b) = (aa.data[n] - ma * ma, bb.data[n] - mb * mb);
        let folds = || ab.data[n] - ma * mb > kept * (var_a * var_b.max(0.1 * least)).sqrt();
        comparable.data[n] && pair.tissue.data[n] && grey.contains(&before.data[n]) && var_a > least && folds()
    });
    let ratio = |n: usize| if same.data[n] { (after.data[n] / before.data[n]).ln() } else { 0.0 };
    Window::new(&same, GAIN_MM).mean(&Volume::from_fn(before.grid, ratio)).map(f32::exp)
}

fn variance(square: &Volume<f32, Mni>, mean: &Volume<f32, Mni>) -> Volume<f32, Mni> {
    Volume::from_fn(mean.grid, |n| (square.data[n] - mean.data[n] * mean.data[n]).max(0.0))
}

fn product(x: &Volume<f32, Mni>, y: &Volume<f32, Mni>) -> Volume<f32, Mni> {
    Volume::from_fn(x.grid, |n| x.data[n] * y.data[n])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;
    use nalgebra::Point3;

    const FLUID: f32 = 40.0;
    const GREY: f32 = 120.0;
    const WHITE: f32 = 180.0;

    fn at(grid: &Grid<Mni>, n: usize) -> Point3<f64> {
        grid.position(grid.voxel(n).map(|c| c as f64).into()).mm
    }

    fn folds(p: Point3<f64>) -> f32 {
        if (0.55 * p.x + 0.3 * p.z).sin() > 0.0 { WHITE } else { GREY }
    }

    /// Folds of grey and white matter with a ball of fluid of 12 mm at the origin, of which `shown` says what the second scan shows
    /// by the place and what was there; the cavity that is found beyond the ball and what is left in doubt, in cc.
    fn found_and_in_doubt_cc(shown: impl Fn(Point3<f64>, f32) -> f32 + Sync + Send) -> (f64, f64) {
        let (found, ball_cc) = in_tissue(folds, shown);
        (found.cavity.volume_cc() - ball_cc, found.in_doubt_cc)
    }

    /// The same in tissue that `was` so; with the volume of the ball, cc.
    fn in_tissue(
        was: impl Fn(Point3<f64>) -> f32 + Sync + Send,
        shown: impl Fn(Point3<f64>, f32) -> f32 + Sync + Send,
    ) -> (WithBlood, f64) {
        let grid = Grid::<Mni>::axis_aligned([64; 3], [1.0; 3], [-31.5; 3]);
        let pre = Volume::from_fn(grid, |n| was(at(&grid, n)));
        let cavity = Mask::from_fn(grid, |n| at(&grid, n).coords.norm() < 12.0);
        let post = Volume::from_fn(grid, |n| if cavity.data[n] { FLUID } else { shown(at(&grid, n), pre.data[n]) });
        let all = cavity.map(|_| true);
        let pair = SaggedPair {
            pre: &pre,
            tissue: &all,
            brain: &all,
            post: &post,
            post_known: &all,
            csf_grey_border: f64::from(0.5 * (FLUID + GREY)),
            grey_mean: f64::from(GREY),
            grey_white_contrast: f64::from(WHITE - GREY),
        };
        (with_blood(&cavity, &pair, &CavitySettings::default()), cavity.volume_cc())
    }

    #[test]
    fn doubt_is_told_from_the_least_size_of_a_cavity_and_a_blind_wall_from_nine_tenths() {
        let told = |in_doubt_cc, blind_share| {
            let cavity = Mask::from_fn(Grid::<Mni>::axis_aligned([2; 3], [1.0; 3], [0.0; 3]), |_| true);
            WithBlood { cavity, in_doubt_cc, blind_share }.told(1.0).collect::<Vec<_>>()
        };
        assert_eq!(told(0.9, 0.89), []);
        let both = [SegmentWarning::ChangedBeside { cc: 1.1 }, SegmentWarning::BloodUntold { percent: 95.0 }];
        assert_eq!(told(1.1, 0.95), both);
    }

    #[test]
    fn where_no_folds_were_or_none_are_seen_blood_could_not_be_told() {
        let blind =
            |was: fn(Point3<f64>) -> f32, shown: fn(Point3<f64>, f32) -> f32| in_tissue(was, shown).0.blind_share;
        assert!(blind(folds, |_, was| was) < 0.1);
        assert_eq!(blind(|_| GREY, |_, was| was), 1.0);
        // Oedema before the operation, on one side.
        let half = blind(|p| if p.x > 0.0 { GREY } else { folds(p) }, |_, was| was);
        assert!((0.4..0.6).contains(&half), "{half}");
        // A second scan whose folds are elsewhere shows none of these.
        let elsewhere = blind(folds, |p, _| folds(Point3::new(p.x + 4.0, p.y, p.z)));
        assert_eq!(elsewhere, 1.0);
    }

    /// A pool below the ball, 22 mm wide.
    fn in_pool(p: Point3<f64>) -> bool {
        p.coords.norm() >= 12.0 && (p - Point3::new(0.0, 0.0, -9.0)).norm() < 11.0
    }

    fn pool_cc() -> f64 {
        let grid = Grid::<Mni>::axis_aligned([64; 3], [1.0; 3], [-31.5; 3]);
        Mask::from_fn(grid, |n| in_pool(at(&grid, n))).volume_cc()
    }

    #[test]
    fn a_pool_is_told_from_folds_from_half_way_between_the_tissues_to_white_matter() {
        for blood in [150.0, 165.0, 180.0] {
            let (found, _) = found_and_in_doubt_cc(|p, was| if in_pool(p) { blood } else { was });
            assert!((0.75..1.25).contains(&(found / pool_cc())), "{blood}: {found} of {}", pool_cc());
        }
    }

    #[test]
    fn oedema_that_hides_all_folds_around_the_cavity_is_no_blood() {
        for left in [0.0, 0.2, -0.2] {
            let oedema = |p: Point3<f64>, was: f32| {
                if p.coords.norm() < 22.0 && was > GREY { GREY + left * (WHITE - GREY) } else { was }
            };
            let (found, in_doubt) = found_and_in_doubt_cc(oedema);
            assert!(found == 0.0 && in_doubt > 1.0, "{left}: {found} and {in_doubt} cc");
        }
    }

    /// Contrast agent in the outer 2.5 mm of the bed.
    fn enhanced(p: Point3<f64>) -> f32 {
        if p.coords.norm() < 14.5 { 80.0 } else { 0.0 }
    }

    #[test]
    fn a_bed_that_contrast_agent_has_made_brighter_is_no_blood() {
        let (found, in_doubt) = found_and_in_doubt_cc(|p, was| was + enhanced(p));
        assert!(found == 0.0 && in_doubt > 1.0, "{found} and {in_doubt} cc");
    }

    #[test]
    fn contrast_agent_in_the_bed_and_oedema_around_it_are_no_blood() {
        let oedema = |p: Point3<f64>, was: f32| if p.coords.norm() < 22.0 { was.min(GREY) } else { was };
        let (found, in_doubt) = found_and_in_doubt_cc(|p, was| oedema(p, was) + enhanced(p));
        assert!(found == 0.0 && in_doubt > 1.0, "{found} and {in_doubt} cc");
    }

    #[test]
    fn folds_that_thick_slices_have_blurred_are_no_blood() {
        let slice = |p: Point3<f64>| {
            let across = |k: i32| Point3::new(p.x + f64::from(k), p.y, p.z);
            (-4..=4).map(|k| folds(across(k))).sum::<f32>() / 9.0
        };
        assert_eq!(found_and_in_doubt_cc(|p, _| slice(p)), (0.0, 0.0));
    }

    #[test]
    fn folds_that_are_still_there_under_another_gain_are_no_blood() {
        assert_eq!(found_and_in_doubt_cc(|_, was| was), (0.0, 0.0));
        assert_eq!(found_and_in_doubt_cc(|p, was| was * (0.15 + 0.004 * p.x).exp() as f32), (0.0, 0.0));
    }
}
