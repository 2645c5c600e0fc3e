//! Writing a head file: bricks as they come, tables when everything is known (spec chapters 2 to 6).

use super::assemble::{self, Tables};
use super::layout::{COMPACT_BYTES, payload_start};
use super::leader::{LEADER_BYTES, Leader};
use super::store::NodeStore;
use super::superblock::Superblock;
use super::{BrickSink, ExtraSection, FeatureName, GUARD_BYTES, Node, NodeFlags, NodeKind, Octree, VolumeDescriptor};
use crate::checksum::crc32;
use crate::error::{Code, Error, Result};
use crate::geometry::Coord;
use crate::limits::{self, HEAD_BYTES};
use crate::time::Times;
use std::io::{BufWriter, Seek, SeekFrom, Write};

/// What a file says besides its volume.
#[derive(Clone, Debug, Default)]
pub struct FinishOptions {
    /// Text of the `META` section: one JSON object.
    pub meta: Option<Vec<u8>>,
    /// The time of each step: the `TIME` section.
    pub times: Option<Times>,
    /// The file id, where it is not to follow from the content.
    pub file_id: Option<[u8; 16]>,
    /// Optional feature bits besides `NAN_REPLACED`, which the writer sets itself.
    pub optional: u64,
    /// Names of those bits.
    pub feature_names: Vec<FeatureName>,
    /// The `CBOK` section: its stored bytes, and how many codebooks they are (at least one).
    pub codebooks: Option<(Vec<u8>, u64)>,
    /// Further sections; each must be COPY_SAFE and not CRITICAL.
    pub extra: Vec<ExtraSection>,
}

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileSummary {
    /// Length of the file in bytes.
    pub len: u64,
    /// Its id.
    pub file_id: [u8; 16],
    /// STORED bricks, all levels and trees.
    pub stored: u64,
    /// CONSTANT bricks.
    pub constant: u64,
    /// EMPTY bricks.
    pub empty: u64,
    /// Index pages.
    pub pages: u64,
    /// Bytes of all payloads as they are stored.
    pub stored_bytes: u64,
}

/// Where a stored brick is in the index; its offset is in its node.
pub(super) struct Placed {
    pub(super) ordinal: u64,
    pub(super) slot: usize,
    pub(super) tree: u32,
    pub(super) level: u8,
    pub(super) brick: Coord,
}

/// Writes a head file into an empty `W`. Bricks may come in any order, which becomes their order in the file; the same
/// calls give the same bytes. Memory: 16 KiB per index page (512 bricks), and at most 4 MiB of payloads.
pub struct FileWriter<W: Write + Seek> {
    out: BufWriter<W>,
    descriptor: VolumeDescriptor,
    octree: Octree,
    nodes: NodeStore,
    order: Vec<Placed>,
    /// Payloads of `order`, one after the other, as long as the file may become compact.
    buffer: Option<Vec<u8>>,
    /// One past the last byte of `BRIK`, once bricks are streamed.
    cursor: u64,
    stored_bytes: u64,
}

impl<W: Write + Seek> FileWriter<W> {
    /// Starts a file for the octree and codec table of `descriptor`. Nothing is written yet.
    ///
    /// # Errors
    /// Those of [`VolumeDescriptor::check`].
    pub fn new(out: W, descriptor: &VolumeDescriptor) -> Result<Self> {
        Ok(FileWriter {
            out: BufWriter::new(out),
            descriptor: descriptor.clone(),
            octree: Octree::new(descriptor)?,
            nodes: NodeStore::default(),
            order: Vec::new(),
            buffer: Some(Vec::with_capacity(COMPACT_BYTES as usize)),
            cursor: 0,
            stored_bytes: 0,
        })
    }

