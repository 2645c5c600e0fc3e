//! Any place that a `.vug` file can be read from, by its name.

use crate::error::Result;
use crate::limits::Limits;
use crate::source::{ByteSource, FileSource, is_url, open_url};
use crate::volume::Volume;
use std::path::Path;

/// Opens the bytes of a file, or of an address.
pub(super) fn open_source(path: &Path) -> Result<Box<dyn ByteSource>> {
    // A local file of such a name would have an empty folder name in its path.
    if let Some(url) = path.to_str().filter(|text| is_url(text)) {
        return open_url(url);
    }
    Ok(Box::new(FileSource::open(path)?))
}

/// Opens a volume.
pub(super) fn open_volume(path: &Path) -> Result<Volume> {
    let volume = Volume::open(open_source(path)?, Limits::default())?;
    tell_unfinished(&volume);
    Ok(volume)
}

/// Says on stderr that a log has no end: what is not in its last commit reads as the null value.
pub(super) fn tell_unfinished(volume: &Volume) {
    let behind = volume.head().unfinished();
    if behind > 0 {
        eprintln!(
            "note: the log is unfinished: {behind} bytes follow its last commit. Bricks that no commit has read as the null value; `vug recover` saves what is whole"
        );
    }
}
