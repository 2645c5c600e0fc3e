//! Volumes in memory: a dense grid (x fastest, then y, then z), views with pitches, and slab-wise readers.

use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::voxel::{Sample, SampleType, SampleValue};
use crate::with_sample;
use std::ops::Range;

mod slab;
pub use slab::SlabReader;

/// One cache line: the unit of allocation, so that rows of 64 voxels can be stored whole.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Line([u8; 64]);

// SAFETY: 64 plain bytes with no padding; all-zero is a valid value.
#[allow(unsafe_code, reason = "bytemuck cannot derive Zeroable for an over-aligned type without its derive crate")]
unsafe impl bytemuck::Zeroable for Line {}
// SAFETY: `repr(C)`, 64 bytes long, aligned to 64: no padding, every bit pattern is valid, no interior mutability.
#[allow(unsafe_code, reason = "bytemuck cannot derive Pod for an over-aligned type without its derive crate")]
unsafe impl bytemuck::Pod for Line {}

/// Bytes whose first one lies on a 64-byte boundary.
pub struct AlignedBytes {
    lines: Vec<Line>,
    len: usize,
}

impl AlignedBytes {
    /// `len` zero bytes.
    ///
    /// # Errors
    /// `E_LIMIT` where the memory cannot be had.
    pub fn zeroed(len: usize) -> Result<Self> {
        let lines = bytemuck::allocation::try_zeroed_vec(len.div_ceil(64)).map_err(|()| {
            Error::new(Code::Limit, "memory", format!("{len} bytes could not be allocated; read a smaller region"))
        })?;
        Ok(AlignedBytes { lines, len })
    }

    /// The bytes.
    #[must_use]
    pub fn as_slice(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.lines)[..self.len]
    }

    /// The bytes, to be written.
    #[must_use]
    pub fn as_mut_slice(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.lines)[..self.len]
    }
}

/// A dense volume in memory. Samples are in the machine's byte order, x fastest, then y, then z.
pub struct Grid {
    extent: Extent,
    sample_type: SampleType,
    bytes: AlignedBytes,
}

impl Grid {
    /// A grid of zeros.
    ///
    /// # Errors
    /// `E_PARAM` or `E_LIMIT` for extents outside the caps or more memory than there is.
    pub fn zeros(extent: Extent, sample_type: SampleType) -> Result<Self> {
        let len = dense_len(extent, sample_type)?;
        Ok(Grid { extent, sample_type, bytes: AlignedBytes::zeroed(len)? })
    }

    /// A grid with these samples, x fastest.
    ///
    /// # Errors
    /// As [`Grid::zeros`]; `E_PARAM` where the number of samples is not that of the extent.
    pub fn from_samples<T: Sample>(extent: Extent, samples: &[T]) -> Result<Self> {
        let mut grid = Grid::zeros(extent, T::TYPE)?;
        if samples.len() as u64 != extent.voxels() {
            return Err(Error::param("samples", format!("{} samples given for {extent} voxels", samples.len())));
        }
        grid.bytes_mut().copy_from_slice(bytemuck::cast_slice(samples));
        Ok(grid)
    }

    /// A grid whose voxel at (x, y, z) is `f([x, y, z])`.
    ///
    /// # Errors
    /// As [`Grid::zeros`].
    pub fn from_fn<T: Sample>(extent: Extent, mut f: impl FnMut(Coord) -> T) -> Result<Self> {
        let mut grid = Grid::zeros(extent, T::TYPE)?;
        let mut at = grid.samples_mut::<T>().iter_mut();
        for z in 0..extent.z {
            for y in 0..extent.y {
                for (x, slot) in (0..extent.x).zip(&mut at) {
                    *slot = f([x, y, z]);
                }
            }
        }
        Ok(grid)
    }

    /// A grid over bytes that are in place already: samples in the machine's byte order, x fastest.
    ///
    /// # Errors
    /// As [`Grid::zeros`]; `E_PARAM` where the number of bytes is not that of the extent.
    pub fn from_aligned(extent: Extent, sample_type: SampleType, bytes: AlignedBytes) -> Result<Self> {
        let len = dense_len(extent, sample_type)?;
        if bytes.len != len {
            return Err(Error::param(
                "samples",
                format!("{} bytes given for {extent} voxels of {sample_type}", bytes.len),
            ));
        }
        Ok(Grid { extent, sample_type, bytes })
    }

