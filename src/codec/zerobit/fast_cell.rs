//! Fast decoding of whole cells: rows of voxels in lanes, and only what is stored costs anything. Its judge is `decode`.
//!
//! A detail with letters (hx, hy, hz) is added to one of four sums, by (hy, hz), its sign along x spread over the lanes of a
//! row; the sums of both levels are then combined along y and z. Cells whose level-1 nodes are all null have four distinct
//! rows, not sixteen.

use super::bits;
use super::layout::{Cell, OldCell, byte, bytes};
use super::tables::{Tables, unpack};
use std::ops::{Add, Neg, Sub};

/// A number that a lane holds: wide enough for an average and fourteen details.
pub(super) trait Lane: Copy + Default + Add<Output = Self> + Sub<Output = Self> + Neg<Output = Self> {
    /// A component of a word, which fits.
    fn from_i32(v: i32) -> Self;
}
impl Lane for i16 {
    #[inline(always)]
    fn from_i32(v: i32) -> Self {
        v as i16
    }
}
impl Lane for i32 {
    #[inline(always)]
    fn from_i32(v: i32) -> Self {
        v
    }
}

/// Lanes of a codebook: `L` per voxel.
pub(super) trait Words<T: Lane, const L: usize> {
    fn average(&self, index: u8) -> [T; L];
    fn detail(&self, index: u8) -> [T; L];
}

/// Colours: 4 lanes of 16 bits, the last one unused.
pub(super) struct Colour<'a>(pub(super) &'a Tables);

impl Words<i16, 4> for Colour<'_> {
    #[inline(always)]
    fn average(&self, index: u8) -> [i16; 4] {
        self.0.average_lanes[usize::from(index)]
    }
    #[inline(always)]
    fn detail(&self, index: u8) -> [i16; 4] {
        self.0.detail_lanes[usize::from(index)]
    }
}

/// Scalars: one lane of 32 bits.
pub(super) struct Grey<'a>(pub(super) &'a Tables);

impl Words<i32, 1> for Grey<'_> {
    #[inline(always)]
    fn average(&self, index: u8) -> [i32; 1] {
        [unpack(self.0.average[usize::from(index)])[0]]
    }
    #[inline(always)]
    fn detail(&self, index: u8) -> [i32; 1] {
        [unpack(self.0.detail[usize::from(index)])[0]]
    }
}

/// A stored cell of either stream as nine maps in the order of the new one, and its indices.
pub(super) struct Coded<'a> {
    payload: &'a [u8],
    average: Option<u8>,
    level_0: u8,
    /// Level-1 nodes that have a map, node 1 in the highest bit.
    nodes: u8,
    maps: Maps,
    /// Where the first index of a detail lies.
    details: usize,
}

#[derive(Clone, Copy)]
enum Maps {
    /// Those of the nodes that have one, one after the other from here on.
    Stored(usize),
    /// Flags of all positions.
    Flags(u64),
}

impl<'a> Coded<'a> {
    #[inline(always)]
    pub(super) fn new(cell: &Cell<'a>) -> Self {
        let z = &cell.zerobits;
        let level_0 = if z.level_0 { bits::details(byte(cell.payload, z.maps)) } else { 0 };
        let maps = Maps::Stored(z.maps + usize::from(z.level_0));
        let (payload, average, details) = (cell.payload, Some(cell.average), cell.details);
        Coded { payload, average, level_0, nodes: z.level_1, maps, details }
    }

    #[inline(always)]
    pub(super) fn old(cell: &OldCell<'a>) -> Self {
        let has_average = cell.flags & 1 == 1;
        let average = has_average.then(|| byte(cell.payload, cell.indices));
        let nodes = (1..=8).filter(|i| cell.flags >> (7 * i + 1) & 0x7F != 0).fold(0, |all, i| all | bits::node_bit(i));
        Coded {
            payload: cell.payload,
            average,
            level_0: old_map(cell.flags, 0),
            nodes,
            maps: Maps::Flags(cell.flags),
            details: cell.indices + usize::from(has_average),
        }
    }
}

/// The map of node `i` from the flags of the old stream.
#[inline(always)]
fn old_map(flags: u64, i: u32) -> u8 {
    ((flags >> (7 * i + 1)) as u8).reverse_bits() >> 1 & 0x7F
}

/// Rows (y, z) of a cell at y + 4z: voxels of `L` lanes along x. `R` is 4 · `L`.
pub(super) type Rows<T, const R: usize> = [[T; R]; 16];

/// What a cell consists of.
pub(super) enum Decoded<T, const R: usize> {
    /// All rows.
    Rows(Rows<T, R>),
    /// The level-1 nodes are null: rows (y, z) are those at (y / 2) + 2 (z / 2).
    Quarters([[T; R]; 4]),
}

