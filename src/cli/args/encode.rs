//! `vug encode`, declared.

use super::parse::{parse_bits, parse_block, parse_bytes, parse_file_id, parse_keep, parse_levels};
use super::{Common, Import};
use crate::geometry::Extent;
use crate::volume::Bound;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum CodecArg {
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
pub(in crate::cli) enum EndpointsArg {
    /// True minimum and maximum of the block, as in the paper: smallest maximum error
    Minmax,
    /// Least squares: smaller mean error, larger maximum error
    Fitted,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum DownsampleArg {
    /// Mean of the voxels that a coarse one covers
    Mean,
    /// The smallest of them
    Min,
    /// The largest of them
    Max,
    /// The one in the middle
    Nearest,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum NanArg {
    /// Stop and name the first one
    Reject,
    /// Store the null value instead, and count them in the file
    Null,
}

/// Turns a volume or a series of them (raw, npy, NRRD, NIfTI, a folder of slices or of volumes, a pipe) into a .vug file
#[derive(Args)]
#[command(
    after_help = "Quality: give --index-bits and/or --block (s3dc), or --keep (zerobit), or exactly one of --max-error, --psnr, --rate.
Without any: s3dc, 4 bits, blocks of 4×4×4, bricks of 64³, minmax; rgb8: raw. With a bound and no --codec: auto.
Explicit settings read raw and npy sources and stacks slab by slab, once; bounds read them twice, auto once more; zerobit three
times, and twice more for every ratio that a bound makes it try. NRRD and NIfTI that are compressed are unpacked to memory,
or to a temporary file where they take more than half of --memory.
A folder is a stack of PNG, TIFF or JPEG slices of one size and type, in natural order (2 before
10): 8- or 16-bit grey or 8-bit colour; TIFF also 32-bit and float grey, and pages as slices.
Or it holds volumes of one shape and type, which are the time steps of a series; so does a name with #### for the number of
the step. 4D and 5D files (NRRD, NIfTI, npy as time, channel, z, y, x) are series, too, and so are raw files with --time-steps
or --channels. - is the standard input, of raw samples, as any pipe.

Examples:
  vug encode head.nrrd head.vug
  vug encode head.nrrd head.vug --index-bits 4 --block 16
  vug encode ct.nii.gz ct.vug --max-error 10          no voxel is off by more than 10
  vug encode ct.nii.gz ct.vug --max-error 0.5%        … of the volume's range
  vug encode turb.raw turb.vug --shape 512,512,512 --dtype f32 --psnr 50
  vug encode colour.nrrd colour.vug --keep 3%         zerobit: the largest 3 % of the wavelet coefficients
  vug encode colour.nrrd colour.vug --codec zerobit --psnr 30
  vug encode slices/ stack.vug --codec raw            slices/*.png, *.tif or *.jpg
  vug encode fmri.nii.gz fmri.vug --codec raw         all time steps, and their times
  vug encode step_####.nrrd flow.vug --psnr 50
  produce | vug encode - out.vug --shape 512,512,512 --dtype u16
  vug encode big.raw big.vug --shape 8192,8192,4096 --dtype u8 --levels auto --memory 2G
  vug encode segmentation.nrrd labels.vug --labels --levels auto
  vug encode head.nrrd head.vug --no-zstd             to be mapped, or handed to the GPU as it is"
)]
pub(in crate::cli) struct Encode {
    /// Volume to read: .nrrd .nhdr .nii .nii.gz .hdr .npy .raw .tif, a folder of slices or of time steps, or - for raw samples
    pub(in crate::cli) source: PathBuf,
    /// File to write; - for standard output, as a log
    pub(in crate::cli) target: PathBuf,
    /// Codec
    #[arg(long, value_enum)]
    pub(in crate::cli) codec: Option<CodecArg>,
    /// Bits per index: 1, 2, 4 or 8 [default: 4]
    #[arg(long, value_name = "BITS", conflicts_with_all = ["max_error", "psnr", "rate"], value_parser = parse_bits)]
    pub(in crate::cli) index_bits: Option<u8>,
    /// Block in voxels, 1 to 128 per axis [default: 4]
    #[arg(long, value_name = "N|X,Y,Z", conflicts_with_all = ["max_error", "psnr", "rate"], value_parser = parse_block)]
    pub(in crate::cli) block: Option<Extent>,
    /// Largest error of any voxel, in sample units, or in % of the range (max − min)
    #[arg(long, value_name = "E", conflicts_with_all = ["psnr", "rate"])]
    pub(in crate::cli) max_error: Option<Bound>,
    /// Least PSNR in dB; the peak is the range of the source
    #[arg(long, value_name = "DB", conflicts_with = "rate")]
    pub(in crate::cli) psnr: Option<f64>,
    /// Most payload bits per voxel, before zstd
    #[arg(long, value_name = "BITS")]
    pub(in crate::cli) rate: Option<f64>,
    /// End points of a block
    #[arg(long, value_enum, default_value = "minmax")]
    pub(in crate::cli) endpoints: EndpointsArg,
    #[command(flatten)]
    pub(in crate::cli) zerobit: ZerobitArgs,
    /// Store only the cells of 4×4×4 voxels where this volume (any readable file of the same shape) is not 0; the rest
    /// becomes the null value. A raw mask has a byte per voxel
    #[arg(long, value_name = "MASK")]
    pub(in crate::cli) select: Option<PathBuf>,
    /// Brick edge in voxels: 16, 32, 64, 128, 256 [default: 64, or as large as the block]
    #[arg(long, value_name = "N")]
    pub(in crate::cli) brick: Option<u32>,
    /// Levels of detail, each half as large as the one before: a number, or auto, down to one brick
    #[arg(long, value_name = "N|auto", default_value = "1", value_parser = parse_levels)]
    pub(in crate::cli) levels: u8,
    /// How a coarser voxel is made of those it covers [default: mean; labels: nearest]
    #[arg(long, value_enum, value_name = "OPERATOR")]
    pub(in crate::cli) downsample: Option<DownsampleArg>,
    /// The numbers are labels: stored without loss, coarser levels take the nearest. Sources that say so need no flag
    #[arg(long)]
    pub(in crate::cli) labels: bool,
    /// Memory to keep within, with K, M or G behind it; slabs that do not fit go to temporary files
    #[arg(long, value_name = "BYTES", default_value = "1G", value_parser = parse_bytes)]
    pub(in crate::cli) memory: u64,
    /// Folder for temporary files [default: the system's]
    #[arg(long, value_name = "DIR")]
    pub(in crate::cli) temp_dir: Option<PathBuf>,
    /// Store payloads as they go to the GPU, without zstd
    #[arg(long)]
    pub(in crate::cli) no_zstd: bool,
    /// NaN and infinities
    #[arg(long, value_enum, default_value = "reject")]
    pub(in crate::cli) nan: NanArg,
    /// Value of voxels that need not be stored (background)
    #[arg(long, value_name = "V", default_value = "0", allow_negative_numbers = true)]
    pub(in crate::cli) null_value: f64,
    /// Scene (TOML) that the file is to hold: `vug render TARGET` then shows it so
    #[arg(long, value_name = "TOML")]
    pub(in crate::cli) scene: Option<PathBuf>,
    /// Keep no free text of the source's header: it can name patients
    #[arg(long)]
    pub(in crate::cli) strip_metadata: bool,
    /// File id, 32 hex digits, instead of one made from the content
    #[arg(long, value_name = "HEX", value_parser = parse_file_id)]
    pub(in crate::cli) file_id: Option<[u8; 16]>,
    /// Write a log: front to back, readable up to its last commit even if the writer is killed, and open to `vug append`
    #[arg(long)]
    pub(in crate::cli) log: bool,
    /// Overwrite TARGET
    #[arg(long)]
    pub(in crate::cli) force: bool,
    #[command(flatten)]
    pub(in crate::cli) import: Import,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

/// What only zerobit has; any of these without --codec means zerobit.
#[derive(Args, Clone)]
pub(in crate::cli) struct ZerobitArgs {
    /// Zerobit: wavelet coefficients to keep, in % of the number of voxels, of selected ones with --select (or as a ratio from 0 to 1) [default: 3%]
    #[arg(long, value_name = "P%", conflicts_with_all = ["max_error", "psnr", "rate"], value_parser = parse_keep)]
    pub(in crate::cli) keep: Option<u32>,
    /// Zerobit: thresholds by 16³ voxels, or one for the whole level [default: adaptive]
    #[arg(long, value_enum)]
    pub(in crate::cli) threshold: Option<ThresholdArg>,
    /// Zerobit: what makes a coefficient large [default: energy]
    #[arg(long, value_enum)]
    pub(in crate::cli) norm: Option<NormArg>,
    /// Zerobit: how codebooks are trained [default: median-cut]
    #[arg(long, value_enum)]
    pub(in crate::cli) training: Option<TrainingArg>,
    /// Zerobit: cubes of N bricks per axis share a codebook [default: all bricks of a level]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(in crate::cli) codebook_region: Option<u32>,
    /// Zerobit: layout of the stream; old is the scheme that the paper compares with [default: new]
    #[arg(long, value_enum)]
    pub(in crate::cli) stream: Option<StreamArg>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum ThresholdArg {
    /// Each unit block of 16³ voxels gets its share
    Adaptive,
    /// One threshold for the whole level
    Global,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum NormArg {
    /// The squared error that it causes
    Energy,
    /// Its plain square, as the paper prints it
    Plain,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum TrainingArg {
    /// Median cut, as in the paper
    MedianCut,
    /// Median cut, then k-means: slower, a little better
    Refined,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum StreamArg {
    /// Zerobits and significance maps
    New,
    /// 64 flags per cell
    Old,
}
