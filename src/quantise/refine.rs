//! Better code books by rounds of k-means, in integers.

use super::{Entry, Histogram, MAX_BOOK, Nearest, Vector, mean, sort_book, squared_distance};
use rayon::prelude::*;

/// Entries that one task of a round takes.
const CHUNK: usize = 1 << 13;

/// What is assigned to one word of a book.
#[derive(Clone, Copy, Default)]
struct Cluster {
    sum: [i128; 3],
    count: u128,
}

/// All clusters of a book, and the squared error of everything.
struct Clusters {
    of_word: Vec<Cluster>,
    error: u128,
}

impl Clusters {
    fn new(histogram: &Histogram, book: &[Vector]) -> Clusters {
        let nearest = Nearest::new(book);
        let empty = || Clusters { of_word: vec![Cluster::default(); book.len()], error: 0 };
        // Sums of integers do not depend on the order of chunks.
        let chunks = histogram.entries().par_chunks(CHUNK);
        chunks.fold(empty, |all, own| all.assign(own, book, &nearest)).reduce(empty, Clusters::join)
    }

    fn assign(mut self, entries: &[Entry], book: &[Vector], nearest: &Nearest) -> Clusters {
        for e in entries {
            let word = usize::from(nearest.find(e.vector));
            let cluster = &mut self.of_word[word];
            for c in 0..3 {
                cluster.sum[c] += i128::from(e.vector[c]) * i128::from(e.count);
            }
            cluster.count += u128::from(e.count);
            self.error = self.error.saturating_add(weighted(e, book[word]));
        }
        self
    }

    fn join(mut self, other: Clusters) -> Clusters {
        for (own, other) in self.of_word.iter_mut().zip(other.of_word) {
            (0..3).for_each(|c| own.sum[c] += other.sum[c]);
            own.count += other.count;
        }
        self.error = self.error.saturating_add(other.error);
        self
    }
}

/// Squared error of all vectors of an entry if `word` stands for them.
fn weighted(entry: &Entry, word: Vector) -> u128 {
    u128::from(entry.count) * u128::from(squared_distance(entry.vector, word))
}

/// Sum of squared distances from each counted vector to its nearest word; 0 for an empty book. Stops at `u128::MAX`.
#[must_use]
pub fn squared_error(histogram: &Histogram, book: &[Vector]) -> u128 {
    let book = &book[..book.len().min(MAX_BOOK)];
    if book.is_empty() { 0 } else { Clusters::new(histogram, book).error }
}

/// A book with no larger [`squared_error`] than `book`, after at most `rounds` rounds of k-means (Lloyd).
///
/// A word that nothing is nearest to moves to where count × squared distance is largest, the first of equals. Stops as
/// soon as a round gains nothing. The result is in the order of [`sort_book`], without doubles; at most 256 words.
#[must_use]
pub fn refine(histogram: &Histogram, book: &[Vector], rounds: usize) -> Vec<Vector> {
    let mut best = book[..book.len().min(MAX_BOOK)].to_vec();
    sort_book(&mut best);
    if best.is_empty() || histogram.is_empty() {
        return best;
    }
    let words = book.len().min(MAX_BOOK);
    let mut clusters = Clusters::new(histogram, &best);
    for _ in 0..rounds {
        if clusters.error == 0 {
            break;
        }
        let next = moved(histogram, &best, &clusters, words);
        let found = Clusters::new(histogram, &next);
        if found.error >= clusters.error {
            break;
        }
        (best, clusters) = (next, found);
    }
    best
}

/// The means of all clusters, and new places for the rest of `words`.
fn moved(histogram: &Histogram, book: &[Vector], clusters: &Clusters, words: usize) -> Vec<Vector> {
    let live = clusters.of_word.iter().filter(|c| c.count > 0);
    let mut next: Vec<Vector> = live.map(|c| mean(c.sum, c.count)).collect();
    let wanted = words - next.len();
    if wanted > 0 {
        let nearest = Nearest::new(book);
        let worst = |e: &Entry| weighted(e, book[usize::from(nearest.find(e.vector))]);
        let mut worst: Vec<(u128, Vector)> =
            histogram.entries().par_iter().map(|e| (worst(e), e.vector)).filter(|&(error, _)| error > 0).collect();
        worst.par_sort_unstable_by_key(|&(error, vector)| (std::cmp::Reverse(error), vector));
        next.extend(worst.iter().take(wanted).map(|&(_, vector)| vector));
    }
    sort_book(&mut next);
    next
}
