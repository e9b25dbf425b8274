//! 3D Slicer's fiducials before version 5 (`.fcsv`): a comma-separated table under comment lines that name its axes.

use super::drawing::{Carried, Drawing, Kept, OverlayError, damaged, turned, written};

/// The lines as they were.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    lines: Vec<String>,
    lps: bool,
}

fn is_point(line: &str) -> bool {
    !line.starts_with('#') && !line.trim().is_empty()
}

/// What a line of comment says of `key`, however it is spaced and capitalised.
fn said_above<'a>(lines: &'a [String], key: &str) -> Option<&'a str> {
    let comments = lines.iter().filter_map(|line| line.strip_prefix('#')?.split_once('='));
    comments.into_iter().find(|(said, _)| said.trim().eq_ignore_ascii_case(key)).map(|(_, value)| value.trim())
}

/// The cells of a line; a label with a comma stands in quotes.
fn cells_of(line: &str) -> Vec<String> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(line.as_bytes());
    let first = reader.records().next().and_then(Result::ok);
    first.map_or_else(|| vec![line.to_owned()], |record| record.iter().map(str::to_owned).collect())
}

fn quoted(cell: &str) -> String {
    if cell.contains([',', '"']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.to_owned() }
}

pub(super) fn decode(bytes: &[u8], name: &str) -> Result<Drawing, OverlayError> {
    let text = std::str::from_utf8(bytes).map_err(|_| damaged(name, "the file", "not UTF-8 text"))?;
    let lines: Vec<String> = text.lines().map(str::to_owned).collect();
    if let Some(columns) = said_above(&lines, "columns") {
        let mut first = columns.split(',').map(str::trim);
        if !first.next().is_some_and(|c| c == "id" || c == "label") || !first.by_ref().take(3).eq(["x", "y", "z"]) {
            return Err(damaged(
                name,
                "columns",
                format!("`{columns}` does not begin with id,x,y,z; save it again from 3D Slicer"),
            ));
        }
    }
    let system = said_above(&lines, "CoordinateSystem").unwrap_or("RAS");
    let lps = match system {
        "RAS" | "0" => false,
        "LPS" | "1" => true,
        other => return Err(damaged(name, "CoordinateSystem", format!("`{other}` is neither RAS nor LPS"))),
    };
    let (mut points_mm, mut names) = (Vec::new(), Vec::new());
    for (n, line) in lines.iter().enumerate().filter(|(_, line)| is_point(line)) {
        let cells = cells_of(line);
        let number = |c: usize| -> Result<f64, OverlayError> {
            let cell = cells.get(c).map_or("", String::as_str);
            let wrong = |_| damaged(name, format!("line {}", n + 1), format!("`{cell}` is not a number"));
            cell.trim().parse().map_err(wrong)
        };
        points_mm.push(turned([number(1)?, number(2)?, number(3)?], lps));
        let label = cells.get(11).filter(|label| !label.is_empty());
        names.push(label.unwrap_or(&cells[0]).clone());
    }
    Ok(Drawing { points_mm, names, pairs_mm: Vec::new(), kept: Box::new(Lines { lines, lps }) })
}

impl Kept for Lines {
    /// The same lines; the column of descriptions says how sure a point is.
    fn encode(&self, carried: &[Carried], _: &[String]) -> Vec<u8> {
        let mut points = carried.iter();
        let mut text = String::new();
        for line in &self.lines {
            let point = if is_point(line) { points.next() } else { None };
            let Some(point) = point else {
                text += line;
                text.push('\n');
                continue;
            };
            let mut cells = cells_of(line);
            for (cell, x) in cells[1..4].iter_mut().zip(turned(point.mm, self.lps)) {
                *cell = written(x);
            }
            if let Some(description) = cells.get_mut(12) {
                *description = said(point);
            }
            // The node of a scene, which is not this file's.
            if let Some(node) = cells.get_mut(13) {
                node.clear();
            }
            text += &cells.iter().map(|cell| quoted(cell)).collect::<Vec<_>>().join(",");
            text.push('\n');
        }
        text.into_bytes()
    }
}

/// A point's state and spread in words without a comma.
pub(super) fn said(point: &Carried) -> String {
    let sd = point.sd_mm.map_or_else(String::new, |sd| format!(" sd {} mm", written(sd)));
    format!("{}{sd}", point.state)
}
