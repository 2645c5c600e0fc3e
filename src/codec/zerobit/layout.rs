//! Where things lie in a zerobit payload: prefix, directory, unit blocks, cells (spec chapter 14, §4 to §7).
//!
//! Payloads may be hostile. Whatever the offsets in them say, a byte behind the end of the payload reads as 0, so that
//! every payload decodes to defined values; the strict validator is `check`.

use super::bits::{self, BitCount};
use super::params::Stream;
use crate::geometry::{Coord, Extent};

/// Bytes before the directory.
pub const PREFIX_BYTES: usize = 16;
/// Edge of a unit block in voxels.
pub const UNIT_EDGE: u32 = 16;
/// Edge of a cell in voxels.
pub const CELL_EDGE: u32 = 4;
/// Cells of a unit block.
pub const UNIT_CELLS: u32 = 64;
/// Bytes of a cell's record (CIA) in the new stream: offsets in 4, average index in 1.
pub(super) const NEW_RECORD: usize = 5;
/// Bytes of a cell's record in the old stream: flags in 8, offset in 2.
pub(super) const OLD_RECORD: usize = 10;

/// Reads the byte at `at`, 0 behind the end. // spec: ZBT-12
#[inline(always)]
pub(super) fn byte(payload: &[u8], at: usize) -> u8 {
    payload.get(at).copied().unwrap_or(0)
}

/// Reads `N` bytes at `at`, each 0 behind the end.
#[inline(always)]
pub(super) fn bytes<const N: usize>(payload: &[u8], at: usize) -> [u8; N] {
    match payload.get(at..at.saturating_add(N)) {
        Some(found) => found.try_into().expect("N bytes"),
        None => bytes_at_end(payload, at),
    }
}

#[cold]
#[inline(never)]
fn bytes_at_end<const N: usize>(payload: &[u8], at: usize) -> [u8; N] {
    std::array::from_fn(|i| byte(payload, at.saturating_add(i)))
}

/// Unit blocks of a brick, and the lengths its payload may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Voxels of the brick.
    pub brick: Extent,
    /// Unit blocks per axis.
    pub units: Extent,
}

impl Layout {
    /// The layout of a brick of this extent.
    #[must_use]
    pub const fn new(brick: Extent) -> Self {
        Layout { brick, units: brick.div_ceil(Extent::cube(UNIT_EDGE)) }
    }

    /// Length of the payload of a brick whose unit blocks are all void: prefix and directory.
    #[must_use]
    pub fn min_len(&self) -> u64 {
        PREFIX_BYTES as u64 + 4 * self.units.voxels()
    }

    /// Length that no payload exceeds. // spec: ZBT-8
    #[must_use]
    pub fn max_len(&self, stream: Stream) -> u64 {
        let unit = match stream {
            // CBFT, records, zerobits and nine maps, 63 details.
            Stream::New => 8 + 64 * (NEW_RECORD as u64 + 10 + 63),
            Stream::Old => 8 + 64 * (OLD_RECORD as u64 + 64),
        };
        PREFIX_BYTES as u64 + self.units.voxels().saturating_mul(4 + unit)
    }

    /// Number of the unit block that holds voxel `c` of the brick, and of the cell in it. // spec: ZBT-9, ZBT-13
    #[inline(always)]
    #[must_use]
    pub fn locate(&self, c: Coord) -> (usize, u32) {
        let [ux, uy, uz] = c.map(|v| v as usize / UNIT_EDGE as usize);
        let unit = ux + self.units.x as usize * (uy + self.units.y as usize * uz);
        let [cx, cy, cz] = c.map(|v| v % UNIT_EDGE / CELL_EDGE);
        (unit, cx | cy << 2 | cz << 4)
    }
}

/// Index of the codebook that a payload names. // spec: ZBT-10
#[inline(always)]
pub(super) fn codebook(payload: &[u8]) -> u32 {
    u32::from_le_bytes(bytes(payload, 0))
}

/// Unit block `index` of a payload, or `None` where it is void (case 1 of the paper).
#[inline(always)]
pub fn unit(payload: &[u8], index: usize) -> Option<Unit<'_>> {
    // spec: ZBT-11
    let entry = u32::from_le_bytes(bytes(payload, PREFIX_BYTES + 4 * index));
    let cells = (entry & 0xFF) as usize;
    (cells > 0).then(|| Unit { payload, base: 4 * (entry >> 8) as usize, cells })
}

/// A unit block that is not void.
#[derive(Clone, Copy, Debug)]
pub struct Unit<'a> {
    pub(super) payload: &'a [u8],
    /// First byte of the unit block: its CBFT.
    pub(super) base: usize,
    /// NNNC.
    pub(super) cells: usize,
}

