//! The verdict: what the numbers of a case amount to, found once and worded once. Terminal, page, tables and JSON take it
//! from here.
//!
//! Two lines are drawn, both before any patient was seen: three standard deviations for a contradiction, and odds of
//! e^3 = 20 to 1 for taking one explanation instead of another.

use super::moduli_in_words::{capitalised, words};
pub use super::moduli_in_words::{pa, range, with_interval};
use super::parameter_name::in_words;
use super::way_down::other_way;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// From how many standard deviations on two figures contradict each other (2.7 in a thousand by chance).
pub const CONTRADICTION_SD: f64 = 3.0;
/// Logarithm of the odds from which one of two models is taken (20 to 1: "strong" of Kass and Raftery, Journal of the
/// American Statistical Association 90, 1995).
pub const STRONG: f64 = 3.0;

/// What it comes down to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Finding {
    /// Nothing has moved that could be told from noise: a bound on the stiffness, no estimate.
    NoShift,
    /// Something has moved, and the model does not explain it: no stiffness.
    Unexplained,
    /// The model explains the shift only with a stiffness that no tissue has, or with a load that was not there.
    Conflict,
    /// Several models explain the shift about as well: the figures are averages over them.
    CannotTell,
    /// Of models that explain the shift about as well one claims a stiffness and another none: no stiffness.
    ModelsDisagree,
    /// The shift is explained, and says little of the stiffness: the interval is the prior's.
    PriorDominated,
    /// The shift is explained but for more than the measurement's noise, and the intervals are as much wider.
    Widened,
    /// The shift is explained, and the stiffness follows from it.
    Identified,
    /// A sample explains the surfaces better than rest does.
    Better,
    /// No sample can be told from rest.
    NotDistinguishable,
    /// Every sample is further from the surfaces than rest is.
    Worse,
    /// A phantom's known moduli: the best of the samples is the one nearest to them.
    Recovered,
    /// A phantom's known moduli: another sample than the nearest one is the best.
    NotRecovered,
    /// No simulation has reached an equilibrium.
    NoEquilibrium,
    /// One head twice, and nothing was taken out.
    NoOperation,
    /// Two heads.
    NotOnePerson,
    /// The operation is still to come: there is nothing to be compared with.
    Predicted,
    /// Nothing was simulated.
    #[default]
    Nothing,
}

impl Finding {
    /// A state's distance from what was seen against that at rest, mm: a difference below the floor means nothing.
    pub fn against_rest(rest_mm: f64, deformed_mm: f64, floor_mm: f64) -> Self {
        if rest_mm - deformed_mm > floor_mm {
            Self::Better
        } else if deformed_mm - rest_mm > floor_mm {
            Self::Worse
        } else {
            Self::NotDistinguishable
        }
    }

    /// Whether the figures of the stiffness may be read as an answer.
    pub fn has_stiffness(self) -> bool {
        matches!(
            self,
            Self::Identified
                | Self::Widened
                | Self::PriorDominated
                | Self::CannotTell
                | Self::Better
                | Self::Recovered
                | Self::NotRecovered
        )
    }

    /// In a few words, for a column of a table.
    pub fn short(self) -> &'static str {
        match self {
            Self::NoShift => "no shift seen",
            Self::Unexplained => "shift not explained",
            Self::Conflict => "contradicts what is known",
            Self::CannotTell => "cannot tell",
            Self::ModelsDisagree => "models disagree",
            Self::PriorDominated => "the prior's",
            Self::Widened => "widened by what is unexplained",
            Self::Identified => "identified",
            Self::Better => "better than rest",
            Self::NotDistinguishable => "not distinguishable from rest",
            Self::Worse => "worse than rest",
            Self::Recovered => "found again",
            Self::NotRecovered => "not found again",
            Self::NoEquilibrium => "no equilibrium",
            Self::NoOperation => "no operation seen",
            Self::NotOnePerson => "not one person",
            Self::Predicted => "predicted",
            Self::Nothing => "nothing simulated",
        }
    }
}

