//! Opening a file, sans I/O: the parser says which bytes it wants, checks them in the order of spec chapter 9, and ends
//! in a [`Head`].

use super::directory::{self, ChunkRef, REF_BYTES};
use super::features;
use super::head::Head;
use super::log::{Locate, Located, RECORD_BYTES};
use super::section::{self, ENTRY_BYTES, SectionEntry, show};
use super::superblock::{FileLayout, SUPERBLOCK_BYTES, Superblock, glimpse};
use super::table;
use super::{Commit, Octree, VolumeDescriptor};
use crate::error::{Code, Error, Result};
use crate::geometry::Extent;
use crate::limits::{self, HEAD_BYTES, Limits};

/// What the parser wants next.
#[derive(Debug)]
pub enum Step {
    /// These bytes: read them and call [`HeadParser::supply`].
    Need {
        /// First byte in the file.
        offset: u64,
        /// Bytes; never beyond the source's length.
        len: usize,
    },
    /// Nothing more: the file is open.
    Done(Box<Head>),
}

/// The sans-I/O state of opening a file.
#[derive(Debug)]
pub struct HeadParser {
    source_len: u64,
    limits: Limits,
    salvage: bool,
    /// The file's first bytes, then what was asked for behind them.
    pieces: Vec<(u64, Vec<u8>)>,
    /// The search for a log's last commit, as long as it goes on.
    locate: Option<Locate>,
    commit: Option<Commit>,
}

/// Why parsing stops: an error, or bytes that are not there yet.
enum Stop {
    Need(u64, usize),
    Fail(Error),
}

impl From<Error> for Stop {
    fn from(e: Error) -> Self {
        Stop::Fail(e)
    }
}

impl HeadParser {
    /// Opens a file of `source_len` bytes.
    #[must_use]
    pub fn new(source_len: u64, limits: &Limits) -> Self {
        HeadParser {
            source_len,
            limits: limits.clone(),
            salvage: false,
            pieces: Vec::new(),
            locate: None,
            commit: None,
        }
    }

    /// Opens what is left of a file: a source shorter than the file's length is no error, all else still is.
    #[must_use]
    pub fn salvage(source_len: u64, limits: &Limits) -> Self {
        HeadParser { salvage: true, ..HeadParser::new(source_len, limits) }
    }

    /// What is wanted next. The first wish is always for the first 16 KiB (or the whole file, if it is shorter); every
    /// further one is for a table that lies beyond, or, in a log, for the last 16 KiB, where the last commit lies, unless
    /// the file was not closed: then the search for it goes on backwards, and at last from the front (spec: VAL-7, LOG-9).
    ///
    /// # Errors
    /// The first violation in the order of spec chapter 9.
    #[allow(clippy::should_implement_trait, reason = "not an iterator: it fails, and it wants bytes in between")]
    pub fn next(&mut self) -> Result<Step> {
        if self.pieces.is_empty() {
            let len = self.source_len.min(HEAD_BYTES);
            if len > 0 {
                #[allow(clippy::cast_possible_truncation, reason = "at most 16 KiB")]
                return Ok(Step::Need { offset: 0, len: len as usize });
            }
            self.pieces.push((0, Vec::new()));
        }
        if let Some((offset, len)) = self.find_commit()? {
            return Ok(Step::Need { offset, len });
        }
        match self.parse() {
            Ok(head) => Ok(Step::Done(Box::new(head))),
            Err(Stop::Need(offset, len)) => Ok(Step::Need { offset, len }),
            Err(Stop::Fail(e)) => Err(e),
        }
    }

    /// Delivers the bytes of a wish.
    pub fn supply(&mut self, offset: u64, bytes: Vec<u8>) {
        self.pieces.push((offset, bytes));
    }

