//! A patient's case folder under the names of the Brain Imaging Data Structure (BIDS), each image with a sidecar that
//! says what it shows, in which space, from which scans and by which settings.

use super::hand_off::CaseFile;
use crate::artefact::Manifest;
use crate::layout::{self, BidsName, Family, Maker, Scan, TEMPLATE};
use crate::segment::label;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use thiserror::Error;

const BIDS_VERSION: &str = "1.10.0";

/// Why a case cannot be put under BIDS names.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum DerivativesError {
    #[error("{file}: cannot be read; run this subject again")]
    Read { file: String, source: std::io::Error },
    #[error("{file}: not a manifest of this version; make this subject's case again")]
    Manifest { file: String, source: serde_json::Error },
}

/// A scan of the input data set by its path there: `sub-01/ses-preop/anat/sub-01_ses-preop_T1w.nii.gz`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawScan(pub String);

impl RawScan {
    /// Path up to the suffix: `sub-01/ses-preop/anat/sub-01_ses-preop`.
    fn stem(&self) -> &str {
        let end = self.0.rfind("_T1w.nii").unwrap_or(self.0.len());
        &self.0[..end]
    }

    /// Its address for other data sets.
    fn uri(&self) -> String {
        format!("bids:raw:{}", self.0)
    }
}

/// What a case's images, transforms and page are called in the derivatives, with their bytes. Meshes and simulations
/// stay in the case folder: BIDS has no names for them.
///
/// # Errors
/// [`DerivativesError`] when the case is not finished.
pub fn subject_files(case: &Path, pre: &RawScan, post: &RawScan) -> Result<Vec<CaseFile>, DerivativesError> {
    let read = |file: String| {
        std::fs::read(case.join(&file)).map_err(|source| DerivativesError::Read { file: file.clone(), source })
    };
    let manifest = |stage: &str| -> Result<Manifest, DerivativesError> {
        let file = format!(".stages/{stage}.manifest.json");
        let bytes = read(file.clone())?;
        let text = String::from_utf8_lossy(&bytes);
        serde_json::from_str(&text).map_err(|source| DerivativesError::Manifest { file, source })
    };
    let (registration, anat) = (manifest("registration")?, manifest("anat")?);
    let both = [pre.uri(), post.uri()];
    let made_by = |extra: Value| {
        let mut sidecar = json!({
            "RawSources": both, "GeneratedBy": generated_by(), "Seed": registration.settings["seed"],
            "Settings": {"register": registration.settings, "anat": anat.settings},
        });
        sidecar.as_object_mut().into_iter().zip(extra.as_object()).for_each(|(all, extra)| all.extend(extra.clone()));
        sidecar
    };
    let mut files = Vec::new();
    let mut add = |scan: &RawScan, name: &str, bytes: Vec<u8>, sidecar: &Value| {
        let path = format!("{}_{}", scan.stem(), name);
        let stem = path.trim_end_matches(".nii.gz").trim_end_matches(".tfm").trim_end_matches(".txt");
        files.push((format!("{stem}.json"), pretty(sidecar)));
        files.push((path, bytes));
    };
    for (file, bids) in layout::TABLE.iter().filter_map(|file| Some((file, file.bids?))) {
        let scan = if bids.of == Scan::Pre { pre } else { post };
        let own = if bids.is_transform() {
            json!({"Description": bids.description, "Sources": both})
        } else {
            sidecar_of_image(&bids, scan, &both)
        };
        let family = Family(file.path);
        if file.path.contains('{') {
            for (member, path) in members(case, family) {
                add(scan, &bids.spelt_of(&member), read(path)?, &made_by(own.clone()));
            }
        // What only a simulated case has.
        } else if file.maker != Maker::Fields || case.join(file.path).exists() {
            add(scan, &bids.spelt(), read(file.path.to_owned())?, &made_by(own));
        }
    }
    let subject = pre.0.split('/').next().unwrap_or_default();
    files.push((format!("{subject}.html"), read(layout::PAGE.to_owned())?));
    Ok(files)
}

