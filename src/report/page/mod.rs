//! The report as one HTML file that opens from disk and asks nothing of any other place.

mod brain_shift;
mod cohort;
mod estimate;
mod evaluation;
mod files;
mod glance;
mod methods;
mod parts;
pub mod plans;
mod posterior;
mod prediction;
mod results;
mod scans;
mod tasks;

pub use evaluation::in_a_sentence as evaluation_in_a_sentence;
pub use methods::{Reference, references};
#[cfg(test)]
pub(in crate::report) use posterior::tests::estimate as estimate_of_two;
pub use prediction::in_a_sentence as expected_in_a_sentence;
pub use results::set_name;

use super::chart;
use super::colour::{ColourScale, Rgb, hex};
use super::figure::{Mosaic, RegistrationFigure};
use super::glance_figure::GlanceFigure;
use super::html::{count, png_address, without_control_characters};
use super::listing::Listed;
use super::viewer::Viewer;
use crate::experiment::field::{BrainShift, StateShift};
use crate::experiment::landmarks::Evaluation;
use crate::experiment::outcome::{ExperimentKind, ExperimentOutcome};
use crate::experiment::predict::{Prediction, PredictionEvaluation};
use maud::{DOCTYPE, Markup, PreEscaped, html};

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
    /// What of the patient lies on the left and on the right side: `R`, `L`; absent where the picture itself says so.
    pub sides: Option<[&'static str; 2]>,
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
    /// Nodes on two of the sets: their error is the smaller of the two.
    pub on_two_sets: usize,
}

/// The brain shift on a slice: seen, modelled, what is between them.
#[derive(Clone, Debug, PartialEq)]
pub struct ShiftFigure {
    /// The colours of all its pictures, mm.
    pub scale: ColourScale,
    /// The pictures.
    pub pictures: Vec<CaptionedPicture>,
}

/// A prediction on a slice: the expected shift, and how sure it is.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictionFigure {
    /// Expected shift and its reach, with the colours of both.
    pub shift: ShiftFigure,
    /// Its standard deviation.
    pub spread: ShiftFigure,
}

/// Everything a page can show. What is absent is left out, and said so in `absent`.
#[derive(Clone, Debug, Default)]
pub struct CasePage {
    /// Whose page it is: `sub-01`, or the name of the case folder.
    pub subject: String,
    /// Heading: `Resection` or a name without any patient's data.
    pub title: String,
    /// Version of the program.
    pub version: String,
    /// Warnings that are not in the outcome.
    pub warnings: Vec<String>,
    /// Parts that could not be shown because their files are not there, or are not of this version.
    pub absent: Vec<String>,
    /// What the experiment found.
    pub outcome: Option<ExperimentOutcome>,
    /// How the brain is expected to move.
    pub prediction: Option<Prediction>,
    /// The same against what was seen afterwards.
    pub evaluation: Option<PredictionEvaluation>,
    /// The same on slices.
    pub prediction_figure: Option<PredictionFigure>,
    /// The brain shift in numbers.
    pub brain_shift: Option<BrainShift>,
    /// Slices for the first screen.
    pub glance: Option<GlanceFigure>,
    /// The brain shift on a slice.
    pub shift_figure: Option<ShiftFigure>,
    /// What an estimate leaves of what it was held against.
    pub residual_figure: Option<ShiftFigure>,
    /// Landmarks against it.
    pub landmarks: Option<Evaluation>,
    /// Before and after registration.
    pub registration: Option<RegistrationFigure>,
    /// Both scans when a step gave up.
    pub refused: Option<CaptionedPicture>,
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
    /// The files of the case, to link to.
    pub files: Vec<Listed>,
}

/// The policy that makes a browser refuse every request to another place.
const POLICY: &str = "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; \
    script-src 'unsafe-inline' 'wasm-unsafe-eval' blob:; connect-src data: blob:; worker-src blob:; font-src data:; \
    base-uri 'none'; form-action 'none'";

