//! Figures of images and the rating form, as HTML.

use super::super::figure::{Mosaic, RegistrationFigure, Structure, TileFigure};
use super::super::html::{escape, number, png_address};
use super::super::slice::{PLANES, Plane};
use std::fmt::Write;

fn axis_letter(plane: Plane) -> &'static str {
    ["x", "y", "z"][plane.axis()]
}

/// One tile as an SVG of its pictures and outlines; `layers` names the style class of every picture.
fn tile(figure: &TileFigure, layers: &[&str], what: &str) -> String {
    let [w, h] = figure.tile.size.map(|n| 10 * n);
    let plane = figure.tile.plane;
    let at = format!("{} = {} mm", axis_letter(plane), number_mm(figure.tile.at_mm));
    let seen: Vec<&str> = figure.outlines.iter().map(|o| o.0.name()).collect();
    let outlined = if seen.is_empty() { String::new() } else { format!(", outlined: {}", seen.join(", ")) };
    let description = format!("{} slice at {at}, {what}{outlined}", plane.name());
    let mut html = format!(
        "<figure class=\"tile\"><svg viewBox=\"0 0 {w} {h}\" role=\"img\" aria-label=\"{}\">",
        escape(&description)
    );
    for (png, class) in figure.layers.iter().zip(layers) {
        let address = png_address(png);
        let _ = write!(html, "<image class=\"{class}\" width=\"{w}\" height=\"{h}\" href=\"{address}\"/>");
    }
    html.push_str("<g class=\"outlines\">");
    for (structure, path) in &figure.outlines {
        let _ = write!(html, "<path class=\"{}\" d=\"{path}\"/>", structure.class());
    }
    let (left, right) = plane.sides();
    let _ = write!(
        html,
        "</g><text x=\"40\" y=\"140\">{left}</text><text x=\"{}\" y=\"140\" text-anchor=\"end\">{right}</text></svg>\
         <figcaption>{at}</figcaption></figure>",
        w - 40
    );
    html
}

fn number_mm(mm: f64) -> String {
    if mm < 0.0 { format!("\u{2212}{}", -mm) } else { format!("{}", mm + 0.0) }
}

fn legend(structures: &[Structure]) -> String {
    let mut html = String::from("<ul class=\"legend\" aria-label=\"Outlines\">");
    for s in structures {
        let _ = write!(
            html,
            "<li><svg viewBox=\"0 0 280 60\" width=\"28\" height=\"6\" aria-hidden=\"true\"><path class=\"{}\" d=\"M0 30h280\"/></svg>{}</li>",
            s.class(),
            s.name()
        );
    }
    html + "</ul>"
}

/// Rows of tiles, one per plane, under headings of the level `heading`.
fn rows(tiles: &[TileFigure], layers: &[&str], what: &str, heading: &str) -> String {
    let mut html = String::new();
    for plane in PLANES {
        let row: String =
            tiles.iter().filter(|t| t.tile.plane == plane).map(|figure| tile(figure, layers, what)).collect();
        if !row.is_empty() {
            let name = plane.name();
            let _ = write!(html, "<{heading} class=\"plane\">{name}</{heading}><div class=\"tiles\">{row}</div>");
        }
    }
    html
}

/// A mosaic with its legend and a switch for the outlines that needs no script.
pub fn mosaic(mosaic: &Mosaic) -> String {
    let id: String = mosaic.title.chars().filter(char::is_ascii_alphanumeric).collect();
    format!(
        "<div class=\"slices\"><h3>{}</h3><p>{}</p><div class=\"controls\"><input type=\"checkbox\" id=\"o-{id}\" class=\"show-outlines\" \
         checked><label for=\"o-{id}\">Outlines</label>{}</div>\n{}</div>\n",
        escape(&mosaic.title),
        escape(&mosaic.caption),
        legend(&mosaic.structures),
        rows(&mosaic.tiles, &["image"], &mosaic.title.to_lowercase(), "h4")
    )
}

/// The flicker: radio buttons and CSS, no script. Who asks for less motion gets still pictures.
pub fn registration(figure: &RegistrationFigure) -> String {
    let mut html = String::from(
        "<div class=\"slices\"><p>The page alternates between the image before surgery and the image after it. What \
         jumps has moved or is badly registered; the skull-side surface away from the cavity should stand still. The \
         outlines are those of the image before surgery. Patient&#39;s right is on the left.</p>\
         <fieldset class=\"controls flicker\"><legend>Show</legend>",
    );
    let mut choices = vec![("f-after", "alternating, registered", true)];
    if figure.has_before {
        choices.push(("f-before", "alternating, as scanned", false));
    }
    choices.push(("f-fixed", "before surgery", false));
    choices.push(("f-moving", "after surgery, registered", false));
    if figure.has_before {
        choices.push(("f-scanned", "after surgery, as scanned", false));
    }
    for (id, text, checked) in choices {
        let checked = if checked { " checked" } else { "" };
        let _ = write!(
            html,
            "<span><input type=\"radio\" name=\"flicker\" id=\"{id}\"{checked}><label for=\"{id}\">{text}</label></span>"
        );
    }
    let _ = write!(
        html,
        "</fieldset><div class=\"controls\"><input type=\"checkbox\" id=\"o-flicker\" class=\"show-outlines\" checked>\
         <label for=\"o-flicker\">Outlines</label>{}</div>\n{}</div>\n",
        legend(&figure.structures),
        rows(&figure.tiles, &["image fixed", "image moving", "image scanned"], "before and after surgery", "h3")
    );
    html
}

/// The form by which a reader rates the case; saved by the reader as a file, sent nowhere.
pub fn rating() -> String {
    let mut html = String::from(
        "<form id=\"rating-form\"><p>Rate what you saw and keep the rating beside the report. Nothing is sent \
         anywhere; saving needs JavaScript.</p><div class=\"grades\">",
    );
    for (id, what) in [
        ("registration", "Registration"),
        ("brain-mask", "Brain mask"),
        ("tissue", "Tissue and ventricles"),
        ("cavity", "Cavity and resected tissue"),
        ("mesh", "Mesh"),
        ("simulation", "Simulation"),
    ] {
        let _ = write!(html, "<fieldset class=\"controls\"><legend>{what}</legend>");
        for grade in ["good", "acceptable", "bad"] {
            let _ = write!(
                html,
                "<span><input type=\"radio\" name=\"{id}\" id=\"r-{id}-{grade}\" value=\"{grade}\">\
                 <label for=\"r-{id}-{grade}\">{grade}</label></span>"
            );
        }
        html.push_str("</fieldset>");
    }
    html + "</div><p><label for=\"rating-note\">Note (no names)</label><textarea id=\"rating-note\" rows=\"3\"></textarea></p>\
            <p><button type=\"submit\">Save rating (JSON)</button> <output id=\"rating-said\" for=\"rating-note\"></output></p></form>\n"
}

/// A number with its unit for key figures.
pub fn quantity(value: Option<f64>, digits: usize, unit: &str) -> String {
    value.map_or_else(|| "–".to_owned(), |v| format!("{}<span class=\"unit\"> {unit}</span>", number(v, digits)))
}
