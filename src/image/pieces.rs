//! Work on pieces of slices, on all threads.
//!
//! One loop for every caller: woven into rayon's own code, a caller's loop would be compiled anew with all of that code around it.

use rayon::prelude::*;

/// `work` on pieces of `data`, `at_once` values each; it gets the place of a piece's first value, and the piece.
pub(crate) fn each_piece<T: Send>(data: &mut [T], at_once: usize, work: &(dyn Fn(usize, &mut [T]) + Sync)) {
    let at_once = at_once.max(1);
    data.par_chunks_mut(at_once).enumerate().for_each(|(n, piece)| work(n * at_once, piece));
}

/// What is done with pieces of two slices, given the place of their first values.
type OnPair<'a, A, B> = dyn Fn(usize, &mut [A], &mut [B]) + Sync + 'a;

/// The same on pieces of two slices of one length.
pub(crate) fn each_pair<A: Send, B: Send>((a, b): (&mut [A], &mut [B]), at_once: usize, work: &OnPair<'_, A, B>) {
    let at_once = at_once.max(1);
    let pieces = a.par_chunks_mut(at_once).zip(b.par_chunks_mut(at_once)).enumerate();
    pieces.for_each(|(n, (a, b))| work(n * at_once, a, b));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_in_one_piece_and_knows_its_place() {
        for at_once in [0, 1, 7, 100, 1000] {
            let (mut a, mut b) = (vec![0; 100], vec![0.0; 100]);
            each_piece(&mut a, at_once, &|first, piece| {
                piece.iter_mut().enumerate().for_each(|(n, x)| *x += first + n);
            });
            each_pair((&mut a, &mut b), at_once, &|first, a, b| {
                a.iter_mut().zip(b).enumerate().for_each(|(n, (a, b))| (*a, *b) = (*a + 1, *b + (first + n) as f64));
            });
            assert!(a.iter().enumerate().all(|(n, x)| *x == n + 1), "{at_once}");
            assert!(b.iter().enumerate().all(|(n, x)| *x == n as f64), "{at_once}");
        }
    }
}
