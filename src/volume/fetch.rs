//! Bringing the payloads of many bricks: those of neighbours in one read, several reads at a time where the source is far
//! away.
//!
//! Bricks are taken in groups of whole layers. What a group is depends on the file alone, so that every source reads the
//! same ranges and reports the same errors.

use super::At;
use super::bricks::{Claim, Found, Payload, Pool};
use super::codecs::Entry;
use super::open::Volume;
use crate::container::{NodeFlags, NodeKind};
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::source::side_by_side;
use crate::voxel::SampleValue;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// Ranges closer together than this are read in one go: leader, guard and alignment of neighbouring bricks.
pub(super) const MERGE_GAP: u64 = 512;
/// Longest merged read, in bytes.
pub(super) const MERGE_MAX: u64 = 2 << 20;
/// Stored bytes from which on a group is complete: work for all connections to a distant source, and little enough that
/// decoding begins soon.
pub(super) const GROUP_BYTES: u64 = 12 << 20;
/// Bytes of inflated payloads from which on a group is complete: what is stored can be a thousandth of it.
pub(super) const GROUP_INFLATED: u64 = 64 << 20;
/// Bricks from which on a group is complete, where next to nothing is stored.
pub(super) const GROUP_BRICKS: usize = 1 << 16;
/// Payload bytes held in copies at a time while a region is read.
pub(super) const STAGE_BYTES: u64 = 256 << 20;

/// What fills a part of the region.
pub(super) enum Content<'a> {
    Constant(SampleValue),
    Stored { entry: &'a Entry, layout: usize, extent: Extent, payload: Option<Payload<'a>> },
}

/// One brick's share of a region.
pub(super) struct Part<'a> {
    /// First voxel of the brick, in the level's voxels.
    pub(super) origin: Coord,
    pub(super) found: Found<'a>,
    pub(super) content: Content<'a>,
    /// The wanted part of the brick, in the level's voxels.
    pub(super) region: Region,
}

/// Whole layers of bricks, ready to be decoded.
pub(super) struct Stage<'a> {
    pub(super) parts: Vec<Part<'a>>,
    /// The plane behind the last of `parts`.
    pub(super) end: u32,
    /// Why there are no more: to be reported after `parts` have been decoded, which comes first in the region.
    pub(super) error: Option<Error>,
}

/// How bricks are fetched while others are decoded.
#[derive(Default)]
pub(super) struct Ahead {
    /// Nothing new is asked for once this is set.
    pub(super) cancelled: AtomicBool,
    /// Payloads go through this memory and are not kept: what is read would only drive out what is used.
    pub(super) pool: Option<Pool>,
}

impl Ahead {
    fn check(&self) -> Result<()> {
        if self.cancelled.load(Ordering::Relaxed) {
            return Err(Error::new(Code::Source, "region", "reading ahead was given up"));
        }
        Ok(())
    }
}

/// Neighbouring payloads.
struct Run {
    start: u64,
    end: u64,
    /// Indices of parts.
    members: Vec<usize>,
}

impl Run {
    fn len(&self) -> usize {
        usize::try_from(self.end - self.start).expect("at most MERGE_MAX or one brick")
    }

    /// Where the payload of one of its members begins.
    fn place(&self, part: &Part<'_>) -> usize {
        usize::try_from(part.found.node().offset - self.start).expect("inside the run")
    }
}

