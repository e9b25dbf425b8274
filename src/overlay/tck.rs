//! MRtrix's tracks (`.tck`): triplets in mm of the scanner, RAS; NaN ends a line, infinity the file.
//!
//! Source: <https://mrtrix.readthedocs.io/en/latest/getting_started/image_data.html#tracks-file-format-tck>.

use super::drawing::{Carried, Drawing, Kept, OverlayError, damaged, places};

/// Points of every line, and the kind of number.
#[derive(Clone, Debug)]
pub(super) struct Lengths {
    lengths: Vec<usize>,
    double: bool,
}

pub(super) fn decode(bytes: &[u8], name: &str) -> Result<Drawing, OverlayError> {
    let end =
        bytes.windows(5).position(|w| w == b"\nEND\n").ok_or_else(|| damaged(name, "the header", "it has no END"))?;
    let head = String::from_utf8_lossy(&bytes[..end]).into_owned();
    if !head.starts_with("mrtrix tracks") {
        return Err(damaged(name, "the first line", "it is not `mrtrix tracks`"));
    }
    let value = |key: &str| {
        head.lines()
            .find_map(|line| line.split_once(':').filter(|(k, _)| k.trim() == key))
            .map(|(_, v)| v.trim().to_owned())
    };
    let kind = value("datatype").unwrap_or_default();
    let (double, little) = match kind.as_str() {
        "Float32LE" => (false, true),
        "Float32BE" => (false, false),
        "Float64LE" => (true, true),
        "Float64BE" => (true, false),
        other => {
            return Err(damaged(
                name,
                "datatype",
                format!("`{other}` is none of Float32LE, Float32BE, Float64LE, Float64BE"),
            ));
        }
    };
    let offset = value("file").and_then(|file| file.split_whitespace().last()?.parse::<usize>().ok());
    let offset = offset
        .filter(|o| *o <= bytes.len())
        .ok_or_else(|| damaged(name, "file", "it does not say where the numbers begin"))?;
    let numbers: Vec<f64> = if double {
        let read = |w: &[u8; 8]| if little { f64::from_le_bytes(*w) } else { f64::from_be_bytes(*w) };
        bytes[offset..].as_chunks::<8>().0.iter().map(read).collect()
    } else {
        let read = |w: &[u8; 4]| f64::from(if little { f32::from_le_bytes(*w) } else { f32::from_be_bytes(*w) });
        bytes[offset..].as_chunks::<4>().0.iter().map(read).collect()
    };
    let (mut points_mm, mut lengths, mut length) = (Vec::new(), Vec::new(), 0);
    let mut whole = false;
    for p in numbers.as_chunks::<3>().0 {
        if p.iter().all(|x| x.is_infinite()) {
            whole = true;
            break;
        }
        if p.iter().all(|x| x.is_nan()) {
            lengths.push(length);
            length = 0;
        } else {
            points_mm.push(*p);
            length += 1;
        }
    }
    if !whole {
        return Err(damaged(name, "the numbers", "they end without the mark of the end: the file was cut short"));
    }
    if length > 0 {
        lengths.push(length);
    }
    Ok(Drawing { points_mm, names: Vec::new(), pairs_mm: Vec::new(), kept: Box::new(Lengths { lengths, double }) })
}

impl Kept for Lengths {
    fn streamlines(&self) -> Option<usize> {
        Some(self.lengths.len())
    }

    /// The same lines; nothing of the old header but the kind of number.
    fn encode(&self, carried: &[Carried], _: &[String]) -> Vec<u8> {
        let points_mm = &places(carried);
        let kind = if self.double { "Float64LE" } else { "Float32LE" };
        let head = |offset: usize| {
            format!("mrtrix tracks\ndatatype: {kind}\ncount: {}\nfile: . {offset}\nEND\n", self.lengths.len())
        };
        // The offset's own digits count.
        let mut offset = head(0).len();
        while head(offset).len() > offset {
            offset = head(offset).len();
        }
        let mut bytes = head(offset).into_bytes();
        bytes.resize(offset, b'\n');
        let mut put = |p: [f64; 3]| {
            for x in p {
                if self.double {
                    bytes.extend(x.to_le_bytes());
                } else {
                    bytes.extend((x as f32).to_le_bytes());
                }
            }
        };
        let mut points = points_mm.iter();
        for &length in &self.lengths {
            points.by_ref().take(length).for_each(|p| put(*p));
            put([f64::NAN; 3]);
        }
        put([f64::INFINITY; 3]);
        bytes
    }
}
