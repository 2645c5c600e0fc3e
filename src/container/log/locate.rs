//! Finding the last whole commit of a log, sans I/O: at its very end in a file that was closed, else by searching
//! backwards for trailers, as far as a reader goes, else by walking the records from the front (spec chapter 15).

use super::super::superblock::SUPERBLOCK_BYTES;
use super::commit::{Commit, FIRST_RECORD, TRAILER_BYTES, check_commit, read_trailer};
use super::forward::Forward;
use super::record::RECORD_BYTES;
use crate::error::{Code, Error, Result};
use crate::limits::{self, HEAD_BYTES, Limits};

/// Bytes looked at in one go behind the first 16 KiB.
const WINDOW: u64 = 1 << 20;

/// Bytes of a commit's leader, superblock and trailer.
const LEAST: u64 = (RECORD_BYTES + SUPERBLOCK_BYTES + TRAILER_BYTES) as u64;
const NONE_NEAR: &str = "there is no whole commit in the last part of the file, nor one that its records lead to";

/// What the search wants or has found.
pub(in super::super) enum Located {
    /// These bytes.
    Need(u64, usize),
    /// The commit, and bytes of the file, from an offset on, that hold it.
    Found(Commit, u64, Vec<u8>),
}

/// A search for the last whole commit.
#[derive(Debug)]
pub(in super::super) struct Locate {
    file_id: [u8; 16],
    table_bytes: u64,
    /// Trailers that end behind this have been looked at.
    upto: u64,
    /// Bytes being searched, and where they lie.
    window: Option<(u64, Vec<u8>)>,
    /// A commit whose trailer was found and whose bytes are wanted.
    candidate: Option<Commit>,
    /// Start of the window, where one was asked for.
    asked: Option<u64>,
    /// Bytes looked at, all windows and commits: what bounds the work on a hostile file.
    spent: u64,
    /// Most of them.
    most: u64,
    len: u64,
    /// Whether the walk from the front is made when they are spent.
    walks: bool,
    forward: Option<Forward>,
}

impl Locate {
    /// `walks`: whether all records are walked where the search goes too far; where some are damaged, that can end at an
    /// earlier commit than the last one.
    pub(in super::super) fn new(len: u64, file_id: [u8; 16], limits: &Limits, walks: bool) -> Self {
        Locate {
            file_id,
            table_bytes: limits.table_bytes,
            upto: len - len % 16,
            window: None,
            candidate: None,
            asked: None,
            spent: 0,
            most: limits.log_search_bytes,
            len,
            walks,
            forward: None,
        }
    }

    /// Goes on with `supplied`, which answers the last wish. `head` are the first bytes of the file.
    ///
    /// # Errors
    /// `E_COMMIT` where there is no commit, or none in reach; `E_LIMIT` for a commit above the reader's limit;
    /// `E_TRUNCATED` where less was supplied than asked for.
    pub(in super::super) fn step(&mut self, head: &[u8], mut supplied: Option<Vec<u8>>) -> Result<Located> {
        loop {
            // Nothing that was asked for is thrown away: the limit is looked at before the next wish.
            if supplied.is_none() && self.spent > self.most && self.forward.is_none() {
                if !self.walks {
                    return Err(none_found(self.upto, NONE_NEAR));
                }
                (self.candidate, self.window, self.asked) = (None, None, None);
                self.forward = Some(Forward::new(self.len, self.file_id));
            }
            if let Some(commit) = self.candidate {
                let Some((at, bytes)) = self.bytes_of(&commit, head, supplied.take())? else {
                    let len = usize::try_from(commit.end - commit.offset).map_err(|_| too_large(&commit))?;
                    return Ok(Located::Need(commit.offset, len));
                };
                self.candidate = None;
                self.spent += commit.end - commit.offset;
                #[allow(clippy::cast_possible_truncation, reason = "a part of a vector")]
                let [start, end] = [commit.offset - at, commit.end - at].map(|v| v as usize);
                if check_commit(&bytes[start..end], &commit, &self.file_id).is_ok() {
                    return Ok(Located::Found(commit, at, bytes));
                }
            }
            if let Some(forward) = &mut self.forward {
                if let Some((offset, len)) = forward.step(head, &mut supplied)? {
                    return Ok(Located::Need(offset, len));
                }
                let Some(commit) = forward.pop() else { return Err(none_found(self.upto, NONE_NEAR)) };
                // One that a reader does not want to hold is passed over: there is an earlier one.
                self.candidate =
                    Some(commit).filter(|c| c.end - c.offset <= self.table_bytes && c.end - c.offset > LEAST);
                continue;
            }
            if self.window.is_none()
                && let Some(need) = self.open_window(head, supplied.take())?
            {
                return Ok(need);
            }
            self.scan()?;
        }
    }