/// All level-1 nodes.
pub(super) const ALL_NODES: u8 = 0xFF;

/// Decodes a cell; details of level-1 nodes that are not among `wanted` (node 1 in the highest bit) are left out. `R` must
/// be 4 · `L`.
#[inline(always)]
pub(super) fn decode<T: Lane, W: Words<T, L>, const L: usize, const R: usize>(
    cell: &Coded<'_>,
    words: &W,
    wanted: u8,
) -> Decoded<T, R> {
    let average = cell.average.map_or([T::default(); L], |index| words.average(index));
    let mut quarters = [[T::default(); R]; 4];
    let mut at = cell.details;
    if cell.level_0 == 0 {
        quarters = [std::array::from_fn(|lane| average[lane % L]); 4];
    } else {
        // Sums by letters (hy, hz), then combined.
        let mut sums = [[T::default(); R]; 4];
        sums[0] = std::array::from_fn(|lane| average[lane % L]);
        each_detail(cell.payload, cell.level_0, at, |j, index| {
            let word = words.detail(index);
            let sum = &mut sums[j as usize & 3];
            let high = j & 4 != 0;
            for (lane, s) in sum.iter_mut().enumerate() {
                let w = word[lane % L];
                *s = *s + if high && lane >= R / 2 { -w } else { w };
            }
        });
        at += cell.level_0.count_ones() as usize;
        for lane in 0..R {
            let [none, z, y, yz] = sums.map(|sum| sum[lane]);
            let (low, high) = (none + z, none - z);
            let (low_y, high_y) = (y + yz, y - yz);
            quarters[0][lane] = low + low_y;
            quarters[1][lane] = low - low_y;
            quarters[2][lane] = high + high_y;
            quarters[3][lane] = high - high_y;
        }
    }
    if cell.nodes & wanted == 0 {
        return Decoded::Quarters(quarters);
    }
    let mut rows = [[T::default(); R]; 16];
    for (i, row) in rows.iter_mut().enumerate() {
        *row = quarters[i >> 1 & 1 | i >> 3 << 1];
    }
    let mut nodes = cell.nodes;
    let mut stored = 0;
    while nodes != 0 {
        let i = nodes.leading_zeros() + 1;
        nodes ^= bits::node_bit(i);
        let map = match cell.maps {
            Maps::Stored(first) => {
                stored += 1;
                bits::details(byte(cell.payload, first + stored - 1))
            }
            Maps::Flags(flags) => old_map(flags, i),
        };
        if wanted & bits::node_bit(i) != 0 {
            add_node::<T, W, L, R>(cell.payload, map, at, i - 1, words, &mut rows);
        }
        at += map.count_ones() as usize;
    }
    Decoded::Rows(rows)
}

/// Adds the details of level-1 node `i` (0 to 7) to its eight voxels.
#[inline(always)]
fn add_node<T: Lane, W: Words<T, L>, const L: usize, const R: usize>(
    payload: &[u8],
    map: u8,
    at: usize,
    i: u32,
    words: &W,
    rows: &mut Rows<T, R>,
) {
    let x = (i & 1) as usize * 2 * L;
    let first = (i & 2 | (i & 4) << 1) as usize;
    // Two voxels of `L` lanes; the upper half of a row's length is not used.
    let mut sums = [[T::default(); R]; 4];
    each_detail(payload, map, at, |j, index| {
        let word = words.detail(index);
        let sum = &mut sums[j as usize & 3];
        let high = j & 4 != 0;
        for lane in 0..2 * L {
            let w = word[lane % L];
            sum[lane] = sum[lane] + if high && lane >= L { -w } else { w };
        }
    });
    for lane in 0..2 * L {
        let [none, z, y, yz] = sums.map(|sum| sum[lane]);
        let (low, high) = (none + z, none - z);
        let (low_y, high_y) = (y + yz, y - yz);
        let add = |row: &mut [T; R], v: T| row[x + lane] = row[x + lane] + v;
        add(&mut rows[first], low + low_y);
        add(&mut rows[first + 1], low - low_y);
        add(&mut rows[first + 4], high + high_y);
        add(&mut rows[first + 5], high - high_y);
    }
}

/// Visits the details of a map in order, with their indices.
#[inline(always)]
fn each_detail(payload: &[u8], map: u8, at: usize, mut visit: impl FnMut(u32, u8)) {
    let mut indices = u64::from_le_bytes(bytes(payload, at)); // at most seven
    let mut rest = map;
    while rest != 0 {
        let j = rest.leading_zeros();
        visit(j, (indices & 0xFF) as u8);
        indices >>= 8;
        rest ^= bits::detail_bit(j);
    }
}