/// The same of a prediction: its fields, and the plan on the template. Images of the scan itself are named once there is a pair; the rest
/// stays in the case folder.
///
/// # Errors
/// As [`subject_files`].
pub fn plan_files(case: &Path, pre: &RawScan) -> Result<Vec<CaseFile>, DerivativesError> {
    let read = |file: &str| {
        std::fs::read(case.join(file)).map_err(|source| DerivativesError::Read { file: file.to_owned(), source })
    };
    let sources = [pre.uri()];
    let mut files = Vec::new();
    let mut add = |name: &str, bytes: Vec<u8>, own: Value| {
        let mut sidecar = json!({ "RawSources": sources, "Sources": sources, "GeneratedBy": generated_by() });
        sidecar.as_object_mut().into_iter().zip(own.as_object()).for_each(|(all, own)| all.extend(own.clone()));
        let stem = format!("{}_{}", pre.stem(), name.trim_end_matches(".nii.gz"));
        files.push((format!("{stem}.json"), pretty(&sidecar)));
        files.push((format!("{stem}.nii.gz"), bytes));
    };
    for (file, bids) in layout::TABLE.iter().filter_map(|file| Some((file, file.bids?))) {
        if file.path.contains('{') && bids.of == Scan::Pre {
            for (member, path) in members(case, Family(file.path)) {
                add(&bids.spelt_of(&member), read(&path)?, json!({ "Description": bids.description }));
            }
        }
    }
    let own = json!({ "Description": "Tissue that is to be taken", "SpatialReference": TEMPLATE, "Type": "ROI" });
    let name = format!("space-{TEMPLATE}_label-resection_mask.nii.gz");
    add(&name, read(layout::RESECTED)?, own);
    Ok(files)
}

/// What lies in the derivatives beside a scan's images and was made of so many scans (two of a case, one of a prediction): files under a
/// name that the layout has, whatever entities of a scan stand before it, whose sidecar says that this program made them.
pub fn published(out: &Path, scan: &RawScan, scans: usize) -> Vec<String> {
    let (folder, file) = scan.0.rsplit_once('/').unwrap_or(("", &scan.0));
    let begin: Vec<&str> = file.split('_').take(2).collect();
    let begin = begin.join("_");
    let plan = format!("space-{TEMPLATE}_label-resection_mask.nii.gz");
    let names: Vec<String> =
        layout::TABLE.iter().filter_map(|file| file.bids).map(|bids| bids.spelt()).chain([plan]).collect();
    let mut found = Vec::new();
    for entry in std::fs::read_dir(out.join(folder)).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let Some(stem) = name.strip_suffix(".json") else { continue };
        let sidecar = std::fs::read(entry.path()).ok().and_then(|bytes| serde_json::from_slice::<Value>(&bytes).ok());
        let ours = sidecar.is_some_and(|said| {
            said["GeneratedBy"][0]["Name"] == "hgm" && said["RawSources"].as_array().is_some_and(|s| s.len() == scans)
        });
        let ending = stem.strip_prefix(&begin).and_then(|own| names.iter().find_map(|name| ending_of(own, name)));
        if let Some(ending) = ending.filter(|_| ours) {
            found.extend([format!("{folder}/{stem}{ending}"), format!("{folder}/{name}")]);
        }
    }
    found
}

/// The extension of a name of the layout, where a stem ends as that name does; a member of a family is any.
fn ending_of<'n>(stem: &str, name: &'n str) -> Option<&'n str> {
    let (spelt, ending) = name.split_at(name.find('.')?);
    let fits = match spelt.split_once("{state}") {
        None => stem.ends_with(&format!("_{spelt}")),
        Some((before, after)) => stem.strip_suffix(after).is_some_and(|own| {
            own.trim_end_matches(|c: char| c.is_ascii_alphanumeric()).ends_with(&format!("_{before}"))
        }),
    };
    fits.then_some(ending)
}

/// The files of a family that are there, by member, in order.
fn members(case: &Path, family: Family) -> Vec<(String, String)> {
    let entries = std::fs::read_dir(case.join(family.folder())).into_iter().flatten().flatten();
    let paths = entries.map(|entry| format!("{}/{}", family.folder(), entry.file_name().to_string_lossy()));
    let mut found: Vec<_> = paths.filter_map(|path| Some((family.member(&path)?.to_owned(), path))).collect();
    found.sort();
    found
}

