//! What a case shows of its states: errors on the surface, the 3-D view, the sweep's slider, the linked slices.

use super::case_files::{Case, ReportError, best_sample, displaced, file_of};
use super::colour::ColourScale;
use super::figure::CaseImages;
use super::linked_slices::LinkedSlices;
use super::mesh_figure::{PICTURE, value_views};
use super::page::{CasePage, ErrorMap};
use super::swept_states::{SweepGrid, SweptStates, SweptStatesBuilder};
use super::viewer::{ViewedSurface, Viewer};
use crate::experiment::outcome::ExperimentOutcome;
use crate::geometry::{Mni, Post, Pre};
use crate::layout;
use crate::mesh::format::{Field, MeshWithFields};
use crate::mesh::{TetMesh, TriMesh};

/// The error of every node, NaN where the reference says nothing of it: such a node is not without error.
pub(super) fn observed_errors(sample: &MeshWithFields) -> Option<Vec<f64>> {
    let errors = sample.point_field("rmse_mm").filter(|f| f.values.len() == sample.mesh.nodes_mm().len())?;
    let mut seen = vec![f64::NAN; errors.values.len()];
    // In a file from before node sets were marked, or written again by another program, the array is read as a set.
    match (sample.point_field("rmse_observed"), sample.mesh.node_sets.get("rmse_observed")) {
        (Some(observed), _) => {
            for (n, _) in observed.values.iter().enumerate().filter(|(_, v)| **v == 1.0) {
                seen[n] = errors.values[n];
            }
        }
        (None, Some(observed)) => observed.iter().for_each(|&n| seen[n as usize] = errors.values[n as usize]),
        (None, None) => return Some(errors.values.clone()),
    }
    Some(seen)
}

/// Error map and 3-D view from the best sample and the reference.
pub(super) fn add_results(
    case: &Case<'_>,
    outcome: &ExperimentOutcome,
    rest: Option<&MeshWithFields>,
    images: Option<&CaseImages>,
    page: &mut CasePage,
) -> Result<(), ReportError> {
    let Some(best) = outcome.best() else {
        page.absent.push("the error per node (no sample is the best one)".to_owned());
        return Ok(());
    };
    let Some((file, sample)) = best_sample(case, outcome)? else {
        page.absent.push(format!("the error per node and the 3-D view (the file of {} is not there)", best.id));
        return Ok(());
    };
    let mesh = &sample.mesh;
    let deformed = displaced(&file, &sample)?;
    let errors = observed_errors(&sample);
    let scale = errors.as_ref().and_then(|e| ColourScale::to_95(e.iter().copied(), "error per node (mm)"));
    if let (Some(errors), Some(scale)) = (&errors, &scale) {
        let sets = outcome.rmse_sets();
        let named: Vec<&str> = sets.iter().map(String::as_str).filter(|s| *s != "all").collect();
        let of_set = |set: &String| {
            let values = match mesh.node_sets.get(set) {
                Some(nodes) => nodes.iter().map(|&n| errors[n as usize]).collect(),
                None if set == "all" => errors.clone(),
                None => Vec::new(),
            };
            let values: Vec<f64> = values.into_iter().filter(|v: &f64| v.is_finite()).collect();
            (!values.is_empty()).then(|| (set.clone(), values))
        };
        page.error_map = Some(ErrorMap {
            scale: scale.clone(),
            pictures: value_views(mesh, &deformed, errors, scale, &named, PICTURE),
            errors_mm: sets.iter().filter_map(of_set).collect(),
            on_two_sets: on_two_sets(mesh, &sets),
        });
    } else {
        page.absent.push(format!("the error per node ({file} has no point array `rmse_mm`)"));
    }
    let mut viewer = viewer(case, rest, mesh, &deformed, errors, scale)?;
    viewer.states = swept_states(case, outcome, mesh)?;
    viewer.slices = linked_slices(case, images)?;
    page.viewer = Some(viewer);
    Ok(())
}

/// How many nodes lie on two of the sets and more. A file has one error of each node, and of these it is the smallest one. Where
/// every node has an error of its own (set `all`) no set's error is another.
fn on_two_sets(mesh: &TetMesh, sets: &[String]) -> usize {
    if sets.iter().any(|set| set == "all") {
        return 0;
    }
    let mut times = vec![0; mesh.nodes_mm().len()];
    sets.iter().filter_map(|set| mesh.node_sets.get(set)).flatten().for_each(|&n| times[n as usize] += 1);
    times.iter().filter(|times| **times > 1).count()
}

