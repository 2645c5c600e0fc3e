//! What is still whole of a damaged file: brick by brick, and by leaders where the index is lost (spec chapter 6).

use super::At;
use super::bricks::Found;
use super::open::Volume;
use super::pages::Page;
use crate::container::{LEADER_BYTES, NodeKind, find_leaders};
use crate::error::{Error, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::grid::{Grid, ViewMut, dense_len};
use crate::limits;
use crate::with_sample;
use std::collections::HashMap;

/// Bytes searched for leaders at a time.
const SCAN_BYTES: usize = 4 << 20;

/// A brick that could not be read.
pub struct LostBrick {
    /// Position in bricks of its level: x, y, z.
    pub brick: Coord,
    /// The voxels that were filled with the null value.
    pub region: Region,
    /// Why.
    pub error: Error,
}

/// What [`Volume::salvage`] has read.
pub struct Salvaged {
    /// The region; lost bricks hold the null value.
    pub grid: Grid,
    /// Bricks that are lost, in z, y, x order.
    pub lost: Vec<LostBrick>,
    /// Bricks whose index page is lost and that were found by their leaders.
    pub found_by_leader: u64,
}

impl Volume {
    /// Reads a box of voxels from a damaged file, opened with [`Volume::open_salvage`].
    ///
    /// Bricks that cannot be read are filled with the null value and listed. Where a page of the index is damaged, the
    /// file is searched for the leaders of its bricks. CONSTANT and EMPTY bricks exist in the index only: with their
    /// page they are lost.
    ///
    /// # Errors
    /// `E_RANGE`, `E_LIMIT` as [`Volume::read_region`]; damage is not an error here.
    pub fn salvage(&self, at: At, region: Region) -> Result<Salvaged> {
        region.check(self.extent_at(at)?)?;
        let tree = self.tree(at)?;
        let t = self.info().sample_type;
        limits::check("region", dense_len(region.extent(), t)? as u64, self.limits.result_bytes)?;
        let mut grid = Grid::zeros(region.extent(), t)?;
        let mut leaders: Option<HashMap<Coord, Page>> = None;
        let (mut lost, mut found_by_leader) = (Vec::new(), 0);
        let log2 = self.info().brick_log2;
        let (first, last) = (region.start.map(|v| v >> log2), region.end.map(|v| (v - 1) >> log2));
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    let brick = [x, y, z];
                    let wanted = self.head.octree.brick_region(at.lod, brick).intersect(&region);
                    let start = std::array::from_fn(|a| wanted.start[a] - region.start[a]);
                    let mut view = grid.view_mut();
                    let mut dst = view.sub(&Region::at(start, wanted.extent()));
                    let error = match self.find(tree, at.lod, brick) {
                        Ok(_) => match self.read_region_into(at, wanted, dst) {
                            Ok(()) => continue,
                            Err(e) => e,
                        },
                        Err(page_error) => {
                            let leaders = leaders.get_or_insert_with(|| self.scan_leaders(tree, at.lod));
                            let read =
                                leaders.get(&brick).map(|page| self.decode_found(at, brick, page, wanted, &mut dst));
                            match read {
                                Some(Ok(())) => {
                                    found_by_leader += 1;
                                    continue;
                                }
                                Some(Err(e)) => e,
                                None => page_error,
                            }
                        }
                    };
                    let mut dst = grid.view_mut();
                    let mut dst = dst.sub(&Region::at(start, wanted.extent()));
                    let null = self.info().null_sample();
                    with_sample!(self.info().sample_type, T => dst.fill::<T>(null.typed()));
                    lost.push(LostBrick { brick, region: wanted, error });
                }
            }
        }
        Ok(Salvaged { grid, lost, found_by_leader })
    }

    fn decode_found(&self, at: At, brick: Coord, page: &Page, wanted: Region, dst: &mut ViewMut<'_>) -> Result<()> {
        let found = Found { page: Some(page), slot: 0 };
        if found.node().kind == NodeKind::Constant {
            let value = found.node().constant(self.info().sample_type)?;
            with_sample!(self.info().sample_type, T => dst.fill::<T>(value.typed()));
            return Ok(());
        }
        let (entry, layout) = self.codec_of(found.node(), at.lod, brick)?;
        let payload = self.payload_slow(&found, layout, None)?;
        let origin = self.head.octree.brick_region(at.lod, brick).start;
        let start = std::array::from_fn(|a| wanted.start[a] - origin[a]);
        let whole = Region::whole(dst.extent);
        entry.codec().decode(
            &payload,
            self.codecs.layout(layout).extent,
            &Region::at(start, wanted.extent()),
            dst.sub(&whole),
        )
    }

    /// All leaders of one level of one tree, as pages of one node. The last one of a brick wins.
    fn scan_leaders(&self, tree: u32, lod: u8) -> HashMap<Coord, Page> {
        let mut found = HashMap::new();
        let bricks: Extent = self.head.octree.levels[usize::from(lod)].bricks;
        let len = self.source.len();
        let mut offset = 0;
        while offset < len {
            // Windows overlap by a leader, so that none is cut in two.
            let window = usize::try_from(len - offset).map_or(SCAN_BYTES, |left| left.min(SCAN_BYTES));
            // A window that cannot be read loses its own leaders only.
            let bytes = self.source.read(offset, window).unwrap_or_default();
            for (at, leader) in find_leaders(&bytes, offset, &self.head.superblock.file_id) {
                let wanted = leader.tree == tree && leader.level == lod;
                if wanted && bricks.contains(leader.brick) {
                    found.insert(leader.brick, Page::single(leader.node(at)));
                }
            }
            if window < SCAN_BYTES {
                break;
            }
            offset += (SCAN_BYTES - LEADER_BYTES) as u64;
        }
        found
    }
}