    /// In a log, goes on with the search for the commit that owns the file, and returns what it wants.
    fn find_commit(&mut self) -> Result<Option<(u64, usize)>> {
        if self.commit.is_some() {
            return Ok(None);
        }
        let mut supplied = None;
        match &self.locate {
            Some(_) => supplied = (self.pieces.len() > 1).then(|| self.pieces.pop()).flatten().map(|p| p.1),
            None => {
                let superblock = Superblock::read_from(self.head()).map_err(|e| self.name_feature(e, 0))?;
                if superblock.layout == FileLayout::Head {
                    return Ok(None);
                }
                superblock.check_log()?;
                self.locate = Some(Locate::new(self.source_len, superblock.file_id, &self.limits, !self.salvage));
            }
        }
        let Some(locate) = &mut self.locate else { return Ok(None) };
        match locate.step(self.pieces.first().map_or(&[], |p| &p.1), supplied)? {
            Located::Need(offset, len) => Ok(Some((offset, len))),
            Located::Found(commit, at, bytes) => {
                self.pieces.push((at, bytes));
                (self.commit, self.locate) = (Some(commit), None);
                Ok(None)
            }
        }
    }

    /// The superblock that says what is in the file: its first bytes, or, in a log, those of the commit (spec: LOG-8).
    fn superblock(&self) -> Result<Superblock, Stop> {
        let Some(commit) = self.commit else {
            return Ok(Superblock::read_from(self.head()).map_err(|e| self.name_feature(e, 0))?);
        };
        let at = self.base();
        let bytes = self.get(at, SUPERBLOCK_BYTES as u64, "commit")?;
        let superblock = Superblock::read_from(bytes).map_err(|e| self.name_feature(e, at))?;
        let first = Superblock::read_from(self.head())?;
        let bad =
            |offset, message: &str| Err(Error::at(Code::Commit, at + offset, "commit.superblock", message).into());
        if superblock.layout != FileLayout::Log || superblock.file_id != first.file_id {
            return bad(24, "layout or file id is not that of the file");
        }
        if superblock.file_len != commit.end || superblock.clustered {
            return bad(40, "the file length is not where the commit ends, or clustered is set");
        }
        Ok(superblock)
    }

    /// Where that superblock lies.
    fn base(&self) -> u64 {
        self.commit.map_or(0, |commit| commit.offset + RECORD_BYTES as u64)
    }

    fn head(&self) -> &[u8] {
        self.pieces.first().map_or(&[], |p| &p.1)
    }

    /// Bytes of the file that were supplied.
    fn there(&self, offset: u64, len: u64) -> Option<&[u8]> {
        self.pieces.iter().find_map(|(at, bytes)| slice(bytes, *at, offset, len))
    }

    /// Bytes of the file, or the wish for them: never more than the source has (spec: VAL-8, SAF-1, SAF-4).
    fn get(&self, offset: u64, len: u64, field: &'static str) -> Result<&[u8], Stop> {
        if let Some(bytes) = self.there(offset, len) {
            return Ok(bytes);
        }
        let end = offset.checked_add(len).filter(|&end| end <= self.source_len);
        // Asked for and delivered too short also ends here: the pieces tell.
        let asked = self.pieces.iter().skip(1).any(|p| p.0 == offset);
        if end.is_none() || asked {
            let message = format!("{len} bytes at {offset} lie behind the end of the data; fetch the file again");
            return Err(Error::at(Code::Truncated, self.source_len, field, message).into());
        }
        let len = usize::try_from(len).map_err(|_| {
            Error::at(Code::Limit, offset, field, "the table does not fit this machine's address space")
        })?;
        Err(Stop::Need(offset, len))
    }

