//! Stage `mesh`: label map to rest mesh with its boundary sets.

use super::{Case, Failure, REST_MESH, Reject, facts};
use crate::artefact::{Manifest, Produced, Stage};
use crate::cli::Session;
use crate::experiment::outcome::{MeshOutcome, SetOutcome};
use crate::geometry::{Frame, Mni, Position};
use crate::image::LabelMap;
use crate::mesh::engine::{
    Engine, EngineError, EnginePrograms, LabelEdge, MeshSettings, MeshSize, WallEdge, mesh_labels,
};
use crate::mesh::format::gifti::{self, Space};
use crate::mesh::format::{msh, vtu};
use crate::mesh::quality::{fidelity, shape_quality, surface_distance};
use crate::mesh::{TetMesh, TriMesh};
use crate::register::deformable::DisplacementField;
use crate::segment::{label, with_closed_sulci};
use crate::tag::{TagError, TagSettings, falx_sheet, tag_boundary_sets_with};
use anyhow::{Context, anyhow};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Raised when the stage's code changes its result.
const VERSION: u32 = 7;
/// A part that lay apart is worth a warning from half a cubic centimetre on; smaller ones are specks of noise.
const LARGE_ISLAND_MM3: f64 = 500.0;
/// Sulci and fissures up to twice this width are closed in the mesh.
const SULCUS_MM: f64 = 4.0;

/// Engine and size as the command line gives them.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct MeshOptions {
    /// Mesh engine [default: cgal where it is built, else lattice]
    #[arg(long, value_name = "ENGINE", value_parser = engine)]
    pub mesher: Option<Engine>,
    /// Target number of tetrahedra (within 15 %)
    #[arg(long, value_name = "N")]
    pub cells: Option<usize>,
    /// Target edge length in mm, instead of a number of tetrahedra
    #[arg(long, value_name = "MM", conflicts_with = "cells")]
    pub edge_mm: Option<f64>,
    /// Edges inside a label, times the target: white_matter=1.5 (again for more labels)
    #[arg(long, value_name = "LABEL=FACTOR", value_parser = label_edge)]
    pub edge_in: Vec<LabelEdge>,
    /// Edges at the wall of a label, times the target, and the distance to which that counts: ventricle=0.5@8
    #[arg(long, value_name = "LABEL=FACTOR@MM", value_parser = wall_edge)]
    pub edge_near: Vec<WallEdge>,
}

fn label_edge(text: &str) -> Result<LabelEdge, String> {
    let read = || {
        let (label, factor) = text.split_once('=')?;
        Some(LabelEdge { label: label::number(label)?, factor: factor.parse().ok()? })
    };
    read().ok_or_else(|| format!("`{text}` is not LABEL=FACTOR, such as white_matter=1.5 or 3=1.5"))
}

fn wall_edge(text: &str) -> Result<WallEdge, String> {
    let read = || {
        let (label, rest) = text.split_once('=')?;
        let (factor, reach) = rest.split_once('@')?;
        Some(WallEdge { label: label::number(label)?, factor: factor.parse().ok()?, reach_mm: reach.parse().ok()? })
    };
    read().ok_or_else(|| format!("`{text}` is not LABEL=FACTOR@MM, such as ventricle=0.5@8 or 4=0.5@8"))
}

fn engine(name: &str) -> Result<Engine, String> {
    serde_json::from_value(name.into()).map_err(|_| {
        format!("no engine `{name}`: say cgal, lattice, gmsh or tetgen (`hgm doctor` tells which are installed)")
    })
}

/// What the report says of the mesh.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MeshFacts {
    /// Size and quality.
    pub mesh: MeshOutcome,
    /// The boundary sets.
    pub sets: Vec<SetOutcome>,
    /// Sets that are not to be believed, a sentence each.
    pub implausible: Vec<String>,
}

/// Where the engines are on this machine.
pub fn programs() -> EnginePrograms {
    EnginePrograms::find(std::env::current_exe().ok().as_deref(), |name| std::env::var_os(name))
}

