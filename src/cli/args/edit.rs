//! Commands that make a `.vug` file of another one.

use super::encode::NanArg;
use super::parse::{parse_bytes, parse_file_id, parse_region, parse_span};
use super::{Common, Import};
use crate::geometry::Region;
use clap::Args;
use std::ops::Range;
use std::path::PathBuf;

/// Writes a .vug file anew as one that is complete from its head on, payloads as they are
#[derive(Args)]
#[command(after_help = "A log (from a pipe, or one that was appended to) becomes a file that opens with one read.
--clustered puts coarse levels first, so that an overview of a file on the web is one range of it.

Examples:
  vug pack stream.vug head.vug
  vug pack head.vug log.vug --log
  vug pack head.vug web.vug --clustered")]
pub(in crate::cli) struct Pack {
    /// .vug file
    pub(in crate::cli) source: PathBuf,
    /// .vug file to write
    pub(in crate::cli) target: PathBuf,
    /// Coarsest level first, then by time step, channel and position; else as the bricks lie in SOURCE
    #[arg(long)]
    pub(in crate::cli) clustered: bool,
    /// Write a log, which `vug append` can add time steps to
    #[arg(long)]
    pub(in crate::cli) log: bool,
    #[command(flatten)]
    pub(in crate::cli) write: Write,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

/// Compresses the bricks of a .vug file with zstd, or inflates them: payloads stay the same
#[derive(Args)]
#[command(after_help = "Examples:
  vug repack head.vug gpu.vug --no-zstd        bricks that go to a GPU as they are
  vug repack gpu.vug small.vug --zstd")]
pub(in crate::cli) struct Repack {
    /// .vug file
    pub(in crate::cli) source: PathBuf,
    /// .vug file to write
    pub(in crate::cli) target: PathBuf,
    /// Compress every brick that becomes smaller by it
    #[arg(long, required_unless_present = "no_zstd", conflicts_with = "no_zstd")]
    pub(in crate::cli) zstd: bool,
    /// Compress none
    #[arg(long)]
    pub(in crate::cli) no_zstd: bool,
    /// Coarsest level first, then by time step, channel and position; else as the bricks lie in SOURCE
    #[arg(long)]
    pub(in crate::cli) clustered: bool,
    #[command(flatten)]
    pub(in crate::cli) write: Write,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

/// Cuts a part out of a .vug file without coding it again: a box, levels, time steps, channels
#[derive(Args)]
#[command(
    after_help = "Whole bricks are kept, so that a box grows to the bricks it touches: those of the coarsest level of --levels,
else those of the finest one; coarser levels are then kept as far as their bricks fit the box.

Examples:
  vug extract head.vug part.vug --region 0:100,50:120,0:64   x, y, z; the end is not included
  vug extract head.vug small.vug --levels 2:5                level 2 becomes level 0
  vug extract series.vug step17.vug --times 17
  vug extract https://example.org/head.vug part.vug --region 0:64,0:64,0:64"
)]
pub(in crate::cli) struct Extract {
    /// .vug file
    pub(in crate::cli) source: PathBuf,
    /// .vug file to write
    pub(in crate::cli) target: PathBuf,
    /// Box to keep, in voxels of the finest level that is kept, half open
    #[arg(long, value_name = "X0:X1,Y0:Y1,Z0:Z1", value_parser = parse_region)]
    pub(in crate::cli) region: Option<Region>,
    /// Levels to keep: one, or A:B without B
    #[arg(long, value_name = "A:B", value_parser = parse_span::<u8>)]
    pub(in crate::cli) levels: Option<Range<u8>>,
    /// Time steps to keep: one, or A:B without B
    #[arg(long, value_name = "A:B", value_parser = parse_span::<u32>)]
    pub(in crate::cli) times: Option<Range<u32>>,
    /// Channels to keep: one, or A:B without B
    #[arg(long, value_name = "A:B", value_parser = parse_span::<u32>)]
    pub(in crate::cli) channels: Option<Range<u32>>,
    /// Coarsest level first, then by time step, channel and position; else as the bricks lie in SOURCE
    #[arg(long)]
    pub(in crate::cli) clustered: bool,
    #[command(flatten)]
    pub(in crate::cli) write: Write,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

/// Appends time steps to a log (a .vug file that `vug encode --log` or `vug pack --log` wrote)
#[derive(Args)]
#[command(
    after_help = "Each SOURCE is a volume of the same shape, type and channels: one time step, or several. It is encoded as FILE is.
What FILE held before stays as it is; a SOURCE is there whole or not at all, whenever the program is stopped.

Examples:
  vug append series.vug step17.nrrd
  vug append series.vug step17.nrrd step18.nrrd --time 34,36
  vug append series.vug step17.vug               encoded already: its bricks are copied"
)]
pub(in crate::cli) struct Append {
    /// Log to append to
    pub(in crate::cli) file: PathBuf,
    /// Volumes to append: any readable file or address
    #[arg(required = true)]
    pub(in crate::cli) sources: Vec<PathBuf>,
    /// Cut off finished bricks that a stopped writer left behind the last commit
    #[arg(long)]
    pub(in crate::cli) cut: bool,
    /// Times of the new steps, where FILE has times, in its unit [default: what SOURCE says, else FILE's interval goes on]
    #[arg(long, value_name = "T,…", value_delimiter = ',', allow_negative_numbers = true)]
    pub(in crate::cli) time: Vec<f64>,
    /// Store payloads as they go to the GPU, without zstd
    #[arg(long)]
    pub(in crate::cli) no_zstd: bool,
    /// NaN and infinities
    #[arg(long, value_enum, default_value = "reject")]
    pub(in crate::cli) nan: NanArg,
    /// Memory to keep within, with K, M or G behind it; what does not fit goes to temporary files
    #[arg(long, value_name = "BYTES", default_value = "1G", value_parser = parse_bytes)]
    pub(in crate::cli) memory: u64,
    /// Folder for temporary files [default: that of FILE]
    #[arg(long, value_name = "DIR")]
    pub(in crate::cli) temp_dir: Option<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) import: Import,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

/// Saves what is whole of a damaged or unfinished .vug file as a new one
#[derive(Args)]
#[command(
    after_help = "A log that its writer did not finish is taken as of its last commit, with bricks that were finished after it. Where the
index is damaged, bricks are found by what stands before them. TARGET is strictly valid; what is lost is EMPTY in it.
Exit code 0: nothing was lost; 1: bricks or tables were, and are listed.

Examples:
  vug recover broken.vug rest.vug
  vug recover broken.vug rest.vug --json       every brick that lives, and every one that is lost"
)]
pub(in crate::cli) struct Recover {
    /// .vug file
    pub(in crate::cli) source: PathBuf,
    /// .vug file to write
    pub(in crate::cli) target: PathBuf,
    /// Overwrite TARGET
    #[arg(long)]
    pub(in crate::cli) force: bool,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

/// How the new file is written.
#[derive(Args, Clone)]
pub(in crate::cli) struct Write {
    /// File id (32 hex digits) instead of the one made from the content
    #[arg(long, value_name = "HEX", value_parser = parse_file_id)]
    pub(in crate::cli) file_id: Option<[u8; 16]>,
    /// Overwrite TARGET
    #[arg(long)]
    pub(in crate::cli) force: bool,
}
