//! The generative model's figures as files of their own (SVG): what the Gaussian process says of each task beside the
//! curves it learnt from, and literature curves beside the laws fitted to them.

use super::chart::{Axis, SERIES_COLOURS, frame};
use super::html::{escape, fixed};
use crate::material::TissuePrior;
use crate::material::literature::Curve;
use crate::material::meta_model::Fit;
use crate::material::training::GP_LOG_OFFSET_PA;
use std::fmt::Write;

/// A literature curve and the laws fitted to it.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedCurve {
    /// What it is, in words.
    pub name: String,
    /// The curve.
    pub curve: Curve,
    /// The fits.
    pub fits: Vec<Fit>,
}

/// Width and height of a panel, and where its axes stand.
pub(super) struct Layout {
    pub(super) panel: [f64; 2],
    pub(super) x: [f64; 2],
    pub(super) y: [f64; 2],
    pub(super) columns: usize,
}

/// Thin dark lines, seen on the mean's blue.
pub(super) const STUDIES: &str = "#1c1c1c";
pub(super) const SMALL: Layout = Layout { panel: [300.0, 236.0], x: [58.0, 290.0], y: [188.0, 26.0], columns: 4 };
const LARGE: Layout = Layout { panel: [480.0, 330.0], x: [66.0, 466.0], y: [280.0, 26.0], columns: 2 };

pub(super) fn document(layout: &Layout, description: &str, legend: &str, panels: &[String]) -> String {
    let rows = panels.len().div_ceil(layout.columns).max(1);
    let width = layout.panel[0] * layout.columns.min(panels.len().max(1)) as f64;
    let height = layout.panel[1] * rows as f64 + 26.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" role=\"img\" font-family=\"sans-serif\" font-size=\"11\" color=\"#1c1c1c\">\
         <title>{}</title><rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n",
        escape(description)
    );
    for (index, panel) in panels.iter().enumerate() {
        let x = layout.panel[0] * (index % layout.columns) as f64;
        let y = layout.panel[1] * (index / layout.columns) as f64;
        let _ = writeln!(svg, "<g transform=\"translate({x} {y})\">{panel}</g>");
    }
    let _ = writeln!(svg, "<g transform=\"translate(16 {})\">{legend}</g>\n</svg>", height - 9.0);
    svg
}

pub(super) fn title(layout: &Layout, text: &str) -> String {
    let middle = f64::midpoint(layout.x[0], layout.x[1]);
    format!(
        "<text x=\"{middle}\" y=\"16\" text-anchor=\"middle\" font-weight=\"bold\" fill=\"currentColor\">{}</text>",
        escape(text)
    )
}

pub(super) fn path(axes: &(Axis, Axis), points: impl Iterator<Item = (f64, f64)>) -> String {
    let mut line = String::new();
    for (x, y) in points {
        let pen = if line.is_empty() { "M" } else { "L" };
        let _ = write!(line, "{pen}{:.1} {:.1}", axes.0.at(x), axes.1.at(y));
    }
    line
}

/// One panel a task, four in a row: the studies' curves, the posterior mean and two standard deviations of a new
/// observation (the paper's Fig. 2).
pub fn posterior_figure(tasks: &[(TissuePrior, Vec<Curve>)]) -> String {
    let panels: Vec<String> = tasks.iter().map(|(prior, curves)| posterior_panel(prior, curves)).collect();
    let [data, mean, band] = [STUDIES, SERIES_COLOURS[0], SERIES_COLOURS[0]];
    let legend = format!(
        "<path d=\"M0 -4h26\" stroke=\"{data}\" stroke-width=\"1\" opacity=\".7\"/><text x=\"32\">studies</text>\
         <path d=\"M110 -4h26\" stroke=\"{mean}\" stroke-width=\"3\"/><text x=\"142\">posterior mean</text>\
         <rect x=\"260\" y=\"-10\" width=\"26\" height=\"11\" fill=\"{band}\" opacity=\".2\"/>\
         <text x=\"292\">2 standard deviations of a new observation</text>"
    );
    let description = "Strain energy of each task of the Gaussian process over the stretch: studies, posterior mean, \
                       two standard deviations";
    document(&SMALL, description, &legend, &panels)
}

fn posterior_panel(prior: &TissuePrior, curves: &[Curve]) -> String {
    let of = |energy: f64| (energy.max(0.0) + GP_LOG_OFFSET_PA).ln();
    let envelope = |k: f64| prior.quantile(k);
    let (low, high) = (envelope(-2.0), envelope(2.0));
    let data = || curves.iter().flat_map(|c| c.energies_pa.iter().map(|w| of(*w)));
    let stretches = || curves.iter().flat_map(|c| c.stretches.iter().copied());
    let axes = (
        Axis::over(prior.stretches.iter().copied().chain(stretches()), false, false, SMALL.x),
        Axis::over(low.iter().chain(&high).copied().chain(data()), false, false, SMALL.y),
    );
    let studies = if curves.len() == 1 { "1 study".to_owned() } else { format!("{} studies", curves.len()) };
    let mut svg = title(&SMALL, &format!("{} ({studies})", prior.task));
    frame(&mut svg, &axes.0, &axes.1, "stretch", "ln(W / Pa)");
    let up = prior.stretches.iter().copied().zip(high);
    let down = prior.stretches.iter().copied().zip(low).rev();
    let outline = path(&axes, up.chain(down));
    let _ = write!(svg, "<path d=\"{outline}Z\" fill=\"{}\" opacity=\".2\"/>", SERIES_COLOURS[0]);
    let line = path(&axes, prior.stretches.iter().copied().zip(prior.mean.iter().copied()));
    let _ = write!(svg, "<path d=\"{line}\" fill=\"none\" stroke=\"{}\" stroke-width=\"3\"/>", SERIES_COLOURS[0]);
    // Over the mean: where a task has one study, the two fall together.
    for curve in curves {
        let line = path(&axes, curve.stretches.iter().copied().zip(curve.energies_pa.iter().map(|w| of(*w))));
        let colour = STUDIES;
        let _ = write!(svg, "<path d=\"{line}\" fill=\"none\" stroke=\"{colour}\" opacity=\".7\"/>");
    }
    svg
}

