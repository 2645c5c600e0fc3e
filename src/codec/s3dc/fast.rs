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

    /// Decodes `out.len() / BYTES` voxels from the words that hold them, at most [`CHUNK`].
    fn row(&self, words: &[u8], out: &mut [u8], stores: Stores);
}

/// Walks over the rows of blocks of a job. Inlined into a function that has the instruction set of the kernel.
#[inline(always)]
pub fn drive<K: Kernel>(kernel: &mut K, job: Job<'_>) {
    let Job { layout, payload, region, dst, stores } = job;
    let block = layout.params().block();
    let [rx0, ry0, rz0] = region.start;
    let [rx1, ry1, rz1] = region.end;
    let mut x0 = rx0 & !63;
    while x0 < rx1 {
        let x1 = rx1.min(x0.saturating_add(CHUNK as u32));
        let wanted = rx0.max(x0);
        let skip = (wanted - x0) as usize * K::BYTES;
        let len = (x1 - x0) as usize * K::BYTES;
        let words_at = 2 * (x0 / layout.indices_per_word()) as usize;
        let words_len = 2 * (x1 - x0).div_ceil(layout.indices_per_word()) as usize;
        let mut z = rz0;
        while z < rz1 {
            let bz = z / block.z;
            let z_end = rz1.min((bz + 1) * block.z);
            let mut y = ry0;
            while y < ry1 {
                let by = y / block.y;
                let y_end = ry1.min((by + 1) * block.y);
                let fast = kernel.prepare(layout, payload, x0, (x1 - x0) as usize, [by, bz]);
                for z in z..z_end {
                    for y in y..y_end {
                        let words = &payload[layout.row_at(y, z) + words_at..][..words_len];
                        let at = (y - ry0) as usize * dst.row_pitch
                            + (z - rz0) as usize * dst.slice_pitch
                            + (wanted - rx0) as usize * K::BYTES;
                        let out = &mut dst.bytes[at..at + len - skip];
                        if !fast {
                            plain_row(layout, payload, [wanted, y, z], out);
                        } else if skip == 0 {
                            kernel.row(words, out, stores);
                        } else {
                            let mut buffer = [0; CHUNK * 4];
                            kernel.row(words, &mut buffer[..len], Stores::Cached);
                            out.copy_from_slice(&buffer[skip..len]);
                        }
                    }
                }
                y = y_end;
            }
            z = z_end;
        }
        x0 = x1;
    }
}

/// A row of floats with end points that only the plain decoder treats right.
#[cold]
#[inline(never)]
fn plain_row(layout: &Layout, payload: &[u8], [x, y, z]: [u32; 3], out: &mut [u8]) {
    for (x, sample) in (x..).zip(out.chunks_exact_mut(4)) {
        sample.copy_from_slice(&layout.voxel::<f32>(payload, [x, y, z]).to_ne_bytes());
    }
}
