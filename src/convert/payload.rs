//! Where the samples of a foreign file lie, and the slab reader over them.

use super::stack::Stack;
use super::stored::{Kind, Stored};
use super::{fault, narrow};
use crate::error::{Code, Error, Result};
use crate::geometry::Extent;
use crate::grid::{AlignedBytes, Grid, SlabReader};
use crate::voxel::SampleType;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Bytes of samples that are converted in one go.
const CHUNK_BYTES: usize = 256 << 10;

/// Opens a regular file. Pipes and devices are refused: their length is not known, and reading one may never end.
pub(super) fn open(path: &Path) -> Result<(File, u64)> {
    let file = File::open(path).map_err(|e| fault::io(path, e))?;
    let meta = file.metadata().map_err(|e| fault::io(path, e))?;
    if !meta.is_file() {
        return Err(fault::unsupported(path, "", "is not a regular file; copy the data into one"));
    }
    Ok((file, meta.len()))
}

/// Bytes of `extent` voxels of `kind`, checked against the caps before anything is allocated.
///
/// # Errors
/// `E_FOREIGN` for an empty axis, `E_LIMIT` above the caps.
pub(super) fn byte_len(path: &Path, field: &'static str, extent: Extent, kind: Kind) -> Result<u64> {
    extent.check().map_err(|e| fault::relabel(path, field, &e))?;
    extent
        .voxels()
        .checked_mul(kind.bytes() as u64)
        .ok_or_else(|| Error::new(Code::Limit, field, format!("{}: {extent} voxels overflow 64 bits", path.display())))
}

/// Sizes of a header as an extent; missing axes have one voxel.
///
/// # Errors
/// `E_FOREIGN` for an empty axis or more than three, `E_LIMIT` for an axis above 2^32.
pub(super) fn extent_of(path: &Path, field: &'static str, sizes: &[u64]) -> Result<Extent> {
    let mut axes = [1u32; 3];
    if sizes.len() > 3 {
        return Err(fault::foreign(path, field, format!("{sizes:?} are more than three axes")));
    }
    for (axis, size) in axes.iter_mut().zip(sizes) {
        *axis = u32::try_from(*size).map_err(|_| {
            Error::new(Code::Limit, field, format!("{}: an axis of {size} voxels is above the cap", path.display()))
        })?;
    }
    Ok(Extent::from(axes))
}

/// The bytes of all samples, x fastest.
pub(super) enum Bytes {
    /// In a file whose length has been checked, from byte `start` on.
    File { file: File, path: PathBuf, start: u64 },
    /// Unpacked.
    Memory(AlignedBytes),
    /// In images that are decoded as they are wanted, in this machine's byte order.
    Stack(Box<Stack>),
}

impl Bytes {
    /// Fills `out` from byte `offset` of the samples on.
    pub(super) fn read_at(&mut self, offset: u64, out: &mut [u8]) -> Result<()> {
        match self {
            Bytes::File { file, path, start } => file
                .seek(SeekFrom::Start(*start + offset))
                .and_then(|_| file.read_exact(out))
                .map_err(|e| fault::io(path, e)),
            Bytes::Memory(memory) => {
                let from = usize::try_from(offset).unwrap_or(usize::MAX);
                let part = memory.as_slice().get(from..).and_then(|s| s.get(..out.len())).ok_or_else(|| {
                    Error::new(Code::Range, "offset", format!("{} bytes at {offset} lie outside the data", out.len()))
                })?;
                out.copy_from_slice(part);
                Ok(())
            }
            Bytes::Stack(stack) => stack.read_at(offset, out),
        }
    }
}

/// All samples of a foreign file.
pub(super) struct Payload {
    /// Where they lie.
    pub bytes: Bytes,
    /// Their type and byte order.
    pub stored: Stored,
    /// Voxels per axis.
    pub extent: Extent,
}

/// A reader of whole slabs, and whether it streams from the file.
pub(super) type Opened = (Box<dyn SlabReader>, bool);

impl Payload {
    /// A slab reader in the forced type, the file's own, or the one that holds every value.
    ///
    /// # Errors
    /// See [`narrow::choose`].
    pub(super) fn open(self, path: &Path, forced: Option<SampleType>) -> Result<Opened> {
        let Payload { mut bytes, stored, extent } = self;
        let target = narrow::choose(path, &mut bytes, stored, extent, forced)?;
        match bytes {
            Bytes::Memory(mut memory) if stored.kind.native() == Some(target) => {
                to_native(stored, memory.as_mut_slice());
                Ok((Box::new(Grid::from_aligned(extent, target, memory)?), false))
            }
            bytes => {
                let streamed = !matches!(bytes, Bytes::Memory(_));
                Ok((Box::new(Slabs { bytes, stored, extent, target, buffer: Vec::new() }), streamed))
            }
        }
    }
}

/// Reverses the bytes of each sample where the file's order is not the machine's.
fn to_native(stored: Stored, bytes: &mut [u8]) {
    fn reverse<const N: usize>(bytes: &mut [u8]) {
        bytes.as_chunks_mut::<N>().0.iter_mut().for_each(|sample| sample.reverse());
    }
    match stored.kind.bytes() {
        2 if stored.swapped() => reverse::<2>(bytes),
        4 if stored.swapped() => reverse::<4>(bytes),
        8 if stored.swapped() => reverse::<8>(bytes),
        // Single bytes and colours have no order.
        _ => {}
    }
}

/// Slabs read and converted as they are asked for.
struct Slabs {
    bytes: Bytes,
    stored: Stored,
    extent: Extent,
    target: SampleType,
    buffer: Vec<u8>,
}

impl SlabReader for Slabs {
    fn extent(&self) -> Extent {
        self.extent
    }

    fn sample_type(&self) -> SampleType {
        self.target
    }

    fn read_slab(&mut self, z: Range<u32>, out: &mut [u8]) -> Result<()> {
        let (from, to) = (self.stored.kind.bytes(), self.target.bytes());
        let plane = u64::from(self.extent.x) * u64::from(self.extent.y);
        let samples = plane * u64::from(z.end.saturating_sub(z.start));
        if z.end > self.extent.z || out.len() as u64 != samples * to as u64 {
            let message = format!("planes {z:?} of {} into {} bytes", self.extent, out.len());
            return Err(Error::new(Code::Range, "z", message));
        }
        let mut offset = plane * u64::from(z.start) * from as u64;
        if self.stored.kind.native() == Some(self.target) {
            self.bytes.read_at(offset, out)?;
            to_native(self.stored, out);
            return Ok(());
        }
        let step = CHUNK_BYTES / from;
        self.buffer.resize(step * from, 0);
        for part in out.chunks_mut(step * to) {
            let src = &mut self.buffer[..part.len() / to * from];
            self.bytes.read_at(offset, src)?;
            narrow::convert(self.stored, src, self.target, part);
            offset += src.len() as u64;
        }
        Ok(())
    }
}