/// What a sidecar says of its image alone.
fn sidecar_of_image(bids: &BidsName, scan: &RawScan, both: &[String; 2]) -> Value {
    let of_one_scan = bids.name.contains("T1w");
    // A T1 comes from one scan; where the knife was takes both.
    let sources = if of_one_scan { vec![scan.uri()] } else { both.to_vec() };
    let mut own = json!({
        "Description": bids.description, "Sources": sources,
        "SpatialReference": if bids.in_template() { TEMPLATE.to_owned() } else { scan.uri() },
    });
    if of_one_scan {
        own["SkullStripped"] = json!(false);
    }
    if let Some(kind) = bids.mask {
        own["Type"] = json!(kind);
    }
    own
}

pub(crate) fn generated_by() -> Value {
    json!([{"Name": "hgm", "Version": env!("CARGO_PKG_VERSION")}])
}

/// What lies once at the top of the derivatives. `raw` is where the input data set is from there (see [`way_up`]).
pub fn dataset_files(raw: Option<&str>) -> Vec<CaseFile> {
    let mut description = json!({
        "Name": "hgm: brain deformation after resection",
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "derivative",
        "GeneratedBy": generated_by(),
    });
    if let Some(raw) = raw {
        description["DatasetLinks"] = json!({ "raw": raw });
    }
    let labels = [label::CSF, label::GREY_MATTER, label::WHITE_MATTER, label::VENTRICLE];
    let names = labels.iter().fold("index\tname\n".to_owned(), |table, &l| {
        table + &format!("{l}\t{}\n", label::name(l).unwrap_or_default())
    });
    vec![
        ("dataset_description.json".to_owned(), pretty(&description)),
        ("README".to_owned(), README.as_bytes().to_vec()),
        (".bidsignore".to_owned(), IGNORED.as_bytes().to_vec()),
        ("dseg.tsv".to_owned(), names.into_bytes()),
    ]
}

/// BIDS has no names for meshes, simulations, transforms of this kind and pages.
const IGNORED: &str = "sub-*/hgm\nsub-*/hgm-plan\n*_xfm.*\n*.html\n/group.*\n/logs\n";

const README: &str = "\
What hgm made of the T1 pairs (ses-preop, ses-postop) of the data set that bids:raw: stands for in the sidecars.

sub-X.html                the subject's page; group.html has all subjects, outliers first
sub-X_plan.html           the page of its prediction, where `--predict` made one
sub-X/ses-*/anat          images, labels and masks; dseg.tsv names the labels
sub-X/hgm                 the subject's case folder: meshes, simulations, transforms, settings, checksums
sub-X/hgm-plan            the prediction's case folder
logs/sub-X.json           why a subject could not be done (absent when it could)
group.json, group.tsv     a line of figures per subject, with median and median absolute deviation
group.tasks.tsv           tasks of the generative model by ranks (absent with fewer than five subjects of every task)

space-MNI152NLin2009aSym is reached by a rigid motion: sizes stay the patient's. Lengths are mm, RAS+; moduli Pa.
Research software, not a medical device.
";

fn pretty(value: &Value) -> Vec<u8> {
    format!("{value:#}\n").into_bytes()
}

/// Where the derivatives' folder finds the data set it was made from: the way up where it lies inside of it. `None`
/// elsewhere: a path of this machine means nothing to a reader.
pub fn way_up(from: &Path, to: &Path) -> Option<String> {
    let inside: PathBuf = from.strip_prefix(to).ok()?.to_path_buf();
    Some(vec![".."; inside.components().count()].join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entities_of_the_scan_stay_in_front_of_those_of_the_derivative() {
        let scan = RawScan("sub-01/ses-preop/anat/sub-01_ses-preop_run-2_T1w.nii.gz".to_owned());
        assert_eq!(scan.stem(), "sub-01/ses-preop/anat/sub-01_ses-preop_run-2");
        assert_eq!(scan.uri(), "bids:raw:sub-01/ses-preop/anat/sub-01_ses-preop_run-2_T1w.nii.gz");
    }

    #[test]
    fn the_way_to_the_raw_data_names_no_folder() {
        assert_eq!(way_up(Path::new("/data/b/derivatives/hgm"), Path::new("/data/b")), Some("../..".to_owned()));
        assert_eq!(way_up(Path::new("/scratch/out"), Path::new("/data/b")), None);
    }
}
