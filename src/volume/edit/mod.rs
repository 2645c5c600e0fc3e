//! Copying bricks from one file to another without decoding them: parts of a volume, another order, another layout, with or
//! without zstd. What is stored of a brick is copied as it is, its checksum checked on the way.
//!
//! ```
//! use vug::{Extent, Grid, Region, source::MemorySource};
//! use vug::volume::{self, At, CopyOptions, EncodeOptions, Volume};
//! let mut grid = Grid::from_fn(Extent::new(100, 80, 60), |[x, y, z]| (x ^ y ^ z) as u8)?;
//! let mut file = std::io::Cursor::new(Vec::new());
//! volume::encode(&mut grid, &mut file, &EncodeOptions { brick: Some(16), ..Default::default() }, &mut |_, _| {})?;
//! let volume = Volume::open(MemorySource(file.into_inner()), Default::default())?;
//!
//! let wanted = Region { start: [20, 20, 20], end: [40, 40, 40] };
//! let excerpt = volume.excerpt(&CopyOptions { region: Some(wanted), ..Default::default() })?;
//! let kept = excerpt.region();
//! assert_eq!(kept, Region { start: [16; 3], end: [48; 3] }); // whole bricks
//! let (out, report) = excerpt.write_head(std::io::Cursor::new(Vec::new()), &mut |_, _| {})?;
//! let cut = Volume::open(MemorySource(out.into_inner()), Default::default())?;
//! assert_eq!(report.file.stored, 8);
//! assert_eq!(cut.read(At::default())?.bytes(), volume.read_region(At::default(), kept)?.bytes());
//! # Ok::<(), vug::Error>(())
//! ```

mod append;
mod copy;
mod excerpt;
mod recover;
mod steps;
mod stored;

pub use append::Appender;
pub use excerpt::Excerpt;
pub use recover::{Recovered, recover};

use crate::container::FileSummary;
use crate::geometry::Region;
use std::ops::Range;

/// In which order bricks are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum BrickOrder {
    /// As they lie in the file they come from.
    #[default]
    File,
    /// Coarsest level first, then by tree, page and slot (spec: HDR-7): a coarse view is one range of the file.
    Clustered,
}

/// Whether payloads are compressed with zstd. Uncompressed, they are the same bytes either way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum ZstdPolicy {
    /// As they are.
    #[default]
    Keep,
    /// All that become smaller by it (spec: BRK-8).
    Compress,
    /// None.
    Inflate,
}

/// What of a volume is copied, and how. The default copies everything as it is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CopyOptions {
    /// Levels of detail to keep, half open; the first becomes level 0. `None`: all, or with a region those whose bricks
    /// fit it.
    pub levels: Option<Range<u8>>,
    /// Time steps to keep, half open. `None`: all.
    pub times: Option<Range<u32>>,
    /// Channels to keep, half open. `None`: all.
    pub channels: Option<Range<u32>>,
    /// Box to keep, in voxels of the finest level that is kept; grows to whole bricks of the coarsest one, where `levels`
    /// are given, else of the finest one.
    pub region: Option<Region>,
    /// In which order bricks are written.
    pub order: BrickOrder,
    /// Whether payloads are compressed.
    pub zstd: ZstdPolicy,
    /// Text for the `SCNE` section instead of the one that is there.
    pub scene: Option<String>,
    /// File id instead of the one made from the content.
    pub file_id: Option<[u8; 16]>,
}

/// What was copied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CopyReport {
    /// The new file.
    pub file: FileSummary,
    /// Bytes of all payloads before zstd.
    pub payload_bytes: u64,
    /// Payloads that were compressed or inflated.
    pub converted: u64,
}
