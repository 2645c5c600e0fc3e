//! Fast decoding of parts of bricks: the walk over cells, and how rows get to their place. Its judge is `decode`.
//!
//! A row of cells along x, through all bricks that are decoded together, is made in a buffer that stays in the cache. Its
//! sixteen rows of voxels are then written in one stretch each: memory takes that much faster than twelve bytes here and
//! there.

use super::Zerobit;
use super::bits;
use super::fast_cell::{Coded, Kernel, PortableColour, PortableGrey, ROW};
use super::layout::{CELL_EDGE, Layout, UNIT_EDGE, unit};
use super::params::Stream;
use crate::codec::{BrickPart, Stores};
use crate::error::Result;
use crate::geometry::{Coord, Extent, Region};
use crate::grid::ViewMut;
use crate::limits;
use crate::voxel::{SampleType, SampleValue};
use crate::with_sample;
use std::cell::Cell;

/// Rows of a cell.
const ROWS: usize = 16;
/// Bricks that fit the buffer side by side.
const SIDE_BY_SIDE: usize = 4;
/// Bytes from one row of the buffer to the next: four bricks of 256 colours, room for what is written too far, and not a
/// multiple of a page, so that rows do not compete for the same places in the cache.
const PITCH: usize = SIDE_BY_SIDE * 256 * 3 + 128;
/// A row of cells. Its length is known when this is compiled, so that no access to it needs to be checked.
type Buffer = [u8; ROWS * PITCH];

thread_local! {
    static BUFFER: Cell<Option<Box<Buffer>>> = const { Cell::new(None) };
}

/// Ways to decode regions that are slower than the best one; for tests and benches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Isa {
    /// Nothing but what every machine has.
    Portable,
    /// No more than AVX2.
    Avx2,
}