impl Volume {
    /// Fetches as many whole layers of bricks from plane `z` on as fit the staging budget (at least one).
    ///
    /// # Errors
    /// Those of the first layers; later ones come in [`Stage::error`].
    pub(super) fn stage(&self, at: At, region: &Region, z: u32) -> Result<Stage<'_>> {
        let mut stage = self.group(at, region, z, &Ahead::default())?;
        let mut copied = stage.parts.iter().map(copied_bytes).sum::<u64>();
        while stage.end < region.end[2] && copied * 2 <= STAGE_BYTES {
            match self.group(at, region, stage.end, &Ahead::default()) {
                Ok(more) => {
                    copied += more.parts.iter().map(copied_bytes).sum::<u64>();
                    stage.parts.extend(more.parts);
                    stage.end = more.end;
                }
                Err(e) => {
                    stage.error = Some(e);
                    break;
                }
            }
        }
        Ok(stage)
    }

    /// Fetches the next group of layers from plane `z` on. `ahead` may end it early.
    pub(super) fn group(&self, at: At, region: &Region, z: u32, ahead: &Ahead) -> Result<Stage<'_>> {
        let tree = self.tree(at)?;
        let log2 = self.info().brick_log2;
        let [bx, by] = [0, 1].map(|a| [region.start[a] >> log2, (region.end[a] - 1) >> log2]);
        let mut parts = Vec::new();
        let (mut stored, mut inflated, mut end) = (0u64, 0u64, z);
        let more = |stored, inflated, parts| stored < GROUP_BYTES && inflated < GROUP_INFLATED && parts < GROUP_BRICKS;
        while end < region.end[2] && more(stored, inflated, parts.len()) {
            let bz = end >> log2;
            self.load_pages(tree, at.lod, [bx[0], by[0], bz], [bx[1], by[1], bz])?;
            for y in by[0]..=by[1] {
                for x in bx[0]..=bx[1] {
                    let part = self.part(at, tree, [x, y, bz], region)?;
                    if let Content::Stored { layout, .. } = part.content {
                        stored += u64::from(part.found.node().stored_len);
                        if part.found.node().flags.contains(NodeFlags::ZSTD) {
                            inflated = inflated.saturating_add(self.codecs.layout(layout).payload_lens[1]);
                        }
                    }
                    parts.push(part);
                }
            }
            end = ((bz + 1) << log2).min(region.end[2]);
        }
        self.fetch(&mut parts, ahead)?;
        Ok(Stage { parts, end, error: None })
    }

    pub(super) fn part(&self, at: At, tree: u32, brick: Coord, region: &Region) -> Result<Part<'_>> {
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

    /// Parts whose payload is not there yet and whose node does not forbid to read it.
    fn missing(&self, parts: &[Part<'_>]) -> Vec<usize> {
        let is_missing = |part: &Part<'_>| match part.content {
            Content::Stored { layout, .. } => self.wants_read(&part.found, layout),
            Content::Constant(_) => false,
        };
        (0..parts.len()).filter(|&i| is_missing(&parts[i])).collect()
    }

    /// Brings the payloads of stored parts, checked and inflated.
    ///
    /// # Errors
    /// That of the first part in order; those of the source itself at once.
    pub(super) fn fetch<'a>(&'a self, parts: &mut [Part<'a>], ahead: &Ahead) -> Result<()> {
        let missing = self.missing(parts);
        if self.source.connections() > 1 && !missing.is_empty() {
            match &ahead.pool {
                Some(pool) => self.fetch_through(parts, missing, pool, ahead)?,
                None => self.fetch_far(parts, missing, ahead)?,
            }
            return self.complete(parts, &[], &[]);
        }
        let mut merged: Vec<Option<(usize, usize)>> = vec![None; parts.len()];
        let mut buffers = Vec::new();
        for run in runs(parts, missing) {
            if run.members.len() == 1 && self.source.as_slice().is_none() {
                continue; // it is read where it is checked, in parallel
            }
            buffers.push(self.source.read(run.start, run.len())?);
            for &i in &run.members {
                merged[i] = Some((buffers.len() - 1, run.place(&parts[i])));
            }
        }
        self.complete(parts, &merged, &buffers)
    }

    /// Gives every stored part its payload: from the buffers, else from the cache or by a read of its own.
    fn complete<'a>(
        &'a self,
        parts: &mut [Part<'a>],
        merged: &[Option<(usize, usize)>],
        buffers: &[std::borrow::Cow<'_, [u8]>],
    ) -> Result<()> {
        let bring = |(i, part): (usize, &mut Part<'a>)| {
            let Content::Stored { layout, payload, .. } = &mut part.content else { return None };
            if payload.is_some() {
                return None;
            }
            let len = part.found.node().stored_len as usize;
            let stored = merged.get(i).copied().flatten().map(|(buffer, from)| &buffers[buffer][from..from + len]);
            let brought = match stored {
                Some(_) => self.payload_slow(&part.found, *layout, stored),
                None => self.payload(&part.found, *layout),
            };
            match brought {
                Ok(brought) => {
                    *payload = Some(brought);
                    None
                }
                Err(e) => Some((i, e)),
            }
        };
        // The first error in order, however many threads there are.
        let first = parts.par_iter_mut().enumerate().filter_map(bring).min_by_key(|(i, _)| *i);
        first.map_or(Ok(()), |(_, e)| Err(e))
    }

    /// Brings what nobody else is bringing, several ranges at a time; each is checked and inflated by the thread that
    /// waited for it.
    fn fetch_far<'a>(&'a self, parts: &mut [Part<'a>], missing: Vec<usize>, ahead: &Ahead) -> Result<()> {
        // Claims are given back before anything waits for those of others: no two threads wait for each other.
        let mut claims = HashMap::new();
        for i in missing {
            if let Content::Stored { layout, .. } = parts[i].content {
                claims.extend(self.claim(&parts[i].found, layout).map(|claim| (i, claim)));
            }
        }
        let runs = runs(parts, claims.keys().copied().collect());
        let jobs: Vec<(Run, Vec<(usize, Claim<'_>)>)> = runs
            .into_iter()
            .map(|run| {
                let claims = run.members.iter().filter_map(|i| claims.remove_entry(i)).collect();
                (run, claims)
            })
            .collect();
        let brought: Mutex<Vec<(usize, Result<Payload<'a>>)>> = Mutex::default();
        let shared: &[Part<'a>] = parts;
        let width = self.source.connections();
        side_by_side(width, jobs.into_iter(), |(run, claims)| {
            ahead.check()?;
            let bytes = self.source.read(run.start, run.len())?;
            for (i, claim) in claims {
                let part = &shared[i];
                let from = run.place(part);
                let stored = &bytes[from..from + part.found.node().stored_len as usize];
                let payload = self.fulfil(claim, &part.found, stored);
                brought.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((i, payload));
            }
            Ok(())
        })?;
        self.settle(parts, brought)
    }

    /// As [`Volume::fetch_far`], but nothing is kept, and nobody else is waited for.
    fn fetch_through<'a>(
        &'a self,
        parts: &mut [Part<'a>],
        missing: Vec<usize>,
        pool: &Pool,
        ahead: &Ahead,
    ) -> Result<()> {
        let runs = runs(parts, missing);
        let brought: Mutex<Vec<(usize, Result<Payload<'a>>)>> = Mutex::default();
        let shared: &[Part<'a>] = parts;
        side_by_side(self.source.connections(), runs.into_iter(), |run| {
            ahead.check()?;
            let mut buffer = pool.take(run.len());
            self.source.read_into(run.start, &mut buffer.bytes)?;
            let buffer = Arc::new(buffer);
            for &i in &run.members {
                let part = &shared[i];
                let Content::Stored { layout, .. } = part.content else { continue };
                let from = run.place(part);
                let range = from..from + part.found.node().stored_len as usize;
                let payload = self.payload_in(&part.found, layout, &buffer, range);
                brought.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((i, payload));
            }
            Ok(())
        })?;
        self.settle(parts, brought)
    }

    /// Gives the parts what was brought.
    fn settle<'a>(&'a self, parts: &mut [Part<'a>], brought: Mutex<Vec<(usize, Result<Payload<'a>>)>>) -> Result<()> {
        let mut brought = brought.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        brought.sort_by_key(|(i, _)| *i);
        let mut first = None;
        for (i, result) in brought {
            match (&mut parts[i].content, result) {
                (Content::Stored { payload, .. }, Ok(found)) => *payload = Some(found),
                (_, Ok(_)) => {}
                (_, Err(e)) => {
                    first.get_or_insert((i, e));
                }
            }
        }
        let Some((bad, error)) = first else { return Ok(()) };
        // A part before it may fail as well, once it is read.
        self.complete(&mut parts[..bad], &[], &[])?;
        Err(error)
    }
}

fn copied_bytes(part: &Part<'_>) -> u64 {
    match &part.content {
        Content::Stored { payload: Some(Payload::Shared(bytes)), .. } => bytes.len() as u64,
        _ => 0,
    }
}

/// The ranges to read for the payloads of the parts with these indices.
fn runs(parts: &[Part<'_>], mut missing: Vec<usize>) -> Vec<Run> {
    // Parts of one place are asked for in their own order, whoever sorts.
    missing.sort_by_key(|&i| (parts[i].found.node().offset, i));
    let mut runs: Vec<Run> = Vec::new();
    for i in missing {
        let node = parts[i].found.node();
        // Offsets are untrusted: here they must only not overflow, the read itself checks them.
        let (start, end) = (node.offset, node.offset.saturating_add(u64::from(node.stored_len)));
        match runs.last_mut() {
            Some(run)
                if end <= run.end || start <= run.end.saturating_add(MERGE_GAP) && end - run.start <= MERGE_MAX =>
            {
                run.end = run.end.max(end);
                run.members.push(i);
            }
            _ => runs.push(Run { start, end, members: vec![i] }),
        }
    }
    runs
}
