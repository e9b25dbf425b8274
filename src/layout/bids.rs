//! Names in BIDS derivatives.

/// BIDS's name of the template's space; it is reached rigidly, so sizes stay the patient's.
pub const TEMPLATE: &str = "MNI152NLin2009aSym";

/// The scan that a derivative belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scan {
    /// Before surgery.
    Pre,
    /// After surgery.
    Post,
}

/// What a file is called behind the entities of its scan.
#[derive(Clone, Copy, Debug)]
pub struct BidsName {
    /// The scan.
    pub of: Scan,
    /// Entities, suffix and extension; `space-T` and `to-T` stand for the template.
    pub name: &'static str,
    /// The sidecar's description.
    pub description: &'static str,
    /// The sidecar's type, of a mask.
    pub mask: Option<&'static str>,
}

impl BidsName {
    /// Whether the file is on the template's grid.
    pub fn in_template(&self) -> bool {
        self.name.starts_with("space-")
    }

    /// Whether it maps one scan to another.
    pub fn is_transform(&self) -> bool {
        self.name.starts_with("from-")
    }

    /// The name with the template's own name in it.
    pub fn spelt(&self) -> String {
        self.name.replace("-T_", &format!("-{TEMPLATE}_"))
    }

    /// The same of one member of a family; BIDS takes letters and digits alone.
    pub fn spelt_of(&self, member: &str) -> String {
        let plain: String = member.chars().filter(char::is_ascii_alphanumeric).collect();
        self.spelt().replace("{state}", &plain)
    }
}
