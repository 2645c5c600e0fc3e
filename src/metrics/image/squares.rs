//! Squared errors of images, summed as whole numbers, and PSNR that is infinite where there is no error.

use super::RgbImage;
use crate::error::{Error, Result};

/// Sums over the differences of two images. Whole numbers: no order of merging changes them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SquaredError {
    /// Sum of (a − b)² over pixels and channels.
    pub sum: u128,
    /// Number of pixels.
    pub pixels: u64,
    /// Largest |a − b| of a channel.
    pub max: u8,
}

impl SquaredError {
    /// Sums of two images; of the pixels that both have, where one has more.
    #[must_use]
    pub fn of(a: &RgbImage, b: &RgbImage) -> Self {
        let mut total = SquaredError::default();
        for (a, b) in a.pixels.chunks(1 << 16).zip(b.pixels.chunks(1 << 16)) {
            // 2^16 pixels of 3·255² each stay far below 2^64.
            let (mut sum, mut max) = (0u64, 0u8);
            for (a, b) in a.as_flattened().iter().zip(b.as_flattened()) {
                let d = a.abs_diff(*b);
                sum += u64::from(d) * u64::from(d);
                max = max.max(d);
            }
            total.merge(&SquaredError { sum: u128::from(sum), pixels: a.len().min(b.len()) as u64, max });
        }
        total
    }

    /// Adds the sums of another part.
    pub fn merge(&mut self, other: &SquaredError) {
        self.sum += other.sum;
        self.pixels += other.pixels;
        self.max = self.max.max(other.max);
    }

    /// Mean of (a − b)² per channel: the sum divided by pixels × 3. 0 for nothing at all.
    #[must_use]
    pub fn mse(&self) -> f64 {
        self.sum as f64 / (3 * u128::from(self.pixels)).max(1) as f64
    }

    /// The sum divided by pixels alone: three times [`SquaredError::mse`].
    #[must_use]
    pub fn mse_per_pixel(&self) -> f64 {
        self.sum as f64 / self.pixels.max(1) as f64
    }
}

/// PSNR in dB: 10·log10(peak² / mse), +∞ where `mse` is 0. Never NaN.
///
/// # Errors
/// `E_PARAM` for a peak that is not positive and finite, where PSNR has no meaning, and for an `mse` that is no number
/// or negative.
pub fn peak_psnr(peak: f64, mse: f64) -> Result<f64> {
    if !(peak > 0.0 && peak.is_finite()) {
        return Err(Error::param("peak", format!("PSNR has no meaning for a peak of {peak}; give one above 0")));
    }
    if mse.is_nan() || mse < 0.0 {
        return Err(Error::param("mse", format!("{mse} is no mean of squares")));
    }
    // Both logarithms apart: the square could overflow.
    Ok(if mse == 0.0 { f64::INFINITY } else { 20.0 * peak.log10() - 10.0 * mse.log10() })
}

/// Mean of PSNRs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanPsnr {
    /// Mean of the finite ones in dB; `None` where there is none.
    pub mean: Option<f64>,
    /// How many were finite.
    pub finite: usize,
    /// How many were infinite, and are not in the mean.
    pub infinite: usize,
}

/// Mean of the finite PSNRs, and how many were left out.
#[must_use]
pub fn mean_psnr(values: &[f64]) -> MeanPsnr {
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let mean = (!finite.is_empty()).then(|| finite.iter().sum::<f64>() / finite.len() as f64);
    MeanPsnr { mean, finite: finite.len(), infinite: values.len() - finite.len() }
}