/// The stage with its settings, and how the boundary is tagged.
///
/// # Errors
/// A settings table that does not fit.
pub fn mesh_stage(
    case: &Case,
    options: &MeshOptions,
    after: &Manifest,
    session: &Session,
) -> Result<(Stage, MeshSettings, TagSettings), Failure> {
    let mut settings = mesh_settings(options, &programs(), session)?;
    settings.without = vec![label::CSF];
    let tag_settings: TagSettings = session.settings("tag")?;
    if tag_settings.falx && settings.split.is_none() {
        settings.split = Some(falx_sheet());
    }
    let both = serde_json::json!({ "mesh": settings, "tag": tag_settings });
    let stage = Stage::new("mesh", VERSION, &case.folder, &both).after(after).frame(Mni::NAME);
    Ok((stage, settings, tag_settings))
}

/// Meshes a label map (grey, white, ventricle, resected), tags the sets, leaves only the tissue, writes the rest mesh.
/// `template_from_labels` carries the landmarks of the template onto a patient; without it they are taken where they are.
///
/// # Errors
/// Rejected label maps and engines that fail.
pub fn mesh(
    case: &Case,
    labels: &LabelMap<Mni>,
    template_from_labels: Option<&DisplacementField<Mni>>,
    options: &MeshOptions,
    after: &Manifest,
    session: &Session,
) -> Result<(Manifest, MeshFacts), Failure> {
    let (stage, settings, tag_settings) = mesh_stage(case, options, after, session)?;
    case.run(&stage, "mesh", || {
        let body = with_closed_sulci(labels, SULCUS_MM);
        let source = template_from_labels.map_or("the template's labels", |_| "anat/pre_space-MNI_dseg.nii.gz");
        let (mut whole, record) = mesh_labels(&body, &settings, &programs()).map_err(|e| no_mesh(e).about(source))?;
        let in_template = |p: [f64; 3]| match template_from_labels {
            Some(field) => field.apply(Position::new(p[0], p[1], p[2])).mm.into(),
            None => p,
        };
        let tags = tag_boundary_sets_with(&mut whole, &tag_settings, in_template).map_err(|error| match error {
            TagError::Empty { .. } => Failure::QualityGate(error.into()),
            TagError::NoTissue => Failure::Rejected(error.into()),
        })?;
        let tissue = |l: u8| l == label::GREY_MATTER || l == label::WHITE_MATTER;
        let tissue_of = whole.restricted(tissue).and_then(|(rest, _)| rest.largest_face_connected_part());
        let no_tissue = || {
            format!(
                "{source}: the mesh of these labels holds no grey or white matter; look at the labels, or give a brain \
                 mask (--brain-mask)"
            )
        };
        let (rest, _) = tissue_of.with_context(no_tissue).reject()?;
        let mut produced = Produced::default();
        produced.files.push((REST_MESH.to_owned(), vtu::encode(&rest, &[], &[])?));
        produced.files.push(("mesh/rest.msh".to_owned(), msh::encode(&rest)?));
        for (set, facets) in &rest.facet_sets {
            let (surface, _) = TriMesh::from_facets(rest.nodes_mm(), facets);
            let file = format!("mesh/rest_{set}.surf.gii");
            produced.files.push((file, gifti::encode_surface(&surface, Space::Mni152, set)));
        }
        let large = record.islands.iter().filter(|island| island.volume_mm3 > LARGE_ISLAND_MM3);
        produced.warnings.extend(large.map(|island| {
            let name = label::name(island.label).unwrap_or("unknown");
            format!("a part of {name} of {:.2} cc lay apart and was left out of the mesh", island.volume_mm3 / 1000.0)
        }));
        produced.warnings.extend(tags.warnings.iter().cloned());
        let sets = tags.sets.iter().map(|set| SetOutcome {
            name: set.name.clone(),
            nodes: set.nodes,
            area_mm2: Some(set.area_mm2),
            centroid_mm: Some(set.centroid_mm),
        });
        let facts_of_mesh = MeshFacts {
            mesh: mesh_outcome(&rest, &whole, &body, &settings),
            sets: sets.collect(),
            implausible: tags.warnings.clone(),
        };
        produced.facts = facts(&facts_of_mesh)?;
        Ok(produced)
    })
}

