//! The command line, declared.

use crate::convert::Stored;
use crate::error::{Error, Result};
use crate::geometry::{Extent, Region};
use crate::volume::{Axis, Bound};
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Compresses 3D volumes so that every voxel, plane, block, brick or region can be read alone.
///
/// Axis order is x, y, z everywhere, x fastest. Exit codes: 0 fine, 1 a result is over its bound or bricks were lost,
/// 2 wrong usage, 3 unreadable or corrupt input.
#[derive(Parser)]
#[command(name = "vug", version, propagate_version = true, after_help = EXAMPLES)]
pub(super) struct Vug {
    #[command(subcommand)]
    pub(super) command: Command,
}

const EXAMPLES: &str = "Examples:
  vug demo                                     a synthetic volume, several settings, one page to look at
  vug encode head.nrrd head.vug                4 bits per voxel, blocks of 4×4×4
  vug encode head.nii.gz head.vug --max-error 1%
  vug verify head.vug && vug info head.vug
  vug decode head.vug back.nrrd
  vug compare head.nrrd back.nrrd --json
  vug slice head.vug --axis z --index 100 -o slice.png";

#[derive(Subcommand)]
pub(super) enum Command {
    Demo(Demo),
    Encode(Encode),
    Decode(Decode),
    Info(Info),
    Verify(Verify),
    Compare(Compare),
    Slice(Slice),
}

impl Command {
    pub(super) fn common(&self) -> &Common {
        match self {
            Command::Demo(c) => &c.common,
            Command::Encode(c) => &c.common,
            Command::Decode(c) => &c.common,
            Command::Info(c) => &c.common,
            Command::Verify(c) => &c.common,
            Command::Compare(c) => &c.common,
            Command::Slice(c) => &c.common,
        }
    }
}

#[derive(Args, Clone)]
pub(super) struct Common {
    /// Print one JSON object on stdout instead of text
    #[arg(long)]
    pub(super) json: bool,
    /// Print nothing but results and errors
    #[arg(short, long)]
    pub(super) quiet: bool,
    /// Threads to use; default: one per core. The output does not depend on it
    #[arg(long, value_name = "N", value_parser = parse_jobs)]
    pub(super) jobs: Option<usize>,
}

/// How to read files of other formats.
#[derive(Args, Clone)]
pub(super) struct Import {
    /// Shape of a raw file, in voxels: x fastest
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_extent)]
    pub(super) shape: Option<Extent>,
    /// Sample type. Of a raw file: what it stores, e.g. u16, i32be, f64. Of others: u8, u16, i16, f32 or rgb8 to convert to
    #[arg(long, value_name = "TYPE")]
    pub(super) dtype: Option<Stored>,
}

