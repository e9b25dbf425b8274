//! A patient's unknowns with their priors, and what is assumed beside them.

use super::outcome::{Prediction, UnknownOutcome};
use super::settings::PredictSettings;
use super::uncertain::{Cause, Reading, Uncertain, Uncertainty};
use crate::experiment::estimate::{LogPrior, Scale, Turn, Unknown, Z_95};
use crate::experiment::prior::{PriorError, PriorSettings, law_priors};
use crate::experiment::resection::{CsfSettings, ResectionSettings, Supports};
use crate::experiment::sample::Tissue;
use crate::experiment::skull::levels_when_drained;
use crate::geometry::Frame;
use crate::image::LabelMap;

/// Name of the state of the first head; the others' follow it.
pub const PREDICTED: &str = "predicted";

impl PredictSettings {
    /// The tissues whose stiffness is not known.
    pub fn tissue_list(&self) -> Vec<Tissue> {
        if self.tissues == 1 { Tissue::whole_brain() } else { Tissue::grey_and_white() }
    }

    /// The patient's settings for one head (gravity in the MNI frame) and one way of supporting the brain.
    #[must_use]
    pub fn resection(&self, own: &ResectionSettings, gravity: [f64; 3], supports: Supports) -> ResectionSettings {
        let mut settings = ResectionSettings { supports, gravity_m_per_s2: gravity, ..own.clone() };
        if self.fluid_level.is_some() {
            // Its level is that of the head (`known_fluid`), whatever part of the fluid that leaves.
            settings.csf = None;
            settings.density_kg_per_m3 = self.tissue_density_kg_per_m3;
        } else if let Some(drained) = self.drained {
            settings.csf = Some(CsfSettings { drained, ..own.csf.clone().unwrap_or_default() });
            settings.density_kg_per_m3 = self.tissue_density_kg_per_m3;
        }
        settings
    }

    /// How probable each way of supporting the brain is; only what the settings of the patient leave open is weighed.
    pub fn weights(&self, own: &ResectionSettings) -> Vec<(Supports, f64)> {
        let family = own.supports.family();
        let weight = |supports| match supports {
            _ if family.len() == 1 => 1.0,
            Supports::Sliding => self.sliding_weight,
            Supports::Fixed | Supports::Evidence => self.fixed_weight,
        };
        let weighed: Vec<(Supports, f64)> = family.iter().map(|&s| (s, weight(s))).filter(|(_, w)| *w > 0.0).collect();
        let all: f64 = weighed.iter().map(|(_, w)| w).sum();
        weighed.into_iter().map(|(s, w)| (s, w / all)).collect()
    }

    /// All that is not known of a patient, for one head. `own` is [`Self::resection`]'s.
    ///
    /// # Errors
    /// [`PriorError`].
    pub fn uncertainty<F: Frame>(
        &self,
        own: &ResectionSettings,
        prior: &PriorSettings,
        labels: &LabelMap<F>,
    ) -> Result<Uncertainty, PriorError> {
        let mut list = Vec::new();
        let mut add = |unknown: Unknown, prior: LogPrior, cause| {
            list.push(Uncertain { unknown, prior, cause, reading: Reading::Itself });
        };
        for (unknown, prior) in law_priors(&self.tissue_list(), &prior.for_predictions())? {
            add(unknown, prior, Cause::Stiffness);
        }
        if own.csf.is_none() && self.fluid_level.is_none() {
            let density = Unknown::Density.prior(own.density_kg_per_m3.ln(), self.density_log_sd);
            add(Unknown::Density, prior.learnt(density), Cause::Load);
        }
        for turn in [Turn::Nodding, Turn::Rolling] {
            let unknown = Unknown::GravityTurn(turn);
            let prior = unknown.prior(0.0, self.direction_sd_deg.to_radians());
            add(unknown, prior, Cause::Direction);
        }
        if let Some(sd) = self.poisson_log_sd {
            let unknown = Unknown::PoissonRatio;
            add(unknown.clone(), unknown.prior(unknown.scale().number(own.poisson_ratio), sd), Cause::Poisson);
        }
        if own.supports == Supports::Sliding && own.skull.gap_mm > 0.0 {
            let prior = Unknown::Gap(0).prior(own.skull.gap_mm.ln(), own.skull.gap_log_sd);
            add(Unknown::Gap(0), prior, Cause::Room);
        }
        let fluid = if let Some(csf) = &own.csf {
            let levels_mm = levels_when_drained(labels, own.gravity_m_per_s2);
            let prior = LogPrior {
                name: "part of the fluid that has drained".to_owned(),
                scale: Scale::Logarithm,
                ..Unknown::CsfLevel.prior(csf.drained.ln(), self.drained_log_sd)
            };
            let drained = |levels_mm| Uncertain {
                unknown: Unknown::CsfLevel,
                prior,
                cause: Cause::Load,
                reading: Reading::Drained(levels_mm),
            };
            levels_mm.map(drained)
        } else {
            self.known_fluid(None, labels, own.gravity_m_per_s2).map(|(_, uncertain)| uncertain)
        };
        // Right behind the stiffness, so that draws of it are the same for every way of supporting the brain.
        let place = list.iter().position(|u| u.cause != Cause::Stiffness).unwrap_or(list.len());
        list.splice(place..place, fluid);
        Ok(Uncertainty::new(list).with_seed(self.seed))
    }
}

