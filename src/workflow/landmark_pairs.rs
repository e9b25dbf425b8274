//! Landmarks of two scans, told which belongs to which.

use super::error::{LandmarkError, WorkflowError};
use super::user_file::{read_input, shown};
use crate::experiment::landmarks::fits_far_better;
use crate::geometry::{Frame, Position, RigidTransform};
use crate::overlay::Drawing;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Landmarks on both scans, each in its scanner's frame.
#[derive(Clone, Debug)]
pub struct Landmarks {
    /// Those of the pre-operative scan, or pairs.
    pub pre: PathBuf,
    /// Those of the post-operative one, where the first file holds no pairs.
    pub post: Option<PathBuf>,
}

/// Name, place before, place after.
pub(super) type Pair = (String, [f64; 3], [f64; 3]);

/// What belongs together, and what has nothing that it belongs to.
#[derive(Debug, Default)]
pub(super) struct Paired {
    pub pairs: Vec<Pair>,
    /// Names that one file alone holds.
    pub left_out: Vec<String>,
}

/// How the same name is written in two files: case and blanks around it do not count.
fn alike(name: &str) -> String {
    name.trim().to_lowercase()
}

fn read(path: &Path) -> Result<Drawing, WorkflowError> {
    let name = shown(path);
    let drawing = Drawing::decode(&read_input(path)?, &name)?;
    drawing.check_of_scanner(&name)?;
    if drawing.points_mm.is_empty() { Err(LandmarkError::Empty { file: name }.into()) } else { Ok(drawing) }
}

/// A point's name, or its number where it has none.
fn numbered(names: &[String], n: usize) -> String {
    names.get(n).filter(|name| !name.trim().is_empty()).cloned().unwrap_or_else(|| (n + 1).to_string())
}

/// Places in a list by name, and the first name that stands in it twice.
fn by_name(names: &[String]) -> (BTreeMap<String, usize>, Option<&String>) {
    let mut places = BTreeMap::new();
    let mut twice = None;
    for (n, name) in names.iter().enumerate().filter(|(_, name)| !name.trim().is_empty()) {
        if places.insert(alike(name), n).is_some() {
            twice = twice.or(Some(name));
        }
    }
    (places, twice)
}

impl Paired {
    /// Reads the landmarks of both scans and pairs them: by name, or in order where they have no name in common and are as many.
    ///
    /// # Errors
    /// Files that cannot be used, a name that stands twice in one of them, landmarks of which nobody knows which belong together.
    pub fn read(landmarks: &Landmarks) -> Result<Self, WorkflowError> {
        let pre = read(&landmarks.pre)?;
        let of_pre_at = |n: usize| numbered(&pre.names, n);
        let Some(path) = &landmarks.post else {
            if pre.pairs_mm.is_empty() {
                return Err(LandmarkError::NoPairs { file: shown(&landmarks.pre) }.into());
            }
            let pairs = (0..pre.points_mm.len()).map(|n| (of_pre_at(n), pre.points_mm[n], pre.pairs_mm[n]));
            return Ok(Self { pairs: pairs.collect(), left_out: Vec::new() });
        };
        let post = read(path)?;
        let (of_pre, of_post) = (pre.points_mm.len(), post.points_mm.len());
        let in_order = || (0..of_pre).map(|n| (of_pre_at(n), pre.points_mm[n], post.points_mm[n])).collect();
        let (before, twice_before) = by_name(&pre.names);
        let (after, twice_after) = by_name(&post.names);
        let common = before.keys().any(|name| after.contains_key(name));
        if common && pre.names != post.names {
            let twice = twice_before.map(|name| (&landmarks.pre, name)).or(twice_after.map(|name| (path, name)));
            if let Some((file, name)) = twice {
                return Err(LandmarkError::Twice { file: shown(file), name: name.clone() }.into());
            }
            let place = |n: usize| after.get(&alike(&pre.names[n])).copied();
            let pairs = (0..of_pre).filter_map(|n| Some((of_pre_at(n), pre.points_mm[n], post.points_mm[place(n)?])));
            let alone_before = (0..of_pre).filter(|&n| place(n).is_none()).map(of_pre_at);
            let alone = |n: &usize| !before.contains_key(&alike(&post.names[*n]));
            let alone_after = (0..of_post).filter(alone).map(|n| numbered(&post.names, n));
            return Ok(Self { pairs: pairs.collect(), left_out: alone_before.chain(alone_after).collect() });
        }
        // Without names in common, or with the same list twice, the order counts, where there are as many.
        if of_pre != of_post {
            let (pre, post) = (shown(&landmarks.pre), shown(path));
            return Err(LandmarkError::NoMatch { pre, post, of_pre, of_post }.into());
        }
        Ok(Self { pairs: in_order(), left_out: Vec::new() })
    }
}

