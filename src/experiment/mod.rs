//! Phantom, resection, sweep, estimation: scenario in, outcome out.
