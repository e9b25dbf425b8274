//! `./run bench [ROOM ...]`: measures the bars of the issues, prints them side by side and writes them to
//! `docs/evidence/ROOM.md`. Never part of a timed test.

mod bar;
mod bytes;
#[path = "../it/cluster.rs"]
mod cluster;
mod cohort;
mod confidence;
mod contact;
mod corruptions;
mod evidence;
mod experiment;
mod fem;
mod fields;
mod heads;
#[path = "../it/fem/hertz.rs"]
mod hertz;
mod imaging;
mod job;
mod kills;
mod live;
mod material;
mod mesh;
#[path = "../it/fem/meshes.rs"]
#[allow(dead_code, reason = "the tests use more of it")]
mod meshes;
mod pairs;
mod patients;
mod predict;
#[path = "../it/python.rs"]
#[allow(dead_code, reason = "the tests use more of it")]
mod python;
#[path = "../it/sequences.rs"]
mod sequences;
mod stale;
mod study_level;
#[path = "../it/fem/walls.rs"]
mod walls;

use bar::Bar;

type Room = (&'static str, fn() -> Vec<Bar>);

fn main() {
    let rooms: Vec<Room> = vec![
        ("imaging", imaging::bars),
        ("heads", heads::bars),
        ("corruptions", corruptions::bars),
        ("confidence", confidence::bars),
        ("mesh", mesh::bars),
        ("material", material::bars),
        ("study-level", study_level::bars),
        ("fem", fem::bars),
        ("contact", contact::bars),
        ("live", live::bars),
        ("experiment", experiment::bars),
        ("pairs", pairs::bars),
        ("patients", patients::bars),
        ("predict", predict::bars),
        ("fields", fields::bars),
        ("kills", kills::bars),
        ("bytes", bytes::bars),
        ("stale", stale::bars),
        ("job", job::bars),
        ("cohort", cohort::bars),
    ];
    let wanted: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    if bar::data().is_none() {
        println!("HGM_BENCH_DATA is not set: bars that need the measuring data are skipped, each room says which.");
    }
    let (mut met, mut all) = (0, 0);
    for (name, bars) in rooms.into_iter().filter(|(name, _)| wanted.is_empty() || wanted.iter().any(|w| w == name)) {
        println!("\n== {name}");
        let bars = bars();
        evidence::write(name, bar::data().is_some(), &bars);
        for Bar { name, bar, measured, met: reached } in bars {
            println!("{} {name:<44} bar {bar:<44} measured {measured}", if reached { "met    " } else { "NOT MET" });
            met += usize::from(reached);
            all += 1;
        }
    }
    println!("\n{met} of {all} bars met");
}
