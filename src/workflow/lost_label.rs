//! Labels of a map of which its mesh has nothing.

use crate::anatomy::label;
use crate::geometry::Frame;
use crate::image::LabelMap;
use crate::mesh::TetMesh;
use thiserror::Error;

/// What a label is called.
pub(super) fn name_of_label(number: u8) -> String {
    label::name(number).map_or_else(|| format!("label {number}"), str::to_owned)
}

/// A label of a map of which its mesh has nothing.
#[derive(Clone, Debug, PartialEq, Error)]
#[error(
    "the mesh has nothing of {}: all its {:.2} cc lie apart from the rest or in pieces too small for tetrahedra of {edge_mm:.1} mm; \
     ask for more cells or shorter edges, or look at the label map",
    name_of_label(*.label), mm3 / 1000.0
)]
pub struct LostLabel {
    /// Its number.
    pub label: u8,
    /// What the map has of it, mm3.
    pub mm3: f64,
    /// Target edge of the mesh, mm.
    pub edge_mm: f64,
}

/// Labels of the map, but for those left out on purpose, of which the mesh has nothing, however little it was.
pub(crate) fn lost_labels<F: Frame>(map: &LabelMap<F>, mesh: &TetMesh, without: &[u8], edge_mm: f64) -> Vec<LostLabel> {
    let mut voxels = [0usize; 256];
    map.data.iter().for_each(|&l| voxels[usize::from(l)] += 1);
    let lost = |l: &u8| voxels[usize::from(*l)] > 0 && !without.contains(l) && !mesh.labels().contains(l);
    let told = |label: u8| {
        let mm3 = voxels[usize::from(label)] as f64 * map.grid.voxel_volume_mm3();
        LostLabel { label, mm3, edge_mm }
    };
    (1..=u8::MAX).filter(lost).map(told).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mni;
    use crate::image::Grid;

    #[test]
    fn a_label_that_is_wholly_lost_is_told_however_small_and_one_left_out_is_not() {
        let grid = Grid::<Mni>::axis_aligned([4; 3], [1.0; 3], [0.0; 3]);
        let numbers = [label::CSF, label::RESECTED, label::WHITE_MATTER];
        let map = LabelMap::from_fn(grid, |n| numbers.get(n).copied().unwrap_or(label::GREY_MATTER));
        let nodes = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]];
        let labels = vec![label::GREY_MATTER, label::WHITE_MATTER];
        let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4]], labels).unwrap();
        let lost = lost_labels(&map, &mesh, &[label::CSF], 2.5);
        assert_eq!(lost, [LostLabel { label: label::RESECTED, mm3: 1.0, edge_mm: 2.5 }]);
        let said = lost[0].to_string();
        assert!(said.contains("nothing of resected") && said.contains("more cells"), "{said}");
    }
}
