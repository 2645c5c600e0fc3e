//! Single voxels and batches of them.

use super::cells::Cells;
use super::open::Volume;
use super::pages::{Known, PageSlot};
use super::shortcut::Shortcut;
use super::{At, Axis};
use crate::codec::s3dc;
use crate::codec::zerobit::{self, BrickReader};
use crate::container::NodeKind;
use crate::error::{Error, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::voxel::{Sample, SampleType, SampleValue, same};
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
        self.bare_sampler::<T>(at)?.get(c)
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
        let mut sampler = self.bare_sampler(at)?;
        sampler.shortcut = Shortcut::new(self, at.lod);
        sampler.cells = Cells::new(self, at.lod);
        Ok(sampler)
    }

    /// A sampler that costs nothing to set up.
    fn bare_sampler<T: Sample>(&self, at: At) -> Result<Sampler<'_, T>> {
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
            shortcut: Shortcut::default(),
            cells: Cells::default(),
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
                entry.codec().voxel(&payload, T::TYPE, self.codecs.layout(layout).extent, local)?
            }
            NodeKind::Constant => node.constant(T::TYPE)?,
            NodeKind::Empty => self.head.descriptor.null_sample(),
        };
        Ok(value.typed())
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
    shortcut: Shortcut,
    cells: Cells<'a>,
    sample: PhantomData<T>,
}

// Inlined by force: through memory, places and results of 16 bytes written in parts would be read back whole, which
// stalls until the loads that we want to overlap are done.
impl<'a, T: Sample> Sampler<'a, T> {
    /// Reads the voxel at `c` (x, y, z).
    ///
    /// # Errors
    /// As [`Volume::voxel`].
    #[inline(always)]
    pub fn get(&self, c: Coord) -> Result<T> {
        // The usual layout apart, down to the sample: every number of it is then a constant.
        if !matches!(T::TYPE, SampleType::Rgb8)
            && let Some((n, point)) = self.shortcut.usual_point::<T>(c)
        {
            return Ok(s3dc_voxel(self.file, n, point));
        }
        if let Some((reader, local)) = self.cells.find(c) {
            return Ok(reader.voxel(local));
        }
        match self.direct(c) {
            Some((n, point)) => Ok(s3dc_voxel(self.file, n, point)),
            None => self.indirect(c),
        }
    }

    /// Reads many voxels in the order given, asking memory for the next ones while it decodes the first.
    ///
    /// # Errors
    /// As [`Volume::voxels`].
    pub fn get_many(&self, coords: &[Coord], out: &mut [T]) -> Result<()> {
        if coords.len() != out.len() {
            return Err(Error::param("out", format!("{} places for {} voxels", out.len(), coords.len())));
        }
        if !self.cells.is_empty() {
            return self.get_many_cells(coords, out);
        }
        // Indices per word; 0 where the voxel takes the long way.
        let mut words = [0; AHEAD];
        let mut points = [s3dc::Point::default(); AHEAD];
        for (coords, out) in coords.chunks(AHEAD).zip(out.chunks_mut(AHEAD)) {
            for ((word, point), &c) in words.iter_mut().zip(&mut points).zip(coords) {
                *word = 0;
                if let Some((n, p)) = self.direct(c) {
                    p.prefetch(self.file);
                    (*word, *point) = (n, p);
                }
            }
            for (((value, &n), &point), &c) in out.iter_mut().zip(&words).zip(&points).zip(coords) {
                *value = if n > 0 { s3dc_voxel(self.file, n, point) } else { self.indirect(c)? };
            }
        }
        Ok(())
    }

    /// [`Sampler::get_many`] of a zerobit level.
    fn get_many_cells(&self, coords: &[Coord], out: &mut [T]) -> Result<()> {
        let mut readers: Vec<BrickReader<'_>> = Vec::with_capacity(zerobit::AHEAD);
        let mut locals = [Coord::default(); zerobit::AHEAD];
        let (mut coords, mut out) = (coords, out);
        while !coords.is_empty() {
            let most = coords.len().min(zerobit::AHEAD);
            readers.clear();
            for (local, &c) in locals.iter_mut().zip(&coords[..most]) {
                let Some((reader, l)) = self.cells.find(c) else { break };
                *local = l;
                readers.push(reader);
            }
            let mut known = readers.len();
            BrickReader::voxels(&readers, &locals[..known], &mut out[..known]);
            if known < most {
                out[known] = self.get(coords[known])?;
                known += 1;
            }
            coords = &coords[known..];
            out = &mut out[known..];
        }
        Ok(())
    }