    /// Voxels per axis.
    #[must_use]
    pub const fn extent(&self) -> Extent {
        self.extent
    }

    /// Type of a voxel.
    #[must_use]
    pub const fn sample_type(&self) -> SampleType {
        self.sample_type
    }

    /// All samples as bytes in the machine's byte order.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.bytes.as_slice()
    }

    /// All samples as bytes, to be written.
    #[must_use]
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        self.bytes.as_mut_slice()
    }

    /// All samples.
    ///
    /// # Panics
    /// Where `T` is not the grid's sample type.
    #[must_use]
    pub fn samples<T: Sample>(&self) -> &[T] {
        assert_eq!(T::TYPE, self.sample_type, "samples of the grid's own type");
        bytemuck::cast_slice(self.bytes())
    }

    /// All samples, to be written.
    ///
    /// # Panics
    /// Where `T` is not the grid's sample type.
    #[must_use]
    pub fn samples_mut<T: Sample>(&mut self) -> &mut [T] {
        assert_eq!(T::TYPE, self.sample_type, "samples of the grid's own type");
        bytemuck::cast_slice_mut(self.bytes_mut())
    }

    /// The voxel at `c`.
    ///
    /// # Errors
    /// `E_RANGE` outside the grid.
    pub fn value(&self, c: Coord) -> Result<SampleValue> {
        Region::at(c, Extent::cube(1)).check(self.extent)?;
        let i = usize::try_from(self.extent.index(c)).expect("a grid fits in memory");
        Ok(with_sample!(self.sample_type, T => self.samples::<T>()[i].value()))
    }

    /// Smallest and largest component of all voxels; NaN is skipped, `None` where nothing else is there.
    #[must_use]
    pub fn range(&self) -> Option<(f64, f64)> {
        with_sample!(self.sample_type, T => {
            let components = T::TYPE.components();
            let mut range: Option<(f64, f64)> = None;
            for s in self.samples::<T>() {
                for c in 0..components {
                    let v = s.component(c);
                    if !v.is_nan() {
                        range = Some(range.map_or((v, v), |(lo, hi)| (lo.min(v), hi.max(v))));
                    }
                }
            }
            range
        })
    }

    /// The whole grid as a view.
    #[must_use]
    pub fn view(&self) -> View<'_> {
        View::dense(self.bytes(), self.extent, self.sample_type)
    }

    /// The whole grid as a view to be written.
    #[must_use]
    pub fn view_mut(&mut self) -> ViewMut<'_> {
        let (extent, sample_type) = (self.extent, self.sample_type);
        ViewMut::dense(self.bytes_mut(), extent, sample_type)
    }
}

/// Bytes of a dense volume.
///
/// # Errors
/// `E_PARAM` or `E_LIMIT` where the extent is outside the caps or does not fit this machine's address space.
pub fn dense_len(extent: Extent, sample_type: SampleType) -> Result<usize> {
    extent.check()?;
    extent.voxels().checked_mul(sample_type.bytes() as u64).and_then(|n| usize::try_from(n).ok()).ok_or_else(|| {
        Error::new(Code::Limit, "dims", format!("{extent} voxels of {sample_type} do not fit in memory; read a region"))
    })
}

/// A box of samples inside a larger buffer: row (y) and slice (z) pitch in bytes; x is dense.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// Bytes from the first sample to (at least) the last.
    pub bytes: &'a [u8],
    /// Voxels per axis.
    pub extent: Extent,
    /// Type of a voxel.
    pub sample_type: SampleType,
    /// Bytes from one row to the next.
    pub row_pitch: usize,
    /// Bytes from one slice to the next.
    pub slice_pitch: usize,
}

/// A box of samples to be written; see [`View`].
pub struct ViewMut<'a> {
    /// Bytes from the first sample to (at least) the last.
    pub bytes: &'a mut [u8],
    /// Voxels per axis.
    pub extent: Extent,
    /// Type of a voxel.
    pub sample_type: SampleType,
    /// Bytes from one row to the next.
    pub row_pitch: usize,
    /// Bytes from one slice to the next.
    pub slice_pitch: usize,
}

/// Row and slice pitch of a dense volume, in bytes.
fn dense_pitch(extent: Extent, sample_type: SampleType) -> (usize, usize) {
    let row = extent.x as usize * sample_type.bytes();
    (row, row * extent.y as usize)
}

