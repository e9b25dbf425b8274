//! From a label map to a mesh, whichever engine makes the tets.

use super::choice::Engine;
use super::error::EngineError;
use super::mesher::{Request, TET_SHARE};
use super::programs::EnginePrograms;
use super::settings::{MIDSAGITTAL, MeshSettings, MeshSize};
use super::sizing::EdgeFactors;
use crate::geometry::Frame;
use crate::image::LabelMap;
use crate::mesh::label_field::LabelField;
use crate::mesh::optimise::{self, Complex, Point};
use crate::mesh::partial_volume::tissue_fractions;
use crate::mesh::repair::{self, Island};
use crate::mesh::tet_mesh::{MeshError, TetMesh};
use serde::Serialize;

/// What was done on the way to a mesh.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshingRecord {
    /// The engine that ran.
    pub engine: Engine,
    /// The target edge in mm that gave the mesh.
    pub edge_mm: f64,
    /// Parts that were too small to mesh.
    pub islands: Vec<Island>,
}

/// The most tets that a mesh may have.
const MOST_CELLS: f64 = 2e7;

/// Meshes a label map: tets in the map's frame (mm, RAS+), labelled as the map is.
///
/// # Errors
/// [`EngineError`] names the engine, what went wrong and what to try.
pub fn mesh_labels<F: Frame>(
    map: &LabelMap<F>,
    settings: &MeshSettings,
    programs: &EnginePrograms,
) -> Result<(TetMesh, MeshingRecord), EngineError> {
    let name = settings.engine.name();
    settings.check()?;
    let no_labels = || EngineError::NoLabels { without: settings.without.clone() };
    let mut map = map.map(|l| if settings.without.contains(&l) { 0 } else { l });
    let labelled = map.data.iter().filter(|&&l| l != 0).count();
    let volume_mm3 = labelled as f64 * map.grid.voxel_volume_mm3();
    if labelled == 0 {
        return Err(no_labels());
    }
    check_number_of_labels(&map, settings)?;
    // A first guess: tets of a fair mesh of edge h have about 0.17 h^3.
    let mut edge_mm = match settings.size {
        MeshSize::EdgeMm(edge) => edge,
        MeshSize::Cells(cells) => (volume_mm3 / (TET_SHARE * cells as f64)).cbrt(),
    };
    let cells = volume_mm3 / (TET_SHARE * edge_mm.powi(3));
    if cells > MOST_CELLS {
        return Err(EngineError::TooFine { edge_mm, cells, most: MOST_CELLS });
    }
    // What is too small for cells of its own is still a part of others.
    let voxels_of_labels = settings.partial_volume.then(|| map.clone());
    let islands = repair::remove_islands(&mut map, settings.smallest_part, TET_SHARE * edge_mm.powi(3));
    let field = LabelField::new(&map, settings.smoothing_voxels).ok_or_else(no_labels)?;
    settings.sizing.check(&field.labels()[1..])?;
    let field = match &settings.split {
        Some(split) => field.split_at_midplane(&split.labels, &split.above_yz_mm),
        None => field,
    };
    let factors = EdgeFactors::new(&field, &settings.sizing);
    let voxel_mm3 = map.grid.voxel_volume_mm3();
    let mut voxels = [0usize; 256];
    map.data.iter().for_each(|&l| voxels[l as usize] += 1);
    let wanted_mm3: Vec<f64> = field.labels().iter().map(|&l| voxels[l as usize] as f64 * voxel_mm3).collect();
    let polish = |mut complex: Complex| {
        repair::drop_ears(&mut complex);
        repair::separate(&mut complex);
        complex.sheet = field.sheet().cloned();
        optimise::optimise(&mut complex, &field, &wanted_mm3, &settings.optimise);
        repair::separate(&mut complex);
        complex
    };
    let program = programs.check(settings.engine)?;
    let request = Request::new(&field, &factors, &polish, program, &settings.limits);
    let mesher = settings.engine.mesher();
    let make = |edge_mm: f64| {
        let made = mesher.mesh(&request, edge_mm);
        made.map_err(|source| EngineError::Program { engine: name, source })
    };
    if matches!(settings.size, MeshSize::Cells(_)) {
        edge_mm *= mesher.first_guess(edge_mm);
    }
    let mut complex = make(edge_mm)?;
    if let MeshSize::Cells(wanted) = settings.size {
        for _ in 0..4 {
            let ratio = complex.count() as f64 / wanted as f64;
            if complex.count() == 0 || (0.92..=1.08).contains(&ratio) {
                break;
            }
            edge_mm *= ratio.cbrt();
            complex = make(edge_mm)?;
        }
    }
    if complex.count() == 0 {
        let centre_mm = centre_mm(&map);
        return Err(EngineError::TooSmall { engine: name, centre_mm, volume_mm3, edge_mm });
    }
    let complex = polish(complex);
    let invalid = |source| EngineError::Invalid { engine: name, source };
    let mut mesh = to_frame(&complex, &field).map_err(invalid)?;
    if let Some(map) = &voxels_of_labels {
        mesh.set_fractions(tissue_fractions(&mesh, map)).map_err(invalid)?;
    }
    Ok((mesh, MeshingRecord { engine: settings.engine, edge_mm, islands }))
}

