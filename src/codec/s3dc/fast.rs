//! Fast decoding, the part that is the same for every instruction set: which path to take, and the walk over a brick.
//!
//! Why it is fast: what a block's end points contribute is spread over the voxels of a row once per row of blocks
//! (`fast_tables`), then every row of that row of blocks is plain arithmetic on whole vectors, read and written in order.
//! The plain decoder is the judge: results are equal to the bit, for damaged payloads too.

use super::Layout;
use super::fast_rows::{Grid2, Rows};
use super::fast_tables::BlockRow;
use crate::codec::Stores;
use crate::geometry::Region;
use crate::grid::ViewMut;

/// Voxels that the tables of a kernel hold. Longer rows are decoded in pieces of this length.
pub const CHUNK: usize = 256;
/// Voxels that a kernel decodes at a time. What is left of a row goes through a small buffer.
pub const STEP: usize = 32;
/// Pieces that are decoded together, and rows of each at a time.
const SIDE_BY_SIDE: usize = 4;
/// See [`SIDE_BY_SIDE`].
const ROWS_AT_A_TIME: u32 = 16;
/// Regions below this many voxels are not worth the tables.
const MIN_VOXELS: u64 = 256;

/// An instruction set that has a fast path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Isa {
    /// 256-bit integer and float instructions of x86-64.
    Avx2,
    /// 512-bit instructions of x86-64 with byte permutes (F, BW, VL, VBMI).
    Avx512,
}

impl Isa {
    /// The instruction sets that this machine has, best first.
    #[must_use]
    pub fn available() -> &'static [Isa] {
        #[cfg(target_arch = "x86_64")]
        {
            if super::fast_avx512::Avx512::detect().is_some() {
                return &[Isa::Avx512, Isa::Avx2];
            }
            if super::fast_avx2::Avx2::detect().is_some() {
                return &[Isa::Avx2];
            }
        }
        &[]
    }
}

/// A brick, or a part of it.
#[derive(Clone, Copy)]
pub struct Piece<'a> {
    /// Shape of the payload.
    pub layout: Layout,
    /// The payload.
    pub payload: &'a [u8],
    /// The voxels wanted.
    pub region: Region,
    /// Where they start in the destination along x.
    pub x: u32,
}

/// Pieces to be decoded side by side: their regions have the same y and z. Lengths, regions and view have been checked.
pub struct Job<'a> {
    /// The pieces, all of one type and with the same parameters.
    pub pieces: &'a [Piece<'a>],
    /// Where they go.
    pub dst: ViewMut<'a>,
    /// How to write them.
    pub stores: Stores,
}

