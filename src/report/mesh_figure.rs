//! Pictures of tetrahedral meshes: cut views by label, error maps, the preview that stands alone.

use super::colour::{ColourScale, NO_VALUE, Rgb, of_label, tick_label, ticks, viridis};
use super::html::{fixed, number};
use super::lettering;
use super::page::CaptionedPicture;
use super::picture::Picture;
use super::render::{Camera, CutPlane, Scene};
use crate::mesh::{TetMesh, TriMesh};
use crate::segment::label;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::sync::Arc;

/// Pixels of the mesh pictures on the page.
pub const PICTURE: [usize; 2] = [560, 460];

/// A cut view: where the mesh is cut and from where it is seen.
struct CutView {
    axis: usize,
    /// Side that is taken away: +1 the higher coordinates.
    away: f64,
    from: [f64; 3],
    up: [f64; 3],
    name: &'static str,
}

const CUT_VIEWS: [CutView; 3] = [
    CutView { axis: 2, away: 1.0, from: [-0.35, -0.5, 1.0], up: [0.0, 1.0, 0.0], name: "axial" },
    CutView { axis: 1, away: 1.0, from: [-0.4, 1.0, 0.35], up: [0.0, 0.0, 1.0], name: "coronal" },
    CutView { axis: 0, away: -1.0, from: [-1.0, 0.4, 0.35], up: [0.0, 0.0, 1.0], name: "sagittal" },
];

fn axis_letter(axis: usize) -> &'static str {
    ["x", "y", "z"][axis]
}

fn camera(view: &CutView) -> Camera {
    Camera { from: Vector3::from(view.from), up: Vector3::from(view.up) }
}

/// Middle of the mesh, mm: of its bounding box, but beside the midplane, where the falx would hide the inside.
pub fn middle_mm(mesh: &TetMesh) -> [f64; 3] {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in mesh.nodes_mm() {
        for a in 0..3 {
            low[a] = low[a].min(p[a]);
            high[a] = high[a].max(p[a]);
        }
    }
    let mut middle: [f64; 3] = std::array::from_fn(|a| f64::midpoint(low[a], high[a]));
    middle[0] -= 0.07 * (high[0] - low[0]);
    middle
}

/// Three cuts through `at_mm`, cells coloured by label, edges drawn.
pub fn cut_views(mesh: &TetMesh, at_mm: [f64; 3], size: [usize; 2]) -> Vec<CaptionedPicture> {
    let (surface, colours) = labelled_surface(mesh);
    let names = label_names(mesh);
    CUT_VIEWS
        .par_iter()
        .map(|view| {
            let plane = CutPlane::along(view.axis, at_mm[view.axis], view.away);
            let mut scene = Scene::default();
            scene.add_surface(&surface, &colours, Some(&plane), false);
            scene.add_section(mesh, mesh.nodes_mm(), &plane, |tet, _, _| of_label(mesh.labels()[tet]));
            let (picture, _) = scene.render(&camera(view), size[0], size[1]);
            let place = format!("{} = {} mm", axis_letter(view.axis), fixed(at_mm[view.axis], 0));
            CaptionedPicture {
                png: picture.to_png(),
                size,
                caption: format!("{} cut at {place}", capitalised(view.name)),
                description: format!("The mesh cut open at {place}; cells by label: {}", names.join(", ")),
                sides: Some(camera(view).sides()),
            }
        })
        .collect()
}

fn capitalised(word: &str) -> String {
    let mut letters = word.chars();
    letters.next().map(|first| first.to_uppercase().collect::<String>() + letters.as_str()).unwrap_or_default()
}

fn present_labels(mesh: &TetMesh) -> Vec<u8> {
    let mut labels = mesh.labels().to_vec();
    labels.sort_unstable();
    labels.dedup();
    labels
}

/// Colours and names of the labels in a mesh, ascending.
pub fn legend(mesh: &TetMesh) -> Vec<(Rgb, String)> {
    present_labels(mesh).into_iter().map(of_label).zip(label_names(mesh)).collect()
}

/// Names of the labels in a mesh, with underscores as spaces.
fn label_names(mesh: &TetMesh) -> Vec<String> {
    let name = |l: u8| label::name(l).map_or_else(|| format!("label {l}"), |n| n.replace('_', " "));
    present_labels(mesh).into_iter().map(name).collect()
}

