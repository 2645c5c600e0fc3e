//! Payloads of stored bricks: fetched, checked once against their CRC, inflated, kept (spec chapter 6).

use super::At;
use super::codecs::{Entry, Layout};
use super::open::Volume;
use super::pages::{Known, Page};
use crate::checksum::crc32;
use crate::container::{Node, NodeFlags, NodeKind};
use crate::error::{Code, Error, Result};
use crate::geometry::Coord;
use crate::limits;
use crate::supercompression;
use quick_cache::Weighter;
use quick_cache::sync::Cache;
use std::ops::Deref;
use std::sync::Arc;

/// An uncompressed payload: a part of the file in memory, or a shared copy.
#[derive(Clone)]
pub(super) enum Payload<'a> {
    Slice(&'a [u8]),
    Shared(Arc<[u8]>),
}

impl Deref for Payload<'_> {
    type Target = [u8];
    #[inline]
    fn deref(&self) -> &[u8] {
        match self {
            Payload::Slice(bytes) => bytes,
            Payload::Shared(bytes) => bytes,
        }
    }
}

/// All that decides about the bytes of a payload: a hostile index can name one offset with several lengths or checksums.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Key {
    offset: u64,
    stored_len: u32,
    crc: u32,
    zstd: bool,
    payload_lens: [u64; 2],
}

impl Key {
    fn of(node: &Node, layout: &Layout) -> Key {
        let zstd = node.flags.contains(NodeFlags::ZSTD);
        Key { offset: node.offset, stored_len: node.stored_len, crc: node.crc, zstd, payload_lens: layout.payload_lens }
    }
}

#[derive(Clone)]
struct ByBytes;

impl Weighter<Key, Arc<[u8]>> for ByBytes {
    fn weight(&self, _: &Key, payload: &Arc<[u8]>) -> u64 {
        payload.len() as u64 + 64
    }
}

/// Payloads that had to be copied or inflated, by file offset, within a budget of bytes.
pub(super) struct Bricks {
    cache: Cache<Key, Arc<[u8]>, ByBytes>,
}

impl Bricks {
    pub(super) fn new(bytes: u64) -> Self {
        // The estimate sets the number of shards' slots, not the memory: that follows the weights.
        Bricks { cache: Cache::with_weighter(1024, bytes, ByBytes) }
    }
}

/// A brick found in the index.
pub(super) struct Found<'a> {
    pub(super) page: Option<&'a Page>,
    pub(super) slot: usize,
}

impl<'a> Found<'a> {
    #[inline]
    pub(super) fn node(&self) -> &'a Node {
        self.page.map_or(&Node::EMPTY, |page| page.node(self.slot))
    }
}

impl Volume {
    /// Finds brick `brick` of the tree and level; the caller has checked that it exists.
    #[inline]
    pub(super) fn find(&self, tree: u32, lod: u8, brick: Coord) -> Result<Found<'_>> {
        let (ordinal, slot) = self.head.octree.locate(tree, lod, brick);
        let page = self.pages.page(&self.head, &self.source, ordinal).map_err(|e| self.replaced_or(e))?;
        Ok(Found { page, slot })
    }

    /// Codec entry and index of the layout of a stored brick.
    #[inline]
    pub(super) fn codec_of(&self, node: &Node, lod: u8, brick: Coord) -> Result<(&Entry, usize)> {
        let entry = self.codecs.get(node.codec)?;
        if entry.wants_books() {
            entry.supply(self.codebooks()?);
        }
        let level = self.head.octree.levels[usize::from(lod)].extent;
        Ok((entry, self.codecs.layout_index(entry, lod, brick, level)))
    }

    /// The payload of a stored brick, uncompressed and checked.
    #[inline]
    pub(super) fn payload(&self, found: &Found<'_>, layout: usize) -> Result<Payload<'_>> {
        let node = found.node();
        if !node.flags.contains(NodeFlags::ZSTD)
            && found.page.is_some_and(|p| p.known(found.slot).is_checked())
            && let Some(bytes) = self.stored_slice(node)
        {
            return Ok(Payload::Slice(bytes));
        }
        self.payload_slow(found, layout, None)
    }

    /// The stored bytes, where the whole file lies in memory.
    #[inline]
    fn stored_slice(&self, node: &Node) -> Option<&[u8]> {
        let start = usize::try_from(node.offset).ok()?;
        self.source.as_slice()?.get(start..start.checked_add(node.stored_len as usize)?)
    }

    /// Whether [`Volume::payload`] would have to read: the ranges of several bricks can then be read together.
    pub(super) fn wants_read(&self, node: &Node, layout: usize) -> bool {
        node.kind == NodeKind::Stored
            && self.source.as_slice().is_none()
            && self.bricks.cache.peek(&Key::of(node, self.codecs.layout(layout))).is_none()
    }

    /// The first use of a payload; `stored` are its bytes where a merged read has brought them already.
    pub(super) fn payload_slow(&self, found: &Found<'_>, layout: usize, stored: Option<&[u8]>) -> Result<Payload<'_>> {
        let node = found.node();
        let layout_index = layout;
        let layout = self.codecs.layout(layout);
        let key = Key::of(node, layout);
        if let Some(shared) = self.bricks.cache.get(&key) {
            return Ok(Payload::Shared(shared));
        }
        limits::check("node.stored_len", u64::from(node.stored_len), limits::MAX_BRICK_BYTES)?;
        let [least, most] = layout.payload_lens;
        limits::check("brick", least, self.limits.brick_bytes)?;
        let zstd = node.flags.contains(NodeFlags::ZSTD);
        // spec: BRK-7
        if !zstd && !layout.allows(u64::from(node.stored_len)) {
            return Err(Error::at(
                Code::Size,
                node.offset,
                "node.stored_len",
                format!("{} bytes stored where the codec needs {least} to {most}", node.stored_len),
            ));
        }
        let bytes = match stored {
            Some(bytes) => std::borrow::Cow::Borrowed(bytes),
            None => self.source.read(node.offset, node.stored_len as usize)?,
        };
        if !found.page.is_some_and(|p| p.known(found.slot).is_checked()) {
            let computed = crc32(&bytes);
            if computed != node.crc {
                return Err(self.replaced_or(Error::at(
                    Code::BrickCrc,
                    node.offset,
                    "brick.payload",
                    format!(
                        "CRC {computed:08x} computed, {:08x} stored; the brick is damaged, salvage reads the rest",
                        node.crc
                    ),
                )));
            }
            if let Some(page) = found.page {
                page.set_known(found.slot, Known::CHECKED);
            }
        }
        if zstd {
            let lens = least..=most.min(self.limits.brick_bytes);
            let inflated = supercompression::inflate(&bytes, lens, node.offset, "brick.payload")?;
            return Ok(self.keep(key, inflated.into()));
        }
        if let Some(bytes) = self.stored_slice(node) {
            if let (Some(page), Some(_)) = (found.page, layout.s3dc) {
                page.set_known(found.slot, Known::direct(node.offset, layout_index).unwrap_or(Known::CHECKED));
            }
            return Ok(Payload::Slice(bytes));
        }
        Ok(self.keep(key, bytes.into()))
    }

    fn keep(&self, key: Key, payload: Arc<[u8]>) -> Payload<'_> {
        self.bricks.cache.insert(key, payload.clone());
        Payload::Shared(payload)
    }

    /// Bricks of the level that `at` names, per axis.
    pub(super) fn brick_count(&self, at: At) -> crate::geometry::Extent {
        self.head.octree.levels[usize::from(at.lod)].bricks
    }
}
