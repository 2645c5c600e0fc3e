//! The copying itself: payloads are read in groups, looked at side by side, and written in order.

use super::excerpt::{Excerpt, Item};
use super::stored::{groups, read_all};
use super::{CopyReport, ZstdPolicy};
use crate::codec::Codec;
use crate::container::{BrickSink, FileWriter, FinishOptions, LogWriter, Node, NodeFlags, NodeKind, VolumeDescriptor};
use crate::error::{Error, Result};
use crate::supercompression;
use crate::volume::Volume;
use crate::volume::encode::Progress;
use rayon::prelude::*;
use std::borrow::Cow;
use std::io::{Seek, Write};

/// Payload bytes between the checkpoints of a file that can have some.
const CHECKPOINT_BYTES: u64 = 64 << 20;

/// Copies bricks of one volume.
pub(super) struct Copier<'a> {
    pub(super) volume: &'a Volume,
    pub(super) zstd: ZstdPolicy,
    /// Whether bounds in nodes are not those of what is copied: they are then found by decoding.
    pub(super) measure: bool,
    /// New numbers of codebooks by those in payloads; where there is none, the same.
    pub(super) books: Vec<u32>,
    /// Codebooks of the file that is copied to, where it has some of its own; else 0.
    pub(super) books_there: u64,
    /// New entries of the codec table by old ones; where there is none, the same.
    pub(super) codecs: Vec<u8>,
    /// Whether bricks that cannot be copied are left out, and listed.
    pub(super) tolerant: bool,
}

/// What was copied.
#[derive(Default)]
pub(super) struct Copied {
    /// Bytes before zstd.
    pub(super) payload_bytes: u64,
    /// Stored bytes, as they were.
    pub(super) stored_bytes: u64,
    /// Payloads that were compressed or inflated.
    pub(super) converted: u64,
    /// Range of the values, by the bounds of the nodes.
    pub(super) range: Option<(f64, f64)>,
    /// What was left out, and why.
    pub(super) lost: Vec<(Item, Error)>,
}

impl Copied {
    fn join(&mut self, node: &Node) {
        let (min, max) = (f64::from(node.min), f64::from(node.max));
        self.range = Some(self.range.map_or((min, max), |(lo, hi)| (lo.min(min), hi.max(max))));
    }
}

/// The stored bytes of each brick of a group, and why there are none.
type Read<'a> = (Vec<Cow<'a, [u8]>>, Vec<Option<Error>>);

/// A brick that is ready to be written.
struct Ready<'a> {
    node: Node,
    payload: Cow<'a, [u8]>,
    /// Bytes before zstd.
    payload_len: u64,
    converted: bool,
}

impl Excerpt<'_> {
    /// Writes the excerpt as a head file into an empty `out`: complete, but not synced, when this returns.
    ///
    /// # Errors
    /// As [`Excerpt::copy`].
    pub fn write_head<W: Write + Seek>(self, out: W, progress: &mut Progress<'_>) -> Result<(W, CopyReport)> {
        let sink = FileWriter::new(out, self.descriptor())?;
        let options = self.finish_options()?;
        self.copy(sink, options, progress)
    }

    /// Writes the excerpt as a log, front to back: what is not finished can be read up to its last commit.
    ///
    /// # Errors
    /// As [`Excerpt::copy`].
    pub fn write_log<W: Write>(self, out: W, progress: &mut Progress<'_>) -> Result<(W, CopyReport)> {
        let options = self.finish_options()?;
        let sink = LogWriter::create(out, self.descriptor(), &options)?;
        self.copy(sink, options, progress)
    }

    /// Copies all bricks into a sink that was begun with [`Excerpt::descriptor`], and finishes it with `options`
    /// ([`Excerpt::finish_options`]). Payloads are checked against their CRC. They are decoded only where levels are
    /// dropped below them, whose values the bounds in the index include.
    ///
    /// Memory: some 100 bytes per brick, 16 MiB of payloads, and 64 MiB of those that are inflated (or one brick). `progress` gets bytes copied and in all.
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
        let copier = Copier::new(self.volume, self.zstd, self.loses_descendants());
        let descriptor =
            |copied: &Copied| VolumeDescriptor { payload_bytes: copied.payload_bytes, ..self.descriptor().clone() };
        let mut committed = 0;
        let copied = copier.run(&items, &mut sink, progress, &mut |sink, copied| {
            if !sink.checkpoint_due(copied.stored_bytes - committed, CHECKPOINT_BYTES) {
                return Ok(());
            }
            committed = copied.stored_bytes;
            sink.checkpoint(&descriptor(copied), &options)
        })?;
        let (out, file) = sink.finish(&descriptor(&copied), options)?;
        Ok((out, CopyReport { file, payload_bytes: copied.payload_bytes, converted: copied.converted }))
    }
}