    /// The 64 voxels of the cell of 4³ voxels that holds `c`, x fastest, then y, then z; those outside the volume are
    /// unspecified. Fast for zerobit, whose cells they are (cell mode of the paper); right for every codec.
    ///
    /// # Errors
    /// As [`Volume::voxel`].
    #[inline]
    pub fn cell(&self, c: Coord, out: &mut [T; 64]) -> Result<()> {
        if let Some((reader, local)) = self.cells.find(c) {
            reader.cell(local, out);
            return Ok(());
        }
        let first = c.map(|v| v & !3);
        self.get(c)?; // the brick is known now, or never
        if let Some((reader, local)) = self.cells.find(c) {
            reader.cell(local, out);
            return Ok(());
        }
        self.gather(out, |i| [first[0] + (i & 3), first[1] + (i >> 2 & 3), first[2] + (i >> 4)])
    }

    /// The 16 voxels of that cell whose coordinate along `axis` is that of `c`; the lower of the other axes fastest (plane
    /// mode of the paper).
    ///
    /// # Errors
    /// As [`Volume::voxel`].
    #[inline]
    pub fn plane(&self, axis: Axis, c: Coord, out: &mut [T; 16]) -> Result<()> {
        if let Some((reader, local)) = self.cells.find(c) {
            reader.plane(axis as usize, local, out);
            return Ok(());
        }
        self.get(c)?;
        if let Some((reader, local)) = self.cells.find(c) {
            reader.plane(axis as usize, local, out);
            return Ok(());
        }
        let first = c.map(|v| v & !3);
        self.gather(out, |i| {
            let mut at = c;
            for (axis, step) in (0..3).filter(|&a| a != axis as usize).zip([i & 3, i >> 2]) {
                at[axis] = first[axis] + step;
            }
            at
        })
    }

    /// Voxel by voxel, as far as the volume goes.
    fn gather(&self, out: &mut [T], at: impl Fn(u32) -> Coord) -> Result<()> {
        for (i, value) in (0..).zip(out) {
            let c = at(i);
            if self.extent.contains(c) {
                *value = self.get(c)?;
            }
        }
        Ok(())
    }

    /// Whether there is such a voxel.
    #[inline(always)]
    pub(super) fn contains(&self, c: Coord) -> bool {
        self.extent.contains(c)
    }

    /// What is known of the brick that holds `c`.
    #[inline(always)]
    fn known(&self, c: Coord) -> Option<Known> {
        if !self.extent.contains(c) {
            return None;
        }
        let [x, y, z] = c.map(|v| v >> self.brick_log2);
        let page = (x >> 3) + self.pages[0] * ((y >> 3) + self.pages[1] * (z >> 3));
        let page = self.slots.get(page as usize)?.loaded()?;
        Some(page.known_at(x & 7 | (y & 7) << 3 | (z & 7) << 6))
    }

    /// Where a voxel lies whose brick has been used before and is in memory as it is in the file.
    #[inline(always)]
    fn direct(&self, c: Coord) -> Option<(u32, s3dc::Point)> {
        self.shortcut.point::<T>(c).or_else(|| self.direct_by_page(c))
    }

    /// [`Sampler::direct`] by way of the index; what it finds becomes a shortcut.
    #[inline(never)]
    fn direct_by_page(&self, c: Coord) -> Option<(u32, s3dc::Point)> {
        let (offset, index) = self.known(c)?.as_direct()?;
        self.shortcut.learn(c, index, offset);
        let layout = self.volume.codecs.layout(index).s3dc.as_ref()?;
        let mask = (1 << self.brick_log2) - 1;
        Some((layout.indices_per_word(), layout.point(c.map(|v| v & mask), offset)))
    }

    /// A voxel of a CONSTANT or EMPTY brick, or one that has to be fetched.
    #[inline(never)]
    fn indirect(&self, c: Coord) -> Result<T> {
        match self.known(c).and_then(Known::as_constant) {
            Some(raw) => Ok(bytemuck::pod_read_unaligned(&raw.to_ne_bytes()[native(T::TYPE)])),
            None => {
                let value = self.volume.fetch_voxel(self.at, self.tree, c)?;
                self.cells.learn(self.volume, self.tree, self.at.lod, c)?;
                Ok(value)
            }
        }
    }
}

/// Where the bytes of a sample are in a native `u32` whose low bytes it fills.
const fn native(t: SampleType) -> std::ops::Range<usize> {
    if cfg!(target_endian = "big") && !matches!(t, SampleType::Rgb8) { 4 - t.bytes()..4 } else { 0..t.bytes() }
}

/// The type is known when this is compiled: no match remains.
#[inline(always)]
fn s3dc_voxel<T: Sample>(file: &[u8], n: u32, point: s3dc::Point) -> T {
    match T::TYPE {
        SampleType::U8 => same(point.read::<u8>(file, n)),
        SampleType::U16 => same(point.read::<u16>(file, n)),
        SampleType::I16 => same(point.read::<i16>(file, n)),
        SampleType::F32 => same(point.read::<f32>(file, n)),
        SampleType::Rgb8 => unreachable!("s3dc holds scalars only"),
    }
}
