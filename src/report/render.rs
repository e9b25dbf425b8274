//! Pictures of meshes without a display: orthographic camera, z-buffer, headlight shading.

use super::colour::Rgb;
use super::picture::Picture;
use crate::mesh::{TetMesh, TriMesh};
use nalgebra::Vector3;

/// Samples along one side of a pixel: 2 x 2 per pixel smooths the outlines.
const OVERSAMPLING: usize = 2;

/// A half space: what lies on the side the normal points to is cut away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutPlane {
    /// A point of the plane, mm.
    pub point_mm: Vector3<f64>,
    /// Normal towards the part cut away.
    pub normal: Vector3<f64>,
}

impl CutPlane {
    /// The plane `axis = at_mm` that cuts away the side of higher (or, with `away < 0`, lower) coordinates.
    pub fn along(axis: usize, at_mm: f64, away: f64) -> Self {
        let mut normal = Vector3::zeros();
        normal[axis] = away.signum();
        let mut point_mm = Vector3::zeros();
        point_mm[axis] = at_mm;
        Self { point_mm, normal }
    }

    fn distance(&self, p: &Vector3<f64>) -> f64 {
        (p - self.point_mm).dot(&self.normal)
    }
}

/// Where the reader stands: orthographic, far away along `from`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Direction from the object to the eye.
    pub from: Vector3<f64>,
    /// Direction that is up in the picture.
    pub up: Vector3<f64>,
}

impl Camera {
    /// A camera by the side it looks from: `left`, `right`, `anterior`, `posterior`, `superior`, `inferior`, or
    /// `left-anterior`, `right-anterior` (both also a little from above). `None` for another word.
    pub fn named(name: &str) -> Option<Self> {
        let z = Vector3::z();
        let (from, up) = match name {
            "left" => (-Vector3::x(), z),
            "right" => (Vector3::x(), z),
            "anterior" => (Vector3::y(), z),
            "posterior" => (-Vector3::y(), z),
            "superior" => (z, Vector3::y()),
            "inferior" => (-z, Vector3::y()),
            "left-anterior" => (Vector3::new(-1.0, 0.8, 0.55), z),
            "right-anterior" => (Vector3::new(1.0, 0.8, 0.55), z),
            _ => return None,
        };
        Some(Self { from, up })
    }

    /// Letters for the left and right side of the picture: what of the patient lies there most.
    pub fn sides(&self) -> [&'static str; 2] {
        let right = self.axes()[0];
        match (right.x.abs() >= right.y.abs(), right.x > 0.0, right.y > 0.0) {
            (true, true, _) => ["L", "R"],
            (true, false, _) => ["R", "L"],
            (false, _, true) => ["P", "A"],
            (false, _, false) => ["A", "P"],
        }
    }

    /// Rows: right, up, towards the eye.
    fn axes(&self) -> [Vector3<f64>; 3] {
        let eye = self.from.normalize();
        let right = self.up.cross(&eye).normalize();
        [right, eye.cross(&right), eye]
    }
}

#[derive(Clone, Copy, Debug)]
struct Corner {
    mm: Vector3<f64>,
    normal: Vector3<f64>,
    colour: [f64; 3],
}

#[derive(Clone, Debug)]
struct SceneTriangle {
    corners: [Corner; 3],
    /// Whether the side opposite to corner n is drawn as a line.
    lines: [bool; 3],
}

/// Triangles to be drawn.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    triangles: Vec<SceneTriangle>,
}

fn float(colour: Rgb) -> [f64; 3] {
    colour.map(f64::from)
}

fn mix(a: &Corner, b: &Corner, t: f64) -> Corner {
    Corner {
        mm: a.mm.lerp(&b.mm, t),
        normal: a.normal.lerp(&b.normal, t),
        colour: std::array::from_fn(|c| a.colour[c] + t * (b.colour[c] - a.colour[c])),
    }
}

/// Area-weighted normals at the nodes of a surface.
pub fn node_normals(surface: &TriMesh) -> Vec<Vector3<f64>> {
    let mut normals = vec![Vector3::zeros(); surface.nodes_mm.len()];
    for (t, triangle) in surface.triangles.iter().enumerate() {
        let area = surface.area_vector_mm2(t);
        for &n in triangle {
            normals[n as usize] += area;
        }
    }
    normals.iter().map(|n| n.try_normalize(0.0).unwrap_or_else(Vector3::z)).collect()
}

