//! The copying itself: payloads are read in groups, looked at side by side, and written in order.

use super::excerpt::{Excerpt, Item};
use super::{CopyReport, ZstdPolicy};
use crate::container::{BrickSink, FileWriter, FinishOptions, Node, NodeFlags, NodeKind, VolumeDescriptor};
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Region};
use crate::limits;
use crate::metrics::value_range;
use crate::supercompression;
use crate::volume::Volume;
use crate::volume::brick_encoder::with_scratch;
use crate::volume::encode::Progress;
use rayon::prelude::*;
use std::borrow::Cow;
use std::io::{Seek, Write};

/// Payload bytes that are held at a time, as they are stored.
const GROUP_BYTES: u64 = 16 << 20;
/// Bricks looked at side by side at most: they may be decoded.
const GROUP_BRICKS: usize = 256;
/// Ranges closer together than this are read in one go: leader, guard and alignment of neighbouring bricks.
const MERGE_GAP: u64 = 512;
/// Payload bytes between the checkpoints of a file that can have some.
const CHECKPOINT_BYTES: u64 = 64 << 20;

/// A brick that is ready to be written.
struct Ready<'a> {
    node: Node,
    payload: Cow<'a, [u8]>,
    /// Bytes before zstd.
    payload_len: u64,
    converted: bool,
}

impl Excerpt<'_> {
    /// Writes the part as a head file into an empty `out`: complete, but not synced, when this returns.
    ///
    /// # Errors
    /// As [`Excerpt::copy`].
    pub fn write_head<W: Write + Seek>(self, out: W, progress: &mut Progress<'_>) -> Result<(W, CopyReport)> {
        let sink = FileWriter::new(out, self.descriptor())?;
        let options = self.finish_options()?;
        self.copy(sink, options, progress)
    }

    /// Copies all bricks into a sink that was begun with [`Excerpt::descriptor`], and finishes it with `options`
    /// ([`Excerpt::finish_options`]). Payloads are checked against their CRC. They are decoded only where levels are
    /// dropped below them, whose values the bounds in the index include.
    ///
    /// Memory: some 100 bytes per brick, and 16 MiB of payloads. `progress` gets bytes copied and in all.
    ///
    /// # Errors
    /// `E_PAGE_CRC`, `E_DIR_CRC`, `E_BRICK_CRC`, `E_SIZE`, `E_ZSTD` for what is damaged, `E_REPLACED`; `E_CODEC` where a
    /// brick of an unknown codec would have to be decoded; those of the sink.
    pub fn copy<S: BrickSink>(
        self,
        mut sink: S,
        options: FinishOptions,
        progress: &mut Progress<'_>,
    ) -> Result<(S::Out, CopyReport)> {
        let items = self.items()?;
        let total: u64 = items.iter().map(|i| u64::from(i.node.stored_len)).sum();
        let mut descriptor = VolumeDescriptor { payload_bytes: 0, ..self.descriptor().clone() };
        let (mut done, mut committed, mut converted) = (0, 0, 0);
        for group in groups(&items) {
            let stored = read_all(self.volume, group)?;
            let ready: Result<Vec<Option<Ready<'_>>>> =
                group.par_iter().zip(&stored).map(|(item, bytes)| self.ready(item, bytes)).collect();
            for (item, ready) in group.iter().zip(ready?) {
                let (tree, level, brick) = item.to;
                match ready {
                    Some(r) => {
                        sink.put_stored(tree, level, brick, &r.node, &r.payload)?;
                        descriptor.payload_bytes += r.payload_len;
                        converted += u64::from(r.converted);
                        done += u64::from(item.node.stored_len);
                    }
                    None => sink.put_constant(tree, level, brick, &self.constant(&item.node)?)?,
                }
            }
            progress(done, total);
            if done - committed >= CHECKPOINT_BYTES {
                sink.checkpoint(&descriptor, &options)?;
                committed = done;
            }
        }
        let (out, file) = sink.finish(&descriptor, options)?;
        Ok((out, CopyReport { file, payload_bytes: descriptor.payload_bytes, converted }))
    }

    /// Checks and converts one brick; `None` for a CONSTANT one.
    fn ready<'a>(&self, item: &Item, stored: &'a [u8]) -> Result<Option<Ready<'a>>> {
        if item.node.kind != NodeKind::Stored {
            return Ok(None);
        }
        let (volume, (level, brick)) = (self.volume, item.from);
        item.node.check_payload(stored).map_err(|e| volume.replaced_or(e))?;
        let zstd = item.node.flags.contains(NodeFlags::ZSTD);
        let payload_len = volume.payload_len(&item.node, level, brick, stored)?;
        let inflate = || {
            let lens = payload_len..=payload_len;
            supercompression::inflate(stored, lens, item.node.offset, "brick.payload")
        };
        let mut node = item.node;
        if self.loses_descendants() {
            let payload = if zstd { Cow::Owned(inflate()?) } else { Cow::Borrowed(stored) };
            let range = volume.decoded_range(&item.node, level, brick, &payload)?;
            node = Node::new_stored(node.codec, own_flags(&node), range, own_error(&node));
        }
        let payload = match self.zstd {
            ZstdPolicy::Compress if !zstd => supercompression::compress(stored)?,
            ZstdPolicy::Inflate if zstd => Some(inflate()?),
            _ => None,
        };
        let converted = payload.is_some();
        if converted {
            node.flags = NodeFlags(node.flags.0 ^ NodeFlags::ZSTD.0);
        }
        let payload = payload.map_or(Cow::Borrowed(stored), Cow::Owned);
        Ok(Some(Ready { node, payload, payload_len, converted }))
    }

    /// The node of a CONSTANT brick.
    fn constant(&self, node: &Node) -> Result<Node> {
        if !self.loses_descendants() {
            return Ok(*node);
        }
        Ok(Node::new_constant(node.constant(self.descriptor().sample_type)?, own_flags(node), own_error(node)))
    }
}

