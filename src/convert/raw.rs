//! Raw files: samples alone, x fastest; shape and type come from the caller.

use super::payload::{self, Bytes, Payload};
use super::stored::{Kind, Stored};
use super::{Format, Import, ImportOptions};
use crate::affine::{Placement, ValueMap};
use crate::error::{Code, Error, Result};
use serde_json::json;
use std::path::Path;

/// Opens a raw file, whose length must be exactly that of shape and type.
pub(super) fn import(path: &Path, options: &ImportOptions) -> Result<Import> {
    let missing = |field, how: &str| Error::param(field, format!("{}: a raw file needs {how}", path.display()));
    let extent = options.shape.ok_or_else(|| missing("shape", "its size: --shape X,Y,Z (x fastest)"))?;
    let stored = options
        .raw_dtype
        .or_else(|| options.dtype.map(|t| Stored::from(Kind::from(t))))
        .ok_or_else(|| missing("dtype", "its type: --dtype u8, u16, i16, f32, rgb8, ..."))?;
    extent.check()?;
    let expected = payload::byte_len(path, "shape", extent, stored.kind)?;
    let (file, found) = payload::open(path)?;
    if found != expected {
        let message = format!(
            "{}: {extent} voxels of {} are {expected} bytes, the file has {found}; check --shape and --dtype",
            path.display(),
            stored.kind
        );
        return Err(Error::new(Code::Size, "shape", message));
    }
    let payload = Payload { bytes: Bytes::File { file, path: path.to_owned(), start: 0 }, stored, extent };
    let (reader, streamed) = payload.open(path, options.dtype)?;
    Ok(Import {
        times: None,
        labels: false,
        reader,
        placement: Placement::default(),
        value_map: ValueMap::default(),
        header: json!({ "format": "raw" }),
        format: Format::Raw,
        streamed,
    })
}
