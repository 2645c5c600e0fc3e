//! Raw files: samples alone, x fastest, then y, z, channels and time; shape and type come from the caller.

use super::layout::Layout;
use super::payload::{self, Bytes, Payload};
use super::stored::{Kind, Stored};
use super::{Format, Import, ImportOptions, Probe, pipe};
use crate::affine::ValueMap;
use crate::error::{Code, Error, Result};
use serde_json::json;
use std::path::Path;

/// Opens a raw file, whose length must be exactly that of shape and type, or a pipe, which must deliver exactly that.
pub(super) fn import(path: &Path, options: &ImportOptions) -> Result<Import> {
    let (stored, layout) = shape(path, options)?;
    if pipe::is_pipe(path) {
        return pipe::import(path, stored, layout, options);
    }
    let (file, found) = payload::open(path)?;
    check_len(path, stored, &layout, found)?;
    let bytes = Bytes::File { file, path: path.to_owned(), start: 0, spooled: 0 };
    let opened = Payload { bytes, stored, layout }.open(path, options.dtype)?;
    Ok(Import::plain(opened, Format::Raw, json!({ "format": "raw" })))
}

/// What the caller says of the samples, and the file's length allows.
pub(super) fn probe(path: &Path, options: &ImportOptions) -> Result<Probe> {
    let (stored, layout) = shape(path, options)?;
    check_len(path, stored, &layout, payload::open(path)?.1)?;
    Ok(Probe { kind: stored.kind, layout, value_map: ValueMap::default() })
}

fn shape(path: &Path, options: &ImportOptions) -> Result<(Stored, Layout)> {
    let missing = |field, how: &str| Error::param(field, format!("{}: a raw file needs {how}", path.display()));
    let extent = options.shape.ok_or_else(|| missing("shape", "its size: --shape X,Y,Z (x fastest)"))?;
    let stored = options
        .raw_dtype
        .or_else(|| options.dtype.map(|t| Stored::from(Kind::from(t))))
        .ok_or_else(|| missing("dtype", "its type: --dtype u8, u16, i16, f32, rgb8, ..."))?;
    extent.check()?;
    let series = (options.time_steps.unwrap_or(1), options.channels.unwrap_or(1));
    for (field, count) in [("time-steps", series.0), ("channels", series.1)] {
        if count == 0 {
            return Err(Error::param(field, format!("{}: 0 {field}; one is the least", path.display())));
        }
    }
    Ok((stored, Layout::series(path, "shape", extent, series, stored.kind)?))
}

fn check_len(path: &Path, stored: Stored, layout: &Layout, found: u64) -> Result<()> {
    let expected = layout.bytes(stored.kind);
    if found == expected {
        return Ok(());
    }
    let message = format!(
        "{}: {} voxels of {} are {expected} bytes, the file has {found}; check --shape, --dtype, --time-steps and --channels",
        path.display(),
        layout.text(),
        stored.kind
    );
    Err(Error::new(Code::Size, "shape", message))
}