    /// Everything from the start with the bytes that are there, in the order of the spec: restarted after each wish, at
    /// most four times (spec: VAL-1).
    fn parse(&self) -> Result<Head, Stop> {
        let superblock = self.superblock()?;
        self.check_file_len(&superblock)?;
        let sections = self.read_table(&superblock)?;
        let find = |fourcc| table::mandatory(&sections, fourcc, superblock.section_table_offset);
        let (vold, pdir) = (find(section::VOLD)?, find(section::PDIR)?);
        self.check_in_commit(&superblock, &sections)?;

        limits::check("section.stored_length", vold.stored_len, self.limits.table_bytes).map_err(|e| at(e, vold))?;
        let bytes = self.get(vold.offset, vold.stored_len, "VOLD")?;
        vold.check_crc(bytes)?;
        let descriptor = VolumeDescriptor::read_from(bytes, vold.offset)?;
        table::check_item_count(vold, descriptor.codecs.len() as u64, superblock.section_table_offset, &sections)?;
        self.check_limits(&descriptor, vold, &superblock)?;
        let octree = Octree::new(&descriptor)?;

        let (directory, directory_lost) = match self.read_directory(pdir, &octree, &superblock) {
            Ok(directory) => (directory, None),
            // Bricks can still be found by their leaders.
            Err(Stop::Fail(e)) if self.salvage => (Vec::new(), Some(e.to_string())),
            Err(stop) => return Err(stop),
        };

        let named = match sections.iter().find(|s| s.fourcc == section::FNAM) {
            // A name is worth no extra read: beyond the head it is left to the strict validator.
            Some(s) => match self.there(s.offset, s.stored_len) {
                Some(bytes) => {
                    let names = s.check_crc(bytes).and_then(|()| features::read_from(bytes, s.offset));
                    if self.salvage { names.unwrap_or_default() } else { names? }
                }
                None => Vec::new(),
            },
            None => Vec::new(),
        };
        let masks = [superblock.required, superblock.read_optional, superblock.optional];
        Ok(Head {
            feature_names: features::names(masks, &named),
            superblock,
            sections,
            descriptor,
            octree,
            directory,
            directory_lost,
            head_bytes: self.head().to_vec(),
            commit: self.commit,
            tail: self.commit.and_then(|_| self.pieces.get(1).cloned()).unwrap_or_default(),
            source_len: self.source_len,
        })
    }

    /// The file's length against the source's (spec: HDR-9).
    fn check_file_len(&self, superblock: &Superblock) -> Result<()> {
        if self.commit.is_some() {
            // The commit lies inside the source; what follows it is not finished, and no error (spec: LOG-9).
            return Ok(());
        }
        let (len, there) = (superblock.file_len, self.source_len);
        if there < len && !self.salvage {
            return Err(Error::at(
                Code::Truncated,
                there,
                "superblock.file_length",
                format!("the file ends here, {} bytes short; fetch it again or use salvage", len - there),
            ));
        }
        if there > len && !self.salvage {
            return Err(Error::at(
                Code::Size,
                40,
                "superblock.file_length",
                format!("the file should end at byte {len}, but {} more follow", there - len),
            ));
        }
        Ok(())
    }

    /// What a commit says lies in it, so that opening needs no further read (spec: LOG-8).
    fn check_in_commit(&self, superblock: &Superblock, sections: &[SectionEntry]) -> Result<()> {
        let Some(commit) = self.commit else { return Ok(()) };
        let start = commit.offset + (RECORD_BYTES + SUPERBLOCK_BYTES) as u64;
        if superblock.section_table_offset != start {
            let at = start - SUPERBLOCK_BYTES as u64 + 80;
            return Err(Error::at(Code::Commit, at, "commit.section_table_offset", "the table is not in the commit"));
        }
        for (i, s) in sections.iter().enumerate() {
            let own = [section::VOLD, section::PDIR, section::FNAM].contains(&s.fourcc);
            if if own { s.offset < start } else { s.end() > commit.offset } {
                let (at, name) = (start + (i * ENTRY_BYTES) as u64 + 8, show(s.fourcc));
                let message = format!("{name} lies {} its commit", if own { "before" } else { "inside or behind" });
                return Err(Error::at(Code::Commit, at, "section.offset", message));
            }
        }
        Ok(())
    }

