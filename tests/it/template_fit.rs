//! The template laid onto a head: its surface comes to lie on the brain's.

use hgm::geometry::{AffineTransform, Mni, Position, Pre, RigidTransform};
use hgm::image::Volume;
use hgm::image::distance::signed_distance_mm;
use hgm::material::random::CounterRng;
use hgm::register::deformable::DeformableSettings;
use hgm::segment::{AtlasPriors, atlas, carried_priors, fit_template};
use nalgebra::{Matrix3, Vector3};

/// The template's own brain at a head's size, under a layer of fluid, bone and scalp, mm.
fn head_around(template_from_head: &AffineTransform<Mni, Mni>, fluid_mm: f64, bone_mm: f64) -> Volume<f32, Pre> {
    let template = atlas::template();
    let (grid, t1, away) = (template.grid(), template.t1_f32(), signed_distance_mm(&template.brain()));
    let brightest = t1.data.iter().copied().fold(0.0, f32::max);
    let head_per_template = template_from_head.linear.determinant().powf(-1.0 / 3.0);
    let head: Volume<f32, Mni> = Volume::from_fn(grid, |n| {
        let place: Position<Mni> = grid.position(grid.voxel(n).map(|v| v as f64).into());
        let there = template_from_head.apply(place);
        let outside_mm = head_per_template * f64::from(away.trilinear(there).unwrap_or(60.0));
        let bright = match outside_mm {
            d if d < 0.0 => return t1.trilinear(there).unwrap_or(0.0),
            d if d < fluid_mm => 0.25,
            d if d < fluid_mm + bone_mm => 0.1,
            d if d < fluid_mm + bone_mm + 6.0 => 1.1,
            _ => 0.0,
        };
        bright * brightest
    });
    head.relabelled()
}

/// The same head under a coil that sees the crown a quarter as bright as the base, in noise.
fn dimly(head: &Volume<f32, Pre>) -> Volume<f32, Pre> {
    let brightest = f64::from(head.data.iter().copied().fold(0.0, f32::max));
    let rng = CounterRng::new(5, 5);
    Volume::from_fn(head.grid, |n| {
        let place = head.grid.position(head.grid.voxel(n).map(|v| v as f64).into()).mm;
        let noise: f64 = (0..4).map(|c| rng.uniform(4 * n as u64 + c) - 0.5).sum::<f64>() * 3f64.sqrt();
        (f64::from(head.data[n]) * (-place.z / 90.0).exp() + 0.06 * brightest * noise).max(0.0) as f32
    })
}

fn surface_cc(priors: &AtlasPriors) -> f64 {
    priors.brain_mm.map(|mm| mm < 0.0).volume_cc()
}

#[test]
fn a_small_heads_scalp_is_not_taken_for_pia() {
    // Of this size a bare brain of the usual size agrees better with the head than the whole mean head does.
    let template_from_head = AffineTransform::from_parts(Matrix3::from_diagonal_element(1.0 / 0.74), Vector3::zeros());
    let own_cc = surface_cc(&carried_priors(|p| template_from_head.apply(p)));
    let head = head_around(&template_from_head, 1.0, 4.0);
    let fit = fit_template(&head, &RigidTransform::identity(), &DeformableSettings::default()).unwrap();
    let found_cc = surface_cc(&carried_priors(|p| fit.atlas_from_subject.apply(p)));
    assert!((found_cc / own_cc - 1.0).abs() < 0.08, "{found_cc} cc of {own_cc}: {:?}", fit.quality);
}

#[test]
fn slow_the_carried_surface_is_drawn_neither_in_nor_out_by_what_surrounds_the_brain() {
    let template_from_head = atlas::head_from_template().inverse().unwrap();
    let own_cc = surface_cc(&carried_priors(|p| template_from_head.apply(p)));
    let narrow = head_around(&template_from_head, 1.0, 4.0);
    for head in [dimly(&narrow), narrow, head_around(&template_from_head, 2.5, 5.0)] {
        let fit = fit_template(&head, &RigidTransform::identity(), &DeformableSettings::default()).unwrap();
        let found_cc = surface_cc(&carried_priors(|p| fit.atlas_from_subject.apply(p)));
        assert!((found_cc / own_cc - 1.0).abs() < 0.04, "{found_cc} cc of {own_cc}: {:?}", fit.quality);
    }
}