/// What speaks for a finding, with its figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Reason {
    /// Movement against stillness.
    StillAsProbable {
        /// Logarithm of the odds of movement.
        log_odds: f64,
        /// The smallest shift (at its largest place) that would have been seen, mm.
        would_be_seen_mm: f64,
    },
    /// Whatever is seen to move moves by less than the measurement's noise.
    WithinNoise {
        /// Size of the measurement's noise, mm.
        noise_mm: f64,
        /// The smallest shift (at its largest place) that would have been seen, mm.
        would_be_seen_mm: f64,
    },
    /// What is left is above what the measurement is worth.
    Discrepancy {
        /// Size of the discrepancy, mm.
        discrepancy_mm: f64,
        /// Size of the measurement's noise, mm.
        noise_mm: f64,
    },
    /// What has moved has moved another way than gravity as assumed would take it.
    OtherWayDown {
        /// Mean of the displacement seen, mm (MNI frame).
        seen_mm: [f64; 3],
        /// Gravity as assumed, m/s2 (MNI frame).
        gravity_m_per_s2: [f64; 3],
    },
    /// A smooth movement without any mechanics is as good an explanation.
    NoBetterThanAnyMovement {
        /// Logarithm of the odds of the model against it.
        log_odds: f64,
    },
    /// A parameter far from what is known of it.
    FarFromPrior {
        /// The parameter.
        name: String,
        /// Standard deviations of the prior.
        sd: f64,
    },
    /// Another model is about as probable.
    AnotherModel {
        /// The two.
        models: [String; 2],
        /// Logarithm of the odds between them.
        log_odds: f64,
    },
    /// A model of other tissues is about as probable: of those of this verdict it says nothing.
    OtherTissues {
        /// It.
        model: String,
        /// Logarithm of the odds against it.
        log_odds: f64,
    },
    /// A model that is about as probable claims no stiffness.
    RivalWithholds {
        /// It.
        model: String,
        /// Logarithm of the odds against it.
        log_odds: f64,
        /// What it comes down to on its own.
        finding: Finding,
    },
    /// The best state of a surface's set against rest.
    Surface {
        /// The set: `margin`.
        set: String,
        /// RMSE at rest, mm.
        rest_mm: f64,
        /// RMSE deformed, mm.
        deformed_mm: f64,
        /// What the measurement is worth, mm.
        floor_mm: f64,
    },
    /// The moduli that cannot be told from the best one.
    AsGood {
        /// The tissue.
        tissue: String,
        /// From and to, Pa.
        pa: [f64; 2],
    },
    /// Only one modulus was tried: that it is the best says nothing.
    OneTried {
        /// The tissue.
        tissue: String,
        /// It, Pa.
        tried_pa: f64,
    },
    /// The range of the samples as good as the best ends only where what was tried does.
    EndOfTried {
        /// The tissue.
        tissue: String,
        /// The end, Pa.
        tried_pa: f64,
        /// Whether it is the upper one.
        stiffest: bool,
    },
    /// The data add little to what was known of a parameter.
    LittleSaid {
        /// The parameter.
        name: String,
    },
    /// Which sample explains a phantom's reference best, and which has the moduli nearest to its own.
    Phantom {
        /// The best one.
        best: String,
        /// The nearest one.
        nearest: String,
    },
    /// A phantom's own modulus lies outside those of its samples.
    OutOfReach {
        /// The tissue.
        tissue: String,
        /// Its own, Pa.
        own_pa: f64,
        /// From and to of the samples, Pa.
        tried_pa: [f64; 2],
    },
    /// Samples without an equilibrium, of all of them.
    WithoutEquilibrium {
        /// How many.
        samples: usize,
        /// Of how many.
        of: usize,
    },
    /// Gravity fixes only a quotient.
    LoadAssumed,
    /// The same where tissue stands in fluid up to a level.
    LevelAssumed,
    /// Weight and other loads, all given: the moduli scale with them.
    LoadsAssumed,
    /// The descent was not finished.
    NotConverged,
    /// How the body answers to a shape a little other than it was taken to be was not found.
    ShapeTakenAsExact {
        /// How many of the amounts by which it may be off.
        amounts: usize,
    },
    /// Another model could not be solved to the end: it is neither refuted nor borne out.
    NotCompared {
        /// The model.
        model: String,
    },
}

