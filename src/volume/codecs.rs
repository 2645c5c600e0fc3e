//! The codec table of an open volume: what each entry decodes, with the layouts of full and partial bricks ready.

use crate::codec::{Codec, s3dc};
use crate::container::Head;
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent};

/// One entry of the table.
pub(super) struct Entry {
    pub(super) codec: Codec,
    /// Layouts per level for bricks that are partial along x (bit 0), y (bit 1), z (bit 2).
    layouts: Vec<[Layout; 8]>,
}

/// A brick extent and, for S3Dc, where its parts lie.
#[derive(Clone, Copy)]
pub(super) struct Layout {
    pub(super) extent: Extent,
    pub(super) s3dc: Option<s3dc::Layout>,
    pub(super) payload_len: u64,
}

/// Unknown codecs stay data: the volume opens, and only decoding a brick of theirs fails.
pub(super) struct CodecTable {
    entries: Vec<std::result::Result<Entry, (u16, u16)>>,
}

impl CodecTable {
    pub(super) fn new(head: &Head) -> Result<Self> {
        let d = &head.descriptor;
        let mut entries = Vec::with_capacity(d.codecs.len());
        for wire in &d.codecs {
            let codec = match Codec::from_wire(wire.id, wire.stream_version, &wire.params) {
                Ok(codec) => codec,
                Err(e) if e.code() == Code::Codec => {
                    entries.push(Err((wire.id, wire.stream_version)));
                    continue;
                }
                Err(e) => return Err(e),
            };
            codec.supports(d.sample_type)?;
            let edge = 1u32 << d.brick_log2;
            let layouts = head.octree.levels.iter().map(|level| {
                std::array::from_fn(|partial| {
                    let last = |axis: usize, n: u32| {
                        if partial >> axis & 1 == 0 { edge.min(n) } else { n - (n - 1) / edge * edge }
                    };
                    let e = level.extent;
                    let extent = Extent::new(last(0, e.x), last(1, e.y), last(2, e.z));
                    Layout {
                        extent,
                        s3dc: match codec {
                            Codec::S3dc(params) => Some(s3dc::Layout::new(&params, d.sample_type, extent)),
                            Codec::Raw => None,
                        },
                        payload_len: codec.payload_len(d.sample_type, extent),
                    }
                })
            });
            entries.push(Ok(Entry { codec, layouts: layouts.collect() }));
        }
        Ok(CodecTable { entries })
    }

    /// Entry `index` of the table.
    #[inline]
    pub(super) fn get(&self, index: u8) -> Result<&Entry> {
        match self.entries.get(usize::from(index)) {
            Some(Ok(entry)) => Ok(entry),
            Some(Err((id, version))) => Err(Error::new(
                Code::Codec,
                "VOLD.codec",
                format!("codec {id} version {version} is not known to this reader; a newer one may decode it"),
            )),
            None => Err(Error::new(Code::Ref, "node.codec", format!("entry {index} is not in the codec table"))),
        }
    }
}

impl Entry {
    /// Layout of brick `brick` of level `lod`, where the level has `bricks` bricks.
    #[inline]
    pub(super) fn layout(&self, lod: u8, brick: Coord, bricks: Extent) -> &Layout {
        let partial = usize::from(brick[0] + 1 == bricks.x)
            | usize::from(brick[1] + 1 == bricks.y) << 1
            | usize::from(brick[2] + 1 == bricks.z) << 2;
        &self.layouts[usize::from(lod)][partial]
    }
}
