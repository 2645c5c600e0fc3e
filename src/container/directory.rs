//! The directory: root entries, chunks of page entries, and pages of nodes (spec chapter 5).
//!
//! Root entry (24 bytes, one per chunk present): chunk ordinal u64, offset u64, CRC u32, count u16, flags u16.
//! Page entry (16 bytes, 1,024 per chunk): page offset u64, CRC u32, count u16, flags u16; all zero: every node EMPTY.

use super::head::Head;
use super::node::{NODE_BYTES, Node, NodeKind};
use super::octree::Octree;
use super::{GUARD_BYTES, leader::LEADER_BYTES, section, wire};
use crate::checksum::crc32;
use crate::error::{Code, Error, Result};
use binrw::binrw;

/// Page entries of one chunk.
pub const CHUNK_PAGES: u64 = 1024;
/// Nodes of one page.
pub const PAGE_NODES: usize = 512;
/// Bytes of a root entry.
pub(super) const REF_BYTES: usize = 24;
/// Bytes of a page entry.
pub(super) const PAGE_ENTRY_BYTES: usize = 16;

/// Root entry: where a chunk of the directory lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[binrw]
#[brw(little)]
pub struct ChunkRef {
    /// Which chunk: page ordinal / 1024.
    pub ordinal: u64,
    /// First byte of the chunk.
    pub offset: u64,
    /// CRC-32 of the chunk's stored bytes.
    pub crc: u32,
    /// Page entries stored; trailing zero entries are not.
    pub count: u16,
    flags: u16,
}

impl ChunkRef {
    pub(super) fn new(ordinal: u64, offset: u64, bytes: &[u8]) -> Self {
        let count = u16::try_from(bytes.len() / PAGE_ENTRY_BYTES).expect("at most 1024 entries");
        ChunkRef { ordinal, offset, crc: crc32(bytes), count, flags: 0 }
    }

    /// Bytes of the chunk.
    #[must_use]
    pub fn byte_len(&self) -> usize {
        usize::from(self.count) * PAGE_ENTRY_BYTES
    }
}

/// Where a page of nodes lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[binrw]
#[brw(little)]
pub struct PageEntry {
    /// First byte of the page.
    pub offset: u64,
    /// CRC-32 of the page's stored bytes.
    pub crc: u32,
    /// Nodes stored; trailing all-zero nodes are not.
    pub count: u16,
    flags: u16,
}

impl PageEntry {
    pub(super) const EMPTY: PageEntry = PageEntry { offset: 0, crc: 0, count: 0, flags: 0 };

    pub(super) fn new(offset: u64, bytes: &[u8]) -> Self {
        let count = u16::try_from(bytes.len() / NODE_BYTES).expect("at most 512 nodes");
        PageEntry { offset, crc: crc32(bytes), count, flags: 0 }
    }

    /// Whether every node of the page is EMPTY: then nothing is stored.
    #[must_use]
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Bytes of the page.
    #[must_use]
    pub fn byte_len(&self) -> usize {
        usize::from(self.count) * NODE_BYTES
    }
}

/// Bytes of the root directory.
pub(super) fn write_refs(refs: &[ChunkRef]) -> Vec<u8> {
    refs.iter().flat_map(wire::write::<REF_BYTES, _>).collect()
}

/// Bytes of a chunk.
pub(super) fn write_entries(entries: &[PageEntry]) -> Vec<u8> {
    entries.iter().flat_map(wire::write::<PAGE_ENTRY_BYTES, _>).collect()
}

/// Bytes of a page, trailing EMPTY subtrees left out (spec: IDX-6).
pub(super) fn write_nodes(nodes: &[Node]) -> Vec<u8> {
    let count = nodes.iter().rposition(|n| !n.is_empty_subtree()).map_or(0, |i| i + 1);
    nodes[..count].iter().flat_map(Node::write_to).collect()
}

