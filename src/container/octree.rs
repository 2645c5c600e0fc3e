//! The implicit octree: which node lies where is arithmetic, so there are no pointers and no cycles (spec chapter 5).
//!
//! Child (dx, dy, dz) of node (l, x, y, z) is (l−1, 2x+dx, 2y+dy, 2z+dz). A page holds 8×8×8 nodes of one level.

use super::descriptor::VolumeDescriptor;
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent, Region, morton8};

/// Pages per axis are bricks / 8.
const PAGE_EDGE: Extent = Extent::cube(8);

/// One level of detail.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Level {
    /// Voxels per axis.
    pub extent: Extent,
    /// Bricks per axis.
    pub bricks: Extent,
    /// Pages per axis.
    pub pages: Extent,
    /// Ordinal of the level's first page in the first tree.
    pub first_page: u64,
}

/// Sizes of all levels, and the arithmetic between bricks, pages and ordinals.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Octree {
    /// All levels, finest first.
    pub levels: Vec<Level>,
    /// Pages of one tree.
    pub pages_per_tree: u64,
    trees: u32,
    brick_log2: u8,
}

impl Octree {
    /// The octree of a descriptor. Nothing is allocated but one entry per level (spec: IDX-1).
    ///
    /// # Errors
    /// Those of [`VolumeDescriptor::check`]; `E_LIMIT` where a count overflows 64 bits.
    pub fn new(d: &VolumeDescriptor) -> Result<Self> {
        d.check()?;
        let overflow = || Error::new(Code::Limit, "VOLD.dims", "the page count overflows 64 bits");
        let brick = Extent::cube(1 << d.brick_log2);
        let mut levels = Vec::with_capacity(usize::from(d.lod_count));
        let mut first_page = 0u64;
        for lod in 0..d.lod_count {
            let extent = d.dims.at_lod(lod);
            let bricks = extent.div_ceil(brick);
            let pages = bricks.div_ceil(PAGE_EDGE);
            levels.push(Level { extent, bricks, pages, first_page });
            first_page = pages.checked_voxels().and_then(|n| n.checked_add(first_page)).ok_or_else(overflow)?;
        }
        first_page.checked_mul(u64::from(d.trees())).ok_or_else(overflow)?;
        Ok(Octree { levels, pages_per_tree: first_page, trees: d.trees(), brick_log2: d.brick_log2 })
    }

    /// Number of trees: time steps × channels. Tree index = time · channels + channel (spec: IDX-2).
    #[must_use]
    pub fn trees(&self) -> u32 {
        self.trees
    }

    /// Pages of all trees, stored or not.
    #[must_use]
    pub fn page_count(&self) -> u64 {
        self.pages_per_tree * u64::from(self.trees)
    }

    /// Bricks of all levels and trees, stored or not; saturates at 2^64.
    #[must_use]
    pub fn brick_count(&self) -> u64 {
        let tree =
            self.levels.iter().fold(0u64, |n, l| n.saturating_add(l.bricks.checked_voxels().unwrap_or(u64::MAX)));
        tree.saturating_mul(u64::from(self.trees))
    }

    /// Page ordinal and slot (Morton index) of a brick that exists (spec: IDX-3, IDX-4).
    #[must_use]
    #[inline]
    pub fn locate(&self, tree: u32, level: u8, brick: Coord) -> (u64, usize) {
        (self.page_ordinal(tree, level, brick.map(|v| v >> 3)), morton8(brick.map(|v| v & 7)))
    }

    /// Ordinal of a page that exists: trees, then levels, then z, y, x (spec: IDX-3, GEN-3).
    #[must_use]
    #[inline]
    pub fn page_ordinal(&self, tree: u32, level: u8, page: Coord) -> u64 {
        let l = &self.levels[usize::from(level)];
        u64::from(tree) * self.pages_per_tree + l.first_page + l.pages.index(page)
    }

    /// Tree, level and page position of an ordinal below [`Octree::page_count`].
    #[must_use]
    pub fn page_position(&self, ordinal: u64) -> (u32, u8, Coord) {
        #[allow(clippy::cast_possible_truncation, reason = "an ordinal below the page count")]
        let tree = (ordinal / self.pages_per_tree) as u32;
        let rest = ordinal % self.pages_per_tree;
        let level = self.levels.iter().rposition(|l| l.first_page <= rest).unwrap_or(0);
        let l = &self.levels[level];
        let (i, px, py) = (rest - l.first_page, u64::from(l.pages.x), u64::from(l.pages.y));
        #[allow(clippy::cast_possible_truncation, reason = "each is below a page extent, which is u32")]
        let page = [(i % px) as u32, (i / px % py) as u32, (i / px / py) as u32];
        #[allow(clippy::cast_possible_truncation, reason = "at most 22 levels")]
        (tree, level as u8, page)
    }

    /// Size of a brick in voxels: cropped to the volume (spec: BRK-1).
    #[must_use]
    pub fn brick_extent(&self, level: u8, brick: Coord) -> Extent {
        self.brick_region(level, brick).extent()
    }

    /// The voxels of a brick, in voxels of its level.
    #[must_use]
    pub fn brick_region(&self, level: u8, brick: Coord) -> Region {
        let start = brick.map(|v| v.saturating_mul(1 << self.brick_log2));
        Region::at(start, Extent::cube(1 << self.brick_log2))
            .intersect(&Region::whole(self.levels[usize::from(level)].extent))
    }

    /// Whether tree, level and brick exist.
    #[must_use]
    pub fn contains(&self, tree: u32, level: u8, brick: Coord) -> bool {
        tree < self.trees && self.levels.get(usize::from(level)).is_some_and(|l| l.bricks.contains(brick))
    }
}
