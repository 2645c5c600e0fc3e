//! Reading everything but the bricks, with the checks that one structure alone allows (spec chapter 9).

use super::{Read, Strict};
use crate::container::directory::{self, ChunkRef, PAGE_NODES, PageEntry};
use crate::container::kept;
use crate::container::node::NODE_BYTES;
use crate::container::section::{self, SectionFlags, show};
use crate::container::{
    ExtraSection, Head, HeadParser, Node, SectionEntry, Step, check_meta, check_scene, features, parse_times,
};
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, unmorton8};
use crate::limits::{self, Limits};
use crate::supercompression;
use std::borrow::Cow;

/// Drives the head parser.
pub(super) fn head(len: u64, limits: &Limits, read: &mut Read<'_>) -> Result<Head> {
    let mut parser = HeadParser::new(len, limits);
    loop {
        match parser.next()? {
            Step::Done(head) => return Ok(*head),
            Step::Need { offset, len } => {
                let bytes = read(offset, len)?;
                parser.supply(offset, bytes);
            }
        }
    }
}

impl Strict {
    /// Sections as a whole, and the content of META, FNAM and foreign ones.
    pub(super) fn load_sections(&mut self, limits: &Limits, read: &mut Read<'_>) {
        for s in self.head.sections.clone() {
            let flags = self.check_flags(&s);
            self.keep(flags);
            let own = matches!(s.fourcc, section::VOLD | section::PDIR | section::PAGE | section::BRIK);
            if own {
                continue;
            }
            let loaded = self.load_section(s, limits, read);
            self.keep(loaded);
        }
        let checked = self.check_names();
        self.keep(checked);
    }

    /// Known sections have exactly their flags and alignment; names are printable (spec: SEC-3, SEC-4, SEC-12).
    fn check_flags(&self, s: &SectionEntry) -> Result<()> {
        let (at, name) = (self.entry_offset(s), show(s.fourcc));
        if !s.fourcc.iter().all(|c| (0x20..0x7F).contains(c)) {
            return Err(Error::at(Code::Param, at, "section.fourcc", format!("{name} is not printable ASCII")));
        }
        let flags = s.flags.0 & !if s.fourcc == section::BRIK { SectionFlags::GPU_DIRECT.0 } else { 0 };
        let expected = match s.fourcc {
            section::META | section::SCNE => SectionFlags::COPY_SAFE.0,
            section::FNAM | section::TIME => 0,
            f if section::is_critical(f) => SectionFlags::CRITICAL.0,
            _ if s.flags.contains(SectionFlags::GPU_DIRECT) => {
                return Err(Error::at(Code::Canon, at + 6, "section.flags", format!("{name}: GPU_DIRECT is for BRIK")));
            }
            _ => return Ok(()),
        };
        if flags != expected {
            return Err(Error::at(
                Code::Canon,
                at + 6,
                "section.flags",
                format!("{name}: {flags} instead of {expected}"),
            ));
        }
        if s.align_log2 != 4 {
            return Err(Error::at(
                Code::Canon,
                at + 32,
                "section.alignment",
                format!("{name} declares other than 2^4"),
            ));
        }
        Ok(())
    }

    fn load_section(&mut self, s: SectionEntry, limits: &Limits, read: &mut Read<'_>) -> Result<()> {
        limits::check("section.stored_length", s.stored_len, limits.table_bytes)?;
        let bytes = fetch(&self.head, s.offset, s.stored_len, read)?;
        s.check_crc(&bytes)?;
        if s.fourcc == section::META {
            let text = self.decode_meta(&s, &bytes)?;
            check_meta(&text, s.offset)?;
        }
        if s.fourcc == section::SCNE {
            check_scene(&bytes, s.offset)?;
        }
        if s.fourcc == section::TIME {
            self.times = Some(parse_times(&bytes, s.offset, self.head.descriptor.time_steps)?);
        } else if s.fourcc == section::FNAM {
            // Opening looks at names in the head only.
            self.head.feature_names = features::read_from(&bytes, s.offset)?;
        } else if s.fourcc == section::CBOK {
            // spec: ZBT-34
            if s.item_count == 0 {
                let at = self.entry_offset(&s) + 40;
                return Err(Error::at(Code::Canon, at, "CBOK", "a section of no codebooks must not be there"));
            }
            self.codebooks = Some(ExtraSection { entry: s, bytes });
        } else {
            self.others.push(ExtraSection { entry: s, bytes });
        }
        Ok(())
    }

