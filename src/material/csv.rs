//! Comma-separated tables with quoted cells (RFC 4180) that remember their line numbers.
//!
//! By hand: the csv crate takes a quote that is never closed for one long cell and says nothing, and a table of studies would
//! lose its rows that way.

use thiserror::Error;

/// One row: the line it starts on (the first line is 1) and its cells without quotes, trimmed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// Line in the file.
    pub line: usize,
    /// Cells.
    pub cells: Vec<String>,
}

/// Why bytes are not a table.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum CsvError {
    /// A quote that is never closed.
    #[error("line {line}: the quote is never closed; close it, or take it away")]
    OpenQuote {
        /// Line of the quote.
        line: usize,
    },
    /// Bytes that are not UTF-8.
    #[error("line {line}: the text is not UTF-8; save the table as UTF-8")]
    NotText {
        /// Line of the first bad byte.
        line: usize,
    },
}

/// The rows of a table; blank lines and lines that start with `#` are left out.
///
/// # Errors
/// [`CsvError`] with the line.
pub fn rows(bytes: &[u8]) -> Result<Vec<Row>, CsvError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes)
        .map_err(|error| CsvError::NotText { line: bytes[..error.valid_up_to()].split(|b| *b == b'\n').count() })?;
    let mut rows = Vec::new();
    let mut characters = text.chars().peekable();
    let mut line = 1;
    while characters.peek().is_some() {
        let start = line;
        let (mut cells, mut cell, mut quoted, mut inside) = (Vec::new(), String::new(), false, false);
        loop {
            match characters.next() {
                None if inside => return Err(CsvError::OpenQuote { line: start }),
                None => break,
                Some('\n') if !inside => {
                    line += 1;
                    break;
                }
                Some('"') if inside => {
                    if characters.next_if_eq(&'"').is_some() {
                        cell.push('"');
                    } else {
                        inside = false;
                    }
                }
                Some('"') if !quoted && cell.trim().is_empty() => {
                    (quoted, inside) = (true, true);
                    cell.clear();
                }
                Some(',') if !inside => {
                    cells.push(std::mem::take(&mut cell).trim().to_owned());
                    quoted = false;
                }
                Some(character) => {
                    line += usize::from(character == '\n');
                    cell.push(character);
                }
            }
        }
        cells.push(cell.trim().to_owned());
        let blank = cells.iter().all(String::is_empty);
        if !blank && !cells[0].starts_with('#') {
            rows.push(Row { line: start, cells });
        }
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quoted_cells_keep_commas_quotes_and_line_breaks() {
        let table = rows(b"\xef\xbb\xbfa,b\r\n# a remark\n\n\"x, \"\"y\"\"\", 2 \n\"two\nlines\",3\nlast,").unwrap();
        let cells = |i: usize| table[i].cells.iter().map(String::as_str).collect::<Vec<_>>();
        assert_eq!((cells(0), table[0].line), (vec!["a", "b"], 1));
        assert_eq!((cells(1), table[1].line), (vec!["x, \"y\"", "2"], 4));
        assert_eq!((cells(2), table[2].line), (vec!["two\nlines", "3"], 5));
        assert_eq!((cells(3), table[3].line), (vec!["last", ""], 7));
    }

    #[test]
    fn an_open_quote_and_bytes_that_are_no_text_are_refused_with_their_line() {
        assert_eq!(rows(b"a,b\n\"c,d\n"), Err(CsvError::OpenQuote { line: 2 }));
        assert_eq!(rows(b"a\nb\n\xff\n"), Err(CsvError::NotText { line: 3 }));
    }
}
