//! What the registration makes of a displacement that is known: its own error, taken out of what it has seen.
//!
//! A deformable registration smooths: strains come out too small and tissue too stiff (docs/evidence/patients.md has the
//! figures with this correction). So the estimate's own state is shown to the registration: the pre-operative scan, moved as the solver says, is registered like the
//! post-operative one, and what comes out besides the known displacement is taken from what the patient's scans showed
//! (indirect inference: Gourieroux, Monfort and Renault, Journal of Applied Econometrics 8, 1993). Then the estimate is
//! found again.

use crate::experiment::nodal_field::on_grid;
use crate::geometry::{Mni, Position, RigidTransform};
use crate::image::resample::{Interpolation, resample};
use crate::image::{Mask, Volume};
use crate::mesh::TetMesh;
use crate::register::deformable::{DeformableError, DeformableSettings, DisplacementField};
use crate::register::{RegisterError, RigidSettings, register_two_scans_near};
use crate::resect::{SagScans, fit_sag, moved_scan, on_the_scale_of};
use nalgebra::Vector3;
use thiserror::Error;

/// A node and its displacement, mm.
pub type MovedNode = (u32, [f64; 3]);

/// What a measurement shows of nodes that have moved by a known displacement, mm: all nodes' displacement in, the observed
/// nodes' out.
pub type Instrument<'a> = dyn Fn(&[[f64; 3]]) -> Result<Shown, InstrumentError> + 'a;

/// What an instrument shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// The observed nodes, mm.
    pub nodes: Vec<MovedNode>,
    /// What its rigid half follows of the displacement: from where a point has gone to where it seems to be.
    pub taken_up: RigidTransform<Mni, Mni>,
}

/// By an instrument without a rigid half.
impl From<Vec<MovedNode>> for Shown {
    fn from(nodes: Vec<MovedNode>) -> Self {
        Self { nodes, taken_up: RigidTransform::identity() }
    }
}

/// Why a known displacement cannot be measured.
#[derive(Debug, Error, PartialEq)]
pub enum InstrumentError {
    /// The scans cannot be brought onto each other.
    #[error(transparent)]
    Rigid(#[from] RegisterError),
    /// Nor deformed onto each other.
    #[error(transparent)]
    Deformable(#[from] DeformableError),
}

/// What was seen, without what the instrument adds to a displacement that is known, and what its rigid half follows of that.
///
/// # Errors
/// The instrument's.
pub fn without_own_error(
    seen: &[MovedNode],
    known_mm: &[[f64; 3]],
    instrument: &Instrument<'_>,
) -> Result<Shown, InstrumentError> {
    let Shown { nodes: shown, taken_up } = instrument(known_mm)?;
    let corrected = |(&(n, seen), (m, shown)): (&MovedNode, &MovedNode)| {
        assert_eq!(n, *m, "an instrument shows the nodes that were seen, in their order");
        let known = known_mm[n as usize];
        (n, [0, 1, 2].map(|a| seen[a] - (shown[a] - known[a])))
    };
    Ok(Shown { nodes: seen.iter().zip(&shown).map(corrected).collect(), taken_up })
}

/// The registration of a patient's scans as an instrument. All images lie on one grid in the MNI frame reached rigidly.
#[derive(Clone, Copy, Debug)]
pub struct ReRegistration<'a> {
    /// Pre-operative intensities, as the registration has looked at them: without the coil's gain.
    pub pre: &'a Volume<f32, Mni>,
    /// Brain on the pre-operative scan.
    pub pre_brain: &'a Mask<Mni>,
    /// The tissue that both scans looked at, by which the post-operative intensities came onto the pre-operative scale.
    pub tissue: &'a Mask<Mni>,
    /// How smooth the ratio of the two is, see [`on_the_scale_of`].
    pub scale_sigma_mm: f64,
    /// Where the post-operative scan looked.
    pub post_known: &'a Mask<Mni>,
    /// The cavity on the post-operative scan.
    pub cavity: &'a Mask<Mni>,
    /// Intensity of fluid on the pre-operative scan.
    pub fluid: f32,
    /// Whether both scans show the skull, see [`crate::resect::skull_is_shown`].
    pub skull_is_shown: bool,
    /// The rigid registration of the two scans.
    pub rigid: &'a RigidSettings,
    /// The deformable one after it.
    pub settings: &'a DeformableSettings,
}

impl ReRegistration<'_> {
    /// The displacement that the registration sees when the nodes of `mesh` have moved by `displacement_mm`, and what its rigid
    /// half has followed of it; `like` is a displacement on the registration's grid.
    ///
    /// # Errors
    /// [`InstrumentError`] when too little of the brain is known.
    pub fn sees(
        &self,
        mesh: &TetMesh,
        displacement_mm: &[[f64; 3]],
        like: &DisplacementField<Mni>,
    ) -> Result<(DisplacementField<Mni>, RigidTransform<Mni, Mni>), InstrumentError> {
        let moved: Vec<[f64; 3]> = mesh
            .nodes_mm()
            .iter()
            .zip(displacement_mm)
            .map(|(x, u)| (Vector3::from(*x) + Vector3::from(*u)).into())
            .collect();
        let back: Vec<[f64; 3]> = displacement_mm.iter().map(|u| u.map(|v| -v)).collect();
        let back = on_grid(mesh.tets(), &moved, &back, like.grid());
        let rest_from_moved = DisplacementField::from_displacement(&back.map(|d| d.map(|v| v as f32)));
        // Where a scan of the patient has no skull, rigid registration followed the brain, and has to here.
        let fluid = self.skull_is_shown.then_some(self.fluid);
        let moved = moved_scan(self.pre, self.pre_brain, fluid, &rest_from_moved);
        // Rigid registration follows a part of the shift, and the patient's scans went through it too; its search for where to begin
        // would find what is known here.
        let rigid = register_two_scans_near(&moved, self.pre, &RigidTransform::identity(), self.rigid)?;
        let moved_from_pre = rigid.inverse().to_affine();
        let post = resample(&moved, &self.pre.grid, &moved_from_pre, Interpolation::CubicBSpline, 0.0).volume;
        // Their intensities were brought onto one scale before the shift was known, too: where tissue has given way to fluid their
        // ratio is no gain.
        let post = on_the_scale_of(self.pre, &post.map(|x| x.max(0.0)), self.tissue, self.scale_sigma_mm);
        let scans = SagScans {
            pre: self.pre,
            pre_brain: self.pre_brain,
            post: &post,
            post_known: self.post_known,
            cavity: self.cavity,
        };
        Ok((fit_sag(&scans, self.settings)?.subject_from_atlas, rigid))
    }
}