impl<'a> Unit<'a> {
    /// Cell Bit Flag Table: bit n, from the least significant on, is cell n.
    #[inline(always)]
    #[must_use]
    pub fn cbft(&self) -> u64 {
        u64::from_le_bytes(bytes(self.payload, self.base))
    }

    /// Detail offset (low half) and zerobit offset (high half) of the cell with this rank.
    #[inline(always)]
    pub(super) fn offsets(&self, rank: usize) -> u32 {
        u32::from_le_bytes(bytes(self.payload, self.base + 8 + 4 * rank))
    }

    /// Where ZSMS starts. // spec: ZBT-15
    #[inline(always)]
    pub(super) fn zsms(&self) -> usize {
        self.base + 8 + NEW_RECORD * self.cells
    }

    /// Where DIS starts: behind the maps of the last cell. // spec: ZBT-15
    #[inline(always)]
    pub(super) fn dis(&self) -> usize {
        let last = Zerobits::read(self, self.cells - 1);
        last.maps + last.count() as usize
    }

    /// Cell `n` (0 to 63) of the new stream, or `None` where it is null (case 2).
    #[inline(always)]
    #[must_use]
    pub fn cell(&self, n: u32, count: impl BitCount) -> Option<Cell<'a>> {
        let cbft = self.cbft();
        bits::has_cell(cbft, n).then(|| self.cell_of_rank(count.count(bits::cells_before(cbft, n)) as usize))
    }

    /// The stored cell that `rank` others precede.
    #[inline(always)]
    pub(super) fn cell_of_rank(&self, rank: usize) -> Cell<'a> {
        self.cell_with_dis(rank, self.dis())
    }

    /// The same, where it is known already where DIS starts.
    #[inline(always)]
    pub(super) fn cell_with_dis(&self, rank: usize, dis: usize) -> Cell<'a> {
        let zerobits = Zerobits::read(self, rank);
        Cell {
            payload: self.payload,
            average: byte(self.payload, self.base + 8 + 4 * self.cells + rank),
            zerobits,
            details: dis + (self.offsets(rank) & 0xFFFF) as usize,
        }
    }

    /// Cell `n` of the old stream, or `None` where it is null.
    #[inline(always)]
    #[must_use]
    pub fn old_cell(&self, n: u32, count: impl BitCount) -> Option<OldCell<'a>> {
        let cbft = self.cbft();
        bits::has_cell(cbft, n).then(|| self.old_cell_of_rank(count.count(bits::cells_before(cbft, n)) as usize))
    }

    /// The stored cell of the old stream that `rank` others precede. // spec: ZBT-30
    #[inline(always)]
    pub(super) fn old_cell_of_rank(&self, rank: usize) -> OldCell<'a> {
        let flags = self.base + 8;
        let offsets = flags + 8 * self.cells;
        let indices = offsets + 2 * self.cells;
        let offset = u16::from_le_bytes(bytes(self.payload, offsets + 2 * rank));
        OldCell {
            payload: self.payload,
            flags: u64::from_le_bytes(bytes(self.payload, flags + 8 * rank)),
            indices: indices + usize::from(offset),
        }
    }
}

/// The nine zerobits of a cell, and where its maps lie.
#[derive(Clone, Copy, Debug)]
pub(super) struct Zerobits {
    /// Whether the level-0 node has details.
    pub(super) level_0: bool,
    /// Those of the level-1 nodes.
    pub(super) level_1: u8,
    /// Where the first map lies.
    pub(super) maps: usize,
}

impl Zerobits {
    // spec: ZBT-16
    #[inline(always)]
    pub(super) fn read(unit: &Unit<'_>, rank: usize) -> Self {
        let offset = unit.offsets(rank) >> 16;
        let at = unit.zsms() + (offset & 0x7FFF) as usize;
        Zerobits { level_0: offset >> 15 == 1, level_1: byte(unit.payload, at), maps: at + 1 }
    }

    /// Nodes that have details, thus maps.
    #[inline(always)]
    pub(super) fn count(&self) -> u32 {
        u32::from(self.level_0) + self.level_1.count_ones()
    }
}

/// A stored cell of the new stream.
#[derive(Clone, Copy, Debug)]
pub struct Cell<'a> {
    pub(super) payload: &'a [u8],
    /// Index of its average in the codebook.
    pub average: u8,
    pub(super) zerobits: Zerobits,
    /// Where the cell's first detail index lies.
    pub(super) details: usize,
}

/// A stored cell of the old stream.
#[derive(Clone, Copy, Debug)]
pub struct OldCell<'a> {
    pub(super) payload: &'a [u8],
    /// Flag of position p = 7i + j at bit p.
    pub(super) flags: u64,
    /// Where the cell's first index lies.
    pub(super) indices: usize,
}
