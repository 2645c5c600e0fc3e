//! What a file holds besides its bricks, for the next file: codebooks, metadata, sections of others.

use crate::container::{ExtraSection, FinishOptions, SectionEntry, SectionFlags};
use crate::error::{Code, Error, Result};
use crate::limits;
use crate::volume::Volume;

/// Sections that a writer makes itself.
const OWN: [[u8; 4]; 7] = [*b"VOLD", *b"PDIR", *b"PAGE", *b"BRIK", *b"CBOK", *b"FNAM", *b"TIME"];

impl Volume {
    /// The stored bytes of a section, checked.
    ///
    /// # Errors
    /// `E_SECTION_CRC`, `E_REPLACED`, `E_LIMIT`, `E_SOURCE`.
    pub(super) fn section_bytes(&self, entry: &SectionEntry) -> Result<Vec<u8>> {
        limits::check("section.stored_length", entry.stored_len, self.limits.table_bytes)?;
        let len = usize::try_from(entry.stored_len).map_err(|_| {
            Error::at(Code::Limit, entry.offset, "section", "the section does not fit this machine's address space")
        })?;
        let bytes = match self.head.resident(entry.offset, entry.stored_len) {
            Some(bytes) => bytes.to_vec(),
            None => self.source.read(entry.offset, len)?.into_owned(),
        };
        entry.check_crc(&bytes).map_err(|e| self.replaced_or(e))?;
        Ok(bytes)
    }

    /// All that the next file is to say as this one does. Sections that this version does not know come along if they are
    /// COPY_SAFE (spec: SEC-11); optional features and their names do (spec: VER-3).
    ///
    /// # Errors
    /// `E_FEATURE` where an editor must know a feature that this one does not (spec: VER-3); those of damaged sections.
    pub(super) fn kept_sections(&self) -> Result<FinishOptions> {
        let superblock = &self.head.superblock;
        // This version knows no feature that is optional to read.
        if superblock.read_optional != 0 {
            let bit = superblock.read_optional.trailing_zeros();
            let message = format!("feature bit {bit} is optional to read only, and this editor does not know it");
            return Err(Error::at(Code::Feature, 56, "superblock.read_optional", message));
        }
        let codebooks = match self.head.section(*b"CBOK") {
            Some(entry) => Some((self.section_bytes(entry)?, entry.item_count)),
            None => None,
        };
        let safe = |s: &&SectionEntry| s.flags.contains(SectionFlags::COPY_SAFE) && !OWN.contains(&s.fourcc);
        let extra: Result<Vec<ExtraSection>> = self
            .head
            .sections
            .iter()
            .filter(safe)
            .map(|entry| Ok(ExtraSection { entry: entry.clone(), bytes: self.section_bytes(entry)? }))
            .collect();
        Ok(FinishOptions {
            optional: superblock.optional,
            feature_names: self.head.feature_names.clone(),
            codebooks,
            extra: extra?,
            ..FinishOptions::default()
        })
    }
}
