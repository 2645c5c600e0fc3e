//! Commits: a head of its own at the end of what it owns (spec chapter 15).
//!
//! `leader | superblock | section table | VOLD | FNAM | PDIR | trailer`, each at a multiple of 16.
//!
//! Trailer, 32 bytes: magic `VEND`, zero (4), offset of the commit's leader u64, generation u64, zero (4), seeded CRC.

use super::super::content::items;
use super::super::descriptor::{CODEC_BYTES, VolumeDescriptor};
use super::super::directory::{ChunkRef, REF_BYTES, write_refs};
use super::super::features::{self, FeatureName};
use super::super::section::{self, ENTRY_BYTES, SectionEntry, SectionFlags};
use super::super::strict::Read;
use super::super::superblock::{FileLayout, SUPERBLOCK_BYTES, Superblock};
use super::super::{content, wire};
use super::record::{RECORD_BYTES, Record, RecordKind};
use crate::checksum::{crc32, crc32_seeded};
use crate::error::{Code, Error, Result};
use binrw::binrw;

/// Bytes of a trailer.
pub(in super::super) const TRAILER_BYTES: usize = 32;
const TRAILER_MAGIC: [u8; 4] = *b"VEND";
/// Where the first record lies.
pub(in super::super) const FIRST_RECORD: u64 = SUPERBLOCK_BYTES as u64;

/// The commit that owns a log file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Commit {
    /// How many commits came before it.
    pub generation: u64,
    /// Where its leader starts.
    pub offset: u64,
    /// One past its last byte: what lies there was not finished.
    pub end: u64,
}

/// Everything that a commit says.
pub(in super::super) struct CommitParts<'a> {
    /// Version, file id, feature masks and resource level; the rest is filled in.
    pub(in super::super) superblock: Superblock,
    pub(in super::super) descriptor: &'a VolumeDescriptor,
    pub(in super::super) names: &'a [FeatureName],
    pub(in super::super) refs: &'a [ChunkRef],
    /// Pages and stored bricks that live.
    pub(in super::super) pages: u64,
    pub(in super::super) stored: u64,
    /// Sections that lie in records of their own.
    pub(in super::super) sections: &'a [SectionEntry],
}

impl CommitParts<'_> {
    /// The record of the commit, leader included, whose leader lies at `at` (spec: LOG-5, LOG-6).
    pub(in super::super) fn write_to(&self, at: u64, generation: u64) -> Vec<u8> {
        let start = at + RECORD_BYTES as u64;
        let known = |fourcc, bytes: Vec<u8>, count, size| {
            let flags = if section::is_critical(fourcc) { SectionFlags::CRITICAL } else { SectionFlags::default() };
            content::known(fourcc, flags, bytes, count, size)
        };
        let mut own = vec![known(section::VOLD, self.descriptor.write_to(), self.descriptor.codecs.len(), CODEC_BYTES)];
        if !self.names.is_empty() {
            own.push(known(section::FNAM, features::write_to(self.names), 0, 0));
        }
        own.push(known(section::PDIR, write_refs(self.refs), self.refs.len(), REF_BYTES));

        let count = own.len() + self.sections.len() + 2;
        let mut body = vec![0; SUPERBLOCK_BYTES + count * ENTRY_BYTES];
        let mut entries = self.sections.to_vec();
        // Pages and bricks lie among all records (spec: LOG-7).
        for (fourcc, items_there) in [(section::PAGE, self.pages), (section::BRIK, self.stored)] {
            entries.push(items(fourcc, FIRST_RECORD, at - FIRST_RECORD, items_there, SectionFlags::CRITICAL));
        }
        for s in own {
            entries.push(SectionEntry { offset: start + body.len() as u64, ..s.entry });
            body.extend(s.bytes);
            body.resize(body.len().next_multiple_of(16), 0);
        }
        entries.sort_by_key(|e| e.fourcc);
        let table: Vec<u8> = entries.iter().flat_map(SectionEntry::write_to).collect();
        let superblock = Superblock {
            layout: FileLayout::Log,
            clustered: false,
            file_len: start + (body.len() + TRAILER_BYTES) as u64,
            section_count: u32::try_from(count).expect("checked by the writer"),
            section_table_offset: start + SUPERBLOCK_BYTES as u64,
            section_table_crc: crc32(&table),
            ..self.superblock.clone()
        };
        body[..SUPERBLOCK_BYTES].copy_from_slice(&superblock.write_to());
        body[SUPERBLOCK_BYTES..SUPERBLOCK_BYTES + table.len()].copy_from_slice(&table);
        body.extend(trailer(at, generation, &superblock.file_id));
        let leader = Record::of(RecordKind::Commit, generation, &body).write_to(&superblock.file_id);
        [&leader[..], &body].concat()
    }
}

