//! The draws of a prediction as text: a line for each, its coordinates among the modes last.

use super::modes::DrawnState;
use thiserror::Error;

/// Columns before the modes.
const FIRST: [&str; 4] = ["supports", "draw", "weight", "over_threshold_cc"];

/// Why a table of draws cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("line {line}: {problem}")]
pub struct DrawsTableError {
    /// Counted from 1.
    pub line: usize,
    /// What is wrong with it.
    pub problem: &'static str,
}

/// The name of a mode's column, and of its array on the mesh.
pub fn mode_name(mode: usize) -> String {
    format!("mode_{:02}", mode + 1)
}

/// The table.
pub fn draws_to_csv(draws: &[DrawnState]) -> String {
    let modes = draws.first().map_or(0, |draw| draw.coordinates.len());
    let head: Vec<String> = FIRST.iter().map(|&name| name.to_owned()).chain((0..modes).map(mode_name)).collect();
    let mut text = head.join(",") + "\n";
    for draw in draws {
        text += &format!("{},{},{},{:.4}", draw.supports, draw.number, draw.weight, draw.over_threshold_cc);
        // Six decimals of a coordinate are far less than a mode's own rounding.
        draw.coordinates.iter().for_each(|c| text += &format!(",{:.6}", c + 0.0));
        text += "\n";
    }
    text
}

/// The draws of a table.
///
/// # Errors
/// [`DrawsTableError`] for a table that is none, or was cut short.
pub fn draws_from_csv(text: &str) -> Result<Vec<DrawnState>, DrawsTableError> {
    let wrong = |line: usize, problem| DrawsTableError { line: line + 1, problem };
    let mut lines = text.lines().enumerate();
    let head: Vec<&str> = lines.next().map(|(_, head)| head.split(',').collect()).unwrap_or_default();
    if head.len() < FIRST.len() || head[..FIRST.len()] != FIRST {
        return Err(wrong(0, "not the head of a table of draws"));
    }
    let mut draws = Vec::new();
    for (n, line) in lines {
        let cells: Vec<&str> = line.split(',').collect();
        if cells.len() != head.len() {
            return Err(wrong(n, "not as many cells as the head has"));
        }
        let numbers: Vec<f64> = cells[2..].iter().filter_map(|cell| cell.parse().ok()).collect();
        let number = cells[1].parse().map_err(|_| wrong(n, "the draw's number is no number"))?;
        if numbers.len() + 2 != cells.len() || !numbers.iter().all(|x| x.is_finite()) {
            return Err(wrong(n, "a cell is no number"));
        }
        draws.push(DrawnState {
            supports: cells[0].to_owned(),
            number,
            weight: numbers[0],
            over_threshold_cc: numbers[1],
            coordinates: numbers[2..].to_vec(),
        });
    }
    if draws.is_empty() { Err(wrong(1, "holds no draw")) } else { Ok(draws) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draws() -> Vec<DrawnState> {
        let of = |n: usize| DrawnState {
            supports: if n < 2 { "fixed" } else { "sliding" }.to_owned(),
            number: n % 2,
            weight: 0.25,
            over_threshold_cc: 12.5 * n as f64,
            coordinates: vec![0.5 - n as f64, 0.25],
        };
        (0..4).map(of).collect()
    }

    #[test]
    fn a_table_is_read_as_it_was_written_and_a_damaged_one_is_refused_by_its_line() {
        let text = draws_to_csv(&draws());
        assert_eq!(draws_from_csv(&text).unwrap(), draws());
        let cases = [
            (String::new(), "line 1"),
            ("supports,draw,weight,over_threshold_cc,mode_01\n".to_owned(), "holds no draw"),
            (text.replace("0.250000\nsliding", "\nsliding"), "line 3: a cell"),
            (text[..text.len() - 12].to_owned(), "line 5: not as many"),
            (text.replace("fixed,1", "fixed,x"), "line 3: the draw"),
        ];
        for (text, words) in cases {
            let said = draws_from_csv(&text).unwrap_err().to_string();
            assert!(said.contains(words), "{words}: {said}");
        }
    }
}
