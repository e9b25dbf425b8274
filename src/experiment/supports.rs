//! What holds a patient's brain where nothing sticks: the cut brainstem, the falx, and the skull around it.

use super::resection::ResectionSettings;
use super::setting::{SettingError, first_broken};
use crate::fem::{Contact, FemError, Scenario, Support, Wall};
use crate::geometry::{Frame, SmoothField};
use crate::image::distance::signed_distance_mm;
use crate::image::gaussian::gaussian;
use crate::image::{LabelMap, Mask};
use crate::mesh::{ClosestPoint, TetMesh, TriMesh};
use crate::segment::{label, with_closed_sulci};
use crate::tag::{BASE, FALX, MARGIN, VENTRICLE};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use thiserror::Error;

/// Facet set of the cortex that stands before the skull.
pub const PIAL: &str = "pial";
/// Node set of the cut through the brainstem.
pub const BRAINSTEM: &str = "brainstem";

/// Where the inside of the skull is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SkullFrom {
    /// `gap_mm` outside the cortex everywhere.
    #[default]
    Cortex,
    /// Where the segmentation sees brain and cerebrospinal fluid end, and `gap_mm` farther.
    Scan,
}

/// The skull of `supports = "sliding"`; the table `[resection.skull]` of the settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SkullSettings {
    /// Where its inside is.
    pub from: SkullFrom,
    /// Room between cortex and bone, mm: see `from`. A layer of fluid of about a millimetre where the brain is thickest in
    /// the skull.
    pub gap_mm: f64,
    /// The bone is open this far around the cavity, mm; 0 where the flap is back in its place.
    pub opening_mm: f64,
    /// Sulci and fissures up to twice this width are no way for the bone to follow, mm.
    pub closing_mm: f64,
    /// The brain is held this far above its lowest node, mm: the cut brainstem.
    pub brainstem_cut_mm: f64,
}

impl Default for SkullSettings {
    fn default() -> Self {
        Self { from: SkullFrom::default(), gap_mm: 1.0, opening_mm: 0.0, closing_mm: 4.0, brainstem_cut_mm: 3.0 }
    }
}

impl SkullSettings {
    /// Refuses what no skull can be.
    ///
    /// # Errors
    /// The first setting out of its range.
    pub fn check(&self) -> Result<(), SettingError> {
        let length = |x: f64| (0.0..=50.0).contains(&x);
        first_broken(&[
            ("gap_mm", &self.gap_mm, length(self.gap_mm), "0 to 50 mm"),
            ("opening_mm", &self.opening_mm, length(self.opening_mm), "0 to 50 mm"),
            ("closing_mm", &self.closing_mm, length(self.closing_mm), "0 to 50 mm"),
            ("brainstem_cut_mm", &self.brainstem_cut_mm, length(self.brainstem_cut_mm), "0 to 50 mm"),
        ])
    }

    /// What lies inside the skull, by the labels of the pre-operative scan.
    pub fn inside<F: Frame>(&self, labels: &LabelMap<F>) -> Mask<F> {
        match self.from {
            SkullFrom::Cortex => with_closed_sulci(labels, self.closing_mm).map(|l| l != label::BACKGROUND),
            SkullFrom::Scan => labels.map(|l| l != label::BACKGROUND),
        }
    }

    /// The smooth distance to the skull, positive inside, by the labels of the pre-operative scan.
    pub fn distance<F: Frame>(&self, labels: &LabelMap<F>) -> Option<SmoothField> {
        smooth_distance(&self.inside(labels))
    }
}

/// Standard deviation of the smoothing of a distance to voxels, mm: the bone does not follow gyri, nor steps of voxels.
const SMOOTHING_MM: f64 = 3.0;
/// Spacing of the smooth distance, mm, about.
const SPACING_MM: f64 = 3.0;

/// The distance to the border of a mask, positive inside, as a field that is twice differentiable. The grid's axes are taken
/// as those of the frame, which they are in the MNI frame; `None` where they are not, or the mask is empty or full.
pub fn smooth_distance<F: Frame>(inside: &Mask<F>) -> Option<SmoothField> {
    let grid = inside.grid;
    let signed = signed_distance_mm(inside);
    if signed.data.iter().any(|d| !d.is_finite()) {
        return None;
    }
    let smooth = gaussian(&signed, SMOOTHING_MM);
    let place = |voxel: [usize; 3]| grid.position(voxel.map(|v| v as f64).into()).mm;
    let (first, next) = (place([0; 3]), [place([1, 0, 0]), place([0, 1, 0]), place([0, 0, 1])]);
    let mut spacing_mm = [0.0; 3];
    for axis in 0..3 {
        let step = next[axis] - first;
        let across = (0..3).filter(|&i| i != axis).map(|i| step[i].abs()).fold(0.0, f64::max);
        if step[axis] <= 0.0 || across > 1e-6 * step[axis] {
            return None;
        }
        spacing_mm[axis] = step[axis];
    }
    let every = spacing_mm.map(|h| (SPACING_MM / h).round().max(1.0) as usize);
    let size: [usize; 3] = std::array::from_fn(|a| grid.dims[a].div_ceil(every[a]));
    let mut samples = Vec::with_capacity(size.iter().product());
    for k in 0..size[2] {
        for j in 0..size[1] {
            for i in 0..size[0] {
                samples.push(-smooth.data[grid.index(i * every[0], j * every[1], k * every[2])]);
            }
        }
    }
    let spacing_mm = std::array::from_fn(|a| spacing_mm[a] * every[a] as f64);
    SmoothField::new(first.into(), spacing_mm, size, samples)
}