impl Reason {
    /// In a sentence.
    pub fn sentence(&self) -> String {
        match self {
            Self::StillAsProbable { log_odds, would_be_seen_mm } => {
                let how = if *log_odds < -STRONG { "more probable" } else { "about as probable" };
                format!(
                    "that nothing has moved is {how} (log odds of a shift {log_odds:.1}); a shift of {would_be_seen_mm:.1} mm at \
                     its largest place would have been seen"
                )
            }
            Self::WithinNoise { noise_mm, would_be_seen_mm } => format!(
                "whatever moves does so by less than the measurement's noise of {noise_mm:.2} mm; a shift of {would_be_seen_mm:.1} \
                 mm at its largest place would have been seen"
            ),
            Self::Discrepancy { discrepancy_mm, noise_mm } => format!(
                "the model leaves {discrepancy_mm:.2} mm in each direction unexplained, the measurement is good to \
                 {noise_mm:.2} mm"
            ),
            Self::OtherWayDown { seen_mm, gravity_m_per_s2 } => format!(
                "{}; which way was down for the second scan is `gravity_m_per_s2` of the table [resection]",
                other_way(seen_mm, gravity_m_per_s2)
            ),
            Self::NoBetterThanAnyMovement { log_odds } => {
                format!("any smooth movement explains what is seen as well as this load does (log odds {log_odds:.1})")
            }
            Self::FarFromPrior { name, sd } => {
                let (name, _) = in_words(name);
                format!("the {name} comes out {sd:.1} standard deviations from what is known of it")
            }
            Self::AnotherModel { models: [a, b], log_odds } => {
                format!("{a} and {b} explain the shift about as well (log odds {log_odds:.1})")
            }
            Self::OtherTissues { model, log_odds } => {
                format!("{model}, whose tissues are others, explains the shift about as well (log odds {log_odds:.1})")
            }
            Self::RivalWithholds { model, log_odds, finding } => {
                let finding = finding.short();
                format!("{model} is about as probable as the best model (log odds {log_odds:.1}) and claims no stiffness ({finding})")
            }
            Self::Surface { set, rest_mm, deformed_mm, floor_mm } => format!(
                "{set}: {rest_mm:.2} mm at rest, {deformed_mm:.2} mm deformed, where {floor_mm:.2} mm can be told apart"
            ),
            Self::AsGood { tissue, pa } => format!("{}: {} cannot be told apart", words(tissue), range(*pa)),
            Self::OneTried { tissue, tried_pa } => {
                let (tissue, pa) = (words(tissue), pa(*tried_pa));
                format!("{tissue}: no modulus but {pa} Pa was tried, and nothing is claimed of it; give two levels or more")
            }
            Self::EndOfTried { tissue, tried_pa, stiffest } => {
                let (tissue, pa, way) = (words(tissue), pa(*tried_pa), if *stiffest { "stiff" } else { "soft" });
                format!("{tissue}: the {way}est sample tried ({pa} Pa) is as good as the best: {way}er ones were not tried")
            }
            Self::Phantom { best, nearest } if best == nearest => {
                format!("{best} explains the reference best and has the moduli nearest to its own")
            }
            Self::Phantom { best, nearest } => {
                format!("{best} explains the reference best, but {nearest} has the moduli nearest to its own")
            }
            Self::OutOfReach { tissue, own_pa, tried_pa } => {
                format!("{} of {} Pa lies outside the {} that were tried", words(tissue), pa(*own_pa), range(*tried_pa))
            }
            Self::WithoutEquilibrium { samples, of } => {
                format!("{samples} of {of} samples reached no equilibrium")
            }
            Self::LittleSaid { name } => format!("{name}: the interval comes from the prior, the data add little"),
            Self::LoadAssumed => {
                "gravity alone fixes only modulus / (density x g): the moduli are as good as the effective density assumed"
                    .to_owned()
            }
            Self::LevelAssumed => {
                "gravity alone fixes only modulus / weight: the moduli are as good as the fluid's level assumed".to_owned()
            }
            Self::LoadsAssumed => {
                "the loads fix only modulus / load: the moduli are as good as the density and the pressures or forces assumed".to_owned()
            }
            Self::NotConverged => "the search ended before the minimum was reached".to_owned(),
            Self::ShapeTakenAsExact { amounts } => format!(
                "what {amounts} of the amounts by which outline and supports may be off do was not found: the moduli take them as exact"
            ),
            Self::NotCompared { model } => {
                format!("{model} could not be solved to the end: whether it explains the shift as well is not known")
            }
        }
    }
}

