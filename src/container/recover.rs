//! What is whole of a damaged or unfinished file: the last commit, then leaders (spec chapters 6 and 15).
//!
//! Sans I/O but for a callback, and without codecs: payloads are judged by their CRC.

use super::directory::{CHUNK_PAGES, PageEntry, parse_chunk, parse_page};
use super::kept::{fetch, keep_section};
use super::leader::{self, LEADER_BYTES, Leader};
use super::log::{FIRST_RECORD, Record, RecordKind, check_commit_at};
use super::section;
use super::strict::Read;
use super::{FileLayout, FinishOptions, Head, HeadParser, Node, NodeKind, SUPERBLOCK_BYTES, Step, Superblock};
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, unmorton8};
use crate::limits::Limits;
use std::collections::BTreeMap;

/// Bytes searched for leaders at a time.
const WINDOW: u64 = 4 << 20;
/// Bytes passed over where reading fails.
const SECTOR: u64 = 4096;
/// How often the bytes of a file may be read again for payloads that leaders name: what bounds the work on a hostile file.
const TIMES_OVER: u64 = 4;
/// Most errors that are kept of each kind.
const MAX_ERRORS: usize = 100_000;

/// Tree, level and position of a brick.
pub type Place = (u32, u8, Coord);

/// A brick that is whole.
#[derive(Clone, Copy, Debug)]
pub struct LiveBrick {
    /// Tree, level, position in bricks of the level.
    pub place: Place,
    /// Its node: STORED, with a payload whose CRC is right, or CONSTANT.
    pub node: Node,
    /// Whether the node is from the index. Else it is from a leader, and bounds and error are not known (0).
    pub indexed: bool,
}

/// A brick that is known to have been there and is not whole.
#[derive(Debug)]
pub struct LostBrick {
    /// Tree, level, position in bricks of the level.
    pub place: Place,
    /// Why.
    pub error: Error,
}

/// What [`recover`] has found.
#[derive(Debug)]
pub struct Recovery {
    /// What opening says. The directory may be empty or name pages that are damaged: go by `bricks`.
    pub head: Head,
    /// Metadata, times, codebooks and further sections, as far as they are whole.
    pub options: FinishOptions,
    /// Bricks that are whole, by tree, level and position (z, y, x). All others are EMPTY, or lost.
    pub bricks: Vec<LiveBrick>,
    /// Bricks that are not, in the same order.
    pub lost: Vec<LostBrick>,
    /// Tables that are damaged: sections, chunks, pages. CONSTANT bricks of a head file are lost with their page, without
    /// being named; those of a log have leaders.
    pub damage: Vec<Error>,
    /// Whole bricks of time steps that no commit has: an append that was stopped.
    pub beyond: u64,
}

/// Looks through a file of `len` bytes that `read` delivers: a log whose end is missing or damaged, or a file of either
/// layout with a damaged index. The superblock must be whole; of a head file also section table and volume descriptor, of a
/// log any commit.
///
/// Reads what the index names once, and where something is missing, the whole file (spec: LOG-11). Memory: a few hundred
/// bytes for each brick that lives or is lost; each has 32 bytes of its own in the file, at least.
///
/// # Errors
/// Those of opening, where there is nothing to start from: `E_COMMIT` for a log without a whole commit.
pub fn recover(len: u64, limits: &Limits, read: &mut Read<'_>) -> Result<Recovery> {
    let head = open(len, limits, read)?;
    let mut search = Search {
        options: FinishOptions {
            optional: head.superblock.optional,
            feature_names: head.feature_names.clone(),
            ..FinishOptions::default()
        },
        head,
        live: BTreeMap::new(),
        lost: BTreeMap::new(),
        damage: Vec::new(),
        beyond: 0,
        named: FIRST_RECORD,
        budget: len.saturating_mul(TIMES_OVER).saturating_add(limits.brick_bytes),
        len,
    };
    search.sections(limits, read);
    search.index(read);
    let whole = search.damage.is_empty() && search.lost.is_empty();
    let from = match search.head.commit {
        // A commit that only says again what the one before said has bricks before it that none speaks of.
        Some(commit) if whole => search.named.min(commit.end),
        None if whole && search.len >= search.head.superblock.file_len => len,
        Some(_) => FIRST_RECORD,
        None => SUPERBLOCK_BYTES as u64,
    };
    search.leaders(from, read);
    Ok(search.finish())
}