/// Labels, and halves of labels that are split, which one mesh can hold: sets of them are kept in 64 bits, one of which is
/// the outside.
const MOST_FIELDS: usize = 63;

fn check_number_of_labels<F: Frame>(map: &LabelMap<F>, settings: &MeshSettings) -> Result<(), EngineError> {
    let mut present = [false; 256];
    map.data.iter().for_each(|&l| present[l as usize] = true);
    let labels = || (1..=255u8).filter(|&l| present[l as usize]);
    let halves = settings.split.as_ref().map_or(0, |split| labels().filter(|l| split.labels.contains(l)).count());
    let (found, most) = (labels().count(), MOST_FIELDS - halves);
    if found > most { Err(EngineError::TooManyLabels { found, most }) } else { Ok(()) }
}

/// Mean place of the labelled voxels.
fn centre_mm<F: Frame>(map: &LabelMap<F>) -> [f64; 3] {
    let labelled = (0..map.data.len()).filter(|&v| map.data[v] != 0);
    let (sum, count) = labelled.fold((Point::zeros(), 0.0), |(sum, count), v| {
        (sum + Point::from(map.grid.voxel(v).map(|c| c as f64)), count + 1.0)
    });
    map.grid.position((sum / f64::max(count, 1.0)).into()).mm.coords.into()
}