/// Makes a synthetic volume, encodes it with several settings, verifies and pictures it: see DIR/index.html
#[derive(Args)]
#[command(after_help = "Examples:\n  vug demo\n  vug demo /tmp/demo --force")]
pub(super) struct Demo {
    /// Folder for volumes, pictures and index.html
    #[arg(default_value = "vug-demo")]
    pub(super) dir: PathBuf,
    /// Overwrite files that are there
    #[arg(long)]
    pub(super) force: bool,
    #[command(flatten)]
    pub(super) common: Common,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum CodecArg {
    /// Block minimum and maximum and an index per voxel
    S3dc,
    /// Wavelets on cells of 4³ voxels, vector-quantised: rgb8, u8, u16, i16
    Zerobit,
    /// Lossless
    Raw,
    /// s3dc (rgb8 under a bound: zerobit), or raw where that is no larger or holds a bound that they cannot
    Auto,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum EndpointsArg {
    /// True minimum and maximum of the block, as in the paper: smallest maximum error
    Minmax,
    /// Least squares: smaller mean error, larger maximum error
    Fitted,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum NanArg {
    /// Stop and name the first one
    Reject,
    /// Store the null value instead, and count them in the file
    Null,
}

/// Turns a volume (raw, npy, NRRD, NIfTI, a folder of slices) into a .vug file
#[derive(Args)]
#[command(
    after_help = "Quality: give --index-bits and/or --block (s3dc), or --keep (zerobit), or exactly one of --max-error, --psnr, --rate.
Without any: s3dc, 4 bits, blocks of 4×4×4, bricks of 64³, minmax; rgb8: raw. With a bound and no --codec: auto.
Explicit settings read raw and npy sources and stacks slab by slab, once; bounds read them twice, auto once more; zerobit three
times, and twice more for every ratio that a bound makes it try. NRRD and NIfTI that are compressed are held in memory.
A folder is a stack of PNG, TIFF or JPEG slices of one size and type, in natural order (2 before
10): 8- or 16-bit grey or 8-bit colour; TIFF also 32-bit and float grey, and pages as slices.

Examples:
  vug encode head.nrrd head.vug
  vug encode head.nrrd head.vug --index-bits 4 --block 16
  vug encode ct.nii.gz ct.vug --max-error 10          no voxel is off by more than 10
  vug encode ct.nii.gz ct.vug --max-error 0.5%        … of the volume's range
  vug encode turb.raw turb.vug --shape 512,512,512 --dtype f32 --psnr 50
  vug encode colour.nrrd colour.vug --keep 3%         zerobit: the largest 3 % of the wavelet coefficients
  vug encode colour.nrrd colour.vug --codec zerobit --psnr 30
  vug encode slices/ stack.vug --codec raw            slices/*.png, *.tif or *.jpg
  vug encode head.nrrd head.vug --no-zstd             to be mapped, or handed to the GPU as it is"
)]
pub(super) struct Encode {
    /// Volume to read: .nrrd .nhdr .nii .nii.gz .hdr .npy .raw .tif, or a folder of .png, .tif or .jpg slices
    pub(super) source: PathBuf,
    /// File to write
    pub(super) target: PathBuf,
    /// Codec
    #[arg(long, value_enum)]
    pub(super) codec: Option<CodecArg>,
    /// Bits per index: 1, 2, 4 or 8 [default: 4]
    #[arg(long, value_name = "BITS", conflicts_with_all = ["max_error", "psnr", "rate"], value_parser = parse_bits)]
    pub(super) index_bits: Option<u8>,
    /// Block in voxels, 1 to 128 per axis [default: 4]
    #[arg(long, value_name = "N|X,Y,Z", conflicts_with_all = ["max_error", "psnr", "rate"], value_parser = parse_block)]
    pub(super) block: Option<Extent>,
    /// Largest error of any voxel, in sample units, or in % of the range (max − min)
    #[arg(long, value_name = "E", conflicts_with_all = ["psnr", "rate"])]
    pub(super) max_error: Option<Bound>,
    /// Least PSNR in dB; the peak is the range of the source
    #[arg(long, value_name = "DB", conflicts_with = "rate")]
    pub(super) psnr: Option<f64>,
    /// Most payload bits per voxel, before zstd
    #[arg(long, value_name = "BITS")]
    pub(super) rate: Option<f64>,
    /// End points of a block
    #[arg(long, value_enum, default_value = "minmax")]
    pub(super) endpoints: EndpointsArg,
    #[command(flatten)]
    pub(super) zerobit: ZerobitArgs,
    /// Store only the cells of 4×4×4 voxels where this volume (any readable file of the same shape) is not 0; the rest
    /// becomes the null value. A raw mask has a byte per voxel
    #[arg(long, value_name = "MASK")]
    pub(super) select: Option<PathBuf>,
    /// Brick edge in voxels: 16, 32, 64, 128, 256 [default: 64, or as large as the block]
    #[arg(long, value_name = "N")]
    pub(super) brick: Option<u32>,
    /// Levels of detail, each half as large as the one before; 0: down to one brick
    #[arg(long, value_name = "N", default_value = "1")]
    pub(super) levels: u8,
    /// Store payloads as they go to the GPU, without zstd
    #[arg(long)]
    pub(super) no_zstd: bool,
    /// NaN and infinities
    #[arg(long, value_enum, default_value = "reject")]
    pub(super) nan: NanArg,
    /// Value of voxels that need not be stored (background)
    #[arg(long, value_name = "V", default_value = "0", allow_negative_numbers = true)]
    pub(super) null_value: f64,
    /// Keep no free text of the source's header: it can name patients
    #[arg(long)]
    pub(super) strip_metadata: bool,
    /// File id, 32 hex digits, instead of one made from the content
    #[arg(long, value_name = "HEX", value_parser = parse_file_id)]
    pub(super) file_id: Option<[u8; 16]>,
    /// Overwrite TARGET
    #[arg(long)]
    pub(super) force: bool,
    #[command(flatten)]
    pub(super) import: Import,
    #[command(flatten)]
    pub(super) common: Common,
}

/// What only zerobit has; any of these without --codec means zerobit.
#[derive(Args, Clone)]
pub(super) struct ZerobitArgs {
    /// Zerobit: wavelet coefficients to keep, in % of the number of voxels, of selected ones with --select (or as a ratio from 0 to 1) [default: 3%]
    #[arg(long, value_name = "P%", conflicts_with_all = ["max_error", "psnr", "rate"], value_parser = parse_keep)]
    pub(super) keep: Option<u32>,
    /// Zerobit: thresholds by 16³ voxels, or one for the whole level [default: adaptive]
    #[arg(long, value_enum)]
    pub(super) threshold: Option<ThresholdArg>,
    /// Zerobit: what makes a coefficient large [default: energy]
    #[arg(long, value_enum)]
    pub(super) norm: Option<NormArg>,
    /// Zerobit: how codebooks are trained [default: median-cut]
    #[arg(long, value_enum)]
    pub(super) training: Option<TrainingArg>,
    /// Zerobit: cubes of N bricks per axis share a codebook [default: all bricks of a level]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) codebook_region: Option<u32>,
    /// Zerobit: layout of the stream; old is the scheme that the paper compares with [default: new]
    #[arg(long, value_enum)]
    pub(super) stream: Option<StreamArg>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum ThresholdArg {
    /// Each unit block of 16³ voxels gets its share
    Adaptive,
    /// One threshold for the whole level
    Global,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum NormArg {
    /// The squared error that it causes
    Energy,
    /// Its plain square, as the paper prints it
    Plain,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum TrainingArg {
    /// Median cut, as in the paper
    MedianCut,
    /// Median cut, then k-means: slower, a little better
    Refined,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum StreamArg {
    /// Zerobits and significance maps
    New,
    /// 64 flags per cell
    Old,
}

/// Turns a .vug file back into a volume (NRRD, NIfTI, npy, raw, slices, by the target's name)
#[derive(Args)]
#[command(after_help = "Slices: a folder (slices/) takes 0000.png and so on; slice_####.tif says format and number.
PNG holds u8, u16 and rgb8; TIFF all types, and all slices as pages of one file (stack.tif);
JPEG u8 and rgb8, at quality 95: lossy. None of them keeps spacing.

Examples:
  vug decode head.vug back.nrrd
  vug decode head.vug part.npy --region 0:64,0:64,10:20     x, y, z; the end is not included
  vug decode head.vug small.nii.gz --level 1
  vug decode head.vug slices/                               or slices/s_####.tif
  vug decode colour.vug small.nrrd --reduce 2               zerobit: a quarter of each axis, from the means it holds
  vug decode damaged.vug rest.nrrd --salvage                lost bricks become the null value; exit 1")]
pub(super) struct Decode {
    /// .vug file
    pub(super) source: PathBuf,
    /// File to write: .nrrd .nhdr .nii .nii.gz .hdr .npy .raw .tif; or slices: folder/, name_####.png .tif .jpg
    pub(super) target: PathBuf,
    /// Level of detail; 0 is the finest
    #[arg(long, value_name = "L", default_value = "0")]
    pub(super) level: u8,
    /// Halve the level's axes once or twice, from the means that zerobit bricks hold
    #[arg(long, value_name = "STEPS", value_parser = clap::value_parser!(u8).range(1..=2), conflicts_with = "salvage")]
    pub(super) reduce: Option<u8>,
    /// Part to decode, in voxels of the level (after --reduce), half open
    #[arg(long, value_name = "X0:X1,Y0:Y1,Z0:Z1", value_parser = parse_region)]
    pub(super) region: Option<Region>,
    /// Decode what is whole of a damaged file; lost bricks become the null value and are listed
    #[arg(long)]
    pub(super) salvage: bool,
    /// Overwrite TARGET
    #[arg(long)]
    pub(super) force: bool,
    #[command(flatten)]
    pub(super) common: Common,
}

/// Tells what a .vug file holds
#[derive(Args)]
#[command(after_help = "Examples:
  vug info head.vug
  vug info head.vug --json
  vug info colour.vug --codec-stats          zerobit: what was kept, null nodes, bytes of every part")]
pub(super) struct Info {
    /// .vug file
    pub(super) file: PathBuf,
    /// Look into every zerobit brick: ratios of kept coefficients and of null nodes, bytes of every part
    #[arg(long)]
    pub(super) codec_stats: bool,
    #[command(flatten)]
    pub(super) common: Common,
}

/// Checks every byte of a .vug file against the spec
#[derive(Args)]
#[command(after_help = "Examples:\n  vug verify head.vug        exit 0: valid, 3: not\n  vug verify head.vug --json")]
pub(super) struct Verify {
    /// .vug file
    pub(super) file: PathBuf,
    #[command(flatten)]
    pub(super) common: Common,
}

/// Compares two volumes of any readable format: B against the reference A
#[derive(Args)]
#[command(
    after_help = "PSNR takes the range (max − min) of A as its peak. SSIM is the mean over z slices, 11×11 Gaussian window.

Examples:
  vug compare head.nrrd back.nrrd
  vug compare head.nrrd head.vug --json --max-error 9     exit 1 where an error is larger"
)]
pub(super) struct Compare {
    /// Reference
    pub(super) a: PathBuf,
    /// Volume to judge
    pub(super) b: PathBuf,
    /// Exit with 1 where a voxel is off by more (sample units, or % of the range of A)
    #[arg(long, value_name = "E")]
    pub(super) max_error: Option<Bound>,
    /// Exit with 1 where the PSNR is lower, in dB
    #[arg(long, value_name = "DB")]
    pub(super) min_psnr: Option<f64>,
    #[command(flatten)]
    pub(super) import: Import,
    #[command(flatten)]
    pub(super) common: Common,
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
pub(super) struct Slice {
    /// Volume: .vug or any other readable file
    pub(super) file: PathBuf,
    /// Axis that the slice is perpendicular to: x, y or z
    #[arg(long, default_value = "z")]
    pub(super) axis: Axis,
    /// Position along the axis, in voxels from 0 [default: the middle]
    #[arg(long, value_name = "K")]
    pub(super) index: Option<u32>,
    /// PNG to write
    #[arg(short, long, value_name = "PNG")]
    pub(super) output: PathBuf,
    /// Values that become black and white [default: the slice's range]
    #[arg(long, value_name = "LO,HI", value_parser = parse_range, allow_hyphen_values = true)]
    pub(super) range: Option<(f64, f64)>,
    /// Colours instead of grey: viridis, magma, inferno, plasma, turbo, cividis, …
    #[arg(long, value_name = "NAME")]
    pub(super) colormap: Option<String>,
    /// Picture the difference from this volume
    #[arg(long, value_name = "SOURCE", conflicts_with_all = ["range", "colormap"])]
    pub(super) against: Option<PathBuf>,
    /// Level of detail of a .vug file
    #[arg(long, value_name = "L", default_value = "0")]
    pub(super) level: u8,
    /// One pixel per voxel, whatever the spacing
    #[arg(long)]
    pub(super) no_aspect: bool,
    /// Overwrite the PNG
    #[arg(long)]
    pub(super) force: bool,
    #[command(flatten)]
    pub(super) import: Import,
    #[command(flatten)]
    pub(super) common: Common,
}

fn numbers<T: std::str::FromStr>(s: &str, separator: char) -> Option<Vec<T>> {
    s.split(separator).map(|part| part.trim().parse().ok()).collect()
}

fn parse_jobs(s: &str) -> Result<usize, String> {
    s.parse().ok().filter(|n| (1..=1024).contains(n)).ok_or_else(|| "wants a number from 1 to 1024".into())
}

fn parse_extent(s: &str) -> Result<Extent> {
    match numbers::<u32>(s, ',').as_deref() {
        Some(&[x, y, z]) => Extent::new(x, y, z).check().map(|()| Extent::new(x, y, z)),
        _ => Err(Error::param("shape", format!("{s:?} is not X,Y,Z"))),
    }
}

fn parse_bits(s: &str) -> Result<u8, String> {
    s.parse().ok().filter(|n| [1, 2, 4, 8].contains(n)).ok_or_else(|| "wants 1, 2, 4 or 8".into())
}

/// A ratio in millionths.
fn parse_keep(s: &str) -> Result<u32, String> {
    let (number, unit) = s.strip_suffix('%').map_or((s, 1e6), |percent| (percent, 1e4));
    match number.trim().parse::<f64>() {
        Ok(v) if v >= 0.0 && v * unit <= 1e6 => Ok((v * unit).round() as u32),
        Ok(v) if v > 1.0 && v <= 100.0 && unit == 1e6 => Err(format!("{v} is a ratio above 1; is {v}% meant?")),
        _ => Err("wants a ratio from 0% to 100%, or from 0 to 1".into()),
    }
}

fn parse_block(s: &str) -> Result<Extent, String> {
    let block = match numbers::<u32>(s, ',').as_deref() {
        Some(&[n]) => Extent::cube(n),
        Some(&[x, y, z]) => Extent::new(x, y, z),
        _ => return Err("wants N or X,Y,Z".into()),
    };
    if block.to_array().iter().all(|n| (1..=128).contains(n)) {
        return Ok(block);
    }
    Err("wants 1 to 128 voxels per axis".into())
}

fn parse_region(s: &str) -> Result<Region, String> {
    let axes: Option<Vec<Vec<u32>>> = s.split(',').map(|axis| numbers(axis, ':')).collect();
    match axes.as_deref() {
        Some([x, y, z]) if [x, y, z].iter().all(|a| a.len() == 2) => {
            Ok(Region { start: [x[0], y[0], z[0]], end: [x[1], y[1], z[1]] })
        }
        _ => Err("wants X0:X1,Y0:Y1,Z0:Z1".into()),
    }
}

fn parse_range(s: &str) -> Result<(f64, f64), String> {
    match numbers::<f64>(s, ',').as_deref() {
        Some(&[lo, hi]) if lo.is_finite() && hi.is_finite() && lo <= hi => Ok((lo, hi)),
        _ => Err("wants LO,HI with LO ≤ HI".into()),
    }
}

fn parse_file_id(s: &str) -> Result<[u8; 16], String> {
    let digits = (s.len() == 32 && s.is_ascii()).then(|| u128::from_str_radix(s, 16).ok()).flatten();
    digits.map(u128::to_be_bytes).ok_or_else(|| "wants 32 hex digits".into())
}