/// What is said of a tissue's shear modulus.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Claim {
    /// Most probable value with its 95 % interval, Pa.
    Interval {
        /// Most probable.
        mode_pa: f64,
        /// 95 % interval.
        interval_95_pa: [f64; 2],
    },
    /// Stiffer than this, Pa, with 95 % certainty.
    Above {
        /// The bound.
        bound_pa: f64,
    },
    /// Anything between, Pa.
    Range {
        /// From and to.
        range_pa: [f64; 2],
    },
    /// Nothing.
    Withheld,
}

/// The verdict.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Verdict {
    /// What it comes down to.
    pub finding: Finding,
    /// One sentence or two.
    pub sentence: String,
    /// Share of the seen shift that the model explains: 1 - sum |seen - model|^2 / sum |seen|^2; absent where none was seen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub explained_share: Option<f64>,
    /// What is said of each tissue's shear modulus.
    #[serde(default)]
    pub moduli: Vec<(String, Claim)>,
    /// What speaks for it.
    #[serde(default)]
    pub reasons: Vec<Reason>,
}

impl Verdict {
    /// A verdict with its sentence.
    pub fn new(
        finding: Finding,
        explained_share: Option<f64>,
        moduli: Vec<(String, Claim)>,
        reasons: Vec<Reason>,
    ) -> Self {
        // Of a shift that was not seen there is no share: 0 would say that the model misses it.
        let explained_share = explained_share.filter(|_| finding != Finding::NoShift);
        let other = reasons.iter().find(|reason| matches!(reason, Reason::OtherTissues { .. }));
        let other = other.map_or_else(String::new, |other| format!(" {}.", capitalised(&other.sentence())));
        let sentence = sentence(finding, explained_share, &moduli, &reasons) + &other;
        Self { finding, sentence, explained_share, moduli, reasons }
    }

    /// Beside models that could not be solved: a stiffness that is claimed has not been compared with theirs, and a bound has to
    /// hold for every model.
    #[must_use]
    pub fn beside_unsolved(self, models: impl Iterator<Item = String>) -> Self {
        let bounds = self.moduli.iter().any(|(_, claim)| matches!(claim, Claim::Above { .. }));
        let claims = self.finding.has_stiffness() || bounds;
        let unsolved: Vec<Reason> = models.filter(|_| claims).map(|model| Reason::NotCompared { model }).collect();
        if unsolved.is_empty() {
            return self;
        }
        let Self { finding, explained_share, moduli, reasons, .. } = self.without_bounds();
        Self::new(finding, explained_share, moduli, reasons.into_iter().chain(unsolved).collect())
    }

    /// Where a model that it has to hold for gives no bound.
    #[must_use]
    pub fn without_bounds(self) -> Self {
        let held = |claim| if matches!(claim, Claim::Above { .. }) { Claim::Withheld } else { claim };
        let moduli = self.moduli.into_iter().map(|(tissue, claim)| (tissue, held(claim))).collect();
        Self::new(self.finding, self.explained_share, moduli, self.reasons)
    }

    /// The reasons in sentences.
    pub fn because(&self) -> Vec<String> {
        self.reasons.iter().map(Reason::sentence).collect()
    }
}

/// What is suspected where no stiffness is claimed.
fn suspects(are: &str, reasons: &[Reason]) -> String {
    let astray = reasons.iter().find_map(|reason| match reason {
        Reason::OtherWayDown { seen_mm, gravity_m_per_s2 } => Some(other_way(seen_mm, gravity_m_per_s2)),
        _ => None,
    });
    match astray {
        Some(way) => {
            format!("{}: the patient may have lain another way. No stiffness is claimed.", capitalised(&way))
        }
        None => format!("The load or the supports {are} as assumed; no stiffness is claimed."),
    }
}

