//! Cells of several tissues.

use super::meshes::two_tissue_cube;
use hgm::fem::{Scenario, simulate};
use hgm::geometry::Mni;
use hgm::image::{Grid, LabelMap};
use hgm::mesh::{TetMesh, tissue_fractions};

/// Energy in a bar that is stretched by a hundredth, J: its base slides, its top is moved.
fn stretched_j(mesh: &TetMesh, grey_pa: f64, white_pa: f64, element: &str) -> f64 {
    let text = format!(
        "prescribed = [{{ set = 'z0', displacement_mm = [0.0, 0.0, 0.0], components = [false, false, true] }}, \
         {{ set = 'x0', displacement_mm = [0.0, 0.0, 0.0], components = [true, false, false] }}, \
         {{ set = 'z1', displacement_mm = [0.0, 0.0, 0.4], components = [false, false, true] }}]\n\
         [materials.grey_matter]\nlaw = 'neo-hookean'\nshear_modulus_pa = {grey_pa:?}\npoisson_ratio = 0.45\n\
         [materials.white_matter]\nlaw = 'neo-hookean'\nshear_modulus_pa = {white_pa:?}\npoisson_ratio = 0.45\n\
         [solver]\nelement = '{element}'\nrelative_residual = 1e-10\n"
    );
    let outcome = simulate(mesh, &Scenario::from_toml(&text).unwrap(), &|_| ()).unwrap();
    let of_cell = |t: usize| 1e-9 * mesh.volume_mm3(t) * outcome.strain_energy_density_pa[t];
    (0..mesh.tets().len()).map(of_cell).sum()
}

#[test]
fn a_bar_of_alternating_voxels_has_the_stiffness_of_voigts_mean() {
    let mut mesh = two_tissue_cube(4, 40.0);
    // Cells of 10 mm of voxels of 2 mm: neither tissue is seen by any cell alone.
    let grid = Grid::<Mni>::axis_aligned([20; 3], [2.0; 3], [1.0; 3]);
    let map = LabelMap::from_fn(grid, |n| 2 + (grid.voxel(n).iter().sum::<usize>() % 2) as u8);
    let fractions = tissue_fractions(&mesh, &map);
    assert!(fractions[&3].iter().all(|f| (f - 0.5).abs() < 0.2), "{fractions:?}");
    mesh.set_fractions(fractions).unwrap();
    for element in ["tet4", "tet4-nodal"] {
        let voigt = stretched_j(&mesh, 500.0, 2000.0, element) / stretched_j(&mesh, 1250.0, 1250.0, element);
        // The other bound, Reuss's, is 800 of 1250 Pa.
        assert!((0.97..1.01).contains(&voigt), "{element}: {voigt}");
    }
}

#[test]
fn cells_of_equal_parts_are_a_body_of_their_mean() {
    let mut mesh = two_tissue_cube(3, 40.0);
    let cells = mesh.tets().len();
    mesh.set_fractions([(2, vec![0.25; cells]), (3, vec![0.75; cells])].into()).unwrap();
    for element in ["tet4", "tet4-nodal", "tet10"] {
        let [mixed, mean] = [[400.0, 2000.0], [1600.0, 1600.0]].map(|[g, w]| stretched_j(&mesh, g, w, element));
        assert!((mixed / mean - 1.0).abs() < 1e-8, "{element}: {mixed} {mean}");
    }
}

#[test]
fn mixed_cells_move_alike_on_one_and_two_threads() {
    let mut mesh = two_tissue_cube(4, 40.0);
    let white: Vec<f64> = (0..mesh.tets().len()).map(|t| (t % 5) as f64 / 4.0).collect();
    let grey = white.iter().map(|f| 1.0 - f).collect();
    mesh.set_fractions([(2, grey), (3, white)].into()).unwrap();
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| stretched_j(&mesh, 500.0, 2000.0, "tet4-nodal"))
    };
    assert_eq!(on(1).to_bits(), on(2).to_bits());
}
