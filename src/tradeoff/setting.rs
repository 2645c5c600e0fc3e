//! What a volume is encoded with, and what that does to it.

use super::gradient_correlation;
use crate::codec::s3dc::{Endpoints, Params, formula_ratio};
use crate::error::Result;
use crate::geometry::Extent;
use crate::grid::Grid;
use crate::limits::Limits;
use crate::source::MemorySource;
use crate::volume::{self, At, CodecChoice, EncodeOptions, Quality, Volume};
use std::io::Cursor;
use std::sync::Arc;

/// What the volume is stored as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// Uncompressed.
    Raw,
    /// S3Dc with these parameters.
    S3dc(Params),
}

impl Setting {
    /// S3Dc with cubic blocks, minima and maxima.
    ///
    /// # Errors
    /// Those of [`Params::new`].
    pub fn s3dc(index_bits: u8, block: u32) -> Result<Self> {
        Ok(Setting::S3dc(Params::new(index_bits, Extent::cube(block), Endpoints::MinMax)?))
    }

    /// A name for people: `raw`, `4 bit, 16³`.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Setting::Raw => "raw".into(),
            Setting::S3dc(p) if p.block() == Extent::cube(p.block().x) => {
                format!("{} bit, {}³", p.i_bits(), p.block().x)
            }
            Setting::S3dc(p) => format!("{} bit, {}", p.i_bits(), p.block()),
        }
    }

    /// A name for files: `raw`, `i4-b16`.
    #[must_use]
    pub fn stem(&self) -> String {
        match self {
            Setting::Raw => "raw".into(),
            Setting::S3dc(p) => {
                let [x, y, z] = p.block().to_array();
                let block = if x == y && y == z { x.to_string() } else { format!("{x}x{y}x{z}") };
                format!("i{}-b{block}", p.i_bits())
            }
        }
    }

    /// Bits per index, where there are indices.
    #[must_use]
    pub fn index_bits(&self) -> Option<u8> {
        match self {
            Setting::Raw => None,
            Setting::S3dc(p) => Some(p.i_bits()),
        }
    }

    /// Longest edge of the blocks, where there are blocks.
    #[must_use]
    pub fn block(&self) -> Option<u32> {
        match self {
            Setting::Raw => None,
            Setting::S3dc(p) => p.block().to_array().into_iter().max(),
        }
    }

    /// Encodes a volume in memory and compares what comes out with what went in: figures, and the encoded volume. Of `base` the setting replaces codec,
    /// quality, end points and zstd; placement and value map are kept.
    ///
    /// # Errors
    /// Those of the encoder.
    pub fn encode(&self, grid: &mut Grid, base: &EncodeOptions) -> Result<(Encoded, Arc<Volume>)> {
        let mut options = EncodeOptions { zstd: false, codec: CodecChoice::S3dc, ..base.clone() };
        match self {
            Setting::Raw => options.codec = CodecChoice::Raw,
            Setting::S3dc(p) => {
                options.quality = Quality::Explicit { index_bits: p.i_bits(), block: p.block() };
                options.endpoints = p.endpoints();
            }
        }
        let mut file = Cursor::new(Vec::new());
        let report = volume::encode(grid, &mut file, &options, &mut |_, _| {})?;
        let volume = Volume::open(MemorySource(file.into_inner()), Limits::default())?;
        let sample_bits = 8 * grid.sample_type().bytes() as u32;
        let (ratio_formula, concentration) = match self {
            Setting::Raw => (1.0, None),
            Setting::S3dc(p) => {
                let bits = sample_bits / grid.sample_type().components() as u32;
                let decoded = volume.read(At::default())?;
                (formula_ratio(grid.extent(), bits, p), gradient_correlation(grid, &decoded)?)
            }
        };
        let encoded = Encoded {
            setting: *self,
            ratio_formula,
            ratio_payload: report.ratio_payload,
            bits_per_voxel: f64::from(sample_bits) / report.ratio_payload,
            max_error: report.max_error,
            rmse: report.rmse,
            psnr: report.psnr,
            concentration,
        };
        Ok((encoded, Arc::new(volume)))
    }
}

/// What a setting makes of a volume: its size, and how far it is from the source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoded {
    /// What it was encoded with.
    pub setting: Setting,
    /// Original bytes / bytes by the paper's formula; 1 for raw.
    pub ratio_formula: f64,
    /// Original bytes / bytes of payloads; bricks of one value take none.
    pub ratio_payload: f64,
    /// Bits of payload per voxel.
    pub bits_per_voxel: f64,
    /// Largest error of a voxel.
    pub max_error: f64,
    /// Root of the mean squared error of voxels.
    pub rmse: f64,
    /// PSNR of voxels in dB, peak = range of the source; `None`: infinite or undefined.
    pub psnr: Option<f64>,
    /// Correlation of error and gradient, see [`gradient_correlation`].
    pub concentration: Option<f64>,
}