/// A section of the page: identifier, heading, content.
struct Section {
    id: &'static str,
    heading: &'static str,
    body: Markup,
}

/// What every page has around its sections.
struct Frame<'a> {
    title: &'a str,
    kicker: &'a str,
    version: &'a str,
}

impl Frame<'_> {
    fn html(&self, notice: &Markup, sections: &[Section], footnote: &str, scripts: &Markup) -> String {
        let page = html! {
            (DOCTYPE) "\n"
            html lang="en" {
                "\n" (self.head()) "\n"
                body {
                    "\n"
                    a class="skip" href="#main" { "Skip to the report" } "\n"
                    header {
                        div class="wrap" {
                            p class="kicker" { "hgm " (self.version) " · " (self.kicker) }
                            h1 { (self.title) }
                            p class="disclaimer" {
                                "Research software, not a medical device. Not for diagnosis, not for surgical planning."
                            }
                        }
                    } "\n"
                    nav aria-label="Sections" {
                        div class="wrap" {
                            @for section in sections { a href={ "#" (section.id) } { (section.heading) } }
                        }
                    } "\n"
                    main id="main" class="wrap" {
                        "\n" (notice)
                        @for section in sections { (section.html()) "\n" }
                    } "\n"
                    footer class="wrap" {
                        p { "Research software, not a medical device. Made by hgm " (self.version) ". " (footnote) }
                    } "\n"
                    (scripts)
                } "\n"
            } "\n"
        };
        without_control_characters(page.into_string())
    }

    fn head(&self) -> Markup {
        html! {
            head {
                "\n" meta charset="utf-8";
                "\n" meta http-equiv="Content-Security-Policy" content=(POLICY);
                "\n" meta name="viewport" content="width=device-width, initial-scale=1";
                "\n" meta name="color-scheme" content="light dark";
                "\n" meta name="referrer" content="no-referrer";
                "\n" link rel="icon" href="data:,";
                "\n" title { (self.title) " · hgm" }
                "\n" style { "\n" (PreEscaped(STYLE)) } "\n"
            }
        }
    }
}

impl Section {
    fn html(&self) -> Markup {
        html! {
            section id=(self.id) aria-labelledby={ "h-" (self.id) } {
                h2 id={ "h-" (self.id) } { (self.heading) } "\n"
                (self.body)
            }
        }
    }
}

/// A box above the sections.
fn notice(class: &str, heading: &str, items: &[String]) -> Markup {
    html! {
        div class={ "notice " (class) } id="warnings" role="note" {
            h2 { span aria-hidden="true" { "▲" } " " (heading) }
            ul { @for item in items { li { (item) } } }
        } "\n"
    }
}

impl CasePage {
    /// The whole page.
    pub fn to_html(&self) -> String {
        let title =
            if self.subject.is_empty() { self.title.clone() } else { format!("{} · {}", self.subject, self.title) };
        let frame = Frame { title: &title, kicker: "brain deformation report", version: &self.version };
        let scripts = html! {
            script { "\n" (PreEscaped(RATING_SCRIPT)) } "\n"
            @if let Some(viewer) = &self.viewer { (viewer.scripts()) }
        };
        let note = "The images are masked to the brain; of the scans' headers the page holds no names, dates or places (the \
                    heading is the folder's name), and it makes no request to any other place.";
        // A shift of which nothing is believed has no size.
        let sized = |shift: &&BrainShift| shift.states.first().is_some_and(StateShift::is_believed);
        let shift = self.brain_shift.as_ref().filter(sized);
        let glance = glance::block(self.outcome.as_ref(), self.glance.as_ref(), shift);
        let expected = self.prediction.as_ref().map(prediction::in_a_sentence);
        let first = html! {
            @if let Some(expected) = expected { p class="verdict" { (expected) } "\n" }
            (glance) (self.warnings_box())
        };
        frame.html(&first, &self.sections(), note, &scripts)
    }

