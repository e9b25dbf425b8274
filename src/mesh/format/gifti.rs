//! GIFTI: surfaces (`.surf.gii`) and numbers on their nodes (`.shape.gii`), what FreeSurfer, Connectome Workbench,
//! nilearn and 3D Slicer open.
//!
//! Coordinates are single precision as the format demands: good to 4e-6 mm within 128 mm of the origin.
//! Source: GIFTI Surface Data Format 1.0 (2011), <https://www.nitrc.org/projects/gifti/>.

pub use super::gifti_space::Space;
use super::gifti_space::{Transform, to_scanner};
use super::{Field, ReadError, WriteError, check_fields, line};
use crate::mesh::TriMesh;
use base64::prelude::{BASE64_STANDARD, Engine};
use flate2::{Compression, read::ZlibDecoder, write::ZlibEncoder};
use quick_xml::escape::{escape, resolve_predefined_entity};
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};
use std::io::{Read, Write};

const HEAD: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
     <!DOCTYPE GIFTI SYSTEM \"http://www.nitrc.org/frs/download.php/115/gifti.dtd\">\n";
/// Rows on lines of their own: nibabel reads the matrix by lines.
const IDENTITY: &str = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1";

/// The bytes of a `.surf.gii` file; `name` says what the surface is (`ventricle`).
///
/// ```
/// use hgm::mesh::{TriMesh, format::gifti};
/// let nodes_mm = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let surface = TriMesh { nodes_mm, triangles: vec![[0, 1, 2]] };
/// let bytes = gifti::encode_surface(&surface, gifti::Space::Mni152, "pial");
/// assert_eq!(gifti::decode_surface(&bytes, "pial.surf.gii").unwrap(), surface);
/// ```
pub fn encode_surface(surface: &TriMesh, space: Space, name: &str) -> Vec<u8> {
    let coordinates: Vec<u8> = surface.nodes_mm.iter().flatten().flat_map(|&x| (x as f32).to_le_bytes()).collect();
    let triangles: Vec<u8> = surface.triangles.iter().flatten().flat_map(|&n| (n as i32).to_le_bytes()).collect();
    let (space, name) = (space.name(), escape(name));
    let mut xml = format!("{HEAD}<GIFTI Version=\"1.0\" NumberOfDataArrays=\"2\">\n<MetaData/>\n<LabelTable/>\n");
    let about = format!(
        "<MetaData><MD><Name>AnatomicalStructureSecondary</Name><Value>{name}</Value></MD></MetaData>\n\
         <CoordinateSystemTransformMatrix>\n<DataSpace>{space}</DataSpace>\n\
         <TransformedSpace>{space}</TransformedSpace>\n<MatrixData>{IDENTITY}</MatrixData>\n\
         </CoordinateSystemTransformMatrix>\n"
    );
    let nodes = surface.nodes_mm.len();
    data_array(&mut xml, "NIFTI_INTENT_POINTSET", "NIFTI_TYPE_FLOAT32", &[nodes, 3], &about, &coordinates);
    let kind = if surface.is_closed() { "Closed" } else { "Open" };
    let topology = format!("<MetaData><MD><Name>TopologicalType</Name><Value>{kind}</Value></MD></MetaData>\n");
    let count = surface.triangles.len();
    data_array(&mut xml, "NIFTI_INTENT_TRIANGLE", "NIFTI_TYPE_INT32", &[count, 3], &topology, &triangles);
    xml += "</GIFTI>\n";
    xml.into_bytes()
}

/// The bytes of a `.shape.gii` file: fields of one component on the `nodes` nodes of a surface.
///
/// # Errors
/// [`WriteError`] for a field of the wrong length, of several components, or a name that occurs twice.
pub fn encode_shape(nodes: usize, fields: &[Field]) -> Result<Vec<u8>, WriteError> {
    check_fields(fields, nodes, &[])?;
    let arrays = fields.len();
    let mut xml =
        format!("{HEAD}<GIFTI Version=\"1.0\" NumberOfDataArrays=\"{arrays}\">\n<MetaData/>\n<LabelTable/>\n");
    for field in fields {
        if field.components != 1 {
            return Err(WriteError::FieldLength {
                field: field.name.clone(),
                components: 1,
                places: nodes,
                expected: nodes,
                found: field.values.len(),
            });
        }
        let name = escape(&field.name);
        let about = format!("<MetaData><MD><Name>Name</Name><Value>{name}</Value></MD></MetaData>\n");
        let bytes: Vec<u8> = field.values.iter().flat_map(|&v| (v as f32).to_le_bytes()).collect();
        data_array(&mut xml, "NIFTI_INTENT_SHAPE", "NIFTI_TYPE_FLOAT32", &[nodes], &about, &bytes);
    }
    xml += "</GIFTI>\n";
    Ok(xml.into_bytes())
}

