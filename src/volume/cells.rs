//! Bricks of zerobit levels, ready for single voxels, planes and cells: found once, then looked up by their place.

use super::bricks::Payload;
use super::codecs::Entry;
use super::open::Volume;
use crate::codec::Codec;
use crate::codec::zerobit::{BrickFrame, BrickReader};
use crate::container::NodeKind;
use crate::error::Result;
use crate::geometry::Coord;
use std::cell::{Cell, OnceCell};

/// Bricks that a table is made for at most.
const MAX_BRICKS: u64 = 1 << 16;

/// Bricks by their place, filled as they become known. Empty where the level does not lend itself to it.
#[derive(Default)]
pub(super) struct Cells<'a> {
    /// Voxels of the level; none, where there is no table.
    extent: [u32; 3],
    /// Bricks along x and y.
    bricks: [u32; 2],
    brick_log2: u32,
    known: Vec<OnceCell<Brick<'a>>>,
    /// Bytes of copies that may still be kept.
    budget: Cell<u64>,
}

/// A stored brick.
struct Brick<'a> {
    frame: BrickFrame<'a>,
    payload: Payload<'a>,
}

impl<'a> Cells<'a> {
    pub(super) fn new(volume: &'a Volume, lod: u8) -> Cells<'a> {
        let level = &volume.head().octree.levels[usize::from(lod)];
        let zerobit = |i: usize| volume.codecs.get(i as u8).is_ok_and(|e| matches!(e.codec(), Codec::Zerobit(_)));
        if level.bricks.voxels() > MAX_BRICKS || !(0..volume.info().codecs.len()).any(zerobit) {
            return Cells::default();
        }
        Cells {
            extent: level.extent.to_array(),
            bricks: [level.bricks.x, level.bricks.y],
            brick_log2: u32::from(volume.info().brick_log2),
            known: (0..level.bricks.voxels()).map(|_| OnceCell::new()).collect(),
            budget: Cell::new(volume.limits.cache_bytes),
        }
    }

    /// Whether there is a table at all.
    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        self.known.is_empty()
    }

    /// Number of the brick that holds `c`, if there is such a voxel.
    #[inline(always)]
    fn index(&self, c: Coord) -> Option<usize> {
        if (c[0] >= self.extent[0]) | (c[1] >= self.extent[1]) | (c[2] >= self.extent[2]) {
            return None;
        }
        let [x, y, z] = c.map(|v| v >> self.brick_log2);
        Some((x + self.bricks[0] * (y + self.bricks[1] * z)) as usize)
    }

    /// The reader of the brick that holds `c`, and where `c` is in it, if the brick is known.
    #[inline(always)]
    pub(super) fn find(&self, c: Coord) -> Option<(BrickReader<'_>, Coord)> {
        let brick = self.known.get(self.index(c)?)?.get()?;
        let mask = (1 << self.brick_log2) - 1;
        Some((brick.frame.reader(&brick.payload), c.map(|v| v & mask)))
    }

    /// Finds the brick that holds `c` and notes it, where it is stored with zerobit and may be kept.
    #[cold]
    pub(super) fn learn(&self, volume: &'a Volume, tree: u32, lod: u8, c: Coord) -> Result<()> {
        let Some(slot) = self.index(c).and_then(|i| self.known.get(i)).filter(|slot| slot.get().is_none()) else {
            return Ok(());
        };
        let brick = c.map(|v| v >> self.brick_log2);
        let found = volume.find(tree, lod, brick)?;
        if found.node().kind != NodeKind::Stored {
            return Ok(());
        }
        let (entry, layout): (&'a Entry, usize) = volume.codec_of(found.node(), lod, brick)?;
        let Codec::Zerobit(codec) = entry.codec() else { return Ok(()) };
        let extent = volume.codecs.layout(layout).extent;
        let payload = volume.payload(&found, layout)?;
        if let Payload::Shared(bytes) = &payload {
            let Some(left) = self.budget.get().checked_sub(bytes.len() as u64) else { return Ok(()) };
            self.budget.set(left);
        }
        let _ =
            slot.set(Brick { frame: codec.frame(&payload, extent)?.in_volume(volume.info().payload_bytes), payload });
        Ok(())
    }
}
