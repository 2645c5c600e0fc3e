//! All bytes of a head file but its bricks, from the nodes: what the writer writes and the strict validator compares with.
//!
//! Nothing here asks a clock, a random number or a hash map for an order: same input, same bytes (spec: GEN-8).

use super::NodeFlags;
use super::content::{codebooks, items, known, others};
use super::descriptor::{CODEC_BYTES, VolumeDescriptor};
use super::directory::{CHUNK_PAGES, ChunkRef, PageEntry, REF_BYTES, write_entries, write_nodes, write_refs};
use super::features::{self, OPTIONAL_NAN_REPLACED, REQUIRED_ZSTD};
use super::layout::{self, HeadPlan, Part};
use super::section::{self, ENTRY_BYTES, ExtraSection, SectionEntry, SectionFlags};
use super::store::NodeStore;
use super::superblock::{SUPERBLOCK_BYTES, Superblock};
use super::write::{FinishOptions, Placed};
use crate::checksum::crc32;
use crate::error::{Code, Error, Result};
use crate::limits;
use std::cmp::Reverse;

/// What a contiguous part of the file holds.
enum Content {
    /// A section whose bytes are known from the start.
    Known(ExtraSection),
    /// The root directory.
    Refs,
    Chunks,
    Pages,
}

/// Everything that decides the lengths of the tables.
pub(super) struct Tables {
    superblock: Superblock,
    contents: Vec<Content>,
    parts: Vec<Part>,
    brik_flags: SectionFlags,
    stored: u64,
    stored_bytes: u64,
    given_id: Option<[u8; 16]>,
    vold: Vec<u8>,
    /// Where in `contents` the codebooks are.
    books: Option<usize>,
}

/// The finished bytes before and behind the bricks.
pub(super) struct Assembled {
    pub(super) head: Vec<u8>,
    pub(super) tail: Vec<u8>,
    pub(super) len: u64,
    pub(super) file_id: [u8; 16],
}

impl Tables {
    /// Collects sections, features and flags. `nodes` have been joined; `order` is that of the stored bricks. Of
    /// `superblock`, version and bits that are optional to read are taken over.
    pub(super) fn new(
        mut superblock: Superblock,
        nodes: &NodeStore,
        order: &[Placed],
        d: &VolumeDescriptor,
        options: FinishOptions,
    ) -> Result<Self> {
        let zstd = nodes.pages.values().flatten().any(|n| n.flags.contains(NodeFlags::ZSTD));
        superblock.required = if zstd { REQUIRED_ZSTD } else { 0 };
        superblock.optional = options.optional & !OPTIONAL_NAN_REPLACED;
        superblock.optional |= if d.replaced > 0 { OPTIONAL_NAN_REPLACED } else { 0 };
        superblock.resource_level = d.resource_level();
        superblock.clustered = order.is_sorted_by_key(|p| (Reverse(p.level), p.tree, p.ordinal, p.slot));
        let masks = [superblock.required, superblock.read_optional, superblock.optional];
        features::check_names(&options.feature_names)?;
        let names = features::names(masks, &options.feature_names);

        let vold = d.write_to();
        let mut sections =
            vec![known(section::VOLD, SectionFlags::CRITICAL, vold.clone(), d.codecs.len(), CODEC_BYTES)];
        if !names.is_empty() {
            sections.push(known(section::FNAM, SectionFlags::default(), features::write_to(&names), 0, 0));
        }
        let mut contents: Vec<Content> = sections.into_iter().map(Content::Known).collect();
        contents.extend([Content::Refs, Content::Chunks]);
        let books = options.codebooks.map(codebooks).transpose()?;
        let books = books.map(|section| {
            contents.push(Content::Known(section));
            contents.len() - 1
        });
        let others = others(options.times.as_ref(), options.meta, options.extra, d.time_steps)?;
        contents.extend(others.into_iter().map(Content::Known));
        contents.push(Content::Pages);

        let page_bytes = nodes.pages.values().map(|nodes| write_len(nodes)).sum();
        let (chunks, chunk_bytes) = chunk_sizes(nodes);
        let parts = contents.iter().map(|c| match c {
            Content::Known(s) => Part { len: s.bytes.len() as u64, align_log2: s.entry.align_log2 },
            Content::Refs => Part { len: chunks * REF_BYTES as u64, align_log2: 4 },
            Content::Chunks => Part { len: chunk_bytes, align_log2: 4 },
            Content::Pages => Part { len: page_bytes, align_log2: 4 },
        });
        let parts: Vec<Part> = parts.collect();
        let count = contents.iter().filter(|c| !matches!(c, Content::Chunks)).count() as u64 + 1;
        limits::check("section_count", count, u64::from(limits::MAX_SECTIONS))?;
        superblock.section_count = u32::try_from(count).expect("at most 64");
        Ok(Tables {
            superblock,
            contents,
            parts,
            brik_flags: brik_flags(nodes, order),
            stored: order.len() as u64,
            stored_bytes: order.iter().map(|p| u64::from(nodes.node(p.ordinal, p.slot).stored_len)).sum(),
            given_id: options.file_id,
            vold,
            books,
        })
    }

