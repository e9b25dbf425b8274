//! `./run bench [ROOM ...]`: measures the bars of the issues and prints them side by side. Never part of a timed test.

mod bar;
mod bytes;
#[path = "../it/cluster.rs"]
mod cluster;
mod cohort;
mod experiment;
mod fem;
mod imaging;
mod job;
mod kills;
mod material;
mod mesh;
mod pairs;
mod patients;
#[path = "../it/python.rs"]
#[allow(dead_code, reason = "the tests use more of it")]
mod python;

use bar::Bar;

type Room = (&'static str, fn() -> Vec<Bar>);

fn main() {
    let rooms: Vec<Room> = vec![
        ("imaging", imaging::bars),
        ("mesh", mesh::bars),
        ("material", material::bars),
        ("fem", fem::bars),
        ("experiment", experiment::bars),
        ("pairs", pairs::bars),
        ("patients", patients::bars),
        ("kills", kills::bars),
        ("bytes", bytes::bars),
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
        for Bar { name, bar, measured, met: reached } in bars() {
            println!("{} {name:<44} bar {bar:<44} measured {measured}", if reached { "met    " } else { "NOT MET" });
            met += usize::from(reached);
            all += 1;
        }
    }
    println!("\n{met} of {all} bars met");
}
