//! Every cap of the format, and the limits a reader may set below them (spec chapter 9).

use crate::error::{Code, Error, Result};

/// Longest axis, in voxels.
pub const MAX_AXIS: u32 = 1 << 21;
/// Most voxels of one tree (one time step of one channel).
pub const MAX_VOXELS: u64 = 1 << 48;
/// Most levels of detail.
pub const MAX_LODS: u8 = 22;
/// Most sections of a file.
pub const MAX_SECTIONS: u32 = 64;
/// Largest stored brick payload, in bytes.
pub const MAX_BRICK_BYTES: u64 = 64 << 20;
/// Largest `META` section, in bytes.
pub const MAX_META_BYTES: u64 = 1 << 20;
/// Longest scene, in bytes: a file, or a `SCNE` section.
pub const MAX_SCENE_BYTES: u64 = 1 << 20;
/// Largest section that is parsed as a whole (all but `PAGE` and `BRIK`), in bytes.
pub const MAX_TABLE_BYTES: u64 = 256 << 20;
/// Largest window of a zstd frame, as log2 of bytes.
pub const MAX_ZSTD_WINDOW_LOG: u32 = 23;
/// Codebooks of a file.
pub const MAX_CODEBOOKS: u64 = 4096;
/// Words of a codebook, of averages and of details each.
pub const MAX_CODEBOOK_WORDS: u64 = 256;
/// Most entries of the codec table.
pub const MAX_CODECS: usize = 255;
/// Most trees (time steps × channels).
pub const MAX_TREES: u64 = 1 << 24;
/// Smallest and largest brick edge, as log2 of voxels.
pub const BRICK_LOG2: std::ops::RangeInclusive<u8> = 4..=8;
/// Bytes that opening a file reads at once; the head of a small file fits in them.
pub const HEAD_BYTES: u64 = 16 << 10;

/// Bytes at the end of a log that are searched for its last whole commit, where the file was not closed.
pub const LOG_SEARCH_BYTES: u64 = 256 << 20;
/// Most bytes of a log that a writer puts behind a commit before the next one, unless a single record is longer.
pub const LOG_COMMIT_BYTES: u64 = 64 << 20;

/// What a reader is willing to spend on one file. The defaults are the caps of the format, but for memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Most voxels of a volume that may be opened.
    pub voxels: u64,
    /// Largest decoded brick, in bytes.
    pub brick_bytes: u64,
    /// Largest section that is parsed as a whole, in bytes.
    pub table_bytes: u64,
    /// Largest decoded result of one call (a region or a whole volume), in bytes.
    pub result_bytes: u64,
    /// Bytes of inflated bricks kept in the cache.
    pub cache_bytes: u64,
    /// Bytes at the end of an unfinished log that are searched for its last commit, before its records are walked from the
    /// front.
    pub log_search_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            voxels: MAX_VOXELS,
            brick_bytes: MAX_BRICK_BYTES,
            table_bytes: MAX_TABLE_BYTES,
            result_bytes: 64 << 30,
            cache_bytes: 256 << 20,
            log_search_bytes: LOG_SEARCH_BYTES,
        }
    }
}

/// Checks an untrusted number against a cap before anything is done with it.
///
/// # Errors
/// `E_LIMIT` naming `field`, the number found and the cap.
pub fn check(field: &'static str, found: u64, max: u64) -> Result<()> {
    if found <= max {
        return Ok(());
    }
    Err(Error::new(
        Code::Limit,
        field,
        format!("{found} exceeds the limit of {max}; raise the limit if you trust this file"),
    ))
}
