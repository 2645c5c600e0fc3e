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
use quick_cache::sync::{Cache, DefaultLifecycle, GuardResult, PlaceholderGuard};
use quick_cache::{DefaultHashBuilder, Weighter};
use std::borrow::Cow;
use std::ops::{Deref, Range};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// log2 of the edge of a page, in bricks.
const PAGE_LOG2: u32 = 3;

/// An uncompressed payload: a part of the file in memory, or a shared copy.
#[derive(Clone)]
pub(super) enum Payload<'a> {
    Slice(&'a [u8]),
    Shared(Arc<[u8]>),
    /// A part of what one read brought.
    Part(Arc<Buffer>, Range<usize>),
}

impl Deref for Payload<'_> {
    type Target = [u8];
    #[inline]
    fn deref(&self) -> &[u8] {
        match self {
            Payload::Slice(bytes) => bytes,
            Payload::Shared(bytes) => bytes,
            Payload::Part(buffer, range) => &buffer.bytes[range.clone()],
        }
    }
}

/// Memory that is used again and again: fresh memory costs as much as the bytes that are received into it.
#[derive(Clone, Default)]
pub(super) struct Pool(Arc<Mutex<Vec<Vec<u8>>>>);

impl Pool {
    /// A buffer of `len` bytes, whatever is in them.
    pub(super) fn take(&self, len: usize) -> Buffer {
        let mut bytes = self.lock().pop().unwrap_or_default();
        bytes.resize(len, 0);
        Buffer { bytes, pool: self.clone() }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Vec<u8>>> {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

/// Bytes out of a [`Pool`], to which they go back.
pub(super) struct Buffer {
    pub(super) bytes: Vec<u8>,
    pool: Pool,
}

impl Drop for Buffer {
    fn drop(&mut self) {
        self.pool.lock().push(std::mem::take(&mut self.bytes));
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

type Guard<'a> = PlaceholderGuard<'a, Key, Arc<[u8]>, ByBytes, DefaultHashBuilder, DefaultLifecycle<Key, Arc<[u8]>>>;

/// The right and duty to bring one payload into the cache; others wait for it.
pub(super) struct Claim<'a> {
    guard: Guard<'a>,
    layout: usize,
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

    /// Whether the stored payload has been held against its CRC before.
    fn is_checked(&self) -> bool {
        self.page.is_some_and(|page| page.known(self.slot).is_checked())
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

    /// Reads the pages of bricks `first..=last` that are not there yet, neighbouring ones together.
    pub(super) fn load_pages(&self, tree: u32, lod: u8, first: Coord, last: Coord) -> Result<()> {
        let [first, last] = [first, last].map(|c| c.map(|v| v >> PAGE_LOG2));
        if first == last {
            return Ok(()); // the first brick brings it
        }
        let mut ordinals = Vec::new();
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    ordinals.push(self.head.octree.locate(tree, lod, [x, y, z].map(|v| v << PAGE_LOG2)).0);
                }
            }
        }
        self.pages.load(&self.head, &self.source, &ordinals).map_err(|e| self.replaced_or(e))
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
            && found.is_checked()
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

    /// Whether [`Volume::payload`] would have to read, and may: the ranges of several bricks can then be read together.
    pub(super) fn wants_read(&self, found: &Found<'_>, layout: usize) -> bool {
        let node = found.node();
        let layout = self.codecs.layout(layout);
        let lent = self.is_lent(node);
        if node.kind != NodeKind::Stored || lent && found.is_checked() {
            return false;
        }
        // Where it must not be read, `payload_slow` says why.
        self.check_stored(node, layout).is_ok() && (lent || self.bricks.cache.peek(&Key::of(node, layout)).is_none())
    }

    /// Whether the payload is used where it lies, so that nothing is kept of it.
    fn is_lent(&self, node: &Node) -> bool {
        !node.flags.contains(NodeFlags::ZSTD) && self.source.as_slice().is_some()
    }

    /// What a node says of its payload, held against limits and codec before anything is read.
    fn check_stored(&self, node: &Node, layout: &Layout) -> Result<()> {
        limits::check("node.stored_len", u64::from(node.stored_len), limits::MAX_BRICK_BYTES)?;
        let [least, most] = layout.payload_lens;
        limits::check("brick", least, self.limits.brick_bytes)?;
        // spec: BRK-7
        if !node.flags.contains(NodeFlags::ZSTD) && !layout.allows(u64::from(node.stored_len)) {
            return Err(Error::at(
                Code::Size,
                node.offset,
                "node.stored_len",
                format!("{} bytes stored where the codec needs {least} to {most}", node.stored_len),
            ));
        }
        Ok(())
    }

    /// The first use of a payload; `stored` are its bytes where a merged read has brought them already. Threads that want
    /// the same payload wait for the one that reads it.
    pub(super) fn payload_slow(&self, found: &Found<'_>, layout: usize, stored: Option<&[u8]>) -> Result<Payload<'_>> {
        let node = found.node();
        if let Some(stored) = stored {
            return self.payload_of(found, layout, Cow::Borrowed(stored));
        }
        let read = || {
            self.check_stored(node, self.codecs.layout(layout))?;
            self.source.read(node.offset, node.stored_len as usize)
        };
        if self.is_lent(node) {
            return self.payload_of(found, layout, read()?);
        }
        let key = Key::of(node, self.codecs.layout(layout));
        // The guard is held while this thread reads and inflates, never while it waits for another thread's work.
        match self.bricks.cache.get_value_or_guard(&key, None) {
            GuardResult::Value(shared) => Ok(Payload::Shared(shared)),
            GuardResult::Guard(guard) => self.fulfil(Claim { guard, layout }, found, &read()?),
            GuardResult::Timeout => self.payload_of(found, layout, read()?),
        }
    }

    /// Takes it on to bring a payload; `None` where it is there already or another thread is bringing it.
    pub(super) fn claim(&self, found: &Found<'_>, layout: usize) -> Option<Claim<'_>> {
        let key = Key::of(found.node(), self.codecs.layout(layout));
        match self.bricks.cache.get_value_or_guard(&key, Some(Duration::ZERO)) {
            GuardResult::Guard(guard) => Some(Claim { guard, layout }),
            GuardResult::Value(_) | GuardResult::Timeout => None,
        }
    }

    /// Keeps what was claimed, for all who wait for it; where it is damaged, they read it for themselves.
    pub(super) fn fulfil(&self, claim: Claim<'_>, found: &Found<'_>, stored: &[u8]) -> Result<Payload<'_>> {
        let shared = self.inflated(found, claim.layout, stored.into())?;
        let _ = claim.guard.insert(shared.clone()); // it may be too large to be kept
        Ok(Payload::Shared(shared))
    }

    /// The payload whose stored bytes are a part of `buffer`; not kept.
    pub(super) fn payload_in(
        &self,
        found: &Found<'_>,
        layout: usize,
        buffer: &Arc<Buffer>,
        range: Range<usize>,
    ) -> Result<Payload<'_>> {
        let stored = &buffer.bytes[range.clone()];
        if found.node().flags.contains(NodeFlags::ZSTD) {
            return Ok(Payload::Shared(self.inflated(found, layout, stored.into())?));
        }
        self.check_payload(found, stored)?;
        Ok(Payload::Part(buffer.clone(), range))
    }

    /// The payload whose stored bytes these are; kept where it is not lent.
    fn payload_of(&self, found: &Found<'_>, layout: usize, bytes: Cow<'_, [u8]>) -> Result<Payload<'_>> {
        let node = found.node();
        match self.stored_slice(node).filter(|_| self.is_lent(node)) {
            Some(lent) => {
                self.check_payload(found, &bytes)?;
                if let (Some(page), Some(_)) = (found.page, &self.codecs.layout(layout).s3dc) {
                    page.set_known(found.slot, Known::direct(node.offset, layout).unwrap_or(Known::CHECKED));
                }
                Ok(Payload::Slice(lent))
            }
            None => {
                let shared = self.inflated(found, layout, bytes)?;
                self.bricks.cache.insert(Key::of(node, self.codecs.layout(layout)), shared.clone());
                Ok(Payload::Shared(shared))
            }
        }
    }

    /// Checks stored bytes and takes them out of their zstd frame.
    fn inflated(&self, found: &Found<'_>, layout: usize, bytes: Cow<'_, [u8]>) -> Result<Arc<[u8]>> {
        let node = found.node();
        self.check_payload(found, &bytes)?;
        if !node.flags.contains(NodeFlags::ZSTD) {
            return Ok(bytes.into());
        }
        let [least, most] = self.codecs.layout(layout).payload_lens;
        let lens = least..=most.min(self.limits.brick_bytes);
        Ok(supercompression::inflate(&bytes, lens, node.offset, "brick.payload")?.into())
    }

    /// Holds stored bytes against their CRC: once where they are used where they lie, else whenever they are read. Bytes
    /// that are read again may be another file's.
    fn check_payload(&self, found: &Found<'_>, bytes: &[u8]) -> Result<()> {
        let node = found.node();
        if self.is_lent(node) && found.is_checked() {
            return Ok(());
        }
        let computed = crc32(bytes);
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
        Ok(())
    }

    /// Bricks of the level that `at` names, per axis.
    pub(super) fn brick_count(&self, at: At) -> crate::geometry::Extent {
        self.head.octree.levels[usize::from(at.lod)].bricks
    }
}