/// Reads the root directory, whose bytes lie at `at`: its length has been checked to be whole entries.
///
/// # Errors
/// `E_RESERVED`, `E_ORDER`, `E_DUP`, `E_REF`, `E_PARAM`, `E_ALIGN`, `E_SECTION_RANGE`.
pub(super) fn parse_refs(bytes: &[u8], at: u64, octree: &Octree, file_len: u64) -> Result<Vec<ChunkRef>> {
    let mut refs: Vec<ChunkRef> = Vec::with_capacity(bytes.len() / REF_BYTES);
    let mut total = 0u64;
    for (bytes, at) in bytes.chunks_exact(REF_BYTES).zip((at..).step_by(REF_BYTES)) {
        let r: ChunkRef = wire::read(bytes, at, "PDIR")?;
        let bad = |code, offset, field, message: String| Err(Error::at(code, at + offset, field, message));
        wire::check_zero(&r.flags.to_le_bytes(), at + 22, "PDIR.flags")?;
        if let Some(last) = refs.last() {
            let (a, b) = (last.ordinal, r.ordinal);
            if a == b {
                return bad(Code::Dup, 0, "PDIR.ordinal", format!("chunk {b} is listed twice"));
            }
            if a > b {
                return bad(Code::Order, 0, "PDIR.ordinal", format!("chunk {b} follows chunk {a}"));
            }
        }
        // spec: IDX-5
        let count = u64::from(r.count);
        if !(1..=CHUNK_PAGES).contains(&count) {
            return bad(Code::Param, 20, "PDIR.count", format!("{count} page entries; a chunk has 1 to 1024"));
        }
        let last_page = r.ordinal.checked_mul(CHUNK_PAGES).and_then(|n| n.checked_add(count - 1));
        if last_page.is_none_or(|n| n >= octree.page_count()) {
            let pages = octree.page_count();
            return bad(
                Code::Ref,
                0,
                "PDIR.ordinal",
                format!("chunk {} passes the {pages} pages there are", r.ordinal),
            );
        }
        if !r.offset.is_multiple_of(16) {
            return bad(Code::Align, 8, "PDIR.offset", format!("{} is no multiple of 16", r.offset));
        }
        if r.offset.checked_add(r.byte_len() as u64).is_none_or(|end| end > file_len) {
            return bad(
                Code::SectionRange,
                8,
                "PDIR.offset",
                format!("the chunk at {} passes the file's end", r.offset),
            );
        }
        // Chunks that shared bytes would let a small file ask for any amount of memory.
        total = total.saturating_add(r.byte_len() as u64);
        if total > file_len {
            let message = "the chunks of the directory are longer than the file: some overlap".to_owned();
            return bad(Code::SectionOverlap, 8, "PDIR.offset", message);
        }
        refs.push(r);
    }
    Ok(refs)
}

