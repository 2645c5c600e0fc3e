//! The section table as a whole: order, ranges, overlaps, and which sections must be there (spec chapter 3).

use super::descriptor::{CODEC_BYTES, FIXED_BYTES};
use super::directory::REF_BYTES;
use super::section::{self, ENTRY_BYTES, FourCc, SectionEntry, SectionFlags, show};
use super::superblock::{FileLayout, SUPERBLOCK_BYTES, Superblock};
use super::times;
use crate::checksum::crc32;
use crate::error::{Code, Error, Result};
use crate::limits;

/// Version of the content of all sections of this specification.
pub(super) const SECTION_VERSION: u16 = 1;

/// Checks count and place of the table and returns its length in bytes (spec: HDR-10, HDR-11).
///
/// # Errors
/// `E_LIMIT`, `E_SECTION_RANGE`, `E_ALIGN`.
pub(super) fn check_place(superblock: &Superblock) -> Result<u64> {
    let (count, offset) = (superblock.section_count, superblock.section_table_offset);
    limits::check("superblock.section_count", u64::from(count), u64::from(limits::MAX_SECTIONS))
        .map_err(|e| Error::at(e.code(), 76, "superblock.section_count", e.message().to_owned()))?;
    let len = u64::from(count) * ENTRY_BYTES as u64;
    if offset < SUPERBLOCK_BYTES as u64 || offset.checked_add(len).is_none_or(|end| end > superblock.file_len) {
        let message = format!("{count} entries at byte {offset} lie outside the file");
        return Err(Error::at(Code::SectionRange, 80, "superblock.section_table_offset", message));
    }
    if offset % 16 != 0 {
        let message = format!("{offset} is no multiple of 16");
        return Err(Error::at(Code::Align, 80, "superblock.section_table_offset", message));
    }
    Ok(len)
}

/// Reads the table from its bytes and checks it as a whole, in the order of spec chapter 9.
///
/// # Errors
/// `E_SECTION_CRC`; those of an entry; `E_ORDER`, `E_DUP`, `E_SECTION_RANGE`, `E_SECTION_OVERLAP`,
/// `E_SECTION_UNKNOWN`, `E_VERSION`, `E_PARAM`, `E_SIZE`, `E_LIMIT`, `E_RESERVED`.
pub(super) fn read_from(bytes: &[u8], superblock: &Superblock) -> Result<Vec<SectionEntry>> {
    let start = superblock.section_table_offset;
    let computed = crc32(bytes);
    if computed != superblock.section_table_crc {
        let stored = superblock.section_table_crc;
        let message = format!(
            "CRC {computed:08x} computed, {stored:08x} stored; the section table is damaged, fetch the file again"
        );
        return Err(Error::at(Code::SectionCrc, start, "section_table", message));
    }
    let mut sections: Vec<SectionEntry> = Vec::with_capacity(bytes.len() / ENTRY_BYTES);
    for (bytes, at) in bytes.chunks_exact(ENTRY_BYTES).zip((start..).step_by(ENTRY_BYTES)) {
        let entry = SectionEntry::read_from(bytes, at)?;
        check_order(sections.last(), &entry, at)?;
        check_range(&entry, at, superblock.file_len)?;
        check_known(&entry, at)?;
        sections.push(entry);
    }
    for fourcc in section::MANDATORY {
        mandatory(&sections, fourcc, start)?;
    }
    check_overlaps(&sections, superblock, bytes.len() as u64)?;
    Ok(sections)
}

/// A section that every file has (spec: SEC-9).
///
/// # Errors
/// `E_SECTION_UNKNOWN`.
pub(super) fn mandatory(sections: &[SectionEntry], fourcc: FourCc, table: u64) -> Result<&SectionEntry> {
    sections.iter().find(|s| s.fourcc == fourcc).ok_or_else(|| {
        let message = format!("the mandatory section {} is missing", show(fourcc));
        Error::at(Code::SectionUnknown, table, "section_table", message)
    })
}

/// Compares an item count with what the section holds.
///
/// # Errors
/// `E_SIZE`.
pub(super) fn check_item_count(s: &SectionEntry, items: u64, table: u64, all: &[SectionEntry]) -> Result<()> {
    if s.item_count == items {
        return Ok(());
    }
    let index = all.iter().position(|o| o.fourcc == s.fourcc).unwrap_or(0);
    let at = table + (index * ENTRY_BYTES) as u64 + 40;
    let message = format!("{}: {} items declared, {items} stored", show(s.fourcc), s.item_count);
    Err(Error::at(Code::Size, at, "section.item_count", message))
}

/// Sorted by FourCC, each once (spec: SEC-1, SEC-2).
fn check_order(last: Option<&SectionEntry>, entry: &SectionEntry, at: u64) -> Result<()> {
    let Some(last) = last else { return Ok(()) };
    let name = show(entry.fourcc);
    if last.fourcc == entry.fourcc {
        return Err(Error::at(Code::Dup, at, "section.fourcc", format!("section {name} is listed twice")));
    }
    if last.fourcc > entry.fourcc {
        let message = format!("{name} follows {}, but entries are sorted", show(last.fourcc));
        return Err(Error::at(Code::Order, at, "section.fourcc", message));
    }
    Ok(())
}

