//! FLIP (Andersson et al. 2020): how visible the difference is when one flips between two images.
//!
//! Computed by NVIDIA's own implementation. It does not check its own allocations and counts bytes in 32 bits, so that
//! sizes are checked here.

use super::{RgbImage, check_pair};
use crate::error::{Code, Error, Result};

/// Pixels per degree of the visual field that FLIP assumes: a 0.7 m wide screen of 3840 pixels, seen from 0.7 m.
pub const FLIP_PIXELS_PER_DEGREE: f32 = nv_flip::DEFAULT_PIXELS_PER_DEGREE;

/// Most pixels of an image that FLIP takes: about 1.3 GB of working memory.
pub const FLIP_MAX_PIXELS: usize = 1 << 24;

/// Mean FLIP error, 0 (equal) to 1. Not symmetric in its last digits; the first image is the reference.
///
/// # Errors
/// `E_LIMIT` above 2^24 pixels; those of [`super::compare`].
pub fn flip(a: &RgbImage, b: &RgbImage) -> Result<f64> {
    check_pair(a, b)?;
    if a.pixels.len() > FLIP_MAX_PIXELS {
        let message = format!("FLIP takes {FLIP_MAX_PIXELS} pixels at most; compare a part");
        return Err(Error::new(Code::Limit, "image", message));
    }
    let image = |i: &RgbImage| nv_flip::FlipImageRgb8::with_data(i.width, i.height, i.pixels.as_flattened());
    let map = nv_flip::flip(image(a), image(b), FLIP_PIXELS_PER_DEGREE).to_vec();
    // In f64 and in order: the library's own mean is a histogram's.
    Ok(map.iter().map(|&v| f64::from(v)).sum::<f64>() / map.len() as f64)
}
