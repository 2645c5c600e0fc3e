//! Bricks as they are stored: payloads for those who decode them elsewhere, and what the index says of a level's bricks.

use super::At;
use super::bounds::Bounds;
use super::bricks::Payload;
use super::fetch::{Ahead, Content, GROUP_BRICKS, GROUP_BYTES, GROUP_INFLATED, Part};
use super::open::Volume;
use crate::codec::Codec;
use crate::container::{NodeFlags, NodeKind};
use crate::error::Result;
use crate::geometry::{Coord, Extent, Region};
use crate::voxel::SampleValue;
use std::ops::Deref;

/// The bytes of a payload, checked against their CRC and out of their zstd frame: a part of the file in memory or a
/// shared copy.
#[derive(Clone)]
pub struct PayloadBytes<'a>(Payload<'a>);

impl Deref for PayloadBytes<'_> {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        &self.0
    }
}

/// One brick as the file holds it.
#[derive(Clone)]
pub enum BrickPayload<'a> {
    /// Voxels in a payload.
    Stored {
        /// What decodes it, with its codebooks if it has any.
        codec: &'a Codec,
        /// Voxels of the brick; fewer at the end of the level.
        extent: Extent,
        /// The payload, of a length that the codec allows for this extent.
        bytes: PayloadBytes<'a>,
    },
    /// Every voxel has this value.
    Constant(SampleValue),
    /// Every voxel has the volume's null value.
    Empty,
}

/// The codecs of a level's stored bricks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LevelCodec<'a> {
    /// No brick is stored: all are CONSTANT or EMPTY.
    None,
    /// All stored bricks have this one; without codebooks as yet.
    One(&'a Codec),
    /// Stored bricks have several.
    Mixed,
}

/// What the index says of the bricks of one level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelBricks<'a> {
    /// Codec of the stored bricks.
    pub codec: LevelCodec<'a>,
    /// Bricks in all.
    pub bricks: u64,
    /// Stored bricks.
    pub stored: u64,
    /// Bytes of their payloads in the file.
    pub stored_bytes: u64,
    /// Whether a payload is a zstd frame: then its bytes in memory are other than `stored_bytes` says.
    pub zstd: bool,
}

