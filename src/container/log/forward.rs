//! Commits found from the front, leader by leader, sans I/O: where the search backwards from the end has gone far enough
//! (spec chapter 15).

use super::super::leader::LEADER_BYTES;
use super::commit::Commit;
use super::record::RecordKind;
use super::walk::{Item, Walk};
use crate::error::{Code, Error, Result};
use std::collections::VecDeque;

/// Bytes read at a time: records are mostly longer, and only their leaders are looked at.
const WINDOW: u64 = 4 << 10;
/// Most commits that are remembered, the last ones.
const MOST_COMMITS: usize = 1024;

/// A walk over all records that remembers commits. Each byte is asked for once at most, but for those of leaders that lie
/// across the end of a window.
#[derive(Debug)]
pub(super) struct Forward {
    walk: Walk,
    found: VecDeque<Commit>,
    asked: Option<(u64, usize)>,
    ended: bool,
}

impl Forward {
    /// Over a file of `len` bytes.
    pub(super) fn new(len: u64, file_id: [u8; 16]) -> Self {
        let walk = Walk::new(len, file_id).with_window(WINDOW);
        Forward { walk, found: VecDeque::new(), asked: None, ended: false }
    }

    /// Goes on with `supplied`, which answers the last wish; returns the next one, or `None` at the end: where the file ends,
    /// or what its writer left torn begins. What lies in `head` is not asked for again (spec: VAL-7).
    ///
    /// # Errors
    /// `E_TRUNCATED` where less was supplied than asked for.
    pub(super) fn step(&mut self, head: &[u8], supplied: &mut Option<Vec<u8>>) -> Result<Option<(u64, usize)>> {
        while !self.ended {
            let (asked, mut wish) = (self.asked, None);
            let next = self.walk.next(&mut |offset, len| {
                let there = usize::try_from(offset).ok().and_then(|start| head.get(start..));
                if let Some(bytes) = there.filter(|bytes| bytes.len() >= LEADER_BYTES.min(len)) {
                    return Ok(bytes[..bytes.len().min(len)].to_vec());
                }
                if let Some(bytes) = supplied.take_if(|bytes| asked == Some((offset, len)) && bytes.len() == len) {
                    return Ok(bytes);
                }
                wish = Some((offset, len));
                Err(Error::new(Code::Source, "log", "these bytes are not there yet"))
            });
            if let Some((offset, _)) = wish {
                if self.asked == wish {
                    let message = "the data ends here; fetch the file again";
                    return Err(Error::at(Code::Truncated, offset, "log", message));
                }
                self.asked = wish;
                return Ok(wish);
            }
            match next {
                Ok(Some(record)) => {
                    if let Item::Other(leader) = record.item
                        && leader.kind == RecordKind::Commit
                    {
                        self.found.push_back(Commit { generation: leader.key, offset: record.at, end: record.end });
                        if self.found.len() > MOST_COMMITS {
                            self.found.pop_front();
                        }
                    }
                }
                Ok(None) | Err(_) => self.ended = true,
            }
        }
        Ok(None)
    }

    /// The last commit that was met and not returned yet.
    pub(super) fn pop(&mut self) -> Option<Commit> {
        self.found.pop_back()
    }
}
