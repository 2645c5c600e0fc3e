//! The nearest word of a book, exactly: brute force, and a search that gives the same faster.

use super::{MAX_BOOK, Vector, squared_distance};

/// Candidates that a leaf may hold without being split.
const FEW: usize = 8;

/// Side of the smallest node, as a power of two. Nodes on a point where many words are equally near stay large else.
const SMALLEST_LOG2: u32 = 2;

/// Levels that a search takes in one step.
const TOP_LOG2: u32 = 3;

/// Candidates in all leaves behind which no node is split any more, so that a tree stays within some megabytes.
const MANY: usize = 1 << 17;

/// Sides of cubes in which squared distances fit 32 bits, as a power of two.
const NARROW_LOG2: u32 = 14;

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
    /// Links for the cubes [`TOP_LOG2`] levels down, x fastest.
    top: Vec<u32>,
    nodes: Vec<[u32; 8]>,
    /// Indices of words, ascending in each leaf. The words apart: there are few, and they stay in the cache.
    candidates: Vec<u8>,
    words: Vec<Vector>,
}

/// A cube of points; both ends are inside.
#[derive(Clone, Copy)]
struct Cube {
    low: [i64; 3],
    side_log2: u32,
}

/// A word, its index and the sum of its squares.
#[derive(Clone, Copy)]
struct Word {
    at: [i64; 3],
    index: u32,
    square: i64,
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
        if side_log2 > 27 || low.iter().any(|c| c.abs() > 1 << 28) {
            return None;
        }
        let word = |(index, w): (u32, &Vector)| {
            let at = w.map(i64::from);
            Word { at, index, square: at.iter().map(|c| c * c).sum() }
        };
        let words: Vec<Word> = (0..).zip(book).map(word).collect();
        let corner = low.map(|c| c as i32);
        let mut tree = Tree {
            corner,
            side_log2,
            top: Vec::new(),
            nodes: Vec::new(),
            candidates: Vec::new(),
            words: book.to_vec(),
        };
        let root = tree.build(Cube { low, side_log2 }, &words);
        let bits = |n: u32| [n, n >> TOP_LOG2, n >> (2 * TOP_LOG2)].map(|v| v & ((1 << TOP_LOG2) - 1));
        tree.top = (0..1 << (3 * TOP_LOG2)).map(|n| tree.descend(root, TOP_LOG2, bits(n), TOP_LOG2)).collect();
        Some(tree)
    }

    /// Adds the part of the tree for a cube, whose words are among `words`, and returns the link to it.
    fn build(&mut self, cube: Cube, words: &[Word]) -> u32 {
        let words = cube.contenders(words);
        if words.len() <= FEW || cube.side_log2 <= SMALLEST_LOG2 || self.candidates.len() >= MANY {
            let link = LEAF | (words.len() as u32 - 1) << 23 | self.candidates.len() as u32;
            self.candidates.extend(words.iter().map(|w| w.index as u8));
            return link;
        }
        let node = self.nodes.len();
        self.nodes.push([0; 8]);
        for child in 0..8 {
            let link = self.build(cube.child(child), &words);
            self.nodes[node][child] = link;
        }
        node as u32
    }

    /// Follows at most `levels` links towards a point, whose places have `bits` bits.
    #[inline(always)]
    fn descend(&self, mut link: u32, mut bits: u32, at: [u32; 3], levels: u32) -> u32 {
        let end = bits - levels;
        while link & LEAF == 0 && bits > end {
            bits -= 1;
            let child = (at[0] >> bits & 1) | (at[1] >> bits & 1) << 1 | (at[2] >> bits & 1) << 2;
            link = self.nodes[link as usize][child as usize];
        }
        link
    }

    #[inline]
    fn find(&self, v: Vector) -> Option<u8> {
        let at: [u32; 3] = std::array::from_fn(|c| v[c].wrapping_sub(self.corner[c]) as u32);
        if (at[0] | at[1] | at[2]) >> self.side_log2 != 0 {
            return None;
        }
        let bits = self.side_log2 - TOP_LOG2;
        let top = at[0] >> bits | at[1] >> bits << TOP_LOG2 | at[2] >> bits << (2 * TOP_LOG2);
        let link = self.descend(self.top[top as usize], bits, at, bits);
        let (from, more) = ((link & 0x7F_FFFF) as usize, (link >> 23 & 0xFF) as usize);
        let leaf = self.candidates.get(from..=from + more)?;
        Some(if self.side_log2 <= NARROW_LOG2 {
            self.nearest_of(leaf, |word| {
                let d: Vector = std::array::from_fn(|c| word[c] - v[c]);
                (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) as u32
            })
        } else {
            self.nearest_of(leaf, |word| squared_distance(word, v))
        })
    }

    /// The first candidate that is no further away than any other.
    #[inline(always)]
    fn nearest_of<D: Ord + Copy>(&self, leaf: &[u8], distance: impl Fn(Vector) -> D) -> u8 {
        let mut best = (distance(self.words[usize::from(leaf[0])]), leaf[0]);
        for &i in &leaf[1..] {
            let d = distance(self.words[usize::from(i)]);
            best = if d < best.0 { (d, i) } else { best };
        }
        best.1
    }
}

impl Cube {
    fn child(self, which: usize) -> Cube {
        let side_log2 = self.side_log2 - 1;
        Cube { low: std::array::from_fn(|c| self.low[c] + ((which as i64 >> c & 1) << side_log2)), side_log2 }
    }

    /// The words that are found for some point of the cube, and maybe more.
    ///
    /// A word is out if another one, the one nearest to the centre or to a corner, is found rather than it everywhere.
    fn contenders(self, words: &[Word]) -> Vec<Word> {
        let last = (1 << self.side_log2) - 1;
        let winner = |words: &[Word], place: [i64; 3]| {
            let point: [i64; 3] = std::array::from_fn(|c| self.low[c] + place[c]);
            // |p − w|² but for |p|², which is the same for all.
            let apart = |w: &Word| w.square - 2 * (0..3).map(|c| point[c] * w.at[c]).sum::<i64>();
            words.iter().copied().min_by_key(apart)
        };
        let Some(first) = winner(words, [last / 2; 3]) else { return Vec::new() };
        let stays = |winner: &Word, word: &Word| word.index == winner.index || !self.beats(winner, word);
        let mut left: Vec<Word> = words.iter().copied().filter(|w| stays(&first, w)).collect();
        for k in 0..8 {
            if left.len() <= FEW {
                break;
            }
            if let Some(winner) = winner(&left, std::array::from_fn(|c| (k >> c & 1) * last)) {
                left.retain(|w| stays(&winner, w));
            }
        }
        left
    }

    /// Whether `winner` is found rather than `word` at every point of the cube.
    #[inline]
    fn beats(self, winner: &Word, word: &Word) -> bool {
        // |p − winner|² − |p − word|² is linear in p, so it is largest in a corner.
        let last = (1 << self.side_log2) - 1;
        let most = |c: usize| {
            let apart = word.at[c] - winner.at[c];
            2 * apart * (self.low[c] + if apart > 0 { last } else { 0 })
        };
        let most = winner.square - word.square + most(0) + most(1) + most(2);
        most < 0 || (most == 0 && winner.index < word.index)
    }
}
