//! The page of a cohort.

use super::super::change_chart::{Change, ChangeChart, ChangePanel, Middle};
use super::super::cohort::{Cohort, Pupil, Row, Status};
use super::super::html::{fixed, number};
use super::super::median_samples::as_outcome;
use super::super::strip_chart::{StripChart, StripPoint};
use super::results::{figures, set_name};
use super::scans::RiskCells;
use super::{Frame, Section, notice, tasks};
use maud::{Markup, PreEscaped, html};
use std::collections::BTreeMap;

/// Sorting and filtering; without it the tables are as the program ordered them.
const SCRIPT: &str = include_str!("../assets/cohort.js");

impl Cohort {
    /// One HTML file beside the subjects' pages, to which it links.
    pub fn to_html(&self) -> String {
        let frame = Frame {
            title: "Brain deformation after resection: all subjects",
            kicker: "cohort",
            version: env!("CARGO_PKG_VERSION"),
        };
        let bodies = [
            ("subjects", "Subjects", Some(self.subjects_section())),
            ("look-first", "Scans to look at first", self.look_first_section()),
            ("errors", "What deformation explains", self.errors_section()),
            ("samples", "Samples over the subjects", self.samples_section()),
            ("tasks", "Tasks of the generative model", tasks::of_cohort(&self.tasks)),
            ("distributions", "Distribution of every figure", self.distributions_section()),
            ("figures", "Figures", Some(self.figures_section())),
            ("population", "What the cohort says of people", self.population_section()),
        ];
        let sections: Vec<Section> =
            bodies.into_iter().filter_map(|(id, heading, body)| Some(Section { id, heading, body: body? })).collect();
        let first = self.notices();
        let scripts = html! { script { "\n" (PreEscaped(SCRIPT)) } "\n" };
        let above = html! { @if !first.is_empty() { (notice("warn", "Look here first", &first)) } };
        frame.html(&above, &sections, "The page makes no request to any other place.", &scripts)
    }

    /// The population with every patient who teaches: what the others say of people draws a figure towards them.
    fn population_section(&self) -> Option<Markup> {
        let population = self.population.as_ref()?;
        let row = |pupil: &Pupil| {
            let of_subject = self.subjects.iter().find(|row| row.participant_id == pupil.participant_id);
            html! {
                @for own in &pupil.shrunken {
                    tr data-subject=(pupil.participant_id) data-verdict=[of_subject.map(said)] data-apart=[of_subject.map(apart)] {
                        th scope="row" { (pupil.participant_id) }
                        td { (own.name) }
                        td data-value=(own.value) { (number(own.value, 3)) " (" (number(own.interval_95[0], 3)) " to " (number(own.interval_95[1], 3)) ")" }
                    }
                }
            }
        };
        Some(html! {
            @for sentence in population.sentences() { p { (sentence) "." } }
            @if !population.subjects.is_empty() {
                (sortable(
                    "Each patient with what the others say (95 % interval)",
                    &["subject", "parameter", "value"].map(str::to_owned),
                    &html! { @for pupil in &population.subjects { (row(pupil)) } },
                    &html! {},
                ))
            }
        })
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
        let odd = self.warnings.iter().map(ToString::to_string);
        all.clone().filter_map(unwell).chain(all.filter_map(apart)).chain(odd).collect()
    }

