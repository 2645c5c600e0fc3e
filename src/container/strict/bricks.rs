//! Stored bricks in the order of the file: leader, payload and guard (spec chapter 6).

use super::Strict;
use crate::container::leader::{LEADER_BYTES, Leader};
use crate::container::{GUARD_BYTES, Node, NodeFlags, NodeKind, OPTIONAL_NAN_REPLACED, section};
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, unmorton8};
use std::ops::Range;

/// A stored brick and its node.
#[derive(Clone, Debug)]
pub struct StoredBrick {
    /// Tree index.
    pub tree: u32,
    /// Level of detail.
    pub level: u8,
    /// Position in bricks of the level.
    pub brick: Coord,
    /// Its node as it is in the file.
    pub node: Node,
    pub(super) ordinal: u64,
    pub(super) slot: usize,
    /// Range of the decoded voxels, once it is known.
    pub(super) bounds: Option<(f64, f64)>,
    /// Length of the payload before zstd, once it is known.
    pub(super) payload_len: Option<u64>,
}

impl StoredBrick {
    /// Leader, payload and guard: the bytes to give to [`Strict::check_brick`].
    #[must_use]
    pub fn window(&self) -> Range<u64> {
        let start = self.node.offset - LEADER_BYTES as u64;
        start..self.node.offset + u64::from(self.node.stored_len) + GUARD_BYTES
    }
}

impl Strict {
    /// Lists the stored bricks by offset. Their ranges have been checked with their pages.
    pub(super) fn collect_bricks(&mut self) {
        let octree = &self.head.octree;
        for (&ordinal, page) in &self.nodes.pages {
            let (tree, level, position) = octree.page_position(ordinal);
            for (slot, node) in page.iter().enumerate().filter(|(_, n)| n.kind == NodeKind::Stored) {
                let local = unmorton8(slot);
                let brick = std::array::from_fn(|a| position[a] * 8 + local[a]);
                self.bricks.push(StoredBrick {
                    tree,
                    level,
                    brick,
                    node: *node,
                    ordinal,
                    slot,
                    bounds: None,
                    payload_len: None,
                });
            }
        }
        self.bricks.sort_by_key(|b| b.node.offset);
        for b in &self.bricks {
            self.coverage.add(b.window(), "brick");
        }
    }

    /// Checks leader, payload CRC and guard of a brick, whose [`StoredBrick::window`] is `bytes`; returns the payload.
    ///
    /// # Errors
    /// `E_LEADER`, `E_SIZE`, `E_BRICK_CRC`, `E_PADDING`.
    pub fn check_brick<'a>(&self, brick: &StoredBrick, bytes: &'a [u8]) -> Result<&'a [u8]> {
        let start = brick.window().start;
        let len = brick.node.stored_len as usize;
        if bytes.len() != LEADER_BYTES + len + GUARD_BYTES as usize {
            return Err(Error::at(Code::Size, start, "brick", format!("{} bytes given for a brick", bytes.len())));
        }
        // spec: BRK-5
        let leader = Leader::read_from(bytes, start, &self.head.superblock.file_id)?;
        if leader != Leader::of(&brick.node, brick.tree, brick.level, brick.brick) {
            return Err(Error::at(Code::Leader, start, "leader", "the leader contradicts the node in the index"));
        }
        let (payload, guard) = bytes[LEADER_BYTES..].split_at(len);
        brick.node.check_payload(payload)?;
        // spec: BRK-4
        if let Some(i) = guard.iter().position(|&b| b != 0) {
            let at = brick.node.offset + (len + i) as u64;
            return Err(Error::at(Code::Padding, at, "brick.guard", format!("guard byte is {:#04x}, not 0", guard[i])));
        }
        Ok(payload)
    }

    /// Says in which range the decoded voxels of brick `index` of [`Strict::bricks`] lie, all components. Bricks of
    /// codecs that the caller does not know are left out; their bounds are then only checked against each other
    /// (spec: VAL-12).
    pub fn set_bounds(&mut self, index: usize, min: f64, max: f64) {
        if let Some(brick) = self.bricks.get_mut(index) {
            brick.bounds = Some((min, max));
        }
    }

    /// Says how long the payload of brick `index` is before zstd.
    pub fn set_payload_len(&mut self, index: usize, len: u64) {
        if let Some(brick) = self.bricks.get_mut(index) {
            brick.payload_len = Some(len);
        }
    }

    /// The descriptor's sum of payload lengths and its count of replaced samples (spec: VOL-15, VER-6).
    pub(super) fn check_totals(&mut self) {
        let d = &self.head.descriptor;
        let Some(vold) = self.head.section(section::VOLD).map(|s| s.offset) else { return };
        let zstd = |b: &StoredBrick| b.node.flags.contains(NodeFlags::ZSTD);
        let stored = |b: &StoredBrick| u64::from(b.node.stored_len);
        let mut lens = self.bricks.iter().map(|b| b.payload_len.or((!zstd(b)).then_some(stored(b))));
        let sum = lens.try_fold(0u64, |sum, len| len.map(|len| sum.saturating_add(len)));
        // spec: BRK-8
        let longer = self.bricks.iter().find(|b| zstd(b) && b.payload_len.is_some_and(|len| len <= stored(b)));
        let longer = longer.map(|b| b.node.offset);
        let (payload, replaced) = (d.payload_bytes, d.replaced);
        let flagged = self.head.superblock.optional & OPTIONAL_NAN_REPLACED != 0;
        if let Some(at) = longer {
            self.report(Error::at(Code::Canon, at, "brick.payload", "compressed, yet not smaller than the payload"));
        }
        if sum.is_some_and(|sum| sum != payload) {
            let message = format!("{payload} bytes declared, {} there", sum.unwrap_or(0));
            self.report(Error::at(Code::Canon, vold + 200, "VOLD.payload_bytes", message));
        }
        if flagged != (replaced > 0) {
            let message = format!("{replaced} samples replaced, which the feature NAN_REPLACED contradicts");
            self.report(Error::at(Code::Canon, vold + 208, "VOLD.replaced", message));
        }
    }
}
