//! A file that can be read while it grows: a log.

use super::AtomicFile;
use crate::error::{Code, Error, Result};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::Path;

/// Bytes from which on there is something to show. What fails earlier leaves the destination as it was.
const REVEALED_BYTES: u64 = 64 << 10;

/// A file that is written front to back and appears under its name at the first [`flush`](Write::flush) at which it holds
/// more than 64 KiB, or when it is [finished](GrowingFile::finish). Each flush brings it to disk. It is locked as long as
/// it is written.
pub struct GrowingFile {
    state: State,
    written: u64,
}

enum State {
    Hidden(AtomicFile),
    Shown(File),
    /// It could not be shown, and is gone.
    Lost,
}

impl GrowingFile {
    /// Starts writing what will become `destination`.
    ///
    /// # Errors
    /// As [`AtomicFile::create`]; `E_SOURCE` where another process is writing to the destination.
    pub fn create(destination: impl AsRef<Path>, overwrite: bool) -> Result<Self> {
        let path = destination.as_ref();
        let hidden = AtomicFile::create(path, overwrite)?;
        if let Ok(old) = OpenOptions::new().write(true).open(path)
            && let Err(TryLockError::WouldBlock) = old.try_lock()
        {
            let message = format!("another process is writing to {}; wait until it is done", path.display());
            return Err(Error::new(Code::Source, "path", message));
        }
        Ok(GrowingFile { state: State::Hidden(hidden), written: 0 })
    }

    /// Brings the file to disk, under its name.
    ///
    /// # Errors
    /// As [`AtomicFile::commit`].
    pub fn finish(mut self) -> Result<()> {
        self.show()?;
        self.flush().map_err(|e| Error::io("cannot write", e))
    }

    fn show(&mut self) -> Result<()> {
        self.state = match std::mem::replace(&mut self.state, State::Lost) {
            State::Hidden(file) => State::Shown(file.commit_open()?),
            other => other,
        };
        Ok(())
    }
}

fn lost() -> io::Error {
    io::Error::other("the file could not be given its name")
}

impl Write for GrowingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = match &mut self.state {
            State::Hidden(file) => file.write(bytes)?,
            State::Shown(file) => file.write(bytes)?,
            State::Lost => return Err(lost()),
        };
        self.written += n as u64;
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.written > REVEALED_BYTES {
            self.show().map_err(|e| io::Error::other(e.to_string()))?;
        }
        match &mut self.state {
            State::Hidden(file) => file.flush(),
            State::Shown(file) => file.sync_data(),
            State::Lost => Err(lost()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_appears_when_there_is_something_to_show() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.vug");
        std::fs::write(&path, "old").unwrap();
        assert_eq!(GrowingFile::create(&path, false).err().unwrap().code(), Code::Param);
        let mut file = GrowingFile::create(&path, true).unwrap();
        file.write_all(&[1; 1000]).unwrap();
        file.flush().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        file.write_all(&[2; 100_000]).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        file.flush().unwrap();
        assert_eq!(std::fs::read(&path).unwrap().len(), 101_000, "shown, and still written to");
        let busy = GrowingFile::create(&path, true).err().unwrap();
        assert!(busy.message().contains("another process"), "{busy}");
        file.write_all(b"end").unwrap();
        file.finish().unwrap();
        assert_eq!(std::fs::read(&path).unwrap().len(), 101_003);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary is left");
    }

    #[test]
    fn what_fails_early_leaves_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.vug");
        std::fs::write(&path, "old").unwrap();
        let mut file = GrowingFile::create(&path, true).unwrap();
        file.write_all(&[1; 70_000]).unwrap();
        drop(file);
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        let small = folder.path().join("small.vug");
        let mut file = GrowingFile::create(&small, false).unwrap();
        file.write_all(b"few").unwrap();
        file.finish().unwrap();
        assert_eq!(std::fs::read(&small).unwrap(), b"few");
    }
}