impl<'a> Copier<'a> {
    pub(super) fn new(volume: &'a Volume, zstd: ZstdPolicy, measure: bool) -> Self {
        Copier { volume, zstd, measure, books: Vec::new(), books_there: 0, codecs: Vec::new(), tolerant: false }
    }

    /// Copies `items` in their order; `after` is called after each group of them.
    pub(super) fn run<S: BrickSink>(
        &self,
        items: &[Item],
        sink: &mut S,
        progress: &mut Progress<'_>,
        after: &mut dyn FnMut(&mut S, &Copied) -> Result<()>,
    ) -> Result<Copied> {
        let total: u64 = items.iter().map(|i| u64::from(i.node.stored_len)).sum();
        let mut copied = Copied::default();
        for group in groups(items, |item| self.inflated(item)) {
            let (stored, mut failed) = self.read(group)?;
            let ready: Vec<Result<Option<Ready<'_>>>> =
                group.par_iter().zip(&stored).map(|(item, bytes)| self.ready(item, bytes)).collect();
            for (i, (item, ready)) in group.iter().zip(ready).enumerate() {
                let (tree, level, brick) = item.to;
                match ready {
                    Ok(Some(r)) => {
                        copied.join(&r.node);
                        sink.put_stored(tree, level, brick, &r.node, &r.payload)?;
                        copied.payload_bytes += r.payload_len;
                        copied.converted += u64::from(r.converted);
                    }
                    Ok(None) => {
                        let node = self.constant(&item.node)?;
                        copied.join(&node);
                        sink.put_constant(tree, level, brick, &node)?;
                    }
                    Err(e) if self.tolerant => copied.lost.push((*item, failed[i].take().unwrap_or(e))),
                    Err(e) => return Err(e),
                }
                copied.stored_bytes += u64::from(item.node.stored_len);
            }
            progress(copied.stored_bytes, total);
            after(sink, &copied)?;
        }
        Ok(copied)
    }

    /// Whether codebooks have other numbers in the copy, or payloads could name one there that they do not have here.
    fn moves_books(&self) -> bool {
        let known = self.books.len() as u64;
        self.books_there > known || (0u32..).zip(&self.books).any(|(old, &new)| old != new)
    }

    /// The most bytes that a brick takes besides its stored ones: those of its payload where it is inflated or changed.
    fn inflated(&self, item: &Item) -> u64 {
        if item.node.kind != NodeKind::Stored {
            return 0;
        }
        let changes = self.measure || self.moves_books();
        if !item.node.flags.contains(NodeFlags::ZSTD) {
            return if changes { u64::from(item.node.stored_len) } else { 0 };
        }
        if !changes && self.zstd != ZstdPolicy::Inflate {
            return 0;
        }
        let (level, brick) = item.from;
        // Bricks that cannot be looked at are not inflated either.
        self.volume.payload_lens(&item.node, level, brick).map_or(0, |[_, most]| most)
    }

