//! The report as one HTML file that opens from disk and asks nothing of any other place.

mod cohort;
mod estimate;
mod methods;
mod parts;
mod results;

pub use methods::{Reference, references};
pub use results::set_name;

use super::chart;
use super::colour::{ColourScale, Rgb, hex};
use super::figure::{Mosaic, RegistrationFigure};
use super::html::{escape, png_address};
use super::viewer::Viewer;
use crate::experiment::outcome::{ExperimentKind, ExperimentOutcome};
use std::fmt::Write;

const STYLE: &str = include_str!("../assets/page.css");
const RATING_SCRIPT: &str = include_str!("../assets/rating.js");

/// A picture with what it shows.
#[derive(Clone, Debug, PartialEq)]
pub struct CaptionedPicture {
    /// PNG bytes.
    pub png: Vec<u8>,
    /// Pixels: width, height.
    pub size: [usize; 2],
    /// A few words under the picture.
    pub caption: String,
    /// One sentence for those who cannot see it.
    pub description: String,
}

/// The error at every node of the best sample.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorMap {
    /// Colours of all its pictures; exactly the range of the data.
    pub scale: ColourScale,
    /// Pictures from several sides.
    pub pictures: Vec<CaptionedPicture>,
    /// Errors of the nodes, mm, per set.
    pub errors_mm: Vec<(String, Vec<f64>)>,
}

/// Everything a page can show. What is absent is left out, and said so in `absent`.
#[derive(Clone, Debug, Default)]
pub struct CasePage {
    /// Heading: `Resection` or a name without any patient's data.
    pub title: String,
    /// Version of the program.
    pub version: String,
    /// Warnings that are not in the outcome.
    pub warnings: Vec<String>,
    /// Parts that could not be shown because their files are not there.
    pub absent: Vec<String>,
    /// What the experiment found.
    pub outcome: Option<ExperimentOutcome>,
    /// Before and after registration.
    pub registration: Option<RegistrationFigure>,
    /// Masks on slices.
    pub mosaics: Vec<Mosaic>,
    /// Pictures of the mesh.
    pub mesh_pictures: Vec<CaptionedPicture>,
    /// What the colours of the mesh pictures mean.
    pub mesh_legend: Vec<(Rgb, String)>,
    /// Per-node error.
    pub error_map: Option<ErrorMap>,
    /// Surfaces for the 3-D view.
    pub viewer: Option<Viewer>,
    /// The resolved settings.
    pub settings_toml: Option<String>,
    /// Where everything came from.
    pub provenance_json: Option<String>,
}

/// The policy that makes a browser refuse every request to another place.
const POLICY: &str = "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; \
    script-src 'unsafe-inline' 'wasm-unsafe-eval' blob:; connect-src data: blob:; worker-src blob:; font-src data:; \
    base-uri 'none'; form-action 'none'";

/// A section of the page: identifier, heading, content.
struct Section {
    id: &'static str,
    heading: &'static str,
    body: String,
}

/// What every page has around its sections.
struct Frame<'a> {
    title: &'a str,
    kicker: &'a str,
    version: &'a str,
}

impl Frame<'_> {
    fn html(&self, notice: &str, sections: &[Section], footnote: &str, scripts: &str) -> String {
        let mut page = String::with_capacity(4 << 20);
        let (title, version) = (escape(self.title), escape(self.version));
        let _ = write!(
            page,
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n<meta name=\"referrer\" content=\"no-referrer\">\n\
             <link rel=\"icon\" href=\"data:,\">\n<title>{title} · hgm</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
             <a class=\"skip\" href=\"#main\">Skip to the report</a>\n\
             <header><div class=\"wrap\"><p class=\"kicker\">hgm {version} · {}</p><h1>{title}</h1>\
             <p class=\"disclaimer\">Research software, not a medical device. \
             Not for diagnosis, not for surgical planning.</p></div></header>\n\
             <nav aria-label=\"Sections\"><div class=\"wrap\">",
            self.kicker
        );
        for section in sections {
            let _ = write!(page, "<a href=\"#{}\">{}</a>", section.id, section.heading);
        }
        page.push_str("</div></nav>\n<main id=\"main\" class=\"wrap\">\n");
        page.push_str(notice);
        for s in sections {
            let _ = write!(
                page,
                "<section id=\"{0}\" aria-labelledby=\"h-{0}\"><h2 id=\"h-{0}\">{1}</h2>\n{2}</section>\n",
                s.id, s.heading, s.body
            );
        }
        let _ = write!(
            page,
            "</main>\n<footer class=\"wrap\"><p>Research software, not a medical device. Made by hgm {version}. \
             {footnote}</p></footer>\n{scripts}</body>\n</html>\n"
        );
        page
    }
}

/// A box above the sections.
fn notice(class: &str, heading: &str, items: &[String]) -> String {
    let items: Vec<String> = items.iter().map(|text| format!("<li>{}</li>", escape(text))).collect();
    let items = items.concat();
    format!(
        "<div class=\"notice {class}\" id=\"warnings\" role=\"note\"><h2><span aria-hidden=\"true\">▲</span> \
         {heading}</h2><ul>{items}</ul></div>\n"
    )
}

impl CasePage {
    /// The whole page.
    pub fn to_html(&self) -> String {
        let frame = Frame { title: &self.title, kicker: "brain deformation report", version: &self.version };
        let mut scripts = format!("<script>\n{RATING_SCRIPT}</script>\n");
        if let Some(viewer) = &self.viewer {
            scripts.push_str(&viewer.scripts());
        }
        let note = "The images are masked to the brain; the page holds no names, dates or places, and makes no request \
                    to any other place.";
        frame.html(&self.warnings_box(), &self.sections(), note, &scripts)
    }