/// Decodes on the best instruction set of this machine. Gives the job back where there is none or it is too small.
pub fn decode(job: Job<'_>) -> Result<(), Job<'_>> {
    match Isa::available().first() {
        Some(&isa) if job.dst.extent.voxels() >= MIN_VOXELS => decode_on(isa, job),
        _ => Err(job),
    }
}

/// Decodes on `isa`. Gives the job back where the machine does not have it.
pub fn decode_on(isa: Isa, job: Job<'_>) -> Result<(), Job<'_>> {
    #[cfg(target_arch = "x86_64")]
    match isa {
        Isa::Avx512 => {
            if let Some(token) = super::fast_avx512::Avx512::detect() {
                super::fast_avx512::decode(token, job);
                return Ok(());
            }
        }
        Isa::Avx2 => {
            if let Some(token) = super::fast_avx2::Avx2::detect() {
                super::fast_avx2::decode(token, job);
                return Ok(());
            }
        }
    }
    let _ = isa;
    Err(job)
}

/// Decodes rows of one sample type and index width.
pub trait Kernel {
    /// Bytes of a sample.
    const BYTES: usize;
    /// Bits of an index.
    const I: usize;

    /// Reads the end points of a row of blocks, for the rows that follow. `false` where a pair needs the plain decoder.
    fn prepare(&mut self, blocks: &BlockRow<'_>) -> bool;

    /// Decodes rows of the blocks that were prepared last, in steps of [`STEP`] voxels from their first one: a row of
    /// samples is `STEP · BYTES` bytes per step, at most [`CHUNK`] voxels, its words are `STEP · I / 8` bytes per step.
    fn rows(&self, rows: Rows<'_>, stores: Stores);
}

/// At most [`CHUNK`] voxels of the rows of a piece.
#[derive(Clone, Copy)]
struct Strip<'a> {
    piece: Piece<'a>,
    /// First and one past the last voxel of the brick that is decoded; the first is a multiple of 64.
    x: [u32; 2],
    /// First voxel that is wanted.
    wanted: u32,
}

impl<'a> Piece<'a> {
    fn strips(&self) -> impl Iterator<Item = Strip<'a>> + use<'a> {
        let (piece, [x0, x1]) = (*self, [self.region.start[0], self.region.end[0]]);
        (x0 & !63..x1).step_by(CHUNK).map(move |x| Strip { piece, x: [x, x1.min(x + CHUNK as u32)], wanted: x0.max(x) })
    }
}

/// Walks over the rows of blocks of a job.
///
/// Pieces that lie side by side are decoded a few rows of each at a time: neighbouring cache lines of the destination are
/// then written soon after each other, which memory takes twice as fast as lone lines.
pub fn drive<K: Kernel>(new: impl Fn() -> K, mut job: Job<'_>) {
    let mut kernels: Vec<K> = Vec::new();
    let mut strips = job.pieces.iter().flat_map(Piece::strips);
    while let Some(first) = strips.next() {
        let mut group = [first; SIDE_BY_SIDE];
        let mut count = 1;
        while count < SIDE_BY_SIDE
            && let Some(strip) = strips.next()
        {
            group[count] = strip;
            count += 1;
        }
        while kernels.len() < count {
            kernels.push(new());
        }
        walk(&mut kernels, &group[..count], &mut job.dst, job.stores);
    }
}

fn walk<K: Kernel>(kernels: &mut [K], strips: &[Strip<'_>], dst: &mut ViewMut<'_>, stores: Stores) {
    let Piece { layout, region, .. } = strips[0].piece;
    let edge = layout.params().block();
    let [_, y0, z0] = region.start;
    let [_, y1, z1] = region.end;
    let mut fast = [true; SIDE_BY_SIDE];
    for bz in z0 / edge.z..z1.div_ceil(edge.z) {
        for by in y0 / edge.y..y1.div_ceil(edge.y) {
            for ((strip, kernel), fast) in strips.iter().zip(kernels.iter_mut()).zip(&mut fast) {
                let Strip { piece, x, .. } = strip;
                *fast = kernel.prepare(&BlockRow::new(&piece.layout, piece.payload, *x, [by, bz]));
            }
            let (y_end, z_end) = (y1.min((by + 1) * edge.y), z1.min((bz + 1) * edge.z));
            let ys = edge.y.min(ROWS_AT_A_TIME);
            let zs = ROWS_AT_A_TIME / ys;
            for z in (z0.max(bz * edge.z)..z_end).step_by(zs as usize) {
                for y in (y0.max(by * edge.y)..y_end).step_by(ys as usize) {
                    let rows = Region { start: [0, y, z], end: [0, y_end.min(y + ys), z_end.min(z + zs)] };
                    for ((strip, kernel), fast) in strips.iter().zip(kernels.iter()).zip(&fast) {
                        strip.rows(kernel, *fast, &rows, dst, stores);
                    }
                }
            }
        }
    }
}

impl Strip<'_> {
    /// Decodes rows of the brick into their places in the destination.
    fn rows<K: Kernel>(&self, kernel: &K, fast: bool, rows: &Region, dst: &mut ViewMut<'_>, stores: Stores) {
        let Strip { piece: Piece { layout, payload, region, x: out_x }, x: [x0, x1], wanted } = *self;
        let [_, y0, z0] = rows.start;
        let voxels = (x1 - x0) as usize;
        let words_at = layout.row_at(y0, z0) + 2 * (x0 / layout.indices_per_word()) as usize;
        let words = Grid2 {
            len: 2 * (x1 - x0).div_ceil(layout.indices_per_word()) as usize,
            pitch: [1, layout.brick().y as usize].map(|rows| rows * 2 * layout.row_words()),
        };
        let out_at = (y0 - region.start[1]) as usize * dst.row_pitch
            + (z0 - region.start[2]) as usize * dst.slice_pitch
            + (out_x + wanted - region.start[0]) as usize * K::BYTES;
        let out = Grid2 { len: (x1 - wanted) as usize * K::BYTES, pitch: [dst.row_pitch, dst.slice_pitch] };
        let count = [1, 2].map(|a| (rows.end[a] - rows.start[a]) as usize);
        let rows = Rows::new((&payload[words_at..], words), (&mut dst.bytes[out_at..], out), count);
        if fast && wanted == x0 && voxels % STEP == 0 {
            return kernel.rows(rows, stores);
        }
        // What does not start or end with a whole step goes through buffers.
        let (mut all_words, mut all_out) = ([0; CHUNK], [0; 4 * CHUNK]);
        let steps = voxels.div_ceil(STEP);
        let lens = [steps * STEP * K::I / 8, steps * STEP * K::BYTES].map(|len| Grid2 { len, pitch: [0; 2] });
        for (k, (words, out)) in rows.enumerate() {
            if fast {
                all_words[..words.len()].copy_from_slice(words);
                kernel.rows(Rows::new((&all_words, lens[0]), (&mut all_out, lens[1]), [1; 2]), Stores::Cached);
                out.copy_from_slice(&all_out[(wanted - x0) as usize * K::BYTES..voxels * K::BYTES]);
            } else {
                plain_row(&layout, payload, [wanted, y0 + (k % count[0]) as u32, z0 + (k / count[0]) as u32], out);
            }
        }
    }
}

/// A row of floats with end points that only the plain decoder treats right.
#[cold]
#[inline(never)]
fn plain_row(layout: &Layout, payload: &[u8], [x, y, z]: [u32; 3], out: &mut [u8]) {
    for (x, sample) in (x..).zip(out.chunks_exact_mut(4)) {
        let value: f32 = layout.voxel(payload, [x, y, z]);
        sample.copy_from_slice(&value.to_ne_bytes());
    }
}
