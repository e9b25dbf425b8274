//! Label maps of other tools at the door of `hgm mesh`: what is right is carried over, what is wrong or mixed up is refused.

use crate::job::output;
use hgm::geometry::Native;
use hgm::image::nifti::encode_i16;
use hgm::image::{Grid, Volume};

/// What lies where in a model head: two half balls of white matter under cortex, ventricles, a cerebellum, fluid, skull.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    Air,
    Skull,
    Fluid,
    Cortex(bool),
    White(bool),
    Ventricle(bool),
    Thalamus(bool),
    Cerebellum(bool),
}

fn place(p: [f64; 3]) -> Place {
    let left = p[0] < 0.0;
    let far = |c: [f64; 3]| ((p[0] - c[0]).powi(2) + (p[1] - c[1]).powi(2) + (p[2] - c[2]).powi(2)).sqrt();
    let low = far([0.0, -30.0, -50.0]);
    match far([0.0; 3]) {
        r if r < 14.0 => Place::Ventricle(left),
        r if r < 20.0 => Place::Thalamus(left),
        r if r < 48.0 => Place::White(left),
        r if r < 60.0 => Place::Cortex(left),
        _ if low < 24.0 => Place::Cerebellum(left),
        r if r < 66.0 || low < 28.0 => Place::Fluid,
        r if r < 72.0 => Place::Skull,
        _ => Place::Air,
    }
}

type Numbers = fn(Place) -> i16;

fn pick(left: bool, l: i16, r: i16) -> i16 {
    if left { l } else { r }
}

fn freesurfer(p: Place) -> i16 {
    match p {
        Place::Air | Place::Skull => 0,
        Place::Fluid => 24,
        Place::Cortex(l) => pick(l, 3, 42),
        Place::White(l) => pick(l, 2, 41),
        Place::Ventricle(l) => pick(l, 4, 43),
        Place::Thalamus(l) => pick(l, 10, 49),
        Place::Cerebellum(l) => pick(l, 8, 47),
    }
}

fn parcels(p: Place) -> i16 {
    match p {
        Place::Cortex(l) => pick(l, 1028, 2028),
        p => freesurfer(p),
    }
}

fn synthseg(p: Place) -> i16 {
    if p == Place::Skull { 515 } else { freesurfer(p) }
}

fn charm(p: Place) -> i16 {
    match p {
        Place::Air => 0,
        Place::Skull => 8,
        Place::Fluid | Place::Ventricle(_) => 3,
        Place::Cortex(_) | Place::Thalamus(_) => 2,
        Place::White(_) => 1,
        // A little scalp, which no map of the tool is without.
        Place::Cerebellum(l) => pick(l, 2, 5),
    }
}

fn gif(p: Place) -> i16 {
    match p {
        Place::Air => 0,
        Place::Skull => 1,
        Place::Fluid => 4,
        Place::Cortex(l) => pick(l, 144, 143),
        Place::White(l) => pick(l, 92, 84),
        Place::Ventricle(l) => pick(l, 53, 52),
        Place::Thalamus(l) => pick(l, 61, 60),
        Place::Cerebellum(l) => pick(l, 40, 39),
    }
}

fn muse(p: Place) -> i16 {
    match p {
        Place::Air | Place::Skull => 0,
        Place::Fluid => 46,
        Place::Cortex(l) => pick(l, 143, 142),
        Place::White(l) => pick(l, 82, 81),
        Place::Ventricle(l) => pick(l, 52, 51),
        Place::Thalamus(l) => pick(l, 60, 59),
        Place::Cerebellum(l) => pick(l, 39, 38),
    }
}

fn own(p: Place) -> i16 {
    match p {
        Place::Air | Place::Skull => 0,
        Place::Fluid => 1,
        Place::Cortex(_) | Place::Thalamus(_) | Place::Cerebellum(_) => 2,
        Place::White(_) => 3,
        Place::Ventricle(_) => 4,
    }
}

fn map(numbers: impl Fn(Place) -> i16 + Sync + Send) -> Volume<i16, Native> {
    let grid = Grid::axis_aligned([52, 56, 56], [3.0; 3], [-76.5, -84.0, -88.5]);
    Volume::from_fn(grid, |n| {
        let v = grid.voxel(n).map(|v| v as f64);
        numbers(place([0, 1, 2].map(|a| grid.mm_from_voxel[(a, 3)] + 3.0 * v[a])))
    })
}

