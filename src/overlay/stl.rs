//! STL, binary or text: triangles without connection.

use super::drawing::{Carried, Drawing, Kept, OverlayError, damaged, places, says_lps, turned};
use nalgebra::Vector3;

/// Which way the axes go, and the two bytes that each triangle ends with.
#[derive(Clone, Debug)]
pub(super) struct Facets {
    lps: bool,
    words: Vec<[u8; 2]>,
}

pub(super) fn decode(bytes: &[u8], name: &str) -> Result<Drawing, OverlayError> {
    let lps = says_lps(bytes);
    let declared = bytes.get(80..84).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]]) as usize);
    let mut points_mm = Vec::new();
    let words = if let Some(count) =
        declared.filter(|n| Some(bytes.len()) == n.checked_mul(50).and_then(|n| n.checked_add(84)))
    {
        let mut words = Vec::with_capacity(count);
        for facet in bytes[84..].chunks_exact(50) {
            let number = |n: usize| {
                f64::from(f32::from_le_bytes([facet[4 * n], facet[4 * n + 1], facet[4 * n + 2], facet[4 * n + 3]]))
            };
            points_mm.extend([3, 6, 9].map(|n| turned([number(n), number(n + 1), number(n + 2)], lps)));
            words.push([facet[48], facet[49]]);
        }
        words
    } else if bytes.starts_with(b"solid") {
        let text = String::from_utf8_lossy(bytes);
        for (n, line) in text.lines().enumerate() {
            let Some(numbers) = line.trim().strip_prefix("vertex") else { continue };
            let read: Vec<f64> = numbers.split_whitespace().filter_map(|w| w.parse().ok()).collect();
            let [x, y, z] = read[..] else { return Err(damaged(name, format!("line {}", n + 1), "not three numbers")) };
            points_mm.push(turned([x, y, z], lps));
        }
        vec![[0; 2]; points_mm.len() / 3]
    } else {
        return Err(damaged(name, "the size", "it is not that of the triangles it declares: the file was cut short"));
    };
    if points_mm.len() != 3 * words.len() {
        return Err(damaged(name, "the last facet", "it has not three corners"));
    }
    Ok(Drawing { points_mm, names: Vec::new(), pairs_mm: Vec::new(), kept: Box::new(Facets { lps, words }) })
}

impl Kept for Facets {
    /// Binary; normals anew.
    fn encode(&self, carried: &[Carried], _: &[String]) -> Vec<u8> {
        let points_mm = &places(carried);
        let mut bytes = format!("binary STL, mm, SPACE={}", if self.lps { "LPS" } else { "RAS" }).into_bytes();
        bytes.resize(80, b' ');
        bytes.extend((self.words.len() as u32).to_le_bytes());
        for (corners, word) in points_mm.chunks_exact(3).zip(&self.words) {
            let [a, b, c] = [0, 1, 2].map(|n| Vector3::from(turned(corners[n], self.lps)));
            let normal = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default();
            for x in [normal, a, b, c].iter().flat_map(|v| v.iter()) {
                bytes.extend((*x as f32).to_le_bytes());
            }
            bytes.extend(word);
        }
        bytes
    }

    fn triangles(&self, points: usize, _: &str) -> Option<Result<Vec<[u32; 3]>, OverlayError>> {
        Some(Ok((0..points as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect()))
    }
}
