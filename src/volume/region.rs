//! Reading boxes: regions, planes, blocks, bricks, whole levels.

use super::bricks::Pool;
use super::fetch::{Ahead, Content, Part, STAGE_BYTES, Stage};
use super::open::Volume;
use super::{At, Axis};
use crate::codec::{BrickPart, Codec, Stores, zerobit};
use crate::container::NodeKind;
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::grid::{Grid, ViewMut, dense_len};
use crate::limits;
use crate::voxel::{SampleType, SampleValue};
use rayon::prelude::*;
use std::sync::atomic::Ordering;
use std::sync::mpsc;

/// Bricks that are decoded side by side at most.
const SIDE_BY_SIDE: usize = 4;
/// Results from this size on do not fit a cache: they are written past it.
const STREAMING_BYTES: usize = 8 << 20;

impl Volume {
    /// Reads a box of voxels.
    ///
    /// # Errors
    /// `E_RANGE` outside the volume, `E_LIMIT` for results above [`Limits::result_bytes`](crate::limits::Limits), and
    /// what damaged or unknown bricks yield (`E_BRICK_CRC`, `E_CODEC`, `E_ZSTD`, …).
    pub fn read_region(&self, at: At, region: Region) -> Result<Grid> {
        region.check(self.extent_at(at)?)?;
        let sample_type = self.info().sample_type;
        limits::check("region", dense_len(region.extent(), sample_type)? as u64, self.limits.result_bytes)?;
        let mut grid = Grid::zeros(region.extent(), sample_type)?;
        self.read_region_into(at, region, grid.view_mut())?;
        Ok(grid)
    }

    /// Reads a whole level.
    ///
    /// # Errors
    /// As [`Volume::read_region`].
    pub fn read(&self, at: At) -> Result<Grid> {
        self.read_region(at, Region::whole(self.extent_at(at)?))
    }

    /// Reads plane `index` across `axis`: a grid whose extent along `axis` is 1.
    ///
    /// # Errors
    /// As [`Volume::read_region`].
    pub fn plane(&self, at: At, axis: Axis, index: u32) -> Result<Grid> {
        let mut region = Region::whole(self.extent_at(at)?);
        region.start[axis as usize] = index;
        region.end[axis as usize] = index.saturating_add(1);
        self.read_region(at, region)
    }

    /// Reads brick `brick` (position in bricks), cropped to the volume.
    ///
    /// # Errors
    /// As [`Volume::read_region`].
    pub fn read_brick(&self, at: At, brick: Coord) -> Result<Grid> {
        self.check_brick(at, brick)?;
        self.read_region(at, self.head.octree.brick_region(at.lod, brick))
    }

    /// Reads the coding block that holds voxel `c`, cropped to its brick. Its region comes along.
    ///
    /// A block of zerobit is a unit block of 16³ voxels; its cells of 4³ are [`Volume::cell`]'s. Where the brick's codec
    /// has no blocks (`raw`, CONSTANT, EMPTY), the block is the brick.
    ///
    /// # Errors
    /// As [`Volume::read_region`].
    pub fn block(&self, at: At, c: Coord) -> Result<(Region, Grid)> {
        Region::at(c, Extent::cube(1)).check(self.extent_at(at)?)?;
        let brick = c.map(|v| v >> self.info().brick_log2);
        let found = self.find(self.tree(at)?, at.lod, brick)?;
        let mut region = self.head.octree.brick_region(at.lod, brick);
        if found.node().kind == NodeKind::Stored {
            let block = match self.codec_of(found.node(), at.lod, brick)?.0.codec() {
                Codec::S3dc(params) => params.block(),
                Codec::Zerobit(_) => Extent::cube(zerobit::UNIT_EDGE),
                Codec::Raw => region.extent(),
            };
            region = box_at(&region, block, c);
        }
        Ok((region, self.read_region(at, region)?))
    }

    /// Reads the cell of 4³ voxels that holds voxel `c`, cropped to its brick. Its region comes along.
    ///
    /// That is the smallest unit that zerobit decodes at once (the paper's cell mode); other codecs give the same box.
    ///
    /// # Errors
    /// As [`Volume::read_region`].
    pub fn cell(&self, at: At, c: Coord) -> Result<(Region, Grid)> {
        Region::at(c, Extent::cube(1)).check(self.extent_at(at)?)?;
        let brick = self.head.octree.brick_region(at.lod, c.map(|v| v >> self.info().brick_log2));
        let region = box_at(&brick, Extent::cube(zerobit::CELL_EDGE), c);
        Ok((region, self.read_region(at, region)?))
    }

