//! Going through a log record by record (spec chapter 15).

use super::super::leader::{self, LEADER_BYTES, Leader};
use super::super::strict::Read;
use super::super::{GUARD_BYTES, NodeKind};
use super::commit::FIRST_RECORD;
use super::record::{self, Record};
use crate::error::{Code, Error, Result};

/// Bytes read at a time to find the next leader.
const WINDOW: u64 = 64 << 10;
/// Most padding between two records (spec: LOG-2).
const MOST_PADDING: u64 = 1 << 20;

/// A record's leader.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) enum Item {
    Brick(Leader),
    Other(Record),
}

/// A record and where it lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) struct Walked {
    /// Where the record before ends.
    pub(in super::super) from: u64,
    /// Where the leader starts.
    pub(in super::super) at: u64,
    /// One past the record, guard included.
    pub(in super::super) end: u64,
    pub(in super::super) item: Item,
}

impl Walked {
    /// Where payload or content start.
    pub(in super::super) fn content(&self) -> u64 {
        self.at + LEADER_BYTES as u64
    }
}

/// A walk from the first record on. It goes forward only, at least 32 bytes a step, so that it ends.
#[derive(Debug)]
pub(in super::super) struct Walk {
    cursor: u64,
    /// What lies between `cursor` and here is padding: not read again where reading had to wait.
    seen: u64,
    end: u64,
    window_bytes: u64,
    file_id: [u8; 16],
    window: (u64, Vec<u8>),
}

impl Walk {
    /// Over the records that end at or before `end`.
    pub(in super::super) fn new(end: u64, file_id: [u8; 16]) -> Self {
        let window = (0, Vec::new());
        Walk { cursor: FIRST_RECORD, seen: 0, end, window_bytes: WINDOW, file_id, window }
    }

    /// Reads so many bytes at a time.
    pub(super) fn with_window(self, bytes: u64) -> Self {
        Walk { window_bytes: bytes, ..self }
    }

    /// The next record; `None` behind the last one.
    ///
    /// # Errors
    /// `E_LEADER` where no leader follows the record before, `E_PADDING`, `E_TRUNCATED` where a record passes the end, and
    /// what reading yields: only from the latter the walk can go on.
    pub(in super::super) fn next(&mut self, read: &mut Read<'_>) -> Result<Option<Walked>> {
        let from = self.cursor;
        let mut at = self.seen.max(from);
        let aligned = from.next_multiple_of(16);
        loop {
            if at >= self.end {
                return Ok(None);
            }
            let unit = self.bytes(at, (at + 1).next_multiple_of(16).min(self.end) - at, read)?;
            let magic = at >= aligned && (unit.starts_with(&leader::MAGIC) || unit.starts_with(&record::MAGIC));
            if magic {
                break;
            }
            if let Some(i) = unit.iter().position(|&b| b != 0) {
                let message = "neither a leader nor padding follows the record before";
                let code = if at >= aligned { Code::Leader } else { Code::Padding };
                return Err(Error::at(code, at + i as u64, "record", message));
            }
            at += unit.len() as u64;
            self.seen = at;
            if at - from > MOST_PADDING {
                return Err(Error::at(Code::Leader, from, "record", "no record follows within 1 MiB"));
            }
        }
        if self.end - at < LEADER_BYTES as u64 {
            return Err(Error::at(Code::Truncated, self.end, "record", "a leader passes the end of its commit"));
        }
        let id = self.file_id;
        let bytes = self.bytes(at, LEADER_BYTES as u64, read)?;
        let (item, end) = if bytes.starts_with(&leader::MAGIC) {
            let leader = Leader::read_from(bytes, at, &id)?;
            let behind = match leader.kind {
                NodeKind::Stored => u64::from(leader.stored_len) + GUARD_BYTES,
                _ => 0,
            };
            (Item::Brick(leader), at + LEADER_BYTES as u64 + behind)
        } else {
            let record = Record::read_from(bytes, at, &id)?;
            (Item::Other(record), record.end(at))
        };
        if end > self.end {
            return Err(Error::at(Code::Truncated, at, "record", "the record passes the end of its commit"));
        }
        self.cursor = end;
        Ok(Some(Walked { from, at, end, item }))
    }

    /// Bytes before the end of the walk, at most a few.
    fn bytes(&mut self, at: u64, len: u64, read: &mut Read<'_>) -> Result<&[u8]> {
        let (start, window) = &self.window;
        if at < *start || at + len > start + window.len() as u64 {
            #[allow(clippy::cast_possible_truncation, reason = "at most 64 KiB")]
            let wanted = (self.end - at).min(self.window_bytes) as usize;
            self.window = (at, read(at, wanted)?);
        }
        let (start, window) = &self.window;
        #[allow(clippy::cast_possible_truncation, reason = "inside the window")]
        let first = (at - start) as usize;
        #[allow(clippy::cast_possible_truncation, reason = "at most 32")]
        let part = window.get(first..first + len as usize);
        part.ok_or_else(|| Error::at(Code::Truncated, at, "record", "fewer bytes were delivered than asked for"))
    }
}
