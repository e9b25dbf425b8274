//! From what is known of tissue to a field over the head.

use super::harmonic::{Place, continued};
use super::inverse::inverse;
use super::jacobian::mended;
use super::raster::{InTetrahedra, in_tetrahedra};
use super::settings::FieldSettings;
use super::vectors::Cell;
use crate::experiment::reach::reach_95;
use crate::geometry::{Mni, Position, Post, Pre, RigidTransform};
use crate::image::morphology::dilate;
use crate::image::{Grid, Mask, Volume};
use nalgebra::{Matrix4, Point3, Vector3};
use rayon::prelude::*;

/// Steps to a mm of a vector's components: far below what any of it is worth, so that files pack well.
const STEPS_PER_MM: f64 = 256.0;

/// A state of a mesh in the MNI frame.
#[derive(Clone, Copy, Debug)]
pub struct Moved<'a> {
    /// Tetrahedra.
    pub tets: &'a [[u32; 4]],
    /// Where the nodes were, mm.
    pub nodes_mm: &'a [[f64; 3]],
    /// How far each has moved, mm.
    pub displacement_mm: &'a [[f64; 3]],
    /// Standard deviation of each (root of the trace of its covariance), mm.
    pub sd_mm: &'a [f64],
    /// The 95 % reach of each, mm: the size that 95 % of what it may have moved by do not exceed.
    pub reach95_mm: &'a [f64],
}

/// Brain shift as a field of the pre-operative scan, and its inverse. Both lie on the part of the scan's grid that holds
/// the brain; beyond it nothing moves.
#[derive(Clone, Debug)]
pub struct ShiftField {
    /// The whole grid that the field's is cut from.
    pub whole: Grid<Pre>,
    /// First voxel of the part.
    pub first: [usize; 3],
    /// How far a point moves, mm.
    pub forward: Volume<[f32; 3], Pre>,
    /// From a moved point back, mm.
    pub inverse: Volume<[f32; 3], Pre>,
    /// Standard deviation (root of the trace of the covariance), mm.
    pub sd_mm: Vec<f32>,
    /// The 95 % reach, mm.
    pub reach95_mm: Vec<f32>,
    /// Where the field is that of tissue that is still there.
    pub believed: Vec<bool>,
    /// Smallest determinant of the field's gradient.
    pub jacobian_min: f64,
    /// Voxels of tissue whose vector was changed because the state folds there.
    pub changed: usize,
}

/// What a case's images say of the head, on the grid of the fields.
#[derive(Clone, Debug)]
pub struct Surroundings {
    /// The brain with its fluid.
    pub brain: Mask<Pre>,
    /// The tissue that was taken.
    pub resected: Mask<Pre>,
}

/// The field of a state. `seen` overrides the displacement inside the tetrahedra: a point (mm, MNI) to its vector.
pub fn shift_field(
    state: &Moved<'_>,
    seen: Option<&(dyn Fn([f64; 3]) -> [f64; 3] + Sync)>,
    pre_from_mni: &RigidTransform<Mni, Pre>,
    around: &Surroundings,
    settings: &FieldSettings,
) -> ShiftField {
    let in_pre = |x: &[f64; 3]| pre_from_mni.apply(Position::new(x[0], x[1], x[2])).mm;
    let nodes: Vec<[f64; 3]> = state.nodes_mm.iter().map(|x| in_pre(x).into()).collect();
    let turned = |u: [f64; 3]| -> [f64; 3] { (pre_from_mni.rotation * Vector3::from(u)).into() };
    let length = |u: &[f64; 3]| Vector3::from(*u).norm();
    let largest = state.displacement_mm.iter().map(length).fold(0.0, f64::max);
    let (first, grid) = part(&around.brain, &nodes, settings.fall_mm + largest + 2.0);
    let values: Vec<[f64; 5]> = (0..nodes.len())
        .map(|n| {
            let [x, y, z] = turned(state.displacement_mm[n]);
            [x, y, z, state.sd_mm[n], state.reach95_mm[n]]
        })
        .collect();
    let mut known = in_tetrahedra(state.tets, &nodes, &values, &grid);
    if let Some(seen) = seen {
        let mni_from_pre = pre_from_mni.inverse();
        known.values.par_iter_mut().zip(&known.inside).enumerate().for_each(|(n, (value, inside))| {
            if !inside {
                return;
            }
            let u = turned(seen(mni_from_pre.apply(grid.centre(grid.voxel(n))).mm.into()));
            (0..3).for_each(|a| value[a] = u[a] as f32);
            value[4] = reach_95(length(&u), f64::from(value[3])) as f32;
        });
    }
    let brain = cut(&around.brain, first, &grid);
    let resected = cut(&around.resected, first, &grid);
    from_tissue(known, &brain, &resected, (around.brain.grid, first), settings)
}