    /// Reads a box of voxels into `dst`, whose extent and type must be those of the region and the volume.
    ///
    /// Neighbouring bricks are read together; decoding runs on the current rayon pool. The result does not depend on
    /// the number of threads.
    ///
    /// # Errors
    /// As [`Volume::read_region`]; `E_PARAM` where `dst` does not fit. `dst` is then partly written.
    pub fn read_region_into(&self, at: At, region: Region, dst: ViewMut<'_>) -> Result<()> {
        region.check(self.extent_at(at)?)?;
        if dst.extent != region.extent() || dst.sample_type != self.info().sample_type {
            return Err(Error::param(
                "dst",
                format!(
                    "{} voxels of {} given for {} of {}",
                    dst.extent,
                    dst.sample_type,
                    region.extent(),
                    self.info().sample_type
                ),
            ));
        }
        let mut dst = dst;
        let rows = self.rows_at_a_time(at, &region);
        let mut y = region.start[1];
        while y < region.end[1] {
            // Rows of bricks begin at multiples of their edge, wherever the region does.
            let end = ((y >> self.info().brick_log2).saturating_add(rows) << self.info().brick_log2).min(region.end[1]);
            let strip =
                Region { start: [region.start[0], y, region.start[2]], end: [region.end[0], end, region.end[2]] };
            let start = [0, y - region.start[1], 0];
            self.read_strip(at, strip, dst.sub(&Region::at(start, strip.extent())))?;
            y = end;
        }
        Ok(())
    }

    /// Rows of bricks of a region that are read at a time: all, unless a layer of it would not fit the staging budget.
    fn rows_at_a_time(&self, at: At, region: &Region) -> u32 {
        let log2 = self.info().brick_log2;
        let level = self.head.octree.levels[usize::from(at.lod)].extent;
        let brick = Extent::cube(1 << log2).min(level).voxels() * self.info().sample_type.bytes() as u64;
        let across = u64::from((region.end[0] - 1) >> log2) - u64::from(region.start[0] >> log2) + 1;
        u32::try_from((STAGE_BYTES / (across * brick)).max(1)).unwrap_or(u32::MAX >> 8).min(u32::MAX >> 8)
    }

    fn read_strip(&self, at: At, region: Region, dst: ViewMut<'_>) -> Result<()> {
        if self.source.connections() > 1 {
            return self.read_ahead(at, region, dst);
        }
        let mut rest = dst;
        let mut z = region.start[2];
        while z < region.end[2] {
            let stage = self.stage(at, &region, z)?;
            (rest, z) = decode_stage(stage, rest, &region, z)?;
        }
        Ok(())
    }

    /// Fetches one group of bricks while the one before it is decoded.
    fn read_ahead(&self, at: At, region: Region, dst: ViewMut<'_>) -> Result<()> {
        // What would fill half the cache drives out more than it is likely to be asked for again.
        let through = dense_len(region.extent(), dst.sample_type)? as u64 > self.limits.cache_bytes / 2;
        let ahead = Ahead { pool: through.then(Pool::default), ..Ahead::default() };
        let first = self.group(at, &region, region.start[2], &ahead)?;
        if first.end == region.end[2] {
            return decode_stage(first, dst, &region, region.start[2]).map(|_| ());
        }
        std::thread::scope(|scope| {
            // One group waits at most: memory for three.
            let (send, receive) = mpsc::sync_channel(1);
            let (ahead, from) = (&ahead, first.end);
            scope.spawn(move || {
                let mut z = from;
                while z < region.end[2] {
                    let stage = self.group(at, &region, z, ahead);
                    z = stage.as_ref().map_or(region.end[2], |stage| stage.end);
                    if send.send(stage).is_err() {
                        return; // nobody wants it any more
                    }
                }
            });
            let decode = || {
                let mut rest = dst;
                let mut z = region.start[2];
                for stage in std::iter::once(Ok(first)).chain(receive) {
                    (rest, z) = decode_stage(stage?, rest, &region, z)?;
                }
                Ok(())
            };
            decode().inspect_err(|_| ahead.cancelled.store(true, Ordering::Relaxed))
        })
    }

    pub(super) fn check_brick(&self, at: At, brick: Coord) -> Result<()> {
        self.tree(at)?;
        let bricks = self.brick_count(at);
        if bricks.contains(brick) {
            return Ok(());
        }
        Err(Error::new(Code::Range, "brick", format!("brick {brick:?} (x, y, z) is not among {bricks} bricks")))
    }
}

/// The box of a grid of `block`s from the brick's first voxel on that holds `c`, cropped to the brick.
fn box_at(brick: &Region, block: Extent, c: Coord) -> Region {
    let b = block.to_array();
    let start = std::array::from_fn(|a| brick.start[a] + (c[a] - brick.start[a]) / b[a] * b[a]);
    Region::at(start, block).intersect(brick)
}

