//! Single voxels and batches of them.

use super::At;
use super::open::Volume;
use super::pages::PageSlot;
use crate::codec::s3dc;
use crate::container::NodeKind;
use crate::error::{Error, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::voxel::{Sample, SampleType, SampleValue};
use crate::with_sample;
use std::marker::PhantomData;

/// Voxels whose bytes are asked for ahead before the first of them is decoded: enough to hide main memory's latency.
const AHEAD: usize = 32;

impl Volume {
    /// Reads the voxel at `c` (x, y, z): one page and one brick at most, nothing if both were used before.
    ///
    /// # Errors
    /// `E_RANGE` outside the volume; those of the brick it lies in.
    pub fn voxel(&self, at: At, c: Coord) -> Result<SampleValue> {
        with_sample!(self.info().sample_type, T => self.get::<T>(at, c).map(Sample::value))
    }

    /// Reads the voxel at `c` as the Rust type of the volume's samples. For many single voxels, a [`Sampler`] is faster.
    ///
    /// # Errors
    /// As [`Volume::voxel`]; `E_PARAM` where `T` is not the volume's type.
    pub fn get<T: Sample>(&self, at: At, c: Coord) -> Result<T> {
        self.sampler::<T>(at)?.get(c)
    }

    /// Reads many voxels in the order given, asking memory for the next ones while it decodes the first.
    ///
    /// # Errors
    /// As [`Volume::get`], for the first voxel that fails; `E_PARAM` where `out` is not as long as `coords`.
    pub fn voxels<T: Sample>(&self, at: At, coords: &[Coord], out: &mut [T]) -> Result<()> {
        self.sampler::<T>(at)?.get_many(coords, out)
    }

    /// A reader of single voxels of one level, with all that does not depend on the position looked up once.
    ///
    /// # Errors
    /// `E_RANGE` where there is no such level, `E_PARAM` where `T` is not the volume's type, those of the directory.
    pub fn sampler<T: Sample>(&self, at: At) -> Result<Sampler<'_, T>> {
        let d = &self.head.descriptor;
        if T::TYPE != d.sample_type {
            return Err(Error::param("T", format!("voxels of {} wanted from a volume of {}", T::TYPE, d.sample_type)));
        }
        let tree = self.tree(at)?;
        let level = &self.head.octree.levels[usize::from(at.lod)];
        let first = u64::from(tree) * self.head.octree.pages_per_tree + level.first_page;
        let slots = self.pages.slots(&self.head, &self.source, first, level.pages.voxels());
        Ok(Sampler {
            volume: self,
            at,
            tree,
            extent: level.extent,
            brick_log2: u32::from(d.brick_log2),
            pages: [level.pages.x, level.pages.y],
            slots: slots.map_err(|e| self.replaced_or(e))?.unwrap_or_default(),
            file: self.source.as_slice().unwrap_or_default(),
            sample: PhantomData,
        })
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

/// Reads single voxels of one level; see [`Volume::sampler`].
pub struct Sampler<'a, T> {
    volume: &'a Volume,
    at: At,
    tree: u32,
    extent: Extent,
    brick_log2: u32,
    /// Pages along x and y.
    pages: [u32; 2],
    /// The level's pages; none, where they are not all in one chunk of the directory.
    slots: &'a [PageSlot],
    /// The whole file, where it lies in memory.
    file: &'a [u8],
    sample: PhantomData<T>,
}

/// Where a voxel is that needs no reading.
#[derive(Clone, Copy)]
enum Place<'a> {
    S3dc(&'a s3dc::Layout, s3dc::Point),
    Constant(u32),
    /// It has to be fetched, or does not exist.
    Unknown,
}

impl<T: Sample> Sampler<'_, T> {
    /// Reads the voxel at `c` (x, y, z).
    ///
    /// # Errors
    /// As [`Volume::voxel`].
    #[inline]
    pub fn get(&self, c: Coord) -> Result<T> {
        self.decode(self.place(c), c)
    }

    /// Reads many voxels in the order given, asking memory for the next ones while it decodes the first.
    ///
    /// # Errors
    /// As [`Volume::voxels`].
    pub fn get_many(&self, coords: &[Coord], out: &mut [T]) -> Result<()> {
        if coords.len() != out.len() {
            return Err(Error::param("out", format!("{} places for {} voxels", out.len(), coords.len())));
        }
        let mut ahead = [Place::Unknown; AHEAD];
        for (coords, out) in coords.chunks(AHEAD).zip(out.chunks_mut(AHEAD)) {
            for (slot, &c) in ahead.iter_mut().zip(coords) {
                *slot = self.place(c);
                if let Place::S3dc(_, point) = *slot {
                    point.prefetch(self.file);
                }
            }
            for ((value, &place), &c) in out.iter_mut().zip(&ahead).zip(coords) {
                *value = self.decode(place, c)?;
            }
        }
        Ok(())
    }

    #[inline]
    fn place(&self, c: Coord) -> Place<'_> {
        if !self.extent.contains(c) {
            return Place::Unknown;
        }
        let brick = c.map(|v| v >> self.brick_log2);
        let page = (brick[0] >> 3) + self.pages[0] * ((brick[1] >> 3) + self.pages[1] * (brick[2] >> 3));
        let Some(page) = self.slots.get(page as usize).and_then(PageSlot::loaded) else { return Place::Unknown };
        let known = page.known_at(brick[0] & 7 | (brick[1] & 7) << 3 | (brick[2] & 7) << 6);
        if let Some((offset, layout)) = known.as_direct() {
            let mask = (1 << self.brick_log2) - 1;
            if let Some(layout) = &self.volume.codecs.layout(layout).s3dc {
                return Place::S3dc(layout, layout.point(c.map(|v| v & mask), offset));
            }
        }
        known.as_constant().map_or(Place::Unknown, Place::Constant)
    }

    #[inline]
    fn decode(&self, place: Place<'_>, c: Coord) -> Result<T> {
        match place {
            Place::S3dc(layout, point) => Ok(s3dc_voxel(layout, self.file, point)),
            Place::Constant(raw) => Ok(bytemuck::pod_read_unaligned(&raw.to_ne_bytes()[native(T::TYPE)])),
            Place::Unknown => self.volume.fetch_voxel(self.at, self.tree, c),
        }
    }
}

/// Where the bytes of a sample are in a native `u32` whose low bytes it fills.
const fn native(t: SampleType) -> std::ops::Range<usize> {
    if cfg!(target_endian = "big") && !matches!(t, SampleType::Rgb8) { 4 - t.bytes()..4 } else { 0..t.bytes() }
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
