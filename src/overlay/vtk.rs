//! VTK's legacy files (`.vtk`), text or binary: the points move, whatever hangs on them stays.

use super::drawing::{Carried, Drawing, Kept, NotCarried, OverlayError, damaged, places, says_lps, turned, written};

/// The file with the place of its points.
#[derive(Clone, Debug)]
pub(super) struct Points {
    before: Vec<u8>,
    after: Vec<u8>,
    text: bool,
    double: bool,
    lps: bool,
}

pub(super) fn decode(bytes: &[u8], name: &str) -> Result<Drawing, OverlayError> {
    if !bytes.starts_with(b"# vtk DataFile") {
        return Err(damaged(
            name,
            "the first line",
            "it is not that of a legacy VTK file (.vtp: save it as .vtk or .ply)",
        ));
    }
    let line_end = |from: usize| bytes[from..].iter().position(|b| *b == b'\n').map(|n| from + n + 1);
    let cut = || damaged(name, "POINTS", "the file ends before them");
    let title = line_end(0).ok_or_else(cut)?;
    let kind = line_end(title).ok_or_else(cut)?;
    let data = line_end(kind).ok_or_else(cut)?;
    let text = bytes[kind..data].trim_ascii() == b"ASCII";
    const KEY: &[u8] = b"\nPOINTS ";
    let key = bytes.windows(KEY.len()).position(|w| w == KEY).ok_or_else(cut)? + 1;
    let first = line_end(key).ok_or_else(cut)?;
    let words = String::from_utf8_lossy(&bytes[key..first]).into_owned();
    let words: Vec<&str> = words.split_whitespace().collect();
    let count: usize =
        words.get(1).and_then(|w| w.parse().ok()).ok_or_else(|| damaged(name, "POINTS", "how many is not a number"))?;
    let double = match words.get(2).copied() {
        Some("float") => false,
        Some("double") => true,
        _ => return Err(damaged(name, "POINTS", "they are neither float nor double")),
    };
    let wanted = count.checked_mul(3).ok_or_else(cut)?;
    let (numbers, end) = if text {
        let (mut numbers, mut at) = (Vec::new(), first);
        while numbers.len() < wanted {
            let start = at + bytes[at..].iter().take_while(|b| b.is_ascii_whitespace()).count();
            let length = bytes[start..].iter().take_while(|b| !b.is_ascii_whitespace()).count();
            let word = String::from_utf8_lossy(&bytes[start..start + length]).into_owned();
            numbers
                .push(word.parse::<f64>().map_err(|_| damaged(name, "POINTS", format!("`{word}` is not a number")))?);
            at = start + length;
        }
        (numbers, at)
    } else {
        let size = if double { 8 } else { 4 };
        let end = wanted
            .checked_mul(size)
            .and_then(|n| n.checked_add(first))
            .filter(|e| *e <= bytes.len())
            .ok_or_else(cut)?;
        let part = &bytes[first..end];
        let numbers = if double {
            part.as_chunks::<8>().0.iter().map(|w| f64::from_be_bytes(*w)).collect()
        } else {
            part.as_chunks::<4>().0.iter().map(|w| f64::from(f32::from_be_bytes(*w))).collect()
        };
        (numbers, end)
    };
    let lps = says_lps(bytes);
    let points_mm = numbers.as_chunks::<3>().0.iter().map(|p| turned(*p, lps)).collect();
    // The title may say anything; which way the axes go it keeps.
    let space = if lps { "SPACE=LPS" } else { "SPACE=RAS" };
    let mut before = bytes[..title].to_vec();
    before.extend(format!("carried by hgm {space}\n").bytes());
    before.extend(&bytes[kind..first]);
    let kept = Box::new(Points { before, after: bytes[end..].to_vec(), text, double, lps });
    Ok(Drawing { points_mm, names: Vec::new(), pairs_mm: Vec::new(), kept })
}

impl Points {
    /// Whether a block of arrays (`FIELD`), where newer programs keep normals, has one of three or nine broken numbers a place.
    fn field_has_vectors(&self) -> bool {
        const FIELD: &[u8] = b"\nFIELD ";
        let Some(at) = self.after.windows(FIELD.len()).position(|w| w == FIELD) else { return false };
        // The head of an array: its name, numbers a place, places, kind.
        let head = |line: &[u8]| {
            let words: Vec<&str> =
                std::str::from_utf8(line).map(|l| l.split_whitespace().collect()).unwrap_or_default();
            matches!(words[..], [_, "3" | "9", places, "float" | "double"] if places.parse::<u64>().is_ok())
        };
        self.after[at..].split(|b| *b == b'\n').filter(|line| line.len() < 200).any(head)
    }
}

impl Kept for Points {
    fn encode(&self, carried: &[Carried], _: &[String]) -> Vec<u8> {
        let points_mm = &places(carried);
        let mut bytes = self.before.clone();
        for (n, p) in points_mm.iter().enumerate() {
            let p = turned(*p, self.lps);
            if self.text {
                let end = if n + 1 < points_mm.len() { "\n" } else { "" };
                bytes.extend(format!("{}{end}", p.map(written).join(" ")).bytes());
            } else if self.double {
                bytes.extend(p.iter().flat_map(|x| x.to_be_bytes()));
            } else {
                bytes.extend(p.iter().flat_map(|x| (*x as f32).to_be_bytes()));
            }
        }
        bytes.extend(&self.after);
        bytes
    }

    fn not_carried(&self) -> Option<NotCarried> {
        let begins = |key: &[u8]| self.after.windows(key.len()).any(|w| w == key);
        let any = [&b"\nNORMALS "[..], b"\nVECTORS ", b"\nTENSORS "].into_iter().any(begins);
        (any || self.field_has_vectors()).then_some(NotCarried::Directions)
    }
}
