//! The records of a log: each whole and in its place, and what lives among them (spec chapter 15).

use super::load::fetch;
use super::{Read, Strict, load};
use crate::container::layout::payload_start;
use crate::container::log::{CommitParts, Item, Record, RecordKind, Walk, Walked, section_key};
use crate::container::section;
use crate::container::{
    Commit, GUARD_BYTES, Leader, NodeFlags, NodeKind, OPTIONAL_NAN_REPLACED, REQUIRED_ZSTD, Superblock, features,
};
use crate::error::{Code, Error, Result};
use crate::geometry::unmorton8;
use crate::limits::Limits;
use std::collections::{BTreeMap, BTreeSet};

/// Bytes read at a time where a content is only checked.
const PIECE: u64 = 1 << 20;

/// What the commit says must be the content of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Live {
    Other(Record),
    /// Its leader has been held against its node.
    Brick,
}

impl Strict {
    /// What lies behind the last commit is damage to a validator (spec: LOG-9, VAL-13).
    pub(super) fn check_unfinished(&mut self) {
        let behind = self.head.unfinished();
        let Some(commit) = self.head.commit.filter(|_| behind > 0) else { return };
        let live = self.bricks.len();
        let message = format!(
            "{behind} bytes follow the last whole commit (generation {}, {live} stored bricks live); their writer was \
             stopped, or they are damaged: `vug recover` saves what is whole",
            commit.generation
        );
        self.report(Error::at(Code::Commit, commit.end, "commit", message));
    }

    /// Walks all records of a log (spec: LOG-2 to LOG-6, VAL-9, VAL-10).
    pub(super) fn check_records(&mut self, commit: Commit, limits: &Limits, read: &mut Read<'_>) {
        let mut live = self.live();
        let mut constant = self.constants();
        let mut walk = Walk::new(commit.end, self.head.superblock.file_id);
        let mut generation = 0;
        loop {
            let record = match walk.next(read) {
                Ok(Some(record)) => record,
                Ok(None) => break,
                Err(e) => {
                    self.report(e);
                    return;
                }
            };
            let checked = match record.item {
                Item::Brick(leader) => self.check_leader(&record, &leader, &mut live, &mut constant, read),
                Item::Other(other) => {
                    let lives = live.remove(&record.content());
                    let placed = check_place(&record, 4..=if other.kind == RecordKind::Section { 20 } else { 4 });
                    placed.and_then(|()| self.check_other(&record, &other, lives, &mut generation, limits, read))
                }
            };
            self.keep(checked);
        }
        for (at, what) in live {
            let message = format!("the commit refers to what no record holds: {what:?}");
            self.report(Error::at(Code::Leader, at, "record", message));
        }
        if let Some((tree, level, brick)) = constant.first() {
            let message = format!("CONSTANT brick {brick:?} of level {level}, tree {tree}, has no leader");
            self.report(Error::at(Code::Leader, commit.offset, "leader", message));
        }
        let checked = self.compare_commit(&commit, read);
        self.keep(checked);
    }

    /// Contents that the commit refers to, by offset.
    fn live(&mut self) -> BTreeMap<u64, Live> {
        let mut all: Vec<(u64, Live)> = self.bricks.iter().map(|b| (b.node.offset, Live::Brick)).collect();
        let other = |kind, key, len: u64, crc| Live::Other(Record { kind, key, len, crc });
        for c in &self.head.directory {
            all.push((c.offset, other(RecordKind::Chunk, c.ordinal, c.byte_len() as u64, c.crc)));
        }
        for (&ordinal, entry) in &self.page_entries {
            all.push((entry.offset, other(RecordKind::Page, ordinal, entry.byte_len() as u64, entry.crc)));
        }
        let own = [section::VOLD, section::FNAM, section::PDIR, section::PAGE, section::BRIK];
        for s in self.head.sections.iter().filter(|s| !own.contains(&s.fourcc)) {
            all.push((s.offset, other(RecordKind::Section, section_key(s.fourcc), s.stored_len, s.crc)));
        }
        let mut live = BTreeMap::new();
        for (at, what) in all {
            if let Some(before) = live.insert(at, what) {
                let message = format!("{what:?} and {before:?} lie in the same bytes");
                self.report(Error::at(Code::SectionOverlap, at, "record", message));
            }
        }
        live
    }

    /// The CONSTANT bricks of the index.
    fn constants(&self) -> BTreeSet<(u32, u8, [u32; 3])> {
        let mut all = BTreeSet::new();
        for (&ordinal, page) in &self.nodes.pages {
            let (tree, level, position) = self.head.octree.page_position(ordinal);
            for (slot, _) in page.iter().enumerate().filter(|(_, n)| n.kind == NodeKind::Constant) {
                let local = unmorton8(slot);
                all.insert((tree, level, std::array::from_fn(|a| position[a] * 8 + local[a])));
            }
        }
        all
    }

