//! The plain decoder: coefficient by coefficient, as in §3.3 of the paper (spec chapter 14, §6 to §9). It defines the result.

use super::bits::{self, BitCount};
use super::book::{Book, Word, ranges};
use super::inverse::{self, Group};
use super::layout::{CELL_EDGE, Cell, Layout, OldCell, Unit, byte, unit};
use super::tally::{Case, Tally};
use super::value_of;
use crate::codec::BrickPart;
use crate::geometry::{Extent, Region};
use crate::grid::ViewMut;
use crate::voxel::{Sample, SampleType};

/// A stored cell: average and 63 details, each null or an index.
pub trait Coefficients {
    /// Index of the average, `None` where it is null.
    fn average(&self, tally: &mut impl Tally) -> Option<u8>;
    /// Index of detail `j` (1 to 7) of node `i` (0: level 0; 1 to 8: level 1), `None` where it is null.
    fn detail(&self, i: u32, j: u32, count: impl BitCount, tally: &mut impl Tally) -> Option<u8>;
    /// Whether node `i` is known to have no details without decoding them.
    fn is_null(&self, i: u32) -> bool;
    /// Whether none of the seven details of node `i` is stored, where that is seen at once.
    fn has_none(&self, i: u32) -> bool {
        self.is_null(i)
    }
}

impl Coefficients for Cell<'_> {
    fn average(&self, tally: &mut impl Tally) -> Option<u8> {
        tally.case(Case::Average);
        Some(self.average)
    }

    fn detail(&self, i: u32, j: u32, count: impl BitCount, tally: &mut impl Tally) -> Option<u8> {
        if self.is_null(i) {
            tally.case(Case::NullNode);
            return None;
        }
        // spec: ZBT-17, ZBT-20
        let z = &self.zerobits;
        let before =
            if i == 0 { 0 } else { u32::from(z.level_0) + count.count(u64::from(bits::nodes_before(z.level_1, i))) };
        let map = byte(self.payload, z.maps + before as usize);
        if !bits::has_detail(map, j) {
            tally.case(Case::NullDetail);
            return None;
        }
        tally.case(Case::Detail);
        // spec: ZBT-21
        let earlier: u32 =
            (0..before).map(|k| count.count(u64::from(bits::details(byte(self.payload, z.maps + k as usize))))).sum();
        let displacement = earlier + count.count(u64::from(bits::details_before(map, j)));
        Some(byte(self.payload, self.details + displacement as usize))
    }

    fn is_null(&self, i: u32) -> bool {
        if i == 0 { !self.zerobits.level_0 } else { !bits::has_node(self.zerobits.level_1, i) }
    }
}

impl Coefficients for OldCell<'_> {
    fn average(&self, tally: &mut impl Tally) -> Option<u8> {
        tally.case(Case::Average);
        (self.flags & 1 == 1).then(|| byte(self.payload, self.indices))
    }

    // spec: ZBT-31
    fn detail(&self, i: u32, j: u32, count: impl BitCount, tally: &mut impl Tally) -> Option<u8> {
        let p = 7 * i + j;
        if self.flags >> p & 1 == 0 {
            tally.case(Case::NullDetail);
            return None;
        }
        tally.case(Case::Detail);
        let displacement = count.count(self.flags & ((1 << p) - 1));
        Some(byte(self.payload, self.indices + displacement as usize))
    }

    fn is_null(&self, _: u32) -> bool {
        false // the old stream cannot tell without looking at seven flags
    }

    fn has_none(&self, i: u32) -> bool {
        // The seven at once: a machine with words of 64 bits can.
        self.flags >> (7 * i + 1) & 0x7F == 0
    }
}

/// What the plain decoder needs besides a cell.
#[derive(Clone, Copy, Debug)]
pub struct Context<'a, C> {
    /// What the indices stand for.
    pub book: &'a Book,
    /// Type of the samples: their range is that of the results.
    pub sample_type: SampleType,
    /// How bits are counted.
    pub count: C,
}

