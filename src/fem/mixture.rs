//! What of a cell is which material.
//!
//! A cell whose parts are of several tissues deforms as one, so the energy in it is the sum of its tissues' by their parts,
//! W = sum_i f_i W_i (Voigt, Annalen der Physik 274, 1889): for any law the integral of the energy over the cell under a
//! deformation that is constant in it. So such a cell is assembled once for each tissue with a part of its volume, and stress,
//! tangent and sensitivities are sums as the energy is.
//!
//! It bounds the energy of any arrangement from above (Hill, Proc. Phys. Soc. A 65, 1952; for large strain Ogden, Int. J. Solids
//! Structures 14, 1978). The bound is the stiff one: soft tissue within a cell cannot give way by itself.

use super::FemError;
use super::portion::Portion;
use super::scenario::Scenario;
use crate::mesh::TetMesh;
use crate::mesh::format::vtu::fraction_name;

/// A tissue with less of a cell is left to the others. About a hundred parts of a cell are counted, so less than this is hardly
/// told from none, and every tissue of a cell is assembled by itself.
const LEAST_SHARE: f64 = 0.05;

/// What fills every cell, in order of the cells, and the names that materials are counted by; checks names both ways.
pub(super) fn portions(mesh: &TetMesh, scenario: &Scenario) -> Result<(Vec<Portion>, Vec<String>), FemError> {
    for (first, number) in &scenario.labels {
        let same = scenario.labels.iter().find(|(other, n)| *other > first && *n == number);
        if let Some((second, _)) = same {
            let (first, second) = (first.clone(), second.clone());
            return Err(FemError::SameLabel { first, second, number: *number });
        }
    }
    let names: Vec<String> = scenario.materials.keys().cloned().collect();
    for name in &names {
        if scenario.label_number(name).is_none() {
            return Err(FemError::UnknownLabel { name: name.clone() });
        }
    }
    let mut index_of_label = [None; 256];
    let mut material_of = |cell: usize, label: u8| {
        if let Some(index) = index_of_label[usize::from(label)] {
            return Ok(index);
        }
        let name = scenario.label_name(label).ok_or(FemError::UnnamedLabel { cell, label })?;
        let index = names.iter().position(|n| n == name);
        let index = index.ok_or_else(|| FemError::NoMaterial { cell, label, name: name.to_owned() })? as u16;
        index_of_label[usize::from(label)] = Some(index);
        Ok(index)
    };
    check_fractions(mesh)?;
    let mut portions = Vec::with_capacity(mesh.tets().len());
    for (cell, &label) in mesh.labels().iter().enumerate() {
        let of_cell =
            || mesh.fractions().iter().map(|(&label, of)| (label, of[cell])).filter(|(_, f)| *f >= LEAST_SHARE);
        let whole: f64 = of_cell().map(|(_, fraction)| fraction).sum();
        if whole == 0.0 {
            portions.push(Portion { cell: cell as u32, material: material_of(cell, label)?, share: 1.0 });
        }
        for (label, fraction) in of_cell() {
            portions.push(Portion { cell: cell as u32, material: material_of(cell, label)?, share: fraction / whole });
        }
    }
    Ok((portions, names))
}

