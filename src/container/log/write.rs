//! Writing a log: records as they come, a commit whenever what was put is to be readable (spec chapter 15).

use super::super::content;
use super::super::directory::{CHUNK_PAGES, ChunkRef, PageEntry, write_entries, write_nodes};
use super::super::features::{self, FeatureName, OPTIONAL_NAN_REPLACED, REQUIRED_ZSTD};
use super::super::layout::{align_up, payload_start};
use super::super::section::{ExtraSection, SectionEntry};
use super::super::store::NodeStore;
use super::super::superblock::{FileLayout, Superblock};
use super::super::write::{check_constant, check_stored, write_brick};
use super::super::{
    BrickSink, FileSummary, FinishOptions, LEADER_BYTES, Leader, Node, NodeFlags, Octree, VolumeDescriptor,
};
use super::record::{RECORD_BYTES, Record, RecordKind, section_key};
use super::said::Said;
use crate::error::{Error, Result};
use crate::geometry::Coord;
use crate::limits;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufWriter, Write};

/// Writes a log file, front to back: `W` need not seek. Bricks are readable from the next
/// [`checkpoint`](BrickSink::checkpoint) on, whatever becomes of the writer after it; making the bytes durable
/// (`fsync`) is the caller's affair. Memory: 16 KiB per index page (512 bricks).
pub struct LogWriter<W: Write> {
    out: BufWriter<W>,
    /// One past the last byte written.
    pub(super) cursor: u64,
    pub(super) superblock: Superblock,
    descriptor: VolumeDescriptor,
    octree: Octree,
    /// Trees below this one were in the file before: nothing can be put into them.
    pub(super) first_tree: u32,
    /// Each brick with its own bounds: joining waits for commits, because later bricks change it.
    nodes: NodeStore,
    /// Trees that have changed since the last commit.
    changed: BTreeSet<u32>,
    /// Pages that are written, and what is in them.
    pub(super) pages: BTreeMap<u64, (PageEntry, Ident)>,
    pub(super) chunks: BTreeMap<u64, ChunkRef>,
    /// Sections that are written, and what is in them.
    pub(super) sections: Vec<(SectionEntry, Ident)>,
    /// What the last commit says, which it is, and where it ends.
    pub(super) last: Option<(Said, Ident, u64)>,
    /// Bytes behind it that make it due again.
    commit_every: u64,
    /// Bytes of pages and sections that the last commit took to go through.
    gone_through: u64,
    pub(super) generation: u64,
    pub(super) stored: u64,
    stored_bytes: u64,
    /// A write has failed: nobody knows where the file ends.
    broken: bool,
}

/// Bytes of a page's nodes.
const PAGE_BYTES: u64 = 16 << 10;

/// BLAKE3 of a content: what is written already is not written again.
pub(super) type Ident = [u8; 32];

impl<W: Write> LogWriter<W> {
    /// Starts a log for the octree and codec table of `descriptor`, and commits that it has no bricks, so that whatever
    /// happens from now on, what the file is a file of is known. `options` are written too; each commit can change them.
    ///
    /// The file id follows from both, unless `options` gives one (spec: HDR-13).
    ///
    /// # Errors
    /// Those of [`VolumeDescriptor::check`] and of [`BrickSink::finish`].
    pub fn create(out: W, descriptor: &VolumeDescriptor, options: &FinishOptions) -> Result<Self> {
        // What only bricks can make true is not true yet.
        let empty = VolumeDescriptor { payload_bytes: 0, replaced: 0, achieved: None, ..descriptor.clone() };
        let octree = Octree::new(&empty)?;
        let sections = sections_of(options, &empty)?;
        let superblock = Superblock {
            layout: FileLayout::Log,
            section_table_offset: 0,
            resource_level: empty.resource_level(),
            file_id: options.file_id.unwrap_or_else(|| log_id(&empty, &sections)),
            ..Superblock::new()
        };
        let mut writer = LogWriter::over(out, 0, superblock, empty.clone(), octree);
        writer.emit(&writer.superblock.write_to())?;
        writer.commit(&empty, options)?;
        Ok(writer)
    }

    pub(super) fn over(
        out: W,
        cursor: u64,
        superblock: Superblock,
        descriptor: VolumeDescriptor,
        octree: Octree,
    ) -> Self {
        LogWriter {
            out: BufWriter::new(out),
            cursor,
            superblock,
            descriptor,
            octree,
            first_tree: 0,
            nodes: NodeStore::default(),
            changed: BTreeSet::new(),
            pages: BTreeMap::new(),
            chunks: BTreeMap::new(),
            sections: Vec::new(),
            last: None,
            commit_every: limits::LOG_COMMIT_BYTES,
            gone_through: 0,
            generation: 0,
            stored: 0,
            stored_bytes: 0,
            broken: false,
        }
    }

