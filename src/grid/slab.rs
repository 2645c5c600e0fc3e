//! Volumes that are read slab by slab, so that an encoder needs no more memory than one slab of bricks.

use super::{Grid, View, dense_len, dense_pitch};
use crate::error::{Code, Error, Result};
use crate::geometry::Extent;
use crate::voxel::SampleType;
use std::ops::Range;

/// A volume that delivers whole z-slabs, or a series of such volumes: one per time step and channel.
///
/// Slabs may be asked for in any order and more than once, unless the reader is [sequential](SlabReader::is_sequential).
pub trait SlabReader: Send {
    /// Voxels per axis, of each volume of a series.
    fn extent(&self) -> Extent;
    /// Type of a voxel.
    fn sample_type(&self) -> SampleType;
    /// Fills `out` with planes `z` (dense, x fastest, machine byte order).
    ///
    /// # Errors
    /// `E_SOURCE`, `E_FOREIGN` where the source cannot deliver them.
    fn read_slab(&mut self, z: Range<u32>, out: &mut [u8]) -> Result<()>;

    /// Fills `out` with rows `y` of planes `z` (dense, x fastest): less than a slab, where memory is short.
    ///
    /// # Errors
    /// As [`SlabReader::read_slab`].
    fn read_rows(&mut self, z: Range<u32>, y: Range<u32>, out: &mut [u8]) -> Result<()> {
        let (e, t) = (self.extent(), self.sample_type());
        if y == (0..e.y) {
            return self.read_slab(z, out);
        }
        let mut plane = vec![0; dense_len(Extent { z: 1, ..e }, t)?];
        let row = e.x as usize * t.bytes();
        let rows = y.start as usize * row..y.end as usize * row;
        for (z, out) in z.zip(out.chunks_exact_mut(rows.len())) {
            self.read_slab(z..z + 1, &mut plane)?;
            out.copy_from_slice(&plane[rows.clone()]);
        }
        Ok(())
    }

    /// The whole volume where it lies in memory already: saves the copy.
    fn as_view(&self) -> Option<View<'_>> {
        None
    }

    /// Time steps and channels: the series has one volume for each pair.
    fn series(&self) -> (u32, u32) {
        (1, 1)
    }

    /// Turns to the volume of a time step and channel. A reader starts at the first of each.
    ///
    /// # Errors
    /// `E_RANGE` where there is no such volume.
    fn turn_to(&mut self, time: u32, channel: u32) -> Result<()> {
        if (time, channel) == (0, 0) {
            return Ok(());
        }
        Err(Error::new(Code::Range, "time", format!("time step {time}, channel {channel} of a single volume")))
    }

    /// Whether planes can be had once only, in order: time steps, in each channels, in each planes. A pipe is so.
    fn is_sequential(&self) -> bool {
        false
    }
}

impl SlabReader for Grid {
    fn extent(&self) -> Extent {
        self.extent
    }
    fn sample_type(&self) -> SampleType {
        self.sample_type
    }
    fn read_slab(&mut self, z: Range<u32>, out: &mut [u8]) -> Result<()> {
        let plane = dense_pitch(self.extent, self.sample_type).1;
        out.copy_from_slice(&self.bytes()[z.start as usize * plane..z.end as usize * plane]);
        Ok(())
    }
    fn as_view(&self) -> Option<View<'_>> {
        Some(self.view())
    }
}

impl SlabReader for View<'_> {
    fn extent(&self) -> Extent {
        self.extent
    }
    fn sample_type(&self) -> SampleType {
        self.sample_type
    }
    fn read_slab(&mut self, z: Range<u32>, out: &mut [u8]) -> Result<()> {
        let row = self.extent.x as usize * self.sample_type.bytes();
        let mut rows = out.chunks_exact_mut(row);
        for z in z {
            for y in 0..self.extent.y {
                let start = y as usize * self.row_pitch + z as usize * self.slice_pitch;
                rows.next().expect("room for the slab").copy_from_slice(&self.bytes[start..start + row]);
            }
        }
        Ok(())
    }
    fn as_view(&self) -> Option<View<'_>> {
        Some(*self)
    }
}