impl Scene {
    /// Adds a surface, one colour per node, shaded smoothly, without what `cut` takes away; `lines` draws its edges.
    pub fn add_surface(&mut self, surface: &TriMesh, colours: &[Rgb], cut: Option<&CutPlane>, lines: bool) {
        let normals = node_normals(surface);
        for triangle in &surface.triangles {
            let corners = triangle.map(|n| Corner {
                mm: Vector3::from(surface.nodes_mm[n as usize]),
                normal: normals[n as usize],
                colour: float(colours[n as usize]),
            });
            match cut {
                None => self.triangles.push(SceneTriangle { corners, lines: [lines; 3] }),
                Some(plane) => {
                    // Clipped in the manner of Sutherland and Hodgman, one plane.
                    let mut polygon = Vec::new();
                    for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(a, b)| (&corners[a], &corners[b])) {
                        let (da, db) = (plane.distance(&a.mm), plane.distance(&b.mm));
                        if da <= 0.0 {
                            polygon.push(*a);
                        }
                        if (da < 0.0 && db > 0.0) || (da > 0.0 && db < 0.0) {
                            polygon.push(mix(a, b, da / (da - db)));
                        }
                    }
                    self.add_polygon(&polygon, lines);
                }
            }
        }
    }

    /// Adds the section of a mesh with a plane: one polygon per tetrahedron met, coloured by `colour` (cell number,
    /// position in mm), its outline drawn as a line.
    pub fn add_section(
        &mut self,
        mesh: &TetMesh,
        nodes_mm: &[[f64; 3]],
        plane: &CutPlane,
        colour: impl Fn(usize, [usize; 2], f64) -> Rgb,
    ) {
        let distance: Vec<f64> = nodes_mm.iter().map(|p| plane.distance(&Vector3::from(*p))).collect();
        for (t, tet) in mesh.tets().iter().enumerate() {
            let nodes = tet.map(|n| n as usize);
            let (inside, outside): (Vec<usize>, Vec<usize>) = nodes.into_iter().partition(|&n| distance[n] <= 0.0);
            let crossing = |a: usize, b: usize| {
                let w = distance[a] / (distance[a] - distance[b]);
                Corner {
                    mm: Vector3::from(nodes_mm[a]).lerp(&Vector3::from(nodes_mm[b]), w),
                    normal: plane.normal,
                    colour: float(colour(t, [a, b], w)),
                }
            };
            let polygon: Vec<Corner> = match (inside.as_slice(), outside.as_slice()) {
                (&[a], &[b, c, d]) | (&[b, c, d], &[a]) => vec![crossing(a, b), crossing(a, c), crossing(a, d)],
                (&[a, b], &[c, d]) => vec![crossing(a, c), crossing(a, d), crossing(b, d), crossing(b, c)],
                _ => continue,
            };
            self.add_polygon(&polygon, true);
        }
    }

    fn add_polygon(&mut self, polygon: &[Corner], lines: bool) {
        for n in 2..polygon.len() {
            let last = n + 1 == polygon.len();
            self.triangles.push(SceneTriangle {
                corners: [polygon[0], polygon[n - 1], polygon[n]],
                lines: [lines, lines && last, lines && n == 2],
            });
        }
    }

    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Extent of the scene in a camera's picture, mm: lowest and highest (right, up).
    fn extent_mm(&self, axes: &[Vector3<f64>; 3]) -> [[f64; 2]; 2] {
        let mut extent = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for corner in self.triangles.iter().flat_map(|t| &t.corners) {
            for a in 0..2 {
                let x = corner.mm.dot(&axes[a]);
                extent[0][a] = extent[0][a].min(x);
                extent[1][a] = extent[1][a].max(x);
            }
        }
        extent
    }

    /// Draws the scene on a transparent ground, as large as fits into `width` x `height` with a small margin.
    /// Also returns the scale: mm per pixel. The same scene gives the same bytes.
    pub fn render(&self, camera: &Camera, width: usize, height: usize) -> (Picture, f64) {
        let axes = camera.axes();
        let extent = self.extent_mm(&axes);
        let margin = 4.0;
        let room = [width as f64 - 2.0 * margin, height as f64 - 2.0 * margin];
        let mm_per_pixel = if self.is_empty() {
            1.0
        } else {
            (0..2).map(|a| (extent[1][a] - extent[0][a]) / room[a]).fold(1e-9, f64::max)
        };
        let (w, h) = (width * OVERSAMPLING, height * OVERSAMPLING);
        let scale = OVERSAMPLING as f64 / mm_per_pixel;
        let middle = [0, 1].map(|a| f64::midpoint(extent[0][a], extent[1][a]));
        let mut depth = vec![f32::NEG_INFINITY; w * h];
        let mut colours = vec![[0u8; 3]; w * h];
        for triangle in &self.triangles {
            let screen = triangle.corners.map(|c| {
                let [x, y, z] = axes.map(|axis| c.mm.dot(&axis));
                [(x - middle[0]) * scale + w as f64 / 2.0, h as f64 / 2.0 - (y - middle[1]) * scale, z]
            });
            draw(triangle, &screen, &axes, (w, h), &mut depth, &mut colours);
        }
        (shrink(&depth, &colours, width, height), mm_per_pixel)
    }
}

