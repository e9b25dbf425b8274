//! FEBio (.feb), format 4.0: nodes, one `Elements` block and material per label, `NodeSet` and `Surface` per set.
//!
//! Units are FEBio's `mm-N-s`: coordinates in mm, moduli in MPa, densities in tonne/mm3. Source: FEBio User Manual 4,
//! chapter "Free Format Input".

use super::{WriteError, label_name, line};
use crate::mesh::TetMesh;
use quick_xml::escape::escape;
use std::collections::BTreeMap;

/// A compressible neo-Hookean solid as FEBio parametrises it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elastic {
    /// Young's modulus at rest, Pa.
    pub young_modulus_pa: f64,
    /// Poisson's ratio at rest.
    pub poisson_ratio: f64,
    /// Density, kg/m3.
    pub density_kg_per_m3: f64,
}

impl Default for Elastic {
    /// A soft solid of brain's order of magnitude, so that the file opens and runs before the user has set a material.
    fn default() -> Self {
        Self { young_modulus_pa: 3000.0, poisson_ratio: 0.45, density_kg_per_m3: 1000.0 }
    }
}

/// The bytes of an FEBio file. Labels without an entry in `materials` get [`Elastic::default`] and a comment that says so.
///
/// # Errors
/// [`WriteError::TooMany`] when elements pass the 32 bits FEBio counts with.
pub fn encode(mesh: &TetMesh, materials: &BTreeMap<u8, Elastic>) -> Result<Vec<u8>, WriteError> {
    if i32::try_from(mesh.tets().len()).is_err() {
        return Err(WriteError::TooMany { what: "elements".into(), count: mesh.tets().len() });
    }
    let mut by_label: BTreeMap<u8, Vec<usize>> = BTreeMap::new();
    for (t, &label) in mesh.labels().iter().enumerate() {
        by_label.entry(label).or_default().push(t);
    }
    let mut xml = String::from(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<febio_spec version=\"4.0\">\n\
         <Module type=\"solid\">\n<units>mm-N-s</units>\n</Module>\n<Material>\n",
    );
    for (id, &label) in by_label.keys().enumerate() {
        if !materials.contains_key(&label) {
            xml += "<!-- nominal values: set your own -->\n";
        }
        let elastic = materials.get(&label).copied().unwrap_or_default();
        line(
            &mut xml,
            format_args!("<material id=\"{}\" name=\"{}\" type=\"neo-Hookean\">", id + 1, label_name(label)),
        );
        line(&mut xml, format_args!("<density>{:e}</density>", elastic.density_kg_per_m3 * 1e-12));
        line(&mut xml, format_args!("<E>{:e}</E>", elastic.young_modulus_pa * 1e-6));
        line(&mut xml, format_args!("<v>{}</v>\n</material>", elastic.poisson_ratio));
    }
    xml += "</Material>\n<Mesh>\n<Nodes name=\"nodes\">\n";
    for (n, [x, y, z]) in mesh.nodes_mm().iter().enumerate() {
        line(&mut xml, format_args!("<node id=\"{}\">{x:?},{y:?},{z:?}</node>", n + 1));
    }
    xml += "</Nodes>\n";
    for (&label, tets) in &by_label {
        line(&mut xml, format_args!("<Elements type=\"tet4\" name=\"{}\">", label_name(label)));
        for &t in tets {
            let [a, b, c, d] = mesh.tets()[t].map(|n| n + 1);
            line(&mut xml, format_args!("<elem id=\"{}\">{a},{b},{c},{d}</elem>", t + 1));
        }
        xml += "</Elements>\n";
    }
    for (name, nodes) in &mesh.node_sets {
        let numbers: Vec<String> = nodes.iter().map(|n| (n + 1).to_string()).collect();
        line(&mut xml, format_args!("<NodeSet name=\"{}\">{}</NodeSet>", escape(name), numbers.join(",")));
    }
    for (name, facets) in &mesh.facet_sets {
        line(&mut xml, format_args!("<Surface name=\"{}\">", escape(name)));
        for (n, [a, b, c]) in facets.iter().enumerate() {
            line(&mut xml, format_args!("<tri3 id=\"{}\">{},{},{}</tri3>", n + 1, a + 1, b + 1, c + 1));
        }
        xml += "</Surface>\n";
    }
    xml += "</Mesh>\n<MeshDomains>\n";
    for &label in by_label.keys() {
        line(&mut xml, format_args!("<SolidDomain name=\"{0}\" mat=\"{0}\"/>", label_name(label)));
    }
    xml += "</MeshDomains>\n</febio_spec>\n";
    Ok(xml.into_bytes())
}
