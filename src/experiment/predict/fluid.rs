//! Where fluid of a known level stands with each head, and how much of it has drained then.

use super::head::Head;
use super::settings::PredictSettings;
use super::uncertain::Uncertain;
use crate::experiment::estimate::Z_95;
use crate::experiment::resection::CsfSettings;
use crate::experiment::skull::{Depths, depths};
use crate::fem::CsfLevel;
use crate::geometry::{Frame, Position};
use crate::image::LabelMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Why no fluid can stand there.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum LevelError {
    #[error(
        "`fluid_level.below_top_mm` of the table [predict] is {below_top_mm}, and with the head {head} the brain is {deep_mm:.0} mm deep along \
         gravity: give less, or the part that has drained (`drained = 1`: no fluid is left)"
    )]
    BelowBrain { below_top_mm: f64, head: Head, deep_mm: f64 },
    #[error(
        "`fluid_level` of the table [predict]: the labels show no brain whose highest point a level could be counted from; look at the \
         segmentation"
    )]
    NoBrain,
}

/// Where the fluid stands with one head.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FluidOfHead {
    /// How far below the brain's highest point, mm.
    pub below_top_mm: f64,
    /// 95 % of the draws lie between, mm.
    pub interval_95_mm: [f64; 2],
    /// That highest point, mm.
    pub top_at_mm: [f64; 3],
    /// The part of the fluid seen on the scan that lies above the level, and so has drained. Absent where the labels show none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drained: Option<f64>,
    /// That part at either end of the interval.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drained_95: Option<[f64; 2]>,
}

impl FluidOfHead {
    /// What part has drained, in words.
    pub fn drained_in_words(&self) -> String {
        match (self.drained, self.drained_95) {
            (Some(part), Some([low, high])) => {
                format!("{:.0} % ({:.0} to {:.0} %)", 100.0 * part, 100.0 * low, 100.0 * high)
            }
            _ => "no fluid on the scan".to_owned(),
        }
    }
}

impl PredictSettings {
    /// The fluid as a load and the unknown that its level is, where the level is known, for gravity in the labels' frame.
    pub fn known_fluid<F: Frame>(
        &self,
        csf: Option<&CsfSettings>,
        labels: &LabelMap<F>,
        gravity: [f64; 3],
    ) -> Option<(CsfLevel, Uncertain)> {
        let level = self.fluid_level.as_ref()?;
        let top_mm = depths(labels, gravity)?.top_mm;
        let density_kg_per_m3 = csf.cloned().unwrap_or_default().density_kg_per_m3;
        Some((CsfLevel { density_kg_per_m3, level_mm: top_mm - level.below_top_mm }, level.uncertain(top_mm)))
    }

    /// Where the fluid stands with one head, where that is known; the place is in the labels' frame.
    ///
    /// # Errors
    /// [`LevelError`] for a level that is below all of the brain.
    pub fn fluid_of_head<F: Frame>(
        &self,
        head: &Head,
        labels: &LabelMap<F>,
        gravity: [f64; 3],
    ) -> Result<Option<(FluidOfHead, Position<F>)>, LevelError> {
        let Some(level) = &self.fluid_level else { return Ok(None) };
        let Depths { top_mm, lowest_mm, top_at, fluid_mm } = depths(labels, gravity).ok_or(LevelError::NoBrain)?;
        let (below_top_mm, deep_mm) = (level.below_top_mm, top_mm - lowest_mm);
        if below_top_mm > deep_mm {
            return Err(LevelError::BelowBrain { below_top_mm, head: *head, deep_mm });
        }
        let part = |below: f64| {
            let above = fluid_mm.iter().filter(|height| **height > top_mm - below).count();
            (!fluid_mm.is_empty()).then(|| rounded(above as f64 / fluid_mm.len() as f64))
        };
        let ends = [-Z_95, Z_95].map(|z| (below_top_mm + z * level.sd_mm).max(0.0));
        let found = FluidOfHead {
            below_top_mm,
            interval_95_mm: ends.map(rounded),
            top_at_mm: [0.0; 3],
            drained: part(below_top_mm),
            drained_95: part(ends[0]).zip(part(ends[1])).map(|(low, high)| [low, high]),
        };
        Ok(Some((found, top_at)))
    }
}