fn draw(
    triangle: &SceneTriangle,
    screen: &[[f64; 3]; 3],
    axes: &[Vector3<f64>; 3],
    (w, h): (usize, usize),
    depth: &mut [f32],
    colours: &mut [[u8; 3]],
) {
    let [a, b, c] = screen;
    let doubled = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if doubled.abs() < 1e-12 {
        return;
    }
    // Pixels whose centres lie in the triangle's box.
    let range = |k: usize, size: usize| {
        let (low, high) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
        let first = (low - 0.5).ceil().clamp(0.0, size as f64) as usize;
        first..((high - 0.5).floor() + 1.0).clamp(0.0, size as f64) as usize
    };
    let (columns, rows) = (range(0, w), range(1, h));
    // Pixels across the triangle at each corner: distance to the opposite side is weight times height.
    let side = |p: &[f64; 3], q: &[f64; 3]| (q[0] - p[0]).hypot(q[1] - p[1]).max(1e-9);
    let heights = [doubled.abs() / side(b, c), doubled.abs() / side(c, a), doubled.abs() / side(a, b)];
    let lights = triangle.corners.map(|corner| light(&corner.normal, axes));
    for y in rows {
        for x in columns.clone() {
            let p = [x as f64 + 0.5, y as f64 + 0.5];
            let weight =
                |q: &[f64; 3], r: &[f64; 3]| ((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])) / doubled;
            let weights = [weight(b, c), weight(c, a), weight(a, b)];
            if weights.iter().any(|&t| t < 0.0) {
                continue;
            }
            let z = (0..3).map(|n| weights[n] * screen[n][2]).sum::<f64>() as f32;
            let at = x + y * w;
            if z <= depth[at] {
                continue;
            }
            depth[at] = z;
            let near_line =
                (0..3).filter(|&n| triangle.lines[n]).map(|n| weights[n] * heights[n]).fold(f64::INFINITY, f64::min);
            let line = if near_line < 0.8 { 0.55 } else { 1.0 };
            let shade = line * (0..3).map(|n| weights[n] * lights[n]).sum::<f64>();
            colours[at] = std::array::from_fn(|k| {
                let colour: f64 = (0..3).map(|n| weights[n] * triangle.corners[n].colour[k]).sum();
                (colour * shade).round().clamp(0.0, 255.0) as u8
            });
        }
    }
}

/// Two-sided light: a lamp at the eye and a weaker one above it; a surface that faces the eye keeps its colour, so that
/// colours can be read against the bar.
fn light(normal: &Vector3<f64>, axes: &[Vector3<f64>; 3]) -> f64 {
    let facing = normal.dot(&axes[2]).abs();
    let above = (normal.dot(&axes[1]) * normal.dot(&axes[2]).signum()).max(-1.0);
    (0.34 + 0.66 * facing + 0.08 * above * (1.0 - facing)).clamp(0.0, 1.0)
}

