//! What the index alone says of a box: value bounds and error bound, without touching a brick (spec chapter 5).

use super::At;
use super::bricks::Found;
use super::open::Volume;
use crate::container::{NodeFlags, NodeKind};
use crate::error::Result;
use crate::geometry::{Coord, Region};
use crate::voxel::SampleType;

/// Bounds over the decoded voxels of a box, all components, rounded outward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// No decoded voxel is smaller.
    pub min: f32,
    /// No decoded voxel is larger.
    pub max: f32,
    /// No decoded voxel is further from the exact source of its level; `None` where a brick does not say.
    pub max_error: Option<f32>,
}

impl Bounds {
    fn join(self, other: Bounds) -> Bounds {
        Bounds {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
            max_error: self.max_error.zip(other.max_error).map(|(a, b)| a.max(b)),
        }
    }
}

impl Volume {
    /// Value and error bounds of all bricks that a box touches. Reads index pages only, never a brick.
    ///
    /// # Errors
    /// `E_RANGE` outside the volume; those of damaged pages.
    pub fn bounds(&self, at: At, region: Region) -> Result<Bounds> {
        region.check(self.extent_at(at)?)?;
        let tree = self.tree(at)?;
        let mut all: Option<Bounds> = None;
        self.load_pages_of(at, tree, &region)?;
        self.each_brick(&region, |brick| {
            let b = self.bounds_of(&self.find(tree, at.lod, brick)?);
            all = Some(all.map_or(b, |a| a.join(b)));
            Ok(())
        })?;
        Ok(all.expect("a checked region touches a brick"))
    }

    /// Positions of the bricks whose decoded values may lie in the closed interval `[lo, hi]`. Reads pages only.
    ///
    /// # Errors
    /// As [`Volume::bounds`].
    pub fn bricks_overlapping(&self, at: At, lo: f64, hi: f64) -> Result<Vec<Coord>> {
        let tree = self.tree(at)?;
        let mut bricks = Vec::new();
        let whole = Region::whole(self.extent_at(at)?);
        self.load_pages_of(at, tree, &whole)?;
        self.each_brick(&whole, |brick| {
            let b = self.bounds_of(&self.find(tree, at.lod, brick)?);
            if f64::from(b.min) <= hi && f64::from(b.max) >= lo {
                bricks.push(brick);
            }
            Ok(())
        })?;
        Ok(bricks)
    }

    /// Regions of all coding blocks whose decoded values may lie in the closed interval `[lo, hi]` (S3Dc §5.2:
    /// segmentation by rejecting blocks on their minimum and maximum). Bricks that the index rules out are not read; in
    /// the others only minima and maxima are looked at, never an index.
    ///
    /// No voxel in the interval is missed. Bricks without blocks (`raw`, CONSTANT, EMPTY) come whole.
    ///
    /// # Errors
    /// As [`Volume::read_region`].
    pub fn blocks_overlapping(&self, at: At, lo: f64, hi: f64) -> Result<Vec<Region>> {
        let tree = self.tree(at)?;
        let mut regions = Vec::new();
        for brick in self.bricks_overlapping(at, lo, hi)? {
            let found = self.find(tree, at.lod, brick)?;
            let whole = self.head.octree.brick_region(at.lod, brick);
            if found.node().kind != NodeKind::Stored {
                regions.push(whole);
                continue;
            }
            let (_, layout) = self.codec_of(found.node(), at.lod, brick)?;
            let Some(s3dc) = &self.codecs.layout(layout).s3dc else {
                regions.push(whole);
                continue;
            };
            let payload = self.payload(&found, layout)?;
            let block = s3dc.params().block();
            let mut visit = |[x, y, z]: Coord| {
                let start = [x * block.x, y * block.y, z * block.z];
                let in_volume = std::array::from_fn(|a| start[a] + whole.start[a]);
                regions.push(Region::at(in_volume, block).intersect(&whole));
            };
            match self.info().sample_type {
                SampleType::U8 => s3dc.blocks_overlapping::<u8>(&payload, lo, hi, |block, _, _| visit(block)),
                SampleType::U16 => s3dc.blocks_overlapping::<u16>(&payload, lo, hi, |block, _, _| visit(block)),
                SampleType::I16 => s3dc.blocks_overlapping::<i16>(&payload, lo, hi, |block, _, _| visit(block)),
                SampleType::F32 => s3dc.blocks_overlapping::<f32>(&payload, lo, hi, |block, _, _| visit(block)),
                SampleType::Rgb8 => unreachable!("s3dc holds scalars only"),
            };
        }
        Ok(regions)
    }

    /// Reads the pages of all bricks that a box touches, neighbouring ones together.
    fn load_pages_of(&self, at: At, tree: u32, region: &Region) -> Result<()> {
        let log2 = self.info().brick_log2;
        self.load_pages(tree, at.lod, region.start.map(|v| v >> log2), region.end.map(|v| (v - 1) >> log2))
    }

    fn each_brick(&self, region: &Region, mut visit: impl FnMut(Coord) -> Result<()>) -> Result<()> {
        let log2 = self.info().brick_log2;
        let first = region.start.map(|v| v >> log2);
        let last = region.end.map(|v| (v - 1) >> log2);
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    visit([x, y, z])?;
                }
            }
        }
        Ok(())
    }

    pub(super) fn bounds_of(&self, found: &Found<'_>) -> Bounds {
        let node = found.node();
        // An EMPTY brick without live descendants says nothing: its voxels are the null value.
        if node.kind == NodeKind::Empty && node.child_mask == 0 {
            let null = self.info().null_sample();
            let n = if self.info().sample_type == SampleType::Rgb8 { 3 } else { 1 };
            let values = (0..n).map(|c| null.component(c) as f32);
            let (min, max) = values.fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
            return Bounds { min, max, max_error: Some(0.0) };
        }
        let known = node.flags.contains(NodeFlags::ERROR_KNOWN);
        Bounds { min: node.min, max: node.max, max_error: known.then_some(node.max_error) }
    }
}