/// The states of a sweep on one surface; `None` where they form no row, or one of their files is not there or has another mesh.
fn swept_states(
    case: &Case<'_>,
    outcome: &ExperimentOutcome,
    mesh: &TetMesh,
) -> Result<Option<SweptStates>, ReportError> {
    let Some(grid) = SweepGrid::of(outcome) else { return Ok(None) };
    let (surface, nodes) = TriMesh::from_facets(mesh.nodes_mm(), &mesh.boundary_facets(|_| true));
    let ids = grid.samples.clone();
    let mut states = SweptStatesBuilder::new(grid, &surface);
    for id in ids {
        let Some(sample) = outcome.samples.iter().find(|s| s.id == id) else { return Ok(None) };
        let Some(state) = case.mesh(&file_of(sample))? else { return Ok(None) };
        let displacement = state.point_field("displacement").and_then(Field::vectors);
        let Some(u) = displacement.filter(|u| u.len() == mesh.nodes_mm().len()) else { return Ok(None) };
        let of_surface: Vec<[f64; 3]> = nodes.iter().map(|&n| u[n as usize]).collect();
        states.push(&of_surface);
    }
    Ok(states.build())
}

/// The scans with the frames that are known of them.
fn linked_slices(case: &Case<'_>, images: Option<&CaseImages>) -> Result<Option<LinkedSlices>, ReportError> {
    let Some(images) = images else { return Ok(None) };
    let mni_from_pre = case.transform::<Pre, Mni>(layout::MNI_FROM_PRE_TEXT)?;
    let pre_from_post = case.transform::<Post, Pre>(layout::PRE_FROM_POST_TEXT)?;
    Ok(LinkedSlices::of(images, mni_from_pre.as_ref(), pre_from_post.as_ref()))
}

fn viewer(
    case: &Case<'_>,
    rest: Option<&MeshWithFields>,
    mesh: &TetMesh,
    deformed: &[[f64; 3]],
    errors: Option<Vec<f64>>,
    scale: Option<ColourScale>,
) -> Result<Viewer, ReportError> {
    let facets = mesh.boundary_facets(|_| true);
    let (surface, old) = TriMesh::from_facets(deformed, &facets);
    let values = errors.filter(|_| scale.is_some()).map(|e| old.iter().map(|&n| e[n as usize]).collect());
    let undeformed = rest.map_or(mesh, |r| &r.mesh);
    let rest_surface = TriMesh::from_facets(undeformed.nodes_mm(), &undeformed.boundary_facets(|_| true)).0;
    let plain = |name: &str, surface| ViewedSurface { name: name.to_owned(), surface, values: Vec::new() };
    let mut surfaces = vec![
        plain("undeformed", rest_surface),
        ViewedSurface { name: "deformed, with error".to_owned(), surface, values: values.unwrap_or_default() },
    ];
    if let Some(reference) = case.mesh(layout::REFERENCE_STATE)? {
        let nodes = displaced(layout::REFERENCE_STATE, &reference)?;
        surfaces.push(plain("reference", TriMesh::from_facets(&nodes, &reference.mesh.boundary_facets(|_| true)).0));
    }
    for (what, surface) in case.reference_surfaces()? {
        surfaces.push(plain(&format!("reference: {what}"), surface));
    }
    Ok(Viewer { surfaces, scale, states: None, slices: None })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_where_two_sets_meet_is_counted_once_and_none_where_every_node_has_an_error_of_its_own() {
        let nodes = vec![[0.0, 0.0, 0.0], [50.0, 0.0, 0.0], [0.0, 50.0, 0.0], [0.0, 0.0, 50.0]];
        let mut mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3]], vec![2]).unwrap();
        mesh.set_nodes("margin", vec![0, 1, 2]).unwrap();
        mesh.set_nodes("ventricle", vec![2, 3]).unwrap();
        let of = |sets: &[&str]| on_two_sets(&mesh, &sets.iter().map(|set| (*set).to_owned()).collect::<Vec<_>>());
        assert_eq!(of(&["margin", "ventricle"]), 1);
        assert_eq!(of(&["margin"]), 0);
        assert_eq!(of(&["all", "margin", "ventricle"]), 0);
    }
}