    fn sections(&self) -> Vec<Section> {
        let mut sections = Vec::new();
        let mut add = |id, heading, body: Option<Markup>| {
            sections.extend(body.map(|body| Section { id, heading, body }));
        };
        let outcome = self.outcome.as_ref();
        let shift = self.brain_shift.as_ref().filter(|shift| !shift.states.is_empty());
        let figure = self.shift_figure.as_ref().map(shift_pictures);
        let landmarks = self.landmarks.as_ref();
        let expected = self.prediction_figure.as_ref();
        let expected = expected.map(|f| html! { (shift_pictures(&f.shift)) (shift_pictures(&f.spread)) });
        add("expected", "Expected brain shift", self.prediction.as_ref().map(|p| prediction::section(p, expected)));
        add("evaluation", "Predicted against seen", self.evaluation.as_ref().map(evaluation::section));
        let compared = outcome.filter(|o| o.kind != ExperimentKind::Prediction);
        add("summary", "Summary", compared.map(results::summary));
        add("shift", "Brain shift", shift.map(|shift| brain_shift::section(shift, figure, landmarks)));
        add("seen", "What was seen", self.refused.as_ref().map(|seen| pictures(std::slice::from_ref(seen))));
        add("scans", "Quality of the scans", outcome.and_then(|o| scans::of_case(o.scans.as_ref()?)));
        add("registration", "Registration", self.registration_section());
        add("masks", "Masks", self.masks_section());
        add("mesh", "Mesh", self.mesh_section());
        add("samples", "Samples", outcome.filter(|o| !o.samples.is_empty()).map(samples_section));
        add(
            "estimate",
            "Estimate",
            outcome.and_then(|o| {
                let residuals = self.residual_figure.as_ref().map(shift_pictures);
                let truth = &o.reference_shear_modulus_pa;
                Some(estimate::section(o.estimate.as_ref()?, o.comparison.as_ref(), truth, residuals))
            }),
        );
        add("error", "Error per node", self.error_map.as_ref().map(error_section));
        let sliced = self.viewer.as_ref().is_some_and(|viewer| viewer.slices.is_some());
        let heading = if sliced { "Slices and 3-D view" } else { "3-D view" };
        add("view", heading, self.viewer.as_ref().map(Viewer::section));
        add("convergence", "Convergence", outcome.and_then(results::convergence));
        add("methods", "Methods", outcome.map(|o| methods::section(o, self.prediction.as_ref())));
        add("provenance", "Files and settings", self.provenance_section());
        add("rating", "Your rating", Some(parts::rating()));
        sections
    }

    fn warnings_box(&self) -> Markup {
        let raised = self.outcome.iter().flat_map(|o| &o.warnings).chain(&self.warnings);
        let absent = self.absent.iter().map(|what| format!("Not shown: {what}."));
        let items: Vec<String> = raised.cloned().chain(absent).collect();
        match items.len() {
            0 => html! {
                div class="notice calm" id="warnings" role="note" {
                    h2 { "No warnings" }
                    p { "No stage raised one. Look at the registration and the masks all the same." }
                } "\n"
            },
            1 => notice("warn", "1 warning", &items),
            n => notice("warn", &format!("{n} warnings"), &items),
        }
    }

    fn masks_section(&self) -> Option<Markup> {
        (!self.mosaics.is_empty()).then(|| html! { @for mosaic in &self.mosaics { (parts::mosaic(mosaic)) } })
    }

    fn registration_section(&self) -> Option<Markup> {
        let table = self.outcome.as_ref().and_then(|o| results::registrations(&o.registrations));
        let figure = self.registration.as_ref().map(parts::registration);
        (figure.is_some() || table.is_some()).then(|| html! { (Given(figure)) (Given(table)) })
    }

