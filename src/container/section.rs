//! The section table: what lies where, and how it is protected (spec chapter 3).
//!
//! | off | size | field |
//! |---|---|---|
//! | 0 | 4 | FourCC |
//! | 4 | 2+2 | version, flags |
//! | 8 | 8+8+8 | offset, stored length, decoded length |
//! | 32 | 1+1+2 | alignment log2, supercompression, zero |
//! | 36 | 4 | CRC-32 of the stored bytes |
//! | 40 | 8+4+4 | item count, item size, owner |
//! | 56 | 8 | zero |

use super::wire;
use crate::checksum::crc32;
use crate::error::{Code, Error, Result};
use binrw::binrw;

/// Bytes of one entry.
pub(super) const ENTRY_BYTES: usize = 64;

/// Four characters that name a kind of section.
pub type FourCc = [u8; 4];

pub(super) const VOLD: FourCc = *b"VOLD";
pub(super) const PDIR: FourCc = *b"PDIR";
pub(super) const PAGE: FourCc = *b"PAGE";
pub(super) const BRIK: FourCc = *b"BRIK";
pub(super) const META: FourCc = *b"META";
pub(super) const FNAM: FourCc = *b"FNAM";
pub(super) const CBOK: FourCc = *b"CBOK";
pub(super) const TIME: FourCc = *b"TIME";
pub(super) const SCNE: FourCc = *b"SCNE";
/// Sections that every file has (spec: SEC-9).
pub(super) const MANDATORY: [FourCc; 4] = [BRIK, PAGE, PDIR, VOLD];

/// Sections that nobody may skip who does not know them: the mandatory ones, and codebooks, where there are any.
pub(super) fn is_critical(fourcc: FourCc) -> bool {
    fourcc == CBOK || MANDATORY.contains(&fourcc)
}

/// What a reader or an editor may do with a section it does not know.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct SectionFlags(pub u16);

impl SectionFlags {
    /// Whoever does not know the section must refuse the file.
    pub const CRITICAL: SectionFlags = SectionFlags(1);
    /// Whoever rewrites the file may copy the section without knowing it.
    pub const COPY_SAFE: SectionFlags = SectionFlags(2);
    /// The section is defined outside the format's specification.
    pub const PRIVATE: SectionFlags = SectionFlags(4);
    /// `BRIK` only: no payload is compressed and each level uses one codec entry.
    pub const GPU_DIRECT: SectionFlags = SectionFlags(8);
    const ALL: u16 = 15;

    /// Whether all bits of `other` are set.
    #[must_use]
    pub const fn contains(self, other: SectionFlags) -> bool {
        self.0 & other.0 == other.0
    }
}

/// One entry of the section table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SectionEntry {
    /// Kind of section.
    pub fourcc: FourCc,
    /// Version of the section's content.
    pub version: u16,
    /// What to do with it.
    pub flags: SectionFlags,
    /// First byte in the file.
    pub offset: u64,
    /// Bytes in the file.
    pub stored_len: u64,
    /// Bytes after inflating; the stored length where nothing is compressed.
    pub decoded_len: u64,
    /// Alignment of the first byte, as log2.
    pub align_log2: u8,
    /// 0: none; 1: one zstd frame.
    pub supercompression: u8,
    /// CRC-32 of the stored bytes; 0 for `PAGE` and `BRIK`, whose items carry their own.
    pub crc: u32,
    /// Number of items.
    pub item_count: u64,
    /// Bytes of an item, 0 where they differ.
    pub item_size: u32,
    /// Reserved for sections that belong to others; 0.
    pub owner: u32,
}

/// A section that this version does not know, with its stored bytes: kept by a rewrite if it is COPY_SAFE.
#[derive(Clone, Debug)]
pub struct ExtraSection {
    /// Its entry; the offset is set by the writer.
    pub entry: SectionEntry,
    /// Its stored bytes.
    pub bytes: Vec<u8>,
}

