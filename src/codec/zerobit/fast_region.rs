//! Fast decoding of parts of bricks: the walk over unit blocks and cells, and how rows are stored. Its judge is `decode`.

use super::Zerobit;
use super::bits;
use super::book::ranges;
use super::fast_cell::{ALL_NODES, Coded, Colour, Decoded, Grey, Lane, Words, decode as decode_cell};
use super::layout::{CELL_EDGE, Layout, UNIT_EDGE, Unit, unit};
use super::params::Stream;
use super::tables::{pack, unpack};
use crate::codec::BrickPart;
use crate::error::Result;
use crate::geometry::{Coord, Extent, Region};
use crate::grid::ViewMut;
use crate::voxel::SampleType;

/// Bytes of a packed row at most: four voxels, and room to write whole vectors.
pub(super) const ROW: usize = 16;

/// Turns lanes into the bytes of four samples, clamped to their range.
pub(super) trait Pack<T, const R: usize>: Copy {
    /// Four samples; what lies behind them does not matter.
    fn pack(self, row: &[T; R]) -> [u8; ROW];
}

/// Colours without special instructions.
#[derive(Clone, Copy)]
pub(super) struct PlainColour;

impl Pack<i16, 16> for PlainColour {
    #[inline(always)]
    fn pack(self, row: &[i16; 16]) -> [u8; ROW] {
        let mut out = [0; ROW];
        for (to, from) in out.chunks_exact_mut(3).zip(row.chunks_exact(4)) {
            for (to, &v) in to.iter_mut().zip(from) {
                *to = v.clamp(0, 255) as u8;
            }
        }
        out
    }
}

/// Scalars.
#[derive(Clone, Copy)]
pub(super) struct PlainGrey(pub(super) SampleType);

impl Pack<i32, 4> for PlainGrey {
    #[inline(always)]
    fn pack(self, row: &[i32; 4]) -> [u8; ROW] {
        let [lo, hi] = ranges(self.0).0;
        let mut out = [0; ROW];
        let clamped = row.map(|v| v.clamp(lo, hi));
        if self.0 == SampleType::U8 {
            out[..4].copy_from_slice(&clamped.map(|v| v as u8));
        } else {
            for (to, v) in out.chunks_exact_mut(2).zip(clamped) {
                to.copy_from_slice(&(v as u16).to_ne_bytes());
            }
        }
        out
    }
}

/// Decodes a part of a brick by the fastest way that this machine has.
pub(super) fn decode(codec: &Zerobit, part: &BrickPart<'_>, dst: ViewMut<'_>) -> Result<()> {
    #[cfg(target_arch = "x86_64")]
    if let Some(token) = super::fast_v3::V3::detect() {
        return super::fast_v3::decode(token, codec, part, dst);
    }
    decode_portable(codec, part, dst)
}

/// Decodes with what every machine has.
#[inline(always)]
pub(super) fn decode_portable(codec: &Zerobit, part: &BrickPart<'_>, dst: ViewMut<'_>) -> Result<()> {
    if dst.sample_type == SampleType::Rgb8 {
        decode_colour(codec, part, dst, PlainColour)
    } else {
        decode_grey(codec, part, dst)
    }
}

#[inline(always)]
pub(super) fn decode_colour(
    codec: &Zerobit,
    part: &BrickPart<'_>,
    dst: ViewMut<'_>,
    pack: impl Pack<i16, 16>,
) -> Result<()> {
    let words = Colour(&codec.book(part.payload)?.tables);
    let null = codec.null_components::<3>();
    let null = std::array::from_fn(|lane| if lane % 4 < 3 { null[lane % 4] as i16 } else { 0 });
    Walk { stream: codec.stream(), words, pack, null }.run::<4>(part, dst);
    Ok(())
}

#[inline(always)]
pub(super) fn decode_grey(codec: &Zerobit, part: &BrickPart<'_>, dst: ViewMut<'_>) -> Result<()> {
    let words = Grey(&codec.book(part.payload)?.tables);
    let null = unpack(pack(codec.null_components::<3>()))[0];
    let pack = PlainGrey(dst.sample_type);
    Walk { stream: codec.stream(), words, pack, null: [null; 4] }.run::<1>(part, dst);
    Ok(())
}

struct Walk<W, P, N> {
    stream: Stream,
    words: W,
    pack: P,
    /// A row of a null cell.
    null: N,
}