    fn check_leader(
        &self,
        record: &Walked,
        leader: &Leader,
        live: &mut BTreeMap<u64, Live>,
        constant: &mut BTreeSet<(u32, u8, [u32; 3])>,
        read: &mut Read<'_>,
    ) -> Result<()> {
        let d = &self.head.descriptor;
        let bad = |message: &str| Err(Error::at(Code::Leader, record.at, "leader", message));
        let (tree, level, brick) = (leader.tree, leader.level, leader.brick);
        if leader.kind == NodeKind::Constant {
            check_place(record, 4..=4)?;
            // One of a tree that no commit has is dead.
            if self.head.octree.contains(tree, level, brick) {
                let (ordinal, slot) = self.head.octree.locate(tree, level, brick);
                if Leader::of(self.nodes.node(ordinal, slot), tree, level, brick) == *leader {
                    constant.remove(&(tree, level, brick));
                }
            }
            leader
                .node(record.at)
                .constant(d.sample_type)
                .map_err(|e| Error::at(e.code(), record.at + 24, "leader.value", e.message().to_owned()))?;
            return Ok(());
        }
        let Some(codec) = d.codecs.get(usize::from(leader.codec)) else {
            return bad("the codec entry does not exist");
        };
        let align_log2 = codec.payload_align_log2(leader.flags.contains(NodeFlags::ZSTD));
        check_place(record, align_log2..=align_log2)?;
        let window = record.content()..record.end;
        match live.remove(&window.start) {
            // Checked with its payload.
            Some(Live::Brick) => return Ok(()),
            Some(Live::Other(_)) => return bad("a brick lies where the commit has something else"),
            None => {}
        }
        // Nobody reads a dead brick, but every byte of a valid file is what it should be.
        let bytes = fetch(&self.head, window.start, window.end - window.start, read)?;
        let (payload, guard) = bytes.split_at(bytes.len().saturating_sub(GUARD_BYTES as usize));
        leader.node(record.at).check_payload(payload)?;
        match guard.iter().position(|&b| b != 0) {
            None => Ok(()),
            Some(i) => {
                let at = window.end - GUARD_BYTES + i as u64;
                Err(Error::at(Code::Padding, at, "brick.guard", format!("guard byte is {:#04x}, not 0", guard[i])))
            }
        }
    }

    fn check_other(
        &self,
        record: &Walked,
        other: &Record,
        lives: Option<Live>,
        generation: &mut u64,
        limits: &Limits,
        read: &mut Read<'_>,
    ) -> Result<()> {
        match lives {
            // The bytes have passed the CRC of the index or of the section table, which is the same.
            Some(live) if live == Live::Other(*other) => return Ok(()),
            Some(live) => {
                let message = format!("{other:?} is what the leader says, {live:?} what the commit says");
                return Err(Error::at(Code::Leader, record.at, "record", message));
            }
            None => {}
        }
        if other.kind == RecordKind::Commit {
            let due = std::mem::replace(generation, generation.saturating_add(1));
            if other.key != due {
                let message = format!("commit {} where {due} is due", other.key);
                return Err(Error::at(Code::Commit, record.at + 8, "commit.generation", message));
            }
            // Each of them has owned the file, and was the end of it (spec: LOG-6).
            let head = load::head(record.end, limits, read)?;
            if head.commit.map(|c| c.offset) == Some(record.at) {
                return Ok(());
            }
            return Err(Error::at(Code::Commit, record.at, "commit", "no reader would take this commit"));
        }
        let computed = crc_of(record.content()..record.end, read)?;
        if computed == other.crc {
            return Ok(());
        }
        let message = format!("CRC {computed:08x} computed, {:08x} stored; the record is damaged", other.crc);
        Err(Error::at(Code::SectionCrc, record.content(), "record", message))
    }

    /// The superblock and the last commit are what a writer would write (spec: LOG-1, LOG-5, LOG-7, VAL-11).
    fn compare_commit(&self, commit: &Commit, read: &mut Read<'_>) -> Result<()> {
        let (head, d) = (&self.head, &self.head.descriptor);
        let stored = self.bricks.iter().any(|b| b.node.flags.contains(NodeFlags::ZSTD));
        let replaced = if d.replaced > 0 { OPTIONAL_NAN_REPLACED } else { 0 };
        let superblock = Superblock {
            required: if stored { REQUIRED_ZSTD } else { 0 },
            optional: head.superblock.optional & !OPTIONAL_NAN_REPLACED | replaced,
            resource_level: d.resource_level(),
            ..head.superblock.clone()
        };
        let masks = [superblock.required, superblock.read_optional, superblock.optional];
        let names = features::names(masks, &head.feature_names);
        let own = [section::VOLD, section::FNAM, section::PDIR, section::PAGE, section::BRIK];
        let sections: Vec<_> = head.sections.iter().filter(|s| !own.contains(&s.fourcc)).cloned().collect();
        let parts = CommitParts {
            superblock: superblock.clone(),
            descriptor: d,
            names: &names,
            refs: &head.directory,
            pages: self.page_entries.len() as u64,
            stored: self.bricks.len() as u64,
            sections: &sections,
        };
        self.compare_bytes(commit.offset, &parts.write_to(commit.offset, commit.generation), read)?;
        let first = Superblock {
            file_len: 0,
            required: 0,
            read_optional: 0,
            optional: 0,
            section_count: 0,
            section_table_offset: 0,
            section_table_crc: 0,
            ..superblock
        };
        let minor = Superblock::read_from(&head.head_bytes)?.minor;
        self.compare_bytes(0, &Superblock { minor, ..first }.write_to(), read)
    }
}

/// The record starts as soon behind the one before as its alignment allows (spec: LOG-2).
fn check_place(record: &Walked, mut align_log2: std::ops::RangeInclusive<u8>) -> Result<()> {
    if align_log2.any(|log2| payload_start(record.from, log2) == record.content()) {
        return Ok(());
    }
    let message = format!("the record starts at {}, which is not as soon as it could", record.at);
    Err(Error::at(Code::Canon, record.at, "record", message))
}

fn crc_of(range: std::ops::Range<u64>, read: &mut Read<'_>) -> Result<u32> {
    let (mut hasher, mut at) = (crc32fast::Hasher::new(), range.start);
    while at < range.end {
        #[allow(clippy::cast_possible_truncation, reason = "at most 1 MiB")]
        let bytes = read(at, (range.end - at).min(PIECE) as usize)?;
        hasher.update(&bytes);
        at += (bytes.len() as u64).max(1);
    }
    Ok(hasher.finalize())
}
