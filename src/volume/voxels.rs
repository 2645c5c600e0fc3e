//! Single voxels and batches of them.

use super::At;
use super::bricks::Payload;
use super::codecs::{Entry, Layout};
use super::open::Volume;
use crate::codec::{Codec, s3dc};
use crate::container::NodeKind;
use crate::error::{Error, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::voxel::{Sample, SampleType, SampleValue};
use crate::with_sample;

/// Voxels whose bytes are asked for ahead before the first of them is decoded: enough to hide main memory's latency.
const AHEAD: usize = 32;

/// Where a voxel's bytes are.
enum Place<'a> {
    Value(SampleValue),
    S3dc { layout: &'a s3dc::Layout, payload: Payload<'a>, local: Coord },
    Other { entry: &'a Entry, layout: &'a Layout, payload: Payload<'a>, local: Coord },
}

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
        self.place(at, tree, c).and_then(|place| self.decode_at(place))
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
        let mut places: [Option<Place<'_>>; AHEAD] = [const { None }; AHEAD];
        for (coords, out) in coords.chunks(AHEAD).zip(out.chunks_mut(AHEAD)) {
            for (slot, &c) in places.iter_mut().zip(coords) {
                let place = self.place(at, tree, c)?;
                if let Place::S3dc { layout, payload, local } = &place {
                    layout.touch(payload, *local);
                }
                *slot = Some(place);
            }
            for (value, slot) in out.iter_mut().zip(&mut places) {
                *value = self.decode_at(slot.take().expect("placed above"))?;
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

    /// Finds the bytes of a voxel, reading page and brick where they have not been.
    #[inline]
    fn place(&self, at: At, tree: u32, c: Coord) -> Result<Place<'_>> {
        let level = &self.head.octree.levels[usize::from(at.lod)];
        if !level.extent.contains(c) {
            return Err(outside(c, level.extent));
        }
        let log2 = self.head.descriptor.brick_log2;
        let brick = c.map(|v| v >> log2);
        let found = self.find(tree, at.lod, brick)?;
        let node = found.node();
        match node.kind {
            NodeKind::Stored => {
                let entry = self.codecs.get(node.codec)?;
                let layout = entry.layout(at.lod, brick, level.bricks);
                let payload = self.payload(&found, layout)?;
                let local = c.map(|v| v & ((1 << log2) - 1));
                Ok(match &layout.s3dc {
                    Some(layout) => Place::S3dc { layout, payload, local },
                    None => Place::Other { entry, layout, payload, local },
                })
            }
            NodeKind::Constant => node.constant(self.head.descriptor.sample_type).map(Place::Value),
            NodeKind::Empty => Ok(Place::Value(self.head.descriptor.null_sample())),
        }
    }

    #[inline]
    fn decode_at<T: Sample>(&self, place: Place<'_>) -> Result<T> {
        match place {
            Place::S3dc { layout, payload, local } => Ok(s3dc_voxel(layout, &payload, local)),
            Place::Value(value) => Ok(typed(value)),
            Place::Other { entry, layout, payload, local } => {
                let Codec::Raw = entry.codec else { unreachable!("every other codec has its own place") };
                entry.codec.voxel(&payload, T::TYPE, layout.extent, local).map(typed)
            }
        }
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
fn s3dc_voxel<T: Sample>(layout: &s3dc::Layout, payload: &[u8], c: Coord) -> T {
    match T::TYPE {
        SampleType::U8 => same(layout.voxel::<u8>(payload, c)),
        SampleType::U16 => same(layout.voxel::<u16>(payload, c)),
        SampleType::I16 => same(layout.voxel::<i16>(payload, c)),
        SampleType::F32 => same(layout.voxel::<f32>(payload, c)),
        SampleType::Rgb8 => unreachable!("s3dc holds scalars only"),
    }
}

#[cold]
fn outside(c: Coord, extent: Extent) -> Error {
    Region::at(c, Extent::cube(1)).check(extent).expect_err("called for voxels outside")
}