/// Decodes parts of bricks that lie side by side: by the fastest way that this machine has, or by no better one than `isa`.
pub(super) fn decode(
    codec: &Zerobit,
    parts: &[BrickPart<'_>],
    dst: ViewMut<'_>,
    stores: Stores,
    isa: Option<Isa>,
) -> Result<()> {
    let mut dst = dst;
    let (mut rest, mut x) = (parts, 0);
    while !rest.is_empty() {
        // The first cell of a part is written from its first voxel on: only the first part may begin within a cell.
        let fits = |p: &&BrickPart<'_>| p.region.start[0].is_multiple_of(CELL_EDGE) && is_brick(p);
        let more = if is_brick(&rest[0]) { SIDE_BY_SIDE - 1 } else { 0 };
        let run = 1 + rest[1..].iter().take(more).take_while(fits).count();
        let width = rest[..run].iter().map(|p| p.region.extent().x).sum();
        let extent = Extent { x: width, ..dst.extent };
        let dst = dst.sub(&Region::at([x, 0, 0], extent));
        if is_brick(&rest[0]) {
            decode_run(codec, &rest[..run], dst, stores, isa)?;
        } else {
            codec.decode_plain(&rest[0], dst)?;
        }
        (rest, x) = (&rest[run..], x + width);
    }
    Ok(())
}

/// Whether a part is no wider than the bricks of files are: the buffer holds four of them.
fn is_brick(part: &BrickPart<'_>) -> bool {
    part.region.extent().x <= 1 << limits::BRICK_LOG2.end()
}

fn decode_run(
    codec: &Zerobit,
    parts: &[BrickPart<'_>],
    dst: ViewMut<'_>,
    stores: Stores,
    isa: Option<Isa>,
) -> Result<()> {
    #[cfg(target_arch = "x86_64")]
    if let Some(token) = super::fast_v3::V3::detect()
        && isa != Some(Isa::Portable)
    {
        return super::fast_v3::decode(token, codec, parts, dst, stores, isa);
    }
    let _ = (stores, isa); // streaming takes special instructions
    let t = dst.sample_type;
    let copy = |to: &mut [u8], from: &[u8]| to.copy_from_slice(from);
    if t == SampleType::Rgb8 {
        decode_with(codec, PortableColour, parts, dst, copy)
    } else {
        decode_with(codec, |tables| PortableGrey(tables, t), parts, dst, copy)
    }
}

/// The walk; `kernel` decodes cells by the tables of a codebook, `copy` brings finished rows to their place.
#[inline(always)]
pub(super) fn decode_with<'a, K: Kernel>(
    codec: &'a Zerobit,
    kernel: impl Fn(&'a super::tables::Tables) -> K,
    parts: &[BrickPart<'_>],
    dst: ViewMut<'_>,
    copy: impl Fn(&mut [u8], &[u8]),
) -> Result<()> {
    let size = dst.sample_type.bytes();
    let Some(first) = parts.first() else { return Ok(()) };
    let kernels = parts.iter().map(|p| Ok(kernel(&codec.book(p.payload)?.tables))).collect::<Result<Vec<K>>>()?;
    let null = null_row(codec.null());
    // What the first cell has before its first wanted voxel, and what the last one has behind.
    let lead = (first.region.start[0] % CELL_EDGE) as usize * size;
    let row_bytes = dst.extent.x as usize * size;
    assert!(lead + row_bytes + ROW <= PITCH, "at most four bricks of at most 256 voxels");
    let mut buffer = BUFFER.take().unwrap_or_else(bytemuck::allocation::zeroed_box);
    let [_, y0, z0] = first.region.start;
    let [_, y1, z1] = first.region.end;
    for cz in z0 / CELL_EDGE..z1.div_ceil(CELL_EDGE) {
        for cy in y0 / CELL_EDGE..y1.div_ceil(CELL_EDGE) {
            // Rows (y, z) of these cells that are wanted.
            let wanted = |c: u32, from: u32, to: u32| {
                let first = c * CELL_EDGE;
                from.saturating_sub(first)..(to - first).min(CELL_EDGE)
            };
            let (ys, zs) = (wanted(cy, y0, y1), wanted(cz, z0, z1));
            let mut rows = 0u16;
            for z in zs.clone() {
                ys.clone().for_each(|y| rows |= 1 << (y + 4 * z));
            }
            let mut at = lead;
            for (part, kernel) in parts.iter().zip(&kernels) {
                // The first cell of the first part begins before the part does.
                let cell = at - (part.region.start[0] % CELL_EDGE) as usize * size;
                let mut row = CellRow { buffer: &mut buffer, at: cell, null: &null, rows };
                row.decode(codec.stream(), part, [cy, cz], size, kernel);
                at += part.region.extent().x as usize * size;
            }
            for z in zs {
                for y in ys.clone() {
                    let to = (cy * CELL_EDGE + y - y0) as usize * dst.row_pitch
                        + (cz * CELL_EDGE + z - z0) as usize * dst.slice_pitch;
                    let from = (y + 4 * z) as usize * PITCH + lead;
                    copy(&mut dst.bytes[to..to + row_bytes], &buffer[from..from + row_bytes]);
                }
            }
        }
    }
    BUFFER.set(Some(buffer));
    Ok(())
}

/// Four samples of this value.
fn null_row(null: SampleValue) -> [u8; ROW] {
    let mut out = [0; ROW];
    with_sample!(null.sample_type(), T => {
        let value: T = null.typed();
        for to in out.chunks_exact_mut(size_of::<T>()).take(4) {
            to.copy_from_slice(bytemuck::bytes_of(&value));
        }
    });
    out
}

/// A row of cells along x, in the buffer.
struct CellRow<'a> {
    buffer: &'a mut Buffer,
    /// Where the part's first cell starts in a row of the buffer.
    at: usize,
    null: &'a [u8; ROW],
    /// Rows that are wanted.
    rows: u16,
}

impl CellRow<'_> {
    /// Decodes the cells (.., cy, cz) of a part. Rows are written in whole vectors, a little too far: what follows in them is
    /// written later.
    #[inline(always)]
    fn decode(&mut self, stream: Stream, part: &BrickPart<'_>, [cy, cz]: [u32; 2], size: usize, kernel: &impl Kernel) {
        const PER_UNIT: u32 = UNIT_EDGE / CELL_EDGE;
        let layout = Layout::new(part.brick);
        let (from, to) = (part.region.start[0] / CELL_EDGE, part.region.end[0].div_ceil(CELL_EDGE));
        let place: Coord = [0, cy / PER_UNIT, cz / PER_UNIT];
        let row = layout.units.x * (place[1] + layout.units.y * place[2]);
        let in_unit = (cy % PER_UNIT) << 2 | (cz % PER_UNIT) << 4;
        for ux in from / PER_UNIT..to.div_ceil(PER_UNIT) {
            let unit = unit(part.payload, (row + ux) as usize);
            let (cbft, dis) = match &unit {
                Some(unit) => (unit.cbft(), if stream == Stream::New { unit.dis() } else { 0 }),
                None => (0, 0),
            };
            for cx in from.max(ux * PER_UNIT)..to.min((ux + 1) * PER_UNIT) {
                let n = (cx % PER_UNIT) | in_unit;
                // No cell lies further to the right than the widest run has them.
                let first = (self.at + (cx - from) as usize * 4 * size).min(PITCH - ROW);
                let mut put = |i: usize, row: [u8; ROW]| {
                    let to = (i % ROWS) * PITCH + first;
                    self.buffer[to..to + ROW].copy_from_slice(&row);
                };
                match unit.as_ref().filter(|_| bits::has_cell(cbft, n)) {
                    Some(unit) => {
                        let rank = bits::cells_before(cbft, n).count_ones() as usize;
                        let coded = match stream {
                            Stream::New => Coded::new(&unit.cell_with_dis(rank, dis)),
                            Stream::Old => Coded::old(&unit.old_cell_of_rank(rank)),
                        };
                        kernel.rows(&coded, self.rows, put);
                    }
                    None => (0..ROWS).for_each(|i| put(i, *self.null)),
                }
            }
        }
    }
}
