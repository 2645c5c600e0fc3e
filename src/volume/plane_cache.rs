//! A cache of 4×4 planes for voxels that are read along cutting planes (spec chapter 14, §9; §4.2 of the paper).

use super::open::Volume;
use super::voxels::Sampler;
use super::{At, Axis};
use crate::error::Result;
use crate::geometry::Coord;
use crate::voxel::Sample;

/// Planes that may lie in each set.
const WAYS: usize = 4;
/// Planes that a cache holds unless told otherwise.
const PLANES: usize = 1024;
/// Most planes: what is more would not be a small cache.
const MAX_PLANES: usize = 1 << 20;
/// Tag of a place that holds nothing: no voxel has this coordinate.
const NONE: Coord = [u32::MAX; 3];

/// A plane of a cell.
#[derive(Clone, Copy)]
struct Block<T> {
    /// Cell along the two axes of the plane, voxel along the third.
    tag: Coord,
    /// When it was used last.
    used: u64,
    voxels: [T; 16],
}

/// Reads single voxels of one level through a small cache of planes of 4×4 voxels (§4.2 of the paper: "a small set of
/// cache blocks").
///
/// A voxel that is not there brings the plane of its cell that lies across the axis chosen: 36 coefficients and 60 to 100
/// vector operations for 16 voxels of a zerobit level, rather than 15 and 14 for one. It can pay where
/// planes across that axis are read row by row; for cutting planes of any orientation a plain [`Sampler`] is faster (bench
/// `zerobit`). Right for every codec, but of use for zerobit only. The least recently used of
/// four planes makes room; nothing is allocated after [`Volume::plane_sampler`].
pub struct PlaneSampler<'a, T> {
    sampler: Sampler<'a, T>,
    axis: usize,
    blocks: Vec<Block<T>>,
    /// log2 of the number of sets.
    sets_log2: u32,
    /// Where the plane lies that was read last.
    last: usize,
    reads: u64,
    misses: u64,
}

impl Volume {
    /// A reader of single voxels (x, y, z) of one level that keeps 1,024 planes of 4×4 voxels across `axis`.
    ///
    /// # Errors
    /// As [`Volume::sampler`].
    pub fn plane_sampler<T: Sample>(&self, at: At, axis: Axis) -> Result<PlaneSampler<'_, T>> {
        Ok(PlaneSampler::new(self.sampler(at)?, axis, PLANES))
    }
}

impl<'a, T: Sample> PlaneSampler<'a, T> {
    /// Reads through `sampler`, keeping about `planes` planes across `axis`: a power of two from 4 to 2^20.
    #[must_use]
    pub fn new(sampler: Sampler<'a, T>, axis: Axis, planes: usize) -> Self {
        let planes = planes.clamp(WAYS, MAX_PLANES).next_power_of_two();
        let empty = Block { tag: NONE, used: 0, voxels: [T::zeroed(); 16] };
        PlaneSampler {
            sampler,
            axis: axis as usize,
            blocks: vec![empty; planes],
            sets_log2: (planes / WAYS).trailing_zeros(),
            last: 0,
            reads: 0,
            misses: 0,
        }
    }

    /// Reads the voxel at `c` (x, y, z): what [`Sampler::get`] reads.
    ///
    /// # Errors
    /// As [`Volume::voxel`]; a plane that fails is not kept.
    #[inline]
    pub fn get(&mut self, c: Coord) -> Result<T> {
        let (u, v) = match self.axis {
            0 => (1, 2),
            1 => (0, 2),
            _ => (0, 1),
        };
        let place = ((c[u] & 3) + 4 * (c[v] & 3)) as usize;
        let mut tag = c;
        (tag[u], tag[v]) = (c[u] >> 2, c[v] >> 2);
        self.reads += 1;
        if self.blocks[self.last].tag != tag {
            let set = self.set_of(tag);
            match (set..set + WAYS).find(|&b| self.blocks[b].tag == tag) {
                Some(block) => self.last = block,
                None => return self.fetch(c, tag, set, place),
            }
        }
        // A plane at the border has places outside the volume, whose coordinates are errors.
        if !self.sampler.contains(c) {
            return self.sampler.get(c);
        }
        let block = &mut self.blocks[self.last];
        block.used = self.reads;
        Ok(block.voxels[place])
    }

    /// First place of the set of a tag.
    #[inline(always)]
    fn set_of(&self, tag: Coord) -> usize {
        // Neighbours in a plane and planes one behind the other get sets far apart.
        let mixed =
            tag[0].wrapping_mul(0x9E37_79B1) ^ tag[1].wrapping_mul(0x85EB_CA77) ^ tag[2].wrapping_mul(0xC2B2_AE3D);
        let mixed = mixed.wrapping_mul(0x27D4_EB2F);
        // Two shifts, since there may be one set alone.
        (mixed >> 1 >> (31 - self.sets_log2)) as usize * WAYS
    }

    #[inline(never)]
    fn fetch(&mut self, c: Coord, tag: Coord, set: usize, place: usize) -> Result<T> {
        let mut voxels = [T::zeroed(); 16];
        self.misses += 1;
        self.sampler.plane(self.axis(), c, &mut voxels)?;
        if let Some(oldest) = (set..set + WAYS).min_by_key(|&b| self.blocks[b].used) {
            self.blocks[oldest] = Block { tag, used: self.reads, voxels };
            self.last = oldest;
        }
        Ok(voxels[place])
    }

    /// The axis that planes lie across.
    #[must_use]
    pub const fn axis(&self) -> Axis {
        match self.axis {
            0 => Axis::X,
            1 => Axis::Y,
            _ => Axis::Z,
        }
    }

    /// Planes that the cache can hold.
    #[must_use]
    pub fn capacity(&self) -> usize {
        self.blocks.len()
    }

    /// Voxels that were there already.
    #[must_use]
    pub const fn hits(&self) -> u64 {
        self.reads - self.misses
    }

    /// Voxels whose planes had to be decoded.
    #[must_use]
    pub const fn misses(&self) -> u64 {
        self.misses
    }

    /// Forgets all planes and counts.
    pub fn clear(&mut self) {
        self.blocks.iter_mut().for_each(|block| (block.tag, block.used) = (NONE, 0));
        (self.reads, self.misses) = (0, 0);
    }
}
