//! The codebooks of a volume: section `CBOK`, read when a brick first needs it (spec chapter 14, §3).

use super::open::Volume;
use crate::codec::zerobit::Book;
use crate::error::{Code, Error, Result};
use crate::limits;
use std::sync::{Arc, OnceLock};

/// Codebooks, once they have been read.
#[derive(Default)]
pub(super) struct Books(OnceLock<Result<Arc<[Book]>>>);

impl Volume {
    /// All codebooks: one read, unless the head holds them; none for the next time.
    ///
    /// # Errors
    /// `E_SECTION_CRC`, `E_REPLACED`, `E_LIMIT`, and what a malformed section yields.
    pub fn codebooks(&self) -> Result<&Arc<[Book]>> {
        if let Some(known) = self.books.0.get() {
            return known.as_ref().map_err(again);
        }
        let books = match self.read_books() {
            // A source that fails may answer the next time; what is damaged stays so and is not read for every brick.
            Err(e) if e.code() == Code::Source => return Err(e),
            books => books.map(Arc::from),
        };
        // Another thread may have been faster: then its result stands, which is the same.
        self.books.0.get_or_init(|| books).as_ref().map_err(again)
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

/// The same error once more.
fn again(e: &Error) -> Error {
    match e.offset() {
        Some(offset) => Error::at(e.code(), offset, e.field().to_owned(), e.message().to_owned()),
        None => Error::new(e.code(), e.field().to_owned(), e.message().to_owned()),
    }
}
