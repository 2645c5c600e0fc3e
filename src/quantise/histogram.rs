//! How often each vector occurs, counted in memory that follows the number of distinct ones.

use super::Vector;

/// Fewest vectors that a [`Tally`] holds back before it sorts them in.
const BUFFER: usize = 1 << 15;

/// A distinct vector and how often it occurs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// The vector.
    pub vector: Vector,
    /// How often it occurs; at least 1.
    pub count: u64,
}

/// A histogram that is being counted; [`Tally::finish`] makes it a [`Histogram`].
///
/// It holds a limited number of distinct vectors. Where there are more, the lowest bits of all components are dropped, as
/// few as it takes; a code book of some hundred words does not notice. The result depends on what was counted only, not
/// on the order.
#[derive(Clone, Debug)]
pub struct Tally {
    settled: Histogram,
    waiting: Vec<Entry>,
    most: usize,
    /// Bits that are dropped.
    dropped: u32,
}

impl Default for Tally {
    fn default() -> Self {
        Tally::within(usize::MAX)
    }
}

impl Tally {
    /// An empty one that holds every vector.
    #[must_use]
    pub fn new() -> Tally {
        Tally::default()
    }

    /// An empty one that holds at most `most` distinct vectors.
    #[must_use]
    pub fn within(most: usize) -> Tally {
        Tally { settled: Histogram::default(), waiting: Vec::new(), most: most.max(1), dropped: 0 }
    }

    /// Counts one vector.
    #[inline]
    pub fn add(&mut self, vector: Vector) {
        self.add_counted(vector, 1);
    }

    /// Counts a vector `count` times. Counts stop at `u64::MAX`.
    #[inline]
    pub fn add_counted(&mut self, vector: Vector, count: u64) {
        if let Some(last) = self.waiting.last_mut()
            && last.vector == vector
        {
            last.count = last.count.saturating_add(count);
            return;
        }
        if count > 0 {
            // With a quarter as many waiting as there are distinct ones, a vector is moved a constant number of times on
            // average, and what waits is small beside what is settled.
            if self.waiting.len() >= BUFFER.max(self.settled.len() / 4).min(self.most) {
                self.settle();
            }
            self.waiting.push(Entry { vector, count });
        }
    }

    /// What was counted.
    #[must_use]
    pub fn finish(mut self) -> Histogram {
        self.settle();
        self.settled
    }

    fn settle(&mut self) {
        let mut waiting = std::mem::take(&mut self.waiting);
        drop_bits(&mut waiting, self.dropped);
        sort(&mut waiting);
        self.settled.take_in(&waiting);
        waiting.clear();
        self.waiting = waiting;
        // All that came before is a part of what is there now: what is dropped in the end follows from all of it.
        while self.settled.len() > self.most && self.dropped < 31 {
            self.dropped += 1;
            drop_bits(&mut self.settled.entries, self.dropped);
            sort(&mut self.settled.entries);
        }
    }
}

/// Puts the middle of 2^`bits` values in place of each of them.
fn drop_bits(entries: &mut [Entry], bits: u32) {
    if bits > 0 {
        for v in entries.iter_mut().flat_map(|e| &mut e.vector) {
            *v = (*v >> bits << bits) + (1 << (bits - 1));
        }
    }
}

/// Sorts by vector, and joins equal ones.
fn sort(entries: &mut Vec<Entry>) {
    // One number per vector compares faster than three.
    let key = |e: &Entry| e.vector.iter().fold(0, |key, &c| key << 32 | u128::from(c as u32 ^ 1 << 31));
    entries.sort_unstable_by_key(key);
    entries.dedup_by(|next, kept| {
        let same = next.vector == kept.vector;
        if same {
            kept.count = kept.count.saturating_add(next.count);
        }
        same
    });
}

/// Distinct vectors with their counts, ascending by vector.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Histogram {
    entries: Vec<Entry>,
}

impl Histogram {
    /// The distinct vectors, ascending by components 0, 1, 2.
    #[must_use]
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Number of distinct vectors.
    #[must_use]
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether nothing was counted.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Number of vectors counted, at most `u64::MAX`.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.entries.iter().fold(0, |sum, e| sum.saturating_add(e.count))
    }

    /// Both together. Any order of merges gives the same.
    #[must_use]
    pub fn merge(mut self, mut other: Histogram) -> Histogram {
        if self.len() < other.len() {
            std::mem::swap(&mut self, &mut other);
        }
        self.take_in(&other.entries);
        self
    }

    /// Merges entries that are ascending and distinct.
    fn take_in(&mut self, other: &[Entry]) {
        if self.entries.is_empty() {
            self.entries.extend_from_slice(other);
            return;
        }
        let mut merged = Vec::with_capacity(self.len() + other.len());
        let mut own = self.entries.iter().copied().peekable();
        for &entry in other {
            while let Some(smaller) = own.next_if(|e| e.vector < entry.vector) {
                merged.push(smaller);
            }
            let same = own.next_if(|e| e.vector == entry.vector).map_or(0, |e| e.count);
            merged.push(Entry { vector: entry.vector, count: entry.count.saturating_add(same) });
        }
        merged.extend(own);
        merged.shrink_to_fit();
        self.entries = merged;
    }
}

impl FromIterator<Vector> for Histogram {
    fn from_iter<I: IntoIterator<Item = Vector>>(vectors: I) -> Histogram {
        let mut tally = Tally::new();
        vectors.into_iter().for_each(|v| tally.add(v));
        tally.finish()
    }
}
