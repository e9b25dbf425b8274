//! Figures of images and the rating form, as HTML.

use super::super::figure::{Mosaic, RegistrationFigure, Structure, TileFigure};
use super::super::html::{number, png_address};
use super::super::slice::{PLANES, Plane};
use maud::{Markup, html};

fn axis_letter(plane: Plane) -> &'static str {
    ["x", "y", "z"][plane.axis()]
}

/// One tile as an SVG of its pictures and outlines; `layers` names the style class of every picture.
pub fn tile_figure(figure: &TileFigure, layers: &[&str], what: &str) -> Markup {
    let [w, h] = figure.tile.size.map(|n| 10 * n);
    let plane = figure.tile.plane;
    let at = format!("{} = {} mm", axis_letter(plane), number_mm(figure.tile.at_mm));
    let seen: Vec<&str> = figure.outlines.iter().map(|o| o.0.name()).collect();
    let outlined = if seen.is_empty() { String::new() } else { format!(", outlined: {}", seen.join(", ")) };
    let [left, right] = plane.sides();
    html! {
        figure class="tile" {
            svg viewBox={ "0 0 " (w) " " (h) } role="img" aria-label={ (plane.name()) " slice at " (at) ", " (what) (outlined) } {
                @for (png, class) in figure.layers.iter().zip(layers) {
                    image class=(class) width=(w) height=(h) href=(png_address(png)) {}
                }
                g class="outlines" {
                    @for (structure, path) in &figure.outlines { path class=(structure.class()) d=(path) {} }
                }
                text x="40" y="140" { (left) }
                text x=(w - 40) y="140" text-anchor="end" { (right) }
            }
            figcaption { (at) }
        }
    }
}

fn number_mm(mm: f64) -> String {
    if mm < 0.0 { format!("\u{2212}{}", -mm) } else { format!("{}", mm + 0.0) }
}

/// What the outlines are.
pub fn legend(structures: &[Structure]) -> Markup {
    html! {
        ul class="legend" aria-label="Outlines" {
            @for s in structures {
                li {
                    svg viewBox="0 0 280 60" width="28" height="6" aria-hidden="true" {
                        path class=(s.class()) d="M0 30h280" {}
                    }
                    (s.name())
                }
            }
        }
    }
}

/// A heading's level below that of its section.
#[derive(Clone, Copy)]
enum Heading {
    Third,
    Fourth,
}

/// Rows of tiles, one per plane, under headings.
fn rows(tiles: &[TileFigure], layers: &[&str], what: &str, heading: Heading) -> Markup {
    html! {
        @for plane in PLANES {
            @let row: Vec<&TileFigure> = tiles.iter().filter(|t| t.tile.plane == plane).collect();
            @if !row.is_empty() {
                @match heading {
                    Heading::Third => h3 class="plane" { (plane.name()) },
                    Heading::Fourth => h4 class="plane" { (plane.name()) },
                }
                div class="tiles" { @for figure in row { (tile_figure(figure, layers, what)) } }
            }
        }
    }
}

/// A switch for the outlines that needs no script, with what they are.
fn outlines(id: &str, structures: &[Structure]) -> Markup {
    html! {
        div class="controls" {
            input type="checkbox" id=(id) class="show-outlines" checked;
            label for=(id) { "Outlines" }
            (legend(structures))
        } "\n"
    }
}

/// A mosaic with its legend.
pub fn mosaic(mosaic: &Mosaic) -> Markup {
    let id: String = mosaic.title.chars().filter(char::is_ascii_alphanumeric).collect();
    html! {
        div class="slices" {
            h3 { (mosaic.title) }
            p { (mosaic.caption) }
            (outlines(&format!("o-{id}"), &mosaic.structures))
            (rows(&mosaic.tiles, &["image"], &mosaic.title.to_lowercase(), Heading::Fourth))
        } "\n"
    }
}

/// The flicker: radio buttons and CSS, no script. Who asks for less motion gets still pictures.
pub fn registration(figure: &RegistrationFigure) -> Markup {
    let mut choices = vec![("f-after", "alternating, registered", true)];
    if figure.has_before {
        choices.push(("f-before", "alternating, as scanned", false));
    }
    choices.push(("f-fixed", "before surgery", false));
    choices.push(("f-moving", "after surgery, registered", false));
    if figure.has_before {
        choices.push(("f-scanned", "after surgery, as scanned", false));
    }
    let layers = ["image fixed", "image moving", "image scanned"];
    html! {
        div class="slices" {
            p {
                "The page alternates between the image before surgery and the image after it. What jumps has moved or is \
                 badly registered; the skull-side surface away from the cavity should stand still. The outlines are those \
                 of the image before surgery. Patient's right is on the left."
            }
            fieldset class="controls flicker" {
                legend { "Show" }
                @for (id, text, checked) in choices {
                    span {
                        input type="radio" name="flicker" id=(id) checked[checked];
                        label for=(id) { (text) }
                    }
                }
            }
            (outlines("o-flicker", &figure.structures))
            (rows(&figure.tiles, &layers, "before and after surgery", Heading::Third))
        } "\n"
    }
}

/// The form by which a reader rates the case; saved by the reader as a file, sent nowhere.
pub fn rating() -> Markup {
    let parts = [
        ("registration", "Registration"),
        ("brain-mask", "Brain mask"),
        ("tissue", "Tissue and ventricles"),
        ("cavity", "Cavity and resected tissue"),
        ("mesh", "Mesh"),
        ("simulation", "Simulation"),
    ];
    html! {
        form id="rating-form" {
            p {
                "Rate what you saw and keep the rating beside the report. Nothing is sent anywhere; saving needs JavaScript."
            }
            div class="grades" {
                @for (name, what) in parts {
                    fieldset class="controls" {
                        legend { (what) }
                        @for grade in ["good", "acceptable", "bad"] {
                            @let id = format!("r-{name}-{grade}");
                            span {
                                input type="radio" name=(name) id=(id) value=(grade);
                                label for=(id) { (grade) }
                            }
                        }
                    }
                }
            }
            p { label for="rating-note" { "Note (no names)" } textarea id="rating-note" rows="3" {} }
            p {
                button type="submit" { "Save rating (JSON)" } " "
                output id="rating-said" for="rating-note" {}
            }
        } "\n"
    }
}

/// A key figure with its name and a note below it.
pub fn tile(name: &str, value: &Markup, note: &str) -> Markup {
    html! {
        div {
            dt { (name) }
            dd { (value) @if !note.is_empty() { span class="note" { (note) } } }
        }
    }
}

/// A number with its unit for key figures.
pub fn quantity(value: Option<f64>, digits: usize, unit: &str) -> Markup {
    html! {
        @match value {
            None => "–",
            Some(v) => { (number(v, digits)) span class="unit" { " " (unit) } }
        }
    }
}
