//! Named node and facet sets of a brain mesh: ventricle wall, falx, base, superior load patch, resection margin.
//!
//! The mesh is in the MNI-rigid frame (mm, RAS+, sizes the patient's own) and still carries the ventricle and the
//! resected tissue as labels, so that their walls conform. Tissue is everything else: sets lie on tissue only, and
//! survive `TetMesh::restricted` to it. Load and compare by facet area, never by node count: areas hardly change
//! with resolution, counts do.

mod fissure;
mod landmark;
mod midline;
mod section;
mod void;

use crate::mesh::TetMesh;
use crate::mesh::engine::MidplaneSplit;
use crate::segment::label;
pub use fissure::with_closed_fissure;
use landmark::{above_falx_edge, above_tentorium_mm, below_base_line};
pub use midline::Midline;
use nalgebra::Vector3;
use schemars::JsonSchema;
use section::midsagittal_cut;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use thiserror::Error;
pub(crate) use void::without_voids;

/// Held: where the brain rests on the skull, and the cut brainstem.
pub const BASE: &str = "base";
/// Held: the falx cerebri.
pub const FALX: &str = "falx";
/// Compared: the wall of the ventricles.
pub const VENTRICLE: &str = "ventricle";
/// Loaded: the top of the brain.
pub const SUPERIOR: &str = "superior";
/// Compared: the wall that removing the resected tissue lays bare.
pub const MARGIN: &str = "margin";
/// Held, as an option: the tentorium cerebelli.
pub const TENTORIUM: &str = "tentorium";
/// All of them.
pub const SETS: [&str; 6] = [BASE, FALX, VENTRICLE, SUPERIOR, MARGIN, TENTORIUM];
/// A facet set that meshing leaves where labels were split: used up by tagging.
pub use crate::mesh::engine::MIDSAGITTAL;

/// Facets this close to x = 0 with all nodes lie in the midsagittal plane, mm.
const IN_PLANE_MM: f64 = 1e-3;

/// What to tag and how. The defaults are those of the MNI152 template.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TagSettings {
    /// Tag the falx.
    pub falx: bool,
    /// Tag the tentorium.
    pub tentorium: bool,
    /// Half thickness of falx and tentorium where they are slabs of nodes, mm; half the median edge length if larger.
    pub slab_half_width_mm: f64,
    /// The base looks down at least this much: z of the outward unit normal.
    pub base_normal_z: f64,
    /// The cut through the brainstem: this far above the lowest node, mm.
    pub brainstem_cut_mm: f64,
    /// The superior patch looks up at least this much: z of the outward unit normal.
    pub superior_normal_z: f64,
    /// The superior patch reaches down this far from the highest node, mm.
    pub superior_depth_mm: f64,
    /// Areas, mm2, between which a set is believed. Ranges of adult brains around the template's own figures
    /// (ventricle 7.5e3, falx 4.4e3, base 1.3e4, superior 9.1e3): half to double, wider for ventricles and cavities.
    pub plausible_area_mm2: BTreeMap<String, [f64; 2]>,
}

impl Default for TagSettings {
    fn default() -> Self {
        let ranges = [
            (VENTRICLE, [2e3, 4e4]),
            (FALX, [2.2e3, 9e3]),
            (BASE, [6e3, 2.6e4]),
            (SUPERIOR, [4.5e3, 1.8e4]),
            (MARGIN, [1e2, 3e4]),
            (TENTORIUM, [1e3, 1e4]),
        ];
        Self {
            falx: true,
            tentorium: false,
            slab_half_width_mm: 2.0,
            base_normal_z: -0.5,
            brainstem_cut_mm: 3.0,
            superior_normal_z: 0.6,
            superior_depth_mm: 20.0,
            plausible_area_mm2: ranges.map(|(name, range)| (name.to_owned(), range)).into(),
        }
    }
}

