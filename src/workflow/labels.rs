//! Label maps of other tools: the file, whose numbers it holds, and what comes of it.

use super::error::{LabelMapError, WorkflowError};
use super::progress::Progress;
use super::user_file::{read_input, read_text, shown};
use crate::anatomy::{LabelCount, LabelTable, built_in, named, recognise, table_from_tsv};
use crate::geometry::Native;
use crate::image::nifti::{self, ReadOptions};
use crate::image::{LabelMap, Volume};
use crate::segment::import_labels;
use std::collections::BTreeMap;
use std::path::Path;

/// The tables that a word names.
enum Choice {
    BuiltIn(Vec<&'static LabelTable>),
    Own(LabelTable),
}

fn choice(word: &str) -> Result<Choice, WorkflowError> {
    let tables = named(&word.to_lowercase());
    if !tables.is_empty() {
        return Ok(Choice::BuiltIn(tables));
    }
    if !word.to_ascii_lowercase().ends_with(".tsv") {
        let known = built_in().iter().map(|t| t.name.as_str()).filter(|n| *n != "charm-labeling").collect();
        return Err(LabelMapError::NoTable { word: word.to_owned(), known }.into());
    }
    let text = read_text(Path::new(word))?;
    Ok(Choice::Own(
        table_from_tsv(&text, word).map_err(|source| LabelMapError::Table { word: word.to_owned(), source })?,
    ))
}

/// The map in hgm's numbers; says what it was taken for.
fn imported(
    codes: &Volume<u32, Native>,
    name: &str,
    whose: Option<&str>,
    progress: &mut dyn Progress,
) -> Result<LabelMap<Native>, WorkflowError> {
    let choice = whose.map(choice).transpose()?;
    let tables: Option<Vec<&LabelTable>> = choice.as_ref().map(|choice| match choice {
        Choice::BuiltIn(tables) => tables.clone(),
        Choice::Own(table) => vec![table],
    });
    let found = import_labels(codes, tables.as_deref())
        .map_err(|source| LabelMapError::Import { name: name.to_owned(), source })?;
    let volumes: Vec<String> =
        found.volumes_cc.iter().map(|(tissue, cc)| format!("{} {cc:.0} cc", tissue.name())).collect();
    progress.taken_for(&format!(
        "{name}: read with the table {} ({}): {} structures, {}",
        found.table,
        found.files,
        found.structures,
        volumes.join(", ")
    ));
    if found.without_cerebellum {
        let what = format!(
            "no cerebellum is labelled, where a map of {} has one: it will count as outside the brain, and what stands on the \
             tentorium will hang free; give the whole map",
            found.table
        );
        progress.odd(name, &what);
    }
    Ok(found.labels)
}

fn codes(
    bytes: &[u8],
    name: &str,
    options: &ReadOptions,
    progress: &mut dyn Progress,
) -> Result<Volume<u32, Native>, WorkflowError> {
    let (codes, odd) = nifti::decode_codes(bytes, name, options)?;
    for warning in &odd {
        progress.odd(name, &warning.to_string());
    }
    Ok(codes)
}

/// The label map of a tool in hgm's numbers, from a file the user named; `progress` hears what it was taken for.
///
/// # Errors
/// Numbers that no table has, or what makes it no brain.
pub fn labels_of_tool(
    path: &Path,
    whose: Option<&str>,
    options: &ReadOptions,
    progress: &mut dyn Progress,
) -> Result<LabelMap<Native>, WorkflowError> {
    let name = shown(path);
    imported(&codes(&read_input(path)?, &name, options, progress)?, &name, whose, progress)
}

/// So many numbers are not all in FreeSurfer's table by chance.
const MANY: usize = 6;
/// The last of hgm's own numbers.
const LAST_OWN: u32 = crate::anatomy::label::OEDEMA as u32;

/// A label map to be meshed: that of a known tool in hgm's numbers, numbers of no tool as they are.
///
/// # Errors
/// Where `whose` was said and does not fit, or the map is a known tool's but for some numbers.
pub fn any_labels(
    bytes: &[u8],
    name: &str,
    whose: Option<&str>,
    options: &ReadOptions,
    progress: &mut dyn Progress,
) -> Result<LabelMap<Native>, WorkflowError> {
    let codes = codes(bytes, name, options, progress)?;
    if whose.is_some() {
        return imported(&codes, name, whose, progress);
    }
    let mut voxels = BTreeMap::<u32, usize>::new();
    for &code in &codes.data {
        *voxels.entry(code).or_default() += 1;
    }
    let counts: Vec<LabelCount> = voxels.into_iter().map(|(code, voxels)| LabelCount { code, voxels }).collect();
    let holds = |set: &[u32]| counts.iter().any(|c| set.contains(&c.code));
    // What a map of that tool is never without: then a number more is a slip to be told, not another kind of map. With six
    // such structures one may be missing, or stand under another tool's number.
    let is_of = |t: &LabelTable| {
        let missing = t.needed.iter().filter(|set| !holds(set)).count();
        t.name != "hgm" && missing <= usize::from(t.needed.len() >= 6)
    };
    // Half a map of FreeSurfer's: each of many numbers is one of its few, and what it is never without is missing.
    let freesurfer = |code: u32| named("freesurfer").iter().any(|t| t.structure(code).is_some());
    let own = counts.iter().filter(|c| c.code != 0).all(|c| freesurfer(c.code));
    if own && counts.len() > MANY && counts.iter().any(|c| c.code > LAST_OWN) {
        return imported(&codes, name, Some("freesurfer"), progress);
    }
    let of_a_tool = built_in().iter().any(is_of);
    if of_a_tool || matches!(recognise(&counts, None), Ok(found) if found.table.name != "hgm") {
        return imported(&codes, name, None, progress);
    }
    if let Some(&LabelCount { code, .. }) = counts.iter().find(|c| c.code > 255) {
        return Err(LabelMapError::TooLarge { name: name.to_owned(), code }.into());
    }
    let own = named("hgm");
    let structure = |code: u32| own.iter().find_map(|table| table.structure(code));
    let names: Option<Vec<String>> = counts
        .iter()
        .filter(|c| c.code != 0)
        .map(|c| Some(format!("{} as {}", c.code, structure(c.code)?.name)))
        .collect();
    progress.taken_for(&match names {
        Some(names) => format!(
            "{name}: taken for hgm's own numbers ({}): say whose they are where they are another tool's, or a mask's",
            names.join(", ")
        ),
        None => format!("{name}: numbers of no tool that is known, meshed as they are"),
    });
    Ok(codes.map(|code| code as u8))
}
