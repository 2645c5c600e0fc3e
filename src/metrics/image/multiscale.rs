//! Multi-scale SSIM (Wang, Simoncelli, Bovik 2003): contrast and structure at several scales, luminance at the coarsest.

use super::super::SSIM_WINDOW;
use super::super::ssim::similarity;

/// Exponents of the scales, finest first (Wang et al. 2003, §3.2). They sum to 1.
pub const SCALE_WEIGHTS: [f64; 5] = [0.0448, 0.2856, 0.3001, 0.2363, 0.1333];

/// MS-SSIM of one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MultiScale {
    /// 1 for equal images; 0 is the least.
    pub score: f64,
    /// How many scales there were: as many as keep both edges at 11 or more, 5 from 176 pixels on. One at least.
    pub scales: usize,
    /// Whether a term was negative and was taken for 0, as a power of it is no number.
    pub clamped: bool,
}

/// MS-SSIM of two images of `width`×`height` samples, row by row; `dynamic_range` is L.
///
/// From one scale to the next 2×2 samples become their mean; of an odd edge the last sample is left out. With fewer
/// than five scales the weights of those that are there are divided by their sum.
///
/// # Panics
/// Where an image does not have `width`·`height` samples.
#[must_use]
pub fn ms_ssim(a: &[f64], b: &[f64], width: usize, height: usize, dynamic_range: f64) -> MultiScale {
    let scales = scale_count(width, height);
    let total: f64 = SCALE_WEIGHTS[..scales].iter().sum();
    let (mut score, mut clamped) = (1.0, false);
    let (mut a, mut b, mut size) = (a.to_vec(), b.to_vec(), (width, height));
    for (scale, weight) in SCALE_WEIGHTS[..scales].iter().enumerate() {
        let s = similarity(&a, &b, size.0, size.1, dynamic_range);
        let last = scale + 1 == scales;
        let term = if last { s.ssim } else { s.contrast };
        clamped |= term < 0.0;
        score *= term.max(0.0).powf(weight / total);
        if !last {
            (a, b) = (halved(&a, size), halved(&b, size));
            size = (size.0 / 2, size.1 / 2);
        }
    }
    MultiScale { score, scales, clamped }
}

/// How many scales an image of this size has.
fn scale_count(width: usize, height: usize) -> usize {
    let least = width.min(height);
    (1..=SCALE_WEIGHTS.len()).rev().find(|s| least >> (s - 1) >= SSIM_WINDOW).unwrap_or(1)
}

/// Means of 2×2 samples.
fn halved(v: &[f64], (width, height): (usize, usize)) -> Vec<f64> {
    let mut out = Vec::with_capacity((width / 2) * (height / 2));
    for y in 0..height / 2 {
        let (upper, lower) = (&v[2 * y * width..][..width], &v[(2 * y + 1) * width..][..width]);
        for (u, l) in upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0) {
            // Diagonals first: the same sum for the transposed image.
            out.push(((u[0] + l[1]) + (u[1] + l[0])) / 4.0);
        }
    }
    out
}
