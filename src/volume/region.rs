//! Reading boxes: regions, planes, blocks, bricks, whole levels.

use super::bricks::{Found, Payload};
use super::codecs::Entry;
use super::open::Volume;
use super::{At, Axis};
use crate::codec::{BrickPart, Codec, Stores, zerobit};
use crate::container::NodeKind;
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::grid::{Grid, ViewMut, dense_len};
use crate::limits;
use crate::voxel::SampleValue;
use rayon::prelude::*;

/// Ranges closer together than this are read in one go: leader, guard and alignment of neighbouring bricks.
const MERGE_GAP: u64 = 512;
/// Longest merged read, in bytes.
const MERGE_MAX: u64 = 8 << 20;
/// Bricks that are decoded side by side at most.
const SIDE_BY_SIDE: usize = 4;
/// Results from this size on do not fit a cache: they are written past it.
const STREAMING_BYTES: usize = 8 << 20;
/// Payload bytes held in copies at a time while a region is read.
const STAGE_BYTES: u64 = 256 << 20;

/// What fills a part of the region.
pub(super) enum Content<'a> {
    Constant(SampleValue),
    Stored { entry: &'a Entry, layout: usize, extent: Extent, payload: Option<Payload<'a>> },
}

/// One brick's share of a region.
pub(super) struct Part<'a> {
    /// First voxel of the brick, in the level's voxels.
    pub(super) origin: Coord,
    found: Found<'a>,
    pub(super) content: Content<'a>,
    /// The wanted part of the brick, in the level's voxels.
    pub(super) region: Region,
}

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
        let mut rest = dst;
        let mut z = region.start[2];
        while z < region.end[2] {
            let (parts, end) = self.stage(at, &region, z)?;
            let (now, later) = rest.split_at_z(end - z);
            decode_parts(
                &parts,
                now,
                &Region { start: [region.start[0], region.start[1], z], end: [region.end[0], region.end[1], end] },
            )?;
            (rest, z) = (later, end);
        }
        Ok(())
    }

    pub(super) fn check_brick(&self, at: At, brick: Coord) -> Result<()> {
        self.tree(at)?;
        let bricks = self.brick_count(at);
        if bricks.contains(brick) {
            return Ok(());
        }
        Err(Error::new(Code::Range, "brick", format!("brick {brick:?} (x, y, z) is not among {bricks} bricks")))
    }

    /// Fetches as many whole layers of bricks from plane `z` on as fit the staging budget (at least one).
    pub(super) fn stage(&self, at: At, region: &Region, z: u32) -> Result<(Vec<Part<'_>>, u32)> {
        let tree = self.tree(at)?;
        let log2 = self.info().brick_log2;
        let mut parts = Vec::new();
        let mut copied = 0;
        let mut end = z;
        while end < region.end[2] {
            let bz = end >> log2;
            let first = parts.len();
            for by in region.start[1] >> log2..=(region.end[1] - 1) >> log2 {
                for bx in region.start[0] >> log2..=(region.end[0] - 1) >> log2 {
                    parts.push(self.part(at, tree, [bx, by, bz], region)?);
                }
            }
            self.fetch(&mut parts[first..])?;
            end = ((bz + 1) << log2).min(region.end[2]);
            copied += parts[first..].iter().map(copied_bytes).sum::<u64>();
            if copied * 2 > STAGE_BYTES {
                break;
            }
        }
        Ok((parts, end))
    }

    fn part(&self, at: At, tree: u32, brick: Coord, region: &Region) -> Result<Part<'_>> {
        let found = self.find(tree, at.lod, brick)?;
        let node = found.node();
        let content = match node.kind {
            NodeKind::Empty => Content::Constant(self.info().null_sample()),
            NodeKind::Constant => Content::Constant(node.constant(self.info().sample_type)?),
            NodeKind::Stored => {
                let (entry, layout) = self.codec_of(node, at.lod, brick)?;
                Content::Stored { entry, layout, extent: self.codecs.layout(layout).extent, payload: None }
            }
        };
        let region = self.head.octree.brick_region(at.lod, brick).intersect(region);
        Ok(Part { origin: brick.map(|b| b << self.info().brick_log2), found, content, region })
    }

    fn is_missing(&self, part: &Part<'_>) -> bool {
        matches!(part.content, Content::Stored { layout, .. } if self.wants_read(part.found.node(), layout))
    }

    /// Brings the payloads of stored parts: neighbouring ranges in one read, checks and inflation in parallel.
    fn fetch<'a>(&'a self, parts: &mut [Part<'a>]) -> Result<()> {
        let mut missing: Vec<usize> = (0..parts.len()).filter(|&i| self.is_missing(&parts[i])).collect();
        missing.sort_by_key(|&i| parts[i].found.node().offset);
        // Offsets are untrusted: here they must only not overflow, the read itself checks them.
        let end_of = |i: usize| {
            let node = parts[i].found.node();
            node.offset.saturating_add(u64::from(node.stored_len))
        };
        let mut runs: Vec<(u64, u64, Vec<usize>)> = Vec::new();
        for i in missing {
            let (start, end) = (parts[i].found.node().offset, end_of(i));
            match runs.last_mut() {
                Some(run) if start <= run.1.saturating_add(MERGE_GAP) && end.max(run.1) - run.0 <= MERGE_MAX => {
                    run.1 = run.1.max(end);
                    run.2.push(i);
                }
                _ => runs.push((start, end, vec![i])),
            }
        }
        let mut merged: Vec<Option<(usize, usize)>> = vec![None; parts.len()];
        let mut buffers = Vec::with_capacity(runs.len());
        for (start, end, members) in runs {
            if members.len() == 1 {
                continue; // `payload_slow` reads it, with its own checks first
            }
            let len = usize::try_from(end - start).expect("at most MERGE_MAX or one brick");
            buffers.push(self.source.read(start, len)?);
            for i in members {
                let from = usize::try_from(parts[i].found.node().offset - start).expect("inside the run");
                merged[i] = Some((buffers.len() - 1, from));
            }
        }
        parts.par_iter_mut().enumerate().try_for_each(|(i, part)| {
            let Content::Stored { layout, payload, .. } = &mut part.content else { return Ok(()) };
            let len = part.found.node().stored_len as usize;
            let stored = merged[i].map(|(buffer, from)| &buffers[buffer][from..from + len]);
            *payload = Some(match stored {
                Some(_) => self.payload_slow(&part.found, *layout, stored)?,
                None => self.payload(&part.found, *layout)?,
            });
            Ok(())
        })
    }
}

/// The box of a grid of `block`s from the brick's first voxel on that holds `c`, cropped to the brick.
fn box_at(brick: &Region, block: Extent, c: Coord) -> Region {
    let b = block.to_array();
    let start = std::array::from_fn(|a| brick.start[a] + (c[a] - brick.start[a]) / b[a] * b[a]);
    Region::at(start, block).intersect(brick)
}

fn copied_bytes(part: &Part<'_>) -> u64 {
    match &part.content {
        Content::Stored { payload: Some(Payload::Shared(bytes)), .. } => bytes.len() as u64,
        _ => 0,
    }
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