/// The field of what is known at voxels of tissue: displacement, standard deviation and reach.
fn from_tissue(
    known: InTetrahedra<5>,
    brain: &Mask<Pre>,
    resected: &Mask<Pre>,
    (whole, first): (Grid<Pre>, [usize; 3]),
    settings: &FieldSettings,
) -> ShiftField {
    let grid = brain.grid;
    let InTetrahedra { inside, mut values } = known;
    let tissue: Vec<bool> = inside.par_iter().zip(&resected.data).map(|(inside, gone)| *inside && !gone).collect();
    let head = Mask::from_fn(grid, |n| brain.data[n] || inside[n]);
    let reached = dilate(&head, settings.fall_mm);
    let place_of = |n: usize| if tissue[n] || !reached.data[n] { Place::Known } else { Place::Free };
    let place: Vec<Place> = (0..grid.len()).into_par_iter().map(place_of).collect();
    let taken = |n: usize| inside[n] && !tissue[n];
    values.par_iter_mut().enumerate().filter(|(n, _)| taken(*n)).for_each(|(_, value)| *value = [0.0; 5]);
    let values = continued(grid.dims, grid.spacing_mm(), &place, values);
    let vectors = values.par_iter().map(|&[x, y, z, ..]| [x, y, z]).collect();
    let mut mended = mended(Volume::from_data(grid, vectors), settings.jacobian_least);
    mended.field.data.par_iter_mut().for_each(|v| *v = [rounded(v[0]), rounded(v[1]), rounded(v[2])]);
    let changed = (0..grid.len()).into_par_iter().filter(|&n| tissue[n] && mended.changed[n]).count();
    let inside = |n: usize, v: f32| if resected.data[n] { 0.0 } else { rounded(v.max(0.0)) };
    let component = |c: usize| values.par_iter().enumerate().map(|(n, v)| inside(n, v[c])).collect();
    let mut inverse = inverse(&mended.field);
    // Zeros stay untouched: memory that nothing is written to need not be handed out.
    let moved = inverse.data.par_iter_mut().filter(|v| **v != [0.0; 3]);
    moved.for_each(|v| *v = [rounded(v[0]), rounded(v[1]), rounded(v[2])]);
    ShiftField {
        whole,
        first,
        inverse,
        sd_mm: component(3),
        reach95_mm: component(4),
        believed: (0..grid.len()).into_par_iter().map(|n| tissue[n] && !mended.changed[n]).collect(),
        jacobian_min: mended.jacobian_min,
        changed,
        forward: mended.field,
    }
}

/// What an affine makes of a voxel: nothing else is done for every voxel of a head.
fn of_voxels(affine: &Matrix4<f64>) -> impl Fn([usize; 3]) -> Vector3<f64> + Sync + Send + use<> {
    let [x, y, z, origin] = [0, 1, 2, 3].map(|c| affine.fixed_view::<3, 1>(0, c).into_owned());
    move |[i, j, k]| x * i as f64 + y * j as f64 + z * k as f64 + origin
}