/// Inside the file (spec: SEC-5).
fn check_range(entry: &SectionEntry, at: u64, file_len: u64) -> Result<()> {
    if entry.offset.checked_add(entry.stored_len).is_some_and(|end| end <= file_len) {
        return Ok(());
    }
    let name = show(entry.fourcc);
    let message = format!("{name}: {} bytes at {} pass the file's end", entry.stored_len, entry.offset);
    Err(Error::at(Code::SectionRange, at + 8, "section.offset", message))
}

/// What is known of a section by its name. The names reserved for later versions are as unknown as any other
/// (spec: SEC-9, SEC-10, SEC-11, VER-5).
fn check_known(entry: &SectionEntry, at: u64) -> Result<()> {
    let name = show(entry.fourcc);
    let critical = entry.flags.contains(SectionFlags::CRITICAL);
    let bad = |code, offset, field, message: String| Err(Error::at(code, at + offset, field, message));
    let item_size = match entry.fourcc {
        section::VOLD => CODEC_BYTES,
        section::PDIR => REF_BYTES,
        section::TIME => times::STEP_BYTES,
        // Codebooks differ in length. Their number is compared with the content by who knows codecs. // spec: ZBT-34
        section::PAGE | section::BRIK | section::META | section::FNAM | section::CBOK | section::SCNE => 0,
        _ if critical => {
            let message = format!("this reader does not know the critical section {name}; use a newer reader");
            return bad(Code::SectionUnknown, 0, "section.fourcc", message);
        }
        _ => return Ok(()),
    };
    if entry.version != SECTION_VERSION {
        let message = format!("{name} has version {}, this reader knows {SECTION_VERSION}", entry.version);
        return bad(Code::Version, 4, "section.version", message);
    }
    if critical != section::is_critical(entry.fourcc) {
        return bad(Code::Param, 6, "section.flags", format!("{name}: the CRITICAL flag is wrong"));
    }
    if entry.supercompression != 0 && entry.fourcc != section::META {
        return bad(Code::Param, 33, "section.supercompression", format!("{name} must not be compressed"));
    }
    let items = matches!(entry.fourcc, section::PAGE | section::BRIK);
    if items && entry.crc != 0 {
        return bad(Code::Reserved, 36, "section.crc", format!("{name} carries its CRCs in its items; this one is 0"));
    }
    if entry.owner != 0 {
        return bad(Code::Reserved, 52, "section.owner", format!("{name}: the owner is not 0"));
    }
    if entry.item_size as usize != item_size {
        return bad(Code::Size, 48, "section.item_size", format!("{name}: {} instead of {item_size}", entry.item_size));
    }
    // Counts are compared with the bytes there are before anything is sized by them (spec: SEC-17, VAL-8).
    let fixed = match entry.fourcc {
        section::VOLD => FIXED_BYTES as u64,
        section::TIME => times::HEADER_BYTES as u64,
        _ => 0,
    };
    let expected = entry.item_count.checked_mul(item_size as u64).and_then(|n| n.checked_add(fixed));
    if item_size != 0 && expected != Some(entry.stored_len) {
        let message = format!("{name}: {} bytes do not hold {} items", entry.stored_len, entry.item_count);
        return bad(Code::Size, 16, "section.stored_length", message);
    }
    if entry.fourcc == section::META && entry.decoded_len > limits::MAX_META_BYTES {
        let message = format!("META decodes to {} bytes; the cap is 1 MiB", entry.decoded_len);
        return bad(Code::Limit, 24, "section.decoded_length", message);
    }
    // spec: SEC-19
    if entry.fourcc == section::SCNE && entry.decoded_len > limits::MAX_SCENE_BYTES {
        let message = format!("SCNE has {} bytes; the cap is 1 MiB", entry.decoded_len);
        return bad(Code::Limit, 24, "section.decoded_length", message);
    }
    Ok(())
}

/// Sections overlap neither each other nor superblock and table (spec: SEC-6). Pages and bricks of a log lie among all its
/// records (spec: LOG-7).
fn check_overlaps(sections: &[SectionEntry], superblock: &Superblock, table_len: u64) -> Result<()> {
    let table = superblock.section_table_offset;
    let among =
        |s: &SectionEntry| superblock.layout == FileLayout::Log && [section::PAGE, section::BRIK].contains(&s.fourcc);
    let mut ranges = vec![(0, SUPERBLOCK_BYTES as u64, None), (table, table + table_len, None)];
    let apart = sections.iter().filter(|s| s.stored_len > 0 && !among(s));
    ranges.extend(apart.map(|s| (s.offset, s.end(), Some(s))));
    ranges.sort_by_key(|r| (r.0, r.1));
    for pair in ranges.windows(2) {
        let ((_, end, a), (start, _, b)) = (pair[0], pair[1]);
        if start < end {
            let name =
                |s: Option<&SectionEntry>| s.map_or("the section table or superblock".into(), |s| show(s.fourcc));
            let index = b.or(a).and_then(|s| sections.iter().position(|o| o.fourcc == s.fourcc)).unwrap_or(0);
            let at = table + (index * ENTRY_BYTES) as u64 + 8;
            let message = format!("{} and {} overlap", name(a), name(b));
            return Err(Error::at(Code::SectionOverlap, at, "section.offset", message));
        }
    }
    Ok(())
}
