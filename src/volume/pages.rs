//! The index in memory: directory chunks and pages, each read when it is first needed (spec chapter 5).

use super::counted::Counted;
use crate::container::{self, CHUNK_PAGES, Head, Node, PageEntry};
use crate::error::Result;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// One slot per present directory chunk, in the order of the root directory: memory follows the file, not its dims.
pub(super) struct Pages {
    chunks: Box<[OnceLock<Box<[PageSlot]>>]>,
}

struct PageSlot {
    entry: PageEntry,
    page: OnceLock<Page>,
}

/// 8×8×8 nodes of one level in Morton order; trailing EMPTY ones are absent.
pub(super) struct Page {
    nodes: Vec<Node>,
    /// What has been learnt of each payload since the file was opened; see [`Known`].
    known: Box<[AtomicU64]>,
}

/// What has been learnt of a payload, packed in 64 bits: bit 0, the checksum holds; bits 1 to 7, one more than the layout
/// of a payload that can be read where it lies; bits 8 to 63, its offset in the file.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Known(u64);

impl Known {
    pub(super) const CHECKED: Known = Known(1);

    /// A checked payload that lies in memory as a part of the file. `None` where the numbers do not fit.
    pub(super) fn direct(offset: u64, layout: usize) -> Option<Known> {
        (layout < 127 && offset < 1 << 56).then(|| Known(offset << 8 | (layout as u64 + 1) << 1 | 1))
    }

    #[inline]
    pub(super) fn is_checked(self) -> bool {
        self.0 != 0
    }

    /// Offset in the file and layout of a payload that can be read where it lies.
    #[inline]
    pub(super) fn as_direct(self) -> Option<(usize, usize)> {
        let layout = (self.0 >> 1 & 127) as usize;
        // The offset was one of a slice in memory.
        #[allow(clippy::cast_possible_truncation, reason = "an offset into a slice")]
        (layout > 0).then(|| ((self.0 >> 8) as usize, layout - 1))
    }
}

impl Page {
    fn new(nodes: Vec<Node>) -> Self {
        let known = nodes.iter().map(|_| AtomicU64::new(0)).collect();
        Page { nodes, known }
    }

    /// A page of one node that did not come from the index.
    pub(super) fn single(node: Node) -> Self {
        Page::new(vec![node])
    }

    /// The node in `slot`; absent ones are EMPTY.
    #[inline]
    pub(super) fn node(&self, slot: usize) -> &Node {
        self.nodes.get(slot).unwrap_or(&Node::EMPTY)
    }

    /// All nodes that are stored.
    pub(super) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// What is known of the payload of `slot`.
    #[inline]
    pub(super) fn known(&self, slot: usize) -> Known {
        Known(self.known.get(slot).map_or(0, |k| k.load(Ordering::Acquire)))
    }

    pub(super) fn set_known(&self, slot: usize, known: Known) {
        if let Some(k) = self.known.get(slot) {
            k.store(known.0, Ordering::Release);
        }
    }
}

impl Pages {
    pub(super) fn new(head: &Head) -> Self {
        Pages { chunks: head.directory.iter().map(|_| OnceLock::new()).collect() }
    }

    /// The page with this ordinal, or `None` where all its nodes are EMPTY.
    #[inline]
    pub(super) fn page(&self, head: &Head, source: &Counted, ordinal: u64) -> Result<Option<&Page>> {
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
            None => load_page(head, source, slot, ordinal).map(Some),
        }
    }

    /// The page with this ordinal if it is in memory already.
    #[inline]
    pub(super) fn loaded(&self, head: &Head, ordinal: u64) -> Option<&Page> {
        #[allow(clippy::cast_possible_truncation, reason = "the index of a vector, and below 1024")]
        let (chunk, page) = ((ordinal / CHUNK_PAGES) as usize, (ordinal % CHUNK_PAGES) as usize);
        // Only where every chunk is present; sparse directories take the long way.
        if head.directory.get(chunk)?.ordinal != ordinal / CHUNK_PAGES {
            return None;
        }
        self.chunks.get(chunk)?.get()?.get(page)?.page.get()
    }

    /// Visits every page that is present, in file order of their ordinals.
    pub(super) fn each_present(
        &self,
        head: &Head,
        source: &Counted,
        mut visit: impl FnMut(u64, &Page) -> Result<()>,
    ) -> Result<()> {
        for (index, chunk) in head.directory.iter().enumerate() {
            let slots = match self.chunks[index].get() {
                Some(slots) => slots,
                None => self.load_chunk(head, source, index)?,
            };
            for (i, slot) in slots.iter().enumerate().filter(|(_, slot)| !slot.entry.is_empty()) {
                let ordinal = chunk.ordinal * CHUNK_PAGES + i as u64;
                match slot.page.get() {
                    Some(page) => visit(ordinal, page)?,
                    None => visit(ordinal, load_page(head, source, slot, ordinal)?)?,
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
}

#[cold]
fn load_page<'a>(head: &Head, source: &Counted, slot: &'a PageSlot, ordinal: u64) -> Result<&'a Page> {
    let len = slot.entry.byte_len();
    let nodes = match head.resident(slot.entry.offset, len as u64) {
        Some(bytes) => container::parse_page(bytes, &slot.entry, ordinal, head)?,
        None => container::parse_page(&source.read(slot.entry.offset, len)?, &slot.entry, ordinal, head)?,
    };
    Ok(slot.page.get_or_init(|| Page::new(nodes)))
}
