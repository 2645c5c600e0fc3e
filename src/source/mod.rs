//! Where bytes come from and go to: memory, files, memory maps, web servers, object stores; and files that appear whole or
//! not at all.
//!
//! A source knows nothing of the format. The container says which range it wants; a source delivers it.

mod atomic;
#[cfg(feature = "cloud")]
mod cloud;
mod file;
mod growing;
#[cfg(feature = "http")]
mod http;
mod memory;
mod mmap;
mod parallel;
mod url;

pub use atomic::AtomicFile;
#[cfg(feature = "cloud")]
pub use cloud::{CloudOptions, CloudSource};
pub use file::FileSource;
pub use growing::GrowingFile;
#[cfg(feature = "http")]
pub use http::{HttpOptions, HttpSource, Stopper};
pub use memory::MemorySource;
pub use mmap::MmapSource;
pub(crate) use parallel::side_by_side;
pub use url::{is_url, open_url};

use crate::error::{Code, Error, Result};

/// A file-like thing that can be read at any byte offset, by many threads at once.
pub trait ByteSource: Send + Sync {
    /// Length in bytes.
    fn len(&self) -> u64;

    /// Whether there is not a single byte.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Fills `out` from byte `offset` on.
    ///
    /// # Errors
    /// `E_TRUNCATED` where the range passes the end, `E_SOURCE` where the transport fails.
    fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()>;

    /// All bytes, where they lie in memory already: readers then copy nothing.
    fn as_slice(&self) -> Option<&[u8]> {
        None
    }

    /// Fills every part from its byte offset on; where the source is far away, several at the same time.
    ///
    /// # Errors
    /// As [`ByteSource::read_at`], for a part that failed; what the others then hold is not said.
    fn read_many(&self, parts: &mut [(u64, &mut [u8])]) -> Result<()> {
        side_by_side(self.connections(), parts.iter_mut(), |(offset, out)| self.read_at(*offset, out))
    }

    /// As [`ByteSource::read_at`], but from where the bytes really are, never from what the source has kept of them:
    /// this is how a file that was replaced is found out.
    ///
    /// # Errors
    /// As [`ByteSource::read_at`]; `E_REPLACED` where the source itself sees that the file is another one.
    fn read_fresh(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        self.read_at(offset, out)
    }

    /// How many ranges are best asked for at the same time. More than one says that waiting is most of the work: readers
    /// then fetch ahead while they decode.
    fn connections(&self) -> usize {
        1
    }
}

impl<S: ByteSource + ?Sized> ByteSource for Box<S> {
    fn len(&self) -> u64 {
        (**self).len()
    }
    fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        (**self).read_at(offset, out)
    }
    fn as_slice(&self) -> Option<&[u8]> {
        (**self).as_slice()
    }
    fn read_many(&self, parts: &mut [(u64, &mut [u8])]) -> Result<()> {
        (**self).read_many(parts)
    }
    fn read_fresh(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        (**self).read_fresh(offset, out)
    }
    fn connections(&self) -> usize {
        (**self).connections()
    }
}

/// Checks that `offset..offset + len` lies in a source of `source_len` bytes.
fn check_range(offset: u64, len: usize, source_len: u64) -> Result<()> {
    match offset.checked_add(len as u64) {
        Some(end) if end <= source_len => Ok(()),
        _ => Err(Error::at(
            Code::Truncated,
            offset,
            "file",
            format!("{len} bytes wanted, but the file ends at byte {source_len}; fetch the file again or use salvage"),
        )),
    }
}

/// Fills `out` from the bytes of a file's start, if all of it lies in them.
#[cfg(any(feature = "http", feature = "cloud"))]
fn fill_from(start: &[u8], offset: u64, out: &mut [u8]) -> bool {
    let part = usize::try_from(offset).ok().and_then(|from| start.get(from..from.checked_add(out.len())?));
    part.inspect(|bytes| out.copy_from_slice(bytes)).is_some()
}

/// The part of a slice that a read wants.
fn slice_range(bytes: &[u8], offset: u64, len: usize) -> Result<&[u8]> {
    check_range(offset, len, bytes.len() as u64)?;
    let start = usize::try_from(offset).expect("inside a slice");
    Ok(&bytes[start..start + len])
}

#[cfg(test)]
mod tests;
