//! Where the end points and index words of a brick lie, and single voxels in O(1) (spec chapter 8, §2 and §3).
//!
//! ```text
//! payload = MMV pairs, x fastest over the blocks | zeros to a multiple of 256 | IV rows, y then z
//! IV row  = ceil(Ex / n) little-endian u16 words, n = 16 / i_bits; voxel x: bits [i·(x mod n), +i) of word x / n
//! ```

use super::{Params, Scalar, with_scalar};
use crate::geometry::{Coord, Extent};
use crate::voxel::{Sample, SampleType, SampleValue};

/// The IV starts at a multiple of this many bytes from the start of the payload.
pub const IV_ALIGN: usize = 256;

/// Everything about the shape of a payload, worked out once per parameters, sample type and brick extent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    params: Params,
    pub(super) sample_type: SampleType,
    pub(super) brick: Extent,
    pub(super) blocks: Extent,
    /// `ceil(2^32 / block edge)`: dividing a coordinate by the edge is one multiplication, exact below 2^25.
    magic: [u64; 3],
    pub(super) iv_start: usize,
    pub(super) row_words: usize,
    /// log2 of the indices in a word.
    pub(super) n_log2: u32,
}

impl Layout {
    /// The layout of a brick. `brick` is the extent that is really stored: partial at the end of a volume.
    #[must_use]
    pub fn new(params: &Params, sample_type: SampleType, brick: Extent) -> Layout {
        let block = params.block();
        let blocks = brick.div_ceil(block);
        let mmv_bytes = blocks.voxels() as usize * 2 * sample_type.bytes();
        let n_log2 = 4 - u32::from(params.i_bits()).trailing_zeros();
        Layout {
            params: *params,
            sample_type,
            brick,
            blocks,
            magic: block.to_array().map(|b| (1u64 << 32).div_ceil(u64::from(b))),
            iv_start: mmv_bytes.next_multiple_of(IV_ALIGN), // spec: S3D-8
            row_words: brick.x.div_ceil(1 << n_log2) as usize,
            n_log2,
        }
    }

    /// The parameters.
    #[must_use]
    pub const fn params(&self) -> &Params {
        &self.params
    }

    /// Type of a sample.
    #[must_use]
    pub const fn sample_type(&self) -> SampleType {
        self.sample_type
    }

    /// Voxels of the brick, per axis.
    #[must_use]
    pub const fn brick(&self) -> Extent {
        self.brick
    }

    /// Blocks of the brick, per axis; the last ones may be partial.
    #[must_use]
    pub const fn blocks(&self) -> Extent {
        self.blocks
    }

    /// Bytes of the end points, without the padding that follows.
    #[must_use]
    pub fn mmv_bytes(&self) -> usize {
        self.blocks.voxels() as usize * 2 * self.sample_type.bytes()
    }

    /// Where the index words start.
    #[must_use]
    pub const fn iv_start(&self) -> usize {
        self.iv_start
    }

    /// 16-bit words of one row of indices.
    #[must_use]
    pub const fn row_words(&self) -> usize {
        self.row_words
    }

    /// Indices in a word: 16, 8, 4 or 2.
    #[must_use]
    pub const fn indices_per_word(&self) -> u32 {
        1 << self.n_log2
    }

    /// Length of the payload in bytes. // spec: S3D-5
    #[must_use]
    pub const fn payload_len(&self) -> usize {
        self.iv_start + self.row_words * 2 * self.brick.y as usize * self.brick.z as usize
    }

    /// Block that holds voxel `c`. // spec: S3D-7
    #[inline]
    #[must_use]
    pub fn block_of(&self, c: Coord) -> Coord {
        std::array::from_fn(|a| ((u64::from(c[a]) * self.magic[a]) >> 32) as u32)
    }

    /// Where the end points of a block lie in the payload. // spec: S3D-18
    #[inline]
    #[must_use]
    pub fn mmv_at(&self, block: Coord) -> usize {
        let [x, y, z] = block.map(|v| v as usize);
        let linear = x + self.blocks.x as usize * (y + self.blocks.y as usize * z);
        linear * 2 * self.sample_type.bytes()
    }

    /// Where row (y, z) of the indices lies in the payload.
    #[inline]
    #[must_use]
    pub const fn row_at(&self, y: u32, z: u32) -> usize {
        self.iv_start + (y as usize + self.brick.y as usize * z as usize) * self.row_words * 2
    }

    /// The stored end points (min, max) of a block.
    ///
    /// # Panics
    /// Where the payload is shorter than [`Layout::payload_len`] or the block lies outside the brick.
    #[inline]
    #[must_use]
    pub fn mmv_pair<T: Scalar>(&self, payload: &[u8], block: Coord) -> (T, T) {
        let at = self.mmv_at(block);
        let pair = &payload[at..at + 2 * T::BYTES];
        (T::from_le(pair).stored(), T::from_le(&pair[T::BYTES..]).stored())
    }

    /// The index of voxel `c`. // spec: S3D-9
    #[inline]
    #[must_use]
    pub fn index_at(&self, payload: &[u8], c: Coord) -> u32 {
        let at = self.row_at(c[1], c[2]) + 2 * (c[0] >> self.n_log2) as usize;
        let word = u32::from(u16::from_le_bytes([payload[at], payload[at + 1]]));
        let shift = (c[0] & ((1 << self.n_log2) - 1)) * u32::from(self.params.i_bits());
        word >> shift & self.params.q()
    }

    /// Decodes voxel `c`: one pair of end points, one word.
    ///
    /// # Panics
    /// Where the payload is shorter than [`Layout::payload_len`], or `c` lies outside the brick so far that its bytes do.
    #[inline]
    #[must_use]
    pub fn voxel<T: Scalar>(&self, payload: &[u8], c: Coord) -> T {
        let (min, max) = self.mmv_pair::<T>(payload, self.block_of(c));
        T::reconstruct(min, max, self.index_at(payload, c), self.params.q())
    }

    /// Decodes voxel `c` as a value of the brick's own type.
    ///
    /// # Panics
    /// As [`Layout::voxel`].
    #[must_use]
    pub fn value(&self, payload: &[u8], c: Coord) -> SampleValue {
        with_scalar!(self.sample_type, T => self.voxel::<T>(payload, c).value(), else SampleValue::Rgb8([0; 3]))
    }

    /// Calls `visit` with every block whose end points overlap the closed interval `[lo, hi]`, and with the end points;
    /// reads no index. Returns how many blocks there were.
    ///
    /// The paper's segmentation by rejection (§5.2). With fitted end points the interval is that of the decoded samples.
    ///
    /// # Panics
    /// Where the payload is shorter than [`Layout::payload_len`].
    pub fn blocks_overlapping<T: Scalar>(
        &self,
        payload: &[u8],
        lo: f64,
        hi: f64,
        mut visit: impl FnMut(Coord, T, T),
    ) -> u64 {
        let mut found = 0;
        for z in 0..self.blocks.z {
            for y in 0..self.blocks.y {
                for x in 0..self.blocks.x {
                    let (min, max) = self.mmv_pair::<T>(payload, [x, y, z]);
                    // An out-of-order pair decodes to min: its upper bound is min. // spec: S3D-12
                    let top = if max > min { max } else { min };
                    if min.component(0) <= hi && top.component(0) >= lo {
                        found += 1;
                        visit([x, y, z], min, top);
                    }
                }
            }
        }
        found
    }
}
