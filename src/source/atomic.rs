//! Files that appear whole or not at all: written under a temporary name beside the destination, synced, renamed.

use crate::error::{Code, Error, Result};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Ending of temporary names: `.NAME.PID-N.vug-tmp` in the destination's folder.
pub const TEMPORARY_SUFFIX: &str = ".vug-tmp";

/// A file being written. The destination's name changes only in [`AtomicFile::commit`].
///
/// The temporary file is locked as long as its writer lives; the operating system lets go of the lock when the
/// process ends, however it ends. A temporary without a lock is therefore a dead one, and the next writer of the same
/// destination removes it.
pub struct AtomicFile {
    /// `None` once it has been parked.
    file: Option<File>,
    temporary: PathBuf,
    destination: PathBuf,
    overwrite: bool,
    committed: bool,
}

impl AtomicFile {
    /// Starts writing what will become `destination`.
    ///
    /// # Errors
    /// `E_PARAM` where the destination exists and `overwrite` is false; `E_SOURCE` where it is not a regular file or its
    /// folder cannot be written.
    pub fn create(destination: impl AsRef<Path>, overwrite: bool) -> Result<Self> {
        let destination = resolve(destination.as_ref())?;
        check_destination(&destination, overwrite)?;
        let (folder, name) = split(&destination)?;
        remove_stale(&folder, &name);
        for attempt in 0..1000 {
            let temporary = folder.join(format!(".{name}.{}-{attempt}{TEMPORARY_SUFFIX}", std::process::id()));
            let mut options = OpenOptions::new();
            let file = match options.read(true).write(true).create_new(true).open(&temporary) {
                Ok(file) => file,
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => continue,
                Err(e) => return Err(Error::io(format!("cannot write in {}", folder.display()), e)),
            };
            // Between creation and lock another writer may have taken it for a dead one and removed it: then try again.
            if file.try_lock().is_ok() && temporary.exists() {
                return Ok(AtomicFile { file: Some(file), temporary, destination, overwrite, committed: false });
            }
        }
        Err(Error::new(Code::Source, "path", format!("no free temporary name beside {}", destination.display())))
    }

    /// Whether `destination` may be written at all; asked before the work is done whose result it is to hold.
    ///
    /// # Errors
    /// As [`AtomicFile::create`].
    pub fn check(destination: impl AsRef<Path>, overwrite: bool) -> Result<()> {
        check_destination(&resolve(destination.as_ref())?, overwrite)
    }

    /// The file's bytes are on disk and the file is closed when this returns; all that is left to do is to commit it. For
    /// those who write more files than a process may hold open. It is no longer locked, so another writer of the same
    /// destination may take it for a dead one; committing it then fails.
    ///
    /// # Errors
    /// `E_SOURCE`.
    pub fn park(&mut self) -> Result<()> {
        let fail = |e| Error::io(format!("cannot write {}", self.destination.display()), e);
        if let Some(mut file) = self.file.take() {
            file.flush().map_err(fail)?;
            file.sync_all().map_err(fail)?;
        }
        Ok(())
    }

    fn open(&mut self) -> io::Result<&mut File> {
        self.file.as_mut().ok_or_else(|| io::Error::other("the file is closed"))
    }

    /// The file's bytes are on disk and under the destination's name when this returns.
    ///
    /// # Errors
    /// `E_SOURCE`, or `E_PARAM` where the name was taken meanwhile; the destination is then what it was before.
    pub fn commit(mut self) -> Result<()> {
        self.publish()
    }

    /// As [`AtomicFile::commit`], but the file stays open, and locked, for more to be written.
    ///
    /// # Errors
    /// As [`AtomicFile::commit`]; `E_SOURCE` where it has been parked.
    pub fn commit_open(mut self) -> Result<File> {
        self.publish()?;
        let closed = || Error::new(Code::Source, "path", "the file is closed");
        self.file.take().ok_or_else(closed)
    }

    fn publish(&mut self) -> Result<()> {
        let fail = |e| Error::io(format!("cannot write {}", self.destination.display()), e);
        if let Some(file) = &mut self.file {
            file.flush().map_err(fail)?;
            file.sync_all().map_err(fail)?;
        }
        if self.overwrite {
            fs::rename(&self.temporary, &self.destination).map_err(fail)?;
        } else {
            // A link fails where the name has been taken in the meantime; a rename would replace it.
            match fs::hard_link(&self.temporary, &self.destination) {
                Ok(()) => fs::remove_file(&self.temporary).map_err(fail)?,
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => return Err(exists(&self.destination)),
                // Not every file system knows links.
                Err(_) => fs::rename(&self.temporary, &self.destination).map_err(fail)?,
            }
        }
        self.committed = true;
        // The new name itself must survive a power cut, too. Folders cannot be opened everywhere: best effort.
        if let Ok(folder) = File::open(folder_of(&self.destination)) {
            let _ = folder.sync_all();
        }
        Ok(())
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if !self.committed {
            let _ = fs::remove_file(&self.temporary);
        }
    }
}

impl Write for AtomicFile {
    fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
        self.open()?.write(buf)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.file.as_mut().map_or(Ok(()), File::flush)
    }
}

impl Read for AtomicFile {
    fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
        self.open()?.read(buf)
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, pos: SeekFrom) -> io::Result<u64> {
        self.open()?.seek(pos)
    }
}

/// Follows a link at the destination, so that the link stays and its target is replaced.
fn resolve(path: &Path) -> Result<PathBuf> {
    match fs::symlink_metadata(path) {
        Ok(meta) if meta.is_symlink() => fs::canonicalize(path).map_err(|e| Error::io(path.display(), e)),
        _ => Ok(path.to_owned()),
    }
}

fn check_destination(path: &Path, overwrite: bool) -> Result<()> {
    match fs::metadata(path) {
        Ok(meta) if !meta.is_file() => {
            Err(Error::new(Code::Source, "path", format!("{} is not a regular file", path.display())))
        }
        Ok(_) if !overwrite => Err(exists(path)),
        _ => Ok(()),
    }
}

fn exists(path: &Path) -> Error {
    Error::param("path", format!("{} exists; choose another name, or allow overwriting (--force)", path.display()))
}

/// The folder that a file lies in; a bare name lies in the current one.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn split(path: &Path) -> Result<(PathBuf, String)> {
    let name = path
        .file_name()
        .ok_or_else(|| Error::new(Code::Source, "path", format!("{} names no file", path.display())))?;
    let folder = folder_of(path);
    // File systems take 255 bytes: a long name is shortened, the temporary one has more to say.
    let mut name = name.to_string_lossy().into_owned();
    while name.len() > 200 {
        name.pop();
    }
    Ok((folder.to_owned(), name))
}

/// Removes what dead writers of the same destination have left. Failure to do so harms nobody.
fn remove_stale(folder: &Path, name: &str) {
    let prefix = format!(".{name}.");
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let found = entry.file_name();
        let found = found.to_string_lossy();
        let Some(middle) = found.strip_prefix(&prefix).and_then(|rest| rest.strip_suffix(TEMPORARY_SUFFIX)) else {
            continue;
        };
        // Exactly `PID-N`: a temporary of `NAME.more` has more before it.
        if !middle.bytes().all(|b| b.is_ascii_digit() || b == b'-') {
            continue;
        }
        if let Ok(file) = OpenOptions::new().write(true).open(entry.path()) {
            match file.try_lock() {
                Ok(()) => drop(fs::remove_file(entry.path())),
                Err(TryLockError::WouldBlock | TryLockError::Error(_)) => {}
            }
        }
    }
}
