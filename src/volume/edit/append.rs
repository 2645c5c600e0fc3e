//! Appending time steps to a log: new records and a commit behind the old ones, which stay as they are.

use super::CopyReport;
use super::copy::{Copied, Copier};
use super::steps::{Plan, fitting};
use crate::container::{BrickSink, LEADER_BYTES, LogWriter, VolumeDescriptor, find_leaders};
use crate::error::{Code, Error, Result};
use crate::limits::{self, Limits};
use crate::source::FileSource;
use crate::time::Times;
use crate::volume::encode::Progress;
use crate::volume::{CopyOptions, Volume};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Bytes searched for leaders at a time.
const SCAN_BYTES: usize = 4 << 20;

/// A log file that is open for appending; nobody else can append to it meanwhile.
///
/// ```no_run
/// use vug::volume::{Appender, Volume};
/// let mut log = Appender::open("series.vug")?;
/// let step = Volume::open_path("step17.vug")?; // of the same shape, encoded with `log.volume().encode_options()`
/// log.append(&step, None, &mut |_, _| {})?;
/// assert!(log.volume().info().time_steps >= 2);
/// # Ok::<(), vug::Error>(())
/// ```
pub struct Appender {
    file: File,
    path: PathBuf,
    volume: Volume,
    cut: u64,
    commit_every: u64,
}

impl Appender {
    /// Opens and locks a log. Bytes behind its last commit are what a killed writer left; they are cut off by the first
    /// append (`vug recover` can save finished bricks from them before).
    ///
    /// # Errors
    /// `E_PARAM` where the file has the head layout; `E_SOURCE` where it cannot be written or another process appends
    /// to it; those of [`Volume::open`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref().to_owned();
        let fail = |e| Error::io(path.display(), e);
        let file = OpenOptions::new().read(true).write(true).open(&path).map_err(fail)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let message = format!("another process is appending to {}; wait until it is done", path.display());
                return Err(Error::new(Code::Source, "path", message));
            }
            Err(TryLockError::Error(e)) => return Err(fail(e)),
        }
        let volume = open(&file, &path)?;
        let Some(commit) = volume.head.commit else {
            let message = format!(
                "{} is complete from its head on and cannot grow; make a log of it (`vug pack --log {0} LOG`) and append to that",
                path.display()
            );
            return Err(Error::param("layout", message));
        };
        let cut = volume.file_len().saturating_sub(commit.end);
        Ok(Appender { file, path, volume, cut, commit_every: limits::LOG_COMMIT_BYTES })
    }

    /// The log as its last commit has it.
    #[must_use]
    pub fn volume(&self) -> &Volume {
        &self.volume
    }

    /// How many bytes of a step are written before the old commit is written again: 64 MiB, and never more.
    pub fn commit_every(&mut self, bytes: u64) {
        self.commit_every = bytes;
    }

    /// Bytes behind the last commit, which the next append cuts off.
    #[must_use]
    pub fn unfinished_bytes(&self) -> u64 {
        self.cut
    }

    /// Finished bricks behind the last commit that belong to time steps the log has: `vug recover` would save them, the
    /// next append cuts them off. Those of an append that was killed are not counted: their step is not there.
    ///
    /// # Errors
    /// `E_SOURCE`.
    pub fn unfinished_bricks(&self) -> Result<u64> {
        let Some(commit) = self.volume.head.commit else { return Ok(0) };
        let (mut at, end, mut found) = (commit.end, self.volume.file_len(), 0);
        while at < end {
            let len = usize::try_from(end - at).map_or(SCAN_BYTES, |left| left.min(SCAN_BYTES));
            let bytes = self.volume.source.read(at, len)?;
            for (place, leader) in find_leaders(&bytes, at, &self.volume.head.superblock.file_id) {
                let next = place.saturating_add(LEADER_BYTES as u64).saturating_add(u64::from(leader.stored_len));
                found += u64::from(leader.tree < self.volume.info().trees() && next <= end);
            }
            // Windows overlap by a leader, so that none is cut in two, and none is seen twice.
            at += if len < SCAN_BYTES { len } else { SCAN_BYTES - (LEADER_BYTES - 16) } as u64;
        }
        Ok(found)
    }

    /// Appends all time steps of `steps`: a volume of the same dims, sample type, channels, levels, down-sampling, bricks
    /// and null value. Its bricks are copied as they are stored; codec entries and codebooks that the log does not have
    /// are added to it: a step that was encoded by itself with zerobit mostly has codebooks of its own, of which a file can
    /// have 4,096; those that the log has already are not added again. `times` are those of the new steps, where the log has times.
    ///
    /// The old steps stay valid until the commit is whole: it is written when all else is on disk, and on disk itself when
    /// this returns. If this fails, the log is what it was. If the process is killed, the log still opens with its old
    /// steps: every 64 MiB of a long step the old commit is written again, since readers look for it near the end.
    ///
    /// # Errors
    /// `E_PARAM` where the volumes or times do not fit, `E_LIMIT` for too many steps, codecs or codebooks (begin
    /// another log then); those of copying; `E_SOURCE`.
    pub fn append(&mut self, steps: &Volume, times: Option<Times>, progress: &mut Progress<'_>) -> Result<CopyReport> {
        let fail = |e| Error::io(self.path.display(), e);
        let end = self.volume.head.commit.map_or(0, |c| c.end);
        let plan = fitting(&self.volume, steps, times)?;
        self.file.set_len(end).map_err(fail)?;
        let written = self.write(steps, plan, end, progress);
        if written.is_err() {
            // A dead tail would hurt nobody; still, the file is to be what it was.
            let _ = self.file.set_len(end);
        }
        let report = written?;
        self.volume = open(&self.file, &self.path)?;
        self.cut = 0;
        Ok(report)
    }

    fn write(&self, steps: &Volume, plan: Plan, end: u64, progress: &mut Progress<'_>) -> Result<CopyReport> {
        let fail = |e| Error::io(self.path.display(), e);
        let mut file = self.file.try_clone().map_err(fail)?;
        file.seek(SeekFrom::Start(end)).map_err(fail)?;
        let log = &self.volume;
        let mut read = |offset, len| log.source.read(offset, len).map(std::borrow::Cow::into_owned);
        let mut sink = LogWriter::resume(Synced(file), &log.head, &plan.descriptor, &mut read)?;
        sink.commit_every(self.commit_every);
        let excerpt = steps.excerpt(&CopyOptions::default())?;
        let mut items = excerpt.items()?;
        for item in &mut items {
            item.to.0 += log.info().trees();
        }
        let books_there = plan.options.codebooks.as_ref().map_or(0, |(_, count)| *count);
        let copier =
            Copier { books: plan.books, books_there, codecs: plan.codecs, ..Copier::new(steps, excerpt.zstd, false) };
        let Copied { payload_bytes, converted, .. } = copier.run(&items, &mut sink, progress, &mut |_, _| Ok(()))?;
        let all = plan.descriptor.payload_bytes.saturating_add(payload_bytes);
        let descriptor = VolumeDescriptor { payload_bytes: all, ..plan.descriptor };
        let (_, file) = sink.finish(&descriptor, plan.options)?;
        Ok(CopyReport { file, payload_bytes, converted })
    }
}

fn open(file: &File, path: &Path) -> Result<Volume> {
    let handle = file.try_clone().map_err(|e| Error::io(path.display(), e))?;
    Volume::open(FileSource::from_file(handle, path)?, Limits::default())
}

/// A file that is on disk after each flush: [`LogWriter`] flushes before a commit and after it.
struct Synced(File);

impl Write for Synced {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.0.sync_all()
    }
}
