use super::*;
use std::collections::BTreeMap as Map;

/// An ellipsoid of a brain's size in the MNI frame on a lattice of cubes of `h_mm`, each cut in six: grey matter with
/// a ventricle inside and, if asked, a resected lump at the left temporal pole.
fn ellipsoid_brain(h_mm: f64, offset_mm: f64, resected: bool) -> TetMesh {
    let centre = Vector3::new(0.0, -16.0, 5.0);
    let radii = Vector3::new(71.0, 90.0, 76.5);
    let label_at = |p: Vector3<f64>| {
        let inside = |q: Vector3<f64>, r: Vector3<f64>| (p - q).component_div(&r).norm() < 1.0;
        let ventricle = inside(Vector3::new(15.0, -16.0, 10.0), Vector3::new(12.0, 35.0, 12.0));
        let lump = inside(Vector3::new(-50.0, 10.0, -25.0), Vector3::repeat(22.0));
        match (inside(centre, radii), ventricle, lump && resected) {
            (false, ..) => None,
            (_, true, _) => Some(label::VENTRICLE),
            (_, _, true) => Some(label::RESECTED),
            _ => Some(label::GREY_MATTER),
        }
    };
    let n = (220.0 / h_mm) as i32;
    let orders = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]];
    let mut number: Map<[i32; 3], u32> = Map::new();
    let (mut nodes, mut tets, mut labels) = (Vec::new(), Vec::new(), Vec::new());
    let place = |at: [i32; 3]| {
        let step = at.map(|c| f64::from(c - n / 2) * h_mm);
        Vector3::new(step[0] + offset_mm, step[1] - 16.0, step[2] + 5.0)
    };
    for k in 0..n {
        for j in 0..n {
            for i in 0..n {
                for (o, order) in orders.iter().enumerate() {
                    let mut at = [i, j, k];
                    let mut corners = [at; 4];
                    for (step, &axis) in order.iter().enumerate() {
                        at[axis] += 1;
                        corners[step + 1] = at;
                    }
                    if o >= 3 {
                        corners.swap(2, 3);
                    }
                    let centroid = corners.iter().map(|&c| place(c)).sum::<Vector3<f64>>() / 4.0;
                    let Some(label) = label_at(centroid) else { continue };
                    tets.push(corners.map(|c| {
                        *number.entry(c).or_insert_with(|| {
                            nodes.push(place(c).into());
                            nodes.len() as u32 - 1
                        })
                    }));
                    labels.push(label);
                }
            }
        }
    }
    TetMesh::new(nodes, tets, labels).unwrap()
}

fn settings() -> TagSettings {
    // The staircase of a lattice has no oblique facets, so its areas are not those of the ellipsoid.
    TagSettings { plausible_area_mm2: Map::new(), ..TagSettings::default() }
}

fn facets_enclose(mesh: &TetMesh, sets: &[&str], extra: &[[u32; 3]]) -> f64 {
    let facets = sets.iter().flat_map(|s| mesh.facet_sets[*s].clone()).chain(extra.iter().copied());
    facets.map(|f| mesh.area_vector_mm2(f).dot(&Vector3::from(mesh.facet_centroid_mm(f))) / 3.0).sum()
}

#[test]
fn the_wall_and_the_margin_close_around_what_was_taken_out() {
    let mut mesh = ellipsoid_brain(8.0, 0.0, true);
    tag_boundary_sets(&mut mesh, &settings()).unwrap();
    let volume = |label: u8| -> f64 {
        (0..mesh.tets().len()).filter(|&t| mesh.labels()[t] == label).map(|t| mesh.volume_mm3(t)).sum()
    };
    // Facets point out of the tissue, so into the ventricle: the volume they enclose is negative.
    assert!((facets_enclose(&mesh, &[VENTRICLE], &[]) + volume(label::VENTRICLE)).abs() < 1e-6);
    // The lump reaches the pial surface: margin and its own outer facets close it, and no outer facet is margin.
    let outer = mesh.boundary_facets(|_| true);
    let lump = mesh.boundary_facets(|l| l == label::RESECTED);
    let on_outside: Vec<_> = lump.iter().filter(|f| outer.contains(f)).map(|[a, b, c]| [*a, *c, *b]).collect();
    assert!(!on_outside.is_empty());
    assert!((facets_enclose(&mesh, &[MARGIN], &on_outside) + volume(label::RESECTED)).abs() < 1e-6);
    assert_eq!(mesh.facet_sets[MARGIN].len() + on_outside.len(), lump.len());
}