/// Averages the samples of every pixel; coverage becomes opacity.
fn shrink(depth: &[f32], colours: &[[u8; 3]], width: usize, height: usize) -> Picture {
    let mut picture = Picture::filled(width, height, [0; 4]);
    let samples = (OVERSAMPLING * OVERSAMPLING) as u32;
    for y in 0..height {
        for x in 0..width {
            let (mut sum, mut covered) = ([0u32; 3], 0u32);
            for s in 0..OVERSAMPLING * OVERSAMPLING {
                let (sx, sy) = (x * OVERSAMPLING + s % OVERSAMPLING, y * OVERSAMPLING + s / OVERSAMPLING);
                let at = sx + sy * width * OVERSAMPLING;
                if depth[at] > f32::NEG_INFINITY {
                    covered += 1;
                    (0..3).for_each(|k| sum[k] += u32::from(colours[at][k]));
                }
            }
            if covered > 0 {
                let [r, g, b] = sum.map(|s| (s / covered) as u8);
                picture.set(x, y, [r, g, b, (covered * 255 / samples) as u8]);
            }
        }
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit cube of five tets, labels 2 (corners) and 3 (the inner tet).
    fn cube() -> TetMesh {
        let nodes = (0..8).map(|n| [f64::from(n & 1), f64::from(n >> 1 & 1), f64::from(n >> 2)]).collect();
        let tets = vec![[1, 0, 2, 4], [1, 2, 3, 7], [1, 4, 7, 5], [2, 7, 6, 4], [1, 2, 7, 4]];
        let tets: Vec<[u32; 4]> = tets;
        TetMesh::new(nodes, fix(&tets), vec![2, 2, 2, 2, 3]).unwrap()
    }

    fn fix(tets: &[[u32; 4]]) -> Vec<[u32; 4]> {
        let at = |n: u32| Vector3::new(f64::from(n & 1), f64::from(n >> 1 & 1), f64::from(n >> 2));
        let positive =
            |t: &[u32; 4]| (at(t[1]) - at(t[0])).cross(&(at(t[2]) - at(t[0]))).dot(&(at(t[3]) - at(t[0]))) > 0.0;
        tets.iter().map(|t| if positive(t) { *t } else { [t[0], t[2], t[1], t[3]] }).collect()
    }

    fn surface(mesh: &TetMesh) -> TriMesh {
        TriMesh::from_facets(mesh.nodes_mm(), &mesh.boundary_facets(|_| true)).0
    }

    fn covered(picture: &Picture) -> usize {
        (0..picture.width * picture.height).filter(|n| picture.rgba[4 * n + 3] == 255).count()
    }

    #[test]
    fn a_cube_seen_from_the_front_fills_the_picture_but_its_margin() {
        let surface = surface(&cube());
        let mut scene = Scene::default();
        scene.add_surface(&surface, &[[200, 100, 50]; 8], None, false);
        let (picture, mm_per_pixel) = scene.render(&Camera::named("anterior").unwrap(), 60, 60);
        assert!((mm_per_pixel - 1.0 / 52.0).abs() < 1e-12);
        assert_eq!(covered(&picture), 52 * 52);
        assert_eq!(picture.at(1, 1), [0; 4]);
        let [r, g, b, a] = picture.at(30, 30);
        assert!(a == 255 && r > g && g > b && r > 100);
    }

    #[test]
    fn the_nearer_surface_hides_the_farther_whatever_the_order() {
        let square = |y: f64| TriMesh {
            nodes_mm: vec![[0.0, y, 0.0], [1.0, y, 0.0], [1.0, y, 1.0], [0.0, y, 1.0]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        let mut pictures = Vec::new();
        for order in [[0.0, 1.0], [1.0, 0.0]] {
            let mut scene = Scene::default();
            for y in order {
                let colour = if y > 0.5 { [0, 255, 0] } else { [255, 0, 0] };
                scene.add_surface(&square(y), &[colour; 4], None, false);
            }
            pictures.push(scene.render(&Camera::named("anterior").unwrap(), 20, 20).0);
        }
        assert_eq!(pictures[0], pictures[1]);
        assert!(pictures[0].at(10, 10)[1] == 255 && pictures[0].at(10, 10)[0] == 0);
    }

    #[test]
    fn a_section_covers_the_area_of_the_cut() {
        let mesh = cube();
        let plane = CutPlane::along(1, 0.5, 1.0);
        let mut scene = Scene::default();
        let label = |t: usize, _: [usize; 2], _: f64| if mesh.labels()[t] == 3 { [0, 0, 255] } else { [255, 0, 0] };
        scene.add_section(&mesh, mesh.nodes_mm(), &plane, label);
        scene.add_surface(&surface(&mesh), &[[9, 9, 9]; 8], Some(&plane), false);
        let (picture, _) = scene.render(&Camera::named("anterior").unwrap(), 108, 108);
        assert_eq!(covered(&picture), 100 * 100);
        // Half of the middle section belongs to the inner tet.
        let inner = (0..108 * 108).filter(|n| picture.rgba[4 * n + 2] > picture.rgba[4 * n]).count();
        assert!((inner as f64 / 5000.0 - 1.0).abs() < 0.05, "{inner}");
    }

    #[test]
    fn clipping_keeps_the_part_behind_the_plane() {
        let mut scene = Scene::default();
        scene.add_surface(&surface(&cube()), &[[9, 9, 9]; 8], Some(&CutPlane::along(2, 0.25, 1.0)), false);
        let extent = scene.extent_mm(&Camera::named("left").unwrap().axes());
        assert!((extent[1][1] - 0.25).abs() < 1e-12 && extent[0][1] == 0.0);
    }

    #[test]
    fn an_empty_scene_is_an_empty_picture() {
        let (picture, _) = Scene::default().render(&Camera::named("left").unwrap(), 8, 8);
        assert_eq!(picture, Picture::filled(8, 8, [0; 4]));
        assert!(Camera::named("sideways").is_none());
    }
}
