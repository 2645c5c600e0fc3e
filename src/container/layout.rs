//! Where everything of a head file goes: the one canonical place for each part (spec chapters 3, 5, 6).
//!
//! `superblock | section table | VOLD | FNAM | PDIR | chunks | CBOK | META | others | pages`, as far as that fits in 16 KiB;
//! then `BRIK`; then what did not fit, in the same order.

use crate::limits::HEAD_BYTES;

/// A file whose stored payloads total at most this many bytes is compact: its bricks follow its tables directly. Every
/// other one has its bricks from 16 KiB on, so that a writer needs not know all of them before it writes the first
/// (spec: SEC-16).
pub(super) const COMPACT_BYTES: u64 = 4 << 20;

/// A contiguous part: a section, all chunks, or all pages.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub(super) len: u64,
    pub(super) align_log2: u8,
}

/// Where the parts go that are not bricks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct HeadPlan {
    /// Offsets of the parts that the head holds; `None` for those behind the bricks.
    pub(super) in_head: Vec<Option<u64>>,
    /// Where the bricks start.
    pub(super) bricks: u64,
}

/// Places the parts that fit in the first 16 KiB behind the section table (spec: SEC-15).
pub(super) fn plan_head(table_end: u64, parts: &[Part], compact: bool) -> HeadPlan {
    let mut cursor = table_end;
    let mut in_head = Vec::with_capacity(parts.len());
    for part in parts {
        let start = align_up(cursor, part.align_log2);
        let fits = start.checked_add(part.len).is_some_and(|end| end <= HEAD_BYTES);
        in_head.push(fits.then_some(start));
        if fits {
            cursor = start + part.len;
        }
    }
    HeadPlan { in_head, bricks: if compact { align_up(cursor, 4) } else { HEAD_BYTES } }
}

/// Places all parts, and returns the file's length too. `bricks_end` is where `BRIK` ends.
pub(super) fn place_all(plan: &HeadPlan, parts: &[Part], bricks_end: u64) -> (Vec<u64>, u64) {
    let mut cursor = bricks_end;
    let mut offsets = Vec::with_capacity(parts.len());
    for (part, in_head) in parts.iter().zip(&plan.in_head) {
        offsets.push(in_head.unwrap_or_else(|| {
            let start = align_up(cursor, part.align_log2);
            cursor = start + part.len;
            start
        }));
    }
    (offsets, cursor)
}

/// Where the payload of the next brick starts: its leader fits between `cursor` and it (spec: BRK-2, BRK-3).
pub(super) fn payload_start(cursor: u64, align_log2: u8) -> u64 {
    align_up(cursor + super::leader::LEADER_BYTES as u64, align_log2)
}

/// Rounds up to a multiple of 2^`log2`; saturates.
pub(super) fn align_up(offset: u64, log2: u8) -> u64 {
    let mask = (1u64 << log2) - 1;
    offset.checked_add(mask).map_or(!mask, |o| o & !mask)
}
