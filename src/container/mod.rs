//! The container: bytes ↔ structures, sans I/O (spec chapters 2 to 6, 9 and 15).
//!
//! Nothing here reads or writes a file. [`HeadParser`] says which range it wants next, somebody else delivers it;
//! [`FileWriter`] takes whatever can be written and sought, [`LogWriter`] whatever can be written. Decoding payloads is not
//! the container's business either: it knows where a brick lies, how long it is and what its bounds are, not what its bytes
//! mean.
//!
//! | structure | bytes | here |
//! |---|---|---|
//! | superblock | 256 | [`Superblock`] |
//! | section entry | 64 | [`SectionEntry`] |
//! | volume descriptor | 256 + 32 per codec | [`VolumeDescriptor`] |
//! | root directory entry | 24 | [`ChunkRef`] |
//! | page entry | 16 | [`PageEntry`] |
//! | node | 32 | [`Node`] |
//! | leader | 32 | [`Leader`] |

mod assemble;
mod content;
mod descriptor;
mod directory;
mod downsample;
mod features;
mod head;
mod kept;
mod layout;
mod leader;
mod log;
mod meta;
mod node;
mod octree;
mod parse;
mod recover;
mod rewrite;
mod scene;
mod section;
mod sink;
mod store;
pub mod strict;
mod superblock;
mod table;
mod times;
mod wire;
mod write;

pub use descriptor::{Achieved, CODEC_RAW, CODEC_S3DC, CodecEntry, VolumeDescriptor};
pub use descriptor::{CODEC_BYTES as CODEC_ENTRY_BYTES, FIXED_BYTES as DESCRIPTOR_BYTES};
pub use directory::{CHUNK_PAGES, ChunkRef, PAGE_NODES, PageEntry, parse_chunk, parse_page};
pub use downsample::Downsample;
pub use features::{FeatureName, OPTIONAL_NAN_REPLACED, REQUIRED_ZSTD};
pub use head::Head;
pub use kept::kept_options;
pub use leader::{LEADER_BYTES, Leader, find_leaders};
pub use log::{Commit, LogWriter};
pub use meta::check_meta;
pub use node::{Node, NodeFlags, NodeKind, round_down_f32, round_up_f32};
pub use octree::{Level, Octree};
pub use parse::{HeadParser, Step};
pub use recover::{LiveBrick, LostBrick, Place, Recovery, recover};
pub use rewrite::rewrite;
pub use scene::{check_scene, scene_section};
pub use section::{ExtraSection, FourCc, SectionEntry, SectionFlags};
pub use sink::BrickSink;
pub use superblock::{FileLayout, MAGIC, SUPERBLOCK_BYTES, Superblock};
pub use times::parse_times;
pub use write::{FileSummary, FileWriter, FinishOptions};

/// Zero bytes behind every payload, so that decoders may load whole words (spec: BRK-4).
pub const GUARD_BYTES: u64 = 16;

#[cfg(test)]
mod tests;
