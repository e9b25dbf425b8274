//! The XML of a VTU file as it stands: its arrays, whatever their storage, and of them the tetrahedra and their labels.

use super::vtk_array::{NumberType, Source, Storage, numbers_from_bytes, numbers_from_text};
use super::{Field, ReadError};
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

/// VTK's number of the linear tetrahedron.
pub(super) const VTK_TETRA: u8 = 10;
/// Attribute of a file whose node sets are marked.
pub(super) const MARKED: &str = "hgm_sets";
/// Attribute of an array that is a set, and what it is a set of.
pub(super) const SET: (&str, &str) = ("hgm_set", "nodes");

/// The elements of a piece that hold its arrays. What else may stand among them (`Array` of strings, `InformationKey`) is none.
const SECTIONS: [&str; 5] = ["Points", "Cells", "PointData", "CellData", "FieldData"];

/// A `DataArray` as it stands in the file.
#[derive(Debug, Default)]
pub(super) struct RawArray {
    pub section: String,
    pub name: String,
    number: String,
    components: usize,
    format: String,
    offset: usize,
    /// Whether it is marked as a node set.
    pub is_set: bool,
    text: String,
}

impl RawArray {
    pub fn is_integer(&self) -> bool {
        matches!(NumberType::from_name(&self.number), Some(NumberType::Int(_) | NumberType::UInt(_)))
    }
}

pub(super) struct File<'a> {
    name: &'a str,
    storage: Storage,
    /// Whether node sets are marked as such.
    pub marked: bool,
    pub points: usize,
    pub cells: usize,
    pub arrays: Vec<RawArray>,
    /// Bytes after the underscore of `AppendedData`, and whether they are base64.
    appended: Option<(&'a [u8], bool)>,
}

impl<'a> File<'a> {
    fn damaged(&self, field: &str, problem: impl Into<String>) -> ReadError {
        ReadError::Damaged { file: self.name.to_owned(), field: field.to_owned(), problem: problem.into() }
    }

    pub fn unsupported(&self, field: &str, problem: impl Into<String>) -> ReadError {
        ReadError::Unsupported { file: self.name.to_owned(), field: field.to_owned(), problem: problem.into() }
    }

    pub fn parse(bytes: &'a [u8], name: &'a str) -> Result<Self, ReadError> {
        let storage = Storage { big_endian: false, header_bytes: 4, zlib: false };
        let mut file = Self { name, storage, marked: false, points: 0, cells: 0, arrays: Vec::new(), appended: None };
        // What is appended need not be text, so the XML ends there for us.
        let marker = b"<AppendedData";
        let split = bytes.windows(marker.len()).position(|w| w == marker);
        let text = std::str::from_utf8(&bytes[..split.unwrap_or(bytes.len())])
            .map_err(|e| file.damaged("XML", format!("byte {} is not UTF-8", e.valid_up_to())))?;
        if let Some(start) = split {
            file.appended = Some(file.appended_data(&bytes[start..])?);
        }

        let mut reader = Reader::from_str(text);
        reader.config_mut().expand_empty_elements = true;
        let (mut section, mut open, mut pieces, mut closed) = (String::new(), None::<RawArray>, 0, split.is_some());
        let mut inside = 0usize;
        loop {
            match reader.read_event().map_err(|e| file.damaged("XML", e.to_string()))? {
                Event::Start(element) => match element.local_name().as_ref() {
                    "VTKFile" => file.read_root(&element)?,
                    "Piece" => {
                        pieces += 1;
                        file.points = file.count(&element, "NumberOfPoints")?;
                        file.cells = file.count(&element, "NumberOfCells")?;
                    }
                    "DataArray" => open = Some(file.raw_array(&element, &section)?),
                    _ if open.is_some() => inside += 1,
                    other if SECTIONS.contains(&other) => other.clone_into(&mut section),
                    _ => {}
                },
                Event::Text(text) => {
                    // VTK nests `InformationKey` into arrays; its text is not the array's.
                    if let Some(raw) = open.as_mut().filter(|_| inside == 0) {
                        raw.text += &text.into_inner();
                    }
                }
                Event::End(element) => match element.local_name().as_ref() {
                    "DataArray" => file.arrays.extend(open.take()),
                    "VTKFile" => closed = true,
                    _ if open.is_some() => inside = inside.saturating_sub(1),
                    other if SECTIONS.contains(&other) => section.clear(),
                    _ => {}
                },
                Event::Eof => break,
                _ => {}
            }
        }
        if !closed {
            return Err(file.damaged("XML", "the file ends before `</VTKFile>`"));
        }
        match pieces {
            1 => Ok(file),
            0 => Err(file.damaged("Piece", "there is none")),
            n => Err(file.unsupported(
                "Piece",
                format!(
                    "there are {n}, and nodes at their seams may be doubled; merge them into one (ParaView: Clean)"
                ),
            )),
        }
    }