    /// The stored bytes of a group; of what cannot be read nothing, and why.
    fn read(&self, group: &[Item]) -> Result<Read<'a>> {
        match read_all(self.volume, group) {
            Ok(stored) => Ok((stored, group.iter().map(|_| None).collect())),
            Err(e) if !self.tolerant => Err(e),
            // One after the other: some of them can be read, it may be.
            Err(_) => Ok(group
                .iter()
                .map(|item| match read_all(self.volume, std::slice::from_ref(item)) {
                    Ok(mut stored) => (stored.pop().unwrap_or_default(), None),
                    Err(e) => (Cow::default(), Some(e)),
                })
                .unzip()),
        }
    }

    /// Checks and converts one brick; `None` for a CONSTANT one.
    fn ready<'b>(&self, item: &Item, stored: &'b [u8]) -> Result<Option<Ready<'b>>> {
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
        if self.measure {
            let payload = if zstd { Cow::Owned(inflate()?) } else { Cow::Borrowed(stored) };
            let range = volume.decoded_range(&item.node, level, brick, &payload)?;
            node = Node::new_stored(node.codec, own_flags(&node), range, own_error(&node));
        }
        node.codec = self.codecs.get(usize::from(node.codec)).copied().unwrap_or(node.codec);
        let moved = self.moves_books();
        if moved && matches!(volume.codecs.get(item.node.codec)?.codec(), Codec::Zerobit(_)) {
            let payload = renumbered(if zstd { inflate()? } else { stored.to_vec() }, &self.books, &item.node)?;
            let keeps = self.zstd == ZstdPolicy::Compress || (self.zstd == ZstdPolicy::Keep && zstd);
            let frame = if keeps { supercompression::compress(&payload)? } else { None };
            node.flags = with_zstd(node.flags, frame.is_some());
            let payload = Cow::Owned(frame.unwrap_or(payload));
            return Ok(Some(Ready { node, payload, payload_len, converted: false }));
        }
        let payload = match self.zstd {
            ZstdPolicy::Compress if !zstd => supercompression::compress(stored)?,
            ZstdPolicy::Inflate if zstd => Some(inflate()?),
            _ => None,
        };
        let converted = payload.is_some();
        node.flags = with_zstd(node.flags, zstd != converted);
        let payload = payload.map_or(Cow::Borrowed(stored), Cow::Owned);
        Ok(Some(Ready { node, payload, payload_len, converted }))
    }

    /// The node of a CONSTANT brick.
    fn constant(&self, node: &Node) -> Result<Node> {
        if !self.measure {
            return Ok(*node);
        }
        Ok(Node::new_constant(node.constant(self.volume.info().sample_type)?, own_flags(node), own_error(node)))
    }
}

/// Flags of the brick alone.
fn own_flags(node: &Node) -> NodeFlags {
    NodeFlags(node.flags.0 & !NodeFlags::ERROR_KNOWN.0)
}

/// A bound on the error of the brick alone: exact where it is lossless, else that of brick and descendants.
fn own_error(node: &Node) -> Option<f64> {
    if node.flags.contains(NodeFlags::LOSSLESS) {
        return Some(0.0);
    }
    node.flags.contains(NodeFlags::ERROR_KNOWN).then_some(f64::from(node.max_error))
}

fn with_zstd(flags: NodeFlags, zstd: bool) -> NodeFlags {
    NodeFlags(flags.0 & !NodeFlags::ZSTD.0 | if zstd { NodeFlags::ZSTD.0 } else { 0 })
}

/// A zerobit payload that names its codebook by its number in the new file: the payload's first word (spec 14.4).
fn renumbered(mut payload: Vec<u8>, books: &[u32], node: &Node) -> Result<Vec<u8>> {
    let Some((number, _)) = payload.split_first_chunk_mut::<4>() else {
        return Err(Error::at(crate::Code::Size, node.offset, "brick.payload", "no codebook is named"));
    };
    let old = u32::from_le_bytes(*number);
    let Some(new) = usize::try_from(old).ok().and_then(|old| books.get(old)) else {
        let message = format!("codebook {old} is named, but there are {}", books.len());
        return Err(Error::at(crate::Code::Ref, node.offset, "zerobit.codebook", message));
    };
    *number = new.to_le_bytes();
    Ok(payload)
}
