//! Samples that have to be kept whole: in memory, or above the caller's limit in a temporary file without a name.

use super::payload::Bytes;
use super::{ImportOptions, fault};
use crate::error::{Code, Error, Result};
use crate::grid::AlignedBytes;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Bytes that are written to a temporary file in one go.
const CHUNK_BYTES: usize = 256 << 10;

enum Kept {
    Memory(AlignedBytes),
    File(BufWriter<File>),
}

/// Takes a number of bytes that is known beforehand.
pub(super) struct Spool {
    kept: Kept,
    len: u64,
    filled: u64,
}

impl Spool {
    /// Room for `len` bytes of the file at `path`. Memory is taken zeroed in one piece: the operating system hands out its
    /// pages only as data really arrives. A temporary file grows with them.
    ///
    /// # Errors
    /// `E_LIMIT` above the caller's limit or what this machine can address, `E_SOURCE` where no temporary file can be made.
    pub(super) fn new(path: &Path, len: u64, options: &ImportOptions) -> Result<Spool> {
        if len > options.max_bytes {
            let max = options.max_bytes;
            let message = format!("{}: {len} unpacked bytes are above the limit of {max}", path.display());
            return Err(Error::new(Code::Limit, "sizes", message));
        }
        let kept = match usize::try_from(len) {
            Ok(len) if len as u64 <= options.memory => Kept::Memory(AlignedBytes::zeroed(len)?),
            _ => Kept::File(BufWriter::with_capacity(CHUNK_BYTES, temp_file(options)?)),
        };
        Ok(Spool { kept, len, filled: 0 })
    }

    /// Takes from `read` until all bytes are there or it delivers none. Returns how many are there.
    ///
    /// # Errors
    /// Those of `read`; `E_SOURCE` where the temporary file cannot be written.
    pub(super) fn fill(&mut self, mut read: impl FnMut(&mut [u8]) -> Result<usize>) -> Result<u64> {
        let mut chunk = match self.kept {
            Kept::Memory(_) => Vec::new(),
            Kept::File(_) => vec![0; CHUNK_BYTES],
        };
        while self.filled < self.len {
            let n = match &mut self.kept {
                Kept::Memory(memory) => read(&mut memory.as_mut_slice()[self.filled as usize..])?,
                Kept::File(file) => {
                    let room = (self.len - self.filled).min(CHUNK_BYTES as u64) as usize;
                    let n = read(&mut chunk[..room])?;
                    file.write_all(&chunk[..n]).map_err(|e| temp_error(&e))?;
                    n
                }
            };
            if n == 0 {
                break;
            }
            self.filled += n as u64;
        }
        Ok(self.filled)
    }

    /// Takes some more bytes.
    ///
    /// # Errors
    /// `E_SOURCE` where the temporary file cannot be written; `E_RANGE` for more bytes than there is room for.
    pub(super) fn put(&mut self, bytes: &[u8]) -> Result<()> {
        if self.filled + bytes.len() as u64 > self.len {
            return Err(Error::new(Code::Range, "data", format!("more than {} bytes", self.len)));
        }
        match &mut self.kept {
            Kept::Memory(memory) => memory.as_mut_slice()[self.filled as usize..][..bytes.len()].copy_from_slice(bytes),
            Kept::File(file) => file.write_all(bytes).map_err(|e| temp_error(&e))?,
        }
        self.filled += bytes.len() as u64;
        Ok(())
    }

    /// All bytes, to be read. `path` is named in messages.
    ///
    /// # Errors
    /// `E_SOURCE` where the temporary file cannot be written.
    pub(super) fn finish(self, path: &Path) -> Result<Bytes> {
        match self.kept {
            Kept::Memory(memory) => Ok(Bytes::Memory(memory)),
            Kept::File(file) => {
                let file = file.into_inner().map_err(|e| temp_error(e.error()))?;
                Ok(Bytes::File { file, path: path.to_owned(), start: 0, spooled: self.len })
            }
        }
    }
}

/// A file without a name that vanishes with the process.
fn temp_file(options: &ImportOptions) -> Result<File> {
    match &options.temp_dir {
        Some(folder) => tempfile::tempfile_in(folder).map_err(|e| fault::io(folder, e)),
        None => tempfile::tempfile().map_err(|e| fault::io(&std::env::temp_dir(), e)),
    }
}

fn temp_error(cause: &std::io::Error) -> Error {
    let message = format!("a temporary file could not be written ({cause}); choose another folder for temporary files");
    Error::new(Code::Source, "temporary file", message)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spooled(memory: u64, pieces: &[&[u8]]) -> (Vec<u8>, bool) {
        let options = ImportOptions { memory, ..ImportOptions::default() };
        let len: usize = pieces.iter().map(|p| p.len()).sum();
        let mut spool = Spool::new(Path::new("f"), len as u64, &options).unwrap();
        let mut rest = pieces.iter();
        spool.put(rest.next().unwrap()).unwrap();
        let filled = spool
            .fill(|out| {
                let Some(piece) = rest.next() else { return Ok(0) };
                out[..piece.len()].copy_from_slice(piece);
                Ok(piece.len())
            })
            .unwrap();
        assert_eq!(filled, len as u64);
        assert_eq!(spool.put(b"x").unwrap_err().code(), Code::Range);
        let mut bytes = spool.finish(Path::new("f")).unwrap();
        let mut out = vec![0; len];
        bytes.read_at(0, &mut out).unwrap();
        (out, matches!(bytes, Bytes::File { .. }))
    }

    #[test]
    fn memory_up_to_the_limit_and_a_file_above() {
        let pieces: [&[u8]; 3] = [b"abc", b"de", b"fghi"];
        assert_eq!(spooled(9, &pieces), (b"abcdefghi".to_vec(), false));
        assert_eq!(spooled(8, &pieces), (b"abcdefghi".to_vec(), true));
    }

    #[test]
    fn what_is_too_large_and_where_no_file_can_be() {
        let options = ImportOptions { max_bytes: 5, ..ImportOptions::default() };
        assert_eq!(Spool::new(Path::new("f"), 6, &options).err().unwrap().code(), Code::Limit);
        let nowhere = ImportOptions { memory: 0, temp_dir: Some("/no/such/folder".into()), ..ImportOptions::default() };
        let e = Spool::new(Path::new("f"), 6, &nowhere).err().unwrap();
        assert!(e.code() == Code::Source && e.message().contains("/no/such/folder"), "{e}");
    }
}