fn data_array(xml: &mut String, intent: &str, number: &str, dims: &[usize], about: &str, bytes: &[u8]) {
    let sizes: Vec<String> = dims.iter().enumerate().map(|(axis, size)| format!("Dim{axis}=\"{size}\"")).collect();
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(6));
    let packed = encoder.write_all(bytes).and_then(|()| encoder.finish()).expect("writing to memory does not fail");
    line(
        xml,
        format_args!(
            "<DataArray Intent=\"{intent}\" DataType=\"{number}\" ArrayIndexingOrder=\"RowMajorOrder\" \
             Dimensionality=\"{}\" {} Encoding=\"GZipBase64Binary\" Endian=\"LittleEndian\" \
             ExternalFileName=\"\" ExternalFileOffset=\"\">\n{about}<Data>{}</Data>\n</DataArray>",
            dims.len(),
            sizes.join(" "),
            BASE64_STANDARD.encode(packed)
        ),
    );
}

/// The surface in the bytes of a `.surf.gii` file, in the scanner's frame where the file says the way there; `name` is what messages
/// call the file.
///
/// # Errors
/// [`ReadError`] for a damaged file, arrays kept in another file, triangles that name nodes which are not there, and coordinates of
/// which nobody knows where they lie.
pub fn decode_surface(bytes: &[u8], name: &str) -> Result<TriMesh, ReadError> {
    Ok(decode_surface_in(bytes, name)?.0)
}

/// [`decode_surface`] with the frame that the file says its coordinates are in; `None` where it says none.
///
/// # Errors
/// As [`decode_surface`].
pub fn decode_surface_in(bytes: &[u8], name: &str) -> Result<(TriMesh, Option<Space>), ReadError> {
    let arrays = arrays(bytes, name)?;
    let find = |intent: &str, what: &str| {
        arrays.iter().find(|a| a.intent == intent).ok_or_else(|| ReadError::Unsupported {
            file: name.to_owned(),
            field: what.to_owned(),
            problem: format!("there is no array of intent {intent}: this is not a surface file (.surf.gii)"),
        })
    };
    let numbers = |array: &Array, what: &str| -> Result<Vec<f64>, ReadError> {
        let damaged = |problem| ReadError::Damaged { file: name.to_owned(), field: what.to_owned(), problem };
        let values = array.values().map_err(damaged)?;
        if values.len() % 3 != 0 || values.len() != array.count {
            return Err(damaged(format!("{} numbers, not {}", values.len(), array.count)));
        }
        Ok(values)
    };
    let points = find("NIFTI_INTENT_POINTSET", "coordinates")?;
    let mut nodes_mm = numbers(points, "coordinates")?.as_chunks::<3>().0.to_vec();
    let damaged = |field: &str, problem| ReadError::Damaged { file: name.to_owned(), field: field.to_owned(), problem };
    if let Some(node) = nodes_mm.iter().position(|p: &[f64; 3]| p.iter().any(|x| !x.is_finite())) {
        return Err(damaged("coordinates", format!("node {node} has a coordinate that is not a finite number")));
    }
    let space = to_scanner(&mut nodes_mm, &points.transforms, &points.about);
    let space = space.map_err(|problem| damaged("coordinates", problem))?;
    let mut triangles = Vec::new();
    let named = numbers(find("NIFTI_INTENT_TRIANGLE", "triangles")?, "triangles")?;
    for (t, triangle) in named.as_chunks::<3>().0.iter().enumerate() {
        if let Some(n) = triangle.iter().find(|&&n| n < 0.0 || n as usize >= nodes_mm.len() || n.fract() != 0.0) {
            return Err(damaged("triangles", format!("triangle {t} names node {n} of {}", nodes_mm.len())));
        }
        triangles.push(triangle.map(|n| n as u32));
    }
    Ok((TriMesh { nodes_mm, triangles }, space))
}

