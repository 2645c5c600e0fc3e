//! The codebooks of a volume: section `CBOK`, read when a brick first needs it (spec chapter 14, §3).

use super::open::Volume;
use crate::codec::zerobit::Book;
use crate::error::{Code, Error, Result};
use crate::limits;
use std::sync::{Arc, OnceLock};

/// Codebooks, once they have been read.
#[derive(Default)]
pub(super) struct Books(OnceLock<Arc<[Book]>>);

impl Volume {
    /// All codebooks: one read, unless the head holds them; none for the next time.
    ///
    /// # Errors
    /// `E_SECTION_CRC`, `E_REPLACED`, `E_LIMIT`, and what a malformed section yields.
    pub fn codebooks(&self) -> Result<&Arc<[Book]>> {
        if let Some(books) = self.books.0.get() {
            return Ok(books);
        }
        let books = self.read_books()?;
        // Another thread may have been faster: then its result stands, which is the same.
        Ok(self.books.0.get_or_init(|| books.into()))
    }

    // spec: ZBT-34
    fn read_books(&self) -> Result<Vec<Book>> {
        let Some(entry) = self.head.section(*b"CBOK") else { return Ok(Vec::new()) };
        limits::check("CBOK", entry.stored_len, self.limits.table_bytes)?;
        let len = usize::try_from(entry.stored_len).map_err(|_| {
            Error::at(Code::Limit, entry.offset, "CBOK", "the section does not fit this machine's address space")
        })?;
        let stored = match self.head.resident(entry.offset, entry.stored_len) {
            Some(bytes) => std::borrow::Cow::Borrowed(bytes),
            None => self.source.read(entry.offset, len)?,
        };
        entry.check_crc(&stored).map_err(|e| self.replaced_or(e))?;
        Book::read_all(&stored, entry.item_count, self.info().sample_type, entry.offset)
    }
}
