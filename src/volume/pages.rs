//! The index in memory: directory chunks and pages, each read when it is first needed (spec chapter 5).

use super::counted::Counted;
use crate::container::{self, CHUNK_PAGES, Head, Node, PageEntry};
use crate::error::Result;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

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
    checked: Box<[AtomicBool]>,
}

impl Page {
    /// A page of one node that did not come from the index.
    pub(super) fn single(node: Node) -> Self {
        Page { nodes: vec![node], checked: [AtomicBool::new(false)].into() }
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

    /// Whether the payload of `slot` has passed its checksum since the file was opened.
    #[inline]
    pub(super) fn is_checked(&self, slot: usize) -> bool {
        self.checked.get(slot).is_some_and(|c| c.load(Ordering::Acquire))
    }

    pub(super) fn set_checked(&self, slot: usize) {
        if let Some(c) = self.checked.get(slot) {
            c.store(true, Ordering::Release);
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
    let checked = nodes.iter().map(|_| AtomicBool::new(false)).collect();
    Ok(slot.page.get_or_init(|| Page { nodes, checked }))
}
