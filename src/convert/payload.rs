//! Where the samples of a foreign file lie, and the slab reader over them.

use super::layout::Layout;
use super::slabs::{Slabs, to_native};
use super::stack::Stack;
use super::stored::Stored;
use super::{fault, narrow};
use crate::error::{Code, Error, Result};
use crate::grid::{AlignedBytes, Grid, SlabReader};
use crate::voxel::SampleType;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Opens a regular file. Pipes and devices are refused: their length is not known, and reading one may never end.
pub(super) fn open(path: &Path) -> Result<(File, u64)> {
    let file = File::open(path).map_err(|e| fault::io(path, e))?;
    let meta = file.metadata().map_err(|e| fault::io(path, e))?;
    if !meta.is_file() {
        return Err(fault::unsupported(path, "", "is not a regular file; copy the data into one"));
    }
    Ok((file, meta.len()))
}

/// The bytes of all samples, in the order of the array.
pub(super) enum Bytes {
    /// In a file whose length has been checked, from byte `start` on; `path` is named in messages. `spooled` of its bytes
    /// were unpacked into it: it is a temporary one.
    File { file: File, path: PathBuf, start: u64, spooled: u64 },
    /// Unpacked.
    Memory(AlignedBytes),
    /// In images that are decoded as they are wanted, in this machine's byte order.
    Stack(Box<Stack>),
}

impl Bytes {
    /// Fills `out` from byte `offset` of the samples on.
    pub(super) fn read_at(&mut self, offset: u64, out: &mut [u8]) -> Result<()> {
        match self {
            Bytes::File { file, path, start, .. } => file
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
    /// Their order, and how many there are.
    pub layout: Layout,
}

/// A reader, and what it costs.
pub(super) struct Opened {
    /// Of all volumes.
    pub reader: Box<dyn SlabReader>,
    /// Whether it reads from a file, so that memory holds no more than is asked for.
    pub streamed: bool,
    /// Bytes in a temporary file.
    pub spooled: u64,
}

impl Payload {
    /// A slab reader in the forced type, the file's own, or the one that holds every value.
    ///
    /// # Errors
    /// See [`narrow::choose`].
    pub(super) fn open(self, path: &Path, forced: Option<SampleType>) -> Result<Opened> {
        let Payload { mut bytes, mut stored, layout } = self;
        let target = narrow::choose(path, &mut bytes, stored, &layout, forced)?;
        let streamed = !matches!(bytes, Bytes::Memory(_));
        let spooled = if let Bytes::File { spooled, .. } = &bytes { *spooled } else { 0 };
        let native = stored.kind.native() == Some(target);
        let reader: Box<dyn SlabReader> = match bytes {
            Bytes::Memory(mut memory) if native => {
                to_native(stored, memory.as_mut_slice());
                stored.big_endian = cfg!(target_endian = "big");
                if layout.is_single() && layout.is_dense() {
                    Box::new(Grid::from_aligned(layout.extent, target, memory)?)
                } else {
                    Box::new(Slabs::new(Bytes::Memory(memory), stored, layout, target))
                }
            }
            bytes => Box::new(Slabs::new(bytes, stored, layout, target)),
        };
        Ok(Opened { reader, streamed, spooled })
    }
}
