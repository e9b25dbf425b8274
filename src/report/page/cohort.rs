//! The page of a cohort.

use super::super::cohort::{Cohort, Row, Status};
use super::super::html::{escape, fixed, number};
use super::results::table;
use super::{Frame, Section, notice};
use std::collections::BTreeMap;

impl Cohort {
    /// One HTML file beside the subjects' pages, to which it links.
    pub fn to_html(&self) -> String {
        let frame = Frame {
            title: "Brain deformation after resection: all subjects",
            kicker: "cohort",
            version: env!("CARGO_PKG_VERSION"),
        };
        let sections = [Section { id: "subjects", heading: "Subjects", body: self.subjects_section() }];
        let first = self.notices();
        let above = if first.is_empty() { String::new() } else { notice("warn", "Look here first", &first) };
        frame.html(&above, &sections, "The page makes no request to any other place.", "")
    }

    /// Who did not end well, and who lies apart in what.
    fn notices(&self) -> Vec<String> {
        let unwell = |row: &Row| {
            let message = row.message.as_deref().unwrap_or("run the participant level");
            (row.status != Status::Done).then(|| format!("{}: {}: {message}", row.participant_id, row.status.name()))
        };
        let apart = |row: &Row| {
            let columns: Vec<String> = row.outlying.iter().map(|name| words(name)).collect();
            (!columns.is_empty()).then(|| format!("{} lies apart in {}", row.participant_id, columns.join(", ")))
        };
        let all = self.subjects.iter();
        all.clone().filter_map(unwell).chain(all.filter_map(apart)).chain(self.warnings.iter().cloned()).collect()
    }

    fn subjects_section(&self) -> String {
        let mut head = vec!["subject".to_owned()];
        head.extend(self.columns.iter().map(|name| escape(&words(name))));
        head.extend(["at the margin", "warnings"].map(str::to_owned));
        let numbers = |from: &BTreeMap<String, f64>| -> Vec<String> {
            let shown = |name: &String, v: f64| if name.ends_with("_sd_level") { fixed(v, 2) } else { number(v, 4) };
            self.columns.iter().map(|name| from.get(name).map_or("–".to_owned(), |v| shown(name, *v))).collect()
        };
        let line = |row: &Row| {
            let name = escape(&row.participant_id);
            let linked = format!("<a href=\"{name}.html\">{name}</a>");
            let mut cells = vec![if row.best_sample.is_some() { linked } else { name }];
            for (column, value) in self.columns.iter().zip(numbers(&row.figures)) {
                let apart = row.outlying.contains(column);
                cells.push(if apart { format!("<strong>{value} ▲</strong>") } else { value });
            }
            let end = if row.status == Status::Done { row.verdict.unwrap_or("–") } else { row.status.name() };
            cells.extend([end.to_owned(), row.warnings.to_string()]);
            (false, cells)
        };
        let mut rows: Vec<(bool, Vec<String>)> = self.subjects.iter().map(line).collect();
        for (name, values) in [("median", &self.median), ("MAD", &self.mad)] {
            rows.push((true, [vec![name.to_owned()], numbers(values), vec!["–".to_owned(); 2]].concat()));
        }
        let done = self.subjects.iter().filter(|row| row.best_sample.is_some()).count();
        format!(
            "<p>{done} of {} subjects have figures. Subjects that did not end well come first, then those farthest from \
             the median; ▲ marks a figure more than 3.5 robust standard deviations from it (1.483 times the median \
             absolute deviation, MAD). Moduli are those of the best sample.</p>\n{}",
            self.subjects.len(),
            table("Best sample and errors per subject", &head, &rows)
        )
    }
}

/// `rest_rmse_margin_mm` as `rest rmse margin (mm)`.
fn words(column: &str) -> String {
    let units = [("_mm", "mm"), ("_cc", "cc"), ("_pa", "Pa")];
    let unit = units.into_iter().find_map(|(end, unit)| column.strip_suffix(end).map(|name| (name, unit)));
    unit.map_or_else(|| column.replace('_', " "), |(name, unit)| format!("{} ({unit})", name.replace('_', " ")))
}
