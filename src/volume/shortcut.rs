//! The shortest way to a voxel: whole bricks of one S3Dc layout with blocks of 2^n, by a table of payload offsets.

use super::codecs::CodecTable;
use super::open::Volume;
use crate::codec::s3dc;
use crate::geometry::{Coord, Extent};
use crate::voxel::Sample;
use std::cell::Cell;

/// Bricks that a table is made for at most: 512 KiB of it.
const MAX_BRICKS: u64 = 1 << 16;

/// log2 of the edge of the usual brick.
const USUAL_BRICK: u32 = 6;

/// Offsets of payloads by brick, filled as they become known. Empty where the level does not lend itself to it.
#[derive(Default)]
pub(super) struct Shortcut {
    /// Voxels that lie in whole bricks; none, where there is no table.
    whole: [u32; 3],
    /// Bricks along x and y.
    bricks: [u32; 2],
    brick_log2: u32,
    /// Number of the layout of whole bricks.
    index: usize,
    layout: s3dc::PowerLayout,
    /// Whether bricks and layout are the usual ones.
    usual: bool,
    /// Offset of each brick's payload in the file; 0 is not known.
    offsets: Vec<Cell<usize>>,
}

impl Shortcut {
    pub(super) fn new(volume: &Volume, lod: u8) -> Shortcut {
        let level = &volume.head().octree.levels[usize::from(lod)];
        let brick_log2 = u32::from(volume.info().brick_log2);
        let in_memory = volume.source.as_slice().is_some();
        if !in_memory || volume.info().codecs.len() != 1 || level.bricks.voxels() > MAX_BRICKS {
            return Shortcut::default();
        }
        let Ok(entry) = volume.codecs.get(0) else { return Shortcut::default() };
        let index = CodecTable::whole_layout(entry, lod);
        let layout = volume.codecs.layout(index);
        let Some(power) = layout.s3dc.as_ref().and_then(s3dc::Layout::power) else { return Shortcut::default() };
        if layout.extent != Extent::cube(1 << brick_log2) {
            return Shortcut::default();
        }
        Shortcut {
            whole: level.extent.to_array().map(|v| v >> brick_log2 << brick_log2),
            bricks: [level.bricks.x, level.bricks.y],
            brick_log2,
            index,
            layout: power,
            usual: brick_log2 == USUAL_BRICK && power == s3dc::PowerLayout::usual(volume.info().sample_type.bytes()),
            offsets: vec![Cell::new(0); level.bricks.voxels() as usize],
        }
    }

    #[inline(always)]
    fn brick(&self, c: Coord, brick_log2: u32) -> usize {
        let [x, y, z] = c.map(|v| v >> brick_log2);
        (x + self.bricks[0] * (y + self.bricks[1] * z)) as usize
    }

    /// Indices per word, and where the voxel lies, if its brick is known.
    #[inline(always)]
    pub(super) fn point<T: Sample>(&self, c: Coord) -> Option<(u32, s3dc::Point)> {
        if self.usual { self.usual_point::<T>(c) } else { self.point_in(c, self.brick_log2, self.layout) }
    }

    /// [`Shortcut::point`] where bricks and layout are the usual ones, else `None`.
    #[inline(always)]
    pub(super) fn usual_point<T: Sample>(&self, c: Coord) -> Option<(u32, s3dc::Point)> {
        if !self.usual {
            return None;
        }
        self.point_in(c, USUAL_BRICK, const { s3dc::PowerLayout::usual(T::TYPE.bytes()) })
    }

    #[inline(always)]
    fn point_in(&self, c: Coord, brick_log2: u32, layout: s3dc::PowerLayout) -> Option<(u32, s3dc::Point)> {
        if (c[0] >= self.whole[0]) | (c[1] >= self.whole[1]) | (c[2] >= self.whole[2]) {
            return None;
        }
        let offset = self.offsets.get(self.brick(c, brick_log2))?.get();
        if offset == 0 {
            return None;
        }
        let mask = (1 << brick_log2) - 1;
        Some((layout.indices_per_word(), layout.point(c.map(|v| v & mask), offset)))
    }

    /// Notes where the payload of the brick of voxel `c` lies, which has layout `index`.
    pub(super) fn learn(&self, c: Coord, index: usize, offset: usize) {
        let whole = (0..3).all(|a| c[a] < self.whole[a]);
        if let Some(slot) = self.offsets.get(self.brick(c, self.brick_log2)).filter(|_| whole && index == self.index) {
            slot.set(offset);
        }
    }
}