/// The sheet that a mesh in the MNI frame must conform to for the falx to be one: grey and white matter cut at x = 0 above
/// the free edge.
pub fn falx_sheet() -> MidplaneSplit {
    MidplaneSplit { labels: vec![label::GREY_MATTER, label::WHITE_MATTER], above_yz_mm: landmark::FALX_EDGE.to_vec() }
}

/// How a set is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SetForm {
    /// Facets of a surface of the tissue, and their nodes.
    Surface,
    /// Facets inside the tissue that conform to the sheet, and their nodes.
    Sheet,
    /// Nodes near the sheet; the area is that of the sheet within the tissue.
    Slab,
}

/// One set as tagged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetReport {
    /// Its name in the mesh.
    pub name: String,
    /// How it is made.
    pub form: SetForm,
    /// Nodes in it.
    pub nodes: usize,
    /// Facets in it.
    pub facets: usize,
    /// Its area, mm2.
    pub area_mm2: f64,
    /// Its centroid by area, mm.
    pub centroid_mm: [f64; 3],
    /// Whether the area is in the range of the settings; a set without a range is believed.
    pub plausible: bool,
}

/// All sets as tagged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TagReport {
    /// The sets in order of name.
    pub sets: Vec<SetReport>,
    /// Median edge length of the mesh, mm.
    pub median_edge_mm: f64,
    /// Each set that is not to be believed: reason enough for the quality gate to refuse.
    pub warnings: Vec<TagWarning>,
}

impl TagReport {
    /// The report of one set.
    pub fn set(&self, name: &str) -> Option<&SetReport> {
        self.sets.iter().find(|set| set.name == name)
    }

    /// The same of a part of the mesh: sets that have lost nodes or facets with the rest are measured again. (What a slab of
    /// nodes is the area of goes with the tissue: it stays.)
    #[must_use]
    pub fn of_part(mut self, part: &TetMesh, settings: &TagSettings) -> Self {
        for set in &mut self.sets {
            let facets = part.facet_sets.get(&set.name).map_or(&[][..], Vec::as_slice);
            set.nodes = part.node_sets.get(&set.name).map_or(0, Vec::len);
            if facets.len() < set.facets {
                let moment = Moment::of(part, facets);
                (set.facets, set.area_mm2, set.centroid_mm) = (facets.len(), moment.area_mm2, moment.centroid_mm());
            }
        }
        self.warnings = implausible(&mut self.sets, settings);
        self
    }
}

/// Why a set is not to be believed.
#[derive(Clone, Debug, Error, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum TagWarning {
    #[error(
        "boundary set `{set}` has {area_mm2:.0} mm2; adult brains have {low_mm2:.0} to {high_mm2:.0}: check the registration to \
         MNI and the segmentation around it before believing the simulation"
    )]
    Area { set: String, area_mm2: f64, low_mm2: f64, high_mm2: f64 },
}

/// Why a mesh cannot be tagged.
#[derive(Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum TagError {
    #[error(
        "the mesh has no tissue: every cell is ventricle ({}) or resected ({}); check the label map",
        label::VENTRICLE,
        label::RESECTED
    )]
    NoTissue,
    #[error(
        "boundary set `{set}` is empty: {reason}. The mesh spans {low_mm:.0?} to {high_mm:.0?} mm; boundary sets need \
         the MNI frame (rigid), RAS+, mm: check the registration to the template and the segmentation, or do without \
         them"
    )]
    Empty { set: String, reason: &'static str, low_mm: [f64; 3], high_mm: [f64; 3] },
}

/// Tags `mesh` by the landmarks of the MNI152 template where they are: see [`tag_boundary_sets_with`].
///
/// # Errors
/// [`TagError`] when the mesh has no tissue or a set that every brain has comes out empty.
pub fn tag_boundary_sets(mesh: &mut TetMesh, settings: &TagSettings) -> Result<TagReport, TagError> {
    tag_boundary_sets_with(mesh, settings, |position_mm| position_mm)
}