#[test]
fn sets_survive_the_removal_of_ventricle_and_resected_tissue() {
    let mut mesh = ellipsoid_brain(8.0, 0.0, true);
    let report = tag_boundary_sets(&mut mesh, &settings()).unwrap();
    let (tissue, _) = mesh.restricted(is_tissue).unwrap();
    let outer = tissue.boundary_facets(|_| true);
    for set in [VENTRICLE, MARGIN, BASE, SUPERIOR] {
        let facets = &tissue.facet_sets[set];
        assert_eq!((facets.len(), tissue.node_sets[set].len()), {
            let reported = report.set(set).unwrap();
            (reported.facets, reported.nodes)
        });
        let same = |a: &[u32; 3], b: &[u32; 3]| (0..3).any(|s| [a[s], a[(s + 1) % 3], a[(s + 2) % 3]] == *b);
        assert!(facets.iter().take(50).all(|f| outer.iter().any(|o| same(o, f))), "{set} is not on the outside");
    }
}

#[test]
fn sets_of_a_part_are_what_the_part_has_and_of_the_whole_what_was_tagged() {
    let mut mesh = ellipsoid_brain(8.0, 0.0, false);
    let tags = settings();
    let report = tag_boundary_sets(&mut mesh, &tags).unwrap();
    assert_eq!(report.clone().of_part(&mesh, &tags), report);
    // The left half.
    let of_left = |tet: &[u32; 4]| tet.iter().map(|&n| mesh.nodes_mm()[n as usize][0]).sum::<f64>() < 0.0;
    let labels = mesh.tets().iter().map(|tet| u8::from(of_left(tet))).collect();
    let mut halves = TetMesh::new(mesh.nodes_mm().to_vec(), mesh.tets().to_vec(), labels).unwrap();
    (halves.node_sets, halves.facet_sets) = (mesh.node_sets.clone(), mesh.facet_sets.clone());
    let (left, _) = halves.restricted(|l| l == 1).unwrap();
    let ranges = TagSettings { plausible_area_mm2: Map::from([(BASE.to_owned(), [0.0, 1.0])]), ..settings() };
    let of_left = report.clone().of_part(&left, &ranges);
    let (whole, half) = (report.set(BASE).unwrap(), of_left.set(BASE).unwrap());
    assert!((0.4..0.6).contains(&(half.area_mm2 / whole.area_mm2)), "{} {}", half.area_mm2, whole.area_mm2);
    assert_eq!((half.nodes, half.facets), (left.node_sets[BASE].len(), left.facet_sets[BASE].len()));
    assert!(half.centroid_mm[0] < -5.0 && !half.plausible && of_left.warnings.len() == 1);
}