impl UnknownOutcome {
    /// The prior of an unknown in its own unit, as draws have it: no more than all of the fluid drains, and none stands above the brain.
    pub fn of(uncertain: &Uncertain) -> Self {
        let prior = &uncertain.prior;
        let sd = prior.sd.unwrap_or(0.0);
        let [least, most] = match uncertain.reading {
            Reading::Itself => [f64::NEG_INFINITY, f64::INFINITY],
            Reading::Drained(_) => [0.0, 1.0],
            Reading::Below(_) => [0.0, f64::INFINITY],
        };
        let at = |z: f64| rounded(prior.scale.value(prior.mean + z * sd).clamp(least, most));
        Self { name: prior.name.clone(), cause: uncertain.cause, median: at(0.0), interval_95: [at(-Z_95), at(Z_95)] }
    }
}

fn rounded(x: f64) -> f64 {
    (x * 1e4).round() / 1e4 + 0.0
}

/// What was assumed, a sentence each; of `found` how the brain was supported is told.
pub fn assumptions(
    settings: &PredictSettings,
    (own, prior): (&ResectionSettings, &PriorSettings),
    found: &Prediction,
) -> Vec<String> {
    let stiffness = prior.source_of(&settings.tissue_list());
    let pressures: Vec<String> =
        own.pressure.iter().map(|load| format!("{} Pa on the {}", load.pressure_pa, load.set)).collect();
    let besides = if pressures.is_empty() {
        String::new()
    } else {
        format!(" Besides its weight it is under a pressure that is taken as known: {}.", pressures.join(", "))
    };
    let mut said = vec![
        format!(
            "The planned tissue is taken out and nothing else is done to the brain: no swelling, no retraction, no bleeding.{besides}"
        ),
        match settings.drained.or(own.csf.as_ref().map(|csf| csf.drained)) {
            _ if settings.fluid_level.is_some() => level_in_words(settings, found),
            Some(part) => format!(
                "About {:.0} % of the fluid drains from the top, give or take a factor of {:.1} and never more than all; tissue above its \
                 level has its own weight.",
                100.0 * part,
                settings.drained_log_sd.exp()
            ),
            None => format!(
                "How much fluid drains is not known: the tissue weighs about {:.0} kg/m3 more than what still carries it, give or take a \
                 factor of {:.1}.",
                own.density_kg_per_m3,
                settings.density_log_sd.exp()
            ),
        },
        "How much fluid drains, and so how heavy the brain is, is not taken to depend on how much tissue is taken: a small plan has the \
         same load as a large one."
            .to_owned(),
        format!("The head lies as it is said to, within about {:.0} degrees.", settings.direction_sd_deg),
        format!("How stiff this brain is, is not known: it is drawn from {stiffness}."),
    ];
    said.extend(prior.spread_of(&settings.tissue_list()));
    said.extend(held_in_words(found));
    if let Some(sd) = settings.poisson_log_sd {
        let at = |z: f64| Scale::LameRatio.value(Scale::LameRatio.number(own.poisson_ratio) + z * sd);
        said.push(format!(
            "How little tissue yields to a change of volume is not known either: Poisson's ratio is about {} (95 % between {:.2} and {:.3}), the \
             same in all tissue, and does not depend on how stiff the brain is.",
            own.poisson_ratio,
            at(-Z_95),
            at(Z_95)
        ));
    }
    said.extend(found.supports_in_words(&own.fixed));
    if found.slides() && own.skull.gap_mm > 0.0 {
        said.push(format!(
            "Where it slides, the skull stands about {} mm off it, give or take a factor of {:.1}; it pushes back and never pulls.",
            own.skull.gap_mm,
            own.skull.gap_log_sd.exp()
        ));
    }
    said
}

