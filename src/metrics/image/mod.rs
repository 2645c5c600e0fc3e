//! Numbers that say how far one picture is from another: MSE, PSNR, SSIM, MS-SSIM, FLIP, and the shares of the error classes.
//!
//! | number | definition |
//! |---|---|
//! | MSE | sum of (a − b)² over pixels and channels, divided by pixels × 3 |
//! | MSE per pixel | the same sum divided by pixels alone, as S3Dc (2008), §4.4, words it: three times the MSE |
//! | PSNR | 10·log10(255² / MSE) in dB; of the MSE per pixel it is 4.77 dB less |
//! | SSIM | of each channel ([`super::ssim`], L = 255); mean and geometric mean of the three |
//! | MS-SSIM | of each channel ([`ms_ssim`]); mean and geometric mean of the three |
//! | FLIP | mean error that a viewer sees, 0 to 1, see `flip` (feature `cli`) |
//! | classes | pixels per [`ErrorClass`]; the error of a pixel is its largest channel error / 255 |

#[cfg(feature = "cli")]
mod flip;
mod multiscale;
mod scores;
mod squares;
#[cfg(test)]
mod tests;

#[cfg(feature = "cli")]
pub use flip::{FLIP_MAX_PIXELS, FLIP_PIXELS_PER_DEGREE, flip};
pub use multiscale::{MultiScale, SCALE_WEIGHTS, ms_ssim};
pub use scores::ChannelScores;
pub use squares::{MeanPsnr, SquaredError, mean_psnr, peak_psnr};

use super::{ErrorClass, ssim};
use crate::error::{Code, Error, Result};
use rayon::prelude::*;

/// Largest value of a channel: MAXi of the PSNR and L of SSIM.
pub const PEAK: f64 = 255.0;

/// Most pixels of an image that is compared.
const MAX_PIXELS: u64 = 1 << 28;

/// An image of 8-bit red, green and blue, as they are shown (sRGB), rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RgbImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row by row, left to right.
    pub pixels: Vec<[u8; 3]>,
}

impl RgbImage {
    /// An image of these pixels.
    ///
    /// # Errors
    /// `E_PARAM` where there are none or not `width`·`height` of them, `E_LIMIT` above 2^28.
    pub fn new(width: u32, height: u32, pixels: Vec<[u8; 3]>) -> Result<Self> {
        let image = RgbImage { width, height, pixels };
        image.check()?;
        Ok(image)
    }

    /// Checks that the image has pixels, and as many as its size says.
    ///
    /// # Errors
    /// Those of [`RgbImage::new`].
    pub fn check(&self) -> Result<()> {
        let count = u64::from(self.width) * u64::from(self.height);
        if count > MAX_PIXELS {
            let message = format!("{}×{} pixels are too many; compare a part", self.width, self.height);
            return Err(Error::new(Code::Limit, "image", message));
        }
        if count == 0 || count != self.pixels.len() as u64 {
            let message = format!("{} pixels do not make {}×{}", self.pixels.len(), self.width, self.height);
            return Err(Error::param("image", message));
        }
        Ok(())
    }

    /// One channel as numbers.
    fn channel(&self, c: usize) -> Vec<f64> {
        self.pixels.iter().map(|p| f64::from(p[c])).collect()
    }
}

/// What [`compare`] finds.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageComparison {
    /// Squared and largest errors.
    pub errors: SquaredError,
    /// 10·log10(255² / MSE) in dB, MSE per channel; +∞ for equal images.
    pub psnr: f64,
    /// The same with the MSE per pixel: 4.77 dB less.
    pub psnr_per_pixel: f64,
    /// SSIM of the channels.
    pub ssim: ChannelScores,
    /// Whether the image is smaller than the SSIM window, so that one window covered all of it.
    pub ssim_global: bool,
    /// MS-SSIM of the channels.
    pub ms_ssim: ChannelScores,
    /// How many scales MS-SSIM took: 5, and fewer for images smaller than 176.
    pub ms_ssim_scales: usize,
    /// Whether a contrast term of MS-SSIM was negative and was taken for 0.
    pub ms_ssim_clamped: bool,
    /// Pixels per [`ErrorClass`], best first.
    pub classes: [u64; 5],
}

impl ImageComparison {
    /// Whether no pixel differs.
    #[must_use]
    pub fn identical(&self) -> bool {
        self.errors.sum == 0
    }
}

/// Compares image `b` with the reference `a`. Symmetric in its numbers. Runs on the threads of the current [rayon] pool.
///
/// # Errors
/// `E_PARAM` where the sizes differ; those of [`RgbImage::check`].
pub fn compare(a: &RgbImage, b: &RgbImage) -> Result<ImageComparison> {
    check_pair(a, b)?;
    let (width, height) = (a.width as usize, a.height as usize);
    let channels: Vec<(f64, MultiScale)> = (0..3)
        .into_par_iter()
        .map(|c| {
            let (a, b) = (a.channel(c), b.channel(c));
            (ssim(&a, &b, width, height, PEAK), ms_ssim(&a, &b, width, height, PEAK))
        })
        .collect();
    let errors = SquaredError::of(a, b);
    let first = channels[0].1;
    Ok(ImageComparison {
        errors,
        psnr: peak_psnr(PEAK, errors.mse())?,
        psnr_per_pixel: peak_psnr(PEAK, errors.mse_per_pixel())?,
        ssim: ChannelScores::of([0, 1, 2].map(|c| channels[c].0)),
        ssim_global: super::ssim::is_global(width, height),
        ms_ssim: ChannelScores::of([0, 1, 2].map(|c| channels[c].1.score)),
        ms_ssim_scales: first.scales,
        ms_ssim_clamped: channels.iter().any(|c| c.1.clamped),
        classes: class_histogram(a, b)?,
    })
}

/// The class of every pixel.
fn classes<'a>(a: &'a RgbImage, b: &'a RgbImage) -> impl Iterator<Item = ErrorClass> + 'a {
    let error = |(a, b): (&[u8; 3], &[u8; 3])| (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap_or(0);
    a.pixels.iter().zip(&b.pixels).map(move |pair| ErrorClass::of(f64::from(error(pair)), PEAK))
}

/// Pixels per [`ErrorClass`], best first.
///
/// # Errors
/// Those of [`compare`].
pub fn class_histogram(a: &RgbImage, b: &RgbImage) -> Result<[u64; 5]> {
    check_pair(a, b)?;
    let mut counts = [0; 5];
    classes(a, b).for_each(|class| counts[class as usize] += 1);
    Ok(counts)
}

/// Every pixel in the colour of its class.
///
/// # Errors
/// Those of [`compare`].
pub fn difference(a: &RgbImage, b: &RgbImage) -> Result<RgbImage> {
    check_pair(a, b)?;
    RgbImage::new(a.width, a.height, classes(a, b).map(ErrorClass::color).collect())
}

fn check_pair(a: &RgbImage, b: &RgbImage) -> Result<()> {
    a.check()?;
    b.check()?;
    if (a.width, a.height) == (b.width, b.height) {
        return Ok(());
    }
    let message =
        format!("{}×{} and {}×{} pixels cannot be compared pixel by pixel", a.width, a.height, b.width, b.height);
    Err(Error::param("image", message))
}
