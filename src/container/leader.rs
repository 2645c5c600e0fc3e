//! Leaders: 32 bytes before each payload that say whose it is, so that a damaged index loses no bricks (spec chapter 6).
//!
//! | off | size | field |
//! |---|---|---|
//! | 0 | 4 | magic `VBRK` |
//! | 4 | 1×4 | level, kind, codec entry, flags |
//! | 8 | 8 | brick position: x, y << 21, z << 42 |
//! | 16 | 4 | tree |
//! | 20 | 4+4 | stored length and CRC-32 of the payload; CONSTANT: 0 and the raw value |
//! | 28 | 4 | CRC-32 of the file id and bytes 0 to 27 |

use super::node::{Node, NodeFlags, NodeKind};
use super::wire;
use crate::checksum::crc32_seeded;
use crate::error::{Code, Error, Result};
use crate::geometry::Coord;
use binrw::binrw;

/// Bytes of a leader.
pub const LEADER_BYTES: usize = 32;
pub(super) const MAGIC: [u8; 4] = *b"VBRK";
const AXIS_MASK: u64 = (1 << 21) - 1;

/// What stands before a payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leader {
    /// Level of detail.
    pub level: u8,
    /// STORED; in log files CONSTANT too: then no payload follows.
    pub kind: NodeKind,
    /// Codec entry.
    pub codec: u8,
    /// The node's flags that concern the brick alone: ZSTD, LOSSLESS, NAN_REPLACED.
    pub flags: NodeFlags,
    /// Brick position in bricks of its level.
    pub brick: Coord,
    /// Tree index.
    pub tree: u32,
    /// Bytes of the payload in the file.
    pub stored_len: u32,
    /// STORED: CRC-32 of the payload. CONSTANT: the raw value.
    pub crc: u32,
}

#[binrw]
#[brw(little)]
struct Wire {
    magic: [u8; 4],
    level: u8,
    kind: u8,
    codec: u8,
    flags: u8,
    position: u64,
    tree: u32,
    stored_len: u32,
    payload_crc: u32,
    leader_crc: u32,
}

impl Leader {
    /// The leader of a node that is STORED or CONSTANT (spec: BRK-5, LOG-3).
    #[must_use]
    pub fn of(node: &Node, tree: u32, level: u8, brick: Coord) -> Self {
        #[allow(clippy::cast_possible_truncation, reason = "a raw value has at most 32 bits")]
        let crc = if node.kind == NodeKind::Constant { node.offset as u32 } else { node.crc };
        Leader {
            level,
            kind: node.kind,
            codec: node.codec,
            flags: NodeFlags(node.flags.0 & NodeFlags::IN_LEADER),
            brick,
            tree,
            stored_len: node.stored_len,
            crc,
        }
    }

    /// The node that belongs to this leader, which lies at `at`. Its bounds are not known.
    #[must_use]
    pub fn node(&self, at: u64) -> Node {
        let node = Node { kind: self.kind, codec: self.codec, flags: self.flags, ..Node::EMPTY };
        match self.kind {
            NodeKind::Constant => Node { offset: u64::from(self.crc), ..node },
            _ => Node { offset: at + LEADER_BYTES as u64, stored_len: self.stored_len, crc: self.crc, ..node },
        }
    }

    /// The 32 bytes of the leader, whose CRC is seeded with the file id (spec: GEN-5).
    #[must_use]
    pub fn write_to(&self, file_id: &[u8; 16]) -> [u8; LEADER_BYTES] {
        let [x, y, z] = self.brick.map(u64::from);
        let mut bytes: [u8; LEADER_BYTES] = wire::write(&Wire {
            magic: MAGIC,
            level: self.level,
            kind: self.kind as u8,
            codec: self.codec,
            flags: self.flags.0,
            position: x | y << 21 | z << 42,
            tree: self.tree,
            stored_len: self.stored_len,
            payload_crc: self.crc,
            leader_crc: 0,
        });
        let crc = crc32_seeded(file_id, &bytes[..28]);
        bytes[28..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// Reads a leader whose bytes lie at `at`.
    ///
    /// # Errors
    /// `E_LEADER` where magic, CRC, kind or flags are wrong; `E_TRUNCATED` where there are fewer than 32 bytes.
    pub fn read_from(bytes: &[u8], at: u64, file_id: &[u8; 16]) -> Result<Self> {
        let w: Wire = wire::read(bytes, at, "leader")?;
        let bad = |offset, field, message: String| Err(Error::at(Code::Leader, at + offset, field, message));
        if w.magic != MAGIC {
            return bad(0, "leader.magic", "no leader stands before the payload".into());
        }
        let computed = crc32_seeded(file_id, &bytes[..28]);
        if computed != w.leader_crc {
            let message =
                format!("CRC {computed:08x} computed, {:08x} stored; damaged or of another file", w.leader_crc);
            return bad(28, "leader.crc", message);
        }
        let kind = match w.kind {
            k if k == NodeKind::Stored as u8 => Some(NodeKind::Stored),
            k if k == NodeKind::Constant as u8 && w.codec == 0 && w.stored_len == 0 => Some(NodeKind::Constant),
            _ => None,
        };
        let Some(kind) = kind.filter(|_| w.flags & !NodeFlags::IN_LEADER == 0 && w.position >> 63 == 0) else {
            return bad(5, "leader", "kind, flags or position have bits set that a leader cannot have".into());
        };
        #[allow(clippy::cast_possible_truncation, reason = "masked to 21 bits")]
        let axis = |shift: u32| (w.position >> shift & AXIS_MASK) as u32;
        Ok(Leader {
            level: w.level,
            kind,
            codec: w.codec,
            flags: NodeFlags(w.flags),
            brick: [axis(0), axis(21), axis(42)],
            tree: w.tree,
            stored_len: w.stored_len,
            crc: w.payload_crc,
        })
    }
}

/// All leaders of this file in `bytes`, which lie at `base` in the file: for salvage. Leaders are aligned to 16 bytes;
/// their seeded CRC keeps remains of other files out.
#[must_use]
pub fn find_leaders(bytes: &[u8], base: u64, file_id: &[u8; 16]) -> Vec<(u64, Leader)> {
    let mut found = Vec::new();
    let first = usize::try_from(base.next_multiple_of(16) - base).expect("below 16");
    for i in (first..bytes.len().saturating_sub(LEADER_BYTES - 1)).step_by(16) {
        if bytes[i..].starts_with(&MAGIC) {
            let at = base + i as u64;
            if let Ok(leader) = Leader::read_from(&bytes[i..i + LEADER_BYTES], at, file_id) {
                found.push((at, leader));
            }
        }
    }
    found
}
