//! An element as scenario files name it.

use super::ELEMENTS;
use super::definition::Element;
use super::{tet4, tet4_nodal, tet10};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Which element carries the mesh.
#[derive(Clone, Copy)]
pub struct ElementKind(&'static dyn Element);

impl ElementKind {
    /// Linear tetrahedron, one point; locks towards nu = 0.5.
    pub const TET4: Self = Self(&tet4::Tet4);
    /// Linear tetrahedron with deformation averaged over the elements of a tissue around each node: no locking.
    pub const TET4_NODAL: Self = Self(&tet4_nodal::Tet4Nodal);
    /// Quadratic tetrahedron with straight edges, four points: the oracle, several times dearer.
    pub const TET10: Self = Self(&tet10::Tet10);

    /// The word in files.
    pub fn name(self) -> &'static str {
        self.0.name()
    }

    pub(in super::super) fn element(self) -> &'static dyn Element {
        self.0
    }
}

impl Default for ElementKind {
    fn default() -> Self {
        Self::TET4
    }
}

impl PartialEq for ElementKind {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for ElementKind {}

impl std::fmt::Debug for ElementKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for ElementKind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for ElementKind {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let word = String::deserialize(deserializer)?;
        let found = ELEMENTS.into_iter().find(|e| e.name() == word || e.aliases().contains(&word.as_str()));
        found.map(Self).ok_or_else(|| {
            let known = ELEMENTS.map(|e| format!("`{}`", e.name())).join(", ");
            D::Error::custom(format!("unknown variant `{word}`, expected one of {known}"))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_element_is_read_back_by_its_names() {
        for element in ELEMENTS {
            for word in [element.name()].iter().chain(element.aliases()) {
                let kind: ElementKind = serde_json::from_value((*word).into()).unwrap();
                assert_eq!(serde_json::to_value(kind).unwrap(), element.name());
            }
        }
        assert!(serde_json::from_value::<ElementKind>("hex8".into()).is_err());
    }
}
