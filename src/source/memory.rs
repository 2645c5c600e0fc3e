//! A source in memory.

use super::{ByteSource, slice_range};
use crate::error::Result;

/// Bytes in memory: a `Vec<u8>`, a `&[u8]`, an `Arc<[u8]>`, …
pub struct MemorySource<B>(pub B);

impl<B: AsRef<[u8]> + Send + Sync> ByteSource for MemorySource<B> {
    fn len(&self) -> u64 {
        self.0.as_ref().len() as u64
    }
    fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        out.copy_from_slice(slice_range(self.0.as_ref(), offset, out.len())?);
        Ok(())
    }
    fn as_slice(&self) -> Option<&[u8]> {
        Some(self.0.as_ref())
    }
}