/// Opens the file, or what is left of it.
fn open(len: u64, limits: &Limits, read: &mut Read<'_>) -> Result<Head> {
    let error = match drive(HeadParser::salvage(len, limits), read) {
        Err(e) if e.code() == Code::Commit => e,
        other => return other,
    };
    // No commit in reach of a reader: any commit of the file will do, the last one best.
    let head = read(0, SUPERBLOCK_BYTES)?;
    let file_id = Superblock::read_from(&head)?.file_id;
    // Commits do not overlap: together they are no longer than the file, but for what is no commit.
    let (mut found, mut budget) = (None, len.saturating_mul(TIMES_OVER));
    scan(FIRST_RECORD, len, read, &mut |at, bytes, read| {
        if let Ok(record) = Record::read_from(bytes, at, &file_id)
            && record.kind == RecordKind::Commit
            && record.len <= limits.table_bytes.min(budget)
        {
            budget -= record.len;
            if check_commit_at(at, &record, &file_id, read).is_ok() {
                found = Some(record.end(at));
                return record.end(at);
            }
        }
        at + 16
    });
    match found {
        Some(end) => drive(HeadParser::salvage(end, limits), read).map(|head| Head { source_len: len, ..head }),
        None => Err(error),
    }
}

fn drive(mut parser: HeadParser, read: &mut Read<'_>) -> Result<Head> {
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

struct Search {
    head: Head,
    options: FinishOptions,
    live: BTreeMap<Key, (Node, bool)>,
    lost: BTreeMap<Key, Error>,
    damage: Vec<Error>,
    beyond: u64,
    /// One past the last byte that the commit refers to.
    named: u64,
    budget: u64,
    len: u64,
}

/// Sorts as the octree does: tree, level, z, y, x.
type Key = (u32, u8, [u32; 3]);

fn key((tree, level, [x, y, z]): Place) -> Key {
    (tree, level, [z, y, x])
}

fn place((tree, level, [z, y, x]): Key) -> Place {
    (tree, level, [x, y, z])
}

impl Search {
    fn damaged(&mut self, e: Error) {
        if self.damage.len() < MAX_ERRORS {
            self.damage.push(e);
        }
    }

    fn sections(&mut self, limits: &Limits, read: &mut Read<'_>) {
        for entry in self.head.sections.clone() {
            if ![section::PAGE, section::BRIK, section::VOLD, section::FNAM, section::PDIR].contains(&entry.fourcc) {
                self.named = self.named.max(entry.end());
            }
            if let Err(e) = keep_section(&self.head, &entry, &mut self.options, limits, read) {
                self.damaged(e);
            }
        }
    }

    /// Bricks that the index names: of pages that together are no longer than their section, as readers hold them to. Each
    /// brick that is kept, live or lost, thus has bytes of its own in the file (spec: LOG-11).
    fn index(&mut self, read: &mut Read<'_>) {
        if let Some(why) = self.head.directory_lost.clone() {
            self.damaged(Error::new(Code::DirCrc, "PDIR", why));
        }
        let most = self.len;
        // What the file says of its length may be false.
        let section = self.head.section_range(*b"PAGE");
        let (mut chunks, mut room) = (self.len, (section.end - section.start).min(self.len));
        for chunk in self.head.directory.clone() {
            self.named = self.named.max(chunk.offset.saturating_add(chunk.byte_len() as u64));
            let Some(left) = chunks.checked_sub(chunk.byte_len() as u64) else {
                let message = "the chunks of the directory are longer than the file; the rest is not looked at";
                self.damaged(Error::at(Code::SectionOverlap, chunk.offset, "PDIR.offset", message));
                return;
            };
            chunks = left;
            let entries = fetch(&self.head, chunk.offset, chunk.byte_len() as u64, most, read)
                .and_then(|bytes| parse_chunk(&bytes, &chunk, &self.head));
            let entries = match entries {
                Ok(entries) => entries,
                Err(e) => {
                    self.damaged(e);
                    continue;
                }
            };
            for (ordinal, entry) in (chunk.ordinal * CHUNK_PAGES..).zip(entries).filter(|(_, e)| !e.is_empty()) {
                let Some(left) = room.checked_sub(entry.byte_len() as u64) else {
                    let message = "the pages are longer than their section: some overlap; the rest is not looked at";
                    self.damaged(Error::at(Code::SectionOverlap, entry.offset, "page_entry.offset", message));
                    return;
                };
                room = left;
                if let Err(e) = self.page(ordinal, &entry, read) {
                    self.damaged(e);
                }
            }
        }
    }

    fn page(&mut self, ordinal: u64, entry: &PageEntry, read: &mut Read<'_>) -> Result<()> {
        let bytes = fetch(&self.head, entry.offset, entry.byte_len() as u64, self.len, read)?;
        self.named = self.named.max(entry.offset.saturating_add(entry.byte_len() as u64));
        let nodes = parse_page(&bytes, entry, ordinal, &self.head)?;
        let (tree, level, page) = self.head.octree.page_position(ordinal);
        for (slot, node) in nodes.iter().enumerate().filter(|(_, n)| n.kind != NodeKind::Empty) {
            let local = unmorton8(slot);
            let brick: Coord = std::array::from_fn(|a| page[a] * 8 + local[a]);
            if !self.head.octree.contains(tree, level, brick) {
                continue;
            }
            let key = key((tree, level, brick));
            match self.check(node, read) {
                Ok(()) => drop(self.live.insert(key, (*node, true))),
                Err(error) => drop(self.lost.insert(key, error)),
            }
        }
        Ok(())
    }

    /// Whether a brick's payload is there and whole.
    fn check(&mut self, node: &Node, read: &mut Read<'_>) -> Result<()> {
        if node.kind != NodeKind::Stored {
            return Ok(());
        }
        let len = u64::from(node.stored_len);
        if node.offset.checked_add(len).is_none_or(|end| end > self.len) {
            return Err(Error::at(Code::Truncated, self.len, "brick.payload", "the file ends inside the payload"));
        }
        let Some(left) = self.budget.checked_sub(len) else {
            let message = "too many payloads lie in the same bytes; the rest is not looked at";
            return Err(Error::at(Code::Limit, node.offset, "brick.payload", message));
        };
        self.budget = left;
        self.named = self.named.max(node.offset.saturating_add(len));
        node.check_payload(&read(node.offset, node.stored_len as usize)?)
    }

    /// Bricks that only leaders name, and those whose payload the index does not find. Later ones win.
    fn leaders(&mut self, from: u64, read: &mut Read<'_>) {
        let (id, len, log) = (self.head.superblock.file_id, self.len, self.head.superblock.layout == FileLayout::Log);
        scan(from, len, read, &mut |at, bytes, read| {
            if !bytes.starts_with(&leader::MAGIC) {
                return at + 16;
            }
            match Leader::read_from(bytes, at, &id) {
                Ok(leader) if log || leader.kind == NodeKind::Stored => self.leader(at, &leader, read),
                _ => at + 16,
            }
        });
    }

    /// Takes a brick by its leader; returns where to go on.
    fn leader(&mut self, at: u64, leader: &Leader, read: &mut Read<'_>) -> u64 {
        let d = &self.head.descriptor;
        let (tree, level, brick) = (leader.tree, leader.level, leader.brick);
        let node = leader.node(at);
        let next = at + LEADER_BYTES as u64;
        let fits = match node.kind {
            NodeKind::Stored => Node::read_from(&node.write_to(), at, d.sample_type).is_ok(),
            _ => node.constant(d.sample_type).is_ok(),
        };
        if !fits || usize::from(leader.codec) >= d.codecs.len().max(1) {
            return at + 16;
        }
        let key = key((tree, level, brick));
        if self.live.get(&key).is_some_and(|(_, indexed)| *indexed) {
            return next + u64::from(node.stored_len);
        }
        match self.check(&node, read) {
            Ok(()) if self.head.octree.contains(tree, level, brick) => {
                self.lost.remove(&key);
                self.live.insert(key, (node, false));
            }
            Ok(()) => self.beyond += 1,
            Err(error) => {
                if self.head.octree.contains(tree, level, brick) && !self.live.contains_key(&key) {
                    self.lost.entry(key).or_insert(error);
                }
                // Its length may be all that is wrong.
                return next;
            }
        }
        next + u64::from(node.stored_len)
    }

    fn finish(self) -> Recovery {
        let bricks = self.live.into_iter();
        let bricks = bricks.map(|(k, (node, indexed))| LiveBrick { place: place(k), node, indexed }).collect();
        let lost = self.lost.into_iter().map(|(k, error)| LostBrick { place: place(k), error }).collect();
        Recovery { head: self.head, options: self.options, bricks, lost, damage: self.damage, beyond: self.beyond }
    }
}

/// Goes over `from..len` in steps of at least 16 bytes. `look` gets an offset and the 32 bytes there that a leader may be, if
/// they start like one, and says where to go on. What cannot be read is passed over.
fn scan(from: u64, len: u64, read: &mut Read<'_>, look: &mut dyn FnMut(u64, &[u8], &mut Read<'_>) -> u64) {
    let (mut at, mut size) = (from.next_multiple_of(16), WINDOW);
    while at + LEADER_BYTES as u64 <= len {
        let start = at;
        #[allow(clippy::cast_possible_truncation, reason = "at most 4 MiB")]
        let wanted = (len - start).min(size) as usize;
        let bytes = match read(start, wanted) {
            Ok(bytes) if bytes.len() >= LEADER_BYTES => bytes,
            // A bad sector shall not take its neighbours along.
            _ if size > SECTOR => {
                size = SECTOR;
                continue;
            }
            _ => {
                at = start + SECTOR;
                continue;
            }
        };
        size = WINDOW;
        while at + LEADER_BYTES as u64 <= start + bytes.len() as u64 {
            #[allow(clippy::cast_possible_truncation, reason = "inside the window")]
            let first = (at - start) as usize;
            let unit = &bytes[first..first + LEADER_BYTES];
            let marked = unit.starts_with(&leader::MAGIC) || unit.starts_with(b"VREC");
            at = if marked { look(at, unit, read).max(at + 16).next_multiple_of(16) } else { at + 16 };
        }
    }
}