    /// Where the file ends, everything put so far included.
    #[must_use]
    pub fn len(&self) -> u64 {
        self.cursor
    }

    /// Whether nothing was written: never, once [`LogWriter::create`] has returned.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.cursor == 0
    }

    /// The file's id.
    #[must_use]
    pub fn file_id(&self) -> [u8; 16] {
        self.superblock.file_id
    }

    /// What is written to; bytes may still be in a buffer, but for those before the last commit.
    pub fn get_mut(&mut self) -> &mut W {
        self.out.get_mut()
    }

    /// How many bytes may follow a commit before the last one is said again, so that whoever opens a file whose writer was
    /// killed finds one near the end: 64 MiB, and never more (spec: LOG-10).
    pub fn commit_every(&mut self, bytes: u64) {
        self.commit_every = bytes.min(limits::LOG_COMMIT_BYTES);
    }

    fn emit(&mut self, bytes: &[u8]) -> Result<()> {
        self.check_whole()?;
        self.broken = true;
        self.out.write_all(bytes).map_err(|e| Error::io("writing", e))?;
        self.broken = false;
        self.cursor += bytes.len() as u64;
        Ok(())
    }

    fn check_whole(&self) -> Result<()> {
        if self.broken {
            return Err(Error::param(
                "log",
                "an earlier write failed: open the file again and append to its last commit",
            ));
        }
        Ok(())
    }

    /// Writes a record whose content starts at a multiple of 2^`align_log2`, and returns where that is (spec: LOG-2).
    fn put_record(&mut self, kind: RecordKind, key: u64, content: &[u8], align_log2: u8) -> Result<u64> {
        self.renew(content.len() as u64)?;
        let start = payload_start(self.cursor, align_log2);
        let padding = start - RECORD_BYTES as u64 - self.cursor;
        let mut bytes = vec![0; usize::try_from(padding).expect("at most 1 MiB")];
        bytes.extend(Record::of(kind, key, content).write_to(&self.superblock.file_id));
        self.emit(&bytes)?;
        self.emit(content)?;
        Ok(start)
    }

    fn put(&mut self, tree: u32, level: u8, brick: Coord, node: Node) -> Result<()> {
        self.check_whole()?;
        if tree < self.first_tree {
            let message = format!("tree {tree} was in the file before; only further time steps can be appended");
            return Err(Error::param("tree", message));
        }
        self.nodes.put(&self.octree, tree, level, brick, node)?;
        self.changed.insert(tree);
        Ok(())
    }

    /// Writes and flushes all that the next commit refers to, but not the commit. Who wants a commit to outlive a power cut
    /// calls this, syncs the file, then [`checkpoint`](BrickSink::checkpoint) or [`finish`](BrickSink::finish) with the same
    /// arguments, and syncs again: then no commit is there before what it refers to (spec: LOG-10).
    ///
    /// # Errors
    /// As [`BrickSink::checkpoint`].
    pub fn prepare(&mut self, descriptor: &VolumeDescriptor, options: &FinishOptions) -> Result<()> {
        self.write_records(descriptor, options)?;
        self.flush()
    }

    /// Pages, chunks and sections that are new or have changed; returns the names of the features.
    fn write_records(&mut self, descriptor: &VolumeDescriptor, options: &FinishOptions) -> Result<Vec<FeatureName>> {
        self.check_whole()?;
        self.take_descriptor(descriptor)?;
        let sections = sections_of(options, descriptor)?;
        let names = self.take_features(descriptor, options)?;
        self.gone_through = sections.iter().map(|s| s.bytes.len() as u64).sum();
        self.write_pages(descriptor)?;
        self.write_sections(sections)?;
        Ok(names)
    }

    fn flush(&mut self) -> Result<()> {
        self.broken = true;
        self.out.flush().map_err(|e| Error::io("writing", e))?;
        self.broken = false;
        Ok(())
    }

    /// Commits all that was put (spec: LOG-10).
    fn commit(&mut self, descriptor: &VolumeDescriptor, options: &FinishOptions) -> Result<()> {
        let names = self.write_records(descriptor, options)?;
        let refs: Vec<ChunkRef> = self.chunks.values().copied().collect();
        let sections: Vec<SectionEntry> = self.sections.iter().map(|s| s.0.clone()).collect();
        let said = Said {
            superblock: self.superblock.clone(),
            descriptor: descriptor.clone(),
            names,
            refs,
            pages: self.pages.len() as u64,
            stored: self.stored,
            sections,
        };
        let ident = said.ident();
        // Where nothing is new, the last commit says it all.
        if self.last.as_ref().is_some_and(|last| last.1 == ident) {
            return self.flush();
        }
        self.say(said, ident)
    }

    /// Writes a commit.
    fn say(&mut self, said: Said, ident: Ident) -> Result<()> {
        let at = align_up(self.cursor, 4);
        #[allow(clippy::cast_possible_truncation, reason = "below 16")]
        let padding = vec![0; (at - self.cursor) as usize];
        let bytes = said.write_to(at, self.generation);
        self.emit(&padding)?;
        // Whoever syncs when flushed has all that the commit speaks of on disk before the commit is.
        self.flush()?;
        self.emit(&bytes)?;
        self.generation += 1;
        self.last = Some((said, ident, self.cursor));
        self.flush()
    }

    /// Says the last commit again where, with a record of `len` more bytes, it would lie too far back (spec: LOG-10).
    fn renew(&mut self, len: u64) -> Result<()> {
        let behind = self.last.as_ref().map_or(0, |last| self.cursor - last.2);
        if behind > 0
            && behind + len > self.commit_every
            && let Some((said, ident, _)) = self.last.take()
        {
            self.say(said, ident)?;
        }
        Ok(())
    }

    /// The volume may have more time steps than at first, all else that bricks depend on stays.
    pub(super) fn take_descriptor(&mut self, new: &VolumeDescriptor) -> Result<()> {
        let old = &self.descriptor;
        let same = (old.dims, old.channels, old.sample_type, old.lod_count, old.brick_log2, old.null_value)
            == (new.dims, new.channels, new.sample_type, new.lod_count, new.brick_log2, new.null_value)
            && new.codecs.starts_with(&old.codecs)
            && new.time_steps >= old.time_steps;
        if !same {
            let what = "octree, sample type, null value and codecs must be those the log was begun with; \
                        time steps and codec entries may be added";
            return Err(Error::param("descriptor", what));
        }
        if new.time_steps != old.time_steps {
            self.octree = Octree::new(new)?;
        }
        new.check()?;
        self.descriptor = new.clone();
        Ok(())
    }

    fn take_features(&mut self, d: &VolumeDescriptor, options: &FinishOptions) -> Result<Vec<FeatureName>> {
        features::check_names(&options.feature_names)?;
        self.superblock.optional = options.optional & !OPTIONAL_NAN_REPLACED;
        self.superblock.optional |= if d.replaced > 0 { OPTIONAL_NAN_REPLACED } else { 0 };
        let s = &self.superblock;
        Ok(features::names([s.required, s.read_optional, s.optional], &options.feature_names))
    }

    /// Pages and chunks that have changed.
    fn write_pages(&mut self, d: &VolumeDescriptor) -> Result<()> {
        let mut chunks = BTreeSet::new();
        for tree in std::mem::take(&mut self.changed) {
            let mut joined = self.nodes.tree(&self.octree, tree);
            joined.join(&self.octree, d.null_sample());
            self.gone_through += joined.pages.len() as u64 * PAGE_BYTES;
            for (ordinal, nodes) in joined.pages {
                let bytes = write_nodes(&nodes);
                let ident = *blake3::hash(&bytes).as_bytes();
                if self.pages.get(&ordinal).is_none_or(|p| p.1 != ident) {
                    let offset = self.put_record(RecordKind::Page, ordinal, &bytes, 4)?;
                    self.pages.insert(ordinal, (PageEntry::new(offset, &bytes), ident));
                    chunks.insert(ordinal / CHUNK_PAGES);
                }
            }
        }
        for chunk in chunks {
            let first = chunk * CHUNK_PAGES;
            let mut entries = Vec::new();
            for (ordinal, page) in self.pages.range(first..first + CHUNK_PAGES) {
                #[allow(clippy::cast_possible_truncation, reason = "below 1024")]
                entries.resize((ordinal - first) as usize, PageEntry::EMPTY);
                entries.push(page.0);
            }
            let bytes = write_entries(&entries);
            let offset = self.put_record(RecordKind::Chunk, chunk, &bytes, 4)?;
            self.chunks.insert(chunk, ChunkRef::new(chunk, offset, &bytes));
        }
        Ok(())
    }

    /// Sections that are new or have changed; those that are gone are forgotten.
    fn write_sections(&mut self, sections: Vec<ExtraSection>) -> Result<()> {
        let known = std::mem::take(&mut self.sections);
        for s in sections {
            let ident = ident_of(&s);
            if let Some(there) = known.iter().find(|k| k.1 == ident) {
                self.sections.push(there.clone());
                continue;
            }
            let key = section_key(s.entry.fourcc);
            let offset = self.put_record(RecordKind::Section, key, &s.bytes, s.entry.align_log2)?;
            self.sections.push((SectionEntry { offset, ..s.entry }, ident));
        }
        Ok(())
    }

    fn summary(&self) -> FileSummary {
        let counts = self.nodes.counts();
        let trees = u64::from(self.octree.trees()).max(1);
        let bricks = self.octree.brick_count() / trees * trees.saturating_sub(u64::from(self.first_tree));
        FileSummary {
            len: self.cursor,
            file_id: self.superblock.file_id,
            stored: counts.stored,
            constant: counts.constant,
            empty: bricks.saturating_sub(counts.stored).saturating_sub(counts.constant),
            pages: self.pages.len() as u64,
            stored_bytes: self.stored_bytes,
        }
    }
}

