//! The command line, declared.

mod edit;
mod encode;
mod parse;
#[cfg(feature = "gpu")]
mod render;
#[cfg(feature = "gpu")]
mod tradeoff;

pub(in crate::cli) use edit::{Append, Extract, Pack, Recover, Repack, Write};
pub(in crate::cli) use encode::{
    CodecArg, DownsampleArg, Encode, EndpointsArg, NanArg, NormArg, StreamArg, ThresholdArg, TrainingArg, ZerobitArgs,
};

#[cfg(feature = "gpu")]
pub(in crate::cli) use render::Render;
#[cfg(feature = "gpu")]
pub(in crate::cli) use tradeoff::Tradeoff;

use crate::convert::Stored;
use crate::geometry::{Extent, Region};
use crate::volume::{Axis, Bound};
use clap::{Args, Parser, Subcommand};
use parse::{parse_extent, parse_jobs, parse_range, parse_region, parse_span};
use std::path::PathBuf;

/// Compresses 3D volumes so that every voxel, plane, block, brick or region can be read alone.
///
/// Axis order is x, y, z everywhere, x fastest. Exit codes: 0 fine, 1 a result is over its bound or bricks were lost,
/// 2 wrong usage, 3 a file is unreadable or corrupt, or cannot be written.
#[derive(Parser)]
#[command(name = "vug", version, propagate_version = true, after_help = EXAMPLES)]
pub(in crate::cli) struct Vug {
    #[command(subcommand)]
    pub(in crate::cli) command: Command,
}

const EXAMPLES: &str = "Examples:
  vug demo                                     a synthetic volume, several settings, one page to look at
  vug encode head.nrrd head.vug                4 bits per voxel, blocks of 4×4×4
  vug encode head.nii.gz head.vug --max-error 1%
  vug verify head.vug && vug info head.vug
  vug decode head.vug back.nrrd
  vug compare head.nrrd back.nrrd --json
  vug slice head.vug --axis z --index 100 -o slice.png
  vug render head.vug -o head.png --transfer ct-bone";

#[derive(Subcommand)]
pub(in crate::cli) enum Command {
    Demo(Demo),
    Encode(Encode),
    Decode(Decode),
    Info(Info),
    Verify(Verify),
    Compare(Compare),
    Slice(Slice),
    Append(Append),
    Extract(Extract),
    Pack(Pack),
    Recover(Recover),
    #[cfg(feature = "gpu")]
    Render(Box<Render>),
    Repack(Repack),
    #[cfg(feature = "gpu")]
    Tradeoff(Tradeoff),
}

impl Command {
    pub(in crate::cli) fn common(&self) -> &Common {
        match self {
            Command::Demo(c) => &c.common,
            Command::Encode(c) => &c.common,
            Command::Decode(c) => &c.common,
            Command::Info(c) => &c.common,
            Command::Verify(c) => &c.common,
            Command::Compare(c) => &c.common,
            Command::Slice(c) => &c.common,
            Command::Append(c) => &c.common,
            Command::Extract(c) => &c.common,
            Command::Pack(c) => &c.common,
            Command::Recover(c) => &c.common,
            #[cfg(feature = "gpu")]
            Command::Render(c) => &c.common,
            Command::Repack(c) => &c.common,
            #[cfg(feature = "gpu")]
            Command::Tradeoff(c) => &c.common,
        }
    }
}

#[derive(Args, Clone)]
pub(in crate::cli) struct Common {
    /// Print one JSON object on stdout instead of text
    #[arg(long)]
    pub(in crate::cli) json: bool,
    /// Print nothing but results and errors
    #[arg(short, long)]
    pub(in crate::cli) quiet: bool,
    /// Threads to use; default: one per core. The output does not depend on it
    #[arg(long, value_name = "N", value_parser = parse_jobs)]
    pub(in crate::cli) jobs: Option<usize>,
}

/// How to read files of other formats.
#[derive(Args, Clone, Default)]
pub(in crate::cli) struct Import {
    /// Shape of a raw file, in voxels: x fastest
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_extent)]
    pub(in crate::cli) shape: Option<Extent>,
    /// Time steps in a raw file, one after the other [default: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(in crate::cli) time_steps: Option<u32>,
    /// Channels in each time step of a raw file, one after the other [default: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(in crate::cli) channels: Option<u32>,
    /// Sample type. Of a raw file: what it stores, e.g. u16, i32be, f64. Of others: u8, u16, i16, f32 or rgb8 to convert to
    #[arg(long, value_name = "TYPE")]
    pub(in crate::cli) dtype: Option<Stored>,
}

