//! Nested dissection: an elimination order that keeps the factor of a mesh's matrix small.
//!
//! The nodes are cut in two halves at the median along an axis; those on one side of the cut with a neighbour on the
//! other become the separator and are eliminated last, the halves before them in the same way (George, "Nested
//! dissection of a regular finite element mesh", SIAM J. Numer. Anal. 10, 1973). Of the three axes the one with the
//! smallest separator is taken. Written here because no maintained pure-Rust crate offers it and minimum-degree
//! orderings of tetrahedral meshes cost about three times the work.

use super::super::sparse::BlockPattern;

fn mark(part: &mut [u32], rows: &[u32], number: u32) {
    for &row in rows {
        part[row as usize] = number;
    }
}

/// Parts of at most this many nodes are not cut further.
const LEAF: usize = 40;

/// Old row of every new one.
pub(super) fn nested_dissection(pattern: &BlockPattern, positions: &[[f64; 3]]) -> Vec<u32> {
    let mut order = Vec::with_capacity(positions.len());
    // Which part a row belongs to; parts under way have their own number.
    let mut part = vec![0u32; positions.len()];
    let mut parts = 1;
    let all: Vec<u32> = (0..positions.len() as u32).collect();
    dissect(&Mesh { pattern, positions }, all, 0, &mut part, &mut parts, &mut order);
    order
}

struct Mesh<'a> {
    pattern: &'a BlockPattern,
    positions: &'a [[f64; 3]],
}

impl Mesh<'_> {
    fn neighbours(&self, row: u32) -> &[u32] {
        let row = row as usize;
        &self.pattern.columns[self.pattern.row_start[row]..self.pattern.row_start[row + 1]]
    }
}

fn dissect(mesh: &Mesh, rows: Vec<u32>, own: u32, part: &mut [u32], parts: &mut u32, order: &mut Vec<u32>) {
    if rows.len() <= LEAF {
        order.extend(rows);
        return;
    }
    let mut best: Option<(usize, [Vec<u32>; 3])> = None;
    for axis in 0..3 {
        let mut sorted = rows.clone();
        sorted.sort_by(|&a, &b| {
            let x = |n: u32| mesh.positions[n as usize][axis];
            x(a).total_cmp(&x(b)).then(a.cmp(&b))
        });
        let (low, high) = sorted.split_at(sorted.len() / 2);
        // Two marks for this trial, dropped again below.
        let (mark_low, mark_high) = (*parts, *parts + 1);
        mark(part, low, mark_low);
        mark(part, high, mark_high);
        let touches = |n: u32, mark: u32| mesh.neighbours(n).iter().any(|&m| part[m as usize] == mark);
        let cut_low: Vec<u32> = low.iter().copied().filter(|&n| touches(n, mark_high)).collect();
        let cut_high: Vec<u32> = high.iter().copied().filter(|&n| touches(n, mark_low)).collect();
        let (separator, from_low) = if cut_low.len() <= cut_high.len() { (cut_low, true) } else { (cut_high, false) };
        if best.as_ref().is_none_or(|(size, _)| separator.len() < *size) {
            let (kept, cut) = if from_low { (low, mark_high) } else { (high, mark_low) };
            let kept: Vec<u32> = kept.iter().copied().filter(|&n| !touches(n, cut)).collect();
            let other = if from_low { high } else { low }.to_vec();
            best = Some((separator.len(), [kept, other, separator]));
        }
        mark(part, &rows, own);
    }
    let Some((_, [first, second, separator])) = best else { return };
    let (a, b) = (*parts, *parts + 1);
    *parts += 2;
    mark(part, &first, a);
    mark(part, &second, b);
    // The separator belongs to neither half from here on.
    mark(part, &separator, u32::MAX);
    dissect(mesh, first, a, part, parts, order);
    dissect(mesh, second, b, part, parts, order);
    order.extend(separator);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_eliminated_once_and_halves_do_not_touch() {
        // A 12 x 12 x 12 grid with its 26 neighbours.
        let n = 12i32;
        let at = |i: i32, j: i32, k: i32| (i + n * (j + n * k)) as u32;
        let (mut row_start, mut columns, mut diagonal, mut positions) = (vec![0], Vec::new(), Vec::new(), Vec::new());
        for row in 0..n * n * n {
            let (i, j, k) = (row % n, row / n % n, row / (n * n));
            positions.push([f64::from(i), f64::from(j), f64::from(k)]);
            let inside = |v: i32| (0..n).contains(&v);
            for d in 0..27 {
                let (a, b, c) = (i + d % 3 - 1, j + d / 3 % 3 - 1, k + d / 9 - 1);
                if inside(a) && inside(b) && inside(c) {
                    if d == 13 {
                        diagonal.push(columns.len() as u32);
                    }
                    columns.push(at(a, b, c));
                }
            }
            row_start.push(columns.len());
        }
        let pattern = BlockPattern { row_start, columns, diagonal };
        let mut order = nested_dissection(&pattern, &positions);
        // The last plane separates the rest.
        let separator: Vec<u32> = order[order.len() - 144..].to_vec();
        let place: Vec<i32> = separator.iter().map(|&s| s as i32 % n).collect();
        assert!(place.iter().all(|&x| x == place[0]), "the first cut is one plane of the grid");
        order.sort_unstable();
        assert_eq!(order, (0..(n * n * n) as u32).collect::<Vec<_>>());
    }
}
