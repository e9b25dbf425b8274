//! The built-in tables. Numbers and names are those of the tools' own lists, named in each file.

mod freesurfer;
mod gif;
mod hgm;
mod muse;
mod neuromorphometrics;
mod simnibs;
mod synthseg;

use super::table::LabelTable;
use std::sync::OnceLock;

/// Every built-in table. The narrower of two that hold the same numbers stands first.
pub fn built_in() -> &'static [LabelTable] {
    static TABLES: OnceLock<Vec<LabelTable>> = OnceLock::new();
    TABLES.get_or_init(|| {
        vec![
            hgm::table(),
            simnibs::tissues(),
            synthseg::table(),
            freesurfer::table(),
            simnibs::labeling(),
            gif::table(),
            muse::table(),
        ]
    })
}

/// The tables that a word names: SimNIBS' charm writes two kinds of map.
pub fn named(word: &str) -> Vec<&'static LabelTable> {
    built_in().iter().filter(|t| t.name == word || (word == "charm" && t.name == "charm-labeling")).collect()
}

#[cfg(test)]
mod tests {
    use super::super::table::{Side, Tissue};
    use super::*;

    fn tissue(table: &str, code: u32) -> Option<Tissue> {
        named(table)[0].structure(code).map(|s| s.tissue)
    }

    #[test]
    fn every_table_has_each_number_once_and_needs_only_numbers_it_has() {
        for table in built_in() {
            assert!(table.structures.windows(2).all(|w| w[0].code < w[1].code), "{}", table.name);
            assert!(table.needed.iter().flatten().all(|&c| table.structure(c).is_some()), "{}", table.name);
            assert!(table.structures.iter().any(|s| s.tissue == Tissue::White));
        }
    }

    /// Lines of FreeSurferColorLUT.txt (distribution/ of the FreeSurfer sources), number and name.
    #[test]
    fn freesurfer_numbers_have_the_names_of_its_colour_table() {
        let lut = "2 Left-Cerebral-White-Matter|3 Left-Cerebral-Cortex|4 Left-Lateral-Ventricle|5 Left-Inf-Lat-Vent|\
            7 Left-Cerebellum-White-Matter|8 Left-Cerebellum-Cortex|10 Left-Thalamus-Proper|11 Left-Caudate|12 Left-Putamen|\
            13 Left-Pallidum|14 3rd-Ventricle|15 4th-Ventricle|16 Brain-Stem|17 Left-Hippocampus|18 Left-Amygdala|24 CSF|\
            26 Left-Accumbens-area|28 Left-VentralDC|30 Left-vessel|31 Left-choroid-plexus|41 Right-Cerebral-White-Matter|\
            42 Right-Cerebral-Cortex|43 Right-Lateral-Ventricle|44 Right-Inf-Lat-Vent|46 Right-Cerebellum-White-Matter|\
            47 Right-Cerebellum-Cortex|49 Right-Thalamus-Proper|50 Right-Caudate|51 Right-Putamen|52 Right-Pallidum|\
            53 Right-Hippocampus|54 Right-Amygdala|58 Right-Accumbens-area|60 Right-VentralDC|62 Right-vessel|\
            63 Right-choroid-plexus|72 5th-Ventricle|77 WM-hypointensities|80 non-WM-hypointensities|85 Optic-Chiasm|\
            251 CC_Posterior|252 CC_Mid_Posterior|253 CC_Central|254 CC_Mid_Anterior|255 CC_Anterior";
        let table = named("freesurfer")[0];
        for line in lut.split('|') {
            let (code, name) = line.split_once(' ').unwrap();
            assert_eq!(table.structure(code.parse().unwrap()).map(|s| s.name.as_str()), Some(name));
        }
        assert_eq!(table.structure(1030).map(|s| s.name.as_str()), Some("ctx-lh-superiortemporal"));
        assert_eq!(table.structure(2035).map(|s| s.name.as_str()), Some("ctx-rh-insula"));
        assert_eq!(table.structure(3028).map(|s| s.tissue), Some(Tissue::White), "wm-lh-superiorfrontal");
        assert_eq!(table.structure(12_104).map(|s| (s.side(), s.tissue)), Some((Some(Side::Right), Tissue::Grey)));
    }

    #[test]
    fn each_tools_tissues_are_told_by_its_own_numbers() {
        use Tissue::{Csf, Grey, Outside, Ventricle, White};
        let expected: [(&str, &[(u32, Tissue)]); 6] = [
            ("freesurfer", &[(2, White), (3, Grey), (5, Ventricle), (15, Csf), (16, White), (10, Grey), (255, White)]),
            ("synthseg", &[(24, Csf), (136, Ventricle), (515, Outside), (507, Outside), (25, White), (14, Ventricle)]),
            ("charm", &[(1, White), (2, Grey), (3, Csf), (5, Outside), (7, Outside), (10, Outside)]),
            ("gif", &[(4, Csf), (5, Ventricle), (12, Csf), (35, White), (84, White), (101, Grey), (66, Ventricle)]),
            ("muse", &[(4, Ventricle), (11, Csf), (51, Ventricle), (81, White), (95, White), (100, Grey), (35, White)]),
            ("hgm", &[(1, Csf), (2, Grey), (3, White), (4, Ventricle)]),
        ];
        for (table, codes) in expected {
            for &(code, wanted) in codes {
                assert_eq!(tissue(table, code), Some(wanted), "{table} {code}");
            }
        }
        assert_eq!(tissue("gif", 7), None);
    }

    #[test]
    fn structures_come_in_pairs_of_one_tissue() {
        for table in built_in() {
            let count = |side| {
                let mut kinds: Vec<_> =
                    table.structures.iter().filter(|s| s.side() == Some(side)).map(|s| s.tissue).collect();
                kinds.sort();
                kinds
            };
            assert_eq!(count(Side::Left), count(Side::Right), "{}", table.name);
        }
    }
}
