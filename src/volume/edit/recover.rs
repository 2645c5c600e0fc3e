//! Saving what is whole of a damaged or unfinished file as a new, strictly valid one.

use super::ZstdPolicy;
use super::copy::{Copied, Copier};
use super::excerpt::Item;
use crate::container::{
    self, BrickSink, FileSummary, FileWriter, FinishOptions, LiveBrick, Recovery, VolumeDescriptor,
};
use crate::error::{Code, Error, Result};
use crate::geometry::Coord;
use crate::limits::Limits;
use crate::source::ByteSource;
use crate::volume::encode::Progress;
use crate::volume::{At, Volume};
use std::io::{Seek, Write};

/// What [`recover`] has saved, and what is lost.
#[derive(Debug)]
pub struct Recovered {
    /// The volume that was written.
    pub descriptor: VolumeDescriptor,
    /// The new file.
    pub file: FileSummary,
    /// The last whole commit, where the file was a log.
    pub commit: Option<container::Commit>,
    /// Bricks that are in the new file, by time step, channel, level and position (z, y, x). Every brick that is neither
    /// here nor in `lost` is EMPTY: it was, or it had not been written yet, or nothing is left of it.
    pub live: Vec<(At, Coord)>,
    /// How many of them were found by their leaders alone.
    pub by_leader: u64,
    /// Bricks that were there and are not whole, in the same order.
    pub lost: Vec<(At, Coord, Error)>,
    /// Damaged tables and sections.
    pub damage: Vec<Error>,
    /// Whole bricks of time steps that no commit has: of an append that was stopped.
    pub beyond: u64,
}

impl Recovered {
    /// Whether the file was whole, but for what its writer had not written yet.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.lost.is_empty() && self.damage.is_empty()
    }
}

/// Looks through a damaged or unfinished file and writes what is whole of it into `out`: a strictly valid head file.
///
/// A log is taken as of its last whole commit, with bricks that were finished after it; where the index is damaged, bricks
/// are found by their leaders. Payloads are copied as they are. Bounds of what is saved are found by decoding, unless
/// all is whole; errors stay the bounds that the index has, and are unknown where it is lost.
///
/// # Errors
/// Those of [`container::recover`], where there is nothing to start from; `E_SOURCE`.
pub fn recover<W: Write + Seek>(
    source: impl ByteSource + 'static,
    limits: Limits,
    out: W,
    progress: &mut Progress<'_>,
) -> Result<(W, Recovered)> {
    let Recovery { head, options, bricks, lost, damage, beyond } = {
        let len = source.len();
        let mut read = |offset: u64, len: usize| {
            let mut bytes = Vec::new();
            bytes
                .try_reserve_exact(len)
                .map_err(|_| Error::at(Code::Limit, offset, "memory", format!("{len} bytes cannot be allocated")))?;
            bytes.resize(len, 0);
            source.read_at(offset, &mut bytes).map(|()| bytes)
        };
        container::recover(len, &limits, &mut read)?
    };
    // A file that was replaced meanwhile, or a server that fails, has lost nothing: what was read is no finding.
    let far = source.connections() > 1;
    let no_finding = |e: &Error| e.code() == Code::Replaced || (far && e.code() == Code::Source);
    let mut damage = damage;
    let mut lost = lost;
    if let Some(i) = damage.iter().position(no_finding) {
        return Err(damage.swap_remove(i));
    }
    if let Some(i) = lost.iter().position(|l| no_finding(&l.error)) {
        return Err(lost.swap_remove(i).error);
    }
    let volume = Volume::of_head(Box::new(source), head, limits)?;
    let d = volume.info().clone();
    let whole = damage.is_empty() && lost.is_empty() && bricks.iter().all(|b| b.indexed);
    let copier = Copier { tolerant: true, ..Copier::new(&volume, ZstdPolicy::Keep, !whole) };
    let mut items: Vec<Item> = bricks.iter().map(item).collect();
    // As they lie in the file: what was whole is then the file that packing gives.
    items.sort_by_key(Item::in_file);
    let mut sink = FileWriter::new(out, &d)?;
    let mut copied = copier.run(&items, &mut sink, progress, &mut |_, _| Ok(()))?;
    if let Some(i) = copied.lost.iter().position(|(_, e)| no_finding(e)) {
        return Err(copied.lost.swap_remove(i).1);
    }
    let at =
        |(tree, level, _): container::Place| At { time: tree / d.channels, channel: tree % d.channels, lod: level };
    let mut lost: Vec<(At, Coord, Error)> = lost.into_iter().map(|l| (at(l.place), l.place.2, l.error)).collect();
    let descriptor = saved(&d, &copied, whole);
    let dropped: std::collections::HashSet<container::Place> = copied.lost.iter().map(|(i, _)| i.to).collect();
    lost.extend(copied.lost.into_iter().map(|(i, e)| (at(i.to), i.to.2, e)));
    lost.sort_by_key(|(at, [x, y, z], _)| (at.time, at.channel, at.lod, *z, *y, *x));
    let live = bricks.iter().filter(|b| !dropped.contains(&b.place));
    let by_leader = live.clone().filter(|b| !b.indexed).count() as u64;
    let live = live.map(|b| (at(b.place), b.place.2)).collect();
    let (out, file) = sink.finish(&descriptor, FinishOptions { file_id: None, ..options })?;
    let commit = volume.head.commit;
    Ok((out, Recovered { descriptor, file, commit, live, by_leader, lost, damage, beyond }))
}

fn item(brick: &LiveBrick) -> Item {
    let (_, level, position) = brick.place;
    Item { node: brick.node, from: (level, position), to: brick.place }
}

/// What can be said of the volume that was saved.
fn saved(d: &VolumeDescriptor, copied: &Copied, whole: bool) -> VolumeDescriptor {
    let mut saved = VolumeDescriptor { payload_bytes: copied.payload_bytes, ..d.clone() };
    if whole {
        return saved;
    }
    saved.achieved = None;
    if let Some((min, max)) = copied.range {
        // A log whose first commit is its last does not know the range yet.
        let known = d.payload_bytes > 0;
        let (lo, hi) = if known { d.source_range } else { (min, max) };
        saved.source_range = (lo.min(min), hi.max(max));
    }
    saved
}