/// Reads a chunk's page entries from its stored bytes (spec: IDX-16, IDX-6).
///
/// # Errors
/// `E_DIR_CRC`; for an entry `E_RESERVED`, `E_CANON`, `E_PARAM`, `E_ALIGN`, `E_SECTION_RANGE`, each with its offset;
/// `E_SIZE` where `bytes` is not [`ChunkRef::byte_len`] long.
pub fn parse_chunk(bytes: &[u8], chunk: &ChunkRef, head: &Head) -> Result<Vec<PageEntry>> {
    check_len(bytes, chunk.byte_len(), chunk.offset, "directory")?;
    let computed = crc32(bytes);
    if computed != chunk.crc {
        let message = format!(
            "CRC {computed:08x} computed, {:08x} stored; the directory is damaged, fetch the file again or use salvage",
            chunk.crc
        );
        return Err(Error::at(Code::DirCrc, chunk.offset, "directory", message));
    }
    let section = head.section_range(section::PAGE);
    let entries = bytes.chunks_exact(PAGE_ENTRY_BYTES).zip((chunk.offset..).step_by(PAGE_ENTRY_BYTES));
    entries
        .map(|(bytes, at)| {
            let p: PageEntry = wire::read(bytes, at, "page_entry")?;
            let bad = |code, offset, field, message: String| Err(Error::at(code, at + offset, field, message));
            wire::check_zero(&p.flags.to_le_bytes(), at + 14, "page_entry.flags")?;
            // spec: IDX-6
            if p.count == 0 {
                return if p == PageEntry::EMPTY {
                    Ok(p)
                } else {
                    bad(Code::Canon, 0, "page_entry", "a page without nodes has an offset or a CRC".into())
                };
            }
            if usize::from(p.count) > PAGE_NODES {
                return bad(Code::Param, 12, "page_entry.count", format!("{} nodes; a page has 1 to 512", p.count));
            }
            if !p.offset.is_multiple_of(16) {
                return bad(Code::Align, 0, "page_entry.offset", format!("{} is no multiple of 16", p.offset));
            }
            let end = p.offset.checked_add(p.byte_len() as u64);
            if p.offset < section.start || end.is_none_or(|end| end > section.end) {
                return bad(Code::SectionRange, 0, "page_entry.offset", format!("{} is not in PAGE", p.offset));
            }
            Ok(p)
        })
        .collect()
}

/// Reads a page's nodes from its stored bytes; nodes past the end are EMPTY. `ordinal` is the page's (spec: IDX-16).
///
/// # Errors
/// `E_PAGE_CRC`; those of a node (`E_PARAM`, `E_RESERVED`, `E_CANON`, `E_NONFINITE`, `E_MINMAX_ORDER`, `E_SIZE`,
/// `E_LIMIT`, `E_ALIGN`), `E_REF`, `E_SECTION_RANGE`, each with its offset.
pub fn parse_page(bytes: &[u8], entry: &PageEntry, ordinal: u64, head: &Head) -> Result<Vec<Node>> {
    check_len(bytes, entry.byte_len(), entry.offset, "page")?;
    let computed = crc32(bytes);
    if computed != entry.crc {
        let message = format!(
            "CRC {computed:08x} computed, {:08x} stored; the index page is damaged, fetch the file again or use salvage",
            entry.crc
        );
        return Err(Error::at(Code::PageCrc, entry.offset, "page", message));
    }
    let (_, level, _) = head.octree.page_position(ordinal);
    let bricks = head.section_range(section::BRIK);
    let nodes = bytes.chunks_exact(NODE_BYTES).zip((entry.offset..).step_by(NODE_BYTES));
    nodes
        .map(|(bytes, at)| {
            let node = Node::read_from(bytes, at, head.descriptor.sample_type)?;
            let bad = |code, offset, field, message: String| Err(Error::at(code, at + offset, field, message));
            if level == 0 && node.child_mask != 0 {
                return bad(Code::Canon, 18, "node.child_mask", "a node of level 0 has children".into());
            }
            if node.kind == NodeKind::Stored {
                // spec: IDX-9
                if usize::from(node.codec) >= head.descriptor.codecs.len() {
                    let n = head.descriptor.codecs.len();
                    return bad(Code::Ref, 17, "node.codec", format!("entry {} of a table of {n} codecs", node.codec));
                }
                let start = node.offset.checked_sub(LEADER_BYTES as u64);
                let end = node.offset.checked_add(u64::from(node.stored_len) + GUARD_BYTES);
                if start.is_none_or(|s| s < bricks.start) || end.is_none_or(|e| e > bricks.end) {
                    return bad(Code::SectionRange, 0, "node.offset", format!("{} is not in BRIK", node.offset));
                }
            }
            Ok(node)
        })
        .collect()
}

fn check_len(bytes: &[u8], len: usize, offset: u64, field: &'static str) -> Result<()> {
    if bytes.len() == len {
        return Ok(());
    }
    Err(Error::at(Code::Size, offset, field, format!("{} bytes given where {len} are due", bytes.len())))
}
