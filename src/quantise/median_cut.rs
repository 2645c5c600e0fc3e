//! Code books by median cut (Heckbert 1982, as the zerobit paper §2.4 uses it).

use super::{Entry, Histogram, Vector, mean, sort_book};

/// A box: a run of entries, and how much there is to gain by cutting it.
struct Part {
    from: usize,
    to: usize,
    axis: usize,
    /// Population × longest side; 0 where nothing can be cut.
    weight: u128,
}

impl Part {
    fn new(entries: &[Entry], from: usize, to: usize) -> Part {
        let own = &entries[from..to];
        let (mut low, mut high) = ([i32::MAX; 3], [i32::MIN; 3]);
        for e in own {
            for c in 0..3 {
                low[c] = low[c].min(e.vector[c]);
                high[c] = high[c].max(e.vector[c]);
            }
        }
        let side = |c: usize| high[c].abs_diff(low[c]);
        // The first of the longest axes.
        let axis = (1..3).fold(0, |best, c| if side(c) > side(best) { c } else { best });
        Part { from, to, axis, weight: population(own) * u128::from(side(axis)) }
    }

    /// Cuts at the median: the first half ends with the entry that brings it to half the population. Sorts the entries
    /// of the box along its axis, within equal ones by vector.
    fn cut(&self, entries: &mut [Entry]) -> [Part; 2] {
        let own = &mut entries[self.from..self.to];
        own.sort_unstable_by_key(|e| (e.vector[self.axis], e.vector));
        let all = population(own);
        let mut seen = 0;
        let median = own.iter().position(|e| {
            seen += u128::from(e.count);
            2 * seen >= all
        });
        // Both halves get at least one.
        let at = self.from + median.map_or(1, |m| m + 1).min(own.len() - 1);
        [Part::new(entries, self.from, at), Part::new(entries, at, self.to)]
    }
}

fn population(entries: &[Entry]) -> u128 {
    entries.iter().map(|e| u128::from(e.count)).sum()
}

/// A book of at most `most` vectors; the vectors themselves where there are no more than that.
///
/// The box with the largest product of population and longest side is cut next, the earlier made one of equals. A box
/// stands for the mean of its vectors. The book is in the order of [`sort_book`], without doubles.
#[must_use]
pub fn median_cut(histogram: &Histogram, most: usize) -> Vec<Vector> {
    let mut entries = histogram.entries().to_vec();
    if entries.is_empty() || most == 0 {
        return Vec::new();
    }
    let mut book: Vec<Vector> = if entries.len() <= most {
        entries.iter().map(|e| e.vector).collect()
    } else {
        let boxes = boxes(&mut entries, most);
        boxes.iter().map(|b| representative(&entries[b.from..b.to])).collect()
    };
    sort_book(&mut book);
    book
}

/// At most `most` boxes in the order in which they were made.
fn boxes(entries: &mut [Entry], most: usize) -> Vec<Part> {
    let mut boxes = vec![Part::new(entries, 0, entries.len())];
    while boxes.len() < most {
        let heaviest = (1..boxes.len()).fold(0, |best, b| if boxes[b].weight > boxes[best].weight { b } else { best });
        if boxes[heaviest].weight == 0 {
            break;
        }
        // Both halves are younger than every box so far.
        let halves = boxes.remove(heaviest).cut(entries);
        boxes.extend(halves);
    }
    boxes
}

fn representative(entries: &[Entry]) -> Vector {
    let mut sum = [0; 3];
    for e in entries {
        sum = std::array::from_fn(|c| sum[c] + i128::from(e.vector[c]) * i128::from(e.count));
    }
    mean(sum, population(entries))
}
