//! The codec table of an open volume: what each entry decodes, with the layouts of full and partial bricks ready.

use crate::codec::{Codec, s3dc, zerobit};
use crate::container::{CODEC_ENTRY_BYTES, DESCRIPTOR_BYTES, Head, VolumeDescriptor};
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent};
use std::sync::{Arc, OnceLock};

/// One entry of the table.
pub(super) struct Entry {
    codec: Codec,
    /// The same with the volume's codebooks, once they have been read.
    with_books: OnceLock<Codec>,
    /// Where its layouts start in [`CodecTable::layouts`]: eight per level, for bricks that are partial along x (bit 0),
    /// y (bit 1), z (bit 2).
    first_layout: usize,
}

impl Entry {
    /// The codec; able to decode after [`Entry::supply`], if it uses codebooks.
    #[inline]
    pub(super) fn codec(&self) -> &Codec {
        self.with_books.get().unwrap_or(&self.codec)
    }

    /// Whether codebooks have to be supplied before anything is decoded.
    #[inline]
    pub(super) fn wants_books(&self) -> bool {
        self.codec.uses_books() && self.with_books.get().is_none()
    }

    /// Supplies the codebooks. Another thread may have been faster, with the same ones.
    pub(super) fn supply(&self, books: &Arc<[zerobit::Book]>) {
        let _ = self.with_books.set(self.codec.with_books(books));
    }
}

/// A brick extent and, for S3Dc, where its parts lie.
#[derive(Clone, Copy)]
pub(super) struct Layout {
    pub(super) extent: Extent,
    pub(super) s3dc: Option<s3dc::Layout>,
    /// Shortest and longest payload.
    pub(super) payload_lens: [u64; 2],
}

impl Layout {
    /// Whether a payload may be this long.
    pub(super) fn allows(&self, len: u64) -> bool {
        (self.payload_lens[0]..=self.payload_lens[1]).contains(&len)
    }
}

/// Checks the parameters of every codec that this reader knows; the descriptor lies at byte `at` (spec: VAL-2).
pub(super) fn check_codecs(d: &VolumeDescriptor, at: u64) -> Result<()> {
    for (i, wire) in d.codecs.iter().enumerate() {
        let codec = Codec::from_wire(wire.id, wire.stream_version, &wire.params, d.null_sample());
        match codec.and_then(|codec| codec.supports(d.sample_type)) {
            Err(e) if e.code() != Code::Codec => {
                let entry = at + (DESCRIPTOR_BYTES + CODEC_ENTRY_BYTES * i) as u64;
                return Err(Error::at(e.code(), entry, format!("VOLD.codec.{}", e.field()), e.message()));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Unknown codecs stay data: the volume opens, and only decoding a brick of theirs fails.
pub(super) struct CodecTable {
    entries: Vec<std::result::Result<Entry, (u16, u16)>>,
    layouts: Vec<Layout>,
    brick_log2: u8,
}

impl CodecTable {
    pub(super) fn new(head: &Head) -> Result<Self> {
        let d = &head.descriptor;
        check_codecs(d, head.section_range(*b"VOLD").start)?;
        let mut entries = Vec::with_capacity(d.codecs.len());
        let mut layouts = Vec::new();
        let edge = 1u32 << d.brick_log2;
        for wire in &d.codecs {
            let Ok(codec) = Codec::from_wire(wire.id, wire.stream_version, &wire.params, d.null_sample()) else {
                entries.push(Err((wire.id, wire.stream_version)));
                continue;
            };
            let first_layout = layouts.len();
            for (level, partial) in head.octree.levels.iter().flat_map(|l| (0..8).map(move |partial| (l, partial))) {
                let last = |axis: usize, n: u32| {
                    if partial >> axis & 1 == 0 { edge.min(n) } else { n - (n - 1) / edge * edge }
                };
                let e = level.extent;
                let extent = Extent::new(last(0, e.x), last(1, e.y), last(2, e.z));
                let s3dc = match &codec {
                    Codec::S3dc(params) => Some(s3dc::Layout::new(params, d.sample_type, extent)),
                    Codec::Raw | Codec::Zerobit(_) => None,
                };
                let lens = codec.payload_lens(d.sample_type, extent);
                layouts.push(Layout { extent, s3dc, payload_lens: [*lens.start(), *lens.end()] });
            }
            entries.push(Ok(Entry { codec, with_books: OnceLock::new(), first_layout }));
        }
        Ok(CodecTable { entries, layouts, brick_log2: d.brick_log2 })
    }

    /// Index of the layout of the whole bricks of level `lod`.
    pub(super) fn whole_layout(entry: &Entry, lod: u8) -> usize {
        entry.first_layout + usize::from(lod) * 8
    }

    /// Index of the layout of brick `brick` of level `lod`, whose extent is `level`.
    #[inline]
    pub(super) fn layout_index(&self, entry: &Entry, lod: u8, brick: Coord, level: Extent) -> usize {
        // No overflow: an axis has at most 2^21 voxels.
        let is_partial = |axis: usize, n: u32| usize::from((brick[axis] + 1) << self.brick_log2 > n) << axis;
        let partial = is_partial(0, level.x) | is_partial(1, level.y) | is_partial(2, level.z);
        entry.first_layout + usize::from(lod) * 8 + partial
    }

    /// Layout `index`.
    #[inline]
    pub(super) fn layout(&self, index: usize) -> &Layout {
        &self.layouts[index]
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
