//! Fast decoding, the part that is the same for every instruction set: which path to take, and the walk over a brick.
//!
//! Why it is fast: what a block's end points contribute is spread over the voxels of a row once per row of blocks
//! (`fast_tables`), then every row of that row of blocks is plain arithmetic on whole vectors, read and written in order.
//! The plain decoder is the judge: results are equal to the bit, for damaged payloads too.

use super::Layout;
use crate::codec::Stores;
use crate::geometry::Region;
use crate::grid::ViewMut;

/// Voxels that the tables of a kernel hold. Longer rows are decoded in pieces of this length.
pub const CHUNK: usize = 256;
/// Voxels that a kernel decodes at a time. What is left of a row goes through a small buffer.
pub const STEP: usize = 32;
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
            if super::fast_avx2::Avx2::detect().is_some() {
                return &[Isa::Avx2];
            }
        }
        &[]
    }
}

/// One brick, or part of it, to be decoded. Lengths, region and view have been checked.
pub struct Job<'a> {
    /// Shape of the payload.
    pub layout: &'a Layout,
    /// The payload.
    pub payload: &'a [u8],
    /// The voxels wanted.
    pub region: &'a Region,
    /// Where they go.
    pub dst: ViewMut<'a>,
    /// How to write them.
    pub stores: Stores,
}

/// Decodes on the best instruction set of this machine. Gives the job back where there is none or it is too small.
pub fn decode(job: Job<'_>) -> Result<(), Job<'_>> {
    match Isa::available().first() {
        Some(&isa) if job.region.extent().voxels() >= MIN_VOXELS => decode_on(isa, job),
        _ => Err(job),
    }
}

/// Decodes on `isa`. Gives the job back where the machine does not have it.
pub fn decode_on(isa: Isa, job: Job<'_>) -> Result<(), Job<'_>> {
    #[cfg(target_arch = "x86_64")]
    match isa {
        Isa::Avx2 | Isa::Avx512 => {
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

    /// Reads the end points of the blocks `(by, bz)` that cover `voxels` voxels from `x0`, a multiple of 64.
    /// `false` where a pair needs the plain decoder.
    fn prepare(&mut self, layout: &Layout, payload: &[u8], x0: u32, voxels: usize, block_yz: [u32; 2]) -> bool;

    /// Decodes rows of the blocks that were prepared last.
    fn rows(&self, rows: Rows<'_>);
}

/// Rows (y, z) of one row of blocks: the same part of each, at most [`CHUNK`] voxels.
pub struct Rows<'a> {
    /// Words, from those of the first row.
    pub words: &'a [u8],
    /// Bytes of words of one row, and from one row and slice to the next.
    pub words_len: usize,
    /// See `words_len`.
    pub words_pitch: [usize; 2],
    /// Samples, from those of the first row.
    pub out: &'a mut [u8],
    /// Bytes of samples of one row, and from one row and slice to the next.
    pub out_len: usize,
    /// See `out_len`.
    pub out_pitch: [usize; 2],
    /// Rows along y and z.
    pub count: [usize; 2],
    /// How to write them.
    pub stores: Stores,
}

impl Rows<'_> {
    /// Calls `row(words, out)` for every row.
    #[inline(always)]
    pub fn for_each(self, mut row: impl FnMut(&[u8], &mut [u8])) {
        for z in 0..self.count[1] {
            for y in 0..self.count[0] {
                let words = &self.words[y * self.words_pitch[0] + z * self.words_pitch[1]..][..self.words_len];
                let out = &mut self.out[y * self.out_pitch[0] + z * self.out_pitch[1]..][..self.out_len];
                row(words, out);
            }
        }
    }
}

/// Walks over the rows of blocks of a job. Inlined into a function that has the instruction set of the kernel.
#[inline(always)]
pub fn drive<K: Kernel>(kernel: &mut K, job: Job<'_>) {
    let Job { layout, payload, region, dst, stores } = job;
    let edge = layout.params().block();
    let row_bytes = layout.row_words() * 2;
    let words_pitch = [row_bytes, row_bytes * layout.brick().y as usize];
    let out_pitch = [dst.row_pitch, dst.slice_pitch];
    let [rx0, ry0, rz0] = region.start;
    let [rx1, ry1, rz1] = region.end;
    for x0 in (rx0 & !63..rx1).step_by(CHUNK) {
        let x1 = rx1.min(x0.saturating_add(CHUNK as u32));
        let wanted = rx0.max(x0);
        let skip = (wanted - x0) as usize * K::BYTES;
        let out_len = (x1 - x0) as usize * K::BYTES;
        let words_at = 2 * (x0 / layout.indices_per_word()) as usize;
        let words_len = 2 * (x1 - x0).div_ceil(layout.indices_per_word()) as usize;
        for bz in rz0 / edge.z..rz1.div_ceil(edge.z) {
            let z = rz0.max(bz * edge.z)..rz1.min((bz + 1) * edge.z);
            for by in ry0 / edge.y..ry1.div_ceil(edge.y) {
                let y = ry0.max(by * edge.y)..ry1.min((by + 1) * edge.y);
                let fast = kernel.prepare(layout, payload, x0, (x1 - x0) as usize, [by, bz]);
                let words = &payload[layout.row_at(y.start, z.start) + words_at..];
                let at = (y.start - ry0) as usize * out_pitch[0] + (z.start - rz0) as usize * out_pitch[1];
                let out = &mut dst.bytes[at + (wanted - rx0) as usize * K::BYTES..];
                let count = [y.len(), z.len()];
                let rows =
                    Rows { words, words_len, words_pitch, out, out_len: out_len - skip, out_pitch, count, stores };
                if !fast {
                    plain_rows(layout, payload, [wanted, y.start, z.start], rows);
                } else if skip == 0 {
                    kernel.rows(rows);
                } else {
                    rows.for_each(|words, out| {
                        let buffer = &mut [0; CHUNK * 4];
                        let (out_pitch, count, stores) = ([0; 2], [1; 2], Stores::Cached);
                        kernel.rows(Rows {
                            words,
                            words_len,
                            words_pitch,
                            out: buffer,
                            out_len,
                            out_pitch,
                            count,
                            stores,
                        });
                        out.copy_from_slice(&buffer[skip..out_len]);
                    });
                }
            }
        }
    }
}

/// Rows of floats with end points that only the plain decoder treats right.
#[cold]
#[inline(never)]
fn plain_rows(layout: &Layout, payload: &[u8], [x, y, z]: [u32; 3], rows: Rows<'_>) {
    let per_slice = rows.count[0] as u32;
    let mut k = 0;
    rows.for_each(|_, out| {
        for (x, sample) in (x..).zip(out.chunks_exact_mut(4)) {
            let value: f32 = layout.voxel(payload, [x, y + k % per_slice, z + k / per_slice]);
            sample.copy_from_slice(&value.to_ne_bytes());
        }
        k += 1;
    });
}
