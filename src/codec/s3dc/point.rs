//! Single voxels in O(1): where their two words lie, asking memory for them ahead, and reading them (S3Dc §3.2).

use super::{Layout, Scalar};
use crate::codec::prefetch::prefetch;
use crate::geometry::Coord;

/// Where a voxel's end points and index lie, in bytes from where a payload's offset counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Point {
    mmv: usize,
    iv: usize,
    shift: u32,
}

impl Point {
    /// Asks memory for the words of a voxel of `bytes`, without waiting for them. Does nothing where the machine has no
    /// such thing.
    #[inline]
    pub fn prefetch(self, bytes: &[u8]) {
        prefetch(bytes, self.mmv);
        prefetch(bytes, self.iv);
    }
}

impl Layout {
    /// Where voxel `c` of the brick lies; `c` must be inside the brick, whose payload starts at byte `offset`.
    #[inline(always)]
    #[must_use]
    pub fn point(&self, c: Coord, offset: usize) -> Point {
        // In 32 bits: a payload has at most 64 MiB.
        let [bx, by, bz] = self.block_of(c);
        let block = bx + self.blocks.x * (by + self.blocks.y * bz);
        let row = c[1] + self.brick.y * c[2];
        let word = row * self.row_words as u32 + (c[0] >> self.n_log2);
        let in_word = c[0] & ((1 << self.n_log2) - 1);
        Point {
            mmv: offset + (block * 2 * self.sample_type.bytes() as u32) as usize,
            iv: offset + self.iv_start + 2 * word as usize,
            shift: in_word << (4 - self.n_log2),
        }
    }

    /// The same layout for blocks of 2^n and bricks of whole blocks, in shifts; `None` for all others.
    #[must_use]
    pub fn power(&self) -> Option<PowerLayout> {
        let (block, brick) = (self.params().block().to_array(), self.brick.to_array());
        let fits = (0..3).all(|a| block[a].is_power_of_two() && brick[a].is_power_of_two() && block[a] <= brick[a]);
        let log2 = |v: u32| v.trailing_zeros();
        fits.then(|| PowerLayout {
            block_log2: block.map(log2),
            blocks_log2: [log2(self.blocks.x), log2(self.blocks.x) + log2(self.blocks.y)],
            rows_log2: log2(self.brick.y),
            row_bytes_log2: log2(2 * self.row_words as u32),
            pair_log2: log2(2 * self.sample_type.bytes() as u32),
            n_log2: self.n_log2,
            iv_start: self.iv_start,
        })
    }
}

/// A [`Layout`] all of whose numbers are powers of two.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PowerLayout {
    block_log2: [u32; 3],
    blocks_log2: [u32; 2],
    rows_log2: u32,
    row_bytes_log2: u32,
    pair_log2: u32,
    n_log2: u32,
    iv_start: usize,
}

impl PowerLayout {
    /// The layout of the default parameters: bricks of 64³, blocks of 4³, 4 bits; samples of `sample_bytes`.
    ///
    /// As a constant it turns every shift of [`PowerLayout::point`] into one by a known number.
    #[must_use]
    pub const fn usual(sample_bytes: usize) -> PowerLayout {
        PowerLayout {
            block_log2: [2; 3],
            blocks_log2: [4, 8],
            rows_log2: 6,
            row_bytes_log2: 5,
            pair_log2: 1 + sample_bytes.trailing_zeros(),
            n_log2: 2,
            iv_start: 16 * 16 * 16 * 2 * sample_bytes,
        }
    }

    /// Indices per word.
    #[inline(always)]
    #[must_use]
    pub const fn indices_per_word(&self) -> u32 {
        1 << self.n_log2
    }

    /// As [`Layout::point`].
    #[inline(always)]
    #[must_use]
    pub fn point(&self, [x, y, z]: Coord, offset: usize) -> Point {
        let [bx, by, bz] = [x >> self.block_log2[0], y >> self.block_log2[1], z >> self.block_log2[2]];
        let block = bx + (by << self.blocks_log2[0]) + (bz << self.blocks_log2[1]);
        let row = (z << self.rows_log2) + y;
        Point {
            mmv: offset + ((block << self.pair_log2) as usize),
            iv: offset + self.iv_start + ((row << self.row_bytes_log2) + (x >> self.n_log2 << 1)) as usize,
            shift: (x & ((1 << self.n_log2) - 1)) << (4 - self.n_log2),
        }
    }
}

impl Point {
    /// The voxel that lies here in `bytes`, where a word holds `n` indices.
    ///
    /// # Panics
    /// Where `bytes` end before the payload does.
    #[inline(always)]
    #[must_use]
    pub fn read<T: Scalar>(self, bytes: &[u8], n: u32) -> T {
        let pair = &bytes[self.mmv..self.mmv + 2 * T::BYTES];
        let (min, max) = (T::from_le(pair).stored(), T::from_le(&pair[T::BYTES..]).stored());
        let word = &bytes[self.iv..self.iv + 2];
        let word = u32::from(u16::from_le_bytes([word[0], word[1]])) >> self.shift;
        // With the number of bits known to the compiler, the division by q is a multiplication.
        match n {
            4 => T::reconstruct(min, max, word & 15, 15),
            2 => T::reconstruct(min, max, word & 255, 255),
            8 => T::reconstruct(min, max, word & 3, 3),
            _ => T::reconstruct(min, max, word & 1, 1),
        }
    }
}

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
                let shifted: Vec<u8> = (0..layout.payload_len() + 3).map(|i| (i * 31 % 251) as u8).collect();
                for c in (0..20).flat_map(|z| (0..18).flat_map(move |y| (0..37).map(move |x| [x, y, z]))) {
                    let point = layout.point(c, 3);
                    point.prefetch(&shifted);
                    let n = layout.indices_per_word();
                    assert_eq!(point.read::<u16>(&shifted, n), layout.voxel::<u16>(&shifted[3..], c));
                }
            }
        }
    }

    #[test]
    fn shifts_give_the_same_points() {
        for bits in [1, 2, 4, 8] {
            for block in [Extent::cube(4), Extent::new(1, 16, 2)] {
                let params = Params::new(bits, block, Endpoints::MinMax).unwrap();
                let layout = Layout::new(&params, SampleType::F32, Extent::cube(16));
                let power = layout.power().unwrap();
                assert_eq!(power.indices_per_word(), layout.indices_per_word());
                for c in (0..16).flat_map(|z| (0..16).flat_map(move |y| (0..16).map(move |x| [x, y, z]))) {
                    assert_eq!(power.point(c, 77), layout.point(c, 77));
                }
            }
        }
        for t in [SampleType::U8, SampleType::U16, SampleType::F32] {
            let params = Params::new(4, Extent::cube(4), Endpoints::MinMax).unwrap();
            let layout = Layout::new(&params, t, Extent::cube(64));
            assert_eq!(layout.power().unwrap(), PowerLayout::usual(t.bytes()));
        }
        let params = Params::new(4, Extent::cube(3), Endpoints::MinMax).unwrap();
        assert!(Layout::new(&params, SampleType::F32, Extent::cube(16)).power().is_none());
    }
}
