//! The index in memory: directory chunks and pages, each read when it is first needed (spec chapter 5).

use super::counted::Counted;
use super::fetch::{MERGE_GAP, MERGE_MAX};
use crate::container::{self, CHUNK_PAGES, Head, Node, NodeKind, PageEntry};
use crate::error::{Code, Error, Result};
use crate::geometry::{morton8, unmorton8};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// One slot per present directory chunk, in the order of the root directory: memory follows the file, not its dims.
pub(super) struct Pages {
    chunks: Box<[OnceLock<Box<[PageSlot]>>]>,
    /// Bytes of the pages that have been loaded. Pages do not overlap, so that they are never longer than their section:
    /// the memory of an index is bounded by the file.
    loaded: AtomicU64,
}

pub(super) struct PageSlot {
    entry: PageEntry,
    page: OnceLock<Page>,
}

impl PageSlot {
    /// The page, if it is in memory.
    #[inline]
    pub(super) fn loaded(&self) -> Option<&Page> {
        self.page.get()
    }
}

/// Bricks of a page.
const BRICKS: usize = 512;

/// 8×8×8 nodes of one level in Morton order; trailing EMPTY ones are absent.
pub(super) struct Page {
    nodes: Vec<Node>,
    /// What has been learnt of each brick, x fastest, then y, then z: random voxels need no Morton order.
    known: Box<[AtomicU64; BRICKS]>,
}

/// What has been learnt of a brick since the file was opened, in one word.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Known(u64);

/// The low byte of a [`Known`]: 0 nothing yet; else one of these, or one more than the number of a layout.
const CONSTANT: u64 = 255;
const CHECKED: u64 = 254;

impl Known {
    /// The stored payload matches its checksum.
    pub(super) const CHECKED: Known = Known(CHECKED);

    /// Every voxel has this raw value.
    pub(super) fn constant(raw: u32) -> Known {
        Known(u64::from(raw) << 8 | CONSTANT)
    }

    /// A checked payload that lies in memory as a part of the file. `None` where the numbers do not fit.
    pub(super) fn direct(offset: u64, layout: usize) -> Option<Known> {
        ((layout as u64) < CHECKED - 1 && offset < 1 << 56).then(|| Known(offset << 8 | (layout as u64 + 1)))
    }

    #[inline]
    pub(super) fn is_checked(self) -> bool {
        self.0 != 0
    }

    /// The raw value of all voxels.
    #[inline]
    pub(super) fn as_constant(self) -> Option<u32> {
        #[allow(clippy::cast_possible_truncation, reason = "32 bits were put in")]
        (self.0 & 255 == CONSTANT).then_some((self.0 >> 8) as u32)
    }

    /// Offset in the file and number of the layout of a payload that can be read where it lies.
    #[inline]
    pub(super) fn as_direct(self) -> Option<(usize, usize)> {
        let layout = self.0 & 255;
        #[allow(clippy::cast_possible_truncation, reason = "an offset into a slice that lies in memory")]
        (layout.wrapping_sub(1) < CHECKED - 1).then(|| ((self.0 >> 8) as usize, layout as usize - 1))
    }
}

impl Page {
    /// A page of these nodes; `null` is the raw null value.
    fn new(nodes: Vec<Node>, null: u32) -> Self {
        let known = Box::new([const { AtomicU64::new(0) }; BRICKS]);
        for (slot, known) in known.iter().enumerate() {
            let [x, y, z] = [slot & 7, slot >> 3 & 7, slot >> 6].map(|v| v as u32);
            let node = nodes.get(morton8([x, y, z])).unwrap_or(&Node::EMPTY);
            match node.kind {
                NodeKind::Stored => {}
                NodeKind::Constant => known.store(Known::constant(node.offset as u32).0, Ordering::Relaxed),
                NodeKind::Empty => known.store(Known::constant(null).0, Ordering::Relaxed),
            }
        }
        Page { nodes, known }
    }

    /// A page of one node that did not come from the index.
    pub(super) fn single(node: Node) -> Self {
        Page::new(vec![node], 0)
    }

    /// The node in Morton slot `slot`; absent ones are EMPTY.
    #[inline]
    pub(super) fn node(&self, slot: usize) -> &Node {
        self.nodes.get(slot).unwrap_or(&Node::EMPTY)
    }

    /// All nodes that are stored.
    pub(super) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// What is known of the brick at x + 8·(y + 8·z) of the page; only the low nine bits of `linear` count.
    #[inline]
    pub(super) fn known_at(&self, linear: u32) -> Known {
        Known(self.known[linear as usize % BRICKS].load(Ordering::Acquire))
    }

