//! PVD, ParaView's list of files along time: a series of samples or load steps.

use super::line;
use quick_xml::escape::escape;

/// The bytes of a PVD file: `(time, file)` in order; files are named as seen from the PVD's own folder.
///
/// ```
/// let bytes = hgm::mesh::format::pvd::encode(&[(0.0, "sample-0.vtu"), (1.0, "sample-1.vtu")]);
/// assert!(String::from_utf8(bytes).unwrap().contains(r#"<DataSet timestep="1" part="0" file="sample-1.vtu"/>"#));
/// ```
pub fn encode(series: &[(f64, &str)]) -> Vec<u8> {
    let mut xml = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n<Collection>\n",
    );
    for (time, file) in series {
        line(&mut xml, format_args!("<DataSet timestep=\"{time}\" part=\"0\" file=\"{}\"/>", escape(*file)));
    }
    xml += "</Collection>\n</VTKFile>\n";
    xml.into_bytes()
}
