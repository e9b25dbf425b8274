//! PLY, text or binary in either order: the vertices move, everything else stays.

use super::drawing::{Carried, Drawing, Kept, NotCarried, OverlayError, damaged, places, says_lps, turned, written};
use super::ply_faces::{Numbers, triangles};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Order {
    Text,
    Little,
    Big,
}

/// The file with the places of its coordinates.
#[derive(Clone, Debug)]
pub(super) struct Vertices {
    bytes: Vec<u8>,
    order: Order,
    lps: bool,
    /// First byte of the vertices.
    first: usize,
    /// One past their last byte.
    end: usize,
    /// Place of x, y, z: byte and size in a row, or the number of the word in a line of text.
    places: [(usize, usize); 3],
    /// Bytes of a row.
    row: usize,
    /// Whether normals are among them.
    normals: bool,
}

fn size_of(kind: &str) -> Option<usize> {
    Some(match kind {
        "char" | "uchar" | "int8" | "uint8" => 1,
        "short" | "ushort" | "int16" | "uint16" => 2,
        "int" | "uint" | "float" | "int32" | "uint32" | "float32" => 4,
        "double" | "float64" => 8,
        _ => return None,
    })
}

pub(super) fn decode(bytes: &[u8], name: &str) -> Result<Drawing, OverlayError> {
    const END: &[u8] = b"end_header";
    let end = bytes.windows(END.len()).position(|w| w == END).filter(|_| bytes.starts_with(b"ply"));
    let end = end.ok_or_else(|| damaged(name, "the header", "it does not begin with ply and end with end_header"))?;
    let first = end + END.len() + bytes[end..].iter().skip(END.len()).take_while(|b| **b == b'\r').count() + 1;
    let head = String::from_utf8_lossy(&bytes[..end]).into_owned();
    let order = match head.lines().find_map(|l| l.strip_prefix("format ")).and_then(|f| f.split_whitespace().next()) {
        Some("ascii") => Order::Text,
        Some("binary_little_endian") => Order::Little,
        Some("binary_big_endian") => Order::Big,
        _ => return Err(damaged(name, "format", "it is none of ascii, binary_little_endian, binary_big_endian")),
    };
    let mut lines = head.lines().map(str::trim).skip_while(|l| !l.starts_with("element"));
    let count =
        lines.next().and_then(|l| l.strip_prefix("element vertex ")).and_then(|n| n.trim().parse::<usize>().ok());
    let count = count.ok_or_else(|| damaged(name, "element", "the vertices do not come first"))?;
    let (mut row, mut word, mut found, mut normals) = (0, 0, [None; 3], false);
    for line in lines.take_while(|l| !l.starts_with("element")).filter(|l| l.starts_with("property")) {
        let mut words = line.split_whitespace().skip(1);
        let (kind, property) = (words.next().unwrap_or(""), words.next().unwrap_or(""));
        let size = size_of(kind).ok_or_else(|| damaged(name, "property", format!("`{kind}` is no kind of number")))?;
        if let Some(axis) = ["x", "y", "z"].iter().position(|a| *a == property) {
            if order != Order::Text && !["float", "float32", "double", "float64"].contains(&kind) {
                let problem = format!("`{property}` is {kind}; save x, y and z as float or double");
                return Err(damaged(name, "property", problem));
            }
            found[axis] = Some(if order == Order::Text { (word, size) } else { (row, size) });
        }
        normals |= ["nx", "ny", "nz"].contains(&property);
        row += size;
        word += 1;
    }
    let [Some(x), Some(y), Some(z)] = found else {
        return Err(damaged(name, "property", "x, y and z are not all there"));
    };
    let places = [x, y, z];
    let lps = says_lps(bytes);
    let mut points_mm = Vec::with_capacity(count.min(1 << 20));
    let cut = || damaged(name, "the vertices", "there are fewer than the header says: the file was cut short");
    let end = if order == Order::Text {
        let text = std::str::from_utf8(bytes.get(first..).unwrap_or(&[]))
            .map_err(|_| damaged(name, "the vertices", "not text"))?;
        let mut at = first;
        for _ in 0..count {
            let line = text[at - first..].split_inclusive('\n').next().ok_or_else(cut)?;
            let words: Vec<f64> = line.split_whitespace().map(|w| w.parse().unwrap_or(f64::NAN)).collect();
            let number = |(word, _): (usize, usize)| words.get(word).copied().ok_or_else(cut);
            points_mm.push(turned([number(x)?, number(y)?, number(z)?], lps));
            at += line.len();
        }
        at
    } else {
        let end = count
            .checked_mul(row)
            .and_then(|n| n.checked_add(first))
            .filter(|end| *end <= bytes.len())
            .ok_or_else(cut)?;
        for vertex in bytes[first..end].chunks_exact(row) {
            points_mm.push(turned(places.map(|place| number(vertex, place, order)), lps));
        }
        end
    };
    let kept = Box::new(Vertices { bytes: bytes.to_vec(), order, lps, first, end, places, row, normals });
    Ok(Drawing { points_mm, names: Vec::new(), pairs_mm: Vec::new(), kept })
}

fn number(row: &[u8], (at, size): (usize, usize), order: Order) -> f64 {
    let little = order == Order::Little;
    if size == 8 {
        let w: [u8; 8] = std::array::from_fn(|n| row[at + n]);
        if little { f64::from_le_bytes(w) } else { f64::from_be_bytes(w) }
    } else {
        let w: [u8; 4] = std::array::from_fn(|n| row[at + n]);
        f64::from(if little { f32::from_le_bytes(w) } else { f32::from_be_bytes(w) })
    }
}

impl Kept for Vertices {
    fn encode(&self, carried: &[Carried], _: &[String]) -> Vec<u8> {
        let points_mm = &places(carried);
        let mut bytes = self.bytes[..self.first].to_vec();
        if self.order == Order::Text {
            // Read as text before.
            let text = String::from_utf8_lossy(&self.bytes[self.first..self.end]);
            for (line, p) in text.split_inclusive('\n').zip(points_mm) {
                let mut words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
                for ((word, _), x) in self.places.iter().zip(turned(*p, self.lps)) {
                    words[*word] = written(x);
                }
                bytes.extend(words.join(" ").bytes().chain([b'\n']));
            }
        } else {
            for (vertex, p) in self.bytes[self.first..self.end].chunks_exact(self.row).zip(points_mm) {
                let mut vertex = vertex.to_vec();
                for ((at, size), x) in self.places.iter().zip(turned(*p, self.lps)) {
                    let little = self.order == Order::Little;
                    if *size == 8 {
                        vertex[*at..at + 8].copy_from_slice(&if little { x.to_le_bytes() } else { x.to_be_bytes() });
                    } else {
                        let x = x as f32;
                        vertex[*at..at + 4].copy_from_slice(&if little { x.to_le_bytes() } else { x.to_be_bytes() });
                    }
                }
                bytes.extend(vertex);
            }
        }
        bytes.extend(&self.bytes[self.end..]);
        bytes
    }

    fn not_carried(&self) -> Option<NotCarried> {
        self.normals.then_some(NotCarried::Directions)
    }

    fn triangles(&self, points: usize, name: &str) -> Option<Result<Vec<[u32; 3]>, OverlayError>> {
        let head = String::from_utf8_lossy(&self.bytes[..self.first]).into_owned();
        let numbers = match self.order {
            Order::Text => Numbers::Text,
            Order::Little => Numbers::Little,
            Order::Big => Numbers::Big,
        };
        Some(triangles((&head, &self.bytes[self.end..]), (numbers, points), name))
    }
}