/// Box coordinates to the map's frame; a mirroring affine turns the tets around.
fn to_frame(complex: &Complex, field: &LabelField) -> Result<TetMesh, MeshError> {
    let (x, mut tets, fields) = complex.compacted();
    let m = field.frame_from_box();
    let nodes = x.iter().map(|p| m.transform_point(&(*p).into()).coords.into()).collect();
    if m.fixed_view::<3, 3>(0, 0).determinant() < 0.0 {
        for tet in &mut tets {
            tet.swap(2, 3);
        }
    }
    let mut mesh = TetMesh::new(nodes, tets, fields.iter().map(|&f| field.labels()[f as usize]).collect())?;
    let Some(sheet) = field.sheet() else { return Ok(mesh) };
    let in_sheet = |(facet, first, second): ([u32; 3], usize, Option<usize>)| {
        let (own, other) = (fields[first], fields[second?]);
        let centre: Point = facet.iter().map(|&n| x[n as usize]).sum::<Point>() / 3.0;
        let [a, b, c] = facet;
        let seen_from_right = if sheet.left >> own & 1 == 1 { facet } else { [a, c, b] };
        (sheet.crosses(own, other) && !sheet.is_loose(own, other, &centre)).then_some(seen_from_right)
    };
    let facets: Vec<[u32; 3]> = mesh.facets().into_iter().filter_map(in_sheet).collect();
    mesh.facet_sets.insert(MIDSAGITTAL.to_owned(), facets);
    Ok(mesh)
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::settings::MidplaneSplit;
    use super::super::sizing::{LabelEdge, Sizing, WallEdge};
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;
    use crate::mesh::quality::{shape_quality, surface_distance};

    /// A ball of radius 20 mm in a shell of radius 30 mm, off centre in a mirrored, shifted grid.
    pub fn ball_in_shell() -> LabelMap<Mni> {
        let mut m = nalgebra::Matrix4::from_diagonal(&nalgebra::Vector4::new(-1.5, 1.5, 1.5, 1.0));
        m.fixed_view_mut::<3, 1>(0, 3).copy_from(&nalgebra::Vector3::new(40.0, -35.0, -38.0));
        let grid = Grid::new([52, 50, 51], m).unwrap();
        let data = (0..grid.len())
            .map(|n| {
                let r = grid.position(grid.voxel(n).map(|c| c as f64).into()).mm.coords.norm();
                if r < 20.0 { 3 } else { 2 * u8::from(r < 30.0) }
            })
            .collect();
        LabelMap::from_data(grid, data)
    }

    fn volumes(mesh: &TetMesh) -> [f64; 2] {
        [2, 3].map(|l| (0..mesh.tets().len()).filter(|&t| mesh.labels()[t] == l).map(|t| mesh.volume_mm3(t)).sum())
    }

    #[test]
    fn lattice_keeps_volumes_shape_and_size_of_a_ball_in_a_shell() {
        let settings = MeshSettings { size: MeshSize::Cells(8000), ..MeshSettings::default() };
        let (mesh, _) = mesh_labels(&ball_in_shell(), &settings, &EnginePrograms::default()).unwrap();
        let count = mesh.tets().len() as f64;
        assert!((count / 8000.0 - 1.0).abs() < 0.15, "{count} tets");
        let ball = |r: f64| 4.0 / 3.0 * std::f64::consts::PI * r.powi(3);
        let [shell_mm3, inner_mm3] = volumes(&mesh);
        assert!((inner_mm3 / ball(20.0) - 1.0).abs() < 0.01, "{inner_mm3}");
        assert!((shell_mm3 / (ball(30.0) - ball(20.0)) - 1.0).abs() < 0.01, "{shell_mm3}");
        let shape = shape_quality(&mesh);
        assert!(
            shape.dihedral_min_deg > 15.0 && shape.non_manifold_outer_edges + shape.crossing_facets == 0,
            "{shape:?}"
        );
        assert!(shape.radius_ratio_min > 0.1 && shape.radius_ratio_mean > 0.7, "{shape:?}");
        assert!(shape.scaled_jacobian_min > 0.05, "{shape:?}");
        let border = surface_distance(&mesh, &ball_in_shell(), &[]).unwrap();
        assert!(border.mean_mm < 0.5 && border.percentile_95_mm < 1.0, "{border:?}");
    }

    #[test]
    fn more_labels_than_a_mesh_can_hold_are_refused_in_words() {
        let grid = Grid::<Mni>::axis_aligned([9; 3], [1.0; 3], [0.0; 3]);
        let map = |most: usize| LabelMap::from_fn(grid, |n| 1 + (n % most) as u8);
        let said = |most: usize, split: bool| {
            let split = split.then(|| MidplaneSplit { labels: vec![2, 3], above_yz_mm: Vec::new() });
            let settings = MeshSettings { split, ..MeshSettings::default() };
            let refused = mesh_labels(&map(most), &settings, &EnginePrograms::default()).err();
            refused.map_or(String::new(), |e| e.to_string())
        };
        assert!(said(64, false).contains("64 labels, 63 are meshed at most"), "{}", said(64, false));
        assert!(said(62, true).contains("62 labels, 61 are meshed at most"));
    }

    #[test]
    fn split_labels_leave_a_sheet_of_facets_in_the_midplane() {
        let size = MeshSize::Cells(8000);
        let split = MidplaneSplit { labels: vec![2], above_yz_mm: Vec::new() };
        let settings = MeshSettings { size, split: Some(split), ..MeshSettings::default() };
        let (mesh, _) = mesh_labels(&ball_in_shell(), &settings, &EnginePrograms::default()).unwrap();
        let sheet = &mesh.facet_sets[MIDSAGITTAL];
        let area: f64 = sheet.iter().map(|&f| mesh.area_vector_mm2(f).norm()).sum();
        let seen: f64 = sheet.iter().map(|&f| mesh.area_vector_mm2(f).x).sum();
        // The shell's cut: a ring between the radii.
        let ring = std::f64::consts::PI * (900.0 - 400.0);
        assert!((area / ring - 1.0).abs() < 0.03, "{area}");
        assert!(seen / area > 0.98, "the facets lie in the plane and are seen from the right: {seen} of {area}");
        // Where the sheet meets other interfaces at a sharp angle, a node may stay beside the plane for the sake of shape.
        let corners = sheet.as_flattened();
        let flat = corners.iter().filter(|&&n| mesh.nodes_mm()[n as usize][0].abs() < 1e-9).count();
        assert!(flat as f64 > 0.95 * corners.len() as f64, "{flat} of {}", corners.len());
        let shape = shape_quality(&mesh);
        assert!(shape.dihedral_min_deg > 15.0 && shape.radius_ratio_min > 0.1, "{shape:?}");
    }

    #[test]
    fn the_same_bytes_on_one_and_two_threads() {
        let settings = MeshSettings { size: MeshSize::Cells(3000), ..MeshSettings::default() };
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| mesh_labels(&ball_in_shell(), &settings, &EnginePrograms::default()).unwrap().0)
        };
        assert!(on(1) == on(2));
    }

    #[test]
    fn fractions_fill_the_volume_of_the_voxels_and_are_the_same_on_one_and_two_threads() {
        let map = ball_in_shell();
        let settings = MeshSettings { size: MeshSize::Cells(3000), partial_volume: true, ..MeshSettings::default() };
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| mesh_labels(&map, &settings, &EnginePrograms::default()).unwrap().0)
        };
        let mesh = on(1);
        assert!(mesh == on(2));
        let plain = MeshSettings { partial_volume: false, ..settings.clone() };
        let (plain, _) = mesh_labels(&map, &plain, &EnginePrograms::default()).unwrap();
        assert!(plain.fractions().is_empty());
        assert!(mesh.clone().without_fractions() == plain);
        let filled: f64 = (0..mesh.tets().len()).map(|t| mesh.fractions()[&3][t] * mesh.volume_mm3(t)).sum();
        let voxels = map.data.iter().filter(|l| **l == 3).count() as f64 * map.grid.voxel_volume_mm3();
        assert!((filled / voxels - 1.0).abs() < 0.005, "{filled} against {voxels} mm3");
        let mixed = mesh.fractions()[&3].iter().filter(|f| **f > 0.0 && **f < 1.0).count();
        assert!(mixed > 100, "{mixed}");
    }

    /// Volumes of the tets whose centres have a distance from the balls' centre within `mm`, on average.
    fn mean_volume_mm3(mesh: &TetMesh, mm: std::ops::Range<f64>) -> f64 {
        let distance = |t: usize| {
            mesh.tets()[t].iter().map(|&n| Point::from(mesh.nodes_mm()[n as usize]) / 4.0).sum::<Point>().norm()
        };
        let there: Vec<usize> = (0..mesh.tets().len()).filter(|&t| mm.contains(&distance(t))).collect();
        there.iter().map(|&t| mesh.volume_mm3(t)).sum::<f64>() / there.len() as f64
    }

    #[test]
    fn lattice_is_coarse_where_no_interface_is_near() {
        let settings = MeshSettings { size: MeshSize::EdgeMm(2.0), ..MeshSettings::default() };
        let (mesh, _) = mesh_labels(&ball_in_shell(), &settings, &EnginePrograms::default()).unwrap();
        let (inside, border) = (mean_volume_mm3(&mesh, 0.0..10.0), mean_volume_mm3(&mesh, 19.0..21.0));
        assert!(inside > 4.0 * border, "{inside} against {border} mm3");
    }

    #[test]
    fn tets_are_small_at_the_wall_or_in_the_label_that_asks_for_it() {
        let mesh = |size, sizing| {
            let settings = MeshSettings { size, sizing, ..MeshSettings::default() };
            let mesh = mesh_labels(&ball_in_shell(), &settings, &EnginePrograms::default()).unwrap().0;
            let shape = shape_quality(&mesh);
            assert!(shape.dihedral_min_deg > 15.0 && shape.radius_ratio_min > 0.1, "{shape:?}");
            mesh
        };
        let volumes = |sizing| {
            let mesh = mesh(MeshSize::EdgeMm(3.5), sizing);
            [0.0..15.0, 19.0..21.0, 28.0..30.0].map(|mm| mean_volume_mm3(&mesh, mm))
        };
        let walls = vec![WallEdge { label: 3, factor: 0.5, reach_mm: 4.0 }];
        let labels = vec![LabelEdge { label: 3, factor: 0.5 }];
        let even = volumes(Sizing::default());
        let at_wall = volumes(Sizing { walls: walls.clone(), ..Sizing::default() });
        let in_label = volumes(Sizing { labels, ..Sizing::default() });
        // Half the edge: an eighth of the volume; grading and the fit to the interface take their part.
        assert!(at_wall[1] < 0.4 * even[1] && at_wall[2] > 0.5 * even[2], "{at_wall:?} against {even:?}");
        assert!(in_label[0] < 0.4 * even[0] && in_label[2] > 0.5 * even[2], "{in_label:?} against {even:?}");
        let count = mesh(MeshSize::Cells(20_000), Sizing { walls, ..Sizing::default() }).tets().len() as f64;
        assert!((count / 20e3 - 1.0).abs() < 0.15, "{count} tets");
    }

    #[test]
    fn refusals_name_the_engine_and_the_remedy() {
        let map = ball_in_shell();
        let refuse =
            |settings: MeshSettings| mesh_labels(&map, &settings, &EnginePrograms::default()).unwrap_err().to_string();
        let default = MeshSettings::default;
        assert!(refuse(MeshSettings { engine: Engine::CGAL, ..default() }).contains("`cgal` is not installed"));
        assert!(refuse(MeshSettings { without: vec![2, 3], ..default() }).contains("no voxel carries a label"));
        assert!(refuse(MeshSettings { size: MeshSize::EdgeMm(-1.0), ..default() }).contains("target edge"));
        assert!(refuse(MeshSettings { size: MeshSize::EdgeMm(0.01), ..default() }).contains("larger edge"));
        assert!(refuse(MeshSettings { size: MeshSize::Cells(0), ..default() }).contains("number of cells"));
        let label = |label, factor| Sizing { labels: vec![LabelEdge { label, factor }], ..Sizing::default() };
        let wall =
            |factor, reach_mm| Sizing { walls: vec![WallEdge { label: 3, factor, reach_mm }], ..Sizing::default() };
        for (sizing, word) in [
            (label(9, 0.5), "one of [2, 3]"),
            (label(2, f64::NAN), "between 0.25 and 4, got NaN"),
            (wall(1.5, 3.0), "the wall of label 3 must be between 0.25 and 1, got 1.5"),
            (wall(0.5, 0.0), "reach"),
        ] {
            let message = refuse(MeshSettings { sizing, ..default() });
            assert!(message.contains(word), "{message}");
        }
    }
}
