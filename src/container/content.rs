//! The sections that are known as bytes before anything is placed: codebooks, times, metadata and what others define.

use super::scene::check_scene;
use super::section::{self, ExtraSection, FourCc, SectionEntry, SectionFlags, show};
use super::table::SECTION_VERSION;
use super::{check_meta, times};
use crate::checksum::crc32;
use crate::error::{Code, Error, Result};
use crate::limits;
use crate::supercompression;
use crate::time::Times;

/// The `CBOK` section. // spec: ZBT-34
pub(super) fn codebooks((bytes, count): (Vec<u8>, u64)) -> Result<ExtraSection> {
    if count == 0 {
        return Err(Error::param("codebooks", "a section of no codebooks is left out"));
    }
    limits::check("codebooks", count, limits::MAX_CODEBOOKS)?;
    let mut s = known(section::CBOK, SectionFlags::CRITICAL, bytes, 0, 0);
    s.entry.item_count = count;
    Ok(s)
}

/// TIME, META, SCNE and foreign sections in the order they have in a file (spec: SEC-15).
pub(super) fn others(
    times: Option<&Times>,
    meta: Option<Vec<u8>>,
    mut extra: Vec<ExtraSection>,
    time_steps: u32,
) -> Result<Vec<ExtraSection>> {
    if let Some(text) = meta {
        check_meta(&text, 0).map_err(|e| Error::new(e.code(), "meta", e.message().to_owned()))?;
        extra.push(compressed(text)?);
    }
    extra.sort_by_key(|s| (s.entry.fourcc != section::META, s.entry.fourcc));
    for (i, s) in extra.iter().enumerate() {
        let name = show(s.entry.fourcc);
        let own = section::is_critical(s.entry.fourcc) || [section::FNAM, section::TIME].contains(&s.entry.fourcc);
        if own || s.entry.flags.contains(SectionFlags::CRITICAL) {
            return Err(Error::param("section", format!("{name} is written by the container itself, or is CRITICAL")));
        }
        check_extra(s)?;
        if s.entry.fourcc == section::SCNE {
            check_scene(&s.bytes, 0)?;
        }
        if extra[..i].iter().any(|o| o.entry.fourcc == s.entry.fourcc) {
            return Err(Error::new(Code::Dup, "section", format!("section {name} is given twice")));
        }
    }
    if let Some(times) = times {
        times.check(time_steps)?;
        let bytes = times::write_to(times);
        extra.insert(0, known(section::TIME, SectionFlags::default(), bytes, times.steps.len(), times::STEP_BYTES));
    }
    Ok(extra)
}

/// A section that comes from outside must be one that a reader takes.
fn check_extra(s: &ExtraSection) -> Result<()> {
    let name = || show(s.entry.fourcc);
    let entry = SectionEntry { offset: 0, ..s.entry.clone() };
    SectionEntry::read_from(&entry.write_to(), 0)
        .and_then(|_| s.entry.check_crc(&s.bytes))
        .map_err(|e| Error::new(e.code(), format!("{} of {}", e.field().to_owned(), name()), e.message().to_owned()))?;
    if s.entry.stored_len != s.bytes.len() as u64 {
        return Err(Error::new(Code::Size, "section", format!("{}: stored length and bytes differ", name())));
    }
    Ok(())
}

/// The `META` section, compressed where that is smaller (spec: SEC-7).
fn compressed(text: Vec<u8>) -> Result<ExtraSection> {
    let decoded_len = text.len() as u64;
    let (bytes, supercompression) = match supercompression::compress(&text)? {
        Some(frame) => (frame, 1),
        None => (text, 0),
    };
    let mut s = known(section::META, SectionFlags::COPY_SAFE, bytes, 0, 0);
    (s.entry.decoded_len, s.entry.supercompression) = (decoded_len, supercompression);
    Ok(s)
}

pub(super) fn known(
    fourcc: FourCc,
    flags: SectionFlags,
    bytes: Vec<u8>,
    count: usize,
    item_size: usize,
) -> ExtraSection {
    let mut entry = items(fourcc, 0, bytes.len() as u64, count as u64, flags);
    entry.crc = crc32(&bytes);
    entry.item_size = u32::try_from(item_size).expect("at most 32");
    ExtraSection { entry, bytes }
}

pub(super) fn items(fourcc: FourCc, offset: u64, len: u64, item_count: u64, flags: SectionFlags) -> SectionEntry {
    SectionEntry {
        fourcc,
        version: SECTION_VERSION,
        flags,
        offset,
        stored_len: len,
        decoded_len: len,
        align_log2: 4,
        supercompression: 0,
        crc: 0,
        item_count,
        item_size: 0,
        owner: 0,
    }
}
