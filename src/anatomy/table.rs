//! What the numbers of a label map mean: one table per tool.

use super::label;

/// What a structure is to hgm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Tissue {
    /// Skull, scalp, eyes, air: not part of the brain.
    Outside,
    /// Fluid outside the lateral and third ventricles.
    Csf,
    /// Cortex, deep nuclei, cerebellar cortex.
    Grey,
    /// White matter of cerebrum and cerebellum, brainstem.
    White,
    /// Lateral and third ventricles with their plexus.
    Ventricle,
    /// Taken out by an operation.
    Resected,
    /// Tumour.
    Tumour,
    /// Oedema.
    Oedema,
}

impl Tissue {
    /// Every kind, in the order of hgm's numbers.
    pub const ALL: [Self; 8] = [
        Self::Outside,
        Self::Csf,
        Self::Grey,
        Self::White,
        Self::Ventricle,
        Self::Resected,
        Self::Tumour,
        Self::Oedema,
    ];

    /// hgm's number for it.
    pub fn label(self) -> u8 {
        match self {
            Self::Outside => label::BACKGROUND,
            Self::Csf => label::CSF,
            Self::Grey => label::GREY_MATTER,
            Self::White => label::WHITE_MATTER,
            Self::Ventricle => label::VENTRICLE,
            Self::Resected => label::RESECTED,
            Self::Tumour => label::TUMOUR,
            Self::Oedema => label::OEDEMA,
        }
    }

    /// The word for it: hgm's name of the label, or `background`.
    pub fn name(self) -> &'static str {
        label::name(self.label()).unwrap_or("background")
    }

    /// The kind that a word names.
    pub fn of_name(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|tissue| tissue.name() == word)
    }
}

/// A hemisphere, as a structure's name says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The patient's left.
    Left,
    /// The patient's right.
    Right,
}

/// One number of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Structure {
    /// The number in the file.
    pub code: u32,
    /// The tool's own name.
    pub name: String,
    /// What it is to hgm.
    pub tissue: Tissue,
}

impl Structure {
    /// The hemisphere in the name, if it names one: `Left-Putamen`, `Right Putamen`, `ctx-lh-insula`, `frontal lobe WM left`.
    pub fn side(&self) -> Option<Side> {
        let name = self.name.to_ascii_lowercase();
        let is = |word: &str| name.split(|c: char| !c.is_ascii_alphanumeric()).any(|part| part == word);
        if is("left") || is("lh") {
            Some(Side::Left)
        } else if is("right") || is("rh") {
            Some(Side::Right)
        } else {
            None
        }
    }
}

/// The numbers of one tool.
#[derive(Clone, Debug)]
pub struct LabelTable {
    /// The word that names it.
    pub name: String,
    /// Which files hold these numbers.
    pub files: &'static str,
    /// Where the numbers stand.
    pub source: &'static str,
    /// Every number, ascending.
    pub structures: Vec<Structure>,
    /// Sets of numbers of which a map of this tool holds at least one each: what it cannot be without.
    pub needed: Vec<Vec<u32>>,
}

impl LabelTable {
    /// A table from numbers with names; sorts them.
    pub(super) fn new(
        name: &str,
        files: &'static str,
        source: &'static str,
        structures: impl IntoIterator<Item = (u32, String, Tissue)>,
        needed: &[&[u32]],
    ) -> Self {
        let mut structures: Vec<Structure> =
            structures.into_iter().map(|(code, name, tissue)| Structure { code, name, tissue }).collect();
        structures.sort_by_key(|s| s.code);
        let needed = needed.iter().map(|set| set.to_vec()).collect();
        Self { name: name.to_owned(), files, source, structures, needed }
    }

    /// The structure with a number.
    pub fn structure(&self, code: u32) -> Option<&Structure> {
        self.structures.binary_search_by_key(&code, |s| s.code).ok().map(|at| &self.structures[at])
    }
}
