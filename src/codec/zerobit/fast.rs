//! Fast decoding of single voxels, in the new and the old stream. Its judge is `decode`.
//!
//! Random voxels cannot be guessed: whether a level-0 node is null and how many details it has is masked instead of
//! branched on; level-1 nodes are nearly always null, which is guessed right.

use super::bits;
use super::book::ranges;
use super::layout::{NEW_RECORD, PREFIX_BYTES, Unit, byte, bytes};
use super::params::Stream;
use super::tables::{Tables, unpack};
use crate::codec::prefetch::prefetch;
use crate::geometry::{Coord, Extent};
use crate::voxel::{Sample, SampleType, same};

/// What all voxels of a brick have in common, its payload apart.
#[derive(Clone, Copy, Debug)]
pub struct BrickFrame<'a> {
    pub(super) tables: &'a Tables,
    /// Unit blocks along x, and in a layer.
    units: [u32; 2],
    pub(super) stream: Stream,
    /// The null value, packed.
    pub(super) null: i64,
    /// Whether bytes are to be expected far from the processor: then a voxel asks for all that it may need at once, instead
    /// of for one thing after the other.
    far: bool,
    #[cfg(target_arch = "x86_64")]
    pub(super) v3: Option<super::fast_v3::V3>,
    #[cfg(target_arch = "x86_64")]
    pub(super) v4: Option<super::fast_v3::V4>,
}

/// A brick whose voxels, planes and cells are to be read one by one. Coordinates must lie inside the brick.
#[derive(Clone, Copy, Debug)]
pub struct BrickReader<'a> {
    pub(super) payload: &'a [u8],
    pub(super) frame: &'a BrickFrame<'a>,
}

/// Voxels whose bytes are asked for ahead before the first of them is decoded: enough to hide main memory's latency.
pub const AHEAD: usize = 32;

/// Payloads of this many bytes fit the caches near the processor.
const NEAR_BYTES: u64 = 4 << 20;

/// What a voxel consists of.
pub(super) struct Parts {
    /// Index of the average.
    pub(super) average: Option<u8>,
    /// Per level: the map of the node, 0 where that is null; the place of the voxel in the node, 4x + 2y + z; the indices of
    /// the node's details, at most seven.
    pub(super) nodes: [(u8, u32, u64); 2],
}

/// Adds up what a voxel consists of.
pub(super) trait Sum<T> {
    fn sum(&self, tables: &Tables, parts: &Parts) -> T;
}

/// Sums of packed words; any machine, any type.
pub(super) struct Portable;

impl<T: Sample> Sum<T> for Portable {
    #[inline(always)]
    fn sum(&self, tables: &Tables, parts: &Parts) -> T {
        let mut value = parts.average.map_or(0, |index| tables.average[usize::from(index)]);
        for &(map, place, indices) in &parts.nodes {
            if map != 0 {
                value += details(tables, map, place, indices);
            }
        }
        to_sample(value)
    }
}

/// Signs of the details of a map at a place (4x + 2y + z) of a 2³ group: two bits for each stored detail, from the lowest on:
/// 2 where it is added, 3 where it is subtracted; 0 behind the last.
pub(super) static SIGNS: [[u16; 128]; 8] = {
    let mut signs = [[0; 128]; 8];
    let mut place = 0;
    while place < 8 {
        let mut map = 0u8;
        while map < 128 {
            let (mut j, mut k) = (1, 0);
            while j < 8 {
                if bits::has_detail(map, j) {
                    signs[place][map as usize] |= (2 | ((j & place as u32).count_ones() as u16 & 1)) << (2 * k);
                    k += 1;
                }
                j += 1;
            }
            map += 1;
        }
        place += 1;
    }
    signs
};

/// The sum of a node's details, each with its sign.
#[inline(always)]
fn details(tables: &Tables, map: u8, place: u32, mut indices: u64) -> i64 {
    let mut signs = SIGNS[place as usize & 7][usize::from(map & 0x7F)];
    let mut sum = 0;
    while signs != 0 {
        let word = tables.detail[(indices & 0xFF) as usize];
        let minus = -i64::from(signs & 1);
        sum += (word ^ minus) - minus;
        indices >>= 8;
        signs >>= 2;
    }
    sum
}

