//! Points as a table: columns `x`, `y`, `z` (mm, RAS+), or three columns of numbers and no others. A fourth may be a number of the
//! row as well as a coordinate: then a header says which.

use super::drawing::{Carried, Drawing, Kept, OverlayError, damaged, names_of, written};

/// The table as it was, and where its coordinates stand.
#[derive(Clone, Debug)]
pub(super) struct Table {
    header: Option<Vec<String>>,
    rows: Vec<Vec<String>>,
    columns: [usize; 3],
}

pub(super) fn decode(bytes: &[u8], name: &str) -> Result<Drawing, OverlayError> {
    refuse_other_separator(bytes, name)?;
    let table = without_comments(bytes);
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(false).trim(csv::Trim::All).from_reader(table.as_slice());
    let mut rows: Vec<Vec<String>> = Vec::new();
    for (n, record) in reader.records().enumerate() {
        let record = record.map_err(|e| damaged(name, format!("row {}", n + 1), in_words(&e)))?;
        rows.push(record.iter().map(|cell| cell.trim_start_matches('\u{feff}').to_owned()).collect());
    }
    let Some(first) = rows.first().cloned() else { return Err(damaged(name, "the table", "it holds no row")) };
    let is_number = |cell: &String| cell.parse::<f64>().is_ok();
    let numbers = first.iter().filter(|cell| is_number(cell)).count();
    if numbers > 3 {
        let problem =
            format!("{numbers} columns of numbers and no header: say above them which are x, y and z (mm, RAS)");
        return Err(damaged(name, "the first row", problem));
    }
    let (header, columns) = if numbers == 3 {
        let places: Vec<usize> = (0..first.len()).filter(|&c| is_number(&first[c])).collect();
        (None, [places[0], places[1], places[2]])
    } else {
        let named = |axis: &str| {
            let fits = |cell: &String| [axis, &format!("{axis}_mm")].contains(&cell.to_lowercase().as_str());
            let mut columns = (0..first.len()).filter(|&c| fits(&first[c]));
            match (columns.next(), columns.next()) {
                (Some(only), None) => Ok(only),
                (None, _) => Err(damaged(
                    name,
                    "the first row",
                    format!("no column is called `{axis}`: say x, y and z (mm, RAS)"),
                )),
                (Some(one), Some(other)) => {
                    let both = format!("`{}` and `{}`", first[one], first[other]);
                    let problem = format!(
                        "two columns may be {axis} ({both}): leave the one in mm of the scanner (RAS), rename the other"
                    );
                    Err(damaged(name, "the first row", problem))
                }
            }
        };
        let columns = [named("x")?, named("y")?, named("z")?];
        if first.iter().any(|cell| cell == "t") {
            let problem = "x, y, z, t are the columns of ANTs, whose x and y are those of LPS: turn the signs of x and y, and take t \
                           away (or call it otherwise, if the points are RAS)";
            return Err(damaged(name, "the first row", problem));
        }
        (Some(rows.remove(0)), columns)
    };
    let mut points_mm = Vec::with_capacity(rows.len());
    for (n, row) in rows.iter().enumerate() {
        let number = |c: usize| {
            let line = n + 1 + usize::from(header.is_some());
            row[c]
                .parse::<f64>()
                .map_err(|_| damaged(name, format!("row {line}"), format!("`{}` is not a number", row[c])))
        };
        points_mm.push([number(columns[0])?, number(columns[1])?, number(columns[2])?]);
    }
    let label = header
        .as_ref()
        .and_then(|h| h.iter().position(|c| ["name", "label", "id"].contains(&c.to_lowercase().as_str())));
    let label = label.or_else(|| header.is_none().then(|| (0..first.len()).find(|c| !is_number(&first[*c]))).flatten());
    let names = label.map_or_else(Vec::new, |c| names_of(rows.iter().map(|row| row[c].clone()).collect()));
    Ok(Drawing { points_mm, names, pairs_mm: Vec::new(), kept: Box::new(Table { header, rows, columns }) })
}

/// The table without its comments. A line that begins with `#` and has a point's three numbers is a row: the `#` is a part of its name.
fn without_comments(bytes: &[u8]) -> Vec<u8> {
    let rest = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
    let is_number = |cell: &[u8]| str::from_utf8(cell).is_ok_and(|cell| cell.trim().parse::<f64>().is_ok());
    let is_row =
        |line: &[u8]| !line.starts_with(b"#") || line.split(|b| *b == b',').filter(|c| is_number(c)).count() >= 3;
    rest.split_inclusive(|b| *b == b'\n').filter(|line| is_row(line)).collect::<Vec<_>>().concat()
}

/// What is wrong with a row, and what to do about it.
fn in_words(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("it has {len} cells and the rows above it {expected_len}: give every row as many")
        }
        csv::ErrorKind::Utf8 { .. } => "it is no UTF-8 text: save the file as UTF-8".to_owned(),
        _ => error.to_string(),
    }
}

/// Spreadsheets of half the world write semicolons, because their commas are decimal marks.
fn refuse_other_separator(bytes: &[u8], name: &str) -> Result<(), OverlayError> {
    let text = String::from_utf8_lossy(bytes);
    let first =
        text.trim_start_matches('\u{feff}').lines().find(|line| !line.trim().is_empty() && !line.starts_with('#'));
    let Some(first) = first else { return Ok(()) };
    let tells = |cell: &str| {
        let cell = cell.trim().to_lowercase();
        ["x", "y", "z", "x_mm", "y_mm", "z_mm"].contains(&cell.as_str())
            || cell.replace(',', ".").parse::<f64>().is_ok()
    };
    let telling = |mark: char| first.split(mark).filter(|cell| tells(cell)).count();
    let other = [(';', "semicolons"), ('\t', "tabs")].into_iter().find(|(mark, _)| telling(*mark) >= 3);
    match other.filter(|_| telling(',') < 3) {
        None => Ok(()),
        Some((_, marks)) => {
            let problem = format!("its cells are parted by {marks}: part them by commas, with points as decimal marks");
            Err(damaged(name, "the first row", problem))
        }
    }
}

impl Kept for Table {
    /// The table with the points where they are now, and two columns more, `sd_mm` and `state`, where an earlier carrying has not
    /// left them.
    fn encode(&self, carried: &[Carried], _: &[String]) -> Vec<u8> {
        let mut writer = csv::WriterBuilder::new().from_writer(Vec::new());
        let mut write = |row: Vec<String>| writer.write_record(row).expect("writing to memory does not fail");
        let place = |key: &str| self.header.iter().flatten().position(|cell| cell == key);
        let own = [place("sd_mm"), place("state")];
        if let Some(header) = &self.header {
            let more = ["sd_mm", "state"].into_iter().zip(own).filter(|(_, at)| at.is_none());
            write(header.iter().cloned().chain(more.map(|(key, _)| key.to_owned())).collect());
        }
        for (row, point) in self.rows.iter().zip(carried) {
            let mut row = row.clone();
            for (c, x) in self.columns.iter().zip(point.mm) {
                row[*c] = written(x);
            }
            let values = [point.sd_mm.map_or_else(String::new, written), point.state.to_string()];
            for (value, at) in values.into_iter().zip(own) {
                match at {
                    Some(at) => row[at] = value,
                    None => row.push(value),
                }
            }
            write(row);
        }
        writer.into_inner().expect("writing to memory does not fail")
    }
}
