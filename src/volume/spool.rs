//! What does not fit in memory: temporary files without a name, which vanish with the process however it ends.

use crate::error::{Error, Result};
use crate::geometry::Extent;
use crate::grid::{AlignedBytes, SlabReader, dense_len};
use crate::voxel::SampleType;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::Path;

/// Bytes that are copied at a time.
const PIECE: usize = 8 << 20;

/// A temporary file in `dir`, or in the system's folder for such files.
///
/// # Errors
/// `E_SOURCE` where it cannot be made.
fn temporary(dir: Option<&Path>) -> Result<File> {
    let made = dir.map_or_else(tempfile::tempfile, tempfile::tempfile_in);
    let place = || dir.map_or_else(std::env::temp_dir, Path::to_owned);
    made.map_err(|e| Error::io(format!("no temporary file in {} (--temp-dir)", place().display()), e))
}

fn full(e: std::io::Error) -> Error {
    Error::io("a temporary file (--temp-dir says where)", e)
}

/// Planes of rows, written as they come and read when they are all there: in memory, or in a temporary file.
pub(super) enum SlabBuffer {
    Memory(AlignedBytes),
    File(File),
}

impl SlabBuffer {
    /// Room for `bytes`.
    ///
    /// # Errors
    /// `E_LIMIT`, `E_SOURCE`.
    pub(super) fn new(bytes: usize, in_memory: bool, temp_dir: Option<&Path>) -> Result<Self> {
        if in_memory {
            return Ok(SlabBuffer::Memory(AlignedBytes::zeroed(bytes)?));
        }
        temporary(temp_dir).map(SlabBuffer::File)
    }

    /// Puts bytes at `offset`.
    pub(super) fn write(&mut self, offset: usize, bytes: &[u8]) -> Result<()> {
        match self {
            SlabBuffer::Memory(memory) => {
                memory.as_mut_slice()[offset..offset + bytes.len()].copy_from_slice(bytes);
                Ok(())
            }
            SlabBuffer::File(file) => {
                file.seek(SeekFrom::Start(offset as u64)).and_then(|_| file.write_all(bytes)).map_err(full)
            }
        }
    }

    /// Fills `out` from `offset` on.
    pub(super) fn read(&mut self, offset: usize, out: &mut [u8]) -> Result<()> {
        match self {
            SlabBuffer::Memory(memory) => {
                out.copy_from_slice(&memory.as_slice()[offset..offset + out.len()]);
                Ok(())
            }
            SlabBuffer::File(file) => {
                file.seek(SeekFrom::Start(offset as u64)).and_then(|_| file.read_exact(out)).map_err(full)
            }
        }
    }
}

/// A sequential reader that has been read to its end, into a temporary file, so that it can be looked at again.
pub(super) struct Spooled {
    file: File,
    extent: Extent,
    sample_type: SampleType,
    series: (u32, u32),
    /// First byte of the current volume.
    base: u64,
}

impl Spooled {
    /// Reads all of `reader`.
    ///
    /// # Errors
    /// Those of the reader; `E_SOURCE` where the temporary file cannot be written.
    pub(super) fn new(reader: &mut dyn SlabReader, temp_dir: Option<&Path>) -> Result<Self> {
        let (extent, sample_type, series) = (reader.extent(), reader.sample_type(), reader.series());
        let mut file = temporary(temp_dir)?;
        let row = dense_len(Extent { y: 1, z: 1, ..extent }, sample_type)?;
        let rows = u32::try_from(PIECE / row).unwrap_or(u32::MAX).clamp(1, extent.y);
        let mut buffer = vec![0; rows as usize * row];
        for time in 0..series.0 {
            for channel in 0..series.1 {
                reader.turn_to(time, channel)?;
                for z in 0..extent.z {
                    for y in (0..extent.y).step_by(rows as usize) {
                        let y = y..(y + rows).min(extent.y);
                        let piece = &mut buffer[..y.len() * row];
                        reader.read_rows(z..z + 1, y, piece)?;
                        file.write_all(piece).map_err(full)?;
                    }
                }
            }
        }
        Ok(Spooled { file, extent, sample_type, series, base: 0 })
    }

    fn bytes(&self) -> u64 {
        self.extent.voxels() * self.sample_type.bytes() as u64
    }
}

impl SlabReader for Spooled {
    fn extent(&self) -> Extent {
        self.extent
    }

    fn sample_type(&self) -> SampleType {
        self.sample_type
    }

    fn read_slab(&mut self, z: Range<u32>, out: &mut [u8]) -> Result<()> {
        self.read_rows(z, 0..self.extent.y, out)
    }

    fn read_rows(&mut self, z: Range<u32>, y: Range<u32>, out: &mut [u8]) -> Result<()> {
        let row = u64::from(self.extent.x) * self.sample_type.bytes() as u64;
        let planes = z.len().max(1);
        let len = out.len() / planes;
        for (z, out) in z.zip(out.chunks_exact_mut(len.max(1))) {
            let at = self.base + (u64::from(z) * u64::from(self.extent.y) + u64::from(y.start)) * row;
            self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(out)).map_err(full)?;
        }
        Ok(())
    }

    fn series(&self) -> (u32, u32) {
        self.series
    }

    fn turn_to(&mut self, time: u32, channel: u32) -> Result<()> {
        self.base = (u64::from(time) * u64::from(self.series.1) + u64::from(channel)) * self.bytes();
        Ok(())
    }
}