    /// Compressed only where that is smaller (spec: SEC-7).
    fn decode_meta<'a>(&self, s: &SectionEntry, bytes: &'a [u8]) -> Result<Cow<'a, [u8]>> {
        if s.supercompression == 0 {
            return Ok(bytes.into());
        }
        if s.stored_len >= s.decoded_len {
            let at = self.entry_offset(s) + 33;
            return Err(Error::at(Code::Canon, at, "section.supercompression", "META is compressed, yet not smaller"));
        }
        supercompression::inflate(bytes, s.decoded_len..=s.decoded_len, s.offset, "META").map(Cow::Owned)
    }

    /// `FNAM` names exactly the bits that are set, by their known names (spec: SEC-14).
    fn check_names(&self) -> Result<()> {
        let b = &self.head.superblock;
        let names = &self.head.feature_names;
        let expected = features::names([b.required, b.read_optional, b.optional], names);
        let section = self.head.section(section::FNAM);
        let stored = if section.is_some() { &names[..] } else { &[] };
        if stored == expected && section.is_some() != expected.is_empty() {
            return Ok(());
        }
        let at = section.map_or(48, |s| s.offset);
        Err(Error::at(Code::Canon, at, "FNAM", "it must name exactly the feature bits that are set, if there are any"))
    }

    /// Directory chunks and pages.
    pub(super) fn load_index(&mut self, read: &mut Read<'_>) {
        let page_section = self.head.section_range(section::PAGE);
        let mut pages = 0u64;
        for chunk in self.head.directory.clone() {
            self.coverage.add(chunk.offset..chunk.offset + chunk.byte_len() as u64, "directory chunk");
            let entries = match self.load_chunk(&chunk, read) {
                Ok(entries) => entries,
                Err(e) => {
                    self.report(e);
                    continue;
                }
            };
            // Pages that share bytes are reported with the coverage; they are not all loaded, however.
            pages = pages.saturating_add(entries.iter().map(|e| e.byte_len() as u64).sum());
            if pages > page_section.end - page_section.start {
                let message = "the pages are longer than their section: some overlap";
                self.report(Error::at(Code::SectionOverlap, chunk.offset, "page_entry.offset", message));
                return;
            }
            for (ordinal, entry) in (chunk.ordinal * directory::CHUNK_PAGES..).zip(entries) {
                if !entry.is_empty() {
                    self.coverage.add(entry.offset..entry.offset + entry.byte_len() as u64, "page");
                    let loaded = self.load_page(ordinal, &entry, read);
                    self.keep(loaded);
                }
            }
        }
    }

    fn load_chunk(&self, chunk: &ChunkRef, read: &mut Read<'_>) -> Result<Vec<PageEntry>> {
        let bytes = fetch(&self.head, chunk.offset, chunk.byte_len() as u64, read)?;
        let entries = directory::parse_chunk(&bytes, chunk, &self.head)?;
        // spec: IDX-5
        if entries.last().is_none_or(PageEntry::is_empty) {
            return Err(Error::at(Code::Canon, chunk.offset, "directory", "trailing EMPTY page entries are stored"));
        }
        Ok(entries)
    }

    fn load_page(&mut self, ordinal: u64, entry: &PageEntry, read: &mut Read<'_>) -> Result<()> {
        self.page_entries.insert(ordinal, *entry);
        let bytes = fetch(&self.head, entry.offset, entry.byte_len() as u64, read)?;
        let nodes = directory::parse_page(&bytes, entry, ordinal, &self.head)?;
        let canon = |slot: usize, message: &str| {
            let at = entry.offset + (slot * NODE_BYTES) as u64;
            Err(Error::at(Code::Canon, at, "node", message))
        };
        // spec: IDX-6
        if nodes.last().is_none_or(Node::is_empty_subtree) {
            return canon(nodes.len().saturating_sub(1), "trailing EMPTY nodes are stored");
        }
        let (_, level, page) = self.head.octree.page_position(ordinal);
        let bricks = self.head.octree.levels[usize::from(level)].bricks;
        for (slot, node) in nodes.iter().enumerate() {
            let local = unmorton8(slot);
            let brick: Coord = std::array::from_fn(|a| page[a] * 8 + local[a]);
            // spec: IDX-14
            if !bricks.contains(brick) && !node.is_empty_subtree() {
                return canon(slot, "a node outside the volume is not EMPTY");
            }
        }
        debug_assert!(nodes.len() <= PAGE_NODES);
        self.nodes.page_mut(ordinal)[..nodes.len()].copy_from_slice(&nodes);
        Ok(())
    }
}

/// Bytes of the file, from the head where they lie in it.
pub(super) fn fetch(head: &Head, offset: u64, len: u64, read: &mut Read<'_>) -> Result<Vec<u8>> {
    kept::fetch(head, offset, len, u64::MAX, read)
}
