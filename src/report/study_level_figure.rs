//! The study-level model's figures (SVG): the bands of every task, and each publication beside what the others say of it.

use super::chart::{Axis, SERIES_COLOURS, frame};
use super::html::escape;
use super::material_figure::{Layout, SMALL, STUDIES, document, path, title};
use crate::material::study_level::{LeftOut, LeftOutCurve, StudyCurve, StudyLevelPrior};
use std::fmt::Write;

/// Half widths of the central 95 and 50 % of the normal law.
const WIDE: f64 = 1.96;
const HALF: f64 = 0.6745;
const MANY: Layout = Layout { columns: 5, ..SMALL };

/// One task: from the widest to the narrowest prediction, and the studies' curves.
#[derive(Clone, Debug)]
pub struct TaskBands {
    /// A new study, a new laboratory's average, the mean.
    pub bands: [StudyLevelPrior; 3],
    /// What has been published.
    pub curves: Vec<StudyCurve>,
}

/// The area between two sets of logarithms.
fn band(axes: &(Axis, Axis), stretches: &[f64], [low, high]: [&[f64]; 2], opacity: f64, colour: &str) -> String {
    let pair = |(l, y): (&f64, &f64)| (*l, y.exp());
    let up = stretches.iter().zip(high).map(pair);
    let down = stretches.iter().zip(low).map(pair).rev();
    format!("<path d=\"{}Z\" fill=\"{colour}\" opacity=\"{opacity}\"/>", path(axes, up.chain(down)))
}

fn line(axes: &(Axis, Axis), stretches: &[f64], logs: &[f64], stroke: &str) -> String {
    let points = stretches.iter().zip(logs).map(|(l, y)| (*l, y.exp()));
    format!("<path d=\"{}\" fill=\"none\" {stroke}/>", path(axes, points))
}

fn shifted(mean: &[f64], sd: &[f64], by: f64) -> Vec<f64> {
    mean.iter().zip(sd).map(|(mean, sd)| mean + by * sd).collect()
}

/// One panel a task, four in a row: 95 % of a new study, of a laboratory's average and of the mean, under the studies.
pub fn bands_figure(tasks: &[TaskBands]) -> String {
    let panels: Vec<String> = tasks.iter().map(bands_panel).collect();
    let colour = SERIES_COLOURS[0];
    let mut legend = format!(
        "<path d=\"M0 -4h26\" stroke=\"{STUDIES}\" opacity=\".7\"/><text x=\"32\">studies</text>\
         <path d=\"M90 -4h26\" stroke=\"{colour}\" stroke-width=\"3\"/><text x=\"122\">expectation</text>"
    );
    let words = ["95 % of a new study", "of a laboratory's average", "of the mean"];
    for (n, (words, opacity)) in words.iter().zip([0.13, 0.31, 0.56]).enumerate() {
        let x = 220 + 190 * n;
        let _ = write!(
            legend,
            "<rect x=\"{x}\" y=\"-10\" width=\"26\" height=\"11\" fill=\"{colour}\" opacity=\"{opacity}\"/>\
             <text x=\"{}\">{}</text>",
            x + 32,
            escape(words)
        );
    }
    let description = "Effective shear modulus of each task over the stretch: studies, and 95 % bands of the mean, of a \
                       laboratory's average and of a new study";
    document(&SMALL, description, &legend, &panels)
}

fn bands_panel(task: &TaskBands) -> String {
    let widest = &task.bands[0];
    let edges = [-WIDE, WIDE].map(|k| shifted(&widest.mean, &widest.sd, k));
    let shown = |l: f64| l >= widest.stretches[0] - 1e-9 && l <= widest.stretches[widest.stretches.len() - 1] + 1e-9;
    let curves: Vec<(Vec<f64>, Vec<f64>)> = task
        .curves
        .iter()
        .map(|curve| {
            let points = curve.strains.iter().map(|x| x.exp()).zip(curve.log_moduli.iter().copied());
            points.filter(|(l, _)| shown(*l)).unzip()
        })
        .collect();
    let logs = edges.iter().flatten().chain(curves.iter().flat_map(|(_, y)| y));
    let axes = (
        Axis::over(widest.stretches.iter().copied(), false, false, SMALL.x),
        Axis::over(logs.map(|y| y.exp()), true, false, SMALL.y),
    );
    let count = task.curves.len();
    let studies = if count == 1 { "1 study".to_owned() } else { format!("{count} studies") };
    let mut svg = title(&SMALL, &format!("{} ({studies})", widest.task));
    frame(&mut svg, &axes.0, &axes.1, "stretch", "shear modulus (Pa)");
    for prior in &task.bands {
        let edges = [-WIDE, WIDE].map(|k| shifted(&prior.mean, &prior.sd, k));
        svg += &band(&axes, &prior.stretches, [&edges[0], &edges[1]], 0.2, SERIES_COLOURS[0]);
    }
    let stroke = format!("stroke=\"{}\" stroke-width=\"3\"", SERIES_COLOURS[0]);
    svg += &line(&axes, &widest.stretches, &widest.mean, &stroke);
    for (stretches, logs) in &curves {
        svg += &line(&axes, stretches, logs, &format!("stroke=\"{STUDIES}\" opacity=\".7\""));
    }
    svg
}