/// How far points lie from their fellows by a rigid motion, mm (root mean square).
pub(super) fn apart_mm<A: Frame, B: Frame>(
    pairs: impl ExactSizeIterator<Item = ([f64; 3], [f64; 3])>,
    after_from_before: &RigidTransform<A, B>,
) -> f64 {
    let count = pairs.len().max(1) as f64;
    let of = |([x, y, z], after): ([f64; 3], [f64; 3])| {
        (after_from_before.apply(Position::new(x, y, z)).mm.coords - Vector3::from(after)).norm_squared()
    };
    (pairs.map(of).sum::<f64>() / count).sqrt()
}

/// Refuses landmarks that fit the rigid motion between the scans far better when they are read in another way: a brain shift does not
/// part the two so far.
///
/// # Errors
/// [`LandmarkError::FitsAs`].
pub(super) fn check_frames<A: Frame, B: Frame>(
    pairs: &[Pair],
    after_from_before: &RigidTransform<A, B>,
    files: &Landmarks,
) -> Result<(), LandmarkError> {
    let apart = |before: &dyn Fn(&Pair) -> [f64; 3], after: &dyn Fn(&Pair) -> [f64; 3]| {
        apart_mm(pairs.iter().map(|pair| (before(pair), after(pair))), after_from_before)
    };
    let (first, second) = (|pair: &Pair| pair.1, |pair: &Pair| pair.2);
    let (first_turned, second_turned) = (|pair: &Pair| turned(pair.1), |pair: &Pair| turned(pair.2));
    let given_mm = apart(&first, &second);
    let (pre, post) = (shown(&files.pre), files.post.as_deref().map_or_else(|| "the second scan".to_owned(), shown));
    let readings = [
        (apart(&first_turned, &second_turned), "x and y of both are turned round (LPS given as RAS)".to_owned()),
        (apart(&first_turned, &second), format!("x and y of {pre} are turned round (LPS given as RAS)")),
        (apart(&first, &second_turned), format!("x and y of {post} are turned round (LPS given as RAS)")),
        (apart(&second, &first), "the two are exchanged".to_owned()),
    ];
    let better = readings.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    match better.filter(|(mm, _)| fits_far_better(*mm, given_mm)) {
        Some((other_mm, how)) => Err(LandmarkError::FitsAs { file: pre, given_mm, other_mm, how }),
        None => Ok(()),
    }
}

