//! Fast decoding of whole cells: rows of voxels in lanes, and only what is stored costs anything. Its judge is `decode`.
//!
//! A detail with letters (hx, hy, hz) is added to one of four sums, by (hy, hz), its sign along x spread over the lanes of a
//! row; the sums of both levels are then combined along y and z. Cells whose level-1 nodes are all null have four distinct
//! rows, not sixteen.

use super::bits;
use super::book::ranges;
use super::layout::{Cell, OldCell, byte, bytes};
use super::tables::{Tables, unpack};
use crate::voxel::SampleType;
use std::ops::{Add, Neg, Sub};

/// A number that a lane holds: wide enough for an average and fourteen details.
trait Lane: Copy + Default + Add<Output = Self> + Sub<Output = Self> + Neg<Output = Self> {}
impl Lane for i16 {}
impl Lane for i32 {}

/// Bytes of a packed row at most: four voxels, and room to write whole vectors.
pub(super) const ROW: usize = 16;

/// Decodes cells of one sample type to rows of bytes.
pub(super) trait Kernel {
    /// Hands rows (y, z) of a cell, by their numbers y + 4z, to `put`, as the bytes of four samples; what lies behind them
    /// does not matter. Rows that are not in the mask `rows` may be left out.
    fn rows(&self, cell: &Coded<'_>, rows: u16, put: impl FnMut(usize, [u8; ROW]));
}

/// Colours without special instructions.
#[derive(Clone, Copy)]
pub(super) struct PortableColour<'a>(pub(super) &'a Tables);

impl Kernel for PortableColour<'_> {
    #[inline(always)]
    fn rows(&self, cell: &Coded<'_>, rows: u16, put: impl FnMut(usize, [u8; ROW])) {
        let pack = |row: &[i16; 16]| {
            let mut out = [0; ROW];
            for (to, from) in out.chunks_exact_mut(3).zip(row.chunks_exact(4)) {
                for (to, &v) in to.iter_mut().zip(from) {
                    *to = v.clamp(0, 255) as u8;
                }
            }
            out
        };
        decode::<i16, _, 4, 16>(cell, &Colour(self.0), nodes_of(rows)).each_row(pack, put);
    }
}

/// Scalars of a type.
#[derive(Clone, Copy)]
pub(super) struct PortableGrey<'a>(pub(super) &'a Tables, pub(super) SampleType);

impl Kernel for PortableGrey<'_> {
    #[inline(always)]
    fn rows(&self, cell: &Coded<'_>, rows: u16, put: impl FnMut(usize, [u8; ROW])) {
        let [lo, hi] = ranges(self.1).0;
        let pack = |row: &[i32; 4]| {
            let mut out = [0; ROW];
            let clamped = row.map(|v| v.clamp(lo, hi));
            if self.1 == SampleType::U8 {
                out[..4].copy_from_slice(&clamped.map(|v| v as u8));
            } else {
                for (to, v) in out.chunks_exact_mut(2).zip(clamped) {
                    to.copy_from_slice(&(v as u16).to_ne_bytes());
                }
            }
            out
        };
        decode::<i32, _, 1, 4>(cell, &Grey(self.0), nodes_of(rows)).each_row(pack, put);
    }
}

/// The level-1 nodes of which a row is wanted, node 1 in the highest bit.
#[inline(always)]
fn nodes_of(rows: u16) -> u8 {
    (0..4).filter(|q| rows >> ((q & 1) * 2 + (q >> 1) * 8) & 0b11_0011 != 0).fold(0, |all, q| all | 0xC0 >> (2 * q))
}

/// Lanes of a codebook: `L` per voxel.
trait Words<T: Lane, const L: usize> {
    fn average(&self, index: u8) -> [T; L];
    fn detail(&self, index: u8) -> [T; L];
}

/// Colours: 4 lanes of 16 bits, the last one unused.
struct Colour<'a>(&'a Tables);

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
struct Grey<'a>(&'a Tables);

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
    pub(super) payload: &'a [u8],
    pub(super) average: Option<u8>,
    /// The map of the level-0 node, 0 where it is null.
    pub(super) level_0: u8,
    /// Level-1 nodes that have a map, node 1 in the highest bit.
    pub(super) nodes: u8,
    pub(super) maps: Maps,
    /// Where the first index of a detail lies.
    pub(super) details: usize,
}

/// Maps of level-1 nodes.
#[derive(Clone, Copy)]
pub(super) enum Maps {
    /// Those of the nodes that have one, one after the other from here on.
    Stored(usize),
    /// Flags of all positions.
    Flags(u64),
}

impl Maps {
    /// The map of node `i`, the next one that has a map.
    #[inline(always)]
    pub(super) fn next(&mut self, payload: &[u8], i: u32) -> u8 {
        match self {
            Maps::Stored(at) => {
                *at += 1;
                bits::details(byte(payload, *at - 1))
            }
            Maps::Flags(flags) => old_map(*flags, i),
        }
    }
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
type Rows<T, const R: usize> = [[T; R]; 16];

/// What a cell consists of.
enum Decoded<T, const R: usize> {
    /// All rows.
    Rows(Rows<T, R>),
    /// The level-1 nodes are null: rows (y, z) are those at (y / 2) + 2 (z / 2).
    Quarters([[T; R]; 4]),
}

impl<T, const R: usize> Decoded<T, R> {
    #[inline(always)]
    fn each_row(&self, pack: impl Fn(&[T; R]) -> [u8; ROW], mut put: impl FnMut(usize, [u8; ROW])) {
        match self {
            Decoded::Rows(rows) => rows.iter().enumerate().for_each(|(i, row)| put(i, pack(row))),
            Decoded::Quarters(quarters) => {
                for (q, quarter) in quarters.iter().enumerate() {
                    let packed = pack(quarter);
                    [0, 1, 4, 5].into_iter().for_each(|row| put((q & 1) * 2 + (q >> 1) * 8 + row, packed));
                }
            }
        }
    }
}

/// Decodes a cell; details of level-1 nodes that are not among `wanted` (node 1 in the highest bit) are left out. `R` must
/// be 4 · `L`.
#[inline(always)]
fn decode<T: Lane, W: Words<T, L>, const L: usize, const R: usize>(
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
    let mut maps = cell.maps;
    while nodes != 0 {
        let i = nodes.leading_zeros() + 1;
        nodes ^= bits::node_bit(i);
        let map = maps.next(cell.payload, i);
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