/// One panel a publication, five in a row: its curves over the 50 and 95 % bands that the others give of a new study.
pub fn left_out_figure(left_out: &[LeftOut]) -> String {
    let panels: Vec<String> = left_out.iter().map(left_out_panel).collect();
    let legend = "<text>lines: the publication's curves; bands: 50 and 95 % of a new study as all other publications have it, \
                  one colour a task</text>";
    let description = "Each publication's effective shear moduli over the stretch, with the prediction from all others";
    document(&MANY, description, legend, &panels)
}

fn left_out_panel(left: &LeftOut) -> String {
    let mut tasks: Vec<&LeftOutCurve> = Vec::new();
    for curve in &left.curves {
        // The widest curve of a task carries its band.
        let width = |c: &LeftOutCurve| c.stretches.iter().fold(0.0_f64, |w, l| w.max((l - 1.0).abs()));
        match tasks.iter_mut().find(|known| known.task == curve.task) {
            Some(known) if width(curve) > width(known) => *known = curve,
            Some(_) => {}
            None => tasks.push(curve),
        }
    }
    let edges = tasks.iter().flat_map(|c| [-WIDE, WIDE].map(|k| shifted(&c.mean, &c.sd, k)));
    let logs: Vec<f64> = edges.flatten().chain(left.curves.iter().flat_map(|c| c.log_moduli.iter().copied())).collect();
    let axes = (
        Axis::over(left.curves.iter().flat_map(|c| c.stretches.iter().copied()), false, false, MANY.x),
        Axis::over(logs.iter().map(|y| y.exp()), true, false, MANY.y),
    );
    let mut svg = title(&MANY, &format!("{} ({:.0} % inside)", left.publication, 100.0 * left.inside_95));
    frame(&mut svg, &axes.0, &axes.1, "stretch", "shear modulus (Pa)");
    for (n, curve) in tasks.iter().enumerate() {
        for reach in [WIDE, HALF] {
            let edges = [-reach, reach].map(|k| shifted(&curve.mean, &curve.sd, k));
            let colour = SERIES_COLOURS[n % SERIES_COLOURS.len()];
            svg += &band(&axes, &curve.stretches, [&edges[0], &edges[1]], 0.2, colour);
        }
    }
    for curve in &left.curves {
        svg += &line(&axes, &curve.stretches, &curve.log_moduli, &format!("stroke=\"{STUDIES}\" opacity=\".7\""));
    }
    svg
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Task;
    use crate::material::literature::{Curves, table};
    use crate::material::study_level::{Evidence, Of, Spreads, Studies, predict};
    use crate::material::task::stretches;

    #[test]
    fn every_task_has_a_panel_with_three_bands_and_all_its_studies() {
        let studies = Studies::from_literature(&table(), Curves::Corrected);
        let spreads = Spreads::default();
        let means = Evidence::new(&studies, &spreads).unwrap().means;
        let panel = |task: Task| {
            let [low, high] = task.stretch_window();
            let grid = stretches(low, high, 11);
            let bands = [Of::Study, Of::Laboratory, Of::Mean].map(|of| predict(&means, &spreads, task, of, &grid));
            let curves = studies.publications.iter().flat_map(|(_, curves)| curves);
            TaskBands { bands, curves: curves.filter(|curve| curve.task == task).cloned().collect() }
        };
        let panels: Vec<TaskBands> = Task::all().map(panel).collect();
        let svg = bands_figure(&panels);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert_eq!(svg.matches("<g transform").count(), 13, "twelve panels and the legend");
        assert_eq!(svg.matches("opacity=\".7\"").count(), 73 + 1, "all studies and the legend");
        assert_eq!(svg.matches("Z\" fill").count(), 36, "three bands a task");
        assert_eq!(svg, bands_figure(&panels), "the same bytes again");
        for TaskBands { bands: [study, laboratory, mean], .. } in &panels {
            for n in 0..11 {
                assert!(mean.sd[n] < laboratory.sd[n] && laboratory.sd[n] < study.sd[n]);
            }
        }
    }
}