/// The rest mesh with the sets that slide or hold: [`PIAL`], the cortex before the skull, without ventricle wall, margin,
/// the cut through the brainstem and what lies within the opening; and [`BRAINSTEM`], that cut.
#[must_use]
pub fn with_sliding_sets(mesh: &TetMesh, skull: &SkullSettings) -> TetMesh {
    let mut mesh = mesh.clone();
    let lowest = mesh.nodes_mm().iter().map(|x| x[2]).fold(f64::INFINITY, f64::min);
    let cut = lowest + skull.brainstem_cut_mm;
    let held: Vec<u32> = (0..mesh.nodes_mm().len() as u32).filter(|&n| mesh.nodes_mm()[n as usize][2] <= cut).collect();
    let sorted = |mut facet: [u32; 3]| {
        facet.sort_unstable();
        facet
    };
    let of = |set: &str| mesh.facet_sets.get(set).map_or(&[][..], Vec::as_slice);
    let mut others: Vec<[u32; 3]> =
        of(VENTRICLE).iter().chain(of(MARGIN)).chain(of(FALX)).copied().map(sorted).collect();
    others.sort_unstable();
    let (margin, _) = TriMesh::from_facets(mesh.nodes_mm(), of(MARGIN));
    let cavity = ClosestPoint::new(&margin).filter(|_| skull.opening_mm > 0.0);
    let open =
        |n: u32| cavity.as_ref().is_some_and(|c| c.find(mesh.nodes_mm()[n as usize]).distance_mm < skull.opening_mm);
    let mut pial = mesh.boundary_facets(|_| true);
    pial.retain(|facet| {
        let held = facet.iter().all(|n| held.binary_search(n).is_ok());
        !held && others.binary_search(&sorted(*facet)).is_err() && !facet.iter().any(|&n| open(n))
    });
    mesh.facet_sets.insert(PIAL.to_owned(), pial);
    mesh.node_sets.insert(BRAINSTEM.to_owned(), held);
    mesh
}

/// Why a patient's supports cannot be posed.
#[derive(Debug, Error)]
pub enum SupportsError {
    /// No distance to the skull.
    #[error(
        "the labels show no inside of a skull on a grid along the axes: look at the segmentation, or take \
         `supports = \"sliding\"` away"
    )]
    NoSkull,
    /// No fluid to drain.
    #[error("the labels show no cerebrospinal fluid whose level could fall: take the table [resection.csf] away")]
    NoFluid,
    /// A set that cannot be cut along.
    #[error(transparent)]
    Fem(#[from] FemError),
}

impl ResectionSettings {
    /// Whether [`Self::supported`] looks at the labels.
    pub fn needs_labels(&self) -> bool {
        self.supports == Support::Sliding || self.csf.is_some()
    }

    /// What else holds and carries the brain, to follow a list of what is held.
    pub fn supports_in_words(&self) -> String {
        let mut words = String::new();
        if self.supports == Support::Sliding {
            let from = match self.skull.from {
                SkullFrom::Cortex => "from the cortex",
                SkullFrom::Scan => "outside the fluid that the scan shows",
            };
            words += &format!(", sliding on a skull {} mm {from}", self.skull.gap_mm);
            if self.falx == Support::Sliding {
                words += " and along the falx";
            }
        }
        if let Some(csf) = &self.csf {
            words += &format!(", {:.0} % of the fluid drained", 100.0 * csf.drained);
        }
        words
    }

    /// The scenario with supports and fluid as these settings have them, by the labels of the pre-operative scan in the
    /// frame of the mesh.
    ///
    /// # Errors
    /// [`SupportsError`] when the labels show no skull or no fluid.
    pub fn supported<F: Frame>(&self, scenario: &Scenario, labels: &LabelMap<F>) -> Result<Scenario, SupportsError> {
        let mut scenario = scenario.clone();
        if let Some(csf) = &self.csf {
            let level = csf.level(labels, scenario.loads.gravity_m_per_s2);
            scenario.loads.csf = Some(level.ok_or(SupportsError::NoFluid)?);
        }
        if self.supports == Support::Fixed {
            return Ok(scenario);
        }
        let skull = self.skull.distance(labels).ok_or(SupportsError::NoSkull)?;
        Ok(self.sliding(&scenario, &Arc::new(skull)))
    }