/// Labels that were changed after the fractions were written would be of no effect, as what lies within a cell counts.
fn check_fractions(mesh: &TetMesh) -> Result<(), FemError> {
    let of = mesh.fractions();
    match mesh.labels().iter().enumerate().find(|(_, label)| !of.is_empty() && !of.contains_key(label)) {
        Some((cell, &label)) => Err(FemError::NoFraction { cell, label, name: fraction_name(label) }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::Model;
    use crate::fem::manufactured::cube;
    use crate::fem::reduce::dot;
    use crate::mesh::{Fractions, TetMesh};

    const LAWS: &str = "
        fixed = ['faces']
        [materials.grey_matter]
        law = 'neo-hookean'
        shear_modulus_pa = 1370.0
        poisson_ratio = 0.45
        [materials.white_matter]
        law = 'ogden'
        terms = [{ mu_pa = -500.0, alpha = -4.0 }]
        poisson_ratio = 0.4
        [solver]
    ";

    fn shares(grey: f64) -> Vec<(u16, f64)> {
        let nodes = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3]], vec![2]).unwrap();
        mesh.set_fractions(Fractions::from([(2, vec![grey]), (3, vec![1.0 - grey])])).unwrap();
        let (portions, names) = portions(&mesh, &Scenario::from_toml(LAWS).unwrap()).unwrap();
        assert_eq!(names, ["grey_matter", "white_matter"]);
        portions.into_iter().map(|p| (p.material, p.share)).collect()
    }

    #[test]
    fn shares_sum_to_one_and_a_trace_of_a_tissue_is_left_to_the_other() {
        assert_eq!(shares(0.25), [(0, 0.25), (1, 0.75)]);
        assert_eq!(shares(1.0), [(0, 1.0)]);
        assert_eq!(shares(0.96), [(0, 1.0)]);
        // What lies within a cell counts, not what it is labelled.
        assert_eq!(shares(0.04), [(1, 1.0)]);
    }

    #[test]
    fn a_label_of_which_no_fraction_is_told_is_refused_and_one_that_is_told_of_as_none_is_not() {
        let nodes = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3]], vec![6]).unwrap();
        mesh.set_fractions(Fractions::from([(2, vec![1.0])])).unwrap();
        let refused = portions(&mesh, &Scenario::from_toml(LAWS).unwrap()).unwrap_err();
        assert!(matches!(refused, FemError::NoFraction { cell: 0, label: 6, .. }), "{refused}");
        assert!(refused.to_string().contains("`fraction:tumour`"), "{refused}");
        mesh.set_fractions(Fractions::from([(2, vec![1.0]), (6, vec![0.0])])).unwrap();
        assert!(portions(&mesh, &Scenario::from_toml(LAWS).unwrap()).is_ok());
    }

    /// The block with white matter in every cell, more of it from cell to cell.
    fn mixed() -> TetMesh {
        let mut mesh = cube(3);
        let white: Vec<f64> = (0..mesh.tets().len()).map(|t| (t % 11) as f64 / 10.0).collect();
        let grey = white.iter().map(|f| 1.0 - f).collect();
        mesh.set_fractions(Fractions::from([(2, grey), (3, white)])).unwrap();
        mesh
    }

    #[test]
    fn stress_of_mixed_cells_is_the_slope_of_their_energy_and_their_energy_is_the_bodys() {
        let mesh = mixed();
        let wave = |phase: f64| -> Vec<[f64; 3]> {
            let at = |x: &[f64; 3], i: usize| 12.0 * (0.0041 * x[i] + 0.0027 * x[(i + 1) % 3] + phase + i as f64).sin();
            mesh.nodes_mm().iter().map(|x| [0, 1, 2].map(|i| at(x, i))).collect()
        };
        for element in ["tet4", "tet4-nodal", "tet10"] {
            let scenario = Scenario::from_toml(&format!("{LAWS}element = '{element}'")).unwrap();
            let model = Model::new(&mesh, &scenario).unwrap();
            let laws = model.laws(&scenario.materials).unwrap();
            let [u, along] = [0.4, 2.3].map(|phase| model.state(&wave(phase)).unwrap().u);
            let energy = |step: f64| {
                let moved: Vec<[f64; 3]> =
                    u.iter().zip(&along).map(|(u, d)| [0, 1, 2].map(|i| u[i] + step * d[i])).collect();
                model.energy(&moved, &laws)
            };
            let mut forces = vec![[0.0; 3]; u.len()];
            model.internal_forces(&u, &laws, &mut forces);
            let (slope, step) = (dot(&forces, &along), 1e-4);
            let differences = (energy(step) - energy(-step)) / (2.0 * step);
            assert!((slope / differences - 1.0).abs() < 1e-6, "{element}: {slope} {differences}");
            let of_cells: f64 =
                model.body.state(&u, &laws).iter().enumerate().map(|(t, s)| s[2] * mesh.volume_mm3(t)).sum();
            assert!((1e-9 * of_cells / energy(0.0) - 1.0).abs() < 1e-10, "{element}: {of_cells} {}", energy(0.0));
        }
    }

    #[test]
    fn cells_of_one_tissue_have_the_forces_and_the_energy_they_had_to_the_bit() {
        let cells = cube(3);
        let labels = (0..cells.tets().len()).map(|t| if t % 4 == 0 { 3 } else { 2 }).collect();
        let mut plain = TetMesh::new(cells.nodes_mm().to_vec(), cells.tets().to_vec(), labels).unwrap();
        plain.node_sets = cells.node_sets;
        let mut mesh = plain.clone();
        let of = |label: u8| plain.labels().iter().map(|l| f64::from(u8::from(*l == label))).collect();
        mesh.set_fractions(Fractions::from([(2, of(2)), (3, of(3))])).unwrap();
        for element in ["tet4", "tet4-nodal", "tet10"] {
            let scenario = Scenario::from_toml(&format!("{LAWS}element = '{element}'")).unwrap();
            let of = |mesh: &TetMesh| {
                let model = Model::new(mesh, &scenario).unwrap();
                let laws = model.laws(&scenario.materials).unwrap();
                let mm: Vec<[f64; 3]> = mesh.nodes_mm().iter().map(|x| x.map(|x| 8.0 * (0.011 * x).sin())).collect();
                let u = model.state(&mm).unwrap().u;
                let mut forces = vec![[0.0; 3]; u.len()];
                model.internal_forces(&u, &laws, &mut forces);
                (model.energy(&u, &laws), forces, model.body.state(&u, &laws))
            };
            assert!(of(&mesh) == of(&plain), "{element}");
        }
    }
}
