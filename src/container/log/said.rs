//! What the last commit of a log says, kept so that it can be said again: whoever opens the file looks for it near the end
//! (spec chapter 15).

use super::super::directory::ChunkRef;
use super::super::features::FeatureName;
use super::super::section::{self, SectionEntry};
use super::super::superblock::Superblock;
use super::super::{Head, VolumeDescriptor};
use super::commit::{CommitParts, FIRST_RECORD};
use super::write::Ident;

/// All that a commit says, wherever it lies.
pub(super) struct Said {
    pub(super) superblock: Superblock,
    pub(super) descriptor: VolumeDescriptor,
    pub(super) names: Vec<FeatureName>,
    pub(super) refs: Vec<ChunkRef>,
    pub(super) pages: u64,
    pub(super) stored: u64,
    pub(super) sections: Vec<SectionEntry>,
}

impl Said {
    /// What the commit said that opened a log.
    pub(super) fn of(head: &Head) -> Self {
        let own = [section::VOLD, section::FNAM, section::PDIR, section::PAGE, section::BRIK];
        let count = |fourcc| head.section(fourcc).map_or(0, |s| s.item_count);
        Said {
            superblock: head.superblock.clone(),
            descriptor: head.descriptor.clone(),
            names: head.feature_names.clone(),
            refs: head.directory.clone(),
            pages: count(section::PAGE),
            stored: count(section::BRIK),
            sections: head.sections.iter().filter(|s| !own.contains(&s.fourcc)).cloned().collect(),
        }
    }

    fn parts(&self) -> CommitParts<'_> {
        CommitParts {
            superblock: self.superblock.clone(),
            descriptor: &self.descriptor,
            names: &self.names,
            refs: &self.refs,
            pages: self.pages,
            stored: self.stored,
            sections: &self.sections,
        }
    }

    /// The record of a commit that says it, leader included.
    pub(super) fn write_to(&self, at: u64, generation: u64) -> Vec<u8> {
        self.parts().write_to(at, generation)
    }

    /// The same for all commits that say the same.
    pub(super) fn ident(&self) -> Ident {
        *blake3::hash(&self.write_to(FIRST_RECORD, 0)).as_bytes()
    }
}