    fn read_directory(&self, pdir: &SectionEntry, octree: &Octree, s: &Superblock) -> Result<Vec<ChunkRef>, Stop> {
        limits::check("section.stored_length", pdir.stored_len, self.limits.table_bytes).map_err(|e| at(e, pdir))?;
        let bytes = self.get(pdir.offset, pdir.stored_len, "PDIR")?;
        pdir.check_crc(bytes)?;
        debug_assert_eq!(bytes.len() % REF_BYTES, 0, "checked with the table");
        Ok(directory::parse_refs(bytes, pdir.offset, octree, s.file_len)?)
    }

    fn read_table(&self, superblock: &Superblock) -> Result<Vec<SectionEntry>, Stop> {
        let len = table::check_place(superblock).map_err(|e| e.shifted(self.base()))?;
        let start = superblock.section_table_offset;
        let bytes = self.get(start, len, "section_table")?;
        Ok(table::read_from(bytes, superblock)?)
    }

    /// The reader's own limits, and the resource level that the file declares (spec: VAL-4, VAL-5).
    fn check_limits(&self, d: &VolumeDescriptor, vold: &SectionEntry, superblock: &Superblock) -> Result<()> {
        let all = d.dims.voxels().checked_mul(u64::from(d.trees()));
        limits::check("VOLD.dims", all.unwrap_or(u64::MAX), self.limits.voxels)
            .map_err(|e| Error::at(e.code(), vold.offset, "VOLD.dims", e.message().to_owned()))?;
        let brick = d.dims.min(Extent::cube(1 << d.brick_log2)).voxels() * d.sample_type.bytes() as u64;
        limits::check("VOLD.brick_log2", brick, self.limits.brick_bytes)
            .map_err(|e| Error::at(e.code(), vold.offset + 22, "VOLD.brick_log2", e.message().to_owned()))?;
        let (declared, needed) = (superblock.resource_level, d.resource_level());
        if needed > declared {
            let message = format!("the file declares resource level {declared}, but its volume needs {needed}");
            return Err(Error::at(Code::Limit, self.base() + 74, "superblock.resource_level", message));
        }
        Ok(())
    }

    /// Adds the feature's name to an `E_FEATURE` of a required bit, where `FNAM` can be trusted (spec: HDR-5).
    /// `base` is where the superblock lies.
    fn name_feature(&self, e: Error, base: u64) -> Error {
        let e = e.shifted(base);
        if e.code() != Code::Feature || e.field() != "superblock.required" {
            return e;
        }
        let Some(name) = self.feature_name(base) else { return e };
        Error::at(e.code(), base + 48, "superblock.required", format!("{} (feature {name})", e.message()))
    }

    fn feature_name(&self, base: u64) -> Option<String> {
        let g = glimpse(self.there(base, SUPERBLOCK_BYTES as u64)?)?;
        let bit = features::unknown_required(g.required)?;
        let len = u64::from(g.section_count.min(limits::MAX_SECTIONS)) * ENTRY_BYTES as u64;
        let table = self.there(g.section_table_offset, len)?;
        let mut entries = table.chunks_exact(ENTRY_BYTES).filter_map(|b| SectionEntry::read_from(b, 0).ok());
        let fnam = entries.find(|s| s.fourcc == section::FNAM)?;
        let bytes = self.there(fnam.offset, fnam.stored_len)?;
        fnam.check_crc(bytes).ok()?;
        let names = features::read_from(bytes, 0).ok()?;
        names.into_iter().find(|n| n.mask == 0 && u32::from(n.bit) == bit).map(|n| n.name)
    }
}

/// `offset..offset + len` of bytes that lie at `base`.
pub(super) fn slice(bytes: &[u8], base: u64, offset: u64, len: u64) -> Option<&[u8]> {
    let start = usize::try_from(offset.checked_sub(base)?).ok()?;
    let end = start.checked_add(usize::try_from(len).ok()?)?;
    bytes.get(start..end)
}

fn at(e: Error, section: &SectionEntry) -> Error {
    let name = format!("{} of {}", e.field(), show(section.fourcc));
    Error::at(e.code(), section.offset, name, e.message().to_owned())
}
