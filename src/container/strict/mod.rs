//! Strict validation of a file's structure: everything that fast reading does not look at (spec chapter 9).
//!
//! Driven from outside, because payloads are not the container's business:
//!
//! 1. [`Strict::open`] reads head, directory, pages and sections.
//! 2. For each of [`Strict::bricks`]: read [`StoredBrick::window`], give it to [`Strict::check_brick`], decode the
//!    payload it returns, and report what it decodes to with [`Strict::set_bounds`] and [`Strict::set_payload_len`] (spec: VAL-12, VAL-13).
//! 3. [`Strict::finish`] checks bounds and child masks, padding, and that the file is the one canonical encoding; of a
//!    log, all records.

mod bounds;
mod bricks;
mod canon;
mod coverage;
mod load;
mod log;

pub use bricks::StoredBrick;
pub use coverage::Coverage;

use super::store::NodeStore;
use super::{ExtraSection, Head, PageEntry, SectionEntry};
use crate::error::{Error, Result};
use crate::limits::Limits;
use crate::time::Times;
use std::collections::BTreeMap;

/// Errors that are kept; a hostile file could have one per brick.
const MAX_ERRORS: usize = 1000;

/// Delivers `len` bytes from `offset` on.
pub type Read<'a> = dyn FnMut(u64, usize) -> Result<Vec<u8>> + 'a;

/// A file whose structure is being checked.
pub struct Strict {
    pub(super) head: Head,
    pub(super) nodes: NodeStore,
    /// Section `TIME`, if there is one and it is right.
    pub(super) times: Option<Times>,
    /// Stored bytes of `META` and of sections that this version does not know.
    pub(super) others: Vec<ExtraSection>,
    /// The section `CBOK`, if there is one and it is whole.
    pub(super) codebooks: Option<ExtraSection>,
    pub(super) errors: Vec<Error>,
    bricks: Vec<StoredBrick>,
    /// Where each page lies.
    page_entries: BTreeMap<u64, PageEntry>,
    limits: Limits,
    coverage: Coverage,
}

impl Strict {
    /// Opens a file of `len` bytes and reads all of it but the bricks.
    ///
    /// # Errors
    /// Those of opening: a file with a damaged head cannot be looked at further. All others are collected.
    pub fn open(len: u64, limits: &Limits, read: &mut Read<'_>) -> Result<Self> {
        let head = load::head(len, limits, read)?;
        let mut strict = Strict {
            head,
            nodes: NodeStore::default(),
            times: None,
            others: Vec::new(),
            codebooks: None,
            errors: Vec::new(),
            bricks: Vec::new(),
            page_entries: BTreeMap::new(),
            limits: limits.clone(),
            coverage: Coverage::default(),
        };
        strict.load_sections(limits, read);
        strict.load_index(read);
        strict.collect_bricks();
        strict.check_unfinished();
        Ok(strict)
    }

    /// The parsed head.
    #[must_use]
    pub fn head(&self) -> &Head {
        &self.head
    }

    /// Section `CBOK`, if there is one and its CRC is right: what is in it is not the container's business.
    #[must_use]
    pub fn codebooks(&self) -> Option<&ExtraSection> {
        self.codebooks.as_ref()
    }

    /// All stored bricks in the order of the file.
    #[must_use]
    pub fn bricks(&self) -> &[StoredBrick] {
        &self.bricks
    }

    /// Errors so far.
    #[must_use]
    pub fn errors(&self) -> &[Error] {
        &self.errors
    }

    /// Adds an error that was found outside: in a payload, say.
    pub fn report(&mut self, error: Error) {
        if self.errors.len() < MAX_ERRORS {
            self.errors.push(error);
        }
    }

    /// Ends the validation, and returns all errors; none: the structure is strictly valid.
    #[must_use]
    pub fn finish(mut self, read: &mut Read<'_>) -> Vec<Error> {
        match self.head.commit {
            Some(commit) => {
                let limits = self.limits.clone();
                self.check_records(commit, &limits, read);
            }
            None => self.check_coverage(read),
        }
        self.check_bounds();
        self.check_totals();
        // The comparison with the canonical bytes says little about a file that is wrong already.
        if self.errors.is_empty() && self.head.commit.is_none() {
            self.check_canonical(read);
        }
        self.errors
    }

    fn keep(&mut self, result: Result<()>) {
        if let Err(e) = result {
            self.report(e);
        }
    }

    fn entry_offset(&self, section: &SectionEntry) -> u64 {
        let index = self.head.sections.iter().position(|s| s.fourcc == section.fourcc).unwrap_or(0);
        self.head.superblock.section_table_offset + (index * super::section::ENTRY_BYTES) as u64
    }
}
