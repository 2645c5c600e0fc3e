//! Single voxels in O(1): where their two words lie, asking memory for them ahead, and reading them (S3Dc §3.2).

use super::{Layout, Scalar};
use crate::geometry::Coord;

/// Where a voxel's end points and index lie in a payload, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Point {
    mmv: u32,
    iv: u32,
    shift: u8,
}

impl Layout {
    /// Where voxel `c` of the brick lies; `c` must be inside the brick.
    #[inline]
    #[must_use]
    pub fn point(&self, c: Coord) -> Point {
        let [bx, by, bz] = self.block_of(c);
        let block = bx + self.blocks.x * (by + self.blocks.y * bz);
        let row = c[1] + self.brick.y * c[2];
        let in_word = c[0] & ((1 << self.n_log2) - 1);
        // A payload has at most 64 MiB, so that all of this fits in 32 bits.
        Point {
            mmv: block * 2 * self.sample_type.bytes() as u32,
            iv: self.iv_start as u32 + 2 * (row * self.row_words as u32 + (c[0] >> self.n_log2)),
            shift: (in_word << (4 - self.n_log2)) as u8,
        }
    }

    /// Asks memory for the words of a voxel, without waiting for them. Does nothing where the machine has no such thing.
    #[inline]
    pub fn prefetch(payload: &[u8], point: Point) {
        prefetch(payload, point.mmv as usize);
        prefetch(payload, point.iv as usize);
    }

    /// The voxel at `point`, which [`Layout::point`] of the same layout has given.
    ///
    /// # Panics
    /// Where the payload is shorter than [`Layout::payload_len`].
    #[inline]
    #[must_use]
    pub fn read<T: Scalar>(&self, payload: &[u8], point: Point) -> T {
        let pair = &payload[point.mmv as usize..][..2 * T::BYTES];
        let (min, max) = (T::from_le(pair).stored(), T::from_le(&pair[T::BYTES..]).stored());
        let word = &payload[point.iv as usize..][..2];
        let word = u32::from(u16::from_le_bytes([word[0], word[1]])) >> point.shift;
        // With the number of bits known to the compiler, the division by q is a multiplication.
        match self.n_log2 {
            1 => T::reconstruct(min, max, word & 255, 255),
            2 => T::reconstruct(min, max, word & 15, 15),
            3 => T::reconstruct(min, max, word & 3, 3),
            _ => T::reconstruct(min, max, word & 1, 1),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[inline]
#[allow(unsafe_code, reason = "the intrinsic takes a pointer; it never reads through it")]
fn prefetch(bytes: &[u8], at: usize) {
    use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
    // SAFETY: a prefetch is a hint: it reads nothing, and an address outside of the slice does no harm.
    unsafe { _mm_prefetch::<_MM_HINT_T0>(bytes.as_ptr().wrapping_add(at).cast()) }
}

#[cfg(not(target_arch = "x86_64"))]
#[inline]
fn prefetch(_: &[u8], _: usize) {}

#[cfg(test)]
mod tests {
    use super::super::{Endpoints, Params};
    use super::*;
    use crate::geometry::Extent;
    use crate::voxel::SampleType;

    #[test] // S-38: a voxel is one pair and one word, the same as the plain path finds
    fn points_are_the_plain_places() {
        for bits in [1, 2, 4, 8] {
            for block in [Extent::cube(4), Extent::new(5, 3, 7), Extent::new(1, 128, 2)] {
                let params = Params::new(bits, block, Endpoints::MinMax).unwrap();
                let layout = Layout::new(&params, SampleType::U16, Extent::new(37, 18, 20));
                let payload: Vec<u8> = (0..layout.payload_len()).map(|i| (i * 31 % 251) as u8).collect();
                for c in (0..20).flat_map(|z| (0..18).flat_map(move |y| (0..37).map(move |x| [x, y, z]))) {
                    let point = layout.point(c);
                    assert_eq!(layout.read::<u16>(&payload, point), layout.voxel::<u16>(&payload, c));
                    Layout::prefetch(&payload, point);
                }
            }
        }
    }
}
