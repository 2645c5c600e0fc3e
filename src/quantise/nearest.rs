//! The nearest word of a book, exactly: brute force, and a search that gives the same faster.

use super::{MAX_BOOK, Vector, squared_distance};

/// Candidates that a leaf may hold without being split.
const FEW: usize = 6;

/// Side of the smallest node, as a power of two. Nodes on a point where many words are equally near stay large else.
const SMALLEST_LOG2: u32 = 2;

/// Candidates in all leaves behind which no node is split any more, so that a tree stays within some megabytes.
const MANY: usize = 1 << 17;

/// Set in links to leaves. Then come 8 bits for one less than the candidates there are, and 23 for the first.
const LEAF: u32 = 1 << 31;

/// Index of the word with the smallest squared distance from `v`, the lowest of equals. 0 if there is no word; words
/// behind the 256th do not count.
#[must_use]
pub fn nearest_plain(book: &[Vector], v: Vector) -> u8 {
    let distances = book.iter().take(MAX_BOOK).map(|&word| squared_distance(word, v));
    // The first of equal ones is the smallest.
    distances.enumerate().min_by_key(|&(_, d)| d).map_or(0, |(index, _)| index as u8)
}

/// Finds what [`nearest_plain`] finds.
#[derive(Clone, Debug)]
pub struct Nearest {
    book: Vec<Vector>,
    search: Search,
}

#[derive(Clone, Debug)]
enum Search {
    /// Words that differ in component 0 alone.
    Line(Line),
    Tree(Tree),
    /// Words too far apart for a tree.
    Plain,
}

impl Nearest {
    /// Prepares a search among the first 256 words of `book`.
    #[must_use]
    pub fn new(book: &[Vector]) -> Nearest {
        let book = book[..book.len().min(MAX_BOOK)].to_vec();
        let line = book.iter().all(|w| w[1..] == book[0][1..]);
        let search =
            if line { Search::Line(Line::new(&book)) } else { Tree::new(&book).map_or(Search::Plain, Search::Tree) };
        Nearest { book, search }
    }

    /// Index of the word nearest to `v`, the lowest of equals; 0 if the book is empty.
    #[inline]
    #[must_use]
    pub fn find(&self, v: Vector) -> u8 {
        match &self.search {
            Search::Line(line) => line.find(v[0]),
            Search::Tree(tree) => tree.find(v).unwrap_or_else(|| nearest_plain(&self.book, v)),
            Search::Plain => nearest_plain(&self.book, v),
        }
    }
}

/// Words on a line, ascending. What the other components add to a distance is the same for all of them.
#[derive(Clone, Debug)]
struct Line {
    /// Last value of each word but the last one.
    last: Vec<i32>,
    index: Vec<u8>,
}

impl Line {
    fn new(book: &[Vector]) -> Line {
        let mut words: Vec<(i32, u8)> = book.iter().enumerate().map(|(i, w)| (w[0], i as u8)).collect();
        words.sort_unstable();
        // Of equal words the first has the lowest index.
        words.dedup_by_key(|w| w.0);
        let last = words.windows(2).map(|pair| {
            let [(a, i), (b, j)] = [pair[0], pair[1]];
            let sum = i64::from(a) + i64::from(b);
            let tie = sum.rem_euclid(2) == 0;
            (sum.div_euclid(2) - i64::from(tie && j < i)) as i32
        });
        Line { last: last.collect(), index: words.iter().map(|w| w.1).collect() }
    }

    #[inline]
    fn find(&self, v: i32) -> u8 {
        self.index.get(self.last.partition_point(|&last| last < v)).copied().unwrap_or(0)
    }
}

/// An octree over a cube around the words. A leaf lists the only words that can be nearest to a point in it, so that a
/// search never goes back up.
#[derive(Clone, Debug)]
struct Tree {
    corner: Vector,
    side_log2: u32,
    root: u32,
    nodes: Vec<[u32; 8]>,
    /// Words and their indices, ascending in each leaf.
    candidates: Vec<(Vector, u32)>,
}

/// A cube of points; both ends are inside.
#[derive(Clone, Copy)]
struct Cube {
    low: [i64; 3],
    side_log2: u32,
}

