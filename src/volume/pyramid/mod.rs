//! Coarser levels: every voxel of level n is made of the level-0 voxels that it covers (spec chapter 4).
//!
//! All levels come out of one pass: sums (or extremes) of level n are joined from those of level n−1, which are exact
//! for integers, so that nothing is rounded but the result (spec: VOL-12; D-53).

mod join;
mod nearest;

use crate::container::Downsample;
use crate::geometry::Extent;
use crate::grid::View;
use crate::voxel::SampleValue;
pub(super) use join::working_bytes;

use join::Joined;

/// How levels are made of one volume.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pyramid {
    /// Voxels of level 0.
    pub(super) fine: Extent,
    pub(super) downsample: Downsample,
    /// Stands for NaN and infinities; says the sample type, too.
    pub(super) null: SampleValue,
    pub(super) brick_log2: u8,
    /// The coarsest level that is wanted.
    pub(super) coarsest: u8,
}

/// Rows of a coarser level, whole along x.
#[derive(Debug)]
pub(super) struct Rows {
    pub(super) level: u8,
    /// First row and plane, in voxels of the level.
    pub(super) y: u32,
    pub(super) z: u32,
    /// Rows of a plane.
    pub(super) rows: u32,
    /// Bytes of a row.
    pub(super) row_bytes: usize,
    /// Samples, x fastest, then y, then z.
    pub(super) bytes: Vec<u8>,
}

/// What a row of bricks of level 0 gives to the levels above it.
pub(super) struct Block {
    pub(super) rows: Vec<Rows>,
    /// Sums or extremes of the level whose voxels are whole bricks: one row of them, to be joined further.
    pub(super) top: Vec<Joined>,
}

impl Pyramid {
    /// Voxels of `level`.
    pub(super) fn extent(&self, level: u8) -> Extent {
        self.fine.at_lod(level)
    }

    /// The last level whose voxels lie inside a brick of level 0.
    fn inner(&self) -> u8 {
        self.coarsest.min(self.brick_log2)
    }

    /// Levels 1 and up of one row of bricks: all voxels along x, `view` from row `y` and plane `z` on.
    pub(super) fn block(&self, view: &View<'_>, y: u32, z: u32) -> Block {
        if self.downsample == Downsample::Nearest {
            return Block { rows: nearest::rows(self, view, y, z), top: Vec::new() };
        }
        join::block(self, view, y, z)
    }

    /// Where planes of whole bricks are joined, slab after slab; `None`, where no level is that coarse.
    pub(super) fn tower(&self) -> Option<Tower> {
        let needed = self.coarsest > self.brick_log2 && self.downsample != Downsample::Nearest;
        needed.then(|| Tower { pyramid: *self, pending: Vec::new() })
    }
}

/// The levels above the one whose voxels are whole bricks: each waits for two planes of the level below.
pub(super) struct Tower {
    pyramid: Pyramid,
    /// By level, from the first above `brick_log2` on: the first of two planes below it.
    pending: Vec<Option<Vec<Joined>>>,
}

impl Tower {
    /// Takes plane `z` of level `brick_log2`, and gives the planes above it that are complete now.
    pub(super) fn take(&mut self, plane: Vec<Joined>, z: u32) -> Vec<Rows> {
        let p = self.pyramid;
        let (mut plane, mut z, mut out) = (plane, z, Vec::new());
        for level in p.brick_log2 + 1..=p.coarsest {
            let below = p.extent(level - 1);
            let index = usize::from(level - p.brick_log2 - 1);
            if self.pending.len() <= index {
                self.pending.push(None);
            }
            let first = match self.pending[index].take() {
                Some(first) => first,
                None if z + 1 < below.z => {
                    self.pending[index] = Some(plane);
                    return out;
                }
                None => std::mem::take(&mut plane),
            };
            let second = (z % 2 == 1).then_some(&plane[..]);
            let (joined, bytes) = join::planes(&p, level, z / 2, &first, second);
            (plane, z) = (joined, z / 2);
            let e = p.extent(level);
            let row_bytes = e.x as usize * p.null.sample_type().bytes();
            out.push(Rows { level, y: 0, z, rows: e.y, row_bytes, bytes });
        }
        out
    }
}

#[cfg(test)]
mod tests;
