//! The points that a prediction is asked for, as a file of the user's holds them.

use super::error::{PredictError, WorkflowError};
use super::user_file::{read_input, shown};
use crate::geometry::{Position, Pre};
use crate::image::Mask;
use crate::overlay::Drawing;
use std::path::Path;

/// A target may lie this far outside the brain, in fluid or in a membrane, mm.
const BESIDE_MM: f64 = 10.0;

/// Points with their names.
#[derive(Clone, Debug)]
pub(crate) struct Targets {
    /// The file's name.
    file: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// Places in the scanner's frame, mm.
    pub points_mm: Vec<[f64; 3]>,
    /// What each is called there, where that is more than its number.
    pub names: Vec<Option<String>>,
}

impl Targets {
    /// Reads them; a file without any is refused.
    pub fn read(path: &Path) -> Result<Self, WorkflowError> {
        let (file, bytes) = (shown(path), read_input(path)?);
        let drawing = Drawing::decode(&bytes, &file)?;
        drawing.check_of_scanner(&file)?;
        if drawing.points_mm.is_empty() {
            return Err(PredictError::NoTarget { file }.into());
        }
        let names = (0..drawing.points_mm.len()).map(|n| name_of(&drawing, n)).collect();
        Ok(Self { file, bytes, points_mm: drawing.points_mm, names })
    }

    /// Refuses a point outside the head. Labels alone tell, so nothing needs to be meshed or written before.
    pub fn check_inside(&self, brain: &Mask<Pre>) -> Result<(), PredictError> {
        match self.points_mm.iter().position(|x| !is_near(brain, *x)) {
            None => Ok(()),
            Some(n) => {
                Err(PredictError::TargetOutside { file: self.file.clone(), target: n + 1, at_mm: self.points_mm[n] })
            }
        }
    }
}

/// A point's name in one line, without what is no letter to a terminal.
fn name_of(drawing: &Drawing, number: usize) -> Option<String> {
    let name = drawing.names.get(number)?.replace(char::is_control, " ");
    let name = name.trim();
    (!name.is_empty()).then(|| name.to_owned())
}

/// Whether the brain has a voxel near a point.
fn is_near(brain: &Mask<Pre>, x: [f64; 3]) -> bool {
    let grid = &brain.grid;
    let p: Position<Pre> = Position::new(x[0], x[1], x[2]);
    let (middle, spacing) = (grid.voxel_at(p), grid.spacing_mm());
    let around = |axis: usize| {
        let reach = BESIDE_MM / spacing[axis];
        let last = grid.dims[axis] as f64 - 1.0;
        let (low, high) = ((middle[axis] - reach).ceil().max(0.0), (middle[axis] + reach).floor().min(last));
        // A range of negative length holds nothing.
        if low > high { 0..0 } else { low as usize..high as usize + 1 }
    };
    let [mut xs, ys, zs] = [0, 1, 2].map(around);
    let near = |voxel: [usize; 3]| (grid.centre(voxel).mm - p.mm).norm() <= BESIDE_MM;
    xs.any(|i| ys.clone().any(|j| zs.clone().any(|k| brain.data[grid.index(i, j, k)] && near([i, j, k]))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    #[test]
    fn a_target_has_the_name_of_its_file_in_one_line() {
        let of = |text: &str, file: &str| {
            let drawing = Drawing::decode(text.as_bytes(), file).unwrap();
            (0..drawing.points_mm.len()).map(|n| name_of(&drawing, n)).collect::<Vec<_>>()
        };
        let some = |name: &str| Some(name.to_owned());
        assert_eq!(of("name,x,y,z\n\"STN, left\",1,2,3\n\u{1b}Vim,1,2,3\n", "t.csv"), [some("STN, left"), some("Vim")]);
        assert_eq!(of("x,y,z\n1,2,3\n", "t.csv"), [None]);
        assert_eq!(of("1,-12,-20,-5,0,0,0,1,1,1,0,\"STN, L\",,\n", "t.fcsv"), [some("STN, L")]);
        let point = |label: &str, more: &str| format!("{{\"label\": \"{label}\", \"position\": [1, 2, 3]{more}}}");
        let (placed, not) = (point("STN", ""), point("next", ", \"positionStatus\": \"undefined\""));
        let text = format!("{{\"markups\": [{{\"controlPoints\": [{not}, {placed}]}}]}}");
        assert_eq!(of(&text, "t.mrk.json"), [some("STN")]);
    }

    #[test]
    fn a_target_lies_in_the_head_or_a_centimetre_beside_the_brain() {
        let grid = Grid::<Pre>::axis_aligned([40, 40, 20], [1.0, 1.0, 2.0], [-20.0, -20.0, -20.0]);
        let brain = Mask::from_fn(grid, |n| (0..3).all(|a| grid.centre(grid.voxel(n)).mm[a].abs() <= 5.0));
        let cases = [
            ([0.0, 0.0, 0.0], true),
            ([14.9, 0.0, 0.0], true),
            ([15.6, 0.0, 0.0], false),
            ([0.0, 0.0, -13.9], true),
            ([500.0, 0.0, 0.0], false),
            ([-500.0, 0.0, 0.0], false),
        ];
        for (x, near) in cases {
            assert_eq!(is_near(&brain, x), near, "{x:?}");
        }
    }
}
