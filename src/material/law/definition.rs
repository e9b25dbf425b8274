//! What a law says of itself: its parameters for files, its shear modulus, its solid, the curves it is fitted by.

use super::curve::UniaxialCurve;
use super::hyperelastic::Hyperelastic;
use super::stability::Stability;

/// A constitutive law: all that files, fits, samples, sensitivities, help and tests need to know of it.
pub trait Law: Sync {
    /// Name, formula, source and parameters.
    fn card(&self) -> &'static Card;
    /// Shear modulus at rest, Pa.
    fn shear_modulus_pa(&self, values: &[f64]) -> f64;
    /// The law with its numbers, ready to be evaluated.
    fn solid(&self, values: &[f64], volume: Volume) -> Box<dyn Hyperelastic>;
    /// The meta-models that fit this law to a uniaxial curve; none where it is not fitted.
    fn curves(&self) -> &'static [&'static dyn UniaxialCurve];
    /// Over which stretches the law was measured, with the verdict there; `None` where it makes no claim.
    fn measured(&self, values: &[f64]) -> Option<([f64; 2], Stability)>;
    /// What an estimate may change of it.
    fn estimated(&self) -> Estimated;
    /// Numbers to test the law with: at least one set.
    fn examples(&self) -> Vec<Values>;
}

impl std::fmt::Debug for dyn Law {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.card().name)
    }
}

/// The numbers of a law in the order of its parameters; of a law of terms once for every term.
pub type Values = Vec<f64>;

/// A law in words.
#[derive(Debug)]
pub struct Card {
    /// The word in files: `law = "neo-hookean"`.
    pub name: &'static str,
    /// The stored energy.
    pub formula: &'static str,
    /// Where it is published.
    pub source: &'static str,
    /// Its parameters, besides those that all laws share.
    pub parameters: &'static [LawParameter],
    /// Whether the parameters stand in a list `terms`, once for every term.
    pub of_terms: bool,
    /// The shear modulus at rest in terms of the parameters: what must be positive.
    pub shear_modulus: &'static str,
    /// Whether the energy can be continued below a volume ratio (`inversion_threshold`); a law that is finite at every
    /// ratio needs none.
    pub continued: bool,
}

/// A parameter of a law.
#[derive(Debug)]
pub struct LawParameter {
    /// The key in files; stresses end in `_pa`.
    pub name: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// How stresses depend on it.
    pub role: Role,
    /// Values it may take.
    pub range: Range,
    /// Its value where a file leaves it out; `None`: it must be there.
    pub default: Option<f64>,
}

/// How stresses depend on a parameter.
#[derive(Clone, Copy, Debug)]
pub enum Role {
    /// Stresses are linear in all parameters of this kind together, with Poisson's ratio held.
    Modulus,
    /// Any other number.
    Shape,
    /// A word of this list, its number being the value.
    Word(fn() -> &'static [String]),
}

/// Values a parameter may take.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    /// Whether a value is one of them.
    pub holds: fn(f64) -> bool,
    /// The same in words, after "it must be".
    pub rule: &'static str,
}

impl Range {
    /// Any finite number.
    pub const ANY: Self = Self { holds: f64::is_finite, rule: "a finite number" };
    /// Above zero.
    pub const POSITIVE: Self = Self { holds: |v| v > 0.0, rule: "above 0" };
    /// Not zero.
    pub const NOT_ZERO: Self = Self { holds: |v| v != 0.0, rule: "other than 0" };
}

/// What all laws share of the change of volume.
#[derive(Clone, Copy, Debug)]
pub struct Volume {
    /// lambda, Pa.
    pub lame_lambda_pa: f64,
    /// Volume ratio below which the energy is continued so that inverted elements can recover; 0: never.
    pub inversion_threshold: f64,
}

/// How an estimate changes a law. Every law says so itself: another law's way of turning a modulus and a shape into
/// parameters would give a body that nobody asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Estimated {
    /// The shear modulus is all there is: the neo-Hookean law.
    Modulus,
    /// The shear modulus, and one number beside it.
    Shaped(&'static Shape),
    /// Not at all: nobody has said what would be estimated of it.
    Not,
}

/// A law's parameters in terms of its shear modulus at rest and one number for everything else.
pub struct Shape {
    /// The law.
    pub law: &'static dyn Law,
    /// The quantity behind the number, as tables name it.
    pub name: &'static str,
    /// What the number is to the quantity.
    pub scale: ShapeScale,
    /// Where what is known of it beforehand comes from.
    pub known: ShapeKnown,
    /// The law's parameters at a shear modulus (Pa) and a number.
    pub values: fn(f64, f64) -> Values,
    /// The number of such parameters: the inverse of `values`.
    pub number: fn(&[f64]) -> f64,
    /// d ln(parameter) / d number by the parameters' names, the shear modulus held.
    pub slopes: fn(f64) -> Vec<(&'static str, f64)>,
}

/// What a shape's number is to the quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShapeScale {
    /// The quantity itself.
    Plain,
    /// The logarithm of a positive quantity.
    Logarithm,
    /// The logarithm of the odds of a share between 0 and 1.
    Share,
}

/// Where what is known of a shape comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShapeKnown {
    /// From nowhere: draws put it at a bound. Any share is as likely as another.
    AnyShare,
    /// From the law fitted to the published studies, each over the stretches it was measured at.
    Studies,
}

impl ShapeScale {
    /// The quantity behind the number.
    pub fn value(self, number: f64) -> f64 {
        match self {
            Self::Plain => number,
            Self::Logarithm => number.exp(),
            Self::Share => 1.0 / (1.0 + (-number).exp()),
        }
    }
}

impl PartialEq for Shape {
    fn eq(&self, other: &Self) -> bool {
        (self.law.card().name, self.name) == (other.law.card().name, other.name)
    }
}

impl std::fmt::Debug for Shape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} of {}", self.name, self.law.card().name)
    }
}