    /// Gives up on a compact file: reserves the head and writes the bricks that were kept.
    fn start_streaming(&mut self) -> Result<()> {
        let Some(buffer) = self.buffer.take() else { return Ok(()) };
        self.out.write_all(&vec![0; HEAD_BYTES as usize]).map_err(|e| Error::io("writing", e))?;
        self.cursor = HEAD_BYTES;
        let mut rest = &buffer[..];
        for placed in &self.order {
            let node = &mut self.nodes.page_mut(placed.ordinal)[placed.slot];
            let codec = &self.descriptor.codecs[usize::from(node.codec)];
            node.offset = payload_start(self.cursor, codec.payload_align_log2(node.flags.contains(NodeFlags::ZSTD)));
            let (payload, tail) = rest.split_at(node.stored_len as usize);
            self.cursor = write_brick(&mut self.out, self.cursor, node.offset, &[0; LEADER_BYTES], payload)?;
            rest = tail;
        }
        Ok(())
    }

    fn write_all(&mut self, file: &assemble::Assembled) -> Result<()> {
        let io = |e| Error::io("writing", e);
        let leader = |nodes: &NodeStore, p: &Placed| {
            let node = nodes.node(p.ordinal, p.slot);
            (node.offset, node.stored_len, Leader::of(node, p.tree, p.level, p.brick).write_to(&file.file_id))
        };
        match &self.buffer {
            Some(buffer) => {
                self.out.write_all(&file.head).map_err(io)?;
                let (mut rest, mut cursor) = (&buffer[..], file.head.len() as u64);
                for placed in &self.order {
                    let (offset, len, leader) = leader(&self.nodes, placed);
                    let (payload, tail) = rest.split_at(len as usize);
                    cursor = write_brick(&mut self.out, cursor, offset, &leader, payload)?;
                    rest = tail;
                }
                self.out.write_all(&file.tail).map_err(io)?;
            }
            None => {
                self.out.write_all(&file.tail).map_err(io)?;
                for placed in &self.order {
                    let (offset, _, leader) = leader(&self.nodes, placed);
                    self.out.seek(SeekFrom::Start(offset - LEADER_BYTES as u64)).map_err(io)?;
                    self.out.write_all(&leader).map_err(io)?;
                }
                self.out.seek(SeekFrom::Start(0)).map_err(io)?;
                self.out.write_all(&file.head).map_err(io)?;
            }
        }
        self.out.flush().map_err(io)
    }
}

impl<W: Write + Seek> BrickSink for FileWriter<W> {
    type Out = W;

    fn octree(&self) -> &Octree {
        &self.octree
    }

    fn put_stored(&mut self, tree: u32, level: u8, brick: Coord, node: &Node, payload: &[u8]) -> Result<()> {
        let (mut node, align_log2) = check_stored(&self.descriptor, node, payload)?;
        if self.stored_bytes + payload.len() as u64 > COMPACT_BYTES {
            self.start_streaming()?;
        }
        if self.buffer.is_none() {
            node.offset = payload_start(self.cursor, align_log2);
        }
        let (ordinal, slot) = self.nodes.put(&self.octree, tree, level, brick, node)?;
        self.order.push(Placed { ordinal, slot, tree, level, brick });
        self.stored_bytes += payload.len() as u64;
        match &mut self.buffer {
            Some(buffer) => buffer.extend_from_slice(payload),
            // The leader needs the file id, which follows from the index: it is written last.
            None => self.cursor = write_brick(&mut self.out, self.cursor, node.offset, &[0; LEADER_BYTES], payload)?,
        }
        Ok(())
    }

    fn put_constant(&mut self, tree: u32, level: u8, brick: Coord, node: &Node) -> Result<()> {
        let node = check_constant(&self.descriptor, node)?;
        self.nodes.put(&self.octree, tree, level, brick, node).map(|_| ())
    }

