//! Leaders of records that are not bricks (spec chapter 15).
//!
//! | off | size | field |
//! |---|---|---|
//! | 0 | 4 | magic `VREC` |
//! | 4 | 1+3 | kind, zero |
//! | 8 | 8 | key: page or chunk ordinal, FourCC, generation |
//! | 16 | 8 | length of the content |
//! | 24 | 4 | CRC-32 of the content |
//! | 28 | 4 | CRC-32 of the file id and bytes 0 to 27 |

use super::super::wire;
use crate::checksum::{crc32, crc32_seeded};
use crate::error::{Code, Error, Result};
use binrw::binrw;

/// Bytes of a record's leader.
pub(in super::super) const RECORD_BYTES: usize = 32;
pub(in super::super) const MAGIC: [u8; 4] = *b"VREC";

/// What a record holds that is not a brick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(in super::super) enum RecordKind {
    Page = 1,
    Chunk = 2,
    Section = 3,
    Commit = 4,
}

/// What stands before the content of such a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) struct Record {
    pub(in super::super) kind: RecordKind,
    /// Ordinal of a page or chunk, FourCC of a section, generation of a commit.
    pub(in super::super) key: u64,
    pub(in super::super) len: u64,
    pub(in super::super) crc: u32,
}

#[binrw]
#[brw(little)]
struct Wire {
    magic: [u8; 4],
    kind: u8,
    reserved: [u8; 3],
    key: u64,
    len: u64,
    content_crc: u32,
    leader_crc: u32,
}

impl Record {
    /// The record of these bytes.
    pub(in super::super) fn of(kind: RecordKind, key: u64, content: &[u8]) -> Self {
        Record { kind, key, len: content.len() as u64, crc: crc32(content) }
    }

    /// The 32 bytes of the leader (spec: LOG-4, GEN-5).
    pub(in super::super) fn write_to(&self, file_id: &[u8; 16]) -> [u8; RECORD_BYTES] {
        let mut bytes: [u8; RECORD_BYTES] = wire::write(&Wire {
            magic: MAGIC,
            kind: self.kind as u8,
            reserved: [0; 3],
            key: self.key,
            len: self.len,
            content_crc: self.crc,
            leader_crc: 0,
        });
        let crc = crc32_seeded(file_id, &bytes[..28]);
        bytes[28..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// Reads the leader of a record whose bytes lie at `at` (spec: LOG-4).
    ///
    /// # Errors
    /// `E_LEADER` where magic, CRC or kind are wrong; `E_RESERVED`; `E_TRUNCATED` where there are fewer than 32 bytes.
    pub(in super::super) fn read_from(bytes: &[u8], at: u64, file_id: &[u8; 16]) -> Result<Self> {
        let w: Wire = wire::read(bytes, at, "record")?;
        let bad = |offset, field, message: String| Err(Error::at(Code::Leader, at + offset, field, message));
        if w.magic != MAGIC {
            return bad(0, "record.magic", "no record starts here".into());
        }
        let computed = crc32_seeded(file_id, &bytes[..28]);
        if computed != w.leader_crc {
            let message =
                format!("CRC {computed:08x} computed, {:08x} stored; damaged or of another file", w.leader_crc);
            return bad(28, "record.crc", message);
        }
        wire::check_zero(&w.reserved, at + 5, "record.reserved")?;
        let kind = match w.kind {
            1 => RecordKind::Page,
            2 => RecordKind::Chunk,
            3 => RecordKind::Section,
            4 => RecordKind::Commit,
            n => return bad(4, "record.kind", format!("kind {n} is not one of this version; use a newer reader")),
        };
        Ok(Record { kind, key: w.key, len: w.len, crc: w.content_crc })
    }

    /// One past the content, where the leader lies at `at`; saturates.
    pub(in super::super) fn end(&self, at: u64) -> u64 {
        at.saturating_add(RECORD_BYTES as u64).saturating_add(self.len)
    }
}

/// The key of a section's record.
pub(in super::super) fn section_key(fourcc: [u8; 4]) -> u64 {
    u64::from(u32::from_le_bytes(fourcc))
}