#[test]
fn a_hole_within_the_brain_is_neither_base_nor_top() {
    let solid = ellipsoid_brain(8.0, 0.0, false);
    // Deep enough for the floor of a hole to lie within the top.
    let tags = TagSettings { superior_depth_mm: 60.0, ..settings() };
    let hollow = |centre: [f64; 3], beside: Option<u8>| {
        let apart = |tet: &[u32; 4]| {
            let middle = tet.iter().map(|&n| Vector3::from(solid.nodes_mm()[n as usize])).sum::<Vector3<f64>>() / 4.0;
            (middle - Vector3::from(centre)).norm() > 12.0
        };
        let kept: Vec<usize> = (0..solid.tets().len()).filter(|&t| apart(&solid.tets()[t])).collect();
        // What lies to one side of the hole within reach has another label: the tissue of its wall has a rim there.
        let label_of = |t: usize| {
            let middle =
                solid.tets()[t].iter().map(|&n| Vector3::from(solid.nodes_mm()[n as usize])).sum::<Vector3<f64>>()
                    / 4.0;
            let way = middle - Vector3::from(centre);
            beside.filter(|_| way.norm() < 17.0 && way.x < -4.0).unwrap_or(solid.labels()[t])
        };
        let (tets, labels): (_, Vec<u8>) = kept.iter().map(|&t| (solid.tets()[t], label_of(t))).unzip();
        let relabelled = kept.iter().zip(&labels).filter(|&(&t, &l)| solid.labels()[t] != l).count();
        assert_eq!(relabelled > 0, beside.is_some());
        let mut mesh = TetMesh::new(solid.nodes_mm().to_vec(), tets, labels).unwrap();
        let report = tag_boundary_sets(&mut mesh, &tags).unwrap();
        [BASE, SUPERIOR].map(|set| report.set(set).unwrap().facets)
    };
    let mut whole = solid.clone();
    let report = tag_boundary_sets(&mut whole, &tags).unwrap();
    let facets = [BASE, SUPERIOR].map(|set| report.set(set).unwrap().facets);
    // Low in the back, and high.
    for beside in [None, Some(label::VENTRICLE), Some(label::RESECTED)] {
        assert_eq!(hollow([-20.0, -40.0, -40.0], beside), facets, "{beside:?}");
        assert_eq!(hollow([-20.0, -20.0, 50.0], beside), facets, "{beside:?}");
    }
}

#[test]
fn a_lattice_with_nodes_in_the_plane_gets_a_sheet_and_any_other_a_slab() {
    let mut conforming = ellipsoid_brain(8.0, 0.0, false);
    let mut shifted = ellipsoid_brain(8.0, 3.0, false);
    let sheet = tag_boundary_sets(&mut conforming, &settings()).unwrap();
    let slab = tag_boundary_sets(&mut shifted, &settings()).unwrap();
    let (sheet, slab) = (sheet.set(FALX).unwrap(), slab.set(FALX).unwrap());
    assert_eq!((sheet.form, slab.form), (SetForm::Sheet, SetForm::Slab));
    assert!(sheet.facets > 0 && slab.facets == 0 && slab.nodes > 0);
    assert!((sheet.area_mm2 / slab.area_mm2 - 1.0).abs() < 0.08, "{} {}", sheet.area_mm2, slab.area_mm2);
    assert!(conforming.node_sets[FALX].iter().all(|&n| conforming.nodes_mm()[n as usize][0] == 0.0));
}

#[test]
fn a_hemisphere_lies_against_the_falx_where_a_sulcus_opens_on_the_other_side() {
    let mut whole = ellipsoid_brain(8.0, 0.0, false);
    let sulcus = |t: &usize| {
        let centre =
            whole.tets()[*t].iter().map(|&n| Vector3::from(whole.nodes_mm()[n as usize])).sum::<Vector3<f64>>() / 4.0;
        (0.0..16.0).contains(&centre.x) && (centre.yz() - nalgebra::Vector2::new(-10.0, 65.0)).norm() < 12.0
    };
    let kept: Vec<usize> = (0..whole.tets().len()).filter(|t| !sulcus(t)).collect();
    assert!(kept.len() < whole.tets().len());
    let (tets, labels) = kept.iter().map(|&t| (whole.tets()[t], whole.labels()[t])).unzip();
    let mut open = TetMesh::new(whole.nodes_mm().to_vec(), tets, labels).unwrap();
    let area = |mesh: &mut TetMesh| {
        let area_mm2 = tag_boundary_sets(mesh, &settings()).unwrap().set(FALX).unwrap().area_mm2;
        let seen = |&facet: &[u32; 3]| mesh.area_vector_mm2(facet).x;
        assert!(
            (mesh.facet_sets[FALX].iter().map(seen).sum::<f64>() - area_mm2).abs() < 1e-6,
            "all are seen from the right"
        );
        area_mm2
    };
    assert!((area(&mut whole) - area(&mut open)).abs() < 1e-6);
}

