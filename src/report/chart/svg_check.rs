//! What the tests of every chart ask of its SVG.

/// Panics unless the text is well-formed XML.
pub(in crate::report) fn well_formed(svg: &str) {
    let mut reader = quick_xml::Reader::from_str(svg);
    loop {
        match reader.read_event().unwrap() {
            quick_xml::events::Event::Eof => break,
            quick_xml::events::Event::Text(t) => assert!(!t.is_empty()),
            _ => {}
        }
    }
}