#[binrw]
#[brw(little)]
struct Trailer {
    magic: [u8; 4],
    reserved_a: u32,
    commit: u64,
    generation: u64,
    reserved_b: u32,
    crc: u32,
}

fn trailer(commit: u64, generation: u64, file_id: &[u8; 16]) -> [u8; TRAILER_BYTES] {
    let mut bytes: [u8; TRAILER_BYTES] =
        wire::write(&Trailer { magic: TRAILER_MAGIC, reserved_a: 0, commit, generation, reserved_b: 0, crc: 0 });
    let crc = crc32_seeded(file_id, &bytes[..28]);
    bytes[28..].copy_from_slice(&crc.to_le_bytes());
    bytes
}

/// The commit that a trailer at `at` ends, if a trailer lies there (spec: LOG-6).
pub(in super::super) fn read_trailer(bytes: &[u8], at: u64, file_id: &[u8; 16]) -> Option<Commit> {
    if !bytes.starts_with(&TRAILER_MAGIC) {
        return None;
    }
    let t: Trailer = wire::read(bytes, at, "trailer").ok()?;
    let least = (RECORD_BYTES + SUPERBLOCK_BYTES) as u64;
    let whole = crc32_seeded(file_id, &bytes[..28]) == t.crc && t.reserved_a == 0 && t.reserved_b == 0;
    let in_place = t.commit >= FIRST_RECORD && t.commit.is_multiple_of(16) && t.commit.checked_add(least)? <= at;
    let end = at + TRAILER_BYTES as u64;
    (whole && in_place).then_some(Commit { generation: t.generation, offset: t.commit, end })
}

/// Whether `bytes`, which lie at the commit's offset, are that commit, whole (spec: LOG-6).
///
/// # Errors
/// `E_COMMIT`.
pub(in super::super) fn check_commit(bytes: &[u8], commit: &Commit, file_id: &[u8; 16]) -> Result<()> {
    let bad =
        |offset: u64, field, message: String| Err(Error::at(Code::Commit, commit.offset + offset, field, message));
    let record = match Record::read_from(bytes, commit.offset, file_id) {
        Ok(record) => record,
        Err(e) => return bad(0, "commit", format!("the commit's leader is damaged: {}", e.message())),
    };
    if record.kind != RecordKind::Commit || record.key != commit.generation {
        return bad(4, "commit.generation", format!("no commit of generation {} starts here", commit.generation));
    }
    if record.end(commit.offset) != commit.end || bytes.len() as u64 != commit.end - commit.offset {
        return bad(16, "commit.length", format!("{} bytes do not end at the trailer", record.len));
    }
    if crc32(&bytes[RECORD_BYTES..]) != record.crc {
        return bad(24, "commit.crc", "the CRC of the commit does not match".into());
    }
    let trailer = read_trailer(&bytes[bytes.len() - TRAILER_BYTES..], commit.end - TRAILER_BYTES as u64, file_id);
    if trailer != Some(*commit) {
        return bad(record.len, "commit.trailer", "the trailer names another commit".into());
    }
    Ok(())
}

/// Reads the commit whose leader is `record`, at `at`, and checks it like [`check_commit`].
///
/// # Errors
/// `E_COMMIT`, `E_LIMIT`, and what reading yields.
pub(in super::super) fn check_commit_at(at: u64, record: &Record, id: &[u8; 16], read: &mut Read<'_>) -> Result<()> {
    let commit = Commit { generation: record.key, offset: at, end: record.end(at) };
    let len = usize::try_from(commit.end - at)
        .map_err(|_| Error::at(Code::Limit, at, "commit", "the commit does not fit this machine's address space"))?;
    if record.len < (SUPERBLOCK_BYTES + TRAILER_BYTES) as u64 {
        return Err(Error::at(Code::Commit, at + 16, "commit.length", "a commit is longer"));
    }
    check_commit(&read(at, len)?, &commit, id)
}