/// Decodes the planes of `region` from `z` on that the stage holds into the front of `dst`; returns the rest, and its first
/// plane.
fn decode_stage<'d>(stage: Stage<'_>, dst: ViewMut<'d>, region: &Region, z: u32) -> Result<(ViewMut<'d>, u32)> {
    let sample_type = dst.sample_type;
    let (now, later) = dst.split_at_z(stage.end - z);
    let planes =
        Region { start: [region.start[0], region.start[1], z], end: [region.end[0], region.end[1], stage.end] };
    // Which of several damaged bricks is found first depends on the threads: the first in order is reported.
    decode_parts(&stage.parts, now, &planes).map_err(|e| first_error(&stage.parts, sample_type).unwrap_or(e))?;
    match stage.error {
        Some(e) => Err(e),
        None => Ok((later, stage.end)),
    }
}

/// The error of the first part that cannot be decoded.
fn first_error(parts: &[Part<'_>], sample_type: SampleType) -> Option<Error> {
    parts.iter().find_map(|part| {
        let Content::Stored { entry, extent, payload: Some(payload), .. } = &part.content else { return None };
        let mut scratch = Grid::zeros(part.region.extent(), sample_type).ok()?;
        let wanted = relative(&part.region, part.origin);
        entry.codec().decode(payload, *extent, &wanted, scratch.view_mut()).err()
    })
}

/// Decodes all parts of `region` into `dst`, in bands of z that threads share out.
fn decode_parts(parts: &[Part<'_>], dst: ViewMut<'_>, region: &Region) -> Result<()> {
    let depth = region.extent().z;
    let large = dst.bytes.len() >= STREAMING_BYTES;
    // One thread walks each brick once; several take thinner bands, so that there is work for all.
    let threads = u32::try_from(rayon::current_num_threads()).unwrap_or(1);
    let band = if threads == 1 { depth } else { depth.div_ceil(threads * 4).next_multiple_of(16) };
    let mut bands = Vec::new();
    let mut rest = dst;
    let mut z = region.start[2];
    while z < region.end[2] {
        let height = band.min(region.end[2] - z);
        let (now, later) = rest.split_at_z(height);
        bands.push((z, now));
        (rest, z) = (later, z + height);
    }
    let stores = if large { Stores::Streaming } else { Stores::Cached };
    bands.into_par_iter().try_for_each(|(z, mut dst)| {
        let end = z + dst.extent.z;
        let band = Region { start: [region.start[0], region.start[1], z], end: [region.end[0], region.end[1], end] };
        let wanted = parts.iter().map(|part| (part, part.region.intersect(&band)));
        let wanted: Vec<_> = wanted.filter(|(_, region)| !region.is_empty()).collect();
        let mut rest = &wanted[..];
        while let Some(run) = rest.get(..run_len(rest)).filter(|run| !run.is_empty()) {
            let (first, last) = (run[0].1, run[run.len() - 1].1);
            let all = Region { start: first.start, end: last.end };
            decode_run(run, dst.sub(&relative(&all, band.start)), stores)?;
            rest = &rest[run.len()..];
        }
        Ok(())
    })
}

/// How many parts at the front lie side by side along x and are coded alike, so that they are decoded in one go.
fn run_len(parts: &[(&Part<'_>, Region)]) -> usize {
    let Some((first, region)) = parts.first() else { return 0 };
    let Content::Stored { entry, .. } = &first.content else { return 1 };
    let beside = |pair: &&[(&Part<'_>, Region)]| {
        let (before, (part, next)) = (pair[0].1, pair[1]);
        let same_rows = next.start[1..] == region.start[1..] && next.end[1..] == region.end[1..];
        let alike = matches!(&part.content, Content::Stored { entry: other, .. } if std::ptr::eq(*entry, *other));
        same_rows && alike && next.start[0] == before.end[0]
    };
    1 + parts.windows(2).take(SIDE_BY_SIDE - 1).take_while(beside).count()
}

fn decode_run(run: &[(&Part<'_>, Region)], mut dst: ViewMut<'_>, stores: Stores) -> Result<()> {
    match &run[0].0.content {
        Content::Constant(value) => {
            fill(&mut dst, *value);
            Ok(())
        }
        Content::Stored { entry, .. } => {
            let bricks: Vec<BrickPart<'_>> = run
                .iter()
                .filter_map(|(part, wanted)| match &part.content {
                    Content::Stored { extent, payload: Some(payload), .. } => {
                        Some(BrickPart { payload, brick: *extent, region: relative(wanted, part.origin) })
                    }
                    _ => None,
                })
                .collect();
            entry.codec().decode_run(&bricks, dst, stores)
        }
    }
}

/// Fills all voxels with one value of their type.
pub(super) fn fill(dst: &mut ViewMut<'_>, value: SampleValue) {
    match value {
        SampleValue::U8(v) => dst.fill(v),
        SampleValue::U16(v) => dst.fill(v),
        SampleValue::I16(v) => dst.fill(v),
        SampleValue::F32(v) => dst.fill(v),
        SampleValue::Rgb8(v) => dst.fill(v),
    }
}

fn relative(region: &Region, origin: Coord) -> Region {
    Region {
        start: std::array::from_fn(|a| region.start[a] - origin[a]),
        end: std::array::from_fn(|a| region.end[a] - origin[a]),
    }
}
