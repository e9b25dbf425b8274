//! gmsh (Geuzaine and Remacle, IJNME 79, 2009) as a separate program.

use super::mesher::{Mesher, Program, Request};
use super::process::{self, ProcessError, scratch_command};
use super::surface::InterfaceSurface;
use crate::mesh::format::msh;
use crate::mesh::optimise::{Complex, Point};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Tets inside may have edges this many times the target.
const EDGE: f64 = 1.25;

/// A patch of the surface: the regions below and above.
type Sides = (u32, Option<u32>);

/// The surface as an MSH 2.2 file, one discrete surface per pair of regions, and the script that names the volumes between.
fn request(surface: &InterfaceSurface, edge_mm: f64) -> (String, String) {
    let mut patches: BTreeMap<Sides, usize> = BTreeMap::new();
    for (_, below, above) in &surface.facets {
        let next = patches.len() + 1;
        patches.entry((*below, *above)).or_insert(next);
    }
    let mut msh = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", surface.x.len());
    for (n, p) in surface.x.iter().enumerate() {
        let _ = writeln!(msh, "{} {:?} {:?} {:?}", n + 1, p.x, p.y, p.z);
    }
    let _ = writeln!(msh, "$EndNodes\n$Elements\n{}", surface.facets.len());
    for (n, ([a, b, c], below, above)) in surface.facets.iter().enumerate() {
        let patch = patches[&(*below, *above)];
        let _ = writeln!(msh, "{} 2 2 {patch} {patch} {} {} {}", n + 1, a + 1, b + 1, c + 1);
    }
    msh += "$EndElements\n";
    let mut geo = String::from("Merge \"s.msh\";\n");
    for region in 0..surface.field.len() as u32 {
        let touches = |sides: &Sides| sides.0 == region || sides.1 == Some(region);
        let around: Vec<String> = patches.iter().filter(|(s, _)| touches(s)).map(|(_, n)| n.to_string()).collect();
        let id = region + 1;
        let _ = writeln!(geo, "Surface Loop({id}) = {{{}}};\nVolume({id}) = {{{id}}};", around.join(", "));
    }
    for field in 1..=u8::MAX {
        let volumes: Vec<String> =
            (0..surface.field.len()).filter(|&r| surface.field[r] == field).map(|r| (r + 1).to_string()).collect();
        if !volumes.is_empty() {
            let _ = writeln!(geo, "Physical Volume({field}) = {{{}}};", volumes.join(", "));
        }
    }
    let _ = writeln!(geo, "Mesh.MeshSizeMax = {:?};", EDGE * edge_mm);
    // The tolerance: banks of a closed sulcus may come as near to each other as our own engines let them.
    geo += "Mesh.AngleToleranceFacetOverlap = 0.0001;\nMesh.MeshSizeExtendFromBoundary = 1;\nMesh.Algorithm3D = 1;\nMesh.Optimize = 1;\nMesh.MshFileVersion = 4.1;\n";
    (msh, geo)
}

/// The engine: the surface stays as it is, the inside gets tets.
pub(super) struct Gmsh;

impl Mesher for Gmsh {
    fn name(&self) -> &'static str {
        "gmsh"
    }

    fn program(&self) -> Option<&'static Program> {
        Some(&Program {
            name: "gmsh",
            used_for: "mesh engine `gmsh`",
            variable: None,
            install: "sudo apt-get install gmsh",
        })
    }

    fn mesh(&self, request: &Request, edge_mm: f64) -> Result<Complex, ProcessError> {
        let edge = request.edges(edge_mm);
        let surface = request.surface(&edge);
        let [_, largest_mm] = edge.range_mm();
        let (msh, geo) = self::request(&surface, largest_mm);
        // One stream in: the script, a line that ends it, the surface.
        let script = "awk 'after { print > \"s.msh\"; next } /^END$/ { after = 1; next } { print > \"s.geo\" }' && \
                      run \"$0\" -3 s.geo -nt 1 -v 2 -o out.msh >&2 && cat out.msh";
        let input = format!("{geo}END\n{msh}").into_bytes();
        let command = scratch_command(&request.program, script, request.limits);
        let answer = process::run(&command, input, request.limits)?;
        let mesh = msh::decode(&answer, "gmsh").map_err(|_| ProcessError::Answer)?;
        let x = mesh.nodes_mm().iter().map(|p| Point::from(*p)).collect();
        Ok(surface.around(x, mesh.tets().to_vec(), mesh.labels().to_vec()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_volume_is_named_with_all_the_patches_around_it() {
        let x = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]].map(Point::from);
        let complex = Complex::new(x.to_vec(), vec![[0, 1, 2, 3], [1, 2, 3, 4]], vec![2, 1]);
        let (msh, geo) = request(&InterfaceSurface::of(&complex), 2.0);
        assert_eq!(msh.matches(" 2 2 ").count(), 7, "three outer facets each and the one between");
        // Patches in order of first facet: outside of region 0 or the shared one, then the rest.
        assert!(geo.contains("Volume(1) = {1};") && geo.contains("Volume(2) = {2};"), "{geo}");
        assert!(geo.contains("Physical Volume(1) = {2};") && geo.contains("Physical Volume(2) = {1};"), "{geo}");
    }
}
