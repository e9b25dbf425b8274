//! Whose label map is this? Its numbers say.

use super::table::{LabelTable, Structure};
use super::tables::built_in;
use thiserror::Error;

/// How often a number occurs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LabelCount {
    /// The number.
    pub code: u32,
    /// Voxels.
    pub voxels: usize,
}

/// A map whose numbers are all known.
#[derive(Clone, Debug)]
pub struct Recognised<'a> {
    /// Whose numbers they are.
    pub table: &'a LabelTable,
    /// The structures that occur, in the order of their numbers.
    pub found: Vec<(&'a Structure, usize)>,
}

/// Why a label map is not believed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum LabelError {
    /// One number only.
    #[error(
        "it holds one label ({code}) and nothing else: that is a mask, not a label map; give it as a brain \
         mask, or a map with grey matter, white matter and ventricles"
    )]
    Mask {
        /// The number.
        code: u32,
    },
    /// Nothing at all.
    #[error("every voxel is 0: there is no label in it; export it again")]
    Empty,
    /// Numbers that the table does not have.
    #[error(
        "{} {} not in the table of {table}: {}; {remedy}",
        if codes.len() == 1 { "the number" } else { "the numbers" },
        if codes.len() == 1 { "is" } else { "are" },
        listed(codes)
    )]
    Unknown {
        /// The table that was asked for, or the one that fits best.
        table: String,
        /// The numbers, with their voxels.
        codes: Vec<(u32, usize)>,
        /// What to do.
        remedy: &'static str,
    },
    /// Numbers that a map of this tool has are missing.
    #[error("{lacking}: it is no map of {table}; {remedy}")]
    Lacking {
        /// The table that was asked for, or the one that fits best.
        table: String,
        /// Which structures, in words.
        lacking: String,
        /// What to do.
        remedy: &'static str,
    },
    /// More than one table has these numbers, with other meanings.
    #[error("its numbers are those of {one} and of {other}, which mean different things by them; say whose they are")]
    Ambiguous {
        /// The first.
        one: String,
        /// The second.
        other: String,
    },
}

const OWN_TABLE: &str = "name them in a table of your own (a .tsv file with the columns index, name, tissue), or give \
                         the map as the tool wrote it";
const OTHER_TABLE: &str = "choose another table (freesurfer, synthseg, charm, gif, muse, hgm or a .tsv file), or give \
                           the map as the tool wrote it";

fn listed(codes: &[(u32, usize)]) -> String {
    const MOST: usize = 8;
    let first: Vec<String> =
        codes.iter().take(MOST).map(|(code, voxels)| format!("{code} ({voxels} voxels)")).collect();
    let more = codes.len().saturating_sub(MOST);
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    first.join(", ") + &rest
}