impl<C: BitCount> Context<'_, C> {
    /// One voxel of a cell, at (x, y, z) in 0..4 each: 15 decodes, 14 vector operations where no node is null.
    pub fn voxel(&self, cell: &impl Coefficients, at: [u32; 3], tally: &mut impl Tally) -> Word {
        let average = self.average(cell, tally);
        let node = at.map(|v| v >> 1);
        let mean = self.node(cell, 0, average, tally, |group, t| inverse::one(group, node, t), |mean| mean);
        let sub = at.map(|v| v & 1);
        let i = 1 + node_number(node);
        clamp(self.node(cell, i, mean, tally, |group, t| inverse::one(group, sub, t), |mean| mean), self.sample_type)
    }

    /// The 16 voxels whose coordinate along `axis` (0 x, 1 y, 2 z) is `at`, the lower of the other axes fastest: 36
    /// decodes; 100, 80, 60 vector operations where no node is null.
    pub fn plane(&self, cell: &impl Coefficients, axis: usize, at: u32, tally: &mut impl Tally) -> [Word; 16] {
        let means = self.plane_of_means(cell, axis, at >> 1, tally);
        let [u, v] = other_axes(axis);
        let mut out = [Word::default(); 16];
        for (k, &mean) in (0u32..).zip(&means) {
            let mut node = [0; 3];
            (node[axis], node[u], node[v]) = (at >> 1, k & 1, k >> 1);
            let i = 1 + node_number(node);
            let four = self.node(cell, i, mean, tally, |g, t| inverse::half(g, axis, at & 1, t), |mean| [mean; 4]);
            for (m, value) in (0u32..).zip(four) {
                let (a, b) = (2 * (k & 1) + (m & 1), 2 * (k >> 1) + (m >> 1));
                out[(a + 4 * b) as usize] = clamp(value, self.sample_type);
            }
        }
        out
    }

    /// All 64 voxels, x fastest: 64 decodes, 216 vector operations where no node is null.
    pub fn cell(&self, cell: &impl Coefficients, tally: &mut impl Tally) -> [Word; 64] {
        let means = self.all_means(cell, tally);
        let mut out = [Word::default(); 64];
        for (k, &mean) in (0u32..).zip(&means) {
            let eight = self.node(cell, 1 + k, mean, tally, inverse::all, |mean| [mean; 8]);
            for (m, value) in (0u32..).zip(eight) {
                let [x, y, z] = [0, 1, 2].map(|a| 2 * (k >> a & 1) + (m >> a & 1));
                out[(x + 4 * y + 16 * z) as usize] = clamp(value, self.sample_type);
            }
        }
        out
    }

    /// One voxel of the cell at half resolution, at (x, y, z) in 0..2 each: 8 decodes, 7 vector operations at most.
    // spec: ZBT-25
    pub fn mean(&self, cell: &impl Coefficients, at: [u32; 3], tally: &mut impl Tally) -> Word {
        let average = self.average(cell, tally);
        let mean = self.node(cell, 0, average, tally, |group, t| inverse::one(group, at, t), |mean| mean);
        clamp(mean, self.sample_type)
    }

    /// The cell at half resolution: the means of its eight 2³ groups, x fastest. 8 decodes, 24 vector operations at most.
    pub fn means(&self, cell: &impl Coefficients, tally: &mut impl Tally) -> [Word; 8] {
        self.all_means(cell, tally).map(|mean| clamp(mean, self.sample_type))
    }

    /// Four means of the plane `at` (0 or 1) across `axis`: 8 decodes; 20, 16, 12 vector operations at most.
    pub fn mean_plane(&self, cell: &impl Coefficients, axis: usize, at: u32, tally: &mut impl Tally) -> [Word; 4] {
        self.plane_of_means(cell, axis, at, tally).map(|mean| clamp(mean, self.sample_type))
    }

    /// The cell at quarter resolution: its average. 1 decode.
    pub fn mean_of_all(&self, cell: &impl Coefficients, tally: &mut impl Tally) -> Word {
        clamp(self.average(cell, tally), self.sample_type)
    }

    fn all_means(&self, cell: &impl Coefficients, tally: &mut impl Tally) -> [Word; 8] {
        let average = self.average(cell, tally);
        self.node(cell, 0, average, tally, inverse::all, |mean| [mean; 8])
    }

    fn plane_of_means(&self, cell: &impl Coefficients, axis: usize, at: u32, tally: &mut impl Tally) -> [Word; 4] {
        let average = self.average(cell, tally);
        self.node(cell, 0, average, tally, |group, t| inverse::half(group, axis, at, t), |mean| [mean; 4])
    }

    fn average(&self, cell: &impl Coefficients, tally: &mut impl Tally) -> Word {
        cell.average(tally).map_or(Word::default(), |index| self.book.average(index))
    }

    /// Decodes the seven details of node `i` and transforms them; a null node costs no arithmetic. // spec: ZBT-23
    fn node<R, T: Tally>(
        &self,
        cell: &impl Coefficients,
        i: u32,
        mean: Word,
        tally: &mut T,
        transform: impl FnOnce(&Group, &mut T) -> R,
        spread: impl FnOnce(Word) -> R,
    ) -> R {
        if !T::COUNTS && cell.has_none(i) {
            return spread(mean);
        }
        let mut group = [mean; 8];
        for (j, slot) in (0..).zip(&mut group).skip(1) {
            let index = cell.detail(i, j, self.count, tally);
            *slot = index.map_or(Word::default(), |index| self.book.detail(index));
        }
        if cell.is_null(i) { spread(mean) } else { transform(&group, tally) }
    }
}