impl<'a> BrickFrame<'a> {
    pub(super) fn new(tables: &'a Tables, units: Extent, stream: Stream, null: i64) -> Self {
        BrickFrame {
            tables,
            units: [units.x, units.x * units.y],
            stream,
            null,
            far: false,
            #[cfg(target_arch = "x86_64")]
            v3: super::fast_v3::V3::detect(),
            #[cfg(target_arch = "x86_64")]
            v4: super::fast_v3::V4::detect(),
        }
    }

    /// The same for payloads of a volume with `payload_bytes` of them in all: those of large ones lie far from the processor.
    #[must_use]
    pub fn in_volume(self, payload_bytes: u64) -> Self {
        BrickFrame { far: payload_bytes > NEAR_BYTES, ..self }
    }

    /// A reader of a payload that belongs to this frame.
    #[inline(always)]
    #[must_use]
    pub fn reader<'b>(&'b self, payload: &'b [u8]) -> BrickReader<'b> {
        BrickReader { payload, frame: self }
    }
}

impl BrickReader<'_> {
    /// The voxel at `c` of the brick; `T` must be the type of the volume's samples.
    #[inline(always)]
    #[must_use]
    pub fn voxel<T: Sample>(&self, c: Coord) -> T {
        #[cfg(target_arch = "x86_64")]
        if let Some(token) = self.frame.v3 {
            return super::fast_v3::voxel(token, self, c);
        }
        self.single_with(c, &Portable)
    }

    /// Voxels of several bricks, at most [`AHEAD`], asking memory for all of them before the first is decoded. `readers`,
    /// `coords` and `out` are equally long; coordinates are those in the bricks.
    pub fn voxels<T: Sample>(readers: &[BrickReader<'_>], coords: &[Coord], out: &mut [T]) {
        #[cfg(target_arch = "x86_64")]
        if let Some(token) = readers.first().and_then(|r| r.frame.v3) {
            return super::fast_v3::voxels(token, readers, coords, out);
        }
        BrickReader::voxels_with(readers, coords, out, &Portable);
    }

    #[inline(always)]
    pub(super) fn voxels_with<T: Sample>(
        readers: &[BrickReader<'_>],
        coords: &[Coord],
        out: &mut [T],
        sum: &impl Sum<T>,
    ) {
        let mut entries = [0; AHEAD];
        readers.iter().zip(coords).for_each(|(reader, &c)| prefetch(reader.payload, reader.entry_at(c)));
        for ((reader, &c), entry) in readers.iter().zip(coords).zip(&mut entries) {
            *entry = reader.entry(c);
            reader.prefetch_unit(*entry);
        }
        for (((reader, &c), &entry), value) in readers.iter().zip(coords).zip(&entries).zip(out) {
            *value = reader.voxel_with(entry, c, sum);
        }
    }

    /// Where the directory entry of a voxel's unit block lies in the payload.
    #[inline(always)]
    fn entry_at(&self, [x, y, z]: Coord) -> usize {
        let units = &self.frame.units;
        PREFIX_BYTES + 4 * (x / 16 + units[0] * (y / 16) + units[1] * (z / 16)) as usize
    }

    /// The directory entry of a voxel's unit block.
    #[inline(always)]
    pub(super) fn entry(&self, c: Coord) -> u32 {
        u32::from_le_bytes(bytes(self.payload, self.entry_at(c)))
    }

    /// Asks memory for the part of a unit block that every voxel of it needs.
    #[inline(always)]
    fn prefetch_unit(&self, entry: u32) {
        if entry & 0xFF == 0 {
            return;
        }
        let (base, cells) = (4 * (entry >> 8) as usize, (entry & 0xFF) as usize);
        let streams = base + 8 + NEW_RECORD * cells;
        if self.frame.far {
            (base..streams + 192).step_by(64).for_each(|at| prefetch(self.payload, at));
        } else {
            // CBFT and the first records, records in the middle, where the streams start, and a line on: asking a near cache
            // for all of a unit block takes longer than it saves.
            [base, base + 2 * cells + 32, streams, streams + 64].into_iter().for_each(|at| prefetch(self.payload, at));
        }
    }

    /// The voxel at `c`.
    #[inline(always)]
    pub(super) fn single_with<T: Sample>(&self, c: Coord, sum: &impl Sum<T>) -> T {
        let entry = self.entry(c);
        if self.frame.far {
            self.prefetch_unit(entry);
        }
        self.voxel_with(entry, c, sum)
    }

    /// The voxel at `c`; `entry` is that of [`BrickReader::entry`].
    #[inline(always)]
    pub(super) fn voxel_with<T: Sample>(&self, entry: u32, c: Coord, sum: &impl Sum<T>) -> T {
        match self.parts(entry, c) {
            Some(parts) => sum.sum(self.frame.tables, &parts),
            None => to_sample(self.frame.null),
        }
    }

    /// What the voxel at `c` consists of; `None` where its cell is null.
    #[inline(always)]
    fn parts(&self, entry: u32, [x, y, z]: Coord) -> Option<Parts> {
        let cells = (entry & 0xFF) as usize;
        if cells == 0 {
            return None;
        }
        let unit = Unit { payload: self.payload, base: 4 * (entry >> 8) as usize, cells };
        let n = x >> 2 & 3 | y & 12 | (z & 12) << 2;
        let cbft = unit.cbft();
        if !bits::has_cell(cbft, n) {
            return None;
        }
        let rank = bits::cells_before(cbft, n).count_ones() as usize;
        let place = |shift: u32| (x >> shift & 1) << 2 | (y >> shift & 1) << 1 | z >> shift & 1;
        // The number of a node has its x in the lowest bit, a place its z.
        let node = 1 + (x >> 1 & 1 | y & 2 | z << 1 & 4);
        Some(match self.frame.stream {
            Stream::New => self.new_parts(&unit, rank, node, [place(1), place(0)]),
            Stream::Old => self.old_parts(&unit, rank, node, [place(1), place(0)]),
        })
    }

    #[inline(always)]
    fn new_parts(&self, unit: &Unit<'_>, rank: usize, i: u32, places: [u32; 2]) -> Parts {
        let cell = unit.cell_of_rank(rank);
        let z = &cell.zerobits;
        let none = 0u8.wrapping_sub(u8::from(!z.level_0));
        let level_0 = bits::details(byte(self.payload, z.maps)) & !none;
        let mut nodes = [(level_0, places[0], self.indices(cell.details)), (0, 0, 0)];
        if bits::has_node(z.level_1, i) {
            let maps = u64::from_le_bytes(bytes(self.payload, z.maps)) & 0x7F7F_7F7F_7F7F_7F7F;
            let before = u32::from(z.level_0) + u32::from(bits::nodes_before(z.level_1, i)).count_ones();
            // At most eight maps precede, so that all of them are in these eight bytes.
            let earlier = maps & 1u64.checked_shl(8 * before).unwrap_or(0).wrapping_sub(1);
            let map = bits::details(byte(self.payload, z.maps + before as usize));
            nodes[1] = (map, places[1], self.indices(cell.details + earlier.count_ones() as usize));
        }
        Parts { average: Some(cell.average), nodes }
    }

    #[inline(always)]
    fn old_parts(&self, unit: &Unit<'_>, rank: usize, i: u32, places: [u32; 2]) -> Parts {
        let cell = unit.old_cell_of_rank(rank);
        let node = |i: u32, place| {
            // Seven flags from the least significant on; a map has the first detail in its highest bit.
            let first = 7 * i + 1;
            let map = ((cell.flags >> first) as u8).reverse_bits() >> 1 & 0x7F;
            let before = (cell.flags & ((1 << first) - 1)).count_ones() as usize;
            (map, place, self.indices(cell.indices + before))
        };
        let average = (cell.flags & 1 == 1).then(|| byte(self.payload, cell.indices));
        Parts { average, nodes: [node(0, places[0]), node(i, places[1])] }
    }

    /// Eight indices from `at` on.
    #[inline(always)]
    fn indices(&self, at: usize) -> u64 {
        u64::from_le_bytes(bytes(self.payload, at))
    }
}

/// A packed word as a sample, clamped to its range. The type is known when this is compiled: no match remains.
#[inline(always)]
pub(super) fn to_sample<T: Sample>(packed: i64) -> T {
    let [lo, hi] = ranges(T::TYPE).0;
    let word = unpack(packed).map(|v| v.clamp(lo, hi));
    match T::TYPE {
        SampleType::U8 => same(word[0] as u8),
        SampleType::U16 => same(word[0] as u16),
        SampleType::I16 => same(word[0] as i16),
        SampleType::Rgb8 => same(word.map(|v| v as u8)),
        SampleType::F32 => unreachable!("refused by Codec::supports"),
    }
}
