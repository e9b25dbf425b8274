//! Bar of stale answers: random sequences of commands in one folder.

use crate::bar::Bar;
use crate::sequences::Bench;
use std::path::Path;

const SEQUENCES: u64 = 30;
const STEPS: u64 = 6;

pub fn bars() -> Vec<Bar> {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::new(Path::new(env!("CARGO_BIN_EXE_hgm")), folder.path());
    let (mut right, mut refused, mut wrong) = (0, 0, Vec::new());
    for seed in 0..SEQUENCES {
        let tally = bench.sequence(seed, STEPS);
        right += tally.right;
        refused += tally.refused;
        wrong.extend(tally.wrong);
    }
    for told in &wrong {
        println!("  wrong: {told}");
    }
    vec![Bar::new(
        "workflow: random commands in one folder",
        "30 sequences, 0 wrong",
        format!("{SEQUENCES} sequences, {} wrong ({right} as in a fresh folder, {refused} refused)", wrong.len()),
        wrong.is_empty(),
    )]
}