fn sentence(finding: Finding, share: Option<f64>, moduli: &[(String, Claim)], reasons: &[Reason]) -> String {
    let each = |of: &dyn Fn(&Claim) -> Option<String>| {
        let parts = moduli.iter().filter_map(|(t, a)| of(a).map(|text| format!("{} {text}", words(t))));
        parts.collect::<Vec<_>>().join(", ")
    };
    let intervals = each(&|a| match a {
        Claim::Interval { mode_pa, interval_95_pa } => Some(with_interval(*mode_pa, *interval_95_pa)),
        _ => None,
    });
    let bounds = each(&|a| match a {
        Claim::Above { bound_pa } => Some(format!("is stiffer than {} Pa", pa(*bound_pa))),
        _ => None,
    });
    let ranges = each(&|a| match a {
        Claim::Range { range_pa } => Some(range(*range_pa)),
        _ => None,
    });
    let percent = share.map(|s| format!(" ({:.0} % of it)", 100.0 * s)).unwrap_or_default();
    let first = reasons.first().map(Reason::sentence).unwrap_or_default();
    match finding {
        Finding::NoShift if bounds.is_empty() => format!("No shift seen: {first}. No stiffness is claimed."),
        Finding::NoShift => format!("No shift seen: {first}. With the load and the supports as assumed, {bounds}."),
        Finding::Unexplained => {
            format!("The model does not explain the shift: {first}. {}", suspects("may not be", reasons))
        }
        Finding::Conflict => {
            format!("Conflict: the shift contradicts what is known: {first}. {}", suspects("are not", reasons))
        }
        Finding::CannotTell => {
            // The first is in the sentence already.
            let more = reasons.iter().filter(|r| matches!(r, Reason::AnotherModel { .. })).count().saturating_sub(1);
            let more = if more > 0 { format!(" and {more} more about as probable") } else { String::new() };
            format!("Cannot tell: {first}. Averaged over them{more}: {intervals}.")
        }
        Finding::ModelsDisagree => format!("Cannot tell: {first}. No stiffness is claimed."),
        Finding::PriorDominated => format!(
            "The model explains the shift{percent}, which says little of the stiffness: the interval is the prior's. \
             {}.",
            capitalised(&intervals)
        ),
        Finding::Widened => format!(
            "The model explains the shift{percent}, but not to the measurement's precision: the intervals are widened. {}.",
            capitalised(&intervals)
        ),
        Finding::Identified => format!("The model explains the shift{percent}: {intervals}."),
        Finding::Better if ranges.is_empty() => {
            format!("A sample explains the surfaces better than rest does.{}", limits_of_tried(reasons))
        }
        Finding::Better => {
            let against = |r: &&Reason| matches!(r, Reason::Surface { .. });
            let rest = reasons.iter().find(against).map(|r| format!(" ({})", r.sentence())).unwrap_or_default();
            format!("Better than rest{rest}; samples as good as the best have {ranges}.{}", limits_of_tried(reasons))
        }
        Finding::NotDistinguishable => format!("No sample can be told from rest ({first}). No stiffness is claimed."),
        Finding::Worse => format!("Every sample is further away than rest ({first}). No stiffness is claimed."),
        Finding::Recovered => format!("The known moduli are found again: {first} ({ranges})."),
        Finding::NotRecovered => format!("The known moduli are not found again: {first}; the best has {ranges}."),
        Finding::NoEquilibrium => format!("No stiffness is claimed: {first}."),
        Finding::NoOperation => "No operation is seen: no stiffness is claimed.".to_owned(),
        Finding::NotOnePerson => "The two scans do not show one person: nothing was compared.".to_owned(),
        Finding::Predicted => {
            "A prediction: the operation is still to come, nothing was compared, and no stiffness is claimed."
                .to_owned()
        }
        Finding::Nothing => "Prepared only: nothing was simulated, and no stiffness is claimed.".to_owned(),
    }
}

