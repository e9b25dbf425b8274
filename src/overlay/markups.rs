//! 3D Slicer's markups (`.mrk.json`): point lists, lines, curves.

use super::drawing::{Carried, Drawing, Kept, OverlayError, damaged, names_of, turned, written};
use super::fcsv::said;
use serde_json::{Value, json};

/// The document as it was.
#[derive(Clone, Debug)]
pub(super) struct Markups {
    document: Value,
}

fn is_lps(markup: &Value) -> Option<bool> {
    match markup.get("coordinateSystem") {
        // The schema's default.
        None => Some(true),
        Some(Value::String(name)) if name == "LPS" || name == "1" => Some(true),
        Some(Value::String(name)) if name == "RAS" || name == "0" => Some(false),
        Some(_) => None,
    }
}

/// 3D Slicer keeps points that are yet to be placed, at the origin.
fn is_placed(point: &Value) -> bool {
    point.get("positionStatus").and_then(Value::as_str).is_none_or(|status| status == "defined")
}

pub(super) fn decode(bytes: &[u8], name: &str) -> Result<Drawing, OverlayError> {
    let document: Value = serde_json::from_slice(bytes).map_err(|e| damaged(name, "the file", e.to_string()))?;
    let markups = document["markups"].as_array().ok_or_else(|| damaged(name, "markups", "there is no such list"))?;
    let (mut points_mm, mut names) = (Vec::new(), Vec::new());
    for (m, markup) in markups.iter().enumerate() {
        let lps = is_lps(markup)
            .ok_or_else(|| damaged(name, format!("markups[{m}].coordinateSystem"), "it is neither LPS nor RAS"))?;
        match markup["type"].as_str() {
            None | Some("Fiducial" | "Line" | "Curve" | "ClosedCurve" | "Angle") => {}
            Some(other) => {
                let problem = format!(
                    "`{other}` is placed by more than its points, which alone are carried; save the points as a list"
                );
                return Err(damaged(name, format!("markups[{m}].type"), problem));
            }
        }
        if let Some(units) = markup["coordinateUnits"].as_str().filter(|units| *units != "mm") {
            return Err(damaged(name, format!("markups[{m}].coordinateUnits"), format!("`{units}`; save it in mm")));
        }
        for (n, point) in
            markup["controlPoints"].as_array().into_iter().flatten().enumerate().filter(|(_, p)| is_placed(p))
        {
            let place = || format!("markups[{m}].controlPoints[{n}].position");
            let numbers: Vec<f64> =
                point["position"].as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
            let [x, y, z] = numbers[..] else { return Err(damaged(name, place(), "it does not hold three numbers")) };
            points_mm.push(turned([x, y, z], lps));
            names.push(point["label"].as_str().unwrap_or_default().to_owned());
        }
    }
    Ok(Drawing { points_mm, names: names_of(names), pairs_mm: Vec::new(), kept: Box::new(Markups { document }) })
}

impl Kept for Markups {
    /// The same document; a point's description says how sure it is. Measurements, which no longer hold, are left out.
    fn encode(&self, carried: &[Carried], _: &[String]) -> Vec<u8> {
        let mut document = self.document.clone();
        let mut carried = carried.iter();
        for markup in document["markups"].as_array_mut().into_iter().flatten() {
            let lps = is_lps(markup).unwrap_or(true);
            markup.as_object_mut().map(|markup| markup.remove("measurements"));
            for point in markup
                .get_mut("controlPoints")
                .and_then(Value::as_array_mut)
                .into_iter()
                .flatten()
                .filter(|p| is_placed(p))
            {
                let Some(to) = carried.next() else { break };
                point["position"] = json!(turned(to.mm, lps).map(|x| written(x).parse::<f64>().unwrap_or(x)));
                point["description"] = json!(said(to));
                if let Some(point) = point.as_object_mut() {
                    point.remove("associatedNodeID");
                }
            }
        }
        format!("{document:#}\n").into_bytes()
    }
}
