//! Peak signal-to-noise ratio. Per component (divide by voxels × components), peak = range of the reference.

use crate::error::{Error, Result};

/// PSNR in dB: 10·log10(peak² / mse). +∞ for a mean squared error of 0.
///
/// `peak` is the largest minus the smallest value of the reference, whatever its type; for 8-bit images literature
/// takes 255. `mse` is divided by voxels × components: a sum over three components divided by voxels alone, as some
/// papers print it, gives 4.77 dB less.
///
/// # Errors
/// `E_PARAM` where the ratio has no meaning: a constant reference (peak 0) with an error, or arguments that are NaN
/// or negative.
pub fn psnr(peak: f64, mse: f64) -> Result<f64> {
    if mse == 0.0 {
        return Ok(f64::INFINITY);
    }
    if !(peak > 0.0 && mse > 0.0) {
        return Err(Error::param("psnr", format!("peak {peak} and mean squared error {mse} have no ratio in dB")));
    }
    // Both logarithms apart: the squares of large floats would overflow.
    Ok(20.0 * peak.log10() - 10.0 * mse.log10())
}

/// Root of the largest mean squared error at which a volume of this `peak` still has `psnr` dB.
#[must_use]
pub fn rmse_for_psnr(peak: f64, psnr: f64) -> f64 {
    peak * 10f64.powf(-psnr / 20.0)
}
