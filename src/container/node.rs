//! Nodes: one brick's place in the octree, with the bounds of all below it (spec chapter 5).
//!
//! | off | size | field |
//! |---|---|---|
//! | 0 | 8 | payload offset; CONSTANT: the raw value |
//! | 8 | 4+4 | stored length, CRC-32 of the stored payload |
//! | 16 | 1×4 | kind, codec entry, child mask, flags |
//! | 20 | 4+4+4 | min, max, max error (f32) |

use super::wire;
use crate::checksum::crc32;
use crate::error::{Code, Error, Result};
use crate::limits::MAX_BRICK_BYTES;
use crate::voxel::{SampleType, SampleValue};
use binrw::binrw;

/// Bytes of a node.
pub(super) const NODE_BYTES: usize = 32;

/// What a node's brick is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum NodeKind {
    /// Every voxel is the null value; nothing is stored.
    Empty = 0,
    /// Every voxel is the value in the node; nothing else is stored.
    Constant = 1,
    /// The voxels are in a payload.
    Stored = 2,
}

/// Flags of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct NodeFlags(pub u8);

impl NodeFlags {
    /// The payload is a zstd frame.
    pub const ZSTD: NodeFlags = NodeFlags(1);
    /// Every voxel of the brick decodes to exactly its source.
    pub const LOSSLESS: NodeFlags = NodeFlags(2);
    /// Some sample of the brick was NaN or infinite and became the null value.
    pub const NAN_REPLACED: NodeFlags = NodeFlags(4);
    /// `max_error` is known for the brick and all its descendants.
    pub const ERROR_KNOWN: NodeFlags = NodeFlags(8);
    const ALL: u8 = 15;
    /// Flags that a leader repeats: those of the brick alone (spec: BRK-5).
    pub(super) const IN_LEADER: u8 = 7;

    /// Whether all bits of `other` are set.
    #[must_use]
    #[inline]
    pub const fn contains(self, other: NodeFlags) -> bool {
        self.0 & other.0 == other.0
    }

    /// Both sets of bits.
    #[must_use]
    pub const fn union(self, other: NodeFlags) -> NodeFlags {
        NodeFlags(self.0 | other.0)
    }
}

impl std::ops::BitOr for NodeFlags {
    type Output = NodeFlags;
    fn bitor(self, other: NodeFlags) -> NodeFlags {
        self.union(other)
    }
}

/// One brick's place in the octree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// STORED: first byte of the payload in the file. CONSTANT: the raw value. EMPTY: 0.
    pub offset: u64,
    /// STORED: bytes of the payload in the file.
    pub stored_len: u32,
    /// STORED: CRC-32 of those bytes.
    pub crc: u32,
    /// What the brick is.
    pub kind: NodeKind,
    /// STORED: entry of the codec table.
    pub codec: u8,
    /// Bit dx+2dy+4dz: that child's subtree is not all EMPTY.
    pub child_mask: u8,
    /// See [`NodeFlags`].
    pub flags: NodeFlags,
    /// No decoded voxel of the brick and its descendants is smaller.
    pub min: f32,
    /// No decoded voxel of the brick and its descendants is larger.
    pub max: f32,
    /// No decoded voxel of the brick and its descendants is further from the exact source of its level.
    pub max_error: f32,
}

#[binrw]
#[brw(little)]
struct Wire {
    offset: u64,
    stored_len: u32,
    crc: u32,
    kind: u8,
    codec: u8,
    child_mask: u8,
    flags: u8,
    min: f32,
    max: f32,
    max_error: f32,
}

impl Node {
    /// A brick of null values without live descendants: 32 zero bytes. Its bounds are the null value, implied.
    pub const EMPTY: Node = Node {
        offset: 0,
        stored_len: 0,
        crc: 0,
        kind: NodeKind::Empty,
        codec: 0,
        child_mask: 0,
        flags: NodeFlags(0),
        min: 0.0,
        max: 0.0,
        max_error: 0.0,
    };

    /// A CONSTANT node: bounds from the value, `max_error` (None: not known) against the source, rounded up.
    #[must_use]
    pub fn new_constant(value: SampleValue, flags: NodeFlags, max_error: Option<f64>) -> Self {
        let (min, max) = value_bounds(value);
        let mut node =
            Node { kind: NodeKind::Constant, offset: u64::from(value.to_raw()), flags, min, max, ..Node::EMPTY };
        node.set_error(max_error);
        node
    }