/// How far a point moves, mm.
pub fn moved_by(field: &DisplacementField<Mni>, x: [f64; 3]) -> [f64; 3] {
    let x = Position::new(x[0], x[1], x[2]);
    (field.apply(x).mm - x.mm).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;
    use crate::resect::PairSettings;
    use crate::segment::atlas::mean_head;

    /// How far rigid registration follows a brain that has moved by 2 mm to the back, mm.
    fn followed_mm(skull_is_shown: bool) -> f64 {
        let head = mean_head();
        let (all, none) = (head.brain.map(|_| true), head.brain.map(|_| false));
        let unit = block(2);
        // Around the whole brain.
        let nodes_mm = unit.nodes_mm().iter().map(|x| x.map(|v| 12.0 * v - 120.0)).collect();
        let mesh = TetMesh::new(nodes_mm, unit.tets().to_vec(), unit.labels().to_vec()).unwrap();
        let displacement = vec![[0.0, -2.0, 0.0]; mesh.nodes_mm().len()];
        let rest = DisplacementField::from_displacement(&Volume::filled(head.t1.grid, [0f32; 3]));
        let registration = ReRegistration {
            pre: &head.t1,
            pre_brain: &head.brain,
            tissue: &head.brain,
            scale_sigma_mm: 25.0,
            post_known: &all,
            cavity: &none,
            fluid: 40.0,
            skull_is_shown,
            rigid: &RigidSettings::default(),
            settings: &DeformableSettings { iterations: vec![1], levels_mm: vec![8.0], ..PairSettings::default().sag },
        };
        let (_, taken_up) = registration.sees(&mesh, &displacement, &rest).unwrap();
        let middle = taken_up.apply(Position::new(0.0, -20.0, 10.0)).mm;
        middle.y + 20.0
    }

    #[test]
    fn rigid_registration_follows_a_brain_where_a_scan_shows_no_skull_and_stays_with_the_skull_where_both_do() {
        let (with_skull, without) = (followed_mm(true), followed_mm(false));
        assert!(with_skull.abs() < 0.5, "{with_skull}");
        assert!((without - 2.0).abs() < 0.5, "{without}");
    }
}
