//! What an editor takes over from a file besides its volume (spec chapters 3 and 11).

use super::features::KNOWN_READ_OPTIONAL;
use super::section::{self, ExtraSection, SectionEntry, SectionFlags};
use super::strict::Read;
use super::{FinishOptions, Head, check_meta, features, parse_times};
use crate::error::{Code, Error, Result};
use crate::limits::{self, Limits};
use crate::supercompression;

/// Metadata, times, codebooks, COPY_SAFE sections, optional features and their names, as a writer wants them. The file id
/// is not taken over. `read` delivers what opening has not read.
///
/// # Errors
/// `E_FEATURE` where an editor must know a feature that this one does not (spec: VER-3); `E_SECTION_CRC`, `E_ZSTD` and
/// what else is wrong with a section; `E_LIMIT`, `E_SOURCE`.
pub fn kept_options(head: &Head, limits: &Limits, read: &mut Read<'_>) -> Result<FinishOptions> {
    check_editable(head)?;
    let mut options = FinishOptions {
        optional: head.superblock.optional,
        feature_names: head.feature_names.clone(),
        ..FinishOptions::default()
    };
    for entry in &head.sections {
        keep_section(head, entry, &mut options, limits, read)?;
    }
    Ok(options)
}

/// Takes over one section, if it is one that an editor takes over.
pub(super) fn keep_section(
    head: &Head,
    entry: &SectionEntry,
    options: &mut FinishOptions,
    limits: &Limits,
    read: &mut Read<'_>,
) -> Result<()> {
    let own = [section::VOLD, section::PDIR, section::PAGE, section::BRIK].contains(&entry.fourcc);
    let known = [section::META, section::TIME, section::CBOK, section::FNAM].contains(&entry.fourcc);
    // spec: SEC-11
    if own || (!known && !entry.flags.contains(SectionFlags::COPY_SAFE)) {
        return Ok(());
    }
    let bytes = fetch(head, entry.offset, entry.stored_len, limits.table_bytes, read)?;
    entry.check_crc(&bytes)?;
    match entry.fourcc {
        section::META => {
            let text = if entry.supercompression == 0 {
                bytes
            } else {
                supercompression::inflate(&bytes, entry.decoded_len..=entry.decoded_len, entry.offset, "META")?
            };
            check_meta(&text, entry.offset)?;
            options.meta = Some(text);
        }
        section::TIME => options.times = Some(parse_times(&bytes, entry.offset, head.descriptor.time_steps)?),
        section::CBOK => options.codebooks = Some((bytes, entry.item_count)),
        section::FNAM => options.feature_names = features::read_from(&bytes, entry.offset)?,
        _ => options.extra.push(ExtraSection { entry: entry.clone(), bytes }),
    }
    Ok(())
}

/// Whether this editor knows all that one must know of the file (spec: VER-3).
///
/// # Errors
/// `E_FEATURE`.
pub(super) fn check_editable(head: &Head) -> Result<()> {
    let unknown = head.superblock.read_optional & !KNOWN_READ_OPTIONAL;
    if unknown == 0 {
        return Ok(());
    }
    let bit = unknown.trailing_zeros();
    let message = format!("feature bit {bit} is optional to read only, and this editor does not know it");
    Err(Error::at(Code::Feature, 56, "superblock.read_optional", message))
}

/// Bytes of the file: those that opening has read, else read now, if they are not more than `most`.
pub(super) fn fetch(head: &Head, offset: u64, len: u64, most: u64, read: &mut Read<'_>) -> Result<Vec<u8>> {
    if let Some(bytes) = head.resident(offset, len) {
        return Ok(bytes.to_vec());
    }
    limits::check("section.stored_length", len, most)?;
    let len = usize::try_from(len)
        .map_err(|_| Error::at(Code::Limit, offset, "file", "the table does not fit this machine's address space"))?;
    read(offset, len)
}