/// What was not tried, or was and has failed: no range is without it.
fn limits_of_tried(reasons: &[Reason]) -> String {
    use Reason::{EndOfTried, OneTried, WithoutEquilibrium};
    let limit = |r: &&Reason| matches!(r, OneTried { .. } | EndOfTried { .. } | WithoutEquilibrium { .. });
    let said: Vec<String> =
        reasons.iter().filter(limit).map(|reason| format!(" {}.", capitalised(&reason.sentence()))).collect();
    said.concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn interval(tissue: &str, mode_pa: f64) -> (String, Claim) {
        (tissue.to_owned(), Claim::Interval { mode_pa, interval_95_pa: [0.8 * mode_pa, 1.25 * mode_pa] })
    }

    #[test]
    fn a_stiffness_is_only_in_the_sentence_of_a_finding_that_has_one() {
        let reasons = vec![Reason::FarFromPrior { name: "shear_modulus_pa of grey_matter".to_owned(), sd: 4.6 }];
        for finding in [Finding::NoShift, Finding::Unexplained, Finding::Conflict] {
            let verdict = Verdict::new(finding, Some(0.9), vec![interval("grey_matter", 41526.0)], reasons.clone());
            assert!(!finding.has_stiffness() && !verdict.sentence.contains("41,500"), "{}", verdict.sentence);
            assert!(
                verdict.sentence.contains("the shear modulus of grey matter comes out 4.6"),
                "{}",
                verdict.sentence
            );
        }
        for finding in [Finding::Identified, Finding::Widened, Finding::PriorDominated, Finding::CannotTell] {
            let verdict = Verdict::new(finding, Some(0.97), vec![interval("grey_matter", 1170.0)], reasons.clone());
            assert!(finding.has_stiffness() && verdict.sentence.contains("rey matter 1,170 Pa (936 to 1,460)"));
        }
    }

    #[test]
    fn a_model_that_could_not_be_solved_is_named_where_a_stiffness_is_claimed() {
        let of = |finding| {
            let interval = Claim::Interval { mode_pa: 1000.0, interval_95_pa: [800.0, 1250.0] };
            let alone = Verdict::new(finding, Some(0.99), vec![("grey_matter".to_owned(), interval)], Vec::new());
            alone.beside_unsolved(std::iter::once("supports sliding".to_owned())).because()
        };
        assert!(of(Finding::Identified)[0].starts_with("supports sliding could not be solved"));
        assert_eq!(of(Finding::NoShift), Vec::<String>::new());
    }

    #[test]
    fn a_bound_is_none_beside_a_model_that_could_not_be_solved() {
        let still = Reason::StillAsProbable { log_odds: -2.0, would_be_seen_mm: 0.64 };
        let bound = ("grey_matter".to_owned(), Claim::Above { bound_pa: 2140.0 });
        let alone = Verdict::new(Finding::NoShift, None, vec![bound], vec![still.clone()]);
        assert_eq!(alone.clone().beside_unsolved(std::iter::empty()), alone);
        let model = "supports sliding".to_owned();
        let beside = alone.beside_unsolved(std::iter::once(model.clone()));
        assert_eq!(beside.moduli, [("grey_matter".to_owned(), Claim::Withheld)]);
        assert_eq!(beside.reasons, [still, Reason::NotCompared { model }]);
        assert!(!beside.sentence.contains("2,140"), "{}", beside.sentence);
    }

    #[test]
    fn a_load_that_pulls_another_way_is_named_as_the_suspect_in_the_sentence() {
        let left = Reason::Discrepancy { discrepancy_mm: 1.3, noise_mm: 0.1 };
        let other_way = Reason::OtherWayDown { seen_mm: [1.0, 0.1, 0.0], gravity_m_per_s2: [0.0, 0.0, -9.81] };
        let said = |reasons| Verdict::new(Finding::Unexplained, Some(0.02), Vec::new(), reasons).sentence;
        let named = said(vec![left.clone(), other_way]);
        assert!(named.contains("towards the right side, 90 degrees") && named.contains("lain another way"), "{named}");
        assert!(said(vec![left]).contains("The load or the supports may not be as assumed;"));
    }

    #[test]
    fn no_shift_gives_a_bound_and_names_what_would_have_been_seen() {
        let reason = Reason::StillAsProbable { log_odds: -2.0, would_be_seen_mm: 0.64 };
        let bound = ("grey_matter".to_owned(), Claim::Above { bound_pa: 2140.0 });
        let verdict = Verdict::new(Finding::NoShift, Some(0.0), vec![bound], vec![reason]);
        assert_eq!(verdict.explained_share, None, "of nothing there is no share");
        let text = verdict.sentence;
        assert!(text.contains("0.6 mm") && text.contains("grey matter is stiffer than 2,140 Pa"), "{text}");
        let said = |log_odds| Reason::StillAsProbable { log_odds, would_be_seen_mm: 0.64 }.sentence();
        assert!(said(-2.0).contains("about as probable") && said(-6.5).contains("moved is more probable"));
    }
}