/// The outer surface; a node takes the colour of the largest label that touches it on the surface.
fn labelled_surface(mesh: &TetMesh) -> (TriMesh, Vec<Rgb>) {
    let (surface, old) = TriMesh::from_facets(mesh.nodes_mm(), &mesh.boundary_facets(|_| true));
    let mut of_node = vec![0u8; mesh.nodes_mm().len()];
    for (tet, &l) in mesh.tets().iter().zip(mesh.labels()) {
        for &n in tet {
            // Grey matter covers the brain: it wins over the white matter below it.
            let l = if l == label::GREY_MATTER { u8::MAX } else { l };
            of_node[n as usize] = of_node[n as usize].max(l);
        }
    }
    let colour = |n: &u32| match of_node[*n as usize] {
        u8::MAX => of_label(label::GREY_MATTER),
        l => of_label(l),
    };
    let colours = old.iter().map(colour).collect();
    (surface, colours)
}

/// Colours of values: grey where there is none.
fn colours_of(values: &[f64], scale: &ColourScale) -> Vec<Rgb> {
    values.iter().map(|v| if v.is_finite() { scale.colour(*v) } else { NO_VALUE }).collect()
}

/// Pictures of a value per node on a (deformed) mesh: the outer surface from both sides, a coronal cut when the inside
/// has values, and every named facet set that carries values, alone.
pub fn value_views(
    mesh: &TetMesh,
    nodes_mm: &[[f64; 3]],
    values: &[f64],
    scale: &ColourScale,
    sets: &[&str],
    size: [usize; 2],
) -> Vec<CaptionedPicture> {
    let facets = mesh.boundary_facets(|_| true);
    let (surface, old) = TriMesh::from_facets(nodes_mm, &facets);
    let on_surface: Vec<f64> = old.iter().map(|&n| values[n as usize]).collect();
    let mut shots: Vec<Shot> = Vec::new();
    let mut outside = Scene::default();
    outside.add_surface(&surface, &colours_of(&on_surface, scale), None, false);
    let outside = Arc::new(outside);
    for (side, caption) in
        [("left-anterior", "Outer surface from the left"), ("right-anterior", "Outer surface from the right")]
    {
        if let Some(camera) = Camera::named(side) {
            let (scene, caption) = (Arc::clone(&outside), caption.to_owned());
            shots.push(Shot { scene, camera, seen: caption.clone(), caption });
        }
    }
    let inside = values.iter().filter(|v| v.is_finite()).count();
    if inside * 10 > values.len() * 9 {
        let view = &CUT_VIEWS[1];
        let at = middle_mm(mesh)[view.axis];
        let plane = CutPlane::along(view.axis, at, view.away);
        let mut scene = Scene::default();
        scene.add_surface(&surface, &colours_of(&on_surface, scale), Some(&plane), false);
        scene.add_section(mesh, nodes_mm, &plane, |_, [a, b], w| scale.colour(values[a] + w * (values[b] - values[a])));
        let caption = format!("Coronal cut at y = {} mm", fixed(at, 0));
        shots.push(Shot { scene: scene.into(), camera: camera(view), caption, seen: "The mesh cut open".to_owned() });
    }
    for set in sets {
        let Some(facets) = set_facets(mesh, set, &facets) else { continue };
        let (surface, old) = TriMesh::from_facets(nodes_mm, &facets);
        let on_set: Vec<f64> = old.iter().map(|&n| values[n as usize]).collect();
        if on_set.iter().all(|v| !v.is_finite()) {
            continue;
        }
        let mut scene = Scene::default();
        scene.add_surface(&surface, &colours_of(&on_set, scale), None, true);
        // A cavity is seen from its opening, a closed wall from the left.
        let mean: Vector3<f64> = (0..surface.triangles.len()).map(|t| surface.area_vector_mm2(t)).sum();
        let open = mean.norm() > 0.25 * surface.area_mm2();
        let side = if open && mean.x > 0.0 { "right-anterior" } else { "left-anterior" };
        if let Some(camera) = Camera::named(side) {
            let caption = capitalised(&super::page::set_name(set));
            shots.push(Shot { scene: scene.into(), camera, seen: caption.clone(), caption });
        }
    }
    let colours = format!("colours: {} from {} to {}", scale.title, number(scale.low, 3), number(scale.high, 3));
    let shoot = |Shot { scene, camera, caption, seen }: Shot| {
        let (picture, _) = scene.render(&camera, size[0], size[1]);
        let (png, sides) = (picture.to_png(), Some(camera.sides()));
        CaptionedPicture { png, size, caption, description: format!("{seen}, {colours}"), sides }
    };
    shots.into_par_iter().map(shoot).collect()
}

/// A picture that is still to be drawn.
struct Shot {
    scene: Arc<Scene>,
    camera: Camera,
    caption: String,
    /// What is seen, for those who do not see it.
    seen: String,
}

