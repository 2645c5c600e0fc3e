//! Any place that a `.vug` file can be read from, by its name.

use crate::error::Result;
use crate::limits::Limits;
use crate::source::{ByteSource, FileSource};
use crate::volume::Volume;
use std::path::Path;

/// Opens the bytes of a file.
pub(super) fn open_source(path: &Path) -> Result<Box<dyn ByteSource>> {
    Ok(Box::new(FileSource::open(path)?))
}

/// Opens a volume.
pub(super) fn open_volume(path: &Path) -> Result<Volume> {
    Volume::open(open_source(path)?, Limits::default())
}