impl Volume {
    /// Brick `brick` (position in bricks of the level) as it is stored.
    ///
    /// # Errors
    /// `E_RANGE` where there is no such brick; those of a damaged page or payload.
    pub fn brick_payload(&self, at: At, brick: Coord) -> Result<BrickPayload<'_>> {
        self.check_brick(at, brick)?;
        let tree = self.tree(at)?;
        let mut parts = [self.part(at, tree, brick, &self.head.octree.brick_region(at.lod, brick))?];
        self.fetch(&mut parts, &Ahead::default())?;
        let [part] = parts;
        self.stored_part(part)
    }

    /// Value and error bounds of one brick and all that it stands for on finer levels. Reads index pages only.
    ///
    /// # Errors
    /// `E_RANGE` where there is no such brick; those of damaged pages.
    pub fn brick_bounds(&self, at: At, brick: Coord) -> Result<Bounds> {
        self.check_brick(at, brick)?;
        let tree = self.tree(at)?;
        Ok(self.bounds_of(&self.find(tree, at.lod, brick)?))
    }

    /// The codec of all stored bricks of a level. Reads all index pages of the level.
    ///
    /// # Errors
    /// As [`Volume::level_bricks`].
    pub fn level_codec(&self, at: At) -> Result<LevelCodec<'_>> {
        Ok(self.level_bricks(at)?.codec)
    }

    /// What the index says of all bricks of a level. Reads all index pages of the level, no brick.
    ///
    /// # Errors
    /// `E_RANGE` for a level that is not there; those of damaged pages; `E_CODEC`, `E_REF` for a codec that is not known.
    pub fn level_bricks(&self, at: At) -> Result<LevelBricks<'_>> {
        let tree = self.tree(at)?;
        let bricks = self.brick_count(at);
        let mut all =
            LevelBricks { codec: LevelCodec::None, bricks: bricks.voxels(), stored: 0, stored_bytes: 0, zstd: false };
        let mut last = None;
        self.load_pages(tree, at.lod, [0; 3], bricks.to_array().map(|n| n - 1))?;
        for brick in each(bricks) {
            let node = self.find(tree, at.lod, brick)?;
            let node = node.node();
            if node.kind != NodeKind::Stored {
                continue;
            }
            all.stored += 1;
            all.stored_bytes += u64::from(node.stored_len);
            all.zstd |= node.flags.contains(NodeFlags::ZSTD);
            if last == Some(node.codec) {
                continue;
            }
            last = Some(node.codec);
            let codec = self.codecs.get(node.codec)?.codec();
            all.codec = match all.codec {
                LevelCodec::None => LevelCodec::One(codec),
                LevelCodec::One(other) if same_stream(other, codec) => LevelCodec::One(other),
                LevelCodec::One(_) | LevelCodec::Mixed => LevelCodec::Mixed,
            };
        }
        Ok(all)
    }

    /// Visits `bricks` of a level as they are stored, in the order given, in groups: payloads that lie side by side in the
    /// file are read together, several reads at a time where the source is far away. A group holds a few MiB.
    ///
    /// # Errors
    /// Those of [`Volume::brick_payload`], and of `visit`.
    pub fn brick_payloads(
        &self,
        at: At,
        bricks: impl IntoIterator<Item = Coord>,
        mut visit: impl FnMut(Vec<(Coord, BrickPayload<'_>)>) -> Result<()>,
    ) -> Result<()> {
        let tree = self.tree(at)?;
        let mut bricks = bricks.into_iter().peekable();
        while bricks.peek().is_some() {
            let (mut group, mut parts) = (Vec::new(), Vec::new());
            let (mut stored, mut inflated) = (0u64, 0u64);
            while stored < GROUP_BYTES && inflated < GROUP_INFLATED && parts.len() < GROUP_BRICKS {
                let Some(brick) = bricks.next() else { break };
                self.check_brick(at, brick)?;
                let part = self.part(at, tree, brick, &self.head.octree.brick_region(at.lod, brick))?;
                if let Content::Stored { layout, .. } = part.content {
                    stored += u64::from(part.found.node().stored_len);
                    if part.found.node().flags.contains(NodeFlags::ZSTD) {
                        inflated = inflated.saturating_add(self.codecs.layout(layout).payload_lens[1]);
                    }
                }
                group.push(brick);
                parts.push(part);
            }
            self.fetch(&mut parts, &Ahead::default())?;
            let payloads = parts.into_iter().map(|part| self.stored_part(part)).collect::<Result<Vec<_>>>()?;
            visit(group.into_iter().zip(payloads).collect())?;
        }
        Ok(())
    }

    fn stored_part<'a>(&'a self, part: Part<'a>) -> Result<BrickPayload<'a>> {
        let kind = part.found.node().kind;
        match part.content {
            Content::Constant(_) if kind == NodeKind::Empty => Ok(BrickPayload::Empty),
            Content::Constant(value) => Ok(BrickPayload::Constant(value)),
            Content::Stored { entry, layout, extent, payload } => {
                let payload = match payload {
                    Some(payload) => payload,
                    None => self.payload(&part.found, layout)?,
                };
                Ok(BrickPayload::Stored { codec: entry.codec(), extent, bytes: PayloadBytes(payload) })
            }
        }
    }
}

/// Whether payloads of both are read by the same rules.
fn same_stream(a: &Codec, b: &Codec) -> bool {
    match (a, b) {
        (Codec::Raw, Codec::Raw) => true,
        (Codec::S3dc(a), Codec::S3dc(b)) => a.i_bits() == b.i_bits() && a.block() == b.block(),
        (Codec::Zerobit(a), Codec::Zerobit(b)) => a.stream() == b.stream(),
        _ => false,
    }
}

/// All positions of an extent, x fastest.
fn each(extent: Extent) -> impl Iterator<Item = Coord> {
    let Region { end: [nx, ny, nz], .. } = Region::whole(extent);
    (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
}