/// Facets of a set: as named, or the boundary facets whose nodes are all in the node set.
pub fn set_facets(mesh: &TetMesh, set: &str, boundary: &[[u32; 3]]) -> Option<Vec<[u32; 3]>> {
    if let Some(facets) = mesh.facet_sets.get(set).filter(|f| !f.is_empty()) {
        return Some(facets.clone());
    }
    let nodes = mesh.node_sets.get(set)?;
    let inside = |f: &&[u32; 3]| f.iter().all(|n| nodes.binary_search(n).is_ok());
    let facets: Vec<[u32; 3]> = boundary.iter().filter(inside).copied().collect();
    (!facets.is_empty()).then_some(facets)
}

/// Paper and ink of pictures that stand alone.
const PAPER: [u8; 4] = [250, 250, 248, 255];
const INK: Rgb = [40, 46, 52];

/// Lays a picture with a transparent ground onto paper.
fn lay(onto: &mut Picture, picture: &Picture, x: usize, y: usize) {
    for row in 0..picture.height {
        for column in 0..picture.width {
            let [r, g, b, a] = picture.at(column, row).map(u32::from);
            if a > 0 && x + column < onto.width && y + row < onto.height {
                let below = onto.at(x + column, y + row).map(u32::from);
                let over = |c: u32, d: u32| ((c * a + d * (255 - a)) / 255) as u8;
                let mixed = [over(r, below[0]), over(g, below[1]), over(b, below[2]), 255];
                onto.set(x + column, y + row, mixed);
            }
        }
    }
}

/// The preview of a mesh: outer surface and three cuts, names of the labels, a bar of 50 mm, as PNG bytes.
///
/// With `values` (one per node, and what they are, with unit) nodes take their colour and a colour bar is drawn.
pub fn preview(mesh: &TetMesh, values: Option<(&[f64], &str)>, width: usize) -> Vec<u8> {
    let half = (width / 2).max(160);
    let cell = [half, half * 4 / 5];
    let foot = 64;
    let mut sheet = Picture::filled(2 * half, 2 * cell[1] + foot, PAPER);
    let scale = values.and_then(|(v, title)| ColourScale::over(v.iter().copied(), title));
    let (surface, plain) = labelled_surface(mesh);
    let (_, old) = TriMesh::from_facets(mesh.nodes_mm(), &mesh.boundary_facets(|_| true));
    let colours = match (&scale, values) {
        (Some(scale), Some((v, _))) => colours_of(&old.iter().map(|&n| v[n as usize]).collect::<Vec<_>>(), scale),
        _ => plain,
    };
    let at_mm = middle_mm(mesh);
    let write_label = |sheet: &mut Picture, text: &str, x: usize, y: usize| {
        lettering::write(sheet, text, [x + 12, y + 12], 2, INK);
    };
    let mut scene = Scene::default();
    scene.add_surface(&surface, &colours, None, true);
    let outer = Camera { from: Vector3::new(-1.0, 0.8, 0.55), up: Vector3::z() };
    let (picture, mm_per_pixel) = scene.render(&outer, cell[0], cell[1]);
    lay(&mut sheet, &picture, 0, 0);
    write_label(&mut sheet, "outer surface", 0, 0);
    let bar = (50.0 / mm_per_pixel).round() as usize;
    for x in 12..(12 + bar).min(half) {
        (0..3).for_each(|y| sheet.set(x, cell[1] - 14 + y, [INK[0], INK[1], INK[2], 255]));
    }
    lettering::write(&mut sheet, "50 mm", [12, cell[1] - 34], 2, INK);
    for (n, view) in CUT_VIEWS.iter().enumerate() {
        let plane = CutPlane::along(view.axis, at_mm[view.axis], view.away);
        let mut scene = Scene::default();
        scene.add_surface(&surface, &colours, Some(&plane), false);
        scene.add_section(mesh, mesh.nodes_mm(), &plane, |tet, [a, b], w| match (&scale, values) {
            (Some(scale), Some((v, _))) => scale.colour(v[a] + w * (v[b] - v[a])),
            _ => of_label(mesh.labels()[tet]),
        });
        let (picture, _) = scene.render(&camera(view), cell[0], cell[1]);
        let (x, y) = ((n + 1) % 2 * half, n.div_ceil(2).min(1) * cell[1]);
        lay(&mut sheet, &picture, x, y);
        let text = format!("{} = {:.0} mm", axis_letter(view.axis), at_mm[view.axis]);
        write_label(&mut sheet, &text, x, y);
    }
    let top = 2 * cell[1] + 18;
    match &scale {
        Some(scale) => draw_bar(&mut sheet, scale, [12, top]),
        None => draw_legend(&mut sheet, mesh, [12, top]),
    }
    sheet.to_png()
}