/// Flags of the brick alone.
pub(super) fn own_flags(node: &Node) -> NodeFlags {
    NodeFlags(node.flags.0 & !NodeFlags::ERROR_KNOWN.0)
}

/// A bound on the error of the brick alone: exact where it is lossless, else that of brick and descendants.
fn own_error(node: &Node) -> Option<f64> {
    if node.flags.contains(NodeFlags::LOSSLESS) {
        return Some(0.0);
    }
    node.flags.contains(NodeFlags::ERROR_KNOWN).then_some(f64::from(node.max_error))
}

impl Volume {
    /// Length of a stored payload before zstd, checked against what the codec allows where it is known (spec: BRK-7, BRK-9).
    pub(super) fn payload_len(&self, node: &Node, level: u8, brick: Coord, stored: &[u8]) -> Result<u64> {
        let allowed = match self.codecs.get(node.codec) {
            Ok(entry) => {
                let extent = self.head.octree.levels[usize::from(level)].extent;
                self.codecs.layout(self.codecs.layout_index(entry, level, brick, extent)).payload_lens
            }
            Err(e) if e.code() == Code::Codec => [0, self.limits.brick_bytes],
            Err(e) => return Err(e),
        };
        let [least, most] = [allowed[0], allowed[1].min(self.limits.brick_bytes)];
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

/// Bricks that are read and looked at together.
fn groups(items: &[Item]) -> impl Iterator<Item = &[Item]> {
    let mut rest = items;
    std::iter::from_fn(move || {
        let mut bytes = 0;
        let fits = rest.iter().take(GROUP_BRICKS).take_while(|item| {
            bytes += u64::from(item.node.stored_len);
            bytes <= GROUP_BYTES
        });
        let count = fits.count().max(1).min(rest.len());
        let (group, later) = rest.split_at(count);
        rest = later;
        (!group.is_empty()).then_some(group)
    })
}

/// The stored bytes of each brick, empty for CONSTANT ones. Neighbours are read together.
fn read_all<'a>(volume: &'a Volume, group: &[Item]) -> Result<Vec<Cow<'a, [u8]>>> {
    let mut by_offset: Vec<usize> = (0..group.len()).filter(|&i| group[i].node.kind == NodeKind::Stored).collect();
    by_offset.sort_by_key(|&i| group[i].node.offset);
    let range = |i: usize| group[i].node.offset..group[i].node.offset + u64::from(group[i].node.stored_len);
    let mut stored = vec![Cow::Borrowed(&[][..]); group.len()];
    let near = |a: &usize, b: &usize| range(*b).start.saturating_sub(range(*a).end) <= MERGE_GAP;
    for run in by_offset.chunk_by(near) {
        let start = range(run[0]).start;
        let end = run.iter().map(|&i| range(i).end).max().unwrap_or(start);
        #[allow(clippy::cast_possible_truncation, reason = "payloads of a group, and gaps between them")]
        let bytes = volume.source.read(start, (end - start) as usize)?;
        for &i in run {
            #[allow(clippy::cast_possible_truncation, reason = "inside the bytes that were read")]
            let part = (range(i).start - start) as usize..(range(i).end - start) as usize;
            stored[i] = match &bytes {
                Cow::Borrowed(bytes) => Cow::Borrowed(&bytes[part]),
                Cow::Owned(bytes) => Cow::Owned(bytes[part].to_vec()),
            };
        }
    }
    Ok(stored)
}
