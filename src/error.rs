//! One error type for the whole crate: a stable code, where it happened, which field, and what to do (spec: VAL-2).

use std::borrow::Cow;
use std::fmt;
use std::io;

/// Result of everything in this crate that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;

macro_rules! codes {
    ($($(#[$doc:meta])* $name:ident = $text:literal,)*) => {
        /// Stable error codes (spec chapter 9). The strings never change meaning between versions.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[non_exhaustive]
        pub enum Code { $($(#[$doc])* $name,)* }

        impl Code {
            /// Every code, in the order of the spec's table.
            pub const ALL: &'static [Code] = &[$(Code::$name,)*];

            /// The stable string, e.g. `E_BRICK_CRC`.
            #[must_use]
            pub const fn as_str(self) -> &'static str {
                match self { $(Code::$name => $text,)* }
            }
        }
    };
}

codes! {
    /// The first 12 bytes are not those of a Vug file.
    Magic = "E_MAGIC",
    /// The major version is not one this reader knows.
    Version = "E_VERSION",
    /// The file or a structure ends before its declared end.
    Truncated = "E_TRUNCATED",
    /// A stored length contradicts another one.
    Size = "E_SIZE",
    /// The superblock's checksum does not match.
    HeaderCrc = "E_HEADER_CRC",
    /// The section table's or a section's checksum does not match.
    SectionCrc = "E_SECTION_CRC",
    /// A directory chunk's checksum does not match.
    DirCrc = "E_DIR_CRC",
    /// An index page's checksum does not match.
    PageCrc = "E_PAGE_CRC",
    /// A brick payload's checksum does not match.
    BrickCrc = "E_BRICK_CRC",
    /// The leader before a payload is wrong.
    Leader = "E_LEADER",
    /// A commit record of a log file is wrong.
    Commit = "E_COMMIT",
    /// The file was replaced by another one while it was open.
    Replaced = "E_REPLACED",
    /// A required feature bit is not known to this reader.
    Feature = "E_FEATURE",
    /// A codec or stream version is not known to this reader.
    Codec = "E_CODEC",
    /// A critical section is not known to this reader, or a mandatory one is missing.
    SectionUnknown = "E_SECTION_UNKNOWN",
    /// Two sections or items overlap.
    SectionOverlap = "E_SECTION_OVERLAP",
    /// A section or item lies outside the file or its section.
    SectionRange = "E_SECTION_RANGE",
    /// An offset is not aligned as declared.
    Align = "E_ALIGN",
    /// A sorted table is not sorted.
    Order = "E_ORDER",
    /// A table names the same thing twice.
    Dup = "E_DUP",
    /// A parameter lies outside its legal set.
    Param = "E_PARAM",
    /// A number exceeds a cap of the format or a limit of this reader.
    Limit = "E_LIMIT",
    /// A reference points at nothing.
    Ref = "E_REF",
    /// A zstd frame is malformed or not of the allowed form.
    Zstd = "E_ZSTD",
    /// Reserved bytes or bits are not zero.
    Reserved = "E_RESERVED",
    /// The bytes decode, but are not the one canonical encoding.
    Canon = "E_CANON",
    /// A zerobit NNNC byte is wrong.
    Nnnc = "E_NNNC",
    /// A zerobit offset is wrong.
    Offset = "E_OFFSET",
    /// A codebook index points past its codebook.
    CodebookIndex = "E_CODEBOOK_INDEX",
    /// A minimum is larger than its maximum.
    MinmaxOrder = "E_MINMAX_ORDER",
    /// A number that must be finite is NaN or infinite.
    NonFinite = "E_NONFINITE",
    /// Padding or guard bytes are not zero.
    Padding = "E_PADDING",
    /// Text is not valid UTF-8 or not valid JSON.
    Utf8 = "E_UTF8",
    /// A coordinate or region lies outside the volume.
    Range = "E_RANGE",
    /// The operating system or transport could not deliver or take the bytes.
    Source = "E_SOURCE",
    /// A file of another format is malformed.
    Foreign = "E_FOREIGN",
    /// A file of another format is valid, but holds what Vug cannot represent (yet).
    Unsupported = "E_UNSUPPORTED",
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// What went wrong, where, and what to do about it.
///
/// One boxed struct, so that `Result` stays small and every layer reports the same facts.
pub struct Error(Box<Facts>);

struct Facts {
    code: Code,
    offset: Option<u64>,
    field: Cow<'static, str>,
    message: String,
    cause: Option<io::Error>,
}

impl Error {
    /// An error with a code, the field it concerns, and a message that says the next step.
    pub fn new(code: Code, field: impl Into<Cow<'static, str>>, message: impl Into<String>) -> Self {
        Error(Box::new(Facts { code, offset: None, field: field.into(), message: message.into(), cause: None }))
    }

    /// An error in the bytes of a file: `offset` is absolute, in bytes from the start of the file.
    pub fn at(code: Code, offset: u64, field: impl Into<Cow<'static, str>>, message: impl Into<String>) -> Self {
        let mut error = Error::new(code, field, message);
        error.0.offset = Some(offset);
        error
    }

    /// A caller's parameter is outside its legal set (`E_PARAM`).
    pub fn param(field: impl Into<Cow<'static, str>>, message: impl Into<String>) -> Self {
        Error::new(Code::Param, field, message)
    }

    /// The operating system failed (`E_SOURCE`); `what` names the file or action.
    pub fn io(what: impl fmt::Display, cause: io::Error) -> Self {
        let mut error = Error::new(Code::Source, "", format!("{what}: {cause}"));
        error.0.cause = Some(cause);
        error
    }

    /// The stable code.
    #[must_use]
    pub fn code(&self) -> Code {
        self.0.code
    }

    /// Absolute byte offset in the file, where one is known.
    #[must_use]
    pub fn offset(&self) -> Option<u64> {
        self.0.offset
    }

    /// The field of the spec or the parameter that is wrong; empty if there is none.
    #[must_use]
    pub fn field(&self) -> &str {
        &self.0.field
    }

    /// The message without code and place.
    #[must_use]
    pub fn message(&self) -> &str {
        &self.0.message
    }

    /// The same error, moved by `base` bytes: for parsers that see a slice of a file.
    #[must_use]
    pub fn shifted(mut self, base: u64) -> Self {
        self.0.offset = self.0.offset.map(|o| o.saturating_add(base));
        self
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Facts { code, offset, field, message, .. } = &*self.0;
        match (offset, field.is_empty()) {
            (Some(o), false) => write!(f, "{code} at byte {o} ({field}): {message}"),
            (Some(o), true) => write!(f, "{code} at byte {o}: {message}"),
            (None, false) => write!(f, "{code} ({field}): {message}"),
            (None, true) => write!(f, "{code}: {message}"),
        }
    }
}

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.0.cause.as_ref().map(|c| c as _)
    }
}