fn draw_legend(sheet: &mut Picture, mesh: &TetMesh, [mut x, y]: [usize; 2]) {
    for ([r, g, b], name) in legend(mesh) {
        sheet.paste(&Picture::filled(18, 18, [r, g, b, 255]), x, y - 2);
        lettering::write(sheet, &name, [x + 26, y], 2, INK);
        x += 26 + lettering::width(&name, 2) + 28;
    }
    let count = format!("{} nodes, {} tetrahedra", mesh.nodes_mm().len(), mesh.tets().len());
    lettering::write(sheet, &count, [12, y + 24], 2, INK);
}

fn draw_bar(sheet: &mut Picture, scale: &ColourScale, [x, y]: [usize; 2]) {
    let length = sheet.width / 2;
    for dx in 0..length {
        let [r, g, b] = viridis(dx as f64 / (length - 1) as f64);
        (0..14).for_each(|dy| sheet.set(x + dx, y + dy, [r, g, b, 255]));
    }
    lettering::write(sheet, &scale.title, [x + length + 16, y], 2, INK);
    let step = ticks(scale.low, scale.high, 4).windows(2).map(|w| w[1] - w[0]).next().unwrap_or(1.0);
    let span = scale.high - scale.low;
    let inner = ticks(scale.low, scale.high, 4);
    let inner = inner.into_iter().filter(|v| v - scale.low > 0.15 * span && scale.high - v > 0.15 * span);
    let ends = [(scale.low, format!("{:.2}", scale.low)), (scale.high, format!("{:.2}", scale.high))];
    for (value, text) in inner.map(|v| (v, tick_label(v, step))).chain(ends) {
        let at = if span > 0.0 { ((value - scale.low) / span * (length - 1) as f64) as usize } else { 0 };
        let half = lettering::width(&text, 2) / 2;
        (0..5).for_each(|dy| sheet.set(x + at, y + 14 + dy, [INK[0], INK[1], INK[2], 255]));
        lettering::write(sheet, &text, [(x + at).saturating_sub(half).max(x), y + 22], 2, INK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_tets() -> TetMesh {
        let nodes = vec![[0.0, 0.0, 0.0], [50.0, 0.0, 0.0], [0.0, 50.0, 0.0], [0.0, 0.0, 50.0], [50.0, 50.0, 50.0]];
        let mut mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4]], vec![2, 3]).unwrap();
        mesh.set_nodes("margin", vec![1, 2, 4]).unwrap();
        mesh
    }

    #[test]
    fn a_set_without_facets_takes_them_from_its_nodes() {
        let mesh = two_tets();
        let boundary = mesh.boundary_facets(|_| true);
        let facets = set_facets(&mesh, "margin", &boundary).unwrap();
        assert_eq!(facets.len(), 1);
        assert!(set_facets(&mesh, "falx", &boundary).is_none());
    }

    #[test]
    fn sets_without_values_are_not_shown_and_the_cut_needs_inner_values() {
        let mesh = two_tets();
        let nan = f64::NAN;
        let values = [nan, 1.0, 2.0, nan, 3.0];
        let scale = ColourScale::over(values, "error (mm)").unwrap();
        let views = value_views(&mesh, mesh.nodes_mm(), &values, &scale, &["margin", "falx"], [40, 30]);
        let captions: Vec<&str> = views.iter().map(|v| v.caption.as_str()).collect();
        assert_eq!(captions, ["Outer surface from the left", "Outer surface from the right", "Resection margin"]);
        assert!(views[0].description.contains("from 1.00 to 3.00"));
        let all = [1.0; 5];
        let scale = ColourScale::over(all, "error (mm)").unwrap();
        assert_eq!(value_views(&mesh, mesh.nodes_mm(), &all, &scale, &[], [40, 30]).len(), 3);
    }

    #[test]
    fn previews_are_the_same_bytes_twice_and_differ_with_values() {
        let mesh = two_tets();
        let plain = preview(&mesh, None, 400);
        assert_eq!(plain, preview(&mesh, None, 400));
        assert_ne!(plain, preview(&mesh, Some((&[0.0, 1.0, 2.0, 3.0, 4.0], "displacement (mm)")), 400));
        assert_eq!(cut_views(&mesh, [10.0; 3], [60, 50]).len(), 3);
    }
}