    /// What is known of the brick in Morton slot `slot`.
    pub(super) fn known(&self, slot: usize) -> Known {
        self.known_at(linear(slot))
    }

    pub(super) fn set_known(&self, slot: usize, known: Known) {
        self.known[linear(slot) as usize % BRICKS].store(known.0, Ordering::Release);
    }
}

fn linear(slot: usize) -> u32 {
    let [x, y, z] = unmorton8(slot);
    x | y << 3 | z << 6
}

impl Pages {
    pub(super) fn new(head: &Head) -> Self {
        Pages { chunks: head.directory.iter().map(|_| OnceLock::new()).collect(), loaded: AtomicU64::new(0) }
    }

    /// The page with this ordinal, or `None` where all its nodes are EMPTY.
    #[inline]
    pub(super) fn page(&self, head: &Head, source: &Counted, ordinal: u64) -> Result<Option<&Page>> {
        if let Some(why) = &head.directory_lost {
            return Err(Error::new(Code::DirCrc, "PDIR", why.clone()));
        }
        let chunk = ordinal / CHUNK_PAGES;
        // Mostly every chunk is present, so that the first guess is right.
        let guess = usize::try_from(chunk).unwrap_or(usize::MAX);
        let index = match head.directory.get(guess) {
            Some(c) if c.ordinal == chunk => guess,
            _ => match head.directory.binary_search_by_key(&chunk, |c| c.ordinal) {
                Ok(index) => index,
                Err(_) => return Ok(None),
            },
        };
        let slots = match self.chunks[index].get() {
            Some(slots) => slots,
            None => self.load_chunk(head, source, index)?,
        };
        #[allow(clippy::cast_possible_truncation, reason = "below 1024")]
        let Some(slot) = slots.get((ordinal % CHUNK_PAGES) as usize) else { return Ok(None) };
        if slot.entry.is_empty() {
            return Ok(None);
        }
        match slot.page.get() {
            Some(page) => Ok(Some(page)),
            None => self.load_page(head, source, slot, ordinal).map(Some),
        }
    }

    /// The slots of pages `first..first + count`, where one chunk holds them all; loads the chunk, but no page.
    pub(super) fn slots(&self, head: &Head, source: &Counted, first: u64, count: u64) -> Result<Option<&[PageSlot]>> {
        let (chunk, start) = (first / CHUNK_PAGES, usize::try_from(first % CHUNK_PAGES).expect("below 1024"));
        if count == 0 || (first + count - 1) / CHUNK_PAGES != chunk {
            return Ok(None);
        }
        let Ok(index) = head.directory.binary_search_by_key(&chunk, |c| c.ordinal) else { return Ok(None) };
        let slots = match self.chunks[index].get() {
            Some(slots) => slots,
            None => self.load_chunk(head, source, index)?,
        };
        Ok(slots.get(start..))
    }

    /// Visits every page that is present, in file order of their ordinals.
    pub(super) fn each_present(
        &self,
        head: &Head,
        source: &Counted,
        visit: impl FnMut(u64, &Page) -> Result<()>,
    ) -> Result<()> {
        self.each_wanted(head, source, |_| true, visit)
    }

    /// Visits those pages that are present and wanted; reads no other page, nor a chunk without such.
    pub(super) fn each_wanted(
        &self,
        head: &Head,
        source: &Counted,
        wanted: impl Fn(u64) -> bool,
        mut visit: impl FnMut(u64, &Page) -> Result<()>,
    ) -> Result<()> {
        for (index, chunk) in head.directory.iter().enumerate() {
            let first = chunk.ordinal * CHUNK_PAGES;
            if !(first..first + u64::from(chunk.count)).any(&wanted) {
                continue;
            }
            let slots = match self.chunks[index].get() {
                Some(slots) => slots,
                None => self.load_chunk(head, source, index)?,
            };
            let ordinals: Vec<u64> = (first..first + slots.len() as u64).filter(|o| wanted(*o)).collect();
            self.load(head, source, &ordinals)?;
            for (i, slot) in slots.iter().enumerate().filter(|(_, slot)| !slot.entry.is_empty()) {
                let ordinal = first + i as u64;
                if !wanted(ordinal) {
                    continue;
                }
                match slot.page.get() {
                    Some(page) => visit(ordinal, page)?,
                    None => visit(ordinal, self.load_page(head, source, slot, ordinal)?)?,
                }
            }
        }
        Ok(())
    }