/// Byte range of a sub-box.
fn sub_range(region: &Region, sample_type: SampleType, row_pitch: usize, slice_pitch: usize) -> Range<usize> {
    let [x, y, z] = region.start.map(|v| v as usize);
    let e = region.extent();
    let start = x * sample_type.bytes() + y * row_pitch + z * slice_pitch;
    let len = if region.is_empty() {
        0
    } else {
        (e.z as usize - 1) * slice_pitch + (e.y as usize - 1) * row_pitch + e.x as usize * sample_type.bytes()
    };
    start..start + len
}

impl<'a> View<'a> {
    /// A dense box.
    #[must_use]
    pub fn dense(bytes: &'a [u8], extent: Extent, sample_type: SampleType) -> Self {
        let (row_pitch, slice_pitch) = dense_pitch(extent, sample_type);
        View { bytes, extent, sample_type, row_pitch, slice_pitch }
    }

    /// A part of this box; `region` must lie inside.
    #[must_use]
    pub fn sub(&self, region: &Region) -> View<'a> {
        let range = sub_range(region, self.sample_type, self.row_pitch, self.slice_pitch);
        View { bytes: &self.bytes[range], extent: region.extent(), ..*self }
    }

    /// Row (y, z) as samples. `bytes` and pitches must be aligned for `T`, as those of grids are.
    #[must_use]
    pub fn row<T: Sample>(&self, y: u32, z: u32) -> &'a [T] {
        let start = y as usize * self.row_pitch + z as usize * self.slice_pitch;
        bytemuck::cast_slice(&self.bytes[start..start + self.extent.x as usize * size_of::<T>()])
    }
}

impl<'a> ViewMut<'a> {
    /// A dense box.
    #[must_use]
    pub fn dense(bytes: &'a mut [u8], extent: Extent, sample_type: SampleType) -> Self {
        let (row_pitch, slice_pitch) = dense_pitch(extent, sample_type);
        ViewMut { bytes, extent, sample_type, row_pitch, slice_pitch }
    }

    /// A part of this box; `region` must lie inside.
    #[must_use]
    pub fn sub(&mut self, region: &Region) -> ViewMut<'_> {
        let range = sub_range(region, self.sample_type, self.row_pitch, self.slice_pitch);
        ViewMut {
            bytes: &mut self.bytes[range],
            extent: region.extent(),
            sample_type: self.sample_type,
            row_pitch: self.row_pitch,
            slice_pitch: self.slice_pitch,
        }
    }

    /// Slices `0..z` and the rest: two boxes that can be written at the same time.
    #[must_use]
    pub fn split_at_z(self, z: u32) -> (ViewMut<'a>, ViewMut<'a>) {
        let cut = (z as usize * self.slice_pitch).min(self.bytes.len());
        let (low, high) = self.bytes.split_at_mut(cut);
        let (extent, sample_type, row_pitch, slice_pitch) =
            (self.extent, self.sample_type, self.row_pitch, self.slice_pitch);
        let part = |bytes, depth| ViewMut {
            bytes,
            extent: Extent { z: depth, ..extent },
            sample_type,
            row_pitch,
            slice_pitch,
        };
        (part(low, z), part(high, extent.z - z))
    }

    /// Sets every voxel to `value`, which must be of the box's type.
    pub fn fill<T: Sample>(&mut self, value: T) {
        for z in 0..self.extent.z {
            for y in 0..self.extent.y {
                self.row_mut::<T>(y, z).fill(value);
            }
        }
    }

    /// Row (y, z) as samples to be written; see [`View::row`].
    #[must_use]
    pub fn row_mut<T: Sample>(&mut self, y: u32, z: u32) -> &mut [T] {
        let start = y as usize * self.row_pitch + z as usize * self.slice_pitch;
        bytemuck::cast_slice_mut(&mut self.bytes[start..start + self.extent.x as usize * size_of::<T>()])
    }

    /// Reading view of the same box.
    #[must_use]
    pub fn as_view(&self) -> View<'_> {
        View {
            bytes: self.bytes,
            extent: self.extent,
            sample_type: self.sample_type,
            row_pitch: self.row_pitch,
            slice_pitch: self.slice_pitch,
        }
    }
}

impl std::fmt::Debug for Grid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Grid({} {})", self.extent, self.sample_type)
    }
}