    /// The rest mesh as that scenario needs it: with the sets that slide, cut open along a falx that slides.
    ///
    /// # Errors
    /// [`SupportsError::Fem`] when the falx of this mesh is no sheet.
    pub fn supported_mesh(&self, mesh: TetMesh, scenario: &Scenario) -> Result<TetMesh, SupportsError> {
        if self.supports == Support::Fixed {
            return Ok(mesh);
        }
        Ok(scenario.body(&with_sliding_sets(&mesh, &self.skull))?.into_owned())
    }

    /// The scenario of a brain that slides on the skull instead of being held at the base: for the mesh of
    /// [`with_sliding_sets`].
    #[must_use]
    pub fn sliding(&self, scenario: &Scenario, skull: &Arc<SmoothField>) -> Scenario {
        let mut sliding = scenario.clone();
        sliding.fixed.retain(|set| set != BASE && (set != FALX || self.falx == Support::Fixed));
        sliding.fixed.push(BRAINSTEM.to_owned());
        if self.falx == Support::Sliding {
            sliding.supports.insert(FALX.to_owned(), Support::Sliding);
        }
        let even = self.skull.from == SkullFrom::Cortex;
        let wall = Wall::Field { name: "skull".to_owned(), even, distance_mm: Some(Arc::clone(skull)) };
        sliding.contact.push(Contact::new(PIAL, wall, self.skull.gap_mm));
        sliding
    }
}

/// The level (mm against gravity, from the origin) to which fluid of `labels` is left when this part of it has drained: what
/// lies highest goes first.
pub fn level_when_drained<F: Frame>(labels: &LabelMap<F>, gravity: [f64; 3], drained: f64) -> Option<f64> {
    let strength = gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
    let fluid = |l: u8| l == label::CSF || l == label::VENTRICLE;
    let mut heights: Vec<f64> = (0..labels.data.len())
        .filter(|&n| fluid(labels.data[n]))
        .map(|n| {
            let p = labels.grid.position(labels.grid.voxel(n).map(|v| v as f64).into()).mm;
            -(0..3).map(|a| p[a] * gravity[a]).sum::<f64>() / strength
        })
        .collect();
    if heights.is_empty() || strength == 0.0 {
        return None;
    }
    heights.sort_unstable_by(f64::total_cmp);
    let place = (1.0 - drained.clamp(0.0, 1.0)) * (heights.len() - 1) as f64;
    let (low, part) = (place.floor() as usize, place.fract());
    Some(heights[low] + part * (heights[(low + 1).min(heights.len() - 1)] - heights[low]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;

    fn ball(radius_mm: f64) -> LabelMap<Mni> {
        let grid = Grid::<Mni>::axis_aligned([61, 61, 61], [1.0; 3], [-30.0; 3]);
        let inside = |n: usize| {
            let square: f64 = grid.voxel(n).iter().map(|&v| (v as f64 - 30.0).powi(2)).sum();
            if square <= radius_mm * radius_mm { label::GREY_MATTER } else { label::BACKGROUND }
        };
        LabelMap::from_data(grid, (0..grid.len()).map(inside).collect())
    }

    #[test]
    fn the_distance_to_a_ball_is_smooth_and_right() {
        let field = SkullSettings::default().distance(&ball(20.0)).unwrap();
        for direction in [[1.0, 0.0, 0.0], [0.6, 0.0, 0.8], [0.577, 0.577, 0.577]] {
            for r in [14.0, 17.0, 20.0, 22.0] {
                let at = field.at(direction.map(|d| d * r));
                assert!((at.value - (20.0 - r)).abs() < 1.0, "{r}: {}", at.value);
                let slope: f64 = (0..3).map(|i| at.gradient[i] * direction[i]).sum();
                assert!((slope + 1.0).abs() < 0.05, "{r}: {slope}");
            }
        }
        assert!(SkullSettings::default().distance(&ball(-1.0)).is_none());
    }

    #[test]
    fn the_level_falls_as_fluid_drains() {
        let mut labels = ball(20.0);
        labels.data.iter_mut().filter(|l| **l != label::BACKGROUND).for_each(|l| *l = label::CSF);
        let level = |drained| level_when_drained(&labels, [0.0, -9.81, 0.0], drained).unwrap();
        assert_eq!([level(0.0), level(1.0)], [20.0, -20.0]);
        // Half of a ball lies above its middle; the part above a height falls smoothly.
        assert!(level(0.5).abs() <= 0.5 && level(0.1) > level(0.2));
        assert_eq!(level_when_drained(&ball(20.0), [0.0, 0.0, -9.81], 0.5), None);
    }
}
