//! A label table of the user's own: tab-separated, as BIDS writes `*_dseg.tsv`, with a column that says the tissue.

use super::table::{LabelTable, Tissue};
use thiserror::Error;

/// Why a table cannot be read; lines count from 1.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum TsvError {
    /// No header with the columns.
    #[error(
        "line 1: the column `{column}` is missing; the header must name index, name and tissue, separated by tabs (tissue is \
         one of background, csf, grey_matter, white_matter, ventricle, resected, tumour, oedema)"
    )]
    Column {
        /// The column.
        column: &'static str,
    },
    /// A number that is none.
    #[error("line {line}: index {value:?} is no whole number from 0 to 4294967295")]
    Index {
        /// The line.
        line: usize,
        /// What stands there.
        value: String,
    },
    /// A tissue that is none.
    #[error(
        "line {line}: tissue {value:?} is unknown; write background, csf, grey_matter, white_matter, ventricle, resected, \
         tumour or oedema"
    )]
    Tissue {
        /// The line.
        line: usize,
        /// What stands there.
        value: String,
    },
    /// A number twice.
    #[error("line {line}: index {code} stands there a second time; each number has one tissue")]
    Twice {
        /// The line.
        line: usize,
        /// The number.
        code: u32,
    },
    /// No tissue at all.
    #[error("it has no number for grey_matter or none for white_matter; a brain needs both")]
    NoTissue,
}

/// Reads the table; `name` is what messages call it.
///
/// # Errors
/// [`TsvError`] with the line.
pub fn table_from_tsv(text: &str, name: &str) -> Result<LabelTable, TsvError> {
    // Spreadsheets begin a file with a byte order mark.
    let mut lines = text.trim_start_matches('\u{feff}').lines();
    let header: Vec<&str> = lines.next().unwrap_or("").split('\t').map(str::trim).collect();
    let column = |column: &'static str| {
        header.iter().position(|h| h.eq_ignore_ascii_case(column)).ok_or(TsvError::Column { column })
    };
    let (index, tissue) = (column("index")?, column("tissue")?);
    let named = column("name").ok();
    let mut rows: Vec<(u32, String, Tissue)> = Vec::new();
    for (n, row) in lines.enumerate().filter(|(_, row)| !row.trim().is_empty()) {
        let line = n + 2;
        let cells: Vec<&str> = row.split('\t').map(str::trim).collect();
        let cell = |at: usize| cells.get(at).copied().unwrap_or("");
        let code: u32 = cell(index).parse().map_err(|_| TsvError::Index { line, value: cell(index).to_owned() })?;
        let kind =
            Tissue::of_name(cell(tissue)).ok_or_else(|| TsvError::Tissue { line, value: cell(tissue).to_owned() })?;
        if rows.iter().any(|r| r.0 == code) {
            return Err(TsvError::Twice { line, code });
        }
        rows.push((code, named.map_or(String::new(), |at| cell(at).to_owned()), kind));
    }
    let of = |kind: Tissue| rows.iter().filter(|r| r.2 == kind).map(|r| r.0).collect::<Vec<u32>>();
    let (grey, white) = (of(Tissue::Grey), of(Tissue::White));
    if grey.is_empty() || white.is_empty() {
        return Err(TsvError::NoTissue);
    }
    Ok(LabelTable::new(name, "a table of the user's own", "the file", rows, &[&grey, &white]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "index\tname\ttissue\n0\tair\tbackground\n10\tcortex\tgrey_matter\n20\tcore\twhite_matter\n\
                        30\tmass\ttumour\n";

    #[test]
    fn numbers_names_and_tissues_are_read() {
        let table = table_from_tsv(GOOD, "mine.tsv").unwrap();
        assert_eq!(table.structure(30).map(|s| (s.name.as_str(), s.tissue)), Some(("mass", Tissue::Tumour)));
        assert_eq!(table.structure(11), None);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let error = |text: &str| table_from_tsv(text, "mine.tsv").unwrap_err().to_string();
        assert!(error("index\tname\n1\ta\n").contains("`tissue` is missing"));
        assert!(error(&GOOD.replace("30", "3x")).contains("line 5: index \"3x\""));
        assert!(error(&GOOD.replace("tumour", "lump")).contains("line 5: tissue \"lump\""));
        assert!(error(&GOOD.replace("30", "20")).contains("line 5: index 20"));
        assert!(error(&GOOD.replace("white_matter", "csf")).contains("white_matter"));
    }
}