/// The fields in the bytes of a `.shape.gii` (or `.func.gii`) file, in the file's order.
///
/// # Errors
/// [`ReadError`] for a damaged file.
pub fn decode_shape(bytes: &[u8], name: &str) -> Result<Vec<Field>, ReadError> {
    let mut fields = Vec::new();
    for (n, array) in arrays(bytes, name)?.into_iter().enumerate() {
        let damaged = |problem| ReadError::Damaged { file: name.to_owned(), field: format!("array {n}"), problem };
        let values = array.values().map_err(damaged)?;
        if values.len() != array.count {
            return Err(damaged(format!("{} numbers, not {}", values.len(), array.count)));
        }
        fields.push(Field::scalar(array.name.trim(), values));
    }
    Ok(fields)
}

/// A `DataArray` as it stands in the file.
#[derive(Default)]
struct Array {
    intent: String,
    number: String,
    encoding: String,
    big_endian: bool,
    column_major: bool,
    count: usize,
    name: String,
    text: String,
    transforms: Vec<Transform>,
    /// What else the file says of it, by name.
    about: Vec<(String, String)>,
}

impl Array {
    fn values(&self) -> Result<Vec<f64>, String> {
        if self.column_major {
            return Err("the array is in column-major order; save it in row-major order".to_owned());
        }
        if self.encoding == "ASCII" {
            let number = |word: &str| word.parse().map_err(|_| format!("`{word}` is not a number"));
            return self.text.split_ascii_whitespace().map(number).collect();
        }
        let text: Vec<u8> = self.text.bytes().filter(|b| !b.is_ascii_whitespace()).collect();
        let packed = BASE64_STANDARD.decode(text).map_err(|e| format!("not base64: {e}"))?;
        let bytes = match self.encoding.as_str() {
            "Base64Binary" => packed,
            "GZipBase64Binary" => {
                let mut bytes = Vec::new();
                // A block that unpacks to more than was announced is not read to its end.
                let limit = (self.count as u64).saturating_mul(8).saturating_add(1);
                ZlibDecoder::new(packed.as_slice()).take(limit).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
                bytes
            }
            other => return Err(format!("encoding `{other}` keeps the numbers elsewhere; save them in the file")),
        };
        let (words, rest) = bytes.as_chunks::<4>();
        if !rest.is_empty() {
            return Err(format!("{} bytes are no whole number of words", bytes.len()));
        }
        let word = |w: &[u8; 4]| if self.big_endian { u32::from_be_bytes(*w) } else { u32::from_le_bytes(*w) };
        match self.number.as_str() {
            "NIFTI_TYPE_FLOAT32" => Ok(words.iter().map(|w| f64::from(f32::from_bits(word(w)))).collect()),
            "NIFTI_TYPE_INT32" => Ok(words.iter().map(|w| f64::from(word(w).cast_signed())).collect()),
            other => Err(format!("type `{other}`; GIFTI surfaces hold FLOAT32 and INT32")),
        }
    }
}

fn arrays(bytes: &[u8], file: &str) -> Result<Vec<Array>, ReadError> {
    let damaged =
        |field: &str, problem: String| ReadError::Damaged { file: file.to_owned(), field: field.to_owned(), problem };
    let text =
        std::str::from_utf8(bytes).map_err(|e| damaged("XML", format!("byte {} is not UTF-8", e.valid_up_to())))?;
    let mut reader = Reader::from_str(text);
    let (mut arrays, mut path, mut key) = (Vec::<Array>::new(), Vec::<String>::new(), String::new());
    let mut closed = false;
    loop {
        match reader.read_event().map_err(|e| damaged("XML", e.to_string()))? {
            Event::Start(element) => {
                let name = element.local_name().as_ref().to_owned();
                if name == "DataArray" {
                    arrays.push(array(&element).map_err(|e| damaged("DataArray", e))?);
                } else if let ("CoordinateSystemTransformMatrix", Some(array)) = (name.as_str(), arrays.last_mut()) {
                    array.transforms.push(Transform::default());
                }
                path.push(name);
            }
            Event::End(_) => closed = path.pop().as_deref() == Some("GIFTI"),
            Event::Text(words) => take(&mut arrays, &path, &mut key, &words.into_inner()),
            Event::CData(words) => take(&mut arrays, &path, &mut key, &words.into_inner()),
            Event::GeneralRef(entity) => {
                let words = resolve_predefined_entity(&entity.into_inner()).unwrap_or("?");
                take(&mut arrays, &path, &mut key, words);
            }
            Event::Eof => break,
            _ => {}
        }
    }
    if closed { Ok(arrays) } else { Err(damaged("XML", "the file ends before `</GIFTI>`".to_owned())) }
}

