//! Single voxels and batches of them.

use super::At;
use super::open::Volume;
use crate::codec::s3dc;
use crate::container::NodeKind;
use crate::error::{Error, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::voxel::{Sample, SampleType, SampleValue};
use crate::with_sample;

/// Voxels whose bytes are asked for ahead before the first of them is decoded: enough to hide main memory's latency.
const AHEAD: usize = 32;

/// A voxel of an S3Dc payload that lies in memory: its layout, its payload, and where its words are.
type Direct<'a> = (&'a s3dc::Layout, &'a [u8], s3dc::Point);

impl Volume {
    /// Reads the voxel at `c` (x, y, z): one page and one brick at most, nothing if both were used before.
    ///
    /// # Errors
    /// `E_RANGE` outside the volume; those of the brick it lies in.
    pub fn voxel(&self, at: At, c: Coord) -> Result<SampleValue> {
        with_sample!(self.info().sample_type, T => self.get::<T>(at, c).map(Sample::value))
    }

    /// Reads the voxel at `c` as the Rust type of the volume's samples.
    ///
    /// # Errors
    /// As [`Volume::voxel`]; `E_PARAM` where `T` is not the volume's type.
    #[inline]
    pub fn get<T: Sample>(&self, at: At, c: Coord) -> Result<T> {
        self.check_type::<T>()?;
        let tree = self.tree(at)?;
        match self.direct(at.lod, tree, c) {
            Some((layout, payload, point)) => Ok(s3dc_voxel(layout, payload, point)),
            None => self.fetch_voxel(at, tree, c),
        }
    }

    /// Reads many voxels in the order given, asking memory for the next ones while it decodes the first.
    ///
    /// # Errors
    /// As [`Volume::get`], for the first voxel that fails; `E_PARAM` where `out` is not as long as `coords`.
    pub fn voxels<T: Sample>(&self, at: At, coords: &[Coord], out: &mut [T]) -> Result<()> {
        self.check_type::<T>()?;
        let tree = self.tree(at)?;
        if coords.len() != out.len() {
            return Err(Error::param("out", format!("{} places for {} voxels", out.len(), coords.len())));
        }
        let mut ahead: [Option<Direct<'_>>; AHEAD] = [None; AHEAD];
        for (coords, out) in coords.chunks(AHEAD).zip(out.chunks_mut(AHEAD)) {
            for (slot, &c) in ahead.iter_mut().zip(coords) {
                *slot = self.direct(at.lod, tree, c);
                if let Some((_, payload, point)) = *slot {
                    s3dc::Layout::prefetch(payload, point);
                }
            }
            for ((value, slot), &c) in out.iter_mut().zip(&ahead).zip(coords) {
                *value = match *slot {
                    Some((layout, payload, point)) => s3dc_voxel(layout, payload, point),
                    None => self.fetch_voxel(at, tree, c)?,
                };
            }
        }
        Ok(())
    }

    fn check_type<T: Sample>(&self) -> Result<()> {
        let volume: SampleType = self.info().sample_type;
        if T::TYPE == volume {
            return Ok(());
        }
        Err(Error::param("T", format!("voxels of {} wanted from a volume of {volume}", T::TYPE)))
    }

    /// The place of a voxel whose brick has been used before and lies in memory as it is; else `None`.
    #[inline]
    fn direct(&self, lod: u8, tree: u32, c: Coord) -> Option<Direct<'_>> {
        let level = &self.head.octree.levels[usize::from(lod)];
        if !level.extent.contains(c) {
            return None;
        }
        let log2 = self.head.descriptor.brick_log2;
        let (ordinal, slot) = self.head.octree.locate(tree, lod, c.map(|v| v >> log2));
        let (offset, layout) = self.pages.loaded(&self.head, ordinal)?.known(slot).as_direct()?;
        let layout = self.codecs.layout(layout).s3dc.as_ref()?;
        let payload = &self.source.as_slice()?[offset..][..layout.payload_len()];
        Some((layout, payload, layout.point(c.map(|v| v & ((1 << log2) - 1)))))
    }

    /// A voxel the long way: page and brick are read where they have not been.
    #[cold]
    #[inline(never)]
    fn fetch_voxel<T: Sample>(&self, at: At, tree: u32, c: Coord) -> Result<T> {
        let level = &self.head.octree.levels[usize::from(at.lod)];
        Region::at(c, Extent::cube(1)).check(level.extent)?;
        let log2 = self.head.descriptor.brick_log2;
        let brick = c.map(|v| v >> log2);
        let found = self.find(tree, at.lod, brick)?;
        let node = found.node();
        let value = match node.kind {
            NodeKind::Stored => {
                let (entry, layout) = self.codec_of(node, at.lod, brick)?;
                let payload = self.payload(&found, layout)?;
                let local = c.map(|v| v & ((1 << log2) - 1));
                entry.codec.voxel(&payload, T::TYPE, self.codecs.layout(layout).extent, local)?
            }
            NodeKind::Constant => node.constant(T::TYPE)?,
            NodeKind::Empty => self.head.descriptor.null_sample(),
        };
        Ok(typed(value))
    }
}

/// A value as the Rust type that it is known to have.
pub(super) fn typed<T: Sample>(value: SampleValue) -> T {
    match value {
        SampleValue::U8(v) => same(v),
        SampleValue::U16(v) => same(v),
        SampleValue::I16(v) => same(v),
        SampleValue::F32(v) => same(v),
        SampleValue::Rgb8(v) => same(v),
    }
}

/// `v` itself, where `A` and `B` are one type under two names.
#[inline]
fn same<A: Sample, B: Sample>(v: A) -> B {
    assert!(A::TYPE == B::TYPE, "checked against the volume's type");
    bytemuck::cast_slice(&[v])[0]
}

/// The type is known when this is compiled: no match remains.
#[inline]
fn s3dc_voxel<T: Sample>(layout: &s3dc::Layout, payload: &[u8], point: s3dc::Point) -> T {
    match T::TYPE {
        SampleType::U8 => same(layout.read::<u8>(payload, point)),
        SampleType::U16 => same(layout.read::<u16>(payload, point)),
        SampleType::I16 => same(layout.read::<i16>(payload, point)),
        SampleType::F32 => same(layout.read::<f32>(payload, point)),
        SampleType::Rgb8 => unreachable!("s3dc holds scalars only"),
    }
}
