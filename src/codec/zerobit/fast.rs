//! Fast decoding of single voxels, in the new and the old stream. Its judge is `decode`.
//!
//! Words are added as packed numbers (`tables`); a map's flags are walked from one set bit to the next; everything that
//! can be known from the counts alone is computed while the bytes are on their way.

use super::bits;
use super::book::ranges;
use super::layout::{NEW_RECORD, PREFIX_BYTES, Unit, byte, bytes};
use super::params::Stream;
use super::tables::{Tables, unpack};
use crate::codec::prefetch::prefetch;
use crate::geometry::{Coord, Extent};
use crate::voxel::{Sample, SampleType, same};

/// A brick whose voxels, planes and cells are to be read one by one. Coordinates must lie inside the brick.
#[derive(Clone, Copy, Debug)]
pub struct BrickReader<'a> {
    pub(super) payload: &'a [u8],
    pub(super) tables: &'a Tables,
    /// Unit blocks along x, and in a layer.
    units: [u32; 2],
    pub(super) stream: Stream,
    /// The null value, packed.
    pub(super) null: i64,
    #[cfg(target_arch = "x86_64")]
    pub(super) v3: Option<super::fast_v3::V3>,
}

/// Signs by place (4x + 2y + z) of a 2³ group, as bits in the order of a map: set where detail j is subtracted.
const SIGNS: [u8; 8] = {
    let mut signs = [0; 8];
    let mut place = 0;
    while place < 8 {
        let mut j = 1;
        while j < 8 {
            if (j & place as u32).count_ones() % 2 == 1 {
                signs[place] |= bits::detail_bit(j);
            }
            j += 1;
        }
        place += 1;
    }
    signs
};

/// Voxels whose bytes are asked for ahead before the first of them is decoded: enough to hide main memory's latency.
pub const AHEAD: usize = 32;

impl<'a> BrickReader<'a> {
    pub(super) fn new(payload: &'a [u8], tables: &'a Tables, units: Extent, stream: Stream, null: i64) -> Self {
        BrickReader {
            payload,
            tables,
            units: [units.x, units.x * units.y],
            stream,
            null,
            #[cfg(target_arch = "x86_64")]
            v3: super::fast_v3::V3::detect(),
        }
    }