/// Adds the node and facet sets to `mesh`: [`BASE`], [`FALX`], [`VENTRICLE`], [`SUPERIOR`], [`MARGIN`] and, as an
/// option, [`TENTORIUM`]; [`VENTRICLE`] and [`MARGIN`] only where the mesh has those labels.
/// `template_from_mesh` carries a position (mm) to where it lies in the template, for meshes of patients whose atlas
/// fit is known; heights at the very top and bottom and normals are taken in the mesh itself.
///
/// Facets point out of the tissue. The falx is a sheet of facets when the mesh has facets in the midsagittal plane
/// (facet set [`MIDSAGITTAL`], or facets between tissue with all nodes at x = 0, and outer facets there) over at least half
/// of the cut of the plane with the tissue above the free edge; otherwise it is a slab of nodes.
///
/// # Errors
/// [`TagError`] when the mesh has no tissue or a set that every brain has comes out empty. An area out of its
/// plausible range is a warning in the report.
pub fn tag_boundary_sets_with(
    mesh: &mut TetMesh,
    settings: &TagSettings,
    template_from_mesh: impl Fn([f64; 3]) -> [f64; 3],
) -> Result<TagReport, TagError> {
    let surfaces = Surfaces::of(mesh)?;
    let median_edge_mm = mesh.median_edge_mm();
    let slab_mm = settings.slab_half_width_mm.max(median_edge_mm / 2.0);
    let midsagittal = mesh.facet_sets.remove(MIDSAGITTAL);
    let mut tagger = Tagger { mesh, settings, surfaces, template_from_mesh, sets: Vec::new() };
    if tagger.mesh.labels().contains(&label::VENTRICLE) {
        let wall = tagger.surfaces.ventricle.clone();
        tagger.add_surface(VENTRICLE, wall, "no ventricle cell touches tissue")?;
    }
    if tagger.mesh.labels().contains(&label::RESECTED) {
        let margin = tagger.surfaces.margin.clone();
        tagger.add_surface(MARGIN, margin, "no resected cell touches tissue")?;
    }
    if settings.falx {
        tagger.add_falx(midsagittal, slab_mm)?;
    }
    if settings.tentorium {
        tagger.add_tentorium(slab_mm)?;
    }
    tagger.add_base()?;
    tagger.add_superior()?;

    let mut sets = tagger.sets;
    sets.sort_by(|a, b| a.name.cmp(&b.name));
    let warnings = implausible(&mut sets, settings);
    Ok(TagReport { sets, median_edge_mm, warnings })
}

/// Marks the sets whose area is not to be believed, and says so of each.
fn implausible(sets: &mut [SetReport], settings: &TagSettings) -> Vec<TagWarning> {
    let mut warnings = Vec::new();
    for set in sets {
        let Some(&[low, high]) = settings.plausible_area_mm2.get(&set.name) else { continue };
        set.plausible = (low..=high).contains(&set.area_mm2);
        if !set.plausible {
            let (set, area_mm2) = (set.name.clone(), set.area_mm2);
            warnings.push(TagWarning::Area { set, area_mm2, low_mm2: low, high_mm2: high });
        }
    }
    warnings
}

fn is_midsagittal(mesh: &TetMesh, facet: &[u32; 3]) -> bool {
    facet.iter().all(|&n| mesh.nodes_mm()[n as usize][0].abs() <= IN_PLANE_MM)
}

fn is_tissue(label: u8) -> bool {
    label != label::VENTRICLE && label != label::RESECTED
}

/// The facets around and between tissue, pointing out of it.
struct Surfaces {
    pial: Vec<[u32; 3]>,
    /// The same without the walls of holes within.
    outer: Vec<[u32; 3]>,
    ventricle: Vec<[u32; 3]>,
    margin: Vec<[u32; 3]>,
    /// Facets between two tissue cells with all nodes in the midsagittal plane.
    in_plane: Vec<[u32; 3]>,
    /// Whether each node belongs to tissue.
    tissue_nodes: Vec<bool>,
    low_mm: [f64; 3],
    high_mm: [f64; 3],
}