    fn attribute(&self, element: &BytesStart<'_>, key: &str) -> Result<Option<String>, ReadError> {
        let wrong = |e: String| self.damaged(element.local_name().as_ref(), e);
        let Some(attribute) = element.try_get_attribute(key).map_err(|e| wrong(e.to_string()))? else {
            return Ok(None);
        };
        let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|e| wrong(e.to_string()))?;
        Ok(Some(value.into_owned()))
    }

    fn count(&self, element: &BytesStart<'_>, key: &str) -> Result<usize, ReadError> {
        let text = self.attribute(element, key)?.ok_or_else(|| self.damaged("Piece", format!("`{key}` is missing")))?;
        text.trim().parse().map_err(|_| self.damaged("Piece", format!("`{key}` is `{text}`, not a count")))
    }

    fn read_root(&mut self, element: &BytesStart<'_>) -> Result<(), ReadError> {
        let get = |key| self.attribute(element, key);
        let kind = get("type")?.unwrap_or_default();
        if kind != "UnstructuredGrid" {
            return Err(self.unsupported("VTKFile", format!("type `{kind}`: only UnstructuredGrid holds tetrahedra")));
        }
        let marked = get(MARKED)?.is_some();
        self.storage = Storage {
            big_endian: get("byte_order")?.as_deref() == Some("BigEndian"),
            header_bytes: if get("header_type")?.as_deref() == Some("UInt64") { 8 } else { 4 },
            zlib: match get("compressor")?.as_deref() {
                None | Some("") => false,
                Some("vtkZLibDataCompressor") => true,
                Some(other) => {
                    return Err(self.unsupported("VTKFile", format!("compressor `{other}`: write with zlib or none")));
                }
            },
        };
        self.marked = marked;
        Ok(())
    }

    fn raw_array(&self, element: &BytesStart<'_>, section: &str) -> Result<RawArray, ReadError> {
        let get = |key| self.attribute(element, key);
        let name = get("Name")?.unwrap_or_else(|| section.to_owned());
        let number = |key: &str, otherwise: usize| match self.attribute(element, key)? {
            None => Ok(otherwise),
            Some(text) => {
                text.trim().parse().map_err(|_| self.damaged(&name, format!("`{key}` is `{text}`, not a number")))
            }
        };
        Ok(RawArray {
            section: section.to_owned(),
            number: get("type")?.unwrap_or_default(),
            // VTK writes 0 or nothing for one component.
            components: number("NumberOfComponents", 1)?.max(1),
            format: get("format")?.unwrap_or_else(|| "ascii".to_owned()),
            offset: number("offset", 0)?,
            is_set: get(SET.0)?.as_deref() == Some(SET.1),
            text: String::new(),
            name,
        })
    }

    /// The payload behind `<AppendedData encoding="...">` and the underscore that opens it.
    fn appended_data(&self, bytes: &'a [u8]) -> Result<(&'a [u8], bool), ReadError> {
        let cut = || self.damaged("AppendedData", "the file ends before its data");
        let tag_end = bytes.iter().position(|&b| b == b'>').ok_or_else(cut)?;
        let tag = String::from_utf8_lossy(&bytes[..tag_end]);
        let underscore = bytes[tag_end..].iter().position(|&b| b == b'_').ok_or_else(cut)?;
        Ok((&bytes[tag_end + underscore + 1..], tag.contains("base64")))
    }

    fn decode_array(&self, raw: &RawArray) -> Result<Vec<f64>, ReadError> {
        let number = NumberType::from_name(&raw.number)
            .ok_or_else(|| self.unsupported(&raw.name, format!("type `{}` is not a type of numbers", raw.number)))?;
        let decoded = match raw.format.as_str() {
            "ascii" => numbers_from_text(&raw.text),
            "binary" => numbers_from_bytes(Source::base64(raw.text.as_bytes()), self.storage, number),
            "appended" => {
                let (payload, base64) =
                    self.appended.ok_or_else(|| self.damaged(&raw.name, "`AppendedData` is missing"))?;
                let payload = payload.get(raw.offset..).ok_or_else(|| {
                    self.damaged(&raw.name, format!("offset {} is beyond the appended data", raw.offset))
                })?;
                let source = if base64 { Source::base64(payload) } else { Source::Raw(payload) };
                numbers_from_bytes(source, self.storage, number)
            }
            other => {
                let problem = format!("format `{other}` is not ascii, binary or appended; write the file again");
                return Err(self.unsupported(&raw.name, problem));
            }
        };
        decoded.map_err(|problem| self.damaged(&raw.name, problem))
    }

    /// The numbers of a required array: `components` for each of `places`.
    pub fn numbers(
        &self,
        section: &str,
        name: Option<&str>,
        components: usize,
        places: usize,
    ) -> Result<Vec<f64>, ReadError> {
        let field = name.unwrap_or(section);
        let raw = self
            .arrays
            .iter()
            .find(|a| a.section == section && name.is_none_or(|n| a.name == n))
            .ok_or_else(|| self.damaged(field, "the array is missing"))?;
        let numbers = self.decode_array(raw)?;
        // Counts come from the file: their product may be anything.
        let wanted = components.saturating_mul(places);
        if numbers.len() != wanted {
            return Err(self.damaged(field, format!("{} numbers, not {wanted}", numbers.len())));
        }
        Ok(numbers)
    }

    /// A point or cell array; `None` when it does not hold numbers.
    pub fn field(&self, raw: &RawArray, places: usize) -> Result<Option<Field>, ReadError> {
        if NumberType::from_name(&raw.number).is_none() {
            return Ok(None);
        }
        let values = self.decode_array(raw)?;
        if values.len() != raw.components.saturating_mul(places) {
            let wanted = format!("{} numbers, not {} x {places}", values.len(), raw.components);
            return Err(self.damaged(&raw.name, wanted));
        }
        Ok(Some(Field { name: raw.name.clone(), components: raw.components, values }))
    }

    /// The tetrahedra and, for each, its number among all cells of the file.
    pub fn tets(&self) -> Result<(Vec<[u32; 4]>, Vec<usize>), ReadError> {
        let types = self.numbers("Cells", Some("types"), 1, self.cells)?;
        let offsets = self.numbers("Cells", Some("offsets"), 1, self.cells)?;
        let corners = self.numbers("Cells", Some("connectivity"), 1, offsets.last().map_or(0, |&n| n as usize))?;
        let (mut tets, mut cell_numbers) = (Vec::new(), Vec::new());
        let mut start = 0;
        for (cell, (&kind, &end)) in types.iter().zip(&offsets).enumerate() {
            let nodes = corners.get(start..end as usize).ok_or_else(|| {
                self.damaged("offsets", format!("cell {cell} goes from {start} to {end} of {}", corners.len()))
            })?;
            start = end as usize;
            let kind = kind as u8;
            if kind == VTK_TETRA {
                let node = |n: f64| Some(n as u32).filter(|&index| f64::from(index) == n);
                let tet = match *nodes {
                    [a, b, c, d] => [a, b, c, d].map(node),
                    _ => return Err(self.damaged("offsets", format!("tetrahedron {cell} has {} nodes", nodes.len()))),
                };
                let [Some(a), Some(b), Some(c), Some(d)] = tet else {
                    let named = nodes.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
                    let problem = format!("cell {cell} names a node that is no whole number or below 0: {named}");
                    return Err(self.damaged("connectivity", problem));
                };
                tets.push([a, b, c, d]);
                cell_numbers.push(cell);
            } else if !is_flat(kind) {
                return Err(self.unsupported(
                    "types",
                    format!("cell {cell} has VTK type {kind}; only linear tetrahedra (10) are taken: split or convert"),
                ));
            }
        }
        Ok((tets, cell_numbers))
    }

    pub fn labels(&self, cell_numbers: &[usize]) -> Result<Vec<u8>, ReadError> {
        let cell_arrays = || self.arrays.iter().filter(|a| a.section == "CellData");
        let raw = ["label", "gmsh:physical"]
            .iter()
            .find_map(|name| cell_arrays().find(|a| a.name == *name))
            .ok_or_else(|| {
                let there: Vec<&str> = cell_arrays().map(|a| a.name.as_str()).collect();
                let there = if there.is_empty() { "none".to_owned() } else { there.join(", ") };
                self.unsupported(
                    "label",
                    format!(
                        "the cells carry no label (cell arrays: {there}); \
                         add an integer cell array `label`, such as 2 for grey and 3 for white matter"
                    ),
                )
            })?;
        let values = self.decode_array(raw)?;
        if values.len() != self.cells {
            return Err(self.damaged(&raw.name, format!("{} numbers for {} cells", values.len(), self.cells)));
        }
        let label = |&cell: &usize| {
            let value = values[cell];
            let label = value as u8;
            if f64::from(label) == value {
                return Ok(label);
            }
            Err(self.unsupported(&raw.name, format!("cell {cell} has label {value}; labels are whole, 0 to 255")))
        };
        cell_numbers.iter().map(label).collect()
    }
}

/// VTK cell types of dimension 0, 1 and 2, linear and quadratic.
fn is_flat(kind: u8) -> bool {
    matches!(kind, 0..=9 | 21..=23 | 28 | 30 | 34..=36 | 68..=70 | 75..=77)
}
