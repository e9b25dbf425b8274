//! How good the scans are, as HTML: of a case, and of a cohort by risk.

use super::super::look_first::{LookFirst, SubjectRisk, scan_measures};
use super::super::scan_measure::{SCAN_MEASURES, ScanMeasure, WhichScan};
use super::results::{Row, table, words};
use crate::segment::{Region, ScanQualities};
use maud::{Markup, html};

/// A line for each measure; nothing where no scan was measured.
pub fn of_case(scans: &ScanQualities) -> Option<Markup> {
    let shown: Vec<WhichScan> = WhichScan::ALL.into_iter().filter(|which| which.of(Some(scans)).is_some()).collect();
    if shown.is_empty() {
        return None;
    }
    let head = ["measure"].into_iter().chain(shown.iter().map(|which| which.in_words())).chain(["how to read it"]);
    let row = |measure: &ScanMeasure| -> Row {
        let values = shown.iter().map(|which| measure.in_words(which.of(Some(scans))));
        let cells = std::iter::once(measure.name.to_owned()).chain(values).chain([measure.hint.to_owned()]);
        (false, words(cells))
    };
    let head: Vec<String> = head.map(str::to_owned).collect();
    let rows: Vec<Row> = SCAN_MEASURES.iter().map(row).collect();
    Some(html! {
        (table("Quality of the scans", &head, &rows))
        (by_regions(scans, &shown))
        p {
            "Measured on the scans as they are, with the labels that were found. None of these numbers is a verdict: they are for \
             comparing scans of one protocol, and hgm warns by itself of what it cannot work with."
        } "\n"
    })
}

/// A line for each part of the brain that is cut or less sure than the others would be; nothing where none was told apart.
fn by_regions(scans: &ScanQualities, shown: &[WhichScan]) -> Markup {
    let of = |which: WhichScan| which.of(Some(scans)).map_or(&[][..], |scan| &scan.regions[..]);
    let sure = |which: WhichScan| of(which).iter().any(|part| part.confidence_percent.is_some());
    if shown.iter().all(|which| of(*which).is_empty()) {
        return html! {};
    }
    let columns: Vec<(WhichScan, bool)> = shown
        .iter()
        .flat_map(|&which| [(which, false)].into_iter().chain(sure(which).then_some((which, true))))
        .collect();
    let name = |&(which, labels): &(WhichScan, bool)| {
        let what = if labels { "labels expected to be right" } else { "outside the scan" };
        format!("{what}, {}", which.in_words())
    };
    let head: Vec<String> = std::iter::once("part of the brain".to_owned()).chain(columns.iter().map(name)).collect();
    let row = |region: Region| -> Row {
        let cell = |&(which, labels): &(WhichScan, bool)| {
            let part = of(which).iter().find(|part| part.region == region);
            let value = part.and_then(|p| if labels { p.confidence_percent } else { Some(p.outside_percent) });
            value.map_or_else(|| "–".to_owned(), |value| format!("{value:.0} %"))
        };
        (false, words(std::iter::once(region.name().to_owned()).chain(columns.iter().map(cell))))
    };
    let rows: Vec<Row> = Region::ALL.into_iter().map(row).collect();
    html! { div class="regions" { (table("Parts of the brain", &head, &rows)) } }
}

/// The order with its reasons: cells of a row, after the subject's own.
pub struct RiskCells<'a> {
    /// What was measured over the cohort.
    pub found: &'a LookFirst,
}

impl RiskCells<'_> {
    /// Heads of the columns of measures.
    pub fn heads(&self) -> Vec<String> {
        self.measured().map(|(scan, measure)| head(scan, measure)).collect()
    }

    /// A subject's measures.
    pub fn values(&self, subject: &SubjectRisk) -> Markup {
        html! {
            @for (scan, measure) in self.measured() {
                @let column = measure.column_of(scan);
                @let worst = subject.worst.as_ref().is_some_and(|worst| worst.column == column);
                @let text = subject.figures.get(&column).map_or_else(|| "–".to_owned(), |v| number(measure, *v));
                td data-value=[subject.figures.get(&column)] { @if worst { strong { (text) } } @else { (text) } }
            }
        }
    }

    /// Median and deviation of every measure.
    pub fn foot(&self) -> Markup {
        html! {
            @for name in ["median", "deviation"] {
                tr class="best" {
                    th scope="row" { (name) }
                    @for ((_, measure), of) in self.measured().zip(&self.found.measures) {
                        td { (number(measure, if name == "median" { of.median } else { of.deviation })) }
                    }
                }
            }
        }
    }

    fn measured(&self) -> impl Iterator<Item = (WhichScan, &'static ScanMeasure)> {
        let has = |column: &String| self.found.measures.iter().any(|of| of.column == *column);
        scan_measures().filter(move |(scan, measure)| has(&measure.column_of(*scan)))
    }
}

fn head(scan: WhichScan, measure: &ScanMeasure) -> String {
    let unit = if measure.unit.is_empty() { String::new() } else { format!(" ({})", measure.unit) };
    format!("{}{unit}, {}", measure.name, scan.in_words())
}

fn number(measure: &ScanMeasure, value: f64) -> String {
    super::super::html::fixed(value, measure.decimals)
}