fn rounded(x: f64) -> f64 {
    (x * 1e3).round() / 1e3 + 0.0
}

#[cfg(test)]
mod tests {
    use super::super::known_level::KnownLevel;
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;
    use crate::segment::label;

    /// A brain of 40 mm, 20 mm wide, under 10 mm of fluid, with a ventricle of as much fluid in its middle.
    fn labels() -> LabelMap<Mni> {
        let grid = Grid::<Mni>::axis_aligned([20, 60, 20], [1.0; 3], [0.0, -20.0, 0.0]);
        let label = |n: usize| match grid.voxel(n)[1] {
            20..=24 | 35..=39 => label::GREY_MATTER,
            10..=19 | 40..=49 => label::WHITE_MATTER,
            25..=34 => label::VENTRICLE,
            50..=59 => label::CSF,
            _ => label::BACKGROUND,
        };
        LabelMap::from_data(grid, (0..grid.len()).map(label).collect())
    }

    fn known(below_top_mm: f64, sd_mm: f64) -> PredictSettings {
        PredictSettings { fluid_level: Some(KnownLevel { below_top_mm, sd_mm }), ..PredictSettings::default() }
    }

    fn found(below_top_mm: f64, head: Head, down: [f64; 3]) -> Result<(FluidOfHead, Position<Mni>), LevelError> {
        known(below_top_mm, 2.0).fluid_of_head(&head, &labels(), down).map(Option::unwrap)
    }

    #[test]
    fn a_level_is_counted_from_the_brain_and_not_from_the_fluid_along_gravity_of_each_head() {
        let (supine, down) = (Head::Supine, [0.0, -9.81, 0.0]);
        let (at_top, place) = found(0.0, supine, down).unwrap();
        assert_eq!((at_top.drained, place.mm.y, at_top.interval_95_mm[0]), (Some(0.5), 29.0, 0.0));
        // Half way down the ventricle; on the face the fluid over the brain lies lowest.
        assert_eq!(found(20.0, supine, down).unwrap().0.drained, Some(0.75));
        let (prone, _) = found(20.0, Head::Prone, [0.0, 9.81, 0.0]).unwrap();
        assert_eq!(prone.drained, Some(0.25));
        let [low, high] = prone.drained_95.unwrap();
        assert!(low < 0.25 && high > 0.25 && prone.interval_95_mm == [16.08, 23.92], "{prone:?}");
    }

    #[test]
    fn a_level_above_or_below_the_brain_is_refused_with_what_to_do() {
        let said = found(45.0, Head::Supine, [0.0, -9.81, 0.0]).unwrap_err().to_string();
        for words in ["is 45", "head supine", "39 mm deep", "`drained = 1`"] {
            assert!(said.contains(words), "{words}: {said}");
        }
        assert!(
            found(45.0, Head::Left, [-9.81, 0.0, 0.0]).is_err() && found(15.0, Head::Left, [-9.81, 0.0, 0.0]).is_ok()
        );
        for (below, sd, words) in [(-1.0, 5.0, "just covered"), (f64::NAN, 5.0, "0 (the brain"), (20.0, -1.0, "sd_mm")]
        {
            assert!(known(below, sd).check().unwrap_err().to_string().contains(words), "{below}");
        }
        let both = PredictSettings { drained: Some(0.3), ..known(20.0, 5.0) };
        let said = both.check().unwrap_err().to_string();
        assert!(said.contains("`drained`") && said.contains("give one of the two"), "{said}");
        let none = labels().map(|_| label::CSF);
        assert_eq!(known(1.0, 5.0).fluid_of_head(&Head::Supine, &none, [0.0, -9.81, 0.0]), Err(LevelError::NoBrain));
    }

    #[test]
    fn draws_of_a_known_level_lie_around_it_and_never_above_the_brain() {
        let down = [0.0, -9.81, 0.0];
        let (load, uncertain) = known(10.0, 5.0).known_fluid(None, &labels(), down).unwrap();
        let all = super::super::uncertain::Uncertainty::new(vec![uncertain]);
        assert_eq!(
            (load.level_mm, all.centre()[0], all.point(&[-4.0])[0], all.point(&[1.0])[0]),
            (19.0, 19.0, 29.0, 14.0)
        );
    }
}