    /// A STORED node of codec entry `codec` whose decoded voxels lie in `range`; offset, length and CRC are set by the
    /// writer. Bounds and error are rounded outward.
    #[must_use]
    pub fn new_stored(codec: u8, flags: NodeFlags, range: (f64, f64), max_error: Option<f64>) -> Self {
        let (min, max) = (round_down_f32(range.0), round_up_f32(range.1));
        let mut node = Node { kind: NodeKind::Stored, codec, flags, min, max, ..Node::EMPTY };
        node.set_error(max_error);
        node
    }

    fn set_error(&mut self, max_error: Option<f64>) {
        self.flags = NodeFlags(self.flags.0 & !NodeFlags::ERROR_KNOWN.0);
        if let Some(e) = max_error {
            self.flags = self.flags | NodeFlags::ERROR_KNOWN;
            self.max_error = round_up_f32(e);
        }
    }

    /// Whether the brick and all its descendants are EMPTY.
    #[must_use]
    #[inline]
    pub fn is_empty_subtree(&self) -> bool {
        self.kind == NodeKind::Empty && self.child_mask == 0
    }

    /// The value of a CONSTANT node, whatever the node says (spec: IDX-8, SAF-6).
    ///
    /// # Errors
    /// `E_CANON` where bits above the sample's width are set, `E_NONFINITE` for a NaN or infinite value.
    #[inline]
    pub fn constant(&self, sample_type: SampleType) -> Result<SampleValue> {
        let raw = u32::try_from(self.offset).ok();
        let Some(value) = raw.and_then(|raw| SampleValue::from_raw(sample_type, raw)) else {
            return Err(Error::new(Code::Canon, "node.value", "bits above the sample's width are set"));
        };
        if !value.component(0).is_finite() {
            return Err(Error::new(Code::NonFinite, "node.value", "a CONSTANT brick is NaN or infinite"));
        }
        Ok(value)
    }

    /// Compares a stored payload with the node's length and CRC (spec: BRK-6).
    ///
    /// # Errors
    /// `E_BRICK_CRC`; `E_SIZE` where `payload` is not `stored_len` bytes.
    pub fn check_payload(&self, payload: &[u8]) -> Result<()> {
        if payload.len() as u64 != u64::from(self.stored_len) {
            let message = format!("{} bytes given for a payload of {}", payload.len(), self.stored_len);
            return Err(Error::at(Code::Size, self.offset, "brick.payload", message));
        }
        let computed = crc32(payload);
        if computed == self.crc {
            return Ok(());
        }
        let message = format!(
            "CRC {computed:08x} computed, {:08x} stored; the brick is damaged, salvage reads the rest",
            self.crc
        );
        Err(Error::at(Code::BrickCrc, self.offset, "brick.payload", message))
    }

    /// The 32 bytes of the node.
    #[must_use]
    pub fn write_to(&self) -> [u8; NODE_BYTES] {
        wire::write(&Wire {
            offset: self.offset,
            stored_len: self.stored_len,
            crc: self.crc,
            kind: self.kind as u8,
            codec: self.codec,
            child_mask: self.child_mask,
            flags: self.flags.0,
            min: self.min,
            max: self.max,
            max_error: self.max_error,
        })
    }

    /// Reads a node whose bytes lie at `at`, checking all that needs no other structure but the sample type.
    ///
    /// # Errors
    /// `E_PARAM`, `E_RESERVED`, `E_CANON`, `E_NONFINITE`, `E_MINMAX_ORDER`, `E_SIZE`, `E_LIMIT`, `E_ALIGN`.
    pub fn read_from(bytes: &[u8], at: u64, sample_type: SampleType) -> Result<Self> {
        let w: Wire = wire::read(bytes, at, "node")?;
        let bad = |code, offset: u64, field, message: &str| Err(Error::at(code, at + offset, field, message));
        let kind = match w.kind {
            0 => NodeKind::Empty,
            1 => NodeKind::Constant,
            2 => NodeKind::Stored,
            _ => return bad(Code::Param, 16, "node.kind", "the kind is not EMPTY, CONSTANT or STORED"),
        };
        if w.flags & !NodeFlags::ALL != 0 {
            return bad(Code::Reserved, 19, "node.flags", "reserved flag bits are set");
        }
        let node = Node {
            offset: w.offset,
            stored_len: w.stored_len,
            crc: w.crc,
            kind,
            codec: w.codec,
            child_mask: w.child_mask,
            flags: NodeFlags(w.flags),
            min: w.min,
            max: w.max,
            max_error: w.max_error,
        };
        node.check(sample_type, bytes, at)?;
        Ok(node)
    }

