//! The file is the one canonical encoding of its content: written again, it has the same bytes (spec chapter 9).

use super::load::fetch;
use super::{Read, Strict};
use crate::container::assemble::{Assembled, Tables};
use crate::container::layout::payload_start;
use crate::container::section::{self, ENTRY_BYTES};
use crate::container::superblock::SUPERBLOCK_BYTES;
use crate::container::write::Placed;
use crate::container::{FinishOptions, GUARD_BYTES, NodeFlags, SectionEntry, Superblock};
use crate::error::{Code, Error, Result};

impl Strict {
    /// Assembles the tables anew and compares (spec: VAL-11).
    pub(super) fn check_canonical(&mut self, read: &mut Read<'_>) {
        let checked = self.compare(read);
        self.keep(checked);
    }

    // spec: VAL-11, SEC-15, SEC-16, SEC-17, HDR-7, HDR-11, BRK-8, BRK-10, VAL-5
    fn compare(&mut self, read: &mut Read<'_>) -> Result<()> {
        let order: Vec<Placed> = self
            .bricks
            .iter()
            .map(|b| Placed { ordinal: b.ordinal, slot: b.slot, tree: b.tree, level: b.level, brick: b.brick })
            .collect();
        let b = &self.head.superblock;
        let options = FinishOptions {
            meta: None,
            times: self.times.take(),
            file_id: Some(b.file_id),
            optional: b.optional,
            feature_names: self.head.feature_names.clone(),
            codebooks: self.codebooks.take().map(|s| (s.bytes, s.entry.item_count)),
            extra: std::mem::take(&mut self.others),
        };
        let tables = Tables::new(b.clone(), &self.nodes, &order, &self.head.descriptor, options)?;
        let plan = tables.plan_head();
        let end = self.check_places(plan.bricks)?;
        let wanted = tables.assemble(&self.nodes, &plan, end)?;
        self.compare_superblock(&wanted)?;
        self.compare_table(&wanted)?;
        self.compare_bytes(0, &wanted.head, read)?;
        self.compare_bytes(end, &wanted.tail, read)
    }

    /// Every brick lies as close behind the one before as alignment allows (spec: BRK-3). Returns the end of `BRIK`.
    fn check_places(&self, start: u64) -> Result<u64> {
        let found = self.head.section_range(section::BRIK);
        let mut end = start;
        for b in &self.bricks {
            let codec = &self.head.descriptor.codecs[usize::from(b.node.codec)];
            let offset = payload_start(end, codec.payload_align_log2(b.node.flags.contains(NodeFlags::ZSTD)));
            if b.node.offset != offset {
                let message = format!("the payload lies at {}, its canonical place is {offset}", b.node.offset);
                return Err(Error::at(Code::Canon, b.node.offset, "node.offset", message));
            }
            end = offset + u64::from(b.node.stored_len) + GUARD_BYTES;
        }
        if found != (start..end) {
            let message = format!("BRIK is {found:?}, its canonical place is {:?}", start..end);
            return Err(Error::at(Code::Canon, found.start, "section.offset", message));
        }
        Ok(end)
    }

    fn compare_superblock(&self, wanted: &Assembled) -> Result<()> {
        let (found, wanted) = (&self.head.superblock, Superblock::read_from(&wanted.head)?);
        let differ = |at, field, what: String| Err(Error::at(Code::Canon, at, field, what));
        if found.required != wanted.required {
            return differ(
                48,
                "superblock.required",
                format!("{:#x} instead of {:#x}", found.required, wanted.required),
            );
        }
        if found.optional != wanted.optional {
            return differ(
                64,
                "superblock.optional",
                format!("{:#x} instead of {:#x}", found.optional, wanted.optional),
            );
        }
        if found.clustered != wanted.clustered {
            return differ(73, "superblock.clustered", "the flag contradicts the order of the bricks".into());
        }
        if found.resource_level != wanted.resource_level {
            let (a, b) = (found.resource_level, wanted.resource_level);
            return differ(74, "superblock.resource_level", format!("{a} instead of {b}"));
        }
        if found.file_len != wanted.file_len {
            let (a, b) = (found.file_len, wanted.file_len);
            return differ(40, "superblock.file_length", format!("{a} bytes instead of {b}"));
        }
        Ok(())
    }

    fn compare_table(&self, wanted: &Assembled) -> Result<()> {
        let entries = wanted.head[SUPERBLOCK_BYTES..].chunks_exact(ENTRY_BYTES);
        let at = (self.head.superblock.section_table_offset..).step_by(ENTRY_BYTES);
        for ((found, bytes), at) in self.head.sections.iter().zip(entries).zip(at) {
            let wanted = SectionEntry::read_from(bytes, at)?;
            if *found != wanted {
                let message = format!("{found:?} instead of {wanted:?}");
                return Err(Error::at(Code::Canon, at, "section", message));
            }
        }
        Ok(())
    }

    pub(super) fn compare_bytes(&self, offset: u64, wanted: &[u8], read: &mut Read<'_>) -> Result<()> {
        if wanted.is_empty() {
            return Ok(());
        }
        let found = fetch(&self.head, offset, wanted.len() as u64, read)?;
        match found.iter().zip(wanted).position(|(a, b)| a != b) {
            None => Ok(()),
            Some(i) => {
                let message = format!("{:#04x} instead of {:#04x}: not the canonical encoding", found[i], wanted[i]);
                Err(Error::at(Code::Canon, offset + i as u64, "file", message))
            }
        }
    }
}