#[inline]
fn vector(d: &Vector3<f64>) -> [f32; 3] {
    [rounded(d.x as f32), rounded(d.y as f32), rounded(d.z as f32)]
}

#[inline]
fn rounded(x: f32) -> f32 {
    // Plus zero: no -0 in a file.
    ((f64::from(x) * STEPS_PER_MM).round_ties_even() / STEPS_PER_MM) as f32 + 0.0
}

/// The part of a mask's grid that holds its inside and some points, with room around.
fn part(mask: &Mask<Pre>, points: &[[f64; 3]], room_mm: f64) -> ([usize; 3], Grid<Pre>) {
    let grid = &mask.grid;
    let (mut low, mut high) = (grid.dims.map(|n| n as f64), [0.0f64; 3]);
    let mut hold = |v: [f64; 3]| {
        for a in 0..3 {
            (low[a], high[a]) = (low[a].min(v[a]), high[a].max(v[a]));
        }
    };
    if let Some(inside) = mask.bounding_box() {
        hold(inside.first.map(|v| v as f64));
        hold(inside.end.map(|v| v as f64 - 1.0));
    }
    for p in points {
        hold(grid.voxel_at(Position::new(p[0], p[1], p[2])).into());
    }
    let spacing = grid.spacing_mm();
    let mut first = [0; 3];
    let mut dims = [2; 3];
    for a in 0..3 {
        let room = room_mm / spacing[a] + 2.0;
        let end = grid.dims[a] - 1;
        first[a] = ((low[a] - room).floor().max(0.0) as usize).min(end - 1);
        let last = ((high[a] + room).ceil().max(0.0) as usize).min(end);
        dims[a] = last.max(first[a] + 1) - first[a] + 1;
    }
    let shift = Matrix4::new_translation(&Vector3::from(first.map(|v| v as f64)));
    // A part of a grid that can be inverted can be.
    let part = Grid::new(dims, grid.mm_from_voxel * shift).unwrap_or(*grid);
    (first, part)
}

fn cut(mask: &Mask<Pre>, first: [usize; 3], grid: &Grid<Pre>) -> Mask<Pre> {
    Mask::from_voxels(*grid, |[i, j, k]| mask.at(i + first[0], j + first[1], k + first[2]))
}