#[test]
fn facets_left_by_the_engine_make_the_sheet() {
    let mut mesh = ellipsoid_brain(8.0, 3.0, false);
    let left = |f: &[u32; 3]| f.iter().all(|&n| (mesh.nodes_mm()[n as usize][0] - 3.0).abs() < 1e-9);
    let sheet: Vec<_> = mesh.facets().into_iter().filter(|f| f.2.is_some()).map(|f| f.0).filter(left).collect();
    mesh.facet_sets.insert(MIDSAGITTAL.into(), sheet);
    let report = tag_boundary_sets(&mut mesh, &settings()).unwrap();
    assert_eq!(report.set(FALX).unwrap().form, SetForm::Sheet);
    assert!(!mesh.facet_sets.contains_key(MIDSAGITTAL));
}

#[test]
fn falx_and_tentorium_leave_the_ventricle_wall_free() {
    let mut mesh = ellipsoid_brain(8.0, 3.0, false);
    tag_boundary_sets(&mut mesh, &TagSettings { tentorium: true, ..settings() }).unwrap();
    for set in [FALX, TENTORIUM] {
        assert!(!mesh.node_sets[set].is_empty());
        assert!(mesh.node_sets[set].iter().all(|n| mesh.node_sets[VENTRICLE].binary_search(n).is_err()));
    }
    assert!(mesh.node_sets[SUPERIOR].iter().all(|n| mesh.node_sets[FALX].binary_search(n).is_err()));
}

#[test]
fn landmarks_move_with_the_atlas_fit() {
    let shift = 9.0;
    let mut there = ellipsoid_brain(8.0, 3.0, false);
    let moved = there.nodes_mm().iter().map(|p| [p[0], p[1] + shift, p[2]]).collect();
    let mut moved = TetMesh::new(moved, there.tets().to_vec(), there.labels().to_vec()).unwrap();
    tag_boundary_sets(&mut there, &settings()).unwrap();
    tag_boundary_sets_with(&mut moved, &settings(), |[x, y, z]| [x, y - shift, z]).unwrap();
    assert_eq!(there.node_sets, moved.node_sets);
}

#[test]
fn an_area_out_of_range_is_a_warning_and_an_empty_set_an_error() {
    let mut mesh = ellipsoid_brain(10.0, 0.0, false);
    let mut ranges = TagSettings::default();
    ranges.plausible_area_mm2.insert(SUPERIOR.into(), [1.0, 2.0]);
    ranges.plausible_area_mm2.retain(|name, _| name == SUPERIOR);
    let report = tag_boundary_sets(&mut mesh, &ranges).unwrap();
    assert!(!report.set(SUPERIOR).unwrap().plausible && report.set(BASE).unwrap().plausible);
    assert!(report.warnings.len() == 1 && report.warnings[0].to_string().contains("`superior`"));

    let high = mesh.nodes_mm().iter().map(|p| [p[0] + 300.0, p[1], p[2] + 300.0]).collect();
    let mut elsewhere = TetMesh::new(high, mesh.tets().to_vec(), mesh.labels().to_vec()).unwrap();
    let message = tag_boundary_sets(&mut elsewhere, &settings()).unwrap_err().to_string();
    assert!(message.contains("`falx`") && message.contains("MNI frame"), "{message}");

    let only = TetMesh::new(mesh.nodes_mm().to_vec(), mesh.tets()[..1].to_vec(), vec![label::VENTRICLE]);
    assert_eq!(tag_boundary_sets(&mut only.unwrap(), &settings()), Err(TagError::NoTissue));
}