#[binrw]
#[brw(little)]
struct Wire {
    fourcc: [u8; 4],
    version: u16,
    flags: u16,
    offset: u64,
    stored_len: u64,
    decoded_len: u64,
    align_log2: u8,
    supercompression: u8,
    reserved_a: [u8; 2],
    crc: u32,
    item_count: u64,
    item_size: u32,
    owner: u32,
    reserved_b: [u8; 8],
}

/// A FourCC as text for messages.
pub(super) fn show(fourcc: FourCc) -> String {
    fourcc.escape_ascii().to_string()
}

impl SectionEntry {
    /// Reads one entry, whose bytes lie at `at`, and checks all that concerns it alone.
    ///
    /// # Errors
    /// `E_RESERVED`, `E_PARAM`, `E_SIZE`, `E_ALIGN`.
    pub fn read_from(bytes: &[u8], at: u64) -> Result<Self> {
        let w: Wire = wire::read(bytes, at, "section")?;
        wire::check_zero(&w.reserved_a, at + 34, "section.reserved")?;
        wire::check_zero(&w.reserved_b, at + 56, "section.reserved")?;
        // spec: SEC-3, SEC-4, SEC-7
        let name = show(w.fourcc);
        let bad = |code, offset: u64, field, message| Err(Error::at(code, at + offset, field, message));
        if w.flags & !SectionFlags::ALL != 0 {
            return bad(Code::Reserved, 6, "section.flags", format!("{name}: reserved flag bits are set"));
        }
        if w.supercompression > 1 {
            let n = w.supercompression;
            return bad(Code::Param, 33, "section.supercompression", format!("{name}: method {n} is not known"));
        }
        if w.supercompression == 0 && w.decoded_len != w.stored_len {
            return bad(
                Code::Size,
                24,
                "section.decoded_length",
                format!("{name}: {} bytes decoded, {} stored, yet not compressed", w.decoded_len, w.stored_len),
            );
        }
        if !(4..=20).contains(&w.align_log2) {
            return bad(Code::Param, 32, "section.alignment", format!("{name}: 2^{} is not allowed", w.align_log2));
        }
        if w.offset & ((1 << w.align_log2) - 1) != 0 {
            return bad(
                Code::Align,
                8,
                "section.offset",
                format!("{name} starts at byte {}, which is no multiple of 2^{}", w.offset, w.align_log2),
            );
        }
        Ok(SectionEntry {
            fourcc: w.fourcc,
            version: w.version,
            flags: SectionFlags(w.flags),
            offset: w.offset,
            stored_len: w.stored_len,
            decoded_len: w.decoded_len,
            align_log2: w.align_log2,
            supercompression: w.supercompression,
            crc: w.crc,
            item_count: w.item_count,
            item_size: w.item_size,
            owner: w.owner,
        })
    }

    /// The bytes of the entry.
    #[must_use]
    pub fn write_to(&self) -> [u8; ENTRY_BYTES] {
        wire::write(&Wire {
            fourcc: self.fourcc,
            version: self.version,
            flags: self.flags.0,
            offset: self.offset,
            stored_len: self.stored_len,
            decoded_len: self.decoded_len,
            align_log2: self.align_log2,
            supercompression: self.supercompression,
            reserved_a: [0; 2],
            crc: self.crc,
            item_count: self.item_count,
            item_size: self.item_size,
            owner: self.owner,
            reserved_b: [0; 8],
        })
    }

    /// One past the last stored byte; entries of a parsed table never overflow.
    #[must_use]
    pub fn end(&self) -> u64 {
        self.offset.saturating_add(self.stored_len)
    }

    /// Compares the stored bytes with the CRC (spec: SEC-8).
    ///
    /// # Errors
    /// `E_SECTION_CRC`.
    pub fn check_crc(&self, stored: &[u8]) -> Result<()> {
        let computed = crc32(stored);
        if computed == self.crc {
            return Ok(());
        }
        let name = show(self.fourcc);
        let message = format!(
            "section {name}: CRC {computed:08x} computed, {:08x} stored; it is damaged, fetch the file again",
            self.crc
        );
        Err(Error::at(Code::SectionCrc, self.offset, name, message))
    }
}
