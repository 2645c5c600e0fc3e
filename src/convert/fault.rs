//! Errors about foreign files: every one names the file, the header field, what was found and what to do.

use crate::error::{Code, Error};
use std::borrow::Cow;
use std::fmt::Display;
use std::io;
use std::path::Path;

/// The file is malformed (`E_FOREIGN`).
pub(super) fn foreign(path: &Path, field: impl Into<Cow<'static, str>>, message: impl Display) -> Error {
    Error::new(Code::Foreign, field, format!("{}: {message}", path.display()))
}

/// The file is valid, but holds what this version cannot represent (`E_UNSUPPORTED`).
pub(super) fn unsupported(path: &Path, field: impl Into<Cow<'static, str>>, message: impl Display) -> Error {
    Error::new(Code::Unsupported, field, format!("{}: {message}", path.display()))
}

/// The operating system failed on this file (`E_SOURCE`).
pub(super) fn io(path: &Path, cause: io::Error) -> Error {
    Error::io(path.display(), cause)
}

/// An error of the ground layer about a number that a foreign header stated: caps keep their code, all else is
/// `E_FOREIGN`.
pub(super) fn relabel(path: &Path, field: &'static str, error: &Error) -> Error {
    let code = if error.code() == Code::Limit { Code::Limit } else { Code::Foreign };
    Error::new(code, field, format!("{}: {}", path.display(), error.message()))
}
