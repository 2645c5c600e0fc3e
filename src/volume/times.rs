//! When the time steps of a volume were taken: section `TIME`, read when it is asked for (spec chapter 3).

use super::open::Volume;
use crate::container::parse_times;
use crate::error::{Code, Error, Result};
use crate::limits;
use crate::time::Times;
use std::borrow::Cow;

impl Volume {
    /// The time of each step, where the file says it: one read, unless the section lies in the head.
    ///
    /// # Errors
    /// `E_SECTION_CRC`, `E_REPLACED`, `E_LIMIT`, and those of a malformed section: `E_PARAM`, `E_RESERVED`, `E_SIZE`,
    /// `E_NONFINITE`, `E_ORDER`.
    pub fn times(&self) -> Result<Option<Times>> {
        let Some(entry) = self.head.section(*b"TIME") else { return Ok(None) };
        limits::check("TIME", entry.stored_len, self.limits.table_bytes)?;
        let len = usize::try_from(entry.stored_len).map_err(|_| {
            Error::at(Code::Limit, entry.offset, "TIME", "the section does not fit this machine's address space")
        })?;
        let stored = match self.head.resident(entry.offset, entry.stored_len) {
            Some(bytes) => Cow::Borrowed(bytes),
            None => self.source.read(entry.offset, len)?,
        };
        entry.check_crc(&stored).map_err(|e| self.replaced_or(e))?;
        parse_times(&stored, entry.offset, self.info().time_steps).map(Some)
    }
}