    fn check(&self, sample_type: SampleType, bytes: &[u8], at: u64) -> Result<()> {
        let bad = |code, offset: u64, field, message: &str| Err(Error::at(code, at + offset, field, message));
        let payload_fields = self.stored_len != 0 || self.crc != 0 || self.codec != 0;
        match self.kind {
            // spec: IDX-7
            NodeKind::Empty if self.child_mask == 0 && bytes[..NODE_BYTES].iter().any(|&b| b != 0) => {
                return bad(Code::Canon, 0, "node", "an EMPTY node without children is not all zero");
            }
            NodeKind::Empty if payload_fields || self.offset != 0 || self.flags.0 & NodeFlags::IN_LEADER != 0 => {
                return bad(Code::Canon, 0, "node", "an EMPTY node has payload fields or flags set");
            }
            NodeKind::Empty => {}
            // spec: IDX-8
            NodeKind::Constant => {
                if payload_fields || self.flags.contains(NodeFlags::ZSTD) {
                    return bad(Code::Canon, 8, "node", "a CONSTANT node has payload fields or flags set");
                }
                self.constant(sample_type)
                    .map_err(|e| Error::at(e.code(), at, "node.value", e.message().to_owned()))?;
            }
            // spec: IDX-9
            NodeKind::Stored => {
                if self.stored_len == 0 {
                    return bad(Code::Size, 8, "node.stored_len", "a STORED node has no payload");
                }
                if u64::from(self.stored_len) > MAX_BRICK_BYTES {
                    return bad(Code::Limit, 8, "node.stored_len", "the payload exceeds 64 MiB");
                }
                if !self.offset.is_multiple_of(16) {
                    return bad(Code::Align, 0, "node.offset", "the payload is not aligned to 16 bytes");
                }
            }
        }
        // spec: IDX-10, IDX-11
        if !(self.min.is_finite() && self.max.is_finite() && self.max_error.is_finite()) {
            return bad(Code::NonFinite, 20, "node.min", "a bound is NaN or infinite");
        }
        if self.min > self.max {
            return bad(Code::MinmaxOrder, 20, "node.min", "min is larger than max");
        }
        if self.max_error < 0.0 {
            return bad(Code::Param, 28, "node.max_error", "the error is negative");
        }
        if !self.flags.contains(NodeFlags::ERROR_KNOWN) && self.max_error.to_bits() != 0 {
            return bad(Code::Canon, 28, "node.max_error", "set, though flagged as not known");
        }
        Ok(())
    }
}

/// Bounds of one value over its components, rounded outward.
pub(super) fn value_bounds(value: SampleValue) -> (f32, f32) {
    let n = value.sample_type().components();
    let (lo, hi) = (0..n)
        .map(|c| value.component(c))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
    (round_down_f32(lo), round_up_f32(hi))
}

/// The largest f32 not above `v` (spec: IDX-11; D-55). Never −0.
#[must_use]
pub fn round_down_f32(v: f64) -> f32 {
    #[allow(clippy::cast_possible_truncation, reason = "the rounding is what this function is about")]
    let near = v as f32;
    let r = if f64::from(near) > v { near.next_down() } else { near };
    r + 0.0
}

/// The smallest f32 not below `v` (spec: IDX-11; D-55). Never −0.
#[must_use]
pub fn round_up_f32(v: f64) -> f32 {
    #[allow(clippy::cast_possible_truncation, reason = "the rounding is what this function is about")]
    let near = v as f32;
    let r = if f64::from(near) < v { near.next_up() } else { near };
    r + 0.0
}