/// Number of a level-1 node at (x, y, z), less 1. // spec: ZBT-13
fn node_number([x, y, z]: [u32; 3]) -> u32 {
    x + 2 * y + 4 * z
}

/// The axes other than `axis`, the lower one first.
pub(super) fn other_axes(axis: usize) -> [usize; 2] {
    match axis {
        0 => [1, 2],
        1 => [0, 2],
        _ => [0, 1],
    }
}

/// A result within the range of the samples. // spec: ZBT-24
pub(super) fn clamp(word: Word, t: SampleType) -> Word {
    let [lo, hi] = ranges(t).0;
    word.map(|v| v.clamp(lo, hi))
}

/// Writes the part of a brick that is wanted, cell by cell. `cell` gives the voxels of cell `n` of a unit block, or `None`
/// where it is null.
pub(super) fn region<T: Sample>(
    part: &BrickPart<'_>,
    dst: ViewMut<'_>,
    null: T,
    cell: impl Fn(&Unit<'_>, u32) -> Option<[Word; 64]>,
) {
    let layout = Layout::new(part.brick);
    let Region { start, end } = part.region;
    let cells = |a: usize| start[a] / CELL_EDGE..end[a].div_ceil(CELL_EDGE);
    for cz in cells(2) {
        for cy in cells(1) {
            for cx in cells(0) {
                let origin = [cx, cy, cz].map(|c| c * CELL_EDGE);
                let (index, n) = layout.locate(origin);
                let words = unit(part.payload, index).and_then(|unit| cell(&unit, n));
                let wanted = Region::at(origin, Extent::cube(CELL_EDGE)).intersect(&part.region);
                for z in wanted.start[2]..wanted.end[2] {
                    for y in wanted.start[1]..wanted.end[1] {
                        for x in wanted.start[0]..wanted.end[0] {
                            let at = x % CELL_EDGE + y % CELL_EDGE * 4 + z % CELL_EDGE * 16;
                            let value = words.map_or(null, |words| value_of(words[at as usize], T::TYPE).typed());
                            let to = (x - start[0]) as usize * size_of::<T>()
                                + (y - start[1]) as usize * dst.row_pitch
                                + (z - start[2]) as usize * dst.slice_pitch;
                            dst.bytes[to..to + size_of::<T>()].copy_from_slice(bytemuck::bytes_of(&value));
                        }
                    }
                }
            }
        }
    }
}
