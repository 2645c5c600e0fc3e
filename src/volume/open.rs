//! Opening a volume and telling what it is.

use super::books::Books;
use super::codecs::CodecTable;
use super::counted::{Cost, Counted};
use super::pages::Pages;
use super::{At, bricks::Bricks};
use crate::container::{Head, HeadParser, Step, VolumeDescriptor};
use crate::error::{Code, Error, Result};
use crate::geometry::Extent;
use crate::limits::Limits;
use crate::source::{ByteSource, FileSource};
use crate::supercompression;
use std::path::Path;

/// An open `.vug` volume. Any number of threads may read it at the same time.
pub struct Volume {
    pub(super) source: Counted,
    pub(super) head: Head,
    pub(super) codecs: CodecTable,
    pub(super) pages: Pages,
    pub(super) bricks: Bricks,
    pub(super) books: Books,
    pub(super) limits: Limits,
}

/// Readers in several threads share a volume; this is where it would not compile any more.
const _: fn() = || {
    fn shared_by_threads<T: Send + Sync>() {}
    shared_by_threads::<Volume>();
};

impl std::fmt::Debug for Volume {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let d = &self.head.descriptor;
        write!(f, "Volume({} {}, {} levels)", d.dims, d.sample_type, d.lod_count)
    }
}

impl Volume {
    /// Opens a local file for reading.
    ///
    /// # Errors
    /// Those of [`Volume::open`], and `E_SOURCE` where the file cannot be opened.
    pub fn open_path(path: impl AsRef<Path>) -> Result<Self> {
        Volume::open(FileSource::open(path)?, Limits::default())
    }

    /// Opens a volume: one read of 16 KiB, and one more for each table that lies beyond (spec chapter 9).
    ///
    /// # Errors
    /// The first violation in the order of checks of spec chapter 9, with its byte offset and field.
    pub fn open(source: impl ByteSource + 'static, limits: Limits) -> Result<Self> {
        let parser = HeadParser::new(source.len(), &limits);
        Volume::open_with(Box::new(source), limits, parser)
    }

    /// Opens what is left of a damaged file: a wrong length, a damaged directory and damaged feature names are no errors
    /// here; superblock, section table and volume descriptor must be whole.
    ///
    /// # Errors
    /// As [`Volume::open`] for the head; damaged pages and bricks show up when they are read.
    pub fn open_salvage(source: impl ByteSource + 'static, limits: Limits) -> Result<Self> {
        let parser = HeadParser::salvage(source.len(), &limits);
        Volume::open_with(Box::new(source), limits, parser)
    }

    fn open_with(source: Box<dyn ByteSource>, limits: Limits, mut parser: HeadParser) -> Result<Self> {
        let source = Counted::new(source);
        let head = loop {
            match parser.next()? {
                Step::Done(head) => break *head,
                Step::Need { offset, len } => {
                    let bytes = source.read(offset, len)?.into_owned();
                    parser.supply(offset, bytes);
                }
            }
        };
        Volume::assemble(source, head, limits)
    }

    /// A volume of a head that was parsed elsewhere.
    pub(super) fn of_head(source: Box<dyn ByteSource>, head: Head, limits: Limits) -> Result<Volume> {
        Volume::assemble(Counted::new(source), head, limits)
    }

    fn assemble(source: Counted, head: Head, limits: Limits) -> Result<Volume> {
        let codecs = CodecTable::new(&head)?;
        let (pages, bricks) = (Pages::new(&head), Bricks::new(limits.cache_bytes));
        Ok(Volume { source, head, codecs, pages, bricks, books: Books::default(), limits })
    }

    /// What the file says of the volume: dims, types, placement, codecs, what was achieved.
    #[must_use]
    pub fn info(&self) -> &VolumeDescriptor {
        &self.head.descriptor
    }

    /// The parsed head: superblock, sections, directory, octree.
    #[must_use]
    pub fn head(&self) -> &Head {
        &self.head
    }