    fn sections(&self) -> Vec<Section> {
        let mut sections = Vec::new();
        let mut add = |id, heading, body: Option<String>| {
            sections.extend(body.map(|body| Section { id, heading, body }));
        };
        let outcome = self.outcome.as_ref();
        add("summary", "Summary", outcome.map(results::summary));
        add("registration", "Registration", self.registration_section());
        add("masks", "Masks", (!self.mosaics.is_empty()).then(|| self.mosaics.iter().map(parts::mosaic).collect()));
        add("mesh", "Mesh", self.mesh_section());
        add("samples", "Samples", outcome.filter(|o| !o.samples.is_empty()).map(results::samples));
        add("estimate", "Estimate", outcome.and_then(|o| o.estimate.as_ref()).map(estimate::section));
        add("error", "Error per node", self.error_map.as_ref().map(error_section));
        add("view", "3-D view", self.viewer.as_ref().map(Viewer::section));
        add("convergence", "Convergence", outcome.and_then(results::convergence));
        add("methods", "Methods", outcome.map(methods::section));
        add("provenance", "Settings and provenance", self.provenance_section());
        add("rating", "Your rating", Some(parts::rating()));
        sections
    }

    fn warnings_box(&self) -> String {
        let raised = self.outcome.iter().flat_map(|o| &o.warnings).chain(&self.warnings);
        let absent = self.absent.iter().map(|what| format!("Not shown: {what}."));
        let items: Vec<String> = raised.cloned().chain(absent).collect();
        match items.len() {
            0 => "<div class=\"notice calm\" id=\"warnings\" role=\"note\"><h2>No warnings</h2><p>Every stage ran \
                  within its checks. Look at the registration and the masks all the same.</p></div>\n"
                .to_owned(),
            1 => notice("warn", "1 warning", &items),
            n => notice("warn", &format!("{n} warnings"), &items),
        }
    }

    fn registration_section(&self) -> Option<String> {
        let table = self.outcome.as_ref().and_then(|o| results::registrations(&o.registrations));
        if self.registration.is_none() && table.is_none() {
            return None;
        }
        Some(self.registration.as_ref().map(parts::registration).unwrap_or_default() + &table.unwrap_or_default())
    }

    fn mesh_section(&self) -> Option<String> {
        let tables = self.outcome.as_ref().and_then(results::mesh);
        if self.mesh_pictures.is_empty() && tables.is_none() {
            return None;
        }
        let mut html = pictures(&self.mesh_pictures);
        if !self.mesh_legend.is_empty() {
            html.push_str("<ul class=\"swatches\" aria-label=\"Colours of the cells\">");
            for (colour, name) in &self.mesh_legend {
                let _ = write!(
                    html,
                    "<li><svg viewBox=\"0 0 10 10\" aria-hidden=\"true\"><path fill=\"{}\" d=\"M0 0h10v10H0z\"/></svg>{}</li>",
                    hex(*colour),
                    escape(name)
                );
            }
            html.push_str("</ul>\n");
        }
        Some(html + &tables.unwrap_or_default())
    }

    fn provenance_section(&self) -> Option<String> {
        let block = |name: &str, text: &Option<String>| {
            let text = text.as_ref()?;
            let text = escape(text);
            Some(format!(
                "<details><summary>{name}</summary><pre tabindex=\"0\" aria-label=\"{name}\">{text}</pre></details>\n"
            ))
        };
        let blocks = [block("Settings", &self.settings_toml), block("Provenance", &self.provenance_json)];
        let body: String = blocks.into_iter().flatten().collect();
        (!body.is_empty()).then_some(body)
    }
}

/// Heading of a page by what was run.
pub fn title_of(kind: Option<ExperimentKind>) -> &'static str {
    match kind {
        Some(ExperimentKind::Phantom) => "Phantom: a known deformation, found again",
        Some(ExperimentKind::Resection) => "Brain deformation after resection",
        None => "Prepared case",
    }
}

/// A row of captioned pictures.
fn pictures(pictures: &[CaptionedPicture]) -> String {
    if pictures.is_empty() {
        return String::new();
    }
    let mut html = String::from("<div class=\"pictures\">");
    for p in pictures {
        let _ = write!(
            html,
            "<figure><img src=\"{}\" width=\"{}\" height=\"{}\" alt=\"{}\"><figcaption>{}</figcaption></figure>",
            png_address(&p.png),
            p.size[0],
            p.size[1],
            escape(&p.description),
            escape(&p.caption)
        );
    }
    html + "</div>\n"
}

fn error_section(map: &ErrorMap) -> String {
    let mut html = String::from(
        "<p>Distance at every node between the best sample and the reference. Grey: no reference there.</p>\n",
    );
    html += &pictures(&map.pictures);
    let _ = write!(html, "<div class=\"bar-row\">{}</div>\n<div class=\"charts\">", chart::colour_bar(&map.scale));
    for (set, errors) in &map.errors_mm {
        let label = format!("error, {} (mm)", set_name(set));
        let chart = chart::histogram(errors, &label, "nodes", Some(&map.scale));
        let _ = write!(html, "<figure>{chart}<figcaption>{}</figcaption></figure>", escape(&results::spread(errors)));
    }
    html + "</div>\n"
}

#[cfg(test)]
mod tests;
