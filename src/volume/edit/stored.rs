//! Stored bytes of bricks, read in groups, and what can be said of them.

use super::excerpt::Item;
use crate::container::{self, FinishOptions, Node, NodeFlags, NodeKind};
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Region};
use crate::limits;
use crate::metrics::value_range;
use crate::supercompression;
use crate::volume::Volume;
use crate::volume::brick_encoder::with_scratch;
use std::borrow::Cow;

/// Payload bytes that are held at a time, as they are stored.
const GROUP_BYTES: u64 = 16 << 20;
/// Payload bytes that are held at a time besides, inflated or changed; a group has one brick at least.
const GROUP_INFLATED_BYTES: u64 = 64 << 20;
/// Bricks looked at side by side at most.
const GROUP_BRICKS: usize = 256;
/// Ranges closer together than this are read in one go: leader, guard and alignment of neighbouring bricks.
const MERGE_GAP: u64 = 512;

/// Bricks that are read and looked at together. `inflated` says how many bytes a brick may take besides its stored ones.
pub(super) fn groups(items: &[Item], inflated: impl Fn(&Item) -> u64) -> impl Iterator<Item = &[Item]> {
    let mut rest = items;
    std::iter::from_fn(move || {
        let (mut bytes, mut more) = (0, 0);
        let fits = rest.iter().take(GROUP_BRICKS).take_while(|item| {
            bytes += u64::from(item.node.stored_len);
            more += inflated(item);
            bytes <= GROUP_BYTES && more <= GROUP_INFLATED_BYTES
        });
        let count = fits.count().max(1).min(rest.len());
        let (group, later) = rest.split_at(count);
        rest = later;
        (!group.is_empty()).then_some(group)
    })
}

/// The stored bytes of each brick, empty for CONSTANT ones. Neighbours are read together.
pub(super) fn read_all<'a>(volume: &'a Volume, group: &[Item]) -> Result<Vec<Cow<'a, [u8]>>> {
    let mut by_offset: Vec<usize> = (0..group.len()).filter(|&i| group[i].node.kind == NodeKind::Stored).collect();
    by_offset.sort_by_key(|&i| group[i].node.offset);
    let range = |i: usize| group[i].node.offset..group[i].node.offset + u64::from(group[i].node.stored_len);
    let mut stored = vec![Cow::Borrowed(&[][..]); group.len()];
    let near = |a: &usize, b: &usize| range(*b).start.saturating_sub(range(*a).end) <= MERGE_GAP;
    let runs: Vec<&[usize]> = by_offset.chunk_by(near).collect();
    let ranges: Vec<(u64, usize)> = runs
        .iter()
        .map(|run| {
            let start = range(run[0]).start;
            let end = run.iter().map(|&i| range(i).end).max().unwrap_or(start);
            #[allow(clippy::cast_possible_truncation, reason = "payloads of a group, and gaps between them")]
            let len = (end - start) as usize;
            (start, len)
        })
        .collect();
    // All runs at once: a source far away is asked for several at a time.
    let read = volume.source.read_many(&ranges)?;
    for ((run, (start, _)), bytes) in runs.into_iter().zip(ranges).zip(&read) {
        for &i in run {
            #[allow(clippy::cast_possible_truncation, reason = "inside the bytes that were read")]
            let part = (range(i).start - start) as usize..(range(i).end - start) as usize;
            stored[i] = match bytes {
                Cow::Borrowed(bytes) => Cow::Borrowed(&bytes[part]),
                Cow::Owned(bytes) => Cow::Owned(bytes[part].to_vec()),
            };
        }
    }
    Ok(stored)
}

impl Volume {
    /// All that the next file is to say as this one does: what [`kept_options`](container::kept_options) says.
    pub(super) fn kept(&self) -> Result<FinishOptions> {
        let mut read = |offset, len| self.source.read(offset, len).map(Cow::into_owned);
        container::kept_options(&self.head, &self.limits, &mut read).map_err(|e| self.replaced_or(e))
    }

    /// Shortest and longest payload that a brick may have before zstd: what its codec allows where it is known, within the
    /// limits.
    pub(super) fn payload_lens(&self, node: &Node, level: u8, brick: Coord) -> Result<[u64; 2]> {
        let allowed = match self.codecs.get(node.codec) {
            Ok(entry) => {
                let extent = self.head.octree.levels[usize::from(level)].extent;
                self.codecs.layout(self.codecs.layout_index(entry, level, brick, extent)).payload_lens
            }
            Err(e) if e.code() == Code::Codec => [0, self.limits.brick_bytes],
            Err(e) => return Err(e),
        };
        Ok([allowed[0], allowed[1].min(self.limits.brick_bytes)])
    }

    /// Length of a stored payload before zstd, checked against what the codec allows where it is known (spec: BRK-7, BRK-9).
    pub(super) fn payload_len(&self, node: &Node, level: u8, brick: Coord, stored: &[u8]) -> Result<u64> {
        let [least, most] = self.payload_lens(node, level, brick)?;
        limits::check("brick", least, self.limits.brick_bytes)?;
        if node.flags.contains(NodeFlags::ZSTD) {
            return supercompression::content_len(stored, least..=most, node.offset, "brick.payload");
        }
        let len = stored.len() as u64;
        if (least..=most).contains(&len) {
            return Ok(len);
        }
        let message = format!("{len} bytes stored where the codec needs {least} to {most}");
        Err(Error::at(Code::Size, node.offset, "node.stored_len", message))
    }

    /// Smallest and largest value of a brick whose payload is uncompressed and checked.
    pub(super) fn decoded_range(&self, node: &Node, level: u8, brick: Coord, payload: &[u8]) -> Result<(f64, f64)> {
        let (entry, layout) = self.codec_of(node, level, brick)?;
        let extent = self.codecs.layout(layout).extent;
        with_scratch(extent, self.info().sample_type, |mut decoded| {
            let whole = Region::whole(extent);
            entry.codec().decode(payload, extent, &whole, decoded.sub(&whole))?;
            value_range(&decoded.as_view()).ok_or_else(|| {
                Error::at(Code::NonFinite, node.offset, "brick.payload", "the brick decodes to no finite number")
            })
        })
    }
}