/// Puts text where its place in the file says: numbers, or the array's name (`key` is the latest metadata key).
fn take(arrays: &mut [Array], path: &[String], key: &mut String, words: &str) {
    let Some(array) = arrays.last_mut() else { return };
    match path.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [.., "DataArray", "Data"] => array.text += words,
        [.., "DataArray", "MetaData", "MD", "Name"] if !words.trim().is_empty() => words.trim().clone_into(key),
        [.., "DataArray", "MetaData", "MD", "Value"] if key == "Name" => array.name += words,
        [.., "DataArray", "MetaData", "MD", "Value"] if !words.trim().is_empty() => {
            array.about.push((key.clone(), words.to_owned()));
        }
        [.., "CoordinateSystemTransformMatrix", part] => {
            let Some(transform) = array.transforms.last_mut() else { return };
            match part {
                "DataSpace" => transform.data_space += words,
                "TransformedSpace" => transform.transformed_space += words,
                "MatrixData" => transform.matrix += words,
                _ => {}
            }
        }
        _ => {}
    }
}

fn array(element: &BytesStart<'_>) -> Result<Array, String> {
    let get = |key: &str| -> Result<String, String> {
        let Some(attribute) = element.try_get_attribute(key).map_err(|e| e.to_string())? else {
            return Ok(String::new());
        };
        Ok(attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|e| e.to_string())?.into_owned())
    };
    let size = |key: &str| -> Result<usize, String> {
        let text = get(key)?;
        if text.is_empty() { Ok(1) } else { text.trim().parse().map_err(|_| format!("`{key}` is `{text}`")) }
    };
    Ok(Array {
        intent: get("Intent")?,
        number: get("DataType")?,
        encoding: get("Encoding")?,
        big_endian: get("Endian")? == "BigEndian",
        column_major: get("ArrayIndexingOrder")? == "ColumnMajorOrder" && size("Dim1")? > 1,
        count: size("Dim0")?.saturating_mul(size("Dim1")?),
        ..Array::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface() -> TriMesh {
        let nodes_mm = vec![[0.0; 3], [1.5, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
        TriMesh { nodes_mm, triangles: vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]] }
    }

    #[test]
    fn fields_on_a_surface_come_back_by_name() {
        let fields = [Field::scalar("rmse_mm", vec![0.5, 1.0, 2.0, -4.0]), Field::scalar("a & b", vec![0.0; 4])];
        let bytes = encode_shape(4, &fields).unwrap();
        let back = decode_shape(&bytes, "x.shape.gii").unwrap();
        assert_eq!(back, fields);
        assert!(encode_shape(3, &fields).is_err());
        assert!(encode_shape(4, &[Field::vector("u", &[[0.0; 3]; 4])]).is_err());
    }

    #[test]
    fn only_a_surface_without_a_rim_is_called_closed() {
        let called = |surface: &TriMesh| {
            let text = String::from_utf8(encode_surface(surface, Space::Scanner, "a")).unwrap();
            let after = text.split("<Name>TopologicalType</Name><Value>").nth(1).unwrap();
            after.split('<').next().unwrap().to_owned()
        };
        let (closed, mut open, mut wing) = (surface(), surface(), surface());
        open.triangles.pop();
        // A fin on a closed surface: three triangles at one edge.
        wing.nodes_mm.push([5.0; 3]);
        wing.triangles.push([0, 1, 4]);
        let none = TriMesh::default();
        assert_eq!([&closed, &open, &wing, &none].map(called), ["Closed", "Open", "Open", "Open"]);
    }

    #[test]
    fn a_file_cut_anywhere_is_refused() {
        let whole = encode_surface(&surface(), Space::Scanner, "pial");
        for length in 0..whole.len() - "</GIFTI>\n".len() {
            assert!(decode_surface(&whole[..length], "cut.surf.gii").is_err(), "cut at {length}");
        }
    }

    #[test]
    fn a_triangle_of_missing_nodes_is_refused() {
        let mut wrong = surface();
        wrong.triangles[2][1] = 4;
        let bytes = encode_surface(&wrong, Space::Scanner, "pial");
        let message = decode_surface(&bytes, "x.surf.gii").unwrap_err().to_string();
        assert!(message.starts_with("x.surf.gii: triangles: triangle 2 names node 4 of 4"), "{message}");
    }
}