/// Finds the table of a map's numbers: among `chosen` where there is a choice, else among the built-in ones.
///
/// A table fits when it has every number of the map and the map has what no map of that tool is without.
///
/// # Errors
/// [`LabelError`] with the numbers at fault.
pub fn recognise<'a>(counts: &[LabelCount], chosen: Option<&[&'a LabelTable]>) -> Result<Recognised<'a>, LabelError>
where
    'static: 'a,
{
    let inside: Vec<&LabelCount> = counts.iter().filter(|c| c.code != 0 && c.voxels > 0).collect();
    match inside[..] {
        [] => return Err(LabelError::Empty),
        [one] => return Err(LabelError::Mask { code: one.code }),
        _ => {}
    }
    let all: Vec<&LabelTable> = built_in().iter().collect();
    let tables: &[&'a LabelTable] = chosen.unwrap_or(&all);
    let unknown = |table: &LabelTable| -> Vec<(u32, usize)> {
        inside.iter().filter(|c| table.structure(c.code).is_none()).map(|c| (c.code, c.voxels)).collect()
    };
    let lacking = |table: &LabelTable| {
        let missing =
            table.needed.iter().find(|set| !inside.iter().any(|c| set.contains(&c.code))).and_then(|set| set.first());
        missing.and_then(|&code| table.structure(code)).map(|s| format!("{} ({}) is missing", s.name, s.code))
    };
    let fitting: Vec<&'a LabelTable> =
        tables.iter().copied().filter(|t| unknown(t).is_empty() && lacking(t).is_none()).collect();
    if let Some(&table) = fitting.first() {
        let tissue = |t: &LabelTable, code| t.structure(code).map(|s| s.tissue);
        let differs = |other: &&LabelTable| inside.iter().any(|c| tissue(table, c.code) != tissue(other, c.code));
        if let Some(other) = fitting[1..].iter().copied().find(|t| differs(t)) {
            return Err(LabelError::Ambiguous { one: table.name.clone(), other: other.name.clone() });
        }
        let found = inside.iter().filter_map(|c| table.structure(c.code).map(|s| (s, c.voxels))).collect();
        return Ok(Recognised { table, found });
    }
    // The one with the fewest voxels unexplained is what the user most likely meant.
    let voxels = |codes: &[(u32, usize)]| codes.iter().map(|c| c.1).sum::<usize>();
    let with_needed: Vec<_> = tables.iter().filter(|t| lacking(t).is_none()).collect();
    let nearest = with_needed.into_iter().min_by_key(|t| voxels(&unknown(t)));
    let nearest = nearest.or_else(|| tables.iter().min_by_key(|t| voxels(&unknown(t))));
    let Some(nearest) = nearest else { return Err(LabelError::Empty) };
    let codes = unknown(nearest);
    let table = nearest.name.clone();
    Err(match lacking(nearest) {
        Some(lacking) if codes.is_empty() => LabelError::Lacking { table, lacking, remedy: OTHER_TABLE },
        _ => LabelError::Unknown { table, codes, remedy: if chosen.is_some() { OTHER_TABLE } else { OWN_TABLE } },
    })
}

#[cfg(test)]
mod tests {
    use super::super::tables::named;
    use super::*;

    fn counts(codes: &[u32]) -> Vec<LabelCount> {
        codes.iter().map(|&code| LabelCount { code, voxels: 10 }).collect()
    }

    fn name(codes: &[u32]) -> Result<String, LabelError> {
        recognise(&counts(codes), None).map(|r| r.table.name.clone())
    }

    const ASEG: [u32; 20] = [0, 2, 3, 4, 5, 7, 8, 10, 11, 14, 16, 24, 31, 41, 42, 43, 46, 47, 49, 251];
    const GIF: [u32; 14] = [0, 1, 2, 3, 4, 5, 39, 40, 60, 61, 84, 92, 143, 144];
    const MUSE: [u32; 13] = [0, 4, 11, 35, 38, 39, 59, 60, 81, 82, 142, 143, 207];

    #[test]
    fn maps_are_known_by_their_numbers() {
        assert_eq!(name(&ASEG).unwrap(), "freesurfer");
        assert_eq!(name(&[&ASEG[..11], &[41, 42, 43, 46, 47, 49, 1005, 2005]].concat()).unwrap(), "synthseg");
        assert_eq!(name(&[&ASEG[..11], &[41, 42, 47, 507, 515, 136]].concat()).unwrap(), "synthseg");
        assert_eq!(name(&[&ASEG[..], &[1005, 2005]].concat()).unwrap(), "freesurfer");
        assert_eq!(name(&[0, 1, 2, 3, 5, 6, 7, 8, 9, 10]).unwrap(), "charm");
        assert_eq!(name(&GIF).unwrap(), "gif");
        assert_eq!(name(&MUSE).unwrap(), "muse");
        assert_eq!(name(&[0, 1, 2, 3, 4]).unwrap(), "hgm");
        assert_eq!(name(&[0, 2, 3]).unwrap(), "hgm");
    }

    #[test]
    fn a_map_of_one_tool_is_not_taken_for_anothers() {
        let with = |codes: &[u32], table: &str| recognise(&counts(codes), Some(&named(table))).map(|_| ());
        for (codes, own) in [(&ASEG[..], "freesurfer"), (&GIF, "gif"), (&MUSE, "muse"), (&[1, 2, 3, 5, 7, 8], "charm")]
        {
            for table in ["freesurfer", "synthseg", "charm", "gif", "muse", "hgm"] {
                let taken = with(codes, table).is_ok();
                assert_eq!(taken, table == own, "{own} as {table}");
            }
        }
    }

    #[test]
    fn unknown_numbers_are_named_with_the_remedy() {
        let error = name(&[&ASEG[..], &[4242]].concat()).unwrap_err().to_string();
        assert!(error.contains("4242 (10 voxels)") && error.contains("freesurfer"), "{error}");
        assert!(error.contains("a .tsv file with the columns"), "{error}");
        let error = recognise(&counts(&[2, 3]), Some(&named("freesurfer"))).unwrap_err().to_string();
        assert!(error.contains("Right-Cerebral-Cortex (42) is missing"), "{error}");
    }

    #[test]
    fn a_mask_and_an_empty_map_are_told() {
        assert_eq!(name(&[0, 1]), Err(LabelError::Mask { code: 1 }));
        assert_eq!(name(&[0, 255]), Err(LabelError::Mask { code: 255 }));
        assert_eq!(name(&[0]), Err(LabelError::Empty));
    }
}