    /// The same for another payload that refers to the same codebook.
    #[inline(always)]
    #[must_use]
    pub fn with_payload<'b>(&self, payload: &'b [u8]) -> BrickReader<'b>
    where
        'a: 'b,
    {
        BrickReader { payload, ..*self }
    }

    /// The voxel at `c` of the brick; `T` must be the type of the volume's samples.
    #[inline(always)]
    #[must_use]
    pub fn voxel<T: Sample>(&self, c: Coord) -> T {
        #[cfg(target_arch = "x86_64")]
        if let Some(token) = self.v3 {
            return super::fast_v3::voxel(token, self, c);
        }
        self.voxel_portable(c)
    }

    #[inline(always)]
    pub(super) fn voxel_portable<T: Sample>(&self, c: Coord) -> T {
        to_sample(self.packed(self.entry(c), c).unwrap_or(self.null))
    }

    /// Voxels of several bricks, at most [`AHEAD`], asking memory for all of them before the first is decoded. `readers`,
    /// `coords` and `out` are equally long; coordinates are those in the bricks.
    pub fn voxels<T: Sample>(readers: &[BrickReader<'_>], coords: &[Coord], out: &mut [T]) {
        #[cfg(target_arch = "x86_64")]
        if let Some(token) = readers.first().and_then(|r| r.v3) {
            return super::fast_v3::voxels(token, readers, coords, out);
        }
        BrickReader::voxels_portable(readers, coords, out);
    }

    #[inline(always)]
    pub(super) fn voxels_portable<T: Sample>(readers: &[BrickReader<'_>], coords: &[Coord], out: &mut [T]) {
        let mut entries = [0; AHEAD];
        readers.iter().zip(coords).for_each(|(reader, &c)| reader.prefetch_entry(c));
        for ((reader, &c), entry) in readers.iter().zip(coords).zip(&mut entries) {
            *entry = reader.entry(c);
            reader.prefetch_unit(*entry);
        }
        for (((reader, &c), &entry), value) in readers.iter().zip(coords).zip(&entries).zip(out) {
            *value = to_sample(reader.packed(entry, c).unwrap_or(reader.null));
        }
    }

    /// Where the directory entry of a voxel's unit block lies in the payload.
    #[inline(always)]
    fn entry_at(&self, [x, y, z]: Coord) -> usize {
        PREFIX_BYTES + 4 * (x / 16 + self.units[0] * (y / 16) + self.units[1] * (z / 16)) as usize
    }

    /// The directory entry of a voxel's unit block.
    #[inline(always)]
    pub(super) fn entry(&self, c: Coord) -> u32 {
        u32::from_le_bytes(bytes(self.payload, self.entry_at(c)))
    }

    /// Asks memory for the directory entry of a voxel.
    #[inline(always)]
    fn prefetch_entry(&self, c: Coord) {
        prefetch(self.payload, self.entry_at(c));
    }

    /// Asks memory for the part of a unit block that every voxel of it needs.
    #[inline(always)]
    fn prefetch_unit(&self, entry: u32) {
        if entry & 0xFF == 0 {
            return;
        }
        let base = 4 * (entry >> 8) as usize;
        prefetch(self.payload, base);
        let streams = base + 8 + NEW_RECORD * (entry & 0xFF) as usize;
        for at in (base + 64..streams + 192).step_by(64) {
            prefetch(self.payload, at);
        }
    }

    /// The voxel at `c`, packed and not yet clamped; `None` where its cell is null. `entry` is that of [`BrickReader::entry`].
    #[inline(always)]
    pub(super) fn packed(&self, entry: u32, [x, y, z]: Coord) -> Option<i64> {
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
        let node = x >> 1 & 1 | y & 2 | z << 1 & 4;
        Some(match self.stream {
            Stream::New => self.new_voxel(&unit, rank, node + 1, [place(1), place(0)]),
            Stream::Old => self.old_voxel(&unit, rank, node + 1, [place(1), place(0)]),
        })
    }

    #[inline(always)]
    fn new_voxel(&self, unit: &Unit<'_>, rank: usize, i: u32, places: [u32; 2]) -> i64 {
        let cell = unit.cell_of_rank(rank);
        let z = &cell.zerobits;
        let mut value = self.tables.average[usize::from(cell.average)];
        if z.level_0 {
            value += self.details(bits::details(byte(self.payload, z.maps)), places[0], cell.details);
        }
        if bits::has_node(z.level_1, i) {
            let before = u32::from(z.level_0) + u32::from(bits::nodes_before(z.level_1, i)).count_ones();
            let maps = u64::from_le_bytes(bytes(self.payload, z.maps)) & 0x7F7F_7F7F_7F7F_7F7F;
            // At most eight maps precede, so that all of them are in these eight bytes.
            let earlier = if before == 8 { maps } else { maps & ((1 << (8 * before)) - 1) };
            let map = bits::details(byte(self.payload, z.maps + before as usize));
            value += self.details(map, places[1], cell.details + earlier.count_ones() as usize);
        }
        value
    }

    #[inline(always)]
    fn old_voxel(&self, unit: &Unit<'_>, rank: usize, i: u32, places: [u32; 2]) -> i64 {
        let cell = unit.old_cell_of_rank(rank);
        let mut value = 0;
        if cell.flags & 1 == 1 {
            value = self.tables.average[usize::from(byte(self.payload, cell.indices))];
        }
        for (i, place) in [(0, places[0]), (i, places[1])] {
            // Seven flags from the least significant on; a map has the first detail in its highest bit.
            let first = 7 * i + 1;
            let map = ((cell.flags >> first) as u8).reverse_bits() >> 1 & 0x7F;
            if map != 0 {
                let before = (cell.flags & ((1 << first) - 1)).count_ones() as usize;
                value += self.details(map, place, cell.indices + before);
            }
        }
        value
    }

    /// The sum of a node's details, each with its sign at `place`; their indices lie from `at` on.
    #[inline(always)]
    fn details(&self, map: u8, place: u32, at: usize) -> i64 {
        let signs = SIGNS[place as usize & 7];
        let mut rest = map;
        let mut sum = 0;
        let mut indices = u64::from_le_bytes(bytes(self.payload, at)); // at most seven
        while rest != 0 {
            let top = 0x80u8 >> rest.leading_zeros();
            let word = self.tables.detail[(indices & 0xFF) as usize];
            let minus = -i64::from(signs & top != 0);
            sum += (word ^ minus) - minus;
            indices >>= 8;
            rest ^= top;
        }
        sum
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
