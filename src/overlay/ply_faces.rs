//! The faces of a PLY file: what makes its vertices a surface.

use super::drawing::{OverlayError, damaged};

/// A property of a face.
enum Property {
    /// Bytes of a single number.
    One(usize),
    /// Kinds of the count and of the numbers of a list, and whether it holds the corners.
    List { count: String, number: String, corners: bool },
}

/// The faces as the header tells of them.
struct Faces {
    count: usize,
    properties: Vec<Property>,
}

/// How the numbers are written.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Numbers {
    Text,
    Little,
    Big,
}

/// The triangles of the faces that follow the vertices; a face of more corners is cut into triangles from its first.
pub(super) fn triangles(
    (head, rest): (&str, &[u8]),
    (numbers, points): (Numbers, usize),
    name: &str,
) -> Result<Vec<[u32; 3]>, OverlayError> {
    let Some(faces) = faces(head, name)? else { return Ok(Vec::new()) };
    let mut reader = Reader { rest, numbers, words: Vec::new() };
    if numbers == Numbers::Text {
        let text = String::from_utf8_lossy(rest);
        reader.words = text.split_whitespace().rev().map(str::to_owned).collect();
    }
    let mut found = Vec::new();
    let cut = || damaged(name, "the faces", "there are fewer than the header says: the file was cut short");
    for _ in 0..faces.count {
        for property in &faces.properties {
            match property {
                Property::One(bytes) => reader.pass(*bytes).ok_or_else(cut)?,
                Property::List { count, number, corners } => {
                    let length = reader.whole(count).ok_or_else(cut)?;
                    if !corners {
                        // Places in a picture and such, whole or not.
                        let no_kind = || damaged(name, "property", format!("`{number}` is no kind of number"));
                        let bytes = bytes_of(number).ok_or_else(no_kind)?;
                        for _ in 0..length {
                            reader.pass(bytes).ok_or_else(cut)?;
                        }
                        continue;
                    }
                    let mut list = Vec::new();
                    for _ in 0..length {
                        list.push(reader.whole(number).ok_or_else(cut)?);
                    }
                    if let Some(far) = list.iter().find(|&&n| n >= points as u64) {
                        return Err(damaged(name, "the faces", format!("one names vertex {far} of {points}")));
                    }
                    let corner = |n: usize| list[n] as u32;
                    found.extend((2..list.len()).map(|n| [corner(0), corner(n - 1), corner(n)]));
                }
            }
        }
    }
    Ok(found)
}

/// What the header says of faces; `None` where there are none.
fn faces(head: &str, name: &str) -> Result<Option<Faces>, OverlayError> {
    let mut lines = head.lines().map(str::trim).filter(|l| l.starts_with("element ") || l.starts_with("property "));
    // After the vertices, which come first.
    let Some(line) = lines.by_ref().filter(|l| l.starts_with("element ")).nth(1) else { return Ok(None) };
    let count = line.strip_prefix("element face ").and_then(|n| n.trim().parse().ok());
    let count = count.ok_or_else(|| damaged(name, "element", "the faces do not follow the vertices"))?;
    let mut properties = Vec::new();
    for line in lines.take_while(|l| l.starts_with("property ")) {
        let words: Vec<&str> = line.split_whitespace().skip(1).collect();
        properties.push(match words[..] {
            ["list", count, number, what] => Property::List {
                count: count.to_owned(),
                number: number.to_owned(),
                corners: what.starts_with("vertex_ind"),
            },
            [kind, _] => Property::One(
                bytes_of(kind).ok_or_else(|| damaged(name, "property", format!("`{kind}` is no kind of number")))?,
            ),
            _ => return Err(damaged(name, "property", format!("`{line}` is none"))),
        });
    }
    Ok(Some(Faces { count, properties }))
}

fn bytes_of(kind: &str) -> Option<usize> {
    Some(match kind {
        "char" | "uchar" | "int8" | "uint8" => 1,
        "short" | "ushort" | "int16" | "uint16" => 2,
        "int" | "uint" | "float" | "int32" | "uint32" | "float32" => 4,
        "double" | "float64" => 8,
        _ => return None,
    })
}

struct Reader<'a> {
    rest: &'a [u8],
    numbers: Numbers,
    /// Of a text, the last word first.
    words: Vec<String>,
}

impl Reader<'_> {
    fn pass(&mut self, bytes: usize) -> Option<()> {
        if self.numbers == Numbers::Text {
            return self.words.pop().map(|_| ());
        }
        self.rest = self.rest.get(bytes..)?;
        Some(())
    }

    /// A whole number from 0 on; `None` where the file ends before it, or holds another.
    fn whole(&mut self, kind: &str) -> Option<u64> {
        if self.numbers == Numbers::Text {
            return self.words.pop()?.parse().ok();
        }
        let bytes = bytes_of(kind).filter(|_| !kind.contains("float") && kind != "double")?;
        let mut word = [0u8; 8];
        for (n, byte) in self.rest.get(..bytes)?.iter().enumerate() {
            let place = if self.numbers == Numbers::Little { n } else { bytes - 1 - n };
            word[place] = *byte;
        }
        self.rest = &self.rest[bytes..];
        let value = u64::from_le_bytes(word);
        let signed = !kind.starts_with('u');
        // The highest bit of a signed number: it is below 0.
        (!signed || value >> (8 * bytes - 1) == 0).then_some(value)
    }
}