/// What was not drawn, where the brain has such tissue.
fn held_in_words(found: &Prediction) -> Option<String> {
    let held = found.held_shear_modulus_pa.iter();
    let held: Vec<String> = held.map(|(name, pa)| format!("{} at {pa:.0} Pa", name.replace('_', " "))).collect();
    (!held.is_empty()).then(|| {
        format!(
            "How stiff abnormal tissue is, is not drawn: its shear modulus is held at the mean of what is known of such tissue ({}).",
            held.join(", ")
        )
    })
}

/// Where the fluid is known to stand, and what part of it has drained then.
fn level_in_words(settings: &PredictSettings, found: &Prediction) -> String {
    let Some(level) = &settings.fluid_level else { return String::new() };
    let of_heads: Vec<String> = found
        .heads
        .iter()
        .filter_map(|h| Some(format!("{} with the head {}", h.fluid.as_ref()?.drained_in_words(), h.head)))
        .collect();
    format!(
        "The fluid stands {} mm below the brain's highest point, give or take {} mm, along gravity of the way the head lies; tissue above \
         has its own weight. Of the fluid on the scan so much has drained then: {}.",
        level.below_top_mm,
        level.sd_mm,
        of_heads.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::super::known_level::KnownLevel;
    use super::super::support::SupportWeight;
    use super::*;
    use crate::fem::PressureLoad;
    use crate::geometry::Mni;
    use crate::image::Grid;
    use crate::segment::label;

    fn labels() -> LabelMap<Mni> {
        let grid = Grid::<Mni>::axis_aligned([10, 20, 10], [1.0; 3], [0.0; 3]);
        LabelMap::filled(grid, label::CSF)
    }

    fn causes(settings: &PredictSettings, supports: Supports) -> Vec<Cause> {
        let own = settings.resection(&ResectionSettings::default(), [0.0, -9.81, 0.0], supports);
        let found = settings.uncertainty(&own, &PriorSettings::default(), &labels()).unwrap();
        found.list.iter().map(|u| u.cause).collect()
    }

    #[test]
    fn every_unknown_is_drawn_and_the_room_only_where_there_is_a_skull() {
        use Cause::{Direction, Load, Room, Stiffness};
        let settings = PredictSettings::default();
        let held = [Stiffness, Stiffness, Load, Direction, Direction];
        assert_eq!(causes(&settings, Supports::Fixed), held);
        assert_eq!(causes(&settings, Supports::Sliding), [&held[..], &[Room]].concat());
        let drained = PredictSettings { drained: Some(0.3), ..settings.clone() };
        assert_eq!(causes(&drained, Supports::Fixed), held);
        // Before the room, so that its draws are the same for every way of supporting the brain.
        let poisson = PredictSettings { poisson_log_sd: Some(0.7), ..settings };
        assert_eq!(causes(&poisson, Supports::Fixed), [&held[..], &[Cause::Poisson]].concat());
        assert_eq!(causes(&poisson, Supports::Sliding), [&held[..], &[Cause::Poisson, Room]].concat());
    }

    #[test]
    fn poissons_ratio_is_drawn_around_the_patients_and_never_reaches_a_half() {
        let settings = PredictSettings { poisson_log_sd: Some(2.0), ..PredictSettings::default() };
        for ratio in [0.35, 0.45, 0.49] {
            let own = ResectionSettings { poisson_ratio: ratio, ..ResectionSettings::default() };
            let own = settings.resection(&own, [0.0, -9.81, 0.0], Supports::Fixed);
            let drawn = settings.uncertainty(&own, &PriorSettings::default(), &labels()).unwrap();
            let place = drawn.of(Cause::Poisson)[0];
            let told = UnknownOutcome::of(&drawn.list[place]);
            assert!((told.median - ratio).abs() < 1e-9 && told.interval_95[1] < 0.5, "{told:?}");
            let of = |z: f64| Scale::LameRatio.value(drawn.point(&[z; 6])[place]);
            assert!([-6.0, -2.0, 2.0, 6.0].iter().all(|z| of(*z) > 0.0 && of(*z) < 0.5));
        }
        // What the setting says of its own spread.
        let usual = Scale::LameRatio.number(0.45);
        let [low, high] = [-Z_95, Z_95].map(|z| Scale::LameRatio.value(usual + 0.7 * z));
        assert!((low - 0.35).abs() < 5e-3 && (high - 0.49).abs() < 5e-3, "{low} {high}");
    }

    #[test]
    fn no_more_than_all_of_the_fluid_is_told_to_drain() {
        for (drained, highest) in [(1.0, 1.0), (0.3, 0.6571)] {
            let settings = PredictSettings { drained: Some(drained), ..PredictSettings::default() };
            let own = settings.resection(&ResectionSettings::default(), [0.0, -9.81, 0.0], Supports::Fixed);
            let found = settings.uncertainty(&own, &PriorSettings::default(), &labels()).unwrap();
            let told: Vec<UnknownOutcome> = found.list.iter().map(UnknownOutcome::of).collect();
            let part = told.iter().find(|u| u.name.contains("drained")).unwrap();
            assert!((part.interval_95[1] - highest).abs() < 1e-3 && part.median == drained, "{part:?}");
            assert!(told[0].interval_95[1] > 100.0, "a modulus has no such bound");
        }
    }

    #[test]
    fn every_cause_that_is_drawn_has_its_sentence() {
        let settings = PredictSettings::default();
        let told = |supports: Supports, settings: &PredictSettings| {
            let way = SupportWeight { supports: supports.name().to_owned(), weight: 1.0 };
            let found = Prediction { supports: vec![way], ..Prediction::default() };
            assumptions(settings, (&ResectionSettings::default(), &PriorSettings::default()), &found).join(" ")
        };
        let sliding = told(Supports::Sliding, &settings);
        for words in [
            "stiff this brain is",
            "not the spread from person to person",
            "fluid drains",
            "depend on how much tissue is taken",
            "within about 10 degrees",
            "skull stands about",
            "factor of 1.6",
        ] {
            assert!(sliding.contains(words), "{words}: {sliding}");
        }
        assert!(!told(Supports::Fixed, &settings).contains("skull stands"));
        assert!(told(Supports::Fixed, &settings).contains("held at its base and at the falx"));
        let pressure = vec![PressureLoad { set: "ventricle".to_owned(), pressure_pa: 1500.0 }];
        let own = ResectionSettings { pressure, fixed: vec!["base".to_owned()], ..ResectionSettings::default() };
        let way = SupportWeight { supports: Supports::Fixed.name().to_owned(), weight: 1.0 };
        let found = Prediction { supports: vec![way], ..Prediction::default() };
        let loaded = assumptions(&settings, (&own, &PriorSettings::default()), &found).join(" ");
        assert!(loaded.contains("1500 Pa on the ventricle") && loaded.contains("held at its base (weight"), "{loaded}");
        let drained = PredictSettings { drained: Some(0.3), ..settings };
        assert!(
            told(Supports::Fixed, &drained)
                .contains("30 % of the fluid drains from the top, give or take a factor of 1.5")
        );
        assert!(!sliding.contains("Poisson"));
        let poisson = PredictSettings { poisson_log_sd: Some(0.7), ..PredictSettings::default() };
        assert!(
            told(Supports::Fixed, &poisson).contains("Poisson's ratio is about 0.45 (95 % between 0.35 and 0.486)")
        );
        let held_shear_modulus_pa = [("tumour".to_owned(), 29_901.2)].into();
        let found = Prediction { held_shear_modulus_pa, ..found };
        let ill = assumptions(&PredictSettings::default(), (&own, &PriorSettings::default()), &found).join(" ");
        assert!(
            ill.contains("not drawn") && ill.contains("tumour at 29901 Pa") && !sliding.contains("abnormal"),
            "{ill}"
        );
        let fluid_level = Some(KnownLevel { below_top_mm: 25.0, sd_mm: 5.0 });
        let level = told(Supports::Fixed, &PredictSettings { fluid_level, ..PredictSettings::default() });
        assert!(
            level.contains("25 mm below the brain's highest point, give or take 5 mm")
                && !level.contains("is not known: the tissue")
        );
    }

    #[test]
    fn weights_are_those_of_what_is_left_open() {
        let settings = PredictSettings { fixed_weight: 1.0, sliding_weight: 3.0, ..PredictSettings::default() };
        let of = |supports| settings.weights(&ResectionSettings { supports, ..ResectionSettings::default() });
        assert_eq!(of(Supports::Evidence), [(Supports::Fixed, 0.25), (Supports::Sliding, 0.75)]);
        assert_eq!(of(Supports::Sliding), [(Supports::Sliding, 1.0)]);
    }
}
