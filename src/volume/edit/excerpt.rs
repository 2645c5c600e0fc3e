//! What of a volume is copied: whole trees, whole levels, boxes of whole bricks.

use super::{BrickOrder, CopyOptions, ZstdPolicy};
use crate::container::{Downsample, FinishOptions, Node, NodeKind, Octree, VolumeDescriptor, scene_section};
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent, Region, unmorton8};
use crate::volume::Volume;
use std::cmp::Reverse;
use std::ops::Range;

/// A part of a volume that is about to be copied: [`Volume::excerpt`].
#[derive(Debug)]
pub struct Excerpt<'a> {
    pub(super) volume: &'a Volume,
    levels: Range<u8>,
    times: Range<u32>,
    channels: Range<u32>,
    region: Region,
    order: BrickOrder,
    pub(super) zstd: ZstdPolicy,
    file_id: Option<[u8; 16]>,
    scene: Option<String>,
    descriptor: VolumeDescriptor,
    pub(super) octree: Octree,
}

/// A brick that is copied.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    /// Its node where it comes from.
    pub(super) node: Node,
    /// Level and position where it comes from.
    pub(super) from: (u8, Coord),
    /// Tree, level and position where it goes to.
    pub(super) to: (u32, u8, Coord),
}

impl Item {
    /// Where it lies. CONSTANT bricks lie nowhere: theirs is the order of the index.
    pub(super) fn in_file(&self) -> u64 {
        if self.node.kind == NodeKind::Stored { self.node.offset } else { 0 }
    }
}

impl Volume {
    /// Chooses what to copy. Nothing is read yet.
    ///
    /// # Errors
    /// `E_RANGE` for levels, time steps, channels or a region that the volume does not have.
    pub fn excerpt(&self, options: &CopyOptions) -> Result<Excerpt<'_>> {
        let d = self.info();
        let mut levels = within("levels", options.levels.clone(), u32::from(d.lod_count), u32::from)?;
        let times = within("times", options.times.clone(), d.time_steps, |v: u32| v)?;
        let channels = within("channels", options.channels.clone(), d.channels, |v: u32| v)?;
        #[allow(clippy::cast_possible_truncation, reason = "at most 22 levels")]
        let finest = levels.start as u8;
        let extent = self.head.octree.levels[usize::from(finest)].extent;
        let mut region = Region::whole(extent);
        if let Some(wanted) = options.region {
            wanted.check(extent)?;
            let coarser = levels.end - levels.start - 1;
            let grow = if options.levels.is_some() { coarser } else { 0 };
            region = snap(wanted, d.brick_log2, grow, extent);
            let kept = (0..=coarser).rev().find(|&k| snap(region, d.brick_log2, k, extent) == region);
            levels.end = levels.start + 1 + kept.expect("whole bricks of the finest level");
        }
        #[allow(clippy::cast_possible_truncation, reason = "at most 22 levels")]
        let levels = finest..levels.end as u8;
        let mut descriptor = d.clone();
        descriptor.dims = region.extent();
        descriptor.lod_count = levels.end - levels.start;
        descriptor.downsample = if descriptor.lod_count > 1 { d.downsample } else { Downsample::default() };
        descriptor.time_steps = times.end - times.start;
        descriptor.channels = channels.end - channels.start;
        descriptor.placement = d.placement.moved(finest, region.start);
        if finest > 0 || region != Region::whole(extent) || descriptor.trees() != d.trees() {
            // It was measured over all of level 0.
            descriptor.achieved = None;
        }
        let octree = Octree::new(&descriptor)?;
        let CopyOptions { order, zstd, file_id, .. } = *options;
        let scene = options.scene.clone();
        Ok(Excerpt { volume: self, levels, times, channels, region, order, zstd, file_id, scene, descriptor, octree })
    }
}