    /// Extent of each level of detail in voxels, finest first.
    pub fn levels(&self) -> impl ExactSizeIterator<Item = Extent> + '_ {
        self.head.octree.levels.iter().map(|l| l.extent)
    }

    /// Length of the file in bytes.
    #[must_use]
    pub fn file_len(&self) -> u64 {
        self.source.len()
    }

    /// Reads and bytes so far.
    #[must_use]
    pub fn cost(&self) -> Cost {
        self.source.cost()
    }

    /// Sets the counters of [`Volume::cost`] to zero.
    pub fn reset_cost(&self) {
        self.source.reset();
    }

    /// The `META` section (UTF-8 JSON), if there is one: one read, unless it lies in the head.
    ///
    /// # Errors
    /// `E_SECTION_CRC`, `E_ZSTD`, `E_LIMIT`, `E_UTF8`.
    pub fn meta(&self) -> Result<Option<String>> {
        let Some(entry) = self.head.section(*b"META") else { return Ok(None) };
        let len = usize::try_from(entry.stored_len).map_err(|_| {
            Error::at(Code::Limit, entry.offset, "META", "the section does not fit this machine's address space")
        })?;
        let stored = match self.head.resident(entry.offset, entry.stored_len) {
            Some(bytes) => std::borrow::Cow::Borrowed(bytes),
            None => self.source.read(entry.offset, len)?,
        };
        entry.check_crc(&stored).map_err(|e| self.replaced_or(e))?;
        let text = if entry.supercompression == 0 {
            stored.into_owned()
        } else {
            supercompression::inflate(&stored, entry.decoded_len..=entry.decoded_len, entry.offset, "META")?
        };
        let text = String::from_utf8(text)
            .map_err(|e| Error::at(Code::Utf8, entry.offset, "META", format!("{e}; the section is not text")))?;
        Ok(Some(text))
    }

    /// The `SCNE` section, if there is one: how the volume is meant to be seen, as text. One read, unless it lies in the head.
    ///
    /// # Errors
    /// `E_SECTION_CRC`, `E_LIMIT`, `E_UTF8`.
    pub fn scene(&self) -> Result<Option<String>> {
        let Some(entry) = self.head.section(*b"SCNE") else { return Ok(None) };
        crate::limits::check("SCNE", entry.stored_len, crate::limits::MAX_SCENE_BYTES)?;
        let stored = match self.head.resident(entry.offset, entry.stored_len) {
            Some(bytes) => std::borrow::Cow::Borrowed(bytes),
            // At most 1 MiB.
            None => self.source.read(entry.offset, entry.stored_len as usize)?,
        };
        entry.check_crc(&stored).map_err(|e| self.replaced_or(e))?;
        crate::container::check_scene(&stored, entry.offset).map(|text| Some(text.to_owned()))
    }

    /// Index of the tree that `at` names, after checking `at` against the volume.
    #[inline]
    pub(super) fn tree(&self, at: At) -> Result<u32> {
        let d = &self.head.descriptor;
        if at.time >= d.time_steps || at.channel >= d.channels || usize::from(at.lod) >= self.head.octree.levels.len() {
            return Err(self.no_such_tree(at));
        }
        Ok(at.time * d.channels + at.channel)
    }

    #[cold]
    fn no_such_tree(&self, at: At) -> Error {
        let d = &self.head.descriptor;
        Error::new(
            Code::Range,
            "at",
            format!(
                "time {} of {}, channel {} of {}, level {} of {}: each counts from 0",
                at.time, d.time_steps, at.channel, d.channels, at.lod, d.lod_count
            ),
        )
    }

    /// Extent of the level that `at` names.
    pub(super) fn extent_at(&self, at: At) -> Result<Extent> {
        self.tree(at)?;
        Ok(self.head.octree.levels[usize::from(at.lod)].extent)
    }

    /// A checksum error, or `E_REPLACED` where the superblock, or in a log the leader of the commit, is no longer the one
    /// that was opened (spec: VAL-6).
    pub(super) fn replaced_or(&self, error: Error) -> Error {
        if !matches!(error.code(), Code::BrickCrc | Code::PageCrc | Code::DirCrc | Code::SectionCrc) {
            return error;
        }
        let superblock =
            self.head.head_bytes.get(..crate::container::SUPERBLOCK_BYTES).map(|opened| ("superblock", 0, opened));
        // Logs that were begun alike have the same superblock for ever; the leader covers all that its commit says.
        let leader = self.head.commit.and_then(|commit| {
            let len = crate::container::LEADER_BYTES as u64;
            Some(("commit", commit.offset, self.head.resident(commit.offset, len)?))
        });
        for (field, offset, opened) in superblock.into_iter().chain(leader) {
            match self.source.read_fresh(offset, opened.len()) {
                Ok(now) if *now == *opened => {}
                // The source has seen it by itself.
                Err(e) if e.code() == Code::Replaced => return e,
                // A source that fails now says nothing about the file, unless it is too short.
                Err(e) if e.code() != Code::Truncated => return error,
                _ => {
                    let message = format!("the file was replaced while it was open; open it again ({error})");
                    return Error::at(Code::Replaced, offset, field, message);
                }
            }
        }
        error
    }
}