    /// The next window, or the wish for it. What lies in the head is not asked for again (spec: VAL-7).
    fn open_window(&mut self, head: &[u8], supplied: Option<Vec<u8>>) -> Result<Option<Located>> {
        if self.upto < FIRST_RECORD + (RECORD_BYTES + TRAILER_BYTES) as u64 {
            return Err(none_found(self.upto, "there is no whole commit in the file"));
        }
        let size = if self.spent == 0 { HEAD_BYTES } else { WINDOW.min(self.most.max(HEAD_BYTES)) };
        let start = self.upto.saturating_sub(size).max(FIRST_RECORD);
        let from = start.max((head.len() as u64).min(self.upto));
        #[allow(clippy::cast_possible_truncation, reason = "at most 1 MiB")]
        let wanted = (self.upto - from) as usize;
        let mut bytes = match supplied {
            Some(bytes) if self.asked == Some(start) && bytes.len() == wanted => bytes,
            None if wanted == 0 => Vec::new(),
            None => {
                self.asked = Some(start);
                return Ok(Some(Located::Need(from, wanted)));
            }
            Some(bytes) => {
                let end = from + bytes.len() as u64;
                return Err(Error::at(Code::Truncated, end, "log", "the data ends here; fetch the file again"));
            }
        };
        if start < from {
            #[allow(clippy::cast_possible_truncation, reason = "inside the head")]
            let before = &head[start as usize..from as usize];
            bytes = [before, &bytes].concat();
        }
        self.spent += bytes.len() as u64;
        self.window = Some((start, bytes));
        Ok(None)
    }

    /// Looks for the last trailer of the window that has not been looked at.
    fn scan(&mut self) -> Result<()> {
        let Some((start, bytes)) = &self.window else { return Ok(()) };
        let first = *start;
        let mut at = self.upto.saturating_sub(TRAILER_BYTES as u64);
        while at >= first {
            #[allow(clippy::cast_possible_truncation, reason = "inside the window")]
            let found = bytes.get((at - first) as usize..).and_then(|b| read_trailer(b, at, &self.file_id));
            if let Some(commit) = found {
                let len = commit.end - commit.offset;
                limits::check("commit", len, self.table_bytes)
                    .map_err(|e| Error::at(e.code(), commit.offset, "commit", e.message().to_owned()))?;
                self.candidate = Some(commit);
                self.upto = at + 16;
                return Ok(());
            }
            at -= 16;
        }
        // A trailer may lie across the start of the window.
        self.upto = if first == FIRST_RECORD { 0 } else { first + 16 };
        (self.window, self.asked) = (None, None);
        Ok(())
    }

    /// Bytes that hold the commit, and where they lie.
    fn bytes_of(&self, commit: &Commit, head: &[u8], supplied: Option<Vec<u8>>) -> Result<Option<(u64, Vec<u8>)>> {
        let holds = |at: u64, len: usize| at <= commit.offset && commit.end <= at + len as u64;
        if let Some(bytes) = supplied {
            if holds(commit.offset, bytes.len()) {
                return Ok(Some((commit.offset, bytes)));
            }
            let end = commit.offset + bytes.len() as u64;
            return Err(Error::at(Code::Truncated, end, "commit", "the data ends here; fetch the file again"));
        }
        if let Some((at, bytes)) = self.window.as_ref().filter(|(at, bytes)| holds(*at, bytes.len())) {
            // Behind the commit lies nothing of use, before it pages and chunks that may be asked for.
            let from = (*at).max(commit.offset.saturating_sub(HEAD_BYTES));
            #[allow(clippy::cast_possible_truncation, reason = "inside the window")]
            let part = &bytes[(from - at) as usize..(commit.end - at) as usize];
            return Ok(Some((from, part.to_vec())));
        }
        if holds(0, head.len()) {
            #[allow(clippy::cast_possible_truncation, reason = "inside the head")]
            return Ok(Some((commit.offset, head[commit.offset as usize..commit.end as usize].to_vec())));
        }
        Ok(None)
    }
}

fn too_large(commit: &Commit) -> Error {
    Error::at(Code::Limit, commit.offset, "commit", "the commit does not fit this machine's address space")
}

fn none_found(at: u64, what: &str) -> Error {
    let message =
        format!("{what}: its writer was stopped, or it is damaged; `vug recover` saves the bricks that are whole");
    Error::at(Code::Commit, at, "commit", message)
}