/// Exit code and what was said.
fn meshed(map: &Volume<i16, Native>, more: &[&str]) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("map.nii.gz"), encode_i16(map)).unwrap();
    let (file, mesh) = (path("map.nii.gz"), path("mesh.vtu"));
    let made = output(&[&["mesh", "-v", &file, "-o", &mesh, "--cells", "1500"], more].concat());
    (made.status.code(), String::from_utf8_lossy(&made.stderr).into_owned())
}

#[test]
fn a_map_of_every_tool_is_meshed_and_the_log_says_whose_it_is() {
    let tools: [(Numbers, &str, &str); 7] = [
        (freesurfer, "freesurfer", "synthseg"),
        (parcels, "freesurfer", "synthseg"),
        (synthseg, "synthseg", "synthseg"),
        (charm, "charm", "charm"),
        (gif, "gif", "gif"),
        (muse, "muse", "muse"),
        (own, "hgm", "hgm"),
    ];
    for (numbers, asked, found) in tools {
        let (code, said) = meshed(&map(numbers), &["--labels", asked]);
        assert_eq!(code, Some(0), "{asked}: {said}");
        assert!(said.contains(&format!("read with the table {asked}")), "{said}");
        let (code, said) = meshed(&map(numbers), &[]);
        let words = if found == "hgm" { "taken for hgm's own numbers" } else { "read with the table" };
        assert!(code == Some(0) && said.contains(words), "{found}: {said}");
    }
}

#[test]
fn twenty_wrong_or_mixed_up_maps_are_refused() {
    let exchanged = |numbers: Numbers, a: i16, b: i16| {
        map(move |p| match numbers(p) {
            n if n == a => b,
            n if n == b => a,
            n => n,
        })
    };
    let mirrored = |numbers: Numbers| {
        let map = map(numbers);
        let [nx, ..] = map.grid.dims;
        Volume::from_fn(map.grid, |n| {
            let [i, j, k] = map.grid.voxel(n);
            map.at(nx - 1 - i, j, k)
        })
    };
    let with = |numbers: Numbers, code: i16| map(move |p| if p == Place::Thalamus(true) { code } else { numbers(p) });
    let without = |numbers: Numbers, gone: fn(Place) -> bool| map(move |p| if gone(p) { 0 } else { numbers(p) });
    let wrong: Vec<(&str, Volume<i16, Native>, &str)> = vec![
        ("aseg as hgm's own", map(freesurfer), "hgm"),
        ("aseg as GIF's", map(freesurfer), "gif"),
        ("aseg as MUSE's", map(freesurfer), "muse"),
        ("aseg as charm's", map(freesurfer), "charm"),
        ("GIF's as FreeSurfer's", map(gif), "freesurfer"),
        ("GIF's as MUSE's", map(gif), "muse"),
        ("MUSE's as GIF's", map(muse), "gif"),
        ("charm's as hgm's own", map(charm), "hgm"),
        ("hgm's own as charm's", map(own), "charm"),
        ("hgm's own as FreeSurfer's", map(own), "freesurfer"),
        ("the training map as FreeSurfer's", map(synthseg), "freesurfer"),
        ("a number of no tool", with(freesurfer, 999), ""),
        ("a number of another tool", with(gif, 10), ""),
        ("left and right exchanged", mirrored(freesurfer), ""),
        ("left and right exchanged, MUSE", mirrored(muse), ""),
        ("grey and white exchanged", map(|p| exchange_white(freesurfer(p))), ""),
        ("fluid and white exchanged in hgm's", exchanged(own, 1, 3), "hgm"),
        ("white matter missing", without(freesurfer, |p| matches!(p, Place::White(_))), "freesurfer"),
        (
            "the right half missing",
            without(freesurfer, |p| matches!(p, Place::White(false) | Place::Cortex(false))),
            "freesurfer",
        ),
        ("the left half alone, and nobody says whose", without(freesurfer, right), ""),
        ("fluid and ventricles exchanged in hgm's", exchanged(own, 1, 4), "hgm"),
        ("a mask", map(|p| i16::from(own(p) > 0)), "hgm"),
        (
            "the brain of a mouse",
            Volume::from_data(Grid::axis_aligned([52, 56, 56], [0.3; 3], [-7.65, -8.4, -8.85]), map(freesurfer).data),
            "",
        ),
    ];
    assert!(wrong.len() >= 20);
    for (what, map, table) in wrong {
        let more: &[&str] = if table.is_empty() { &[] } else { &["--labels", table] };
        let (code, said) = meshed(&map, more);
        assert_eq!(code, Some(3), "{what}: {said}");
        assert!(said.contains("map.nii.gz"), "{what}: {said}");
    }
}