    /// Where the bricks start, and what lies before them.
    pub(super) fn plan_head(&self) -> HeadPlan {
        let compact = self.stored_bytes <= layout::COMPACT_BYTES;
        let table = u64::from(self.superblock.section_count) * ENTRY_BYTES as u64;
        layout::plan_head(SUPERBLOCK_BYTES as u64 + table, &self.parts, compact)
    }

    /// All bytes, now that the nodes have their offsets and the bricks end at `bricks_end`.
    pub(super) fn assemble(mut self, nodes: &NodeStore, plan: &HeadPlan, bricks_end: u64) -> Result<Assembled> {
        let (offsets, len) = layout::place_all(plan, &self.parts, bricks_end);
        let place = |want: fn(&Content) -> bool| {
            let i = self.contents.iter().position(want).expect("every file has it");
            offsets[i]
        };
        let (pages, page_entries) = build_pages(nodes, place(|c| matches!(c, Content::Pages)));
        let (chunks, refs) = build_chunks(&page_entries, place(|c| matches!(c, Content::Chunks)));
        let page_count = page_entries.len() as u64;
        let pdir = known(section::PDIR, SectionFlags::CRITICAL, write_refs(&refs), refs.len(), REF_BYTES);
        let books: &[u8] = match self.books.map(|i| &self.contents[i]) {
            Some(Content::Known(section)) => &section.bytes,
            _ => &[],
        };
        let file_id = self.given_id.unwrap_or_else(|| content_id(&self.vold, &pdir.bytes, books));

        let mut head = vec![0; to_usize(plan.bricks)?];
        let mut tail = vec![0; to_usize(len - bricks_end)?];
        let mut put = |offset: u64, bytes: &[u8]| -> Result<()> {
            let (space, base) = if offset < plan.bricks { (&mut head, 0) } else { (&mut tail, bricks_end) };
            if !bytes.is_empty() {
                let start = to_usize(offset - base)?;
                space[start..start + bytes.len()].copy_from_slice(bytes);
            }
            Ok(())
        };
        let mut entries =
            vec![items(section::BRIK, plan.bricks, bricks_end - plan.bricks, self.stored, self.brik_flags)];
        for (content, &offset) in self.contents.iter().zip(&offsets) {
            let bytes: &[u8] = match content {
                Content::Known(s) => {
                    entries.push(SectionEntry { offset, ..s.entry.clone() });
                    &s.bytes
                }
                Content::Refs => {
                    entries.push(SectionEntry { offset, ..pdir.entry.clone() });
                    &pdir.bytes
                }
                Content::Chunks => &chunks,
                Content::Pages => {
                    let len = pages.len() as u64;
                    entries.push(items(section::PAGE, offset, len, page_count, SectionFlags::CRITICAL));
                    &pages
                }
            };
            put(offset, bytes)?;
        }
        entries.sort_by_key(|e| e.fourcc);
        let table: Vec<u8> = entries.iter().flat_map(SectionEntry::write_to).collect();
        put(SUPERBLOCK_BYTES as u64, &table)?;
        self.superblock.section_table_crc = crc32(&table);
        (self.superblock.file_id, self.superblock.file_len) = (file_id, len);
        put(0, &self.superblock.write_to())?;
        Ok(Assembled { head, tail, len, file_id })
    }
}