    fn finish(mut self, descriptor: &VolumeDescriptor, options: FinishOptions) -> Result<(W, FileSummary)> {
        let d = &self.descriptor;
        if Octree::new(descriptor)? != self.octree
            || (descriptor.sample_type, &descriptor.codecs) != (d.sample_type, &d.codecs)
        {
            return Err(Error::param(
                "descriptor",
                "octree, sample type and codecs must be those the file was begun with",
            ));
        }
        self.nodes.join(&self.octree, descriptor.null_sample());
        let tables = Tables::new(Superblock::new(), &self.nodes, &self.order, descriptor, options)?;
        let plan = tables.plan_head();
        let mut end = self.cursor;
        if self.buffer.is_some() {
            end = plan.bricks;
            for placed in &self.order {
                let node = &mut self.nodes.page_mut(placed.ordinal)[placed.slot];
                let codec = &descriptor.codecs[usize::from(node.codec)];
                node.offset = payload_start(end, codec.payload_align_log2(node.flags.contains(NodeFlags::ZSTD)));
                end = node.offset + u64::from(node.stored_len) + GUARD_BYTES;
            }
        }
        let file = tables.assemble(&self.nodes, &plan, end)?;
        self.write_all(&file)?;
        let counts = self.nodes.counts();
        let summary = FileSummary {
            len: file.len,
            file_id: file.file_id,
            stored: counts.stored,
            constant: counts.constant,
            empty: self.octree.brick_count().saturating_sub(counts.stored).saturating_sub(counts.constant),
            pages: self.nodes.pages.len() as u64,
            stored_bytes: self.stored_bytes,
        };
        let out = self.out.into_inner().map_err(|e| Error::io("writing", e.into_error()))?;
        Ok((out, summary))
    }
}

/// A STORED node as it goes into the index, but for its offset, and the alignment of its payload.
///
/// # Errors
/// `E_LIMIT`, `E_REF`, and those of a node.
pub(super) fn check_stored(d: &VolumeDescriptor, node: &Node, payload: &[u8]) -> Result<(Node, u8)> {
    limits::check("brick.payload", payload.len() as u64, limits::MAX_BRICK_BYTES)?;
    let Some(codec) = d.codecs.get(usize::from(node.codec)) else {
        return Err(Error::new(Code::Ref, "node.codec", format!("entry {} is not in the codec table", node.codec)));
    };
    let stored_len = u32::try_from(payload.len()).expect("at most 64 MiB");
    let node = Node { offset: 0, child_mask: 0, stored_len, crc: crc32(payload), ..*node };
    check_node(d, &node, NodeKind::Stored)?;
    Ok((node, codec.payload_align_log2(node.flags.contains(NodeFlags::ZSTD))))
}

/// A CONSTANT node as it goes into the index.
///
/// # Errors
/// Those of a node.
pub(super) fn check_constant(d: &VolumeDescriptor, node: &Node) -> Result<Node> {
    let node = Node { child_mask: 0, ..*node };
    check_node(d, &node, NodeKind::Constant)?;
    Ok(node)
}

fn check_node(d: &VolumeDescriptor, node: &Node, kind: NodeKind) -> Result<()> {
    if node.kind != kind {
        return Err(Error::param("node.kind", format!("{:?} given, {kind:?} wanted", node.kind)));
    }
    Node::read_from(&node.write_to(), 0, d.sample_type)
        .map(|_| ())
        .map_err(|e| Error::new(e.code(), e.field().to_owned(), e.message().to_owned()))
}

/// Writes padding from `cursor` on, leader, payload and guard; returns one past the guard (spec: BRK-2 to BRK-4).
pub(super) fn write_brick(
    out: &mut impl Write,
    cursor: u64,
    offset: u64,
    leader: &[u8],
    payload: &[u8],
) -> Result<u64> {
    let padding = offset - LEADER_BYTES as u64 - cursor;
    let parts: [&[u8]; 4] = [&[0; 256][..padding as usize], leader, payload, &[0; GUARD_BYTES as usize]];
    for part in parts {
        out.write_all(part).map_err(|e| Error::io("writing", e))?;
    }
    Ok(offset + payload.len() as u64 + GUARD_BYTES)
}