impl Surfaces {
    fn of(mesh: &TetMesh) -> Result<Self, TagError> {
        let nodes = mesh.nodes_mm();
        let mut surfaces = Self {
            pial: Vec::new(),
            outer: Vec::new(),
            ventricle: Vec::new(),
            margin: Vec::new(),
            in_plane: Vec::new(),
            tissue_nodes: vec![false; nodes.len()],
            low_mm: [f64::INFINITY; 3],
            high_mm: [f64::NEG_INFINITY; 3],
        };
        for (tet, _) in mesh.tets().iter().zip(mesh.labels()).filter(|(_, label)| is_tissue(**label)) {
            for &n in tet {
                surfaces.tissue_nodes[n as usize] = true;
                for (axis, &x) in nodes[n as usize].iter().enumerate() {
                    surfaces.low_mm[axis] = surfaces.low_mm[axis].min(x);
                    surfaces.high_mm[axis] = surfaces.high_mm[axis].max(x);
                }
            }
        }
        if !surfaces.tissue_nodes.contains(&true) {
            return Err(TagError::NoTissue);
        }
        for (facet, first, second) in mesh.facets() {
            let [a, b, c] = facet;
            let labels = (mesh.labels()[first], second.map(|t| mesh.labels()[t]));
            match labels {
                (own, None) if is_tissue(own) => surfaces.pial.push(facet),
                (own, Some(other)) => match (is_tissue(own), is_tissue(other)) {
                    (true, true) => {
                        if is_midsagittal(mesh, &facet) {
                            surfaces.in_plane.push(facet);
                        }
                    }
                    (true, false) => surfaces.exposed(other).push(facet),
                    (false, true) => surfaces.exposed(own).push([a, c, b]),
                    (false, false) => {}
                },
                (_, None) => {}
            }
        }
        surfaces.outer = without_voids(mesh, &surfaces.pial);
        Ok(surfaces)
    }

    /// The surface that removing cells of this label exposes.
    fn exposed(&mut self, label: u8) -> &mut Vec<[u32; 3]> {
        if label == label::VENTRICLE { &mut self.ventricle } else { &mut self.margin }
    }
}

struct Tagger<'a, T> {
    mesh: &'a mut TetMesh,
    settings: &'a TagSettings,
    surfaces: Surfaces,
    template_from_mesh: T,
    sets: Vec<SetReport>,
}