/// Why there is no mesh: an engine that broke down has failed, everything else is the input's.
pub fn no_mesh(error: EngineError) -> Failure {
    match error {
        EngineError::Program { .. } | EngineError::Invalid { .. } => Failure::Failed(error.into()),
        refused => Failure::Rejected(refused.into()),
    }
}

/// The settings of room `mesh` with the command line over them.
///
/// # Errors
/// A settings table that does not fit.
pub fn mesh_settings(
    options: &MeshOptions,
    programs: &EnginePrograms,
    session: &Session,
) -> Result<MeshSettings, Failure> {
    let named = session.has_settings("mesh", "engine");
    let mut settings: MeshSettings = session.settings("mesh")?;
    if let Some(engine) = options.mesher {
        settings.engine = engine;
    } else if !named {
        settings.engine = programs.preferred();
    }
    if let Some(cells) = options.cells {
        settings.size = MeshSize::Cells(cells);
    }
    if let Some(edge_mm) = options.edge_mm {
        settings.size = MeshSize::EdgeMm(edge_mm);
    }
    settings.sizing.labels.extend(&options.edge_in);
    settings.sizing.walls.extend(&options.edge_near);
    settings.check().map_err(|e| anyhow!("the mesh asked for (--cells, --edge-mm, table [mesh]): {e}")).reject()?;
    programs.check(settings.engine).reject()?;
    Ok(settings)
}

/// Size and shape of what is simulated, and how well the `whole` mesh it was cut from fills its label map.
pub fn mesh_outcome<F: Frame>(
    mesh: &TetMesh,
    whole: &TetMesh,
    map: &LabelMap<F>,
    settings: &MeshSettings,
) -> MeshOutcome {
    let named = |l: u8| label::name(l).map_or_else(|| l.to_string(), str::to_owned);
    let mut volume_cc = BTreeMap::new();
    for (t, &l) in mesh.labels().iter().enumerate() {
        *volume_cc.entry(named(l)).or_insert(0.0) += mesh.volume_mm3(t) / 1000.0;
    }
    let shape = shape_quality(mesh);
    let fit = fidelity(whole, map, &settings.without);
    let border = surface_distance(whole, map, &settings.without);
    MeshOutcome {
        engine: settings.engine.name().to_owned(),
        nodes: mesh.nodes_mm().len(),
        tets: mesh.tets().len(),
        volume_cc,
        dihedral_min_deg: Some(shape.dihedral_min_deg),
        dihedral_percentile_1_deg: Some(shape.dihedral_percentile_1_deg),
        dihedral_below_10_percent: Some(shape.dihedral_below_10_percent),
        dihedral_counts: shape.dihedral_counts,
        radius_ratio_min: Some(shape.radius_ratio_min),
        radius_ratio_mean: Some(shape.radius_ratio_mean),
        scaled_jacobian_min: Some(shape.scaled_jacobian_min),
        volume_error_percent: fit.labels.iter().map(|l| (named(l.label), l.volume_error_percent)).collect(),
        dice: fit.labels.iter().map(|l| (named(l.label), l.dice)).collect(),
        surface_distance_mean_mm: border.map(|d| d.mean_mm),
        surface_distance_95_mm: border.map(|d| d.percentile_95_mm),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_by_name_or_number_of_the_label() {
        let wall = WallEdge { label: label::VENTRICLE, factor: 0.5, reach_mm: 8.0 };
        assert_eq!([wall_edge("ventricle=0.5@8"), wall_edge("4=0.5@8")], [Ok(wall), Ok(wall)]);
        assert_eq!(label_edge("white_matter=1.5"), Ok(LabelEdge { label: label::WHITE_MATTER, factor: 1.5 }));
        for text in ["ventricle", "ventricle=0.5", "falx=0.5@8", "4=half@8", "300=0.5@8"] {
            assert!(wall_edge(text).unwrap_err().contains("ventricle=0.5@8"), "{text}");
        }
        assert!(label_edge("3=").unwrap_err().contains("white_matter=1.5"));
    }
}