impl Tree {
    /// `None` if its cube would not fit the numbers.
    fn new(book: &[Vector]) -> Option<Tree> {
        let ends = |c: usize| {
            let values = book.iter().map(move |w| i64::from(w[c]));
            (values.clone().min().unwrap_or(0), values.max().unwrap_or(0))
        };
        let ends = [ends(0), ends(1), ends(2)];
        let longest = ends.map(|(low, high)| high - low).into_iter().max().unwrap_or(0) as u64;
        // What is looked up lies around the words as well: twice their extent, and at least twice that of a byte.
        let side_log2 = (2 * longest + 1).next_power_of_two().trailing_zeros().max(9);
        let low = ends.map(|(low, high)| (low + high).div_euclid(2) - (1 << (side_log2 - 1)));
        let fits = |c: i64| i32::try_from(c).is_ok() && i32::try_from(c + (1 << side_log2) - 1).is_ok();
        if side_log2 > 30 || !low.into_iter().all(fits) {
            return None;
        }
        let corner = low.map(|c| c as i32);
        let mut tree = Tree { corner, side_log2, root: LEAF, nodes: Vec::new(), candidates: Vec::new() };
        let words: Vec<(Vector, u32)> = book.iter().copied().zip(0..).collect();
        tree.root = tree.build(Cube { low, side_log2 }, words);
        Some(tree)
    }

    /// Adds the part of the tree for a cube, whose words are among `words`, and returns the link to it.
    fn build(&mut self, cube: Cube, words: Vec<(Vector, u32)>) -> u32 {
        let words = cube.contenders(words);
        if words.len() <= FEW || cube.side_log2 <= SMALLEST_LOG2 || self.candidates.len() >= MANY {
            let link = LEAF | (words.len() as u32 - 1) << 23 | self.candidates.len() as u32;
            self.candidates.extend(words);
            return link;
        }
        let node = self.nodes.len();
        self.nodes.push([0; 8]);
        for child in 0..8 {
            let link = self.build(cube.child(child), words.clone());
            self.nodes[node][child] = link;
        }
        node as u32
    }

    #[inline]
    fn find(&self, v: Vector) -> Option<u8> {
        let at: [u32; 3] = std::array::from_fn(|c| v[c].wrapping_sub(self.corner[c]) as u32);
        if (at[0] | at[1] | at[2]) >> self.side_log2 != 0 {
            return None;
        }
        let (mut link, mut bit) = (self.root, self.side_log2);
        while link & LEAF == 0 {
            bit -= 1;
            let child = (at[0] >> bit & 1) | (at[1] >> bit & 1) << 1 | (at[2] >> bit & 1) << 2;
            link = self.nodes[link as usize][child as usize];
        }
        let (from, more) = ((link & 0x7F_FFFF) as usize, (link >> 23 & 0xFF) as usize);
        let leaf = self.candidates.get(from..=from + more)?;
        let (mut best, mut index) = (u64::MAX, 0);
        for &(word, i) in leaf {
            let d = squared_distance(word, v);
            index = if d < best { i } else { index };
            best = best.min(d);
        }
        Some(index as u8)
    }
}

impl Cube {
    fn child(self, which: usize) -> Cube {
        let side_log2 = self.side_log2 - 1;
        Cube { low: std::array::from_fn(|c| self.low[c] + ((which as i64 >> c & 1) << side_log2)), side_log2 }
    }

    /// The words that are found for some point of the cube, and maybe a few more.
    ///
    /// A word is out if another one, the one nearest to the centre or to a corner, is found rather than it everywhere.
    fn contenders(self, mut words: Vec<(Vector, u32)>) -> Vec<(Vector, u32)> {
        let last = (1 << self.side_log2) - 1;
        let half = last / 2;
        let places = std::iter::once([half; 3]).chain((0..8).map(|k| std::array::from_fn(|c| (k >> c & 1) * last)));
        for place in places {
            let point: [i64; 3] = std::array::from_fn(|c| self.low[c] + place[c]);
            let apart = |w: &Vector| (0..3).map(|c| (i64::from(w[c]) - point[c]).pow(2)).sum::<i64>();
            let Some(&winner) = words.iter().min_by_key(|(w, _)| apart(w)) else { return words };
            words.retain(|word| word.1 == winner.1 || !self.beats(winner, *word));
        }
        words
    }

    /// Whether `winner` is found rather than `word` at every point of the cube.
    fn beats(self, winner: (Vector, u32), word: (Vector, u32)) -> bool {
        // |p − winner|² − |p − word|² is linear in p, so it is largest in a corner.
        let last = (1i64 << self.side_log2) - 1;
        let most: i128 = (0..3)
            .map(|c| {
                let (a, b) = (i128::from(winner.0[c]), i128::from(word.0[c]));
                let p = i128::from(if b > a { self.low[c] + last } else { self.low[c] });
                a * a - b * b + 2 * p * (b - a)
            })
            .sum();
        most < 0 || (most == 0 && winner.1 < word.1)
    }
}
