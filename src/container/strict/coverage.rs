//! Which bytes of a file are used: nothing twice, and everything else is zero padding (spec chapter 9).

use super::{Read, Strict};
use crate::container::section::{self, ENTRY_BYTES};
use crate::container::superblock::SUPERBLOCK_BYTES;
use crate::error::{Code, Error, Result};
use std::ops::Range;

/// Bytes read at a time when a gap is looked at.
const PIECE: u64 = 1 << 20;

/// Collects the ranges that something lies in.
#[derive(Debug, Default)]
pub struct Coverage {
    ranges: Vec<(Range<u64>, &'static str)>,
}

impl Coverage {
    /// Adds a range; an empty one is ignored. `what` names it in messages.
    pub fn add(&mut self, range: Range<u64>, what: &'static str) {
        if !range.is_empty() {
            self.ranges.push((range, what));
        }
    }

    /// Sorts, and returns where two ranges overlap: offset of the second, both names.
    pub fn overlaps(&mut self) -> Vec<(u64, &'static str, &'static str)> {
        self.ranges.sort_by_key(|r| (r.0.start, r.0.end));
        let mut found = Vec::new();
        let mut furthest: Option<(u64, &'static str)> = None;
        for (range, what) in &self.ranges {
            if let Some((_, other)) = furthest.filter(|(end, _)| range.start < *end) {
                found.push((range.start, other, *what));
            }
            if furthest.is_none_or(|(end, _)| range.end > end) {
                furthest = Some((range.end, what));
            }
        }
        found
    }

    /// Sorts, and returns the ranges below `len` that nothing lies in.
    pub fn gaps(&mut self, len: u64) -> Vec<Range<u64>> {
        self.ranges.sort_by_key(|r| (r.0.start, r.0.end));
        let (mut found, mut cursor) = (Vec::new(), 0);
        for (range, _) in &self.ranges {
            if range.start.min(len) > cursor {
                found.push(cursor..range.start.min(len));
            }
            cursor = cursor.max(range.end);
        }
        if cursor < len {
            found.push(cursor..len);
        }
        found
    }
}

impl Strict {
    /// Overlaps of anything with anything, and bytes that are not zero though nothing lies there (spec: VAL-9, VAL-10).
    pub(super) fn check_coverage(&mut self, read: &mut Read<'_>) {
        let table = self.head.superblock.section_table_offset;
        let table_len = (self.head.sections.len() * ENTRY_BYTES) as u64;
        self.coverage.add(0..SUPERBLOCK_BYTES as u64, "superblock");
        self.coverage.add(table..table + table_len, "section table");
        for s in &self.head.sections {
            // Pages and bricks are added one by one.
            if s.fourcc != section::PAGE && s.fourcc != section::BRIK {
                self.coverage.add(s.offset..s.end(), "section");
            }
        }
        for (at, a, b) in self.coverage.overlaps() {
            let message = format!("{b} starts inside another {a}");
            self.report(Error::at(Code::SectionOverlap, at, b, message));
        }
        for gap in self.coverage.gaps(self.head.superblock.file_len) {
            let checked = check_gap(&gap, read);
            self.keep(checked);
        }
    }
}

fn check_gap(gap: &Range<u64>, read: &mut Read<'_>) -> Result<()> {
    let mut at = gap.start;
    while at < gap.end {
        #[allow(clippy::cast_possible_truncation, reason = "at most 1 MiB")]
        let bytes = read(at, (gap.end - at).min(PIECE) as usize)?;
        if let Some(i) = bytes.iter().position(|&b| b != 0) {
            let message = format!("padding byte is {:#04x}, not 0", bytes[i]);
            return Err(Error::at(Code::Padding, at + i as u64, "padding", message));
        }
        at += (bytes.len() as u64).max(1);
    }
    Ok(())
}