    fn mesh_section(&self) -> Option<Markup> {
        let tables = self.outcome.as_ref().and_then(results::mesh);
        if self.mesh_pictures.is_empty() && tables.is_none() {
            return None;
        }
        Some(html! {
            (pictures(&self.mesh_pictures))
            @if !self.mesh_legend.is_empty() {
                ul class="swatches" aria-label="Colours of the cells" {
                    @for (colour, name) in &self.mesh_legend {
                        li {
                            svg viewBox="0 0 10 10" aria-hidden="true" {
                                path fill=(hex(*colour)) d="M0 0h10v10H0z" {}
                            }
                            (name)
                        }
                    }
                } "\n"
            }
            (Given(tables))
        })
    }

    fn provenance_section(&self) -> Option<Markup> {
        let blocks = [("Settings", &self.settings_toml), ("Provenance", &self.provenance_json)];
        (!self.files.is_empty() || blocks.iter().any(|(_, text)| text.is_some())).then(|| {
            html! {
                @if !self.files.is_empty() { (files::section(&self.files)) }
                @for (name, text) in blocks {
                    @if let Some(text) = text {
                        details { summary { (name) } pre tabindex="0" aria-label=(name) { (text) } } "\n"
                    }
                }
            }
        })
    }
}

/// Markup that may be absent.
struct Given(Option<Markup>);

impl maud::Render for Given {
    fn render_to(&self, page: &mut String) {
        page.extend(self.0.as_ref().map(|markup| markup.0.as_str()));
    }
}

/// Heading of a page by what was run.
pub fn title_of(outcome: Option<&ExperimentOutcome>) -> &'static str {
    match outcome.map(|o| (o.kind, o.samples.is_empty(), o.answer)) {
        Some((ExperimentKind::Phantom, ..)) => "A phantom: known moduli, looked for again",
        Some((ExperimentKind::Prediction, ..)) => "Brain shift expected of a planned resection",
        Some((ExperimentKind::Resection, true, Some(_))) => "Two scans compared",
        Some((ExperimentKind::Resection, false, _)) => "Brain deformation after resection",
        Some((ExperimentKind::Resection, true, None)) | None => "Prepared case",
    }
}

fn shift_pictures(figure: &ShiftFigure) -> Markup {
    html! {
        (pictures(&figure.pictures))
        div class="bar-row" { (PreEscaped(chart::colour_bar(&figure.scale))) } "\n"
    }
}

/// A row of captioned pictures.
fn pictures(pictures: &[CaptionedPicture]) -> Markup {
    html! {
        @if !pictures.is_empty() {
            div class="pictures" {
                @for p in pictures {
                    figure {
                        div class="picture" {
                            img src=(png_address(&p.png)) width=(p.size[0]) height=(p.size[1]) alt=(p.description);
                            @if let Some([left, right]) = p.sides {
                                span class="side" { (left) } span class="side right" { (right) }
                            }
                        }
                        figcaption { (p.caption) }
                    }
                }
            } "\n"
        }
    }
}

/// The samples: those of several tasks in panels of their own.
fn samples_section(outcome: &ExperimentOutcome) -> Markup {
    html! { (tasks::of_case(outcome)) (results::samples(outcome, !tasks::compared(outcome))) }
}

fn error_section(map: &ErrorMap) -> Markup {
    html! {
        p {
            "Distance at every node between the best sample and the target. Grey: no target there. The colours end at the 95th \
             percentile."
        } "\n"
        @if map.on_two_sets > 0 {
            p {
                "Nodes that lie on two of the sets, as where the margin meets the ventricle wall: " (count(map.on_two_sets))
                ". They are coloured, and counted in the histograms of both, with the smaller of their two errors; the RMSE of a \
                 set takes the error against its own target."
            } "\n"
        }
        (pictures(&map.pictures))
        div class="bar-row" { (PreEscaped(chart::colour_bar(&map.scale))) } "\n"
        div class="charts" {
            @for (set, errors) in &map.errors_mm {
                @let label = format!("error, {} (mm)", set_name(set));
                figure {
                    (PreEscaped(chart::histogram(errors, &label, "nodes", Some(&map.scale))))
                    figcaption { (results::spread(errors)) }
                }
            }
        } "\n"
    }
}

#[cfg(test)]
mod tests;
