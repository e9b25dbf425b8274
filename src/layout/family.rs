//! Files that a case holds one of for each sample or boundary set.

/// A path with one part in braces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Family(pub &'static str);

impl Family {
    fn around(self) -> (&'static str, &'static str) {
        let (before, rest) = self.0.split_once('{').unwrap_or((self.0, ""));
        (before, rest.split_once('}').map_or("", |(_, after)| after))
    }

    /// The file of one member: `sim/sample-05.vtu`.
    pub fn of(self, member: &str) -> String {
        let (before, after) = self.around();
        format!("{before}{member}{after}")
    }

    /// The member whose file this is.
    pub fn member(self, path: &str) -> Option<&str> {
        let (before, after) = self.around();
        path.strip_prefix(before)?.strip_suffix(after).filter(|member| !member.is_empty())
    }

    /// The folder that the family lies in.
    pub fn folder(self) -> &'static str {
        self.0.split_once('/').map_or("", |(folder, _)| folder)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_member_gives_its_path_and_back() {
        let family = Family("shelf/{book}.txt");
        assert_eq!(family.of("a-1"), "shelf/a-1.txt");
        assert_eq!(family.member("shelf/a-1.txt"), Some("a-1"));
        assert_eq!([family.member("shelf/.txt"), family.member("board/a.txt")], [None, None]);
        assert_eq!(family.folder(), "shelf");
    }
}