impl<T: Fn([f64; 3]) -> [f64; 3]> Tagger<'_, T> {
    fn empty(&self, set: &str, reason: &'static str) -> TagError {
        let (low_mm, high_mm) = (self.surfaces.low_mm, self.surfaces.high_mm);
        TagError::Empty { set: set.to_owned(), reason, low_mm, high_mm }
    }

    fn position_mm(&self, node: u32) -> [f64; 3] {
        self.mesh.nodes_mm()[node as usize]
    }

    fn template_mm(&self, position_mm: [f64; 3]) -> [f64; 3] {
        (self.template_from_mesh)(position_mm)
    }

    /// Nodes of tissue that `wanted` accepts by number.
    fn tissue_nodes(&self, wanted: impl Fn(u32) -> bool) -> Vec<u32> {
        (0..self.mesh.nodes_mm().len() as u32)
            .filter(|&n| self.surfaces.tissue_nodes[n as usize] && wanted(n))
            .collect()
    }

    /// Stores a set and its report; `nodes` need be neither sorted nor unique.
    fn add(&mut self, name: &str, form: SetForm, mut nodes: Vec<u32>, facets: Vec<[u32; 3]>, moment: Moment) {
        nodes.sort_unstable();
        nodes.dedup();
        self.sets.push(SetReport {
            name: name.to_owned(),
            form,
            nodes: nodes.len(),
            facets: facets.len(),
            area_mm2: moment.area_mm2,
            centroid_mm: moment.centroid_mm(),
            plausible: true,
        });
        self.mesh.node_sets.insert(name.to_owned(), nodes);
        if facets.is_empty() {
            self.mesh.facet_sets.remove(name);
        } else {
            self.mesh.facet_sets.insert(name.to_owned(), facets);
        }
    }

    fn moment(&self, facets: &[[u32; 3]]) -> Moment {
        Moment::of(self.mesh, facets)
    }

    fn add_surface(&mut self, name: &str, facets: Vec<[u32; 3]>, reason: &'static str) -> Result<(), TagError> {
        if facets.is_empty() {
            return Err(self.empty(name, reason));
        }
        let moment = self.moment(&facets);
        self.add(name, SetForm::Surface, facets.as_flattened().to_vec(), facets, moment);
        Ok(())
    }

    fn add_falx(&mut self, midsagittal: Option<Vec<[u32; 3]>>, slab_mm: f64) -> Result<(), TagError> {
        let mut section = Moment::default();
        for (tet, _) in self.mesh.tets().iter().zip(self.mesh.labels()).filter(|(_, label)| is_tissue(**label)) {
            let Some((area_mm2, centroid)) = midsagittal_cut(tet.map(|n| Vector3::from(self.position_mm(n)))) else {
                continue;
            };
            if above_falx_edge(self.template_mm(centroid.into())) {
                section.add(area_mm2, centroid);
            }
        }
        let mut sheet = midsagittal.unwrap_or_else(|| self.surfaces.in_plane.clone());
        // Where a sulcus opens on one side of the falx only, the other hemisphere still lies against it.
        let bare = self.surfaces.pial.iter().filter(|facet| is_midsagittal(self.mesh, facet));
        let seen_from_right = |&[a, b, c]: &[u32; 3]| {
            if self.mesh.area_vector_mm2([a, b, c]).x > 0.0 { [a, b, c] } else { [a, c, b] }
        };
        sheet.extend(bare.map(seen_from_right));
        sheet.retain(|&facet| {
            let tissue = facet.iter().all(|&n| self.surfaces.tissue_nodes[n as usize]);
            tissue && above_falx_edge(self.template_mm(self.mesh.facet_centroid_mm(facet)))
        });
        let moment = self.moment(&sheet);
        if moment.area_mm2 >= section.area_mm2 / 2.0 && !sheet.is_empty() {
            let mut nodes = sheet.as_flattened().to_vec();
            self.remove_wall(&mut nodes);
            self.add(FALX, SetForm::Sheet, nodes, sheet, moment);
            return Ok(());
        }
        let mut slab = self.tissue_nodes(|n| {
            let [x, y, z] = self.template_mm(self.position_mm(n));
            x.abs() <= slab_mm && above_falx_edge([x, y, z])
        });
        self.remove_wall(&mut slab);
        if slab.is_empty() {
            return Err(self.empty(FALX, "no tissue lies near x = 0 above the free edge of the falx"));
        }
        self.add(FALX, SetForm::Slab, slab, Vec::new(), section);
        Ok(())
    }

    /// The falx and the tentorium never hold the ventricle wall.
    fn remove_wall(&self, nodes: &mut Vec<u32>) {
        let mut wall = self.surfaces.ventricle.as_flattened().to_vec();
        wall.sort_unstable();
        nodes.retain(|n| wall.binary_search(n).is_err());
    }

    fn add_tentorium(&mut self, slab_mm: f64) -> Result<(), TagError> {
        let mut slab = self.tissue_nodes(|n| {
            above_tentorium_mm(self.template_mm(self.position_mm(n))).is_some_and(|height| height.abs() <= slab_mm)
        });
        self.remove_wall(&mut slab);
        if slab.is_empty() {
            return Err(self.empty(TENTORIUM, "no tissue lies near the tentorium"));
        }
        // The slab is 2 slab_mm high along z, so its volume over that height is its area seen from above.
        let mut moment = Moment::default();
        for (tet, _) in self.mesh.tets().iter().enumerate().filter(|(t, _)| is_tissue(self.mesh.labels()[*t])) {
            let corners = self.mesh.tets()[tet].map(|n| Vector3::from(self.position_mm(n)));
            let centroid = corners.iter().sum::<Vector3<f64>>() / 4.0;
            let height = above_tentorium_mm(self.template_mm(centroid.into()));
            if height.is_some_and(|height| height.abs() <= slab_mm) {
                moment.add(self.mesh.volume_mm3(tet) / (2.0 * slab_mm), centroid);
            }
        }
        self.add(TENTORIUM, SetForm::Slab, slab, Vec::new(), moment);
        Ok(())
    }

    fn normal_z(&self, facet: [u32; 3]) -> f64 {
        let area_vector = self.mesh.area_vector_mm2(facet);
        area_vector.z / area_vector.norm()
    }

    fn add_base(&mut self) -> Result<(), TagError> {
        let cut_z_mm = self.surfaces.low_mm[2] + self.settings.brainstem_cut_mm;
        let on_base = |&facet: &[u32; 3]| {
            let centroid_mm = self.mesh.facet_centroid_mm(facet);
            let rests =
                self.normal_z(facet) < self.settings.base_normal_z && below_base_line(self.template_mm(centroid_mm));
            rests || centroid_mm[2] <= cut_z_mm
        };
        let facets: Vec<[u32; 3]> = self.surfaces.outer.iter().copied().filter(on_base).collect();
        if facets.is_empty() {
            return Err(self.empty(BASE, "no pial facet looks down below the line of the skull base"));
        }
        let moment = self.moment(&facets);
        let mut nodes = facets.as_flattened().to_vec();
        nodes.extend(self.tissue_nodes(|n| self.position_mm(n)[2] <= cut_z_mm));
        self.add(BASE, SetForm::Surface, nodes, facets, moment);
        Ok(())
    }

    fn add_superior(&mut self) -> Result<(), TagError> {
        let floor_z_mm = self.surfaces.high_mm[2] - self.settings.superior_depth_mm;
        let falx = self.mesh.node_sets.get(FALX).cloned().unwrap_or_default();
        let in_falx = |n: &u32| falx.binary_search(n).is_ok();
        let on_top = |&facet: &[u32; 3]| {
            self.mesh.facet_centroid_mm(facet)[2] > floor_z_mm
                && self.normal_z(facet) > self.settings.superior_normal_z
                // A facet with one free corner still carries load; dropping it would make the area depend on the edge length.
                && !facet.iter().all(in_falx)
        };
        let facets: Vec<[u32; 3]> = self.surfaces.outer.iter().copied().filter(on_top).collect();
        let mut nodes = facets.as_flattened().to_vec();
        nodes.retain(|n| !in_falx(n));
        if nodes.is_empty() {
            return Err(self.empty(SUPERIOR, "no pial facet looks up at the top of the mesh"));
        }
        let moment = self.moment(&facets);
        self.add(SUPERIOR, SetForm::Surface, nodes, facets, moment);
        Ok(())
    }
}

/// Area and first moment of area.
#[derive(Clone, Copy, Debug, Default)]
struct Moment {
    area_mm2: f64,
    first_mm3: Vector3<f64>,
}

impl Moment {
    fn of(mesh: &TetMesh, facets: &[[u32; 3]]) -> Self {
        let mut moment = Self::default();
        for &facet in facets {
            moment.add(mesh.area_vector_mm2(facet).norm(), Vector3::from(mesh.facet_centroid_mm(facet)));
        }
        moment
    }

    fn add(&mut self, area_mm2: f64, centroid: Vector3<f64>) {
        self.area_mm2 += area_mm2;
        self.first_mm3 += centroid * area_mm2;
    }

    fn centroid_mm(&self) -> [f64; 3] {
        (self.first_mm3 / self.area_mm2.max(f64::MIN_POSITIVE)).into()
    }
}

#[cfg(test)]
mod tests;