    /// RMSE undeformed and deformed, subject by subject and in the median.
    fn errors_section(&self) -> Option<Markup> {
        let panel = |set: &str| {
            let columns = [format!("rest_rmse_{set}_mm"), format!("rmse_{set}_mm")];
            let middle =
                |column: &String| Some(Middle { median: *self.median.get(column)?, mad: *self.mad.get(column)? });
            let change = |row: &Row| {
                let [before, after] = columns.each_ref().map(|column| row.figures.get(column).copied());
                Some(Change { name: row.participant_id.clone(), before: before?, after: after? })
            };
            // The same subjects as in the medians beside them.
            let done = self.subjects.iter().filter(|row| row.status == Status::Done);
            let changes: Vec<Change> = done.filter_map(change).collect();
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
            description: format!("RMSE of every subject that is done, undeformed and deformed. {}", said.join("; ")),
            y_label: "RMSE (mm)".to_owned(),
            states: ["undeformed", "deformed"].map(str::to_owned),
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
                            "One line per subject that is done; beside them the median and its MAD. Differences below the noise floor \
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

    /// How every subject ended and what it comes down to, with the controls that hold for the figures, too.
    fn subjects_section(&self) -> Markup {
        let mut verdicts: Vec<&str> = self.subjects.iter().map(said).collect();
        verdicts.sort_unstable();
        verdicts.dedup();
        let head = ["subject", "ended", "verdict", "in a sentence", "warnings"].map(str::to_owned);
        html! {
            div class="controls" id="filters" hidden {
                label for="filter-text" { "Subject or words" } input id="filter-text" type="search";
                label for="filter-verdict" { "Verdict" }
                select id="filter-verdict" {
                    option value="" { "all" }
                    @for verdict in &verdicts { option value=(verdict) { (verdict) } }
                }
                span {
                    input id="filter-apart" type="checkbox";
                    label for="filter-apart" { "Only those that lie apart or did not end well" }
                }
                output id="filter-said" for="filter-text filter-verdict filter-apart" {}
            } "\n"
            (sortable("Verdict of every subject", &head, &html! {
                @for row in &self.subjects {
                    tr data-subject=(row.participant_id) data-verdict=(said(row)) data-apart=(apart(row)) {
                        th scope="row" { (linked(row)) }
                        td class="words" { (row.status.name()) }
                        td class="words" { (said(row)) }
                        td class="words" { (row.sentence.as_deref().or(row.message.as_deref()).unwrap_or("–")) }
                        td data-value=(row.warnings) { (row.warnings) }
                    }
                }
            }, &html! {}))
        }
    }

    /// The subjects by risk, and what their scans were measured at.
    fn look_first_section(&self) -> Option<Markup> {
        let found = &self.look_first;
        let row = |id: &str| self.subjects.iter().find(|row| row.participant_id == id);
        let lines = || found.subjects.iter().filter_map(|subject| Some((subject, row(&subject.participant_id)?)));
        let head = ["subject", "place", "ended", "why", "warnings"].map(str::to_owned);
        let body = html! {
            @for (place, (subject, row)) in lines().enumerate() {
                tr data-subject=(row.participant_id) data-verdict=(said(row)) data-apart=(apart(row)) {
                    th scope="row" { (linked(row)) }
                    td data-value=(place + 1) { (place + 1) }
                    td class="words" { (row.status.name()) }
                    td class="words" { (subject.because()) }
                    td data-value=(row.warnings) { (row.warnings) }
                }
            }
        };
        let cells = RiskCells { found };
        let measures = html! {
            @for (subject, row) in lines() {
                tr data-subject=(row.participant_id) data-verdict=(said(row)) data-apart=(apart(row)) {
                    th scope="row" { (linked(row)) }
                    (cells.values(subject))
                }
            }
        };
        let heads: Vec<String> = std::iter::once("subject".to_owned()).chain(cells.heads()).collect();
        (!found.subjects.is_empty()).then(|| {
            html! {
                p { (found.rule) } "\n"
                (sortable("Scans to look at first", &head, &body, &html! {}))
                @if found.measures.is_empty() {
                    p { "No scan was measured: the cases are of before hgm did that. Run the participant level again." } "\n"
                } @else {
                    (sortable("Measures of every scan", &heads, &measures, &cells.foot()))
                }
            }
        })
    }

    /// A strip for every figure in which subjects differ.
    fn distributions_section(&self) -> Option<Markup> {
        let strip = |column: &String| {
            let point = |row: &Row| {
                Some(StripPoint {
                    name: row.participant_id.clone(),
                    value: *row.figures.get(column)?,
                    apart: row.outlying.contains(column),
                    counted: row.status == Status::Done,
                    page: row.has_page.then(|| page_of(row)),
                })
            };
            StripChart { name: words(column), points: self.subjects.iter().filter_map(point).collect() }.to_svg()
        };
        let strips: Vec<String> = self.columns.iter().filter_map(strip).collect();
        (!strips.is_empty()).then(|| {
            html! {
                p {
                    "A point for each subject; the box holds the middle half of those that are done, its line is the \
                     median (from five on); a hollow point is not done and counts for neither, a triangle lies apart. Point at one to find its subject in every figure, press it for the subject's \
                     page; the filters above hold here, too."
                } "\n"
                div class="strips" { @for svg in &strips { (PreEscaped(svg)) "\n" } }
            }
        })
    }

    /// All numbers of all subjects.
    fn figures_section(&self) -> Markup {
        let mut head = vec!["subject".to_owned()];
        head.extend(self.columns.iter().map(|name| words(name)));
        let shown = |name: &String, v: f64| if name.ends_with("_sd_level") { fixed(v, 2) } else { number(v, 4) };
        let cell = |from: &BTreeMap<String, f64>, name: &String| {
            from.get(name).map_or_else(|| "–".to_owned(), |v| shown(name, *v))
        };
        let done = self.subjects.iter().filter(|row| !row.figures.is_empty()).count();
        let body = html! {
            @for row in &self.subjects {
                tr data-subject=(row.participant_id) data-verdict=(said(row)) data-apart=(apart(row)) {
                    th scope="row" { (linked(row)) }
                    @for name in &self.columns {
                        td data-value=[row.figures.get(name)] {
                            @if row.outlying.contains(name) { strong { (cell(&row.figures, name)) " ▲" } }
                            @else { (cell(&row.figures, name)) }
                        }
                    }
                }
            }
        };
        let foot = html! {
            @for (name, values) in [("median", &self.median), ("MAD", &self.mad)] {
                tr class="best" {
                    th scope="row" { (name) }
                    @for column in &self.columns { td { (cell(values, column)) } }
                }
            }
        };
        html! {
            p {
                (done) " of " (self.subjects.len()) " subjects have figures. Subjects that did not end well come first, then \
                 those farthest from the median; ▲ marks a figure more than 3.5 robust standard deviations from it (1.483 times \
                 the median absolute deviation, MAD). A modulus stands only where the verdict claims one."
            } "\n"
            (sortable("Figures of every subject", &head, &body, &foot))
        }
    }
}

/// What a subject's row says it comes down to.
fn said(row: &Row) -> &str {
    row.verdict.unwrap_or_else(|| row.status.name())
}

fn apart(row: &Row) -> &'static str {
    if row.status != Status::Done || !row.outlying.is_empty() { "yes" } else { "no" }
}

/// The subject's name, and the way to its page where it has one.
fn linked(row: &Row) -> Markup {
    let name = &row.participant_id;
    html! { @if row.has_page { a href=(page_of(row)) { (name) } } @else { (name) } }
}

fn page_of(row: &Row) -> String {
    format!("{}.html", row.participant_id)
}

/// A table whose rows the page's script can sort and hide.
fn sortable(caption: &str, head: &[String], body: &Markup, foot: &Markup) -> Markup {
    html! {
        div class="scroll" tabindex="0" role="region" aria-label=(caption) {
            table class="sortable" {
                caption { (caption) }
                thead { tr { @for cell in head { th scope="col" { (cell) } } } }
                tbody { (body) }
                @if !foot.0.is_empty() { tfoot { (foot) } }
            }
        } "\n"
    }
}

/// `rest_rmse_margin_mm` as `rest rmse margin (mm)`.
fn words(column: &str) -> String {
    let units = [("_mm", "mm"), ("_cc", "cc"), ("_pa", "Pa")];
    let unit = units.into_iter().find_map(|(end, unit)| column.strip_suffix(end).map(|name| (name, unit)));
    unit.map_or_else(|| column.replace('_', " "), |(name, unit)| format!("{} ({unit})", name.replace('_', " ")))
}
