//! CGAL's Mesh_3 as a separate program (`engines/cgal/`), over a pipe.

use super::mesher::{Mesher, Program, Request};
use super::process::{self, ProcessError};
use super::sizing::EdgeField;
use crate::mesh::label_field::LabelField;
use crate::mesh::optimise::{Complex, Point};
use std::process::Command;

/// Facet angle (degrees), and facet size, facet distance, cell radius-edge ratio and cell size as multiples of the edge.
const CRITERIA: [f64; 5] = [25.0, 0.95, 0.35, 2.0, 0.95];

/// The request of `hgm-cgal-mesher`; its source describes the protocol.
fn request(field: &LabelField, edge: &EdgeField, seeds: &[Point]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(4 * field.values().len() + 4 * edge.edge_mm.len() + 4096);
    bytes.extend_from_slice(b"HGMFLD01");
    let whole = |bytes: &mut Vec<u8>, n: usize| bytes.extend_from_slice(&(n as u32).to_le_bytes());
    let real = |bytes: &mut Vec<u8>, x: f64| bytes.extend_from_slice(&x.to_le_bytes());
    field.dims().iter().for_each(|&n| whole(&mut bytes, n));
    whole(&mut bytes, field.labels().len());
    field.spacing_mm().iter().chain(&CRITERIA).for_each(|&x| real(&mut bytes, x));
    edge.dims.iter().for_each(|&n| whole(&mut bytes, n));
    edge.spacing_mm.iter().for_each(|&x| real(&mut bytes, x));
    edge.edge_mm.iter().for_each(|x| bytes.extend_from_slice(&x.to_le_bytes()));
    whole(&mut bytes, seeds.len());
    seeds.iter().flat_map(|p| [p.x, p.y, p.z]).for_each(|x| real(&mut bytes, x));
    field.values().iter().for_each(|x| bytes.extend_from_slice(&x.to_le_bytes()));
    bytes
}

/// Reads the program's answer; `None` when it is not one.
fn parse(bytes: &[u8], fields: usize) -> Option<Complex> {
    let rest = bytes.strip_prefix(b"HGMTET02")?;
    let (head, rest) = rest.split_at_checked(8)?;
    let count = |b: &[u8]| Some(u32::from_le_bytes(b.try_into().ok()?) as usize);
    let (nodes, tets) = (count(&head[..4])?, count(&head[4..])?);
    let (xyz, rest) = rest.split_at_checked(nodes.checked_mul(24)?)?;
    let (corners, labels) = rest.split_at_checked(tets.checked_mul(16)?)?;
    let real = |b: &[u8]| Some(f64::from_le_bytes(b.try_into().ok()?));
    let x: Option<Vec<Point>> =
        xyz.chunks_exact(24).map(|p| Some(Point::new(real(&p[..8])?, real(&p[8..16])?, real(&p[16..])?))).collect();
    let number = |b: &[u8]| count(b).filter(|&n| n < nodes).map(|n| n as u32);
    let tets: Option<Vec<[u32; 4]>> = corners
        .chunks_exact(16)
        .map(|t| Some([number(&t[..4])?, number(&t[4..8])?, number(&t[8..12])?, number(&t[12..])?]))
        .collect();
    let (x, tets) = (x?, tets?);
    // Field 0: the layer outside.
    let fine = labels.len() == tets.len() && labels.iter().all(|&l| (l as usize) < fields);
    fine.then(|| Complex::new(x, tets, labels.to_vec()))
}

/// The engine.
pub(super) struct Cgal;

impl Mesher for Cgal {
    fn name(&self) -> &'static str {
        "cgal"
    }

    fn program(&self) -> Option<&'static Program> {
        Some(&Program {
            name: "hgm-cgal-mesher",
            used_for: "mesh engine `cgal` (without it: `lattice`)",
            variable: Some("HGM_CGAL_MESHER"),
            install: "./run engines",
        })
    }

    fn mesh(&self, request: &Request, edge_mm: f64) -> Result<Complex, ProcessError> {
        let edge = request.edges(edge_mm);
        let run = |seeds: &[Point]| {
            let input = self::request(request.field, &edge, seeds);
            let answer = process::run(&Command::new(&request.program), input, request.limits)?;
            parse(&answer, request.field.labels().len()).ok_or(ProcessError::Answer)
        };
        let found = run(request.seeds())?;
        // A thin shell can lie between a few seeds without any facet of theirs across it: then they must be denser.
        if found.count() == 0 { run(&request.dense_seeds()) } else { Ok(found) }
    }

    /// Brains again: the coarser the mesh, the larger the share of tets that interfaces make smaller than the edge asks
    /// for. A good first guess spares a second run of the program.
    fn first_guess(&self, edge_mm: f64) -> f64 {
        1.0 + (0.0125 * (edge_mm - 4.0)).clamp(0.0, 0.05)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broken_answer_is_refused() {
        let mut answer = b"HGMTET02".to_vec();
        answer.extend([4u32, 1].iter().flat_map(|n| n.to_le_bytes()));
        let x = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0f64];
        answer.extend(x.iter().flat_map(|x| x.to_le_bytes()));
        answer.extend([0u32, 1, 2, 3].iter().flat_map(|n| n.to_le_bytes()));
        answer.push(1);
        assert_eq!(parse(&answer, 2).map(|c| c.count()), Some(1));
        assert!(parse(&answer, 1).is_none(), "a field that was not sent");
        assert!(parse(&answer[..answer.len() - 1], 2).is_none(), "a label short");
        assert!(parse(&answer[1..], 2).is_none(), "no magic");
        let node = answer.len() - 17 + 12;
        answer[node] = 4;
        assert!(parse(&answer, 2).is_none(), "a node that does not exist");
    }
}
