//! What opening a file has learned.

use super::directory::ChunkRef;
use super::features::FeatureName;
use super::parse::slice;
use super::section::{FourCc, SectionEntry};
use super::{Commit, Octree, Superblock, VolumeDescriptor};
use std::ops::Range;

/// All that opening a file has learned. Chunks, pages and `META` are read when they are needed.
#[derive(Clone, Debug)]
pub struct Head {
    /// The first 256 bytes.
    pub superblock: Superblock,
    /// The section table, sorted by FourCC.
    pub sections: Vec<SectionEntry>,
    /// The volume.
    pub descriptor: VolumeDescriptor,
    /// Its octree.
    pub octree: Octree,
    /// Root directory: the chunks that are present, sorted by ordinal.
    pub directory: Vec<ChunkRef>,
    /// Why the directory could not be read, in a file that is being salvaged; it is then empty.
    pub directory_lost: Option<String>,
    /// Names of the feature bits that are set, from `FNAM` or this version's own.
    pub feature_names: Vec<FeatureName>,
    /// The first bytes of the file, at most 16 KiB: what lies in them need not be read again.
    pub head_bytes: Vec<u8>,
    /// In a log, the commit that owns the file.
    pub commit: Option<Commit>,
    /// In a log, bytes that were read with the commit, and where they lie.
    pub tail: (u64, Vec<u8>),
    /// Length of the source; shorter than the superblock says only in a salvaged file;
    /// longer also in a log that its writer did not finish.
    pub source_len: u64,
}

impl Head {
    /// The bytes `offset..offset + len` of the file, if opening has read them all.
    #[must_use]
    pub fn resident(&self, offset: u64, len: u64) -> Option<&[u8]> {
        slice(&self.head_bytes, 0, offset, len).or_else(|| slice(&self.tail.1, self.tail.0, offset, len))
    }

    /// Bytes behind the last whole commit of a log: what its writer did not finish. 0 in head files.
    #[must_use]
    pub fn unfinished(&self) -> u64 {
        self.commit.map_or(0, |commit| self.source_len.saturating_sub(commit.end))
    }

    /// The entry of a section.
    #[must_use]
    pub fn section(&self, fourcc: FourCc) -> Option<&SectionEntry> {
        self.sections.iter().find(|s| s.fourcc == fourcc)
    }

    /// Where a section lies in the file; empty where there is none.
    #[must_use]
    pub fn section_range(&self, fourcc: FourCc) -> Range<u64> {
        self.section(fourcc).map_or(0..0, |s| s.offset..s.end())
    }

    /// The root entry of a chunk, or `None` where all its pages are EMPTY.
    #[must_use]
    pub fn chunk(&self, ordinal: u64) -> Option<&ChunkRef> {
        let i = self.directory.binary_search_by_key(&ordinal, |c| c.ordinal).ok()?;
        self.directory.get(i)
    }
}