impl<W, P, T, const R: usize> Walk<W, P, [T; R]>
where
    T: Lane,
    P: Pack<T, R>,
{
    /// Visits the cells of the part by unit blocks, x fastest: a row may be written a few bytes too far, since what follows
    /// in it is written later.
    #[inline(always)]
    fn run<const L: usize>(&self, part: &BrickPart<'_>, mut dst: ViewMut<'_>)
    where
        W: Words<T, L>,
    {
        let layout = Layout::new(part.brick);
        let Region { start, end } = part.region;
        let units = |a: usize| start[a] / UNIT_EDGE..end[a].div_ceil(UNIT_EDGE);
        for uz in units(2) {
            for uy in units(1) {
                for ux in units(0) {
                    let index = ux + layout.units.x * (uy + layout.units.y * uz);
                    let found = unit(part.payload, index as usize);
                    self.unit::<L>(found.as_ref(), [ux, uy, uz], part, &mut dst);
                }
            }
        }
    }

    #[inline(always)]
    fn unit<const L: usize>(&self, unit: Option<&Unit<'_>>, place: Coord, part: &BrickPart<'_>, dst: &mut ViewMut<'_>)
    where
        W: Words<T, L>,
    {
        let null = self.pack.pack(&self.null);
        let origin = place.map(|u| u * UNIT_EDGE);
        // Cells of the unit block that are wanted, per axis.
        let wanted = |a: usize| {
            let from = part.region.start[a].saturating_sub(origin[a]) / CELL_EDGE;
            let to = (part.region.end[a] - origin[a]).min(UNIT_EDGE).div_ceil(CELL_EDGE);
            from..to
        };
        let (cbft, dis) = match unit {
            Some(unit) => (unit.cbft(), if self.stream == Stream::New { unit.dis() } else { 0 }),
            None => (0, 0),
        };
        for cz in wanted(2) {
            for cy in wanted(1) {
                for cx in wanted(0) {
                    let n = cx | cy << 2 | cz << 4;
                    let at = [origin[0] + cx * CELL_EDGE, origin[1] + cy * CELL_EDGE, origin[2] + cz * CELL_EDGE];
                    let coded = unit.filter(|_| bits::has_cell(cbft, n)).map(|unit| {
                        let rank = bits::cells_before(cbft, n).count_ones() as usize;
                        match self.stream {
                            Stream::New => Coded::new(&unit.cell_with_dis(rank, dis)),
                            Stream::Old => Coded::old(&unit.old_cell_of_rank(rank)),
                        }
                    });
                    let Some(coded) = coded else {
                        self.store(at, part, dst, |_| null);
                        continue;
                    };
                    match decode_cell::<T, W, L, R>(&coded, &self.words, ALL_NODES) {
                        Decoded::Rows(rows) => self.store(at, part, dst, |i| self.pack.pack(&rows[i])),
                        Decoded::Quarters(quarters) => {
                            let packed = quarters.map(|row| self.pack.pack(&row));
                            self.store(at, part, dst, |i| packed[i >> 1 & 1 | i >> 3 << 1]);
                        }
                    }
                }
            }
        }
    }

    /// Stores the rows of the cell at `at` (in the brick) as far as they are wanted. `row` gives row (y, z) at y + 4z.
    #[inline(always)]
    fn store(&self, at: Coord, part: &BrickPart<'_>, dst: &mut ViewMut<'_>, row: impl Fn(usize) -> [u8; ROW]) {
        let size = dst.sample_type.bytes();
        let start = part.region.start;
        let inside = (0..3).all(|a| at[a] >= start[a] && at[a] + CELL_EDGE <= part.region.end[a]);
        if inside {
            let [x, y, z] = [at[0] - start[0], at[1] - start[1], at[2] - start[2]].map(|v| v as usize);
            let first = x * size + y * dst.row_pitch + z * dst.slice_pitch;
            // A whole vector where the row goes on for as long.
            let room = (dst.extent.x as usize - x) * size;
            for i in 0..16 {
                let to = first + (i & 3) * dst.row_pitch + (i >> 2) * dst.slice_pitch;
                let row = row(i);
                if room >= ROW {
                    dst.bytes[to..to + ROW].copy_from_slice(&row);
                } else {
                    dst.bytes[to..to + 4 * size].copy_from_slice(&row[..4 * size]);
                }
            }
            return;
        }
        let cell = Region::at(at, Extent::cube(CELL_EDGE)).intersect(&part.region);
        let (from, to) = ((cell.start[0] - at[0]) as usize * size, (cell.end[0] - at[0]) as usize * size);
        for z in cell.start[2]..cell.end[2] {
            for y in cell.start[1]..cell.end[1] {
                let row = row(((y - at[1]) + 4 * (z - at[2])) as usize);
                let first = (cell.start[0] - start[0]) as usize * size
                    + (y - start[1]) as usize * dst.row_pitch
                    + (z - start[2]) as usize * dst.slice_pitch;
                dst.bytes[first..first + to - from].copy_from_slice(&row[from..to]);
            }
        }
    }
}