#[test]
fn a_label_of_which_no_tetrahedron_is_left_is_told_by_name_and_refused_but_for_a_stray_voxel() {
    let head = map(own);
    let beside = |edge: usize| {
        Volume::from_fn(head.grid, |n| if head.grid.voxel(n).iter().all(|&v| v < edge) { 6 } else { head.data[n] })
    };
    let (code, said) = meshed(&beside(1), &["--labels", "hgm"]);
    assert_eq!(code, Some(0), "{said}");
    let (code, said) = meshed(&beside(3), &["--labels", "hgm"]);
    assert!(code == Some(4) && said.contains("nothing of tumour"), "{code:?}: {said}");
    let specks = |n: usize| head.data[n] == 0 && head.grid.voxel(n).iter().all(|v| v % 2 == 0);
    let speckled = Volume::from_fn(head.grid, |n| if specks(n) { 6 } else { head.data[n] });
    let (code, said) = meshed(&speckled, &["--labels", "hgm"]);
    assert!(code == Some(4) && said.contains("nothing of tumour"), "{code:?}: {said}");
}

fn right(p: Place) -> bool {
    matches!(
        p,
        Place::White(false)
            | Place::Cortex(false)
            | Place::Ventricle(false)
            | Place::Thalamus(false)
            | Place::Cerebellum(false)
    )
}

fn exchange_white(n: i16) -> i16 {
    match n {
        2 => 3,
        3 => 2,
        41 => 42,
        42 => 41,
        n => n,
    }
}

#[test]
fn numbers_of_no_tool_are_meshed_as_they_are_and_a_table_of_ones_own_names_them() {
    let lump = |p: Place| match p {
        Place::White(_) | Place::Thalamus(_) => 20,
        Place::Cortex(_) => 30,
        Place::Ventricle(_) => 40,
        _ => 0,
    };
    let (code, said) = meshed(&map(lump), &[]);
    assert_eq!(code, Some(0), "{said}");
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("mine.tsv");
    std::fs::write(&table, "index\tname\ttissue\n20\tcore\twhite_matter\n30\trim\tgrey_matter\n40\tlump\ttumour\n")
        .unwrap();
    let (code, said) = meshed(&map(lump), &["--labels", table.to_str().unwrap()]);
    assert!(code == Some(0) && said.contains("tumour"), "{said}");
    std::fs::write(&table, "index\tname\ttissue\n20\tcore\twhite_matter\n30\trim\tgrey_matter\n").unwrap();
    let (code, said) = meshed(&map(lump), &["--labels", table.to_str().unwrap()]);
    assert!(code == Some(3) && said.contains("40 ("), "{said}");
    let (code, said) = meshed(&map(lump), &["--labels", "slicer"]);
    assert!(code == Some(3) && said.contains("freesurfer") && said.contains("FILE.tsv"), "{said}");
}

#[test]
fn what_lies_apart_is_left_out_of_a_mesh_and_said_so() {
    let apart = |size: usize| {
        let mut map = map(own);
        // In the corner, far from the head: cells of 27 mm3.
        let grid = map.grid;
        for (n, number) in map.data.iter_mut().enumerate() {
            if grid.voxel(n).iter().all(|v| (1..=size).contains(v)) {
                *number = 3;
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        std::fs::write(path("map.nii.gz"), encode_i16(&map)).unwrap();
        let made = output(&["mesh", &path("map.nii.gz"), "-o", &path("mesh.vtu"), "--cells", "1500"]);
        String::from_utf8_lossy(&made.stdout).into_owned()
    };
    let told = apart(3);
    assert!(told.contains("left out: 0.73 cc of white_matter"), "{told}");
    assert!(!apart(2).contains("left out"), "a speck");
}
