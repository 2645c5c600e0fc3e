//! What commands print: JSON of errors, numbers for people, progress bars, exit codes.

use crate::error::{Code, Error, Result};
use crate::source::AtomicFile;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};
use std::io::{IsTerminal, Write};
use std::path::Path;

/// How a command ended that did what it was asked to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// Fine.
    Ok = 0,
    /// A result is over its bound, or bricks were lost.
    Bad = 1,
    /// The input is corrupt (`verify`).
    Corrupt = 3,
}

/// Exit code of an error: 2 for what the caller can mend in the command line, 3 for what is wrong with a file.
pub(super) fn exit_code(error: &Error) -> u8 {
    // A parameter error *with* an offset is a wrong parameter inside a file.
    match error.code() {
        Code::Param | Code::Range if error.offset().is_none() => 2,
        // What was asked for is too much, not what a file holds.
        Code::Limit if matches!(error.field(), "size" | "step" | "gpu-mem" | "scene") => 2,
        _ => 3,
    }
}

pub(super) fn error_json(error: &Error) -> Value {
    json!({ "code": error.code().as_str(), "offset": error.offset(), "field": error.field(), "message": error.message() })
}

/// A number as JSON; infinities and NaN become null.
pub(super) fn number(v: f64) -> Value {
    serde_json::Number::from_f64(v).map_or(Value::Null, Value::Number)
}

/// A PSNR for people.
pub(super) fn psnr_text(psnr: Option<f64>, identical: bool) -> String {
    match psnr {
        Some(db) => format!("{db:.2} dB"),
        None if identical => "inf (identical)".into(),
        None => "undefined (constant reference or infinite error)".into(),
    }
}

/// A number that may be tiny, for people.
pub(super) fn small_text(v: f64) -> String {
    if v == 0.0 || v.abs() >= 0.01 { format!("{v:.6}") } else { format!("{v:.4e}") }
}

/// A number of bytes for people.
pub(super) fn bytes_text(bytes: u64) -> String {
    match bytes {
        0..10_240 => format!("{bytes} B"),
        10_240..10_485_760 => format!("{:.1} KiB", bytes as f64 / 1024.0),
        _ => format!("{:.1} MiB", bytes as f64 / 1_048_576.0),
    }
}

/// A bar on stderr, where that is a terminal and `quiet` is not set; else nothing.
pub(super) fn progress(quiet: bool, what: &str) -> ProgressBar {
    if quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{msg} {bar:40} {percent:>3} % {elapsed}, {eta} left");
    ProgressBar::new(0).with_style(style.expect("a constant template")).with_message(what.to_owned())
}

/// Refuses standard output, where a file is written that has to be sought in.
///
/// # Errors
/// `E_PARAM`.
pub(super) fn check_no_stdout(target: &Path) -> Result<()> {
    if target == Path::new("-") {
        return Err(Error::param("target", "this file cannot go to standard output; give it a name"));
    }
    Ok(())
}

/// Refuses a target that is the source itself, which would be lost, and standard output.
///
/// # Errors
/// `E_PARAM`.
pub(super) fn check_target(source: &Path, target: &Path) -> Result<()> {
    check_no_stdout(target)?;
    if matches!((source.canonicalize(), target.canonicalize()), (Ok(a), Ok(b)) if a == b) {
        return Err(Error::param("target", "the target is the source itself, which would be lost; give another name"));
    }
    Ok(())
}

/// Writes a whole file at once: it appears complete or not at all.
pub(super) fn write_file(path: &Path, force: bool, bytes: &[u8]) -> Result<()> {
    let mut file = AtomicFile::create(path, force)?;
    file.write_all(bytes).map_err(|e| Error::io(path.display(), e))?;
    file.commit()
}
