//! How the head lies in theatre.

use crate::geometry::{Mni, Pre, RigidTransform};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// The way down, as a word for how the patient lies or as a direction of the scanner.
#[derive(Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(into = "String", try_from = "String")]
#[schemars(with = "String")]
pub enum Head {
    /// On the back: down is towards the back of the head.
    Supine,
    /// On the face.
    Prone,
    /// On the left side.
    Left,
    /// On the right side.
    Right,
    /// Upright: down is towards the feet.
    Sitting,
    /// A direction of the pre-operative scanner's frame (RAS+), of any length.
    Down([f64; 3]),
}

/// Why a word says nothing of a head.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "`{0}` is no way to lie: say supine, prone, left, right, sitting or the way down as x,y,z (scanner, RAS+), not all 0"
)]
pub struct HeadParseError(String);

impl FromStr for Head {
    type Err = HeadParseError;

    fn from_str(text: &str) -> Result<Self, HeadParseError> {
        let wrong = || HeadParseError(text.to_owned());
        Ok(match text.trim() {
            "supine" => Self::Supine,
            "prone" => Self::Prone,
            "left" => Self::Left,
            "right" => Self::Right,
            "sitting" => Self::Sitting,
            other => {
                let numbers: Vec<f64> =
                    other.split(',').map(|x| x.trim().parse()).collect::<Result<_, _>>().map_err(|_| wrong())?;
                let down: [f64; 3] = numbers.try_into().map_err(|_| wrong())?;
                let length = Vector3::from(down).norm();
                if !(length > 1e-6 && length.is_finite()) {
                    return Err(wrong());
                }
                Self::Down(down)
            }
        })
    }
}

impl TryFrom<String> for Head {
    type Error = HeadParseError;

    fn try_from(text: String) -> Result<Self, HeadParseError> {
        text.parse()
    }
}

impl From<Head> for String {
    fn from(head: Head) -> Self {
        head.to_string()
    }
}

impl fmt::Display for Head {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Supine => "supine",
            Self::Prone => "prone",
            Self::Left => "left",
            Self::Right => "right",
            Self::Sitting => "sitting",
            Self::Down([x, y, z]) => return write!(f, "{x},{y},{z}"),
        })
    }
}

/// As settings have it: messages show it so.
impl fmt::Debug for Head {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl Head {
    /// Gravity in the MNI frame, m/s2. Words are of the head's own axes, which the MNI frame has and a scanner has nearly.
    pub fn gravity_m_per_s2(&self, mni_from_pre: &RigidTransform<Pre, Mni>) -> [f64; 3] {
        const G: f64 = 9.81;
        let down = match self {
            Self::Supine => -Vector3::y(),
            Self::Prone => Vector3::y(),
            Self::Left => -Vector3::x(),
            Self::Right => Vector3::x(),
            Self::Sitting => -Vector3::z(),
            Self::Down(down) => mni_from_pre.rotation * Vector3::from(*down).normalize(),
        };
        // Plus zero: no -0 in a file.
        (G * down).map(|x| x + 0.0).into()
    }

    /// Gravity in the frame of the scanner that the patient lies in, m/s2: words are of its axes, which follow the patient.
    pub fn gravity_in_scanner_m_per_s2(&self) -> [f64; 3] {
        self.gravity_m_per_s2(&RigidTransform::identity())
    }

    /// Whether both say one way down. A word is of the head's axes and a direction of the scanner's: of those two only the pose
    /// tells ([`same_way`]).
    pub fn is_same_as(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Down(a), Self::Down(b)) => same_way(*a, *b),
            _ => self == other,
        }
    }

    /// The name of its state among a case's files: a word, or `head-2` for a direction.
    pub fn name(&self, number: usize) -> String {
        match self {
            Self::Down(_) => format!("head-{}", number + 1),
            word => word.to_string(),
        }
    }
}

/// Ways down nearer to each other than this are one, degrees: nobody lies that exactly.
const ONE_WAY_DEG: f64 = 0.5;

/// Whether two directions are one.
pub fn same_way(a: [f64; 3], b: [f64; 3]) -> bool {
    Vector3::from(a).angle(&Vector3::from(b)) < ONE_WAY_DEG.to_radians()
}

/// The first two of several heads that are one way to lie, once the pose is known.
pub fn twice(heads: &[Head], mni_from_pre: &RigidTransform<Pre, Mni>) -> Option<(Head, Head)> {
    let down: Vec<[f64; 3]> = heads.iter().map(|head| head.gravity_m_per_s2(mni_from_pre)).collect();
    let mut pairs = (0..heads.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
    pairs.find(|&(a, b)| same_way(down[a], down[b])).map(|(a, b)| (heads[a], heads[b]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_patient_on_the_back_is_pulled_towards_the_back_of_the_head_in_the_scanners_frame() {
        let pull = |text: &str| text.parse::<Head>().unwrap().gravity_in_scanner_m_per_s2();
        assert_eq!(pull("supine"), [0.0, -9.81, 0.0]);
        assert_eq!([pull("left"), pull("sitting")], [[-9.81, 0.0, 0.0], [0.0, 0.0, -9.81]]);
        assert_eq!(pull("0,-3,0"), pull("supine"));
    }

    #[test]
    fn one_way_to_lie_is_found_whatever_its_length_and_whatever_it_is_called() {
        let down = |y: f64| Head::Down([0.0, y, 0.0]);
        assert!(down(-1.0).is_same_as(&down(-2.0)) && !down(-1.0).is_same_as(&down(1.0)));
        assert!(Head::Left.is_same_as(&Head::Left) && !Head::Left.is_same_as(&Head::Right));
        let upright = RigidTransform::<Pre, Mni>::identity();
        assert_eq!(twice(&[Head::Left, Head::Supine, down(-3.0)], &upright), Some((Head::Supine, down(-3.0))));
        let nodding = RigidTransform::<Pre, Mni>::about([0.0; 3].into(), Vector3::x() * 0.1, Vector3::zeros());
        assert_eq!(twice(&[Head::Supine, down(-3.0)], &nodding), None, "a scanner is not the head");
    }

    #[test]
    fn a_head_is_a_word_or_a_direction_and_nothing_else() {
        for text in ["supine", "prone", "left", "right", "sitting", "0,-1,0.5"] {
            assert_eq!(text.parse::<Head>().unwrap().to_string(), text);
        }
        for text in ["0,0,0", "1,2", "nan,0,1", "inf,0,0", "upside-down", "", "0,0,1,0"] {
            let said = text.parse::<Head>().unwrap_err().to_string();
            assert!(said.contains("supine, prone") && said.contains(text), "{said}");
        }
    }

    #[test]
    fn who_lies_on_the_back_is_pulled_to_the_back_of_the_head_wherever_the_scanner_was() {
        let turned = RigidTransform::<Pre, Mni>::about(
            [0.0; 3].into(),
            Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2),
            Vector3::zeros(),
        );
        assert_eq!(Head::Supine.gravity_m_per_s2(&turned), [0.0, -9.81, 0.0]);
        let g = Head::Down([2.0, 0.0, 0.0]).gravity_m_per_s2(&turned);
        assert!(g[0].abs() < 1e-12 && (g[1] - 9.81).abs() < 1e-12, "{g:?}");
        assert_eq!([Head::Left.name(1), Head::Down([0.0, 1.0, 0.0]).name(1)], ["left", "head-2"]);
    }
}
