//! TetGen (Si, "TetGen, a Delaunay-based quality tetrahedral mesh generator", ACM TOMS 41, 2015) as a separate program.

use super::mesher::{Mesher, Program, Request, TET_SHARE};
use super::process::{self, ProcessError, scratch_command};
use super::surface::InterfaceSurface;
use crate::mesh::label_field::LabelField;
use crate::mesh::optimise::{Complex, Point};
use std::fmt::Write;

/// Radius-edge ratio and smallest dihedral angle that TetGen refines for.
const QUALITY: &str = "1.6/12";
/// Tets inside may have this many times the volume that the edge asks for.
const VOLUME: f64 = 2.2;

/// The surface as a `.smesh` file.
fn request(surface: &InterfaceSurface) -> Vec<u8> {
    let mut text = format!("{} 3 0 0\n", surface.x.len());
    for (n, p) in surface.x.iter().enumerate() {
        let _ = writeln!(text, "{n} {:?} {:?} {:?}", p.x, p.y, p.z);
    }
    let _ = writeln!(text, "{} 0", surface.facets.len());
    for ([a, b, c], ..) in &surface.facets {
        let _ = writeln!(text, "3 {a} {b} {c}");
    }
    text += "0\n0\n";
    text.into_bytes()
}

/// Lines of numbers without comments.
fn lines(text: &str) -> impl Iterator<Item = Vec<f64>> + '_ {
    let numbers =
        |line: &str| line.split_whitespace().map(|word| word.parse().unwrap_or(f64::NAN)).collect::<Vec<f64>>();
    text.lines().map(|line| line.split('#').next().unwrap_or("").trim()).filter(|line| !line.is_empty()).map(numbers)
}

/// Nodes, tets and the region of each.
type Parsed = (Vec<Point>, Vec<[u32; 4]>, Vec<i64>);

/// Reads `.node` and `.ele`, one after the other; tets with the number of their region.
fn parse(text: &str) -> Option<Parsed> {
    let mut lines = lines(text);
    let nodes = *lines.next()?.first()? as usize;
    let mut x = Vec::new();
    for _ in 0..nodes {
        let line = lines.next()?;
        x.push(Point::new(*line.get(1)?, *line.get(2)?, *line.get(3)?));
    }
    let count = *lines.next()?.first()? as usize;
    let (mut tets, mut regions) = (Vec::new(), Vec::new());
    for _ in 0..count {
        let line = lines.next()?;
        let mut tet = [0u32; 4];
        for (n, corner) in tet.iter_mut().enumerate() {
            *corner = Some(*line.get(n + 1)?).filter(|&v| v >= 0.0 && v < nodes as f64)? as u32;
        }
        // TetGen turns its tets the other way around.
        let [a, b, c, d] = tet.map(|v| x[v as usize]);
        if (b - a).cross(&(c - a)).dot(&(d - a)) < 0.0 {
            tet.swap(2, 3);
        }
        tets.push(tet);
        regions.push(*line.get(5)? as i64);
    }
    x.iter().all(|p| p.iter().all(|c| c.is_finite())).then_some((x, tets, regions))
}

/// Every region of TetGen gets the field that fills most of it; regions outside are dropped.
fn labelled(
    x: &[Point],
    tets: &[[u32; 4]],
    regions: &[i64],
    field: &LabelField,
) -> (Vec<Point>, Vec<[u32; 4]>, Vec<u8>) {
    let mut numbers: Vec<i64> = regions.to_vec();
    numbers.sort_unstable();
    numbers.dedup();
    let fields = field.labels().len();
    let mut votes = vec![vec![0.0; fields]; numbers.len()];
    let of = |r: i64| numbers.binary_search(&r).unwrap_or(0);
    for (tet, &region) in tets.iter().zip(regions) {
        let [a, b, c, d] = tet.map(|v| x[v as usize]);
        let volume = (b - a).cross(&(c - a)).dot(&(d - a));
        votes[of(region)][field.field_at(&((a + b + c + d) / 4.0)) as usize] += volume;
    }
    let winner = |votes: &Vec<f64>| (0..fields).fold(0, |best, k| if votes[k] > votes[best] { k } else { best }) as u8;
    let winners: Vec<u8> = votes.iter().map(winner).collect();
    let kept: Vec<usize> = (0..tets.len()).filter(|&t| winners[of(regions[t])] != 0).collect();
    let kept_fields = kept.iter().map(|&t| winners[of(regions[t])]).collect();
    Complex::new(x.to_vec(), kept.iter().map(|&t| tets[t]).collect(), kept_fields).compacted()
}

/// The engine: the surface stays as it is, the inside gets tets.
pub(super) struct Tetgen;

impl Mesher for Tetgen {
    fn name(&self) -> &'static str {
        "tetgen"
    }

    fn program(&self) -> Option<&'static Program> {
        Some(&Program {
            name: "tetgen",
            used_for: "mesh engine `tetgen`",
            variable: None,
            install: "sudo apt-get install tetgen",
        })
    }

    fn mesh(&self, request: &Request, edge_mm: f64) -> Result<Complex, ProcessError> {
        let edge = request.edges(edge_mm);
        let surface = request.surface(&edge);
        let [_, largest_mm] = edge.range_mm();
        let most_mm3 = VOLUME * TET_SHARE * largest_mm.powi(3);
        let switches = format!("-pYAzQFq{QUALITY}a{most_mm3:.6}");
        let script = format!("cat > s.smesh && run \"$0\" {switches} s.smesh >&2 && cat s.1.node s.1.ele");
        let command = scratch_command(&request.program, &script, request.limits);
        let answer = process::run(&command, self::request(&surface), request.limits)?;
        let (x, tets, regions) = parse(&String::from_utf8_lossy(&answer)).ok_or(ProcessError::Answer)?;
        let (x, tets, fields) = labelled(&x, &tets, &regions, request.field);
        if tets.is_empty() { Err(ProcessError::Answer) } else { Ok(surface.around(x, tets, fields)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broken_answer_is_refused() {
        let good = "4 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1 # last\n# tets\n1 4 1\n0 0 2 1 3 7\n";
        let (x, tets, regions) = parse(good).unwrap();
        assert_eq!((x.len(), tets[0], regions[0]), (4, [0, 2, 3, 1], 7));
        assert!(parse(&good.replace("0 0 2 1 3 7", "0 0 2 1 4 7")).is_none(), "a node that is not there");
        assert!(parse(&good.replace("3 0 0 1", "3 0 nought 1")).is_none(), "no number");
        assert!(parse(&good[..good.len() - 12]).is_none(), "cut short");
    }
}
