//! What an encoder tells of its work.

use crate::codec::{s3dc, zerobit};

/// What was written, and how well. Errors are those of level 0 against the source, in units of the stored samples.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodeReport {
    /// `s3dc`, `zerobit` or `raw`.
    pub codec: &'static str,
    /// S3Dc parameters, where it is S3Dc.
    pub s3dc: Option<s3dc::Params>,
    /// Zerobit parameters, where it is zerobit.
    pub zerobit: Option<zerobit::Params>,
    /// Codebooks in the file.
    pub codebooks: u64,
    /// Voxels that were selected, where a selection was encoded. Errors are over these; all others are the null value.
    pub selected: Option<u64>,
    /// Largest error of a voxel.
    pub max_error: f64,
    /// Mean absolute error.
    pub mean_error: f64,
    /// Root of the mean squared error.
    pub rmse: f64,
    /// Peak signal-to-noise ratio in dB, peak = range of the source; `None`: infinite or undefined.
    pub psnr: Option<f64>,
    /// Smallest and largest value of the source.
    pub source_range: (f64, f64),
    /// Original bytes / bytes by the paper's formula, with ceilings (S3Dc §3.3); `None` where the codec has none.
    pub ratio_formula: Option<f64>,
    /// Original bytes / bytes of payloads before zstd and of codebooks, all levels.
    pub ratio_payload: f64,
    /// Original bytes / file bytes.
    pub ratio_file: f64,
    /// File bits per voxel of level 0.
    pub bits_per_voxel: f64,
    /// File length in bytes.
    pub bytes: u64,
    /// Bricks: stored, constant, empty.
    pub bricks: [u64; 3],
    /// Bytes that lossless bricks would have taken instead of the stored ones, where that was weighed.
    pub lossless_bytes: Option<u64>,
    /// Bytes of all stored payloads.
    pub stored_bytes: u64,
    /// NaN and infinities that were replaced by the null value.
    pub replaced: u64,
    /// Remarks for people.
    pub notes: Vec<String>,
}
