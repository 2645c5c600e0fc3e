//! The `SCNE` section: how the volume is meant to be seen, as text (spec chapter 3). What the text says is for the renderer.

use super::content::known;
use super::section::{self, ExtraSection, SectionFlags};
use crate::error::{Code, Error, Result};
use crate::limits;

/// Checks the bytes of `SCNE`; `offset` is where the section lies, for errors (spec: SEC-19).
///
/// # Errors
/// `E_LIMIT` above 1 MiB, `E_UTF8` where the bytes are no text.
pub fn check_scene(bytes: &[u8], offset: u64) -> Result<&str> {
    if bytes.len() as u64 > limits::MAX_SCENE_BYTES {
        let message = format!("a scene of {} bytes exceeds the cap of 1 MiB", bytes.len());
        return Err(Error::at(Code::Limit, offset, "SCNE", message));
    }
    std::str::from_utf8(bytes).map_err(|e| Error::at(Code::Utf8, offset, "SCNE", format!("{e}; the scene is not text")))
}

/// The section of a scene, for [`FinishOptions::extra`](super::FinishOptions::extra).
#[must_use]
pub fn scene_section(text: String) -> ExtraSection {
    known(section::SCNE, SectionFlags::COPY_SAFE, text.into_bytes(), 0, 0)
}