impl ShiftField {
    /// From a point of the pre-operative scan to the post-operative one, by voxel of the whole grid, mm.
    pub fn to_post(
        &self,
        post_from_pre: &RigidTransform<Pre, Post>,
    ) -> impl Fn([usize; 3]) -> [f32; 3] + Sync + Send + use<'_> {
        let turn = post_from_pre.to_affine().linear;
        let mm_from_voxel = self.whole.mm_from_voxel;
        let rigid = of_voxels(&(post_from_pre.to_matrix() * mm_from_voxel - mm_from_voxel));
        move |v| {
            let d = rigid(v);
            match self.forward_at(v) {
                [0.0, 0.0, 0.0] => vector(&d),
                shift => vector(&(d + turn * Vector3::from(shift.map(f64::from)))),
            }
        }
    }

    /// Back from a point of the post-operative scan, by voxel of its grid, mm.
    pub fn to_pre(
        &self,
        grid: &Grid<Post>,
        pre_from_post: &RigidTransform<Post, Pre>,
    ) -> impl Fn([usize; 3]) -> [f32; 3] + Sync + Send + use<'_> {
        let moved = pre_from_post.to_matrix() * grid.mm_from_voxel;
        let rigid = of_voxels(&(moved - grid.mm_from_voxel));
        let there = of_voxels(&(self.inverse.grid.voxel_from_mm() * moved));
        move |v| {
            let back = Cell::at(self.inverse.grid.dims, &Point3::from(there(v)));
            vector(&(rigid(v) + back.map_or(Vector3::zeros(), |cell| cell.value(&self.inverse.data))))
        }
    }

    /// A voxel of the whole grid as one of the part.
    #[inline]
    fn of_whole(&self, v: [usize; 3]) -> Option<usize> {
        let dims = self.forward.grid.dims;
        let at = |a: usize| v[a].wrapping_sub(self.first[a]);
        let (i, j, k) = (at(0), at(1), at(2));
        (i < dims[0] && j < dims[1] && k < dims[2]).then(|| self.forward.grid.index(i, j, k))
    }

    /// What the part's values (one per voxel of it) are at a voxel of the whole grid; nothing beyond the part.
    pub fn value_at<T: Copy + Default>(&self, part: &[T], voxel: [usize; 3]) -> T {
        self.of_whole(voxel).map_or(T::default(), |m| part[m])
    }

    /// How far the point at a voxel of the whole grid moves, mm.
    pub fn forward_at(&self, voxel: [usize; 3]) -> [f32; 3] {
        self.value_at(&self.forward.data, voxel)
    }

    /// The same of the inverse.
    pub fn inverse_at(&self, voxel: [usize; 3]) -> [f32; 3] {
        self.value_at(&self.inverse.data, voxel)
    }

    /// The part's values on the whole grid.
    pub fn on_whole<T: Copy + Default + Send + Sync>(&self, part: &[T]) -> Volume<T, Pre> {
        Volume::from_voxels(self.whole, |v| self.value_at(part, v))
    }

    /// Largest and median length of the shift over the tissue, mm, and where the largest is (mm, pre-operative scan).
    pub fn sizes(&self) -> Option<(f64, f64, [f64; 3])> {
        let size = |n: usize| self.forward.data[n].iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt();
        let believed = (0..self.believed.len()).into_par_iter().filter(|&n| self.believed[n]);
        let mut sizes: Vec<(f64, usize)> = believed.map(|n| (size(n), n)).collect();
        // Of equals the first voxel is the largest.
        let order = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1));
        let (largest, at) = sizes.iter().copied().max_by(order)?;
        let half = sizes.len() / 2;
        let (_, (median, _), _) = sizes.select_nth_unstable_by(half, order);
        let grid = &self.forward.grid;
        Some((largest, *median, grid.centre(grid.voxel(at)).mm.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::field::vectors::carried;
    use crate::experiment::phantom::block;
    use crate::geometry::Frame;
    use crate::image::morphology::erode;

    /// A block of tissue in a larger head, moved as a function says, with a piece taken out.
    fn field(u: impl Fn([f64; 3]) -> [f64; 3]) -> (ShiftField, Surroundings) {
        field_seen(u, None)
    }

    type Seen<'a> = Option<&'a (dyn Fn([f64; 3]) -> [f64; 3] + Sync)>;

    /// The same where the images say what moved.
    fn field_seen(u: impl Fn([f64; 3]) -> [f64; 3], seen: Seen<'_>) -> (ShiftField, Surroundings) {
        let mesh = block(6);
        let displacement: Vec<[f64; 3]> = mesh.nodes_mm().iter().map(|x| u(*x)).collect();
        let nodes = mesh.nodes_mm().len();
        let (low, high) = mesh.nodes_mm().iter().fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(l, h), x| {
            ([0, 1, 2].map(|a| l[a].min(x[a])), [0, 1, 2].map(|a| h[a].max(x[a])))
        });
        let dims = [0, 1, 2].map(|a| ((high[a] - low[a]) / 2.0) as usize + 31);
        let grid = Grid::<Mni>::axis_aligned(dims, [2.0; 3], low.map(|x| x - 30.0));
        let to_pre = RigidTransform::<Mni, Pre>::about(
            [1.0, 2.0, 3.0].into(),
            Vector3::new(0.1, -0.2, 0.3),
            Vector3::new(5.0, 0.0, -4.0),
        );
        let whole = Grid::<Pre>::new(dims, to_pre.to_matrix() * grid.mm_from_voxel).unwrap();
        let at = |n: usize| grid.centre(grid.voxel(n)).mm;
        let around = Surroundings {
            brain: Mask::from_fn(whole, |n| (0..3).all(|a| at(n)[a] > low[a] - 6.0 && at(n)[a] < high[a] + 6.0)),
            resected: Mask::from_fn(whole, |n| (0..3).all(|a| at(n)[a] < low[a] + 14.0 && at(n)[a] > low[a])),
        };
        let state = Moved {
            tets: mesh.tets(),
            nodes_mm: mesh.nodes_mm(),
            displacement_mm: &displacement,
            sd_mm: &vec![0.5; nodes],
            reach95_mm: &vec![3.0; nodes],
        };
        (shift_field(&state, seen, &to_pre, &around, &FieldSettings::default()), around)
    }

    #[test]
    fn the_reach_of_what_is_seen_to_stay_is_that_of_an_error_in_every_direction() {
        let (field, _) = field_seen(|_| [0.0; 3], Some(&|_| [0.0; 3]));
        let inner = erode(&Mask::from_data(field.forward.grid, field.believed.clone()), 5.0);
        assert!(inner.count() > 1000);
        for (n, _) in inner.data.iter().enumerate().filter(|(_, b)| **b) {
            // 2.795 standard deviations of a component.
            let expected = 2.795_48 * 0.5 / 3f32.sqrt();
            assert!((field.reach95_mm[n] - expected).abs() < 0.005, "{}", field.reach95_mm[n]);
        }
    }

    #[test]
    fn inside_it_is_the_meshs_own_and_it_falls_to_zero_at_the_skull_and_can_be_inverted() {
        let (field, around) = field(|x| [0.01 * x[2], -1.0, 0.5 + 0.005 * x[0]]);
        assert!(field.jacobian_min > 0.05 && field.changed == 0, "{} {}", field.jacobian_min, field.changed);
        let outside = dilate(&around.brain, 8.0);
        for n in 0..field.whole.len() {
            if !outside.data[n] {
                assert_eq!(field.forward_at(field.whole.voxel(n)), [0.0; 3]);
            }
        }
        let resected = field.on_whole(&field.believed);
        assert!(resected.data.iter().zip(&around.resected.data).all(|(b, r)| !(*b && *r)), "nothing is known there");
        assert!(field.believed.iter().filter(|b| **b).count() > 1000);
        // Where the field bends between two voxels of 2 mm, at the rim of the tissue, the map back bends elsewhere.
        let believed = Mask::from_data(field.forward.grid, field.believed.clone());
        let inner = erode(&believed, 5.0);
        assert!(inner.count() > 1000);
        for (n, _) in inner.data.iter().enumerate().filter(|(_, b)| **b).step_by(97) {
            let grid = &field.forward.grid;
            let p: [f64; 3] = grid.centre(grid.voxel(n)).mm.into();
            let there = carried(&field.forward, p).unwrap();
            let home = carried(&field.inverse, there).unwrap();
            assert!((0..3).all(|a| (home[a] - p[a]).abs() < 0.05), "{p:?} {home:?}");
            assert!((field.sd_mm[n] - 0.5).abs() < 1e-6 && (field.reach95_mm[n] - 3.0).abs() < 1e-6);
        }
        assert_eq!(Pre::NAME, "pre");
    }

    #[test]
    fn a_shift_to_the_right_stays_one_to_the_right_of_the_head() {
        let (field, _) = field(|_| [10.0, 0.0, 0.0]);
        let turn = nalgebra::UnitQuaternion::from_scaled_axis(Vector3::new(0.1, -0.2, 0.3));
        let expected = turn * Vector3::new(10.0, 0.0, 0.0);
        let (largest, median, at) = field.sizes().unwrap();
        assert!((largest - 10.0).abs() < 0.01 && (median - 10.0).abs() < 0.01);
        let there = carried(&field.forward, at).unwrap();
        assert!((0..3).all(|a| (there[a] - at[a] - expected[a]).abs() < 0.01));
    }
}