/// Makes a synthetic volume, encodes it with several settings, verifies and pictures it: see DIR/index.html
#[derive(Args)]
#[command(after_help = "Examples:\n  vug demo\n  vug demo /tmp/demo --force")]
pub(in crate::cli) struct Demo {
    /// Folder for volumes, pictures and index.html
    #[arg(default_value = "vug-demo")]
    pub(in crate::cli) dir: PathBuf,
    /// Overwrite files that are there
    #[arg(long)]
    pub(in crate::cli) force: bool,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

/// Turns a .vug file back into a volume (NRRD, NIfTI, npy, raw, slices, by the target's name)
#[derive(Args)]
#[command(after_help = "Slices: a folder (slices/) takes 0000.png and so on; slice_####.tif says format and number.
PNG holds u8, u16 and rgb8; TIFF all types, and all slices as pages of one file (stack.tif);
JPEG u8 and rgb8, at quality 95: lossy. None of them keeps spacing, and none holds more than one volume.
A series keeps all time steps and channels, as a 4D or 5D file, unless --time or --channel chooses some.

Examples:
  vug decode head.vug back.nrrd
  vug decode head.vug part.npy --region 0:64,0:64,10:20     x, y, z; the end is not included
  vug decode head.vug small.nii.gz --level 1
  vug decode head.vug slices/                               or slices/s_####.tif
  vug decode fmri.vug step17.nii.gz --time 17               one time step; 10:20 are ten
  vug decode colour.vug small.nrrd --reduce 2               zerobit: a quarter of each axis, from the means it holds
  vug decode damaged.vug rest.nrrd --salvage                lost bricks become the null value; exit 1")]
pub(in crate::cli) struct Decode {
    /// .vug file
    pub(in crate::cli) source: PathBuf,
    /// File to write: .nrrd .nhdr .nii .nii.gz .hdr .npy .raw .tif; or slices: folder/, name_####.png .tif .jpg
    pub(in crate::cli) target: PathBuf,
    /// Time steps to decode, half open, or one of them; from 0 [default: all]
    #[arg(long, value_name = "K|A:B", value_parser = parse_span::<u32>)]
    pub(in crate::cli) time: Option<std::ops::Range<u32>>,
    /// Channels to decode, half open, or one of them; from 0 [default: all]
    #[arg(long, value_name = "K|A:B", value_parser = parse_span::<u32>)]
    pub(in crate::cli) channel: Option<std::ops::Range<u32>>,
    /// Level of detail; 0 is the finest
    #[arg(long, value_name = "L", default_value = "0")]
    pub(in crate::cli) level: u8,
    /// Halve the level's axes once or twice, from the means that zerobit bricks hold
    #[arg(long, value_name = "STEPS", value_parser = clap::value_parser!(u8).range(1..=2), conflicts_with = "salvage")]
    pub(in crate::cli) reduce: Option<u8>,
    /// Part to decode, in voxels of the level (after --reduce), half open
    #[arg(long, value_name = "X0:X1,Y0:Y1,Z0:Z1", value_parser = parse_region)]
    pub(in crate::cli) region: Option<Region>,
    /// Decode what is whole of a damaged file; lost bricks become the null value and are listed
    #[arg(long)]
    pub(in crate::cli) salvage: bool,
    /// Overwrite TARGET
    #[arg(long)]
    pub(in crate::cli) force: bool,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

/// Tells what a .vug file holds
#[derive(Args)]
#[command(after_help = "Examples:
  vug info head.vug
  vug info head.vug --json
  vug info colour.vug --codec-stats          zerobit: what was kept, null nodes, bytes of every part")]
pub(in crate::cli) struct Info {
    /// .vug file
    pub(in crate::cli) file: PathBuf,
    /// Look into every zerobit brick: ratios of kept coefficients and of null nodes, bytes of every part
    #[arg(long)]
    pub(in crate::cli) codec_stats: bool,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

/// Checks every byte of a .vug file against the spec
#[derive(Args)]
#[command(after_help = "Examples:\n  vug verify head.vug        exit 0: valid, 3: not\n  vug verify head.vug --json")]
pub(in crate::cli) struct Verify {
    /// .vug file
    pub(in crate::cli) file: PathBuf,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

/// Compares two volumes of any readable format, or two pictures: B against the reference A
#[derive(Args)]
#[command(
    after_help = "PSNR takes the range (max − min) of A as its peak. SSIM is the mean over z slices, 11×11 Gaussian window.
Two PNG files of 8 bits are compared as pictures, peak 255: MSE per channel and per pixel, PSNR, SSIM, MS-SSIM, FLIP, and
the shares of five classes of error.

Examples:
  vug compare head.nrrd back.nrrd
  vug compare head.nrrd head.vug --json --max-error 9     exit 1 where an error is larger
  vug compare reference.png view.png --diff error.png"
)]
pub(in crate::cli) struct Compare {
    /// Reference
    pub(in crate::cli) a: PathBuf,
    /// Volume to judge
    pub(in crate::cli) b: PathBuf,
    /// Exit with 1 where a voxel is off by more (sample units, or % of the range of A)
    #[arg(long, value_name = "E")]
    pub(in crate::cli) max_error: Option<Bound>,
    /// Exit with 1 where the PSNR is lower, in dB
    #[arg(long, value_name = "DB")]
    pub(in crate::cli) min_psnr: Option<f64>,
    /// Of two pictures: write where they differ, in colours of the error's class
    #[arg(long, value_name = "PNG")]
    pub(in crate::cli) diff: Option<PathBuf>,
    /// Overwrite the PNG
    #[arg(long)]
    pub(in crate::cli) force: bool,
    #[command(flatten)]
    pub(in crate::cli) import: Import,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

/// Writes a slice of a volume as PNG, or how it differs from another volume
#[derive(Args)]
#[command(
    after_help = "Orientation: z slices show x to the right and y down; y slices x right, z up; x slices y right, z up.
Difference images show |FILE − SOURCE| in classes of SOURCE's range: dark blue none, blue below 5 %, green to 10 %,
yellow to 15 %, red from 15 % on.

Examples:
  vug slice head.vug --axis z --index 100 -o slice.png
  vug slice ct.nii.gz --axis y --index 128 --range -200,400 --colormap viridis -o slice.png
  vug slice head.vug --axis z --index 100 --against head.nrrd -o difference.png"
)]
pub(in crate::cli) struct Slice {
    /// Volume: .vug or any other readable file
    pub(in crate::cli) file: PathBuf,
    /// Axis that the slice is perpendicular to: x, y or z
    #[arg(long, default_value = "z")]
    pub(in crate::cli) axis: Axis,
    /// Position along the axis, in voxels from 0 [default: the middle]
    #[arg(long, value_name = "K")]
    pub(in crate::cli) index: Option<u32>,
    /// PNG to write
    #[arg(short, long, value_name = "PNG")]
    pub(in crate::cli) output: PathBuf,
    /// Values that become black and white [default: the slice's range]
    #[arg(long, value_name = "LO,HI", value_parser = parse_range, allow_hyphen_values = true)]
    pub(in crate::cli) range: Option<(f64, f64)>,
    /// Colours instead of grey: viridis, magma, inferno, plasma, turbo, cividis, …
    #[arg(long, value_name = "NAME")]
    pub(in crate::cli) colormap: Option<String>,
    /// Picture the difference from this volume
    #[arg(long, value_name = "SOURCE", conflicts_with_all = ["range", "colormap"])]
    pub(in crate::cli) against: Option<PathBuf>,
    /// Time step of a series, from 0
    #[arg(long, value_name = "K", default_value = "0")]
    pub(in crate::cli) time: u32,
    /// Channel, from 0
    #[arg(long, value_name = "K", default_value = "0")]
    pub(in crate::cli) channel: u32,
    /// Level of detail of a .vug file
    #[arg(long, value_name = "L", default_value = "0")]
    pub(in crate::cli) level: u8,
    /// One pixel per voxel, whatever the spacing
    #[arg(long)]
    pub(in crate::cli) no_aspect: bool,
    /// Overwrite the PNG
    #[arg(long)]
    pub(in crate::cli) force: bool,
    #[command(flatten)]
    pub(in crate::cli) import: Import,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}