impl<W: Write> BrickSink for LogWriter<W> {
    type Out = W;

    fn octree(&self) -> &Octree {
        &self.octree
    }

    fn put_stored(&mut self, tree: u32, level: u8, brick: Coord, node: &Node, payload: &[u8]) -> Result<()> {
        let (mut node, align_log2) = check_stored(&self.descriptor, node, payload)?;
        self.renew(payload.len() as u64)?;
        node.offset = payload_start(self.cursor, align_log2);
        self.put(tree, level, brick, node)?;
        let leader = Leader::of(&node, tree, level, brick).write_to(&self.superblock.file_id);
        self.broken = true;
        self.cursor = write_brick(&mut self.out, self.cursor, node.offset, &leader, payload)?;
        self.broken = false;
        self.stored += 1;
        self.stored_bytes += payload.len() as u64;
        if node.flags.contains(NodeFlags::ZSTD) {
            self.superblock.required |= REQUIRED_ZSTD;
        }
        Ok(())
    }

    /// As in a head file; here the brick gets a leader too, so that it is not lost with its page.
    fn put_constant(&mut self, tree: u32, level: u8, brick: Coord, node: &Node) -> Result<()> {
        let node = check_constant(&self.descriptor, node)?;
        self.renew(LEADER_BYTES as u64)?;
        self.put(tree, level, brick, node)?;
        let leader = Leader::of(&node, tree, level, brick).write_to(&self.superblock.file_id);
        #[allow(clippy::cast_possible_truncation, reason = "below 16")]
        let padding = (align_up(self.cursor, 4) - self.cursor) as usize;
        self.emit(&[0; LEADER_BYTES][..padding])?;
        self.emit(&leader)
    }

