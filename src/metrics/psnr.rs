//! Peak signal-to-noise ratio. Per component (divide by voxels × components), peak = range of the reference.

/// PSNR in dB: 20·log10(peak / rmse).
///
/// `peak` is the largest minus the smallest value of the reference, whatever its type; for 8-bit images literature
/// takes 255. `rmse` is the root of the squared error divided by voxels × components: a sum over three components
/// divided by voxels alone, as some papers print it, gives 4.77 dB less.
///
/// `None` where there is no number: +∞ dB (`rmse` 0), a constant reference (`peak` 0) with an error, and arguments
/// that are infinite, NaN or negative. Only the first of them is good news; ask `rmse` which it is.
#[must_use]
pub fn psnr(peak: f64, rmse: f64) -> Option<f64> {
    // Both logarithms apart: the quotient of large and small floats could overflow.
    let db = 20.0 * (peak.log10() - rmse.log10());
    (peak > 0.0 && rmse > 0.0 && db.is_finite()).then_some(db)
}

/// The largest RMSE at which a volume of this `peak` still has `psnr` dB.
#[must_use]
pub fn rmse_for_psnr(peak: f64, psnr: f64) -> f64 {
    peak * 10f64.powf(-psnr / 20.0)
}
