//! What an encoder may choose: codec, quality, bricks, and what to do with values that a block cannot hold.

use super::selection::Selection;
use crate::affine::{Placement, ValueMap};
use crate::codec::s3dc::Endpoints;
use crate::codec::zerobit;
use crate::container::Downsample;
use crate::error::{Error, Result};
use crate::geometry::Extent;
use crate::limits;
use crate::time::Times;
use std::path::PathBuf;

/// Which codec stores the bricks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum CodecChoice {
    /// S3Dc: block minimum and maximum and an index per voxel. Where a bound cannot be met, it is an error.
    S3dc,
    /// Haar wavelets on cells of 4³ voxels, vector-quantised: for colour and for sparse volumes of integers.
    Zerobit,
    /// Lossless samples.
    Raw,
    /// S3Dc, for rgb8 zerobit under a bound or rate; but `raw` where that is no larger, or where no bound is met or given.
    #[default]
    Auto,
}

/// How index bits and block are found. Exactly one way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quality {
    /// Given: bits per index (1, 2, 4, 8) and block (1 to 128 voxels per axis).
    Explicit {
        /// Bits per index: 1, 2, 4 or 8.
        index_bits: u8,
        /// Block extent in voxels.
        block: Extent,
    },
    /// Zerobit: this ratio of coefficients is kept, in millionths of the number of voxels.
    Keep(u32),
    /// The smallest payload, among 1, 2, 4, 8 bits and blocks of 2³ to 32³, of which no voxel is further from the source than this, after rounding.
    MaxError(Bound),
    /// The smallest payload whose PSNR (peak: range of the source) reaches this, in dB.
    Psnr(f64),
    /// The best PSNR whose payload before zstd, all levels, takes at most this many bits per voxel of level 0.
    Rate(f64),
}

/// A bound on the error of each voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// In units of the stored samples.
    Absolute(f64),
    /// In per cent of the source's range (max − min).
    Percent(f64),
}

impl std::str::FromStr for Bound {
    type Err = Error;
    fn from_str(s: &str) -> Result<Self> {
        let (number, bound): (&str, fn(f64) -> Bound) = match s.strip_suffix('%') {
            Some(number) => (number, Bound::Percent),
            None => (s, Bound::Absolute),
        };
        match number.trim().parse::<f64>() {
            Ok(v) if v >= 0.0 && v.is_finite() => Ok(bound(v)),
            _ => Err(Error::param("max-error", format!("{s:?} is not a number ≥ 0, alone or with %"))),
        }
    }
}

/// What the zerobit encoder may choose. Decoders need not know.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct ZerobitOptions {
    /// Layout of the unit blocks: zerobits, or the flags of the scheme before.
    pub stream: zerobit::Stream,
    /// Thresholds by unit block or for the whole level.
    pub threshold: zerobit::Threshold,
    /// What makes a coefficient large.
    pub norm: zerobit::Norm,
    /// How codebooks are trained.
    pub training: zerobit::Training,
    /// Bricks per axis that share a codebook; `None`: all of a level.
    pub codebook_region: Option<u32>,
}

impl ZerobitOptions {
    /// The codec's parameters for a ratio to keep.
    ///
    /// # Errors
    /// `E_PARAM` above 1,000,000 millionths.
    pub(super) fn params(&self, keep_ppm: u32, selection: Option<&Selection>) -> Result<zerobit::Params> {
        let mut params = zerobit::Params::new(keep_ppm)?;
        (params.threshold, params.norm, params.training) = (self.threshold, self.norm, self.training);
        params.selected = selection.map_or(0, |s| s.voxels(0));
        Ok(params)
    }
}

/// What to do with NaN and infinities, which no bound or block can hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum NonFinite {
    /// Stop with `E_NONFINITE` and the coordinate of the first.
    #[default]
    Reject,
    /// Store the null value instead; the file says how many were replaced.
    Null,
}