    fn checkpoint_cost(&self) -> u64 {
        self.gone_through
    }

    /// Writes the pages, chunks and sections that have changed and a commit, and flushes. `descriptor` may have more time
    /// steps and codec entries than before.
    fn checkpoint(&mut self, descriptor: &VolumeDescriptor, options: &FinishOptions) -> Result<()> {
        self.commit(descriptor, options)
    }

    /// Commits. Bricks of the summary are those that this writer has put; pages are all that the file has.
    fn finish(mut self, descriptor: &VolumeDescriptor, options: FinishOptions) -> Result<(W, FileSummary)> {
        self.commit(descriptor, &options)?;
        let summary = self.summary();
        let out = self.out.into_inner().map_err(|e| Error::io("writing", e.into_error()))?;
        Ok((out, summary))
    }
}

/// The sections that lie in records of their own.
fn sections_of(options: &FinishOptions, d: &VolumeDescriptor) -> Result<Vec<ExtraSection>> {
    let books = options.codebooks.clone().map(content::codebooks).transpose()?;
    let others = content::others(options.times.as_ref(), options.meta.clone(), options.extra.clone(), d.time_steps)?;
    let all: Vec<ExtraSection> = books.into_iter().chain(others).collect();
    // VOLD, FNAM, PDIR, PAGE, BRIK
    limits::check("section_count", all.len() as u64 + 5, u64::from(limits::MAX_SECTIONS))?;
    Ok(all)
}

/// What a section says, wherever it lies.
pub(super) fn ident_of(s: &ExtraSection) -> Ident {
    let entry = SectionEntry { offset: 0, ..s.entry.clone() };
    *blake3::Hasher::new().update(&entry.write_to()).update(&s.bytes).finalize().as_bytes()
}

/// The file id that follows from what is known when a log is begun (spec: HDR-13).
fn log_id(d: &VolumeDescriptor, sections: &[ExtraSection]) -> [u8; 16] {
    let mut hash = blake3::Hasher::new();
    hash.update(&d.write_to());
    for s in sections {
        hash.update(&s.bytes);
    }
    std::array::from_fn(|i| hash.finalize().as_bytes()[i])
}
