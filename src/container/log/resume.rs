//! Appending to a log: going on behind its last commit (spec chapter 15).

use super::super::directory::{CHUNK_PAGES, parse_chunk};
use super::super::kept::{check_editable, fetch};
use super::super::section::{self, ExtraSection};
use super::super::strict::Read;
use super::super::{Head, Octree, VolumeDescriptor};
use super::said::Said;
use super::write::{LogWriter, ident_of};
use crate::error::{Error, Result};
use crate::limits::MAX_TABLE_BYTES;
use std::io::Write;

impl<W: Write> LogWriter<W> {
    /// Goes on with the log that `head` opened and `read` delivers. `out` must stand at [`Commit::end`](super::Commit),
    /// with nothing behind it: the caller seeks, and cuts off what was not finished.
    ///
    /// Nothing is written until the first brick or commit; the old commit stays valid until the next one is whole. Bricks
    /// can be put into the time steps that `descriptor` has more than the file: older trees stay as they are. What the file
    /// has besides its volume is not taken over by itself: commits say all of it (see
    /// [`kept_options`](super::super::kept_options)). Memory: 48 bytes for each page that the file has.
    ///
    /// # Errors
    /// `E_PARAM` where the file is no log, or `descriptor` is of another volume; `E_FEATURE` where an editor must know a
    /// feature that this one does not (spec: VER-3); `E_DIR_CRC`, `E_SECTION_CRC` and what reading yields.
    pub fn resume(out: W, head: &Head, descriptor: &VolumeDescriptor, read: &mut Read<'_>) -> Result<Self> {
        let Some(commit) = head.commit else {
            let message =
                "the file has the head layout, which cannot be appended to; `vug pack --log` makes a log of it";
            return Err(Error::param("layout", message));
        };
        check_editable(head)?;
        let old = &head.descriptor;
        let octree = Octree::new(old)?;
        let mut writer = LogWriter::over(out, commit.end, head.superblock.clone(), old.clone(), octree);
        for chunk in &head.directory {
            let bytes = fetch(head, chunk.offset, chunk.byte_len() as u64, u64::MAX, read)?;
            let entries = parse_chunk(&bytes, chunk, head)?;
            let pages = (chunk.ordinal * CHUNK_PAGES..).zip(entries).filter(|(_, entry)| !entry.is_empty());
            writer.pages.extend(pages.map(|(ordinal, entry)| (ordinal, (entry, [0; 32]))));
            writer.chunks.insert(chunk.ordinal, *chunk);
        }
        let own = [section::VOLD, section::FNAM, section::PDIR, section::PAGE, section::BRIK];
        for entry in head.sections.iter().filter(|s| !own.contains(&s.fourcc)) {
            let bytes = fetch(head, entry.offset, entry.stored_len, MAX_TABLE_BYTES, read)?;
            entry.check_crc(&bytes)?;
            let s = ExtraSection { entry: entry.clone(), bytes };
            writer.sections.push((entry.clone(), ident_of(&s)));
        }
        writer.first_tree = old.trees();
        writer.generation = commit.generation.saturating_add(1);
        writer.stored = head.section(section::BRIK).map_or(0, |s| s.item_count);
        let said = Said::of(head);
        let ident = said.ident();
        writer.last = Some((said, ident, commit.end));
        writer.take_descriptor(descriptor)?;
        Ok(writer)
    }
}