    #[cold]
    fn load_chunk(&self, head: &Head, source: &Counted, index: usize) -> Result<&[PageSlot]> {
        let chunk = &head.directory[index];
        let len = chunk.byte_len();
        let entries = match head.resident(chunk.offset, len as u64) {
            Some(bytes) => container::parse_chunk(bytes, chunk, head)?,
            None => container::parse_chunk(&source.read(chunk.offset, len)?, chunk, head)?,
        };
        let slots = entries.into_iter().map(|entry| PageSlot { entry, page: OnceLock::new() }).collect();
        // Another thread may have been faster: then its result stands, which is the same.
        Ok(self.chunks[index].get_or_init(|| slots))
    }

    /// Reads those pages that are not there yet, neighbouring ones together. A page that is damaged is left to
    /// [`Pages::page`], which says so.
    pub(super) fn load(&self, head: &Head, source: &Counted, ordinals: &[u64]) -> Result<()> {
        let mut missing: Vec<(&PageSlot, u64)> = Vec::new();
        for &ordinal in ordinals {
            if let Some(slot) = self.slots(head, source, ordinal, 1)?.and_then(<[PageSlot]>::first)
                && !slot.entry.is_empty()
                && slot.page.get().is_none()
                && head.resident(slot.entry.offset, slot.entry.byte_len() as u64).is_none()
            {
                missing.push((slot, ordinal));
            }
        }
        if missing.len() < 2 {
            return Ok(());
        }
        missing.sort_by_key(|(slot, _)| slot.entry.offset);
        let mut runs: Vec<(u64, u64, usize)> = Vec::new();
        for (i, (slot, _)) in missing.iter().enumerate() {
            let (start, end) = (slot.entry.offset, slot.entry.offset.saturating_add(slot.entry.byte_len() as u64));
            match runs.last_mut() {
                Some(run) if start <= run.1.saturating_add(MERGE_GAP) && end.max(run.1) - run.0 <= MERGE_MAX => {
                    (run.1, run.2) = (run.1.max(end), i + 1);
                }
                _ => runs.push((start, end, i + 1)),
            }
        }
        let ranges: Vec<_> =
            runs.iter().map(|run| (run.0, usize::try_from(run.1 - run.0).expect("at most MERGE_MAX"))).collect();
        let mut rest = &missing[..];
        for (bytes, run) in source.read_many(&ranges)?.iter().zip(&runs) {
            let (now, later) = rest.split_at(run.2 - (missing.len() - rest.len()));
            for (slot, ordinal) in now {
                let from = usize::try_from(slot.entry.offset - run.0).expect("inside the run");
                let bytes = &bytes[from..from + slot.entry.byte_len()];
                if self.has_room(head, slot)
                    && let Ok(nodes) = container::parse_page(bytes, &slot.entry, *ordinal, head)
                {
                    self.put(head, slot, nodes);
                }
            }
            rest = later;
        }
        Ok(())
    }

    #[cold]
    fn load_page<'a>(&self, head: &Head, source: &Counted, slot: &'a PageSlot, ordinal: u64) -> Result<&'a Page> {
        let len = slot.entry.byte_len();
        if !self.has_room(head, slot) {
            // Another thread may have loaded and counted this very page in the meantime.
            return slot.page.get().ok_or_else(|| {
                Error::at(
                    Code::SectionOverlap,
                    slot.entry.offset,
                    "page_entry.offset",
                    "the pages are longer than their section: some overlap, the index is not to be trusted",
                )
            });
        }
        let nodes = match head.resident(slot.entry.offset, len as u64) {
            Some(bytes) => container::parse_page(bytes, &slot.entry, ordinal, head)?,
            None => container::parse_page(&source.read(slot.entry.offset, len)?, &slot.entry, ordinal, head)?,
        };
        self.put(head, slot, nodes);
        Ok(slot.page.get().expect("set by this thread or another"))
    }

    /// Whether another page may be loaded: all of them are no longer than their section.
    fn has_room(&self, head: &Head, slot: &PageSlot) -> bool {
        let section = head.section_range(*b"PAGE");
        self.loaded.load(Ordering::SeqCst) + slot.entry.byte_len() as u64 <= section.end - section.start
    }

    fn put(&self, head: &Head, slot: &PageSlot, nodes: Vec<Node>) {
        // Counted by the one thread whose page stays.
        if slot.page.set(Page::new(nodes, head.descriptor.null_sample().to_raw())).is_ok() {
            self.loaded.fetch_add(slot.entry.byte_len() as u64, Ordering::SeqCst);
        }
    }
}
