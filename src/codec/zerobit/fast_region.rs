//! Fast decoding of parts of bricks: the walk over unit blocks and cells, and how rows are stored. Its judge is `decode`.

use super::Zerobit;
use super::bits;
use super::fast_cell::{Coded, Kernel, PortableColour, PortableGrey, ROW};
use super::layout::{CELL_EDGE, Layout, UNIT_EDGE, Unit, unit};
use super::params::Stream;
use crate::codec::BrickPart;
use crate::error::Result;
use crate::geometry::{Coord, Extent, Region};
use crate::grid::ViewMut;
use crate::voxel::{SampleType, SampleValue};
use crate::with_sample;

/// Decodes a part of a brick by the fastest way that this machine has.
pub(super) fn decode(codec: &Zerobit, part: &BrickPart<'_>, dst: ViewMut<'_>) -> Result<()> {
    #[cfg(target_arch = "x86_64")]
    if let Some(token) = super::fast_v3::V3::detect() {
        return super::fast_v3::decode(token, codec, part, dst);
    }
    decode_portable(codec, part, dst)
}

/// Decodes with what every machine has.
fn decode_portable(codec: &Zerobit, part: &BrickPart<'_>, dst: ViewMut<'_>) -> Result<()> {
    let tables = &codec.book(part.payload)?.tables;
    match dst.sample_type {
        SampleType::Rgb8 => decode_with(codec, PortableColour(tables), part, dst),
        t => decode_with(codec, PortableGrey(tables, t), part, dst),
    }
    Ok(())
}

/// Visits the cells of the part by unit blocks, x fastest: a row may be written a few bytes too far, since what follows in it
/// is written later.
#[inline(always)]
pub(super) fn decode_with(codec: &Zerobit, kernel: impl Kernel, part: &BrickPart<'_>, mut dst: ViewMut<'_>) {
    let layout = Layout::new(part.brick);
    let Region { start, end } = part.region;
    let walk = Walk { stream: codec.stream(), kernel, null: null_row(codec.null()) };
    let units = |a: usize| start[a] / UNIT_EDGE..end[a].div_ceil(UNIT_EDGE);
    for uz in units(2) {
        for uy in units(1) {
            for ux in units(0) {
                let index = ux + layout.units.x * (uy + layout.units.y * uz);
                walk.unit(unit(part.payload, index as usize), [ux, uy, uz], part, &mut dst);
            }
        }
    }
}

/// Four samples of this value.
pub(super) fn null_row(null: SampleValue) -> [u8; ROW] {
    let mut out = [0; ROW];
    with_sample!(null.sample_type(), T => {
        let value: T = null.typed();
        for to in out.chunks_exact_mut(size_of::<T>()).take(4) {
            to.copy_from_slice(bytemuck::bytes_of(&value));
        }
    });
    out
}

struct Walk<K> {
    stream: Stream,
    kernel: K,
    /// A row of a null cell.
    null: [u8; ROW],
}

impl<K: Kernel> Walk<K> {
    #[inline(always)]
    fn unit(&self, unit: Option<Unit<'_>>, place: Coord, part: &BrickPart<'_>, dst: &mut ViewMut<'_>) {
        let origin = place.map(|u| u * UNIT_EDGE);
        // Cells of the unit block that are wanted, per axis.
        let wanted = |a: usize| {
            let from = part.region.start[a].saturating_sub(origin[a]) / CELL_EDGE;
            let to = (part.region.end[a] - origin[a]).min(UNIT_EDGE).div_ceil(CELL_EDGE);
            from..to
        };
        let (cbft, dis) = match &unit {
            Some(unit) => (unit.cbft(), if self.stream == Stream::New { unit.dis() } else { 0 }),
            None => (0, 0),
        };
        for cz in wanted(2) {
            for cy in wanted(1) {
                for cx in wanted(0) {
                    let n = cx | cy << 2 | cz << 4;
                    let at = [origin[0] + cx * CELL_EDGE, origin[1] + cy * CELL_EDGE, origin[2] + cz * CELL_EDGE];
                    let coded = unit.as_ref().filter(|_| bits::has_cell(cbft, n)).map(|unit| {
                        let rank = bits::cells_before(cbft, n).count_ones() as usize;
                        match self.stream {
                            Stream::New => Coded::new(&unit.cell_with_dis(rank, dis)),
                            Stream::Old => Coded::old(&unit.old_cell_of_rank(rank)),
                        }
                    });
                    let mut store = Store::new(at, part, dst);
                    match coded {
                        Some(coded) => self.kernel.rows(&coded, store.rows, |i, row| store.put(i, &row)),
                        None => (0..16).for_each(|i| store.put(i, &self.null)),
                    }
                }
            }
        }
    }
}

/// Where the rows of a cell go, as far as they are wanted.
struct Store<'a> {
    bytes: &'a mut [u8],
    pitches: [usize; 2],
    /// Where row 0 starts; rows before it may lie outside.
    first: usize,
    /// The bytes of a row that are wanted.
    part: [usize; 2],
    /// Whether whole vectors may be written: the cell is whole, and its rows go on for as long.
    wide: bool,
    /// Which rows are wanted.
    rows: u16,
}

impl<'a> Store<'a> {
    /// For the cell at `at` of the brick.
    #[inline(always)]
    fn new(at: Coord, part: &BrickPart<'_>, dst: &'a mut ViewMut<'_>) -> Self {
        let size = dst.sample_type.bytes();
        let start = part.region.start;
        let pitches = [dst.row_pitch, dst.slice_pitch];
        let inside = (0..3).all(|a| at[a] >= start[a] && at[a] + CELL_EDGE <= part.region.end[a]);
        if inside {
            let [x, y, z] = [at[0] - start[0], at[1] - start[1], at[2] - start[2]].map(|v| v as usize);
            let first = x * size + y * dst.row_pitch + z * dst.slice_pitch;
            let wide = (dst.extent.x as usize - x) * size >= ROW;
            return Store { bytes: dst.bytes, pitches, first, part: [0, 4 * size], wide, rows: u16::MAX };
        }
        let cell = Region::at(at, Extent::cube(CELL_EDGE)).intersect(&part.region);
        let inside = |a: usize| (cell.start[a] - at[a]) as usize..(cell.end[a] - at[a]) as usize;
        let mut rows = 0;
        for z in inside(2) {
            inside(1).for_each(|y| rows |= 1 << (y + 4 * z));
        }
        let x = inside(0);
        // Row 0 may lie before the region: what is added for a wanted row makes up for it.
        let first = (cell.start[0] - start[0]) as usize * size;
        let first = first
            .wrapping_add((at[1].wrapping_sub(start[1]) as i32 as isize as usize).wrapping_mul(dst.row_pitch))
            .wrapping_add((at[2].wrapping_sub(start[2]) as i32 as isize as usize).wrapping_mul(dst.slice_pitch));
        Store { bytes: dst.bytes, pitches, first, part: [x.start * size, x.end * size], wide: false, rows }
    }

    /// Stores row (y, z) with the number y + 4z, if it is wanted.
    #[inline(always)]
    fn put(&mut self, i: usize, row: &[u8; ROW]) {
        let to = self.first.wrapping_add((i & 3) * self.pitches[0]).wrapping_add((i >> 2) * self.pitches[1]);
        let [from, end] = self.part;
        if self.wide {
            self.bytes[to..to + ROW].copy_from_slice(row);
        } else if self.rows >> i & 1 == 1 {
            self.bytes[to..to + end - from].copy_from_slice(&row[from..end]);
        }
    }
}
