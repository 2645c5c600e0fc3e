//! A source that reads a local file: the safe default.

use super::{ByteSource, check_range};
use crate::error::{Code, Error, Result};
use std::fs::File;
use std::path::{Path, PathBuf};

/// A local file, read with positioned reads: no shared cursor, so that threads do not wait for each other.
pub struct FileSource {
    file: File,
    len: u64,
    path: PathBuf,
}

impl FileSource {
    /// Opens a file.
    ///
    /// # Errors
    /// `E_SOURCE` where it cannot be opened or is a directory.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let file = File::open(path).map_err(|e| Error::io(path.display(), e))?;
        FileSource::from_file(file, path)
    }

    /// Takes a file that is open for reading, as long as it is now. `path` is what messages call it.
    ///
    /// # Errors
    /// `E_SOURCE` where its length cannot be asked for, or it is a directory.
    pub fn from_file(file: File, path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let fail = |e| Error::io(path.display(), e);
        let meta = file.metadata().map_err(fail)?;
        if meta.is_dir() {
            return Err(Error::new(Code::Source, "path", format!("{} is a directory", path.display())));
        }
        Ok(FileSource { file, len: meta.len(), path: path.to_owned() })
    }
}

impl ByteSource for FileSource {
    fn len(&self) -> u64 {
        self.len
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        check_range(offset, out.len(), self.len)?;
        read_exact_at(&self.file, out, offset).map_err(|e| {
            // The file was shortened after it was opened: say so as for any other missing byte.
            if e.kind() == std::io::ErrorKind::UnexpectedEof {
                Error::at(
                    Code::Truncated,
                    offset,
                    "file",
                    format!("{} became shorter while it was read", self.path.display()),
                )
            } else {
                Error::io(self.path.display(), e)
            }
        })
    }
}

#[cfg(unix)]
fn read_exact_at(file: &File, out: &mut [u8], offset: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, out, offset)
}

#[cfg(windows)]
fn read_exact_at(file: &File, mut out: &mut [u8], mut offset: u64) -> std::io::Result<()> {
    while !out.is_empty() {
        match std::os::windows::fs::FileExt::seek_read(file, out, offset)? {
            0 => return Err(std::io::ErrorKind::UnexpectedEof.into()),
            n => {
                out = &mut out[n..];
                offset += n as u64;
            }
        }
    }
    Ok(())
}