fn turned([x, y, z]: [f64; 3]) -> [f64; 3] {
    [-x, -y, z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Post, Pre};

    fn written(folder: &Path, name: &str, rows: &[(&str, [f64; 3])]) -> PathBuf {
        let path = folder.join(name);
        let lines = rows.iter().map(|(name, [x, y, z])| format!("{name},{x},{y},{z}\n"));
        std::fs::write(&path, format!("name,x,y,z\n{}", lines.collect::<String>())).unwrap();
        path
    }

    fn paired(pre: &[(&str, [f64; 3])], post: &[(&str, [f64; 3])]) -> Result<Paired, String> {
        let folder = tempfile::tempdir().unwrap();
        let post = Some(written(folder.path(), "post.csv", post));
        let landmarks = Landmarks { pre: written(folder.path(), "pre.csv", pre), post };
        Paired::read(&landmarks).map_err(|e| e.to_string())
    }

    const A: [f64; 3] = [1.0, 2.0, 3.0];
    const B: [f64; 3] = [4.0, 5.0, 6.0];

    #[test]
    fn landmarks_belong_together_by_name_however_it_is_written_and_those_alone_are_named() {
        let found = paired(&[("Tip", A), ("base", B), ("only", A)], &[("BASE ", A), ("tip", B)]).unwrap();
        assert_eq!(found.pairs, [("Tip".to_owned(), A, B), ("base".to_owned(), B, A)]);
        assert_eq!(found.left_out, ["only"]);
        let found = paired(&[("a", A)], &[("a", B), ("b", B)]).unwrap();
        assert_eq!((found.pairs.len(), found.left_out), (1, vec!["b".to_owned()]));
    }

    #[test]
    fn numbers_of_rows_are_no_names_so_lists_without_names_belong_together_in_order_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let paired =
            |pre: PathBuf, post: PathBuf| Paired::read(&Landmarks { pre, post: Some(post) }).map_err(|e| e.to_string());
        let tag = |rows: &str| format!("MNI Tag Point File\nVolumes = 1;\nPoints =\n{rows};\n");
        let two = [
            file("two.csv", "x,y,z\n1,2,3\n4,5,6\n"),
            file("two.tag", &tag(" 1 2 3 \"\"\n 4 5 6 \"\"")),
            file(
                "two.mrk.json",
                r#"{"markups": [{"coordinateSystem": "RAS", "controlPoints": [{"position": [1, 2, 3]}, {"position": [4, 5, 6]}]}]}"#,
            ),
        ];
        let three = file("three.csv", "x,y,z\n0,0,0\n1,2,3\n4,5,6\n");
        for list in two {
            assert!(paired(three.clone(), list.clone()).is_err(), "{}", list.display());
            let found = paired(list.clone(), list).unwrap();
            assert_eq!(found.pairs, [("1".to_owned(), A, A), ("2".to_owned(), B, B)]);
        }
        let some = file("some.tag", &tag(" 1 2 3 \"\"\n 4 5 6 \"tip\"\n 0 0 0 \"\""));
        let found = paired(some, file("tip.csv", "name,x,y,z\ntip,1,2,3\n,0,0,0\n")).unwrap();
        assert_eq!(found.pairs, [("tip".to_owned(), B, A)]);
        assert_eq!(found.left_out, ["1", "3", "2"]);
    }

    #[test]
    fn a_name_twice_is_refused_unless_both_lists_are_the_same() {
        let refused = paired(&[("a", A), ("b", B)], &[("b", A), ("a", B), ("A", B)]).unwrap_err();
        assert!(refused.contains("post.csv") && refused.contains("twice"), "{refused}");
        assert!(paired(&[("a", A), ("a", B), ("b", A)], &[("b", B), ("a", A)]).unwrap_err().contains("pre.csv"));
        assert_eq!(paired(&[("F", A), ("F", B)], &[("F", B), ("F", A)]).unwrap().pairs.len(), 2);
    }

    #[test]
    fn landmarks_in_another_frame_or_order_are_told_by_the_rigid_motion_and_a_shift_is_not() {
        let motion: RigidTransform<Pre, Post> = RigidTransform::about(
            nalgebra::Point3::origin(),
            Vector3::new(0.1, 0.0, 0.05),
            Vector3::new(8.0, -6.0, 12.0),
        );
        let files = Landmarks { pre: "pre.csv".into(), post: Some("post.csv".into()) };
        let places = [[40.0, 10.0, 20.0], [-35.0, 30.0, 5.0], [10.0, -60.0, 30.0], [-20.0, -20.0, 50.0]];
        let check = |read: &dyn Fn([f64; 3], [f64; 3]) -> ([f64; 3], [f64; 3])| {
            let pair = |x: &[f64; 3]| {
                let mut y: [f64; 3] = motion.apply(Position::new(x[0], x[1], x[2])).mm.into();
                // A shift of 9 mm, downwards.
                y[2] -= 9.0;
                let (before, after) = read(*x, y);
                (String::new(), before, after)
            };
            check_frames(&places.iter().map(pair).collect::<Vec<_>>(), &motion, &files).map_err(|e| e.to_string())
        };
        assert_eq!(check(&|x, y| (x, y)), Ok(()));
        assert!(check(&|x, y| (turned(x), turned(y))).unwrap_err().contains("both"));
        assert!(check(&|x, y| (x, turned(y))).unwrap_err().contains("post.csv"));
        assert!(check(&|x, y| (y, x)).is_err());
    }
}
