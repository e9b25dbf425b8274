//! The page of a cohort.

use super::super::change_chart::{Change, ChangeChart, ChangePanel, Middle};
use super::super::cohort::{Cohort, Row, Status};
use super::super::html::{fixed, number};
use super::super::median_samples::as_outcome;
use super::results::{Row as Line, figures, set_name, table, words as cells};
use super::{Frame, Section, notice};
use maud::{Markup, PreEscaped, html};
use std::collections::BTreeMap;

impl Cohort {
    /// One HTML file beside the subjects' pages, to which it links.
    pub fn to_html(&self) -> String {
        let frame = Frame {
            title: "Brain deformation after resection: all subjects",
            kicker: "cohort",
            version: env!("CARGO_PKG_VERSION"),
        };
        let bodies = [
            ("errors", "What deformation explains", self.errors_section()),
            ("samples", "Samples over the subjects", self.samples_section()),
            ("subjects", "Subjects", Some(self.subjects_section())),
        ];
        let sections: Vec<Section> =
            bodies.into_iter().filter_map(|(id, heading, body)| Some(Section { id, heading, body: body? })).collect();
        let first = self.notices();
        let above = html! { @if !first.is_empty() { (notice("warn", "Look here first", &first)) } };
        frame.html(&above, &sections, "The page makes no request to any other place.", &html! {})
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

    /// RMSE undeformed and of the best sample, subject by subject and in the median.
    fn errors_section(&self) -> Option<Markup> {
        let panel = |set: &str| {
            let columns = [format!("rest_rmse_{set}_mm"), format!("rmse_{set}_mm")];
            let middle =
                |column: &String| Some(Middle { median: *self.median.get(column)?, mad: *self.mad.get(column)? });
            let change = |row: &Row| {
                let [before, after] = columns.each_ref().map(|column| row.figures.get(column).copied());
                Some(Change { name: row.participant_id.clone(), before: before?, after: after? })
            };
            let changes: Vec<Change> = self.subjects.iter().filter_map(change).collect();
            let middle = [middle(&columns[0])?, middle(&columns[1])?];
            (!changes.is_empty()).then(|| ChangePanel { name: set_name(set), changes, middle })
        };
        let panels: Vec<ChangePanel> = ["margin", "ventricle"].into_iter().filter_map(panel).collect();
        let said: Vec<String> = panels
            .iter()
            .map(|panel| {
                let [rest, deformed] = panel.middle.map(|m| format!("{} ± {}", number(m.median, 3), number(m.mad, 2)));
                let better = panel.changes.iter().filter(|c| c.after < c.before).count();
                let all = panel.changes.len();
                format!("{}: {rest} mm undeformed, {deformed} mm deformed, smaller in {better} of {all}", panel.name)
            })
            .collect();
        let chart = ChangeChart {
            description: format!("RMSE of every subject undeformed and of its best sample. {}", said.join("; ")),
            y_label: "RMSE (mm)".to_owned(),
            states: ["undeformed", "best sample"].map(str::to_owned),
            panels,
            floor: self.median.get("noise_floor_mm").copied(),
        };
        (!chart.panels.is_empty()).then(|| {
            html! {
                p { "Median ± MAD. " (said.join("; ")) "." } "\n"
                div class="charts" {
                    figure {
                        (PreEscaped(chart.to_svg()))
                        figcaption {
                            "One line per subject; beside them the median and its MAD. Differences below the noise floor \
                             (median over the subjects) mean nothing."
                        }
                    }
                }
            }
        })
    }

    /// RMSE over the samples that all subjects share, in the median.
    fn samples_section(&self) -> Option<Markup> {
        let first = self.median_samples.first()?;
        let tissues: Vec<String> = first.shear_modulus_pa.keys().cloned().collect();
        let figures = figures(&as_outcome(&self.median_samples, &tissues));
        Some(html! {
            p {
                "The median over the subjects of the RMSE of every sample: the valley that all of them share, if there is one."
            } "\n"
            div class="charts" { (figures) }
        })
    }

    fn subjects_section(&self) -> Markup {
        let mut head = vec!["subject".to_owned()];
        head.extend(self.columns.iter().map(|name| words(name)));
        head.extend(["at the margin", "warnings"].map(str::to_owned));
        let numbers = |from: &BTreeMap<String, f64>| -> Vec<String> {
            let shown = |name: &String, v: f64| if name.ends_with("_sd_level") { fixed(v, 2) } else { number(v, 4) };
            self.columns.iter().map(|name| from.get(name).map_or("–".to_owned(), |v| shown(name, *v))).collect()
        };
        let line = |row: &Row| -> Line {
            let name = &row.participant_id;
            let linked = html! { a href={ (name) ".html" } { (name) } };
            let answered = matches!(row.status, Status::NoOperation | Status::NotOnePerson);
            let mut line = vec![if row.best_sample.is_some() || answered {
                linked
            } else {
                html! { (name) }
            }];
            for (column, value) in self.columns.iter().zip(numbers(&row.figures)) {
                let apart = row.outlying.contains(column);
                line.push(html! { @if apart { strong { (value) " ▲" } } @else { (value) } });
            }
            let end = if row.status == Status::Done { row.verdict.unwrap_or("–") } else { row.status.name() };
            line.extend(cells([end.replace(' ', "\u{a0}"), row.warnings.to_string()]));
            (false, line)
        };
        let mut rows: Vec<Line> = self.subjects.iter().map(line).collect();
        for (name, values) in [("median", &self.median), ("MAD", &self.mad)] {
            rows.push((true, cells([vec![name.to_owned()], numbers(values), vec!["–".to_owned(); 2]].concat())));
        }
        let done = self.subjects.iter().filter(|row| row.best_sample.is_some()).count();
        html! {
            p {
                (done) " of " (self.subjects.len()) " subjects have figures. Subjects that did not end well come first, then \
                 those farthest from the median; ▲ marks a figure more than 3.5 robust standard deviations from it (1.483 times \
                 the median absolute deviation, MAD). Moduli are those of the best sample."
            } "\n"
            (table("Best sample and errors per subject", &head, &rows))
        }
    }
}

/// `rest_rmse_margin_mm` as `rest rmse margin (mm)`.
fn words(column: &str) -> String {
    let units = [("_mm", "mm"), ("_cc", "cc"), ("_pa", "Pa")];
    let unit = units.into_iter().find_map(|(end, unit)| column.strip_suffix(end).map(|name| (name, unit)));
    unit.map_or_else(|| column.replace('_', " "), |(name, unit)| format!("{} ({unit})", name.replace('_', " ")))
}
