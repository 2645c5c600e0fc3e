//! A source that counts what is read from it: the costs of spec chapter 9 are asserted as counts.

use crate::error::{Code, Error, Result};
use crate::source::ByteSource;
use std::borrow::Cow;
use std::sync::atomic::{AtomicU64, Ordering};

/// Reads and bytes since the volume was opened or [`Volume::reset_cost`](super::Volume::reset_cost) was called.
///
/// A range that lies in memory or in a map counts as one read when it is first touched, as it would over a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Ranges read.
    pub reads: u64,
    /// Bytes read.
    pub bytes: u64,
}

pub(super) struct Counted {
    source: Box<dyn ByteSource>,
    reads: AtomicU64,
    bytes: AtomicU64,
}

impl Counted {
    pub(super) fn new(source: Box<dyn ByteSource>) -> Self {
        Counted { source, reads: AtomicU64::new(0), bytes: AtomicU64::new(0) }
    }

    pub(super) fn len(&self) -> u64 {
        self.source.len()
    }

    /// All bytes, if they lie in memory.
    #[inline]
    pub(super) fn as_slice(&self) -> Option<&[u8]> {
        self.source.as_slice()
    }

    /// Bytes `offset..offset + len`: borrowed where they lie in memory, else one read.
    pub(super) fn read(&self, offset: u64, len: usize) -> Result<Cow<'_, [u8]>> {
        self.count(len);
        if let Some(all) = self.source.as_slice() {
            let start = usize::try_from(offset).ok();
            let range = start.and_then(|s| all.get(s..s.checked_add(len)?));
            return range.map(Cow::Borrowed).ok_or_else(|| self.short(offset, len));
        }
        let mut out = self.buffer(offset, len)?;
        self.source.read_at(offset, &mut out)?;
        Ok(Cow::Owned(out))
    }

    /// As [`Counted::read`], into memory that is there.
    pub(super) fn read_into(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        self.count(out.len());
        self.source.read_at(offset, out)
    }

    /// As [`Counted::read`], for many ranges: side by side where the source is far away.
    pub(super) fn read_many(&self, ranges: &[(u64, usize)]) -> Result<Vec<Cow<'_, [u8]>>> {
        if self.source.as_slice().is_some() || ranges.len() < 2 {
            return ranges.iter().map(|&(offset, len)| self.read(offset, len)).collect();
        }
        let mut buffers = ranges.iter().map(|&(offset, len)| self.buffer(offset, len)).collect::<Result<Vec<_>>>()?;
        ranges.iter().for_each(|&(_, len)| self.count(len));
        let mut parts: Vec<(u64, &mut [u8])> =
            ranges.iter().zip(&mut buffers).map(|(&(offset, _), buffer)| (offset, buffer.as_mut_slice())).collect();
        self.source.read_many(&mut parts)?;
        Ok(buffers.into_iter().map(Cow::Owned).collect())
    }

    /// Bytes of the file as it is now, not as the source has kept them: one read.
    pub(super) fn read_fresh(&self, offset: u64, len: usize) -> Result<Vec<u8>> {
        self.count(len);
        let mut out = self.buffer(offset, len)?;
        self.source.read_fresh(offset, &mut out)?;
        Ok(out)
    }

    /// How many ranges are best read at the same time.
    pub(super) fn connections(&self) -> usize {
        self.source.connections()
    }

    /// Memory for bytes that the source has: the length is checked before the memory is asked for.
    fn buffer(&self, offset: u64, len: usize) -> Result<Vec<u8>> {
        if offset.checked_add(len as u64).is_none_or(|end| end > self.source.len()) {
            return Err(self.short(offset, len));
        }
        let mut out = Vec::new();
        out.try_reserve_exact(len)
            .map_err(|_| Error::at(Code::Limit, offset, "memory", format!("{len} bytes cannot be allocated")))?;
        out.resize(len, 0);
        Ok(out)
    }

    fn short(&self, offset: u64, len: usize) -> Error {
        let end = self.source.len();
        Error::at(Code::Truncated, offset, "file", format!("{len} bytes wanted, but the file ends at byte {end}"))
    }

    fn count(&self, len: usize) {
        self.reads.fetch_add(1, Ordering::Relaxed);
        self.bytes.fetch_add(len as u64, Ordering::Relaxed);
    }

    pub(super) fn cost(&self) -> Cost {
        Cost { reads: self.reads.load(Ordering::Relaxed), bytes: self.bytes.load(Ordering::Relaxed) }
    }

    pub(super) fn reset(&self) {
        self.reads.store(0, Ordering::Relaxed);
        self.bytes.store(0, Ordering::Relaxed);
    }
}
