//! Tag points of the MNI (`.tag`), what the ultrasound data sets keep their landmarks in: one point or a pair in a row,
//! mm of the scanner (the first axis to the right, the second to the front, the third up).

use super::drawing::{Carried, Drawing, Kept, NotCarried, OverlayError, damaged, names_of, written};

/// Whether the points stood on two volumes.
#[derive(Debug)]
struct Tags {
    pairs: bool,
}

pub(super) fn decode(bytes: &[u8], name: &str) -> Result<Drawing, OverlayError> {
    let text = std::str::from_utf8(bytes).map_err(|_| damaged(name, "the file", "not UTF-8 text"))?;
    if !text.trim_start().starts_with("MNI Tag Point File") {
        return Err(damaged(name, "the first line", "it is not `MNI Tag Point File`"));
    }
    let volumes: usize = text
        .split_once("Volumes")
        .and_then(|(_, rest)| rest.split([';', '\n']).next()?.trim().trim_start_matches('=').trim().parse().ok())
        .filter(|n| [1, 2].contains(n))
        .ok_or_else(|| damaged(name, "Volumes", "it is neither 1 nor 2"))?;
    let (_, rows) = text.split_once("Points").ok_or_else(|| damaged(name, "Points", "there is no such list"))?;
    let rows = rows.trim_start().trim_start_matches('=');
    let (mut points_mm, mut pairs_mm, mut names) = (Vec::new(), Vec::new(), Vec::new());
    for row in rows.split('\n').map(|row| row.trim().trim_end_matches(';').trim()).filter(|row| !row.is_empty()) {
        if row.starts_with('%') || row.starts_with('#') {
            continue;
        }
        let (numbers, label) = row.split_once('"').unwrap_or((row, ""));
        let place = || format!("point {}", points_mm.len() + 1);
        let read: Result<Vec<f64>, _> = numbers.split_whitespace().map(str::parse).collect();
        let read =
            read.map_err(|_| damaged(name, place(), format!("`{}` holds a word that is no number", numbers.trim())))?;
        if read.len() < 3 * volumes {
            return Err(damaged(name, place(), format!("{} numbers, and {} are needed", read.len(), 3 * volumes)));
        }
        let label = label.trim_end_matches('"').trim();
        names.push(label.to_owned());
        points_mm.push([read[0], read[1], read[2]]);
        if volumes == 2 {
            pairs_mm.push([read[3], read[4], read[5]]);
        }
    }
    Ok(Drawing { points_mm, names: names_of(names), pairs_mm, kept: Box::new(Tags { pairs: volumes == 2 }) })
}

impl Kept for Tags {
    /// One volume of points with their names.
    fn encode(&self, carried: &[Carried], names: &[String]) -> Vec<u8> {
        let row = |(n, p): (usize, &Carried)| {
            let [x, y, z] = p.mm.map(written);
            let name = names.get(n).map_or("", String::as_str);
            format!(" {x} {y} {z} \"{}\"", name.replace('"', "'"))
        };
        let rows: Vec<String> = carried.iter().enumerate().map(row).collect();
        format!("MNI Tag Point File\nVolumes = 1;\n\nPoints =\n{};\n", rows.join("\n")).into_bytes()
    }

    fn not_carried(&self) -> Option<NotCarried> {
        self.pairs.then_some(NotCarried::SecondVolume)
    }
}
