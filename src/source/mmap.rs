//! A source that maps a file into memory.

use super::{ByteSource, slice_range};
use crate::error::{Error, Result};
use memmap2::Mmap;
use std::fs::File;
use std::path::Path;

/// A memory-mapped file: payloads are decoded, or handed to the GPU, straight from the page cache.
pub struct MmapSource(Mmap);

impl MmapSource {
    /// Maps a file.
    ///
    /// # Safety
    /// As long as the map lives, no process may shorten or rewrite the file: reading a page that was cut off ends the
    /// program with a signal, and rewritten bytes change under shared references (C-12). Files that Vug itself writes
    /// are replaced by renaming, which leaves an open map intact. Where that is not certain, use
    /// [`FileSource`](super::FileSource).
    ///
    /// # Errors
    /// `E_SOURCE` where the file cannot be opened or mapped.
    #[allow(unsafe_code, reason = "mapping a file is unsafe by nature; the contract is passed on to the caller")]
    pub unsafe fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let file = File::open(path).map_err(|e| Error::io(path.display(), e))?;
        // SAFETY: the caller promises that the file is neither shortened nor rewritten while the map lives.
        let map = unsafe { Mmap::map(&file) }.map_err(|e| Error::io(path.display(), e))?;
        Ok(MmapSource(map))
    }
}

impl ByteSource for MmapSource {
    fn len(&self) -> u64 {
        self.0.len() as u64
    }
    fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        out.copy_from_slice(slice_range(&self.0, offset, out.len())?);
        Ok(())
    }
    fn as_slice(&self) -> Option<&[u8]> {
        Some(&self.0)
    }
}