/// The file id that follows from the content: the index, and codebooks, which payloads do not cover (spec: HDR-13).
pub(super) fn content_id(vold: &[u8], pdir: &[u8], books: &[u8]) -> [u8; 16] {
    let hash = blake3::Hasher::new().update(vold).update(pdir).update(books).finalize();
    std::array::from_fn(|i| hash.as_bytes()[i])
}

/// CRITICAL, and GPU_DIRECT where every level is stored uncompressed by one codec entry (spec: BRK-10).
fn brik_flags(nodes: &NodeStore, order: &[Placed]) -> SectionFlags {
    let mut codec_of_level = [None; limits::MAX_LODS as usize];
    let direct = order.iter().all(|p| {
        let node = nodes.node(p.ordinal, p.slot);
        let codec = codec_of_level[usize::from(p.level)].get_or_insert(node.codec);
        *codec == node.codec && !node.flags.contains(NodeFlags::ZSTD)
    });
    let direct = if direct && !order.is_empty() { SectionFlags::GPU_DIRECT.0 } else { 0 };
    SectionFlags(SectionFlags::CRITICAL.0 | direct)
}

fn write_len(nodes: &[super::Node]) -> u64 {
    let count = nodes.iter().rposition(|n| !n.is_empty_subtree()).map_or(0, |i| i + 1);
    (count * super::node::NODE_BYTES) as u64
}

/// Number of chunks and bytes of all of them.
fn chunk_sizes(nodes: &NodeStore) -> (u64, u64) {
    let (mut chunks, mut entries, mut last) = (0u64, 0u64, None);
    for &ordinal in nodes.pages.keys() {
        let (chunk, count) = (ordinal / CHUNK_PAGES, ordinal % CHUNK_PAGES + 1);
        match last {
            Some((c, n)) if c == chunk => entries += count - n,
            _ => (chunks, entries) = (chunks + 1, entries + count),
        }
        last = Some((chunk, count));
    }
    (chunks, entries * super::directory::PAGE_ENTRY_BYTES as u64)
}

/// Bytes of all pages from `offset` on, and their entries by ordinal (spec: IDX-6).
fn build_pages(nodes: &NodeStore, offset: u64) -> (Vec<u8>, Vec<(u64, PageEntry)>) {
    let (mut bytes, mut entries) = (Vec::new(), Vec::with_capacity(nodes.pages.len()));
    for (&ordinal, nodes) in &nodes.pages {
        let page = write_nodes(nodes);
        entries.push((ordinal, PageEntry::new(offset + bytes.len() as u64, &page)));
        bytes.extend(page);
    }
    (bytes, entries)
}

/// Bytes of all chunks from `offset` on, and their root entries (spec: IDX-5).
fn build_chunks(pages: &[(u64, PageEntry)], offset: u64) -> (Vec<u8>, Vec<ChunkRef>) {
    let (mut bytes, mut refs) = (Vec::new(), Vec::new());
    for group in pages.chunk_by(|a, b| a.0 / CHUNK_PAGES == b.0 / CHUNK_PAGES) {
        let mut entries = Vec::new();
        for (ordinal, entry) in group {
            #[allow(clippy::cast_possible_truncation, reason = "below 1024")]
            entries.resize((ordinal % CHUNK_PAGES) as usize, PageEntry::EMPTY);
            entries.push(*entry);
        }
        let chunk = write_entries(&entries);
        refs.push(ChunkRef::new(group[0].0 / CHUNK_PAGES, offset + bytes.len() as u64, &chunk));
        bytes.extend(chunk);
    }
    (bytes, refs)
}

fn to_usize(n: u64) -> Result<usize> {
    usize::try_from(n)
        .map_err(|_| Error::new(Code::Limit, "file", "the tables do not fit this machine's address space"))
}