/// All choices of an encoder. The default is the paper's: 4 bits, 4³ blocks, minima and maxima.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodeOptions {
    /// Which codec stores the bricks.
    pub codec: CodecChoice,
    /// How index bits and block are found.
    pub quality: Quality,
    /// How the two end points of a block are chosen.
    pub endpoints: Endpoints,
    /// What zerobit may choose besides quality.
    pub zerobit: ZerobitOptions,
    /// Cells that are stored; voxels of all others become the null value. `None`: all.
    pub selection: Option<Selection>,
    /// Edge of a brick in voxels: 16, 32, 64, 128 or 256. `None`: 64, or more where the block is larger.
    pub brick: Option<u32>,
    /// Whether payloads are compressed with zstd where that makes them smaller.
    pub zstd: bool,
    /// Levels of detail; level n halves the volume n times. 0: as many as it takes to fit one brick.
    pub levels: u8,
    /// How the voxels of coarser levels are made.
    pub downsample: Downsample,
    /// What to do with NaN and infinities.
    pub non_finite: NonFinite,
    /// Value of voxels that are not stored, per component; bricks full of it cost nothing.
    pub null_value: f64,
    /// Where the volume lies.
    pub placement: Placement,
    /// What the stored numbers mean.
    pub value_map: ValueMap,
    /// Text for the `META` section: UTF-8 JSON.
    pub meta: Option<String>,
    /// Text for the `SCNE` section: how the volume is meant to be seen.
    pub scene: Option<String>,
    /// The time of each step of a series.
    pub times: Option<Times>,
    /// File id instead of the one made from the content.
    pub file_id: Option<[u8; 16]>,
    /// Bytes of memory that the encoder keeps within, as far as it can know; what does not fit goes to temporary files.
    pub memory: u64,
    /// Where temporary files go; `None`: the system's folder for them. They have no name and vanish with the process.
    pub temp_dir: Option<PathBuf>,
}

impl Default for EncodeOptions {
    fn default() -> Self {
        EncodeOptions {
            codec: CodecChoice::S3dc,
            quality: Quality::Explicit { index_bits: 4, block: Extent::cube(4) },
            endpoints: Endpoints::MinMax,
            zerobit: ZerobitOptions::default(),
            selection: None,
            brick: None,
            zstd: true,
            levels: 1,
            downsample: Downsample::Mean,
            non_finite: NonFinite::Reject,
            null_value: 0.0,
            placement: Placement::default(),
            value_map: ValueMap::default(),
            meta: None,
            scene: None,
            times: None,
            file_id: None,
            memory: 1 << 30,
            temp_dir: None,
        }
    }
}

impl EncodeOptions {
    /// log2 of the brick edge for blocks of up to `block`.
    pub(super) fn brick_log2(&self, block: Extent) -> Result<u8> {
        let largest = block.x.max(block.y).max(block.z);
        let edge = self.brick.unwrap_or_else(|| largest.next_power_of_two().max(64));
        let log2 = edge.trailing_zeros() as u8;
        if !edge.is_power_of_two() || !limits::BRICK_LOG2.contains(&log2) {
            return Err(Error::param("brick", format!("{edge} is not one of 16, 32, 64, 128, 256")));
        }
        if largest > edge {
            return Err(Error::param(
                "brick",
                format!("a brick of {edge} voxels is smaller than the block of {block}"),
            ));
        }
        Ok(log2)
    }

    /// Levels of detail for a volume of `extent`, bricks of `1 << log2`.
    pub(super) fn lod_count(&self, extent: Extent, log2: u8) -> Result<u8> {
        let longest = extent.x.max(extent.y).max(extent.z);
        let full = (0..limits::MAX_LODS).find(|&l| longest.div_ceil(1 << l) <= 1 << log2);
        let full = 1 + full.unwrap_or(limits::MAX_LODS - 1);
        match self.levels {
            0 => Ok(full),
            n if n <= full => Ok(n),
            n => Err(Error::param(
                "levels",
                format!("{n} levels asked for, but level {} of {extent} fits one brick already", full - 1),
            )),
        }
    }
}