impl Excerpt<'_> {
    /// The box that is copied, in voxels of the finest level that is kept: whole bricks.
    #[must_use]
    pub fn region(&self) -> Region {
        self.region
    }

    /// The levels that are copied.
    #[must_use]
    pub fn levels(&self) -> Range<u8> {
        self.levels.clone()
    }

    /// Levels that the source has.
    #[must_use]
    pub fn level_count(&self) -> u8 {
        self.volume.info().lod_count
    }

    /// The time steps that are copied.
    #[must_use]
    pub fn times(&self) -> Range<u32> {
        self.times.clone()
    }

    /// The channels that are copied.
    #[must_use]
    pub fn channels(&self) -> Range<u32> {
        self.channels.clone()
    }

    /// The volume that the new file holds. Its bytes of payloads are known when all are copied.
    ///
    /// Errors, range of the source and the number of replaced samples were measured on all of the volume: of a part, the
    /// first are not known any more, the others are bounds.
    #[must_use]
    pub fn descriptor(&self) -> &VolumeDescriptor {
        &self.descriptor
    }

    /// What the new file says besides its volume.
    ///
    /// # Errors
    /// `E_FEATURE` where an editor must know a feature that this one does not; those of damaged sections.
    pub fn finish_options(&self) -> Result<FinishOptions> {
        let mut options = FinishOptions { file_id: self.file_id, ..self.volume.kept()? };
        if let Some(scene) = &self.scene {
            options.extra.retain(|s| s.entry.fourcc != *b"SCNE");
            options.extra.push(scene_section(scene.clone()));
        }
        if let Some(times) = &mut options.times {
            times.steps = times.steps[self.times.start as usize..self.times.end as usize].to_vec();
        }
        Ok(options)
    }

    /// Whether nodes lose descendants whose values their bounds include.
    pub(super) fn loses_descendants(&self) -> bool {
        self.levels.start > 0
    }

    /// The bricks to copy that are not EMPTY, in the order in which they are written. Reads the pages they are in.
    pub(super) fn items(&self) -> Result<Vec<Item>> {
        let head = &self.volume.head;
        if let Some(why) = &head.directory_lost {
            return Err(Error::new(Code::DirCrc, "PDIR", why.clone()));
        }
        let mut items = Vec::new();
        let wanted = |ordinal| {
            let (tree, level, page) = head.octree.page_position(ordinal);
            let Some(bricks) = self.bricks_of(tree, level) else { return false };
            (0..3).all(|a| page[a] * 8 < bricks.end[a] && (page[a] + 1) * 8 > bricks.start[a])
        };
        let pages = &self.volume.pages;
        let visited = pages.each_wanted(head, &self.volume.source, wanted, |ordinal, page| {
            let (tree, level, position) = head.octree.page_position(ordinal);
            let Some(bricks) = self.bricks_of(tree, level) else { return Ok(()) };
            for (slot, node) in page.nodes().iter().enumerate().filter(|(_, n)| n.kind != NodeKind::Empty) {
                let local = unmorton8(slot);
                let brick: Coord = std::array::from_fn(|a| position[a] * 8 + local[a]);
                if (0..3).all(|a| (bricks.start[a]..bricks.end[a]).contains(&brick[a])) {
                    let to = std::array::from_fn(|a| brick[a] - bricks.start[a]);
                    let to = (self.new_tree(tree), level - self.levels.start, to);
                    items.push(Item { node: *node, from: (level, brick), to });
                }
            }
            Ok(())
        });
        visited.map_err(|e| self.volume.replaced_or(e))?;
        match self.order {
            BrickOrder::File => items.sort_by_key(Item::in_file),
            BrickOrder::Clustered => items.sort_by_cached_key(|item| {
                let (tree, level, brick) = item.to;
                (Reverse(level), tree, self.octree.locate(tree, level, brick))
            }),
        }
        Ok(items)
    }

    /// The bricks of a level that are copied; `None` where tree or level are not.
    fn bricks_of(&self, tree: u32, level: u8) -> Option<Region> {
        let channels = self.volume.info().channels;
        let (time, channel) = (tree / channels, tree % channels);
        let kept = self.times.contains(&time) && self.channels.contains(&channel) && self.levels.contains(&level);
        kept.then(|| {
            let log2 = u32::from(level - self.levels.start) + u32::from(self.volume.info().brick_log2);
            Region { start: self.region.start.map(|v| v >> log2), end: self.region.end.map(|v| v.div_ceil(1 << log2)) }
        })
    }

    /// Index that a tree has in the new file.
    fn new_tree(&self, tree: u32) -> u32 {
        let channels = self.volume.info().channels;
        (tree / channels - self.times.start) * self.descriptor.channels + tree % channels - self.channels.start
    }
}

/// A half-open range inside `0..count`, as u32; all where none is given.
fn within<T: Copy>(
    field: &'static str,
    range: Option<Range<T>>,
    count: u32,
    number: impl Fn(T) -> u32,
) -> Result<Range<u32>> {
    let Some(range) = range else { return Ok(0..count) };
    let range = number(range.start)..number(range.end);
    if range.is_empty() || range.end > count {
        let message = format!("{}:{} is empty or not inside 0:{count}, which the file has", range.start, range.end);
        return Err(Error::new(Code::Range, field, message));
    }
    Ok(range)
}

/// Grows a region to whole bricks of the level `coarser` steps above.
fn snap(region: Region, brick_log2: u8, coarser: u32, extent: Extent) -> Region {
    // At most 2^(8 + 21): no sum with an axis of at most 2^21 overflows.
    let unit = 1u32 << (u32::from(brick_log2) + coarser);
    Region { start: region.start.map(|v| v / unit * unit), end: region.end.map(|v| v.next_multiple_of(unit)) }
        .intersect(&Region::whole(extent))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_grow_to_whole_bricks() {
        let extent = Extent::new(100, 50, 30);
        let region = Region { start: [20, 3, 29], end: [33, 5, 30] };
        assert_eq!(snap(region, 4, 0, extent), Region { start: [16, 0, 16], end: [48, 16, 30] });
        assert_eq!(snap(region, 4, 1, extent), Region { start: [0, 0, 0], end: [64, 32, 30] });
        assert_eq!(snap(region, 8, 21, extent), Region::whole(extent));
    }

    #[test]
    fn ranges_stay_inside() {
        assert_eq!(within("levels", None::<Range<u8>>, 3, u32::from).unwrap(), 0..3);
        assert_eq!(within("levels", Some(1u8..3), 3, u32::from).unwrap(), 1..3);
        for range in [1u8..1, 0..4, 3..4] {
            assert_eq!(within("levels", Some(range), 3, u32::from).unwrap_err().code(), Code::Range);
        }
    }
}