/// One panel a literature curve, two in a row: the curve as dots and each fitted law with its cost (the paper's
/// Fig. 3).
pub fn meta_model_figure(fitted: &[FittedCurve]) -> String {
    let panels: Vec<String> = fitted.iter().map(meta_model_panel).collect();
    let legend = "<text>dots: literature; lines: fitted laws, with half the sum of squared residuals of ln W</text>";
    let description = "Strain energy of literature models over the stretch, with the laws fitted to each";
    document(&LARGE, description, legend, &panels)
}

fn meta_model_panel(fitted: &FittedCurve) -> String {
    let curve = &fitted.curve;
    let laws: Vec<Vec<f64>> = fitted
        .fits
        .iter()
        .map(|fit| curve.stretches.iter().map(|l| fit.model.energy_pa(&fit.parameters, *l)).collect())
        .collect();
    let axes = (
        Axis::over(curve.stretches.iter().copied(), false, false, LARGE.x),
        Axis::over(curve.energies_pa.iter().chain(laws.iter().flatten()).copied(), false, true, LARGE.y),
    );
    let mut svg = title(&LARGE, &fitted.name);
    frame(&mut svg, &axes.0, &axes.1, "stretch", "strain energy density (Pa)");
    for (stretch, energy) in curve.stretches.iter().zip(&curve.energies_pa) {
        let (x, y) = (axes.0.at(*stretch), axes.1.at(*energy));
        let _ = write!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"1.8\" fill=\"{}\"/>", SERIES_COLOURS[5]);
    }
    // Energies are least in the middle, where the legend finds room at the top.
    let x = LARGE.x[0] + 0.3 * (LARGE.x[1] - LARGE.x[0]);
    for (index, (fit, energies)) in fitted.fits.iter().zip(&laws).enumerate() {
        let colour = SERIES_COLOURS[index % 5];
        let line = path(&axes, curve.stretches.iter().copied().zip(energies.iter().copied()));
        let dash = ["", "7 3", "2 3", "9 3 2 3"][index % 4];
        let stroke = format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\" stroke-dasharray=\"{dash}\"");
        let y = LARGE.y[1] + 14.0 + 16.0 * index as f64;
        let text = format!("{}, cost {}", fit.model, fixed(fit.cost, 2));
        let _ = write!(
            svg,
            "<path d=\"{line}\" {stroke}/><path d=\"M{x} {:.1}h26\" {stroke}/>\
             <text x=\"{:.1}\" y=\"{y}\" fill=\"currentColor\">{}</text>",
            y - 4.0,
            x + 32.0,
            escape(&text)
        );
    }
    svg
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::generative::{SampleSettings, tissue_prior};
    use crate::material::literature::{Curves, table};
    use crate::material::meta_model::{MetaModel, MetaModelSettings, fit};
    use crate::material::task::Task;

    /// Every element is closed, in order: what an XML parser asks for.
    fn well_formed(svg: &str) -> bool {
        let mut reader = quick_xml::Reader::from_str(svg);
        loop {
            match reader.read_event() {
                Ok(quick_xml::events::Event::Eof) => return true,
                Ok(_) => {}
                Err(_) => return false,
            }
        }
    }

    #[test]
    fn the_posterior_figure_has_a_panel_a_task_with_all_its_studies() {
        let settings = SampleSettings { stretches: 51, ..SampleSettings::published() };
        let table = table();
        let of_task = |task: Task| {
            let own = table.iter().filter(|m| m.task == task).map(|m| m.curve(Curves::Published));
            (tissue_prior(task, &settings), own.collect::<Vec<_>>())
        };
        let tasks: Vec<_> = Task::all().map(of_task).collect();
        assert_eq!(tasks.iter().map(|(_, curves)| curves.len()).sum::<usize>(), 73);
        let svg = posterior_figure(&tasks);
        assert!(well_formed(&svg) && !svg.contains("NaN") && !svg.contains("inf"));
        assert_eq!(svg.matches("<g transform").count(), 13, "twelve panels and the legend");
        assert!(Task::all().all(|task| svg.contains(&format!("{task} ("))));
        // Studies, band and mean of each panel are lines within its axes.
        assert_eq!(svg.matches("opacity=\".7\"").count(), 73 + 1);
        assert_eq!(svg, posterior_figure(&tasks), "the same bytes again");
    }

    #[test]
    fn the_meta_model_figure_names_every_law_with_its_cost() {
        let curve = table()[44].curve(Curves::Corrected);
        let targets: Vec<f64> = curve.energies_pa.iter().map(|w| (w + 1e-3).ln()).collect();
        let fits = MetaModel::PAPER.map(|law| fit(law, &curve.stretches, &targets, &MetaModelSettings::default()));
        let fits: Vec<Fit> = fits.into_iter().map(Result::unwrap).collect();
        let svg = meta_model_figure(&[FittedCurve { name: "a < b".to_owned(), curve, fits: fits.clone() }]);
        assert!(well_formed(&svg) && svg.contains("a &lt; b"));
        for fit in fits {
            assert!(svg.contains(&format!("{}, cost {}", fit.model, fixed(fit.cost, 2))), "{}", fit.model);
        }
    }
}
