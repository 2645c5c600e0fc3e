//! Structural similarity (Wang et al. 2004) of 2D slices: 11×11 Gaussian window, σ = 1.5, valid windows only, in f64.

use crate::grid::View;
use crate::voxel::Sample;
use crate::with_sample;

/// Edge of the window.
pub const WINDOW: usize = 11;
/// Standard deviation of the window's weights.
pub const SIGMA: f64 = 1.5;
/// C1 = (K1·L)²: keeps the luminance term finite for dark images.
pub const K1: f64 = 0.01;
/// C2 = (K2·L)²: keeps the contrast term finite for flat images.
pub const K2: f64 = 0.03;

/// The two stabilising constants.
#[derive(Clone, Copy)]
struct Constants {
    c1: f64,
    c2: f64,
}

/// Moments of one window, of samples from which `shift` has been subtracted.
#[derive(Clone, Copy)]
struct Moments {
    a: f64,
    b: f64,
    /// Weighted mean of a² + b²: only the sum of both variances enters the formula.
    squares: f64,
    product: f64,
}

impl Constants {
    fn of(dynamic_range: f64) -> Self {
        Constants { c1: (K1 * dynamic_range).powi(2), c2: (K2 * dynamic_range).powi(2) }
    }

    /// SSIM of one window. Symmetric, 1 for equal windows, negative for opposed ones.
    #[inline(always)]
    fn similarity(self, m: Moments, shift: [f64; 2]) -> Similarity {
        // Rounding must make neither a variance negative nor a covariance larger than the variances allow.
        let variances = (m.squares - (m.a * m.a + m.b * m.b)).max(0.0);
        let covariance = (2.0 * (m.product - m.a * m.b)).clamp(-variances, variances);
        let (a, b) = (m.a + shift[0], m.b + shift[1]);
        let luminance = (2.0 * a * b + self.c1) / (a * a + b * b + self.c1);
        let contrast = (covariance + self.c2) / (variances + self.c2);
        Similarity { ssim: luminance * contrast, contrast }
    }
}

/// Means over windows of SSIM, and of its contrast-structure factor alone: what MS-SSIM takes of all scales but the
/// coarsest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Similarity {
    pub(super) ssim: f64,
    pub(super) contrast: f64,
}

/// Weights of the separable window; they sum to 1.
fn weights() -> [f64; WINDOW] {
    let w: [f64; WINDOW] = std::array::from_fn(|i| {
        let d = i as f64 - (WINDOW / 2) as f64;
        (-d * d / (2.0 * SIGMA * SIGMA)).exp()
    });
    let sum: f64 = w.iter().sum();
    w.map(|v| v / sum)
}

/// Whether a slice is too small for the window, so that one window over the whole slice is taken.
#[must_use]
pub const fn is_global(width: usize, height: usize) -> bool {
    width < WINDOW || height < WINDOW
}

/// Mean SSIM of two images of `width`×`height` samples, row by row.
///
/// `dynamic_range` is L of the paper, which must be above 0. Images with an edge below 11 are compared by the mean,
/// the variance and the covariance of the whole image, every sample weighing the same.
///
/// A sample that is not finite is replaced by the middle of the finite samples of `a`, in either image.
///
/// # Panics
/// Where an image does not have `width`·`height` samples.
#[must_use]
pub fn ssim(a: &[f64], b: &[f64], width: usize, height: usize, dynamic_range: f64) -> f64 {
    similarity(a, b, width, height, dynamic_range).ssim
}

/// [`ssim`], and its contrast-structure factor.
pub(super) fn similarity(a: &[f64], b: &[f64], width: usize, height: usize, dynamic_range: f64) -> Similarity {
    assert!(a.len() == width * height && b.len() == a.len(), "both images have width × height samples");
    let ((a, shift_a), (b, shift_b)) = {
        let (lo, hi) = bounds(a);
        let middle = if lo <= hi { lo + (hi - lo) / 2.0 } else { 0.0 };
        (shifted(a, middle), shifted(b, middle))
    };
    let (c, shift) = (Constants::of(dynamic_range), [shift_a, shift_b]);
    if is_global(width, height) { global(&a, &b, c, shift) } else { windowed(&a, &b, width, c, shift) }
}

fn bounds(a: &[f64]) -> (f64, f64) {
    a.iter().filter(|v| v.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), &v| (lo.min(v), hi.max(v)))
}

/// Samples less the middle of their range, and that middle: squares of what is left lose no digits to a large offset.
fn shifted(a: &[f64], replacement: f64) -> (Vec<f64>, f64) {
    let (lo, hi) = bounds(a);
    let shift = if lo <= hi { lo + (hi - lo) / 2.0 } else { replacement };
    (a.iter().map(|&v| if v.is_finite() { v } else { replacement } - shift).collect(), shift)
}

/// One window over everything: two passes, plain mean and variance (divided by N).
fn global(a: &[f64], b: &[f64], c: Constants, shift: [f64; 2]) -> Similarity {
    let n = a.len() as f64;
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (mut squares, mut product) = (0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (a - mean_a, b - mean_b);
        squares += a * a + b * b;
        product += a * b;
    }
    // About the means the first moments are 0, so they move into the shift.
    let m = Moments { a: 0.0, b: 0.0, squares: squares / n, product: product / n };
    c.similarity(m, [shift[0] + mean_a, shift[1] + mean_b])
}

/// All valid windows: rows are filtered once, and the last 11 filtered rows give one row of results.
fn windowed(a: &[f64], b: &[f64], width: usize, c: Constants, shift: [f64; 2]) -> Similarity {
    let w = weights();
    let valid = width - (WINDOW - 1);
    let mut ring: [[Vec<f64>; 4]; WINDOW] = std::array::from_fn(|_| std::array::from_fn(|_| vec![0.0; valid]));
    let mut raw: [Vec<f64>; 4] = std::array::from_fn(|_| vec![0.0; width]);
    let mut moments: [Vec<f64>; 4] = std::array::from_fn(|_| vec![0.0; valid]);
    let (mut sum, mut contrast, mut rows) = (0.0, 0.0, 0u64);
    for (y, (a, b)) in a.chunks_exact(width).zip(b.chunks_exact(width)).enumerate() {
        raw[0].copy_from_slice(a);
        raw[1].copy_from_slice(b);
        for x in 0..width {
            raw[2][x] = a[x] * a[x] + b[x] * b[x];
            raw[3][x] = a[x] * b[x];
        }
        for (raw, out) in raw.iter().zip(&mut ring[y % WINDOW]) {
            let taps: [&[f64]; WINDOW] = std::array::from_fn(|i| &raw[i..i + valid]);
            filter(&w, taps, out);
        }
        if y + 1 < WINDOW {
            continue;
        }
        for (q, out) in moments.iter_mut().enumerate() {
            let taps: [&[f64]; WINDOW] = std::array::from_fn(|i| ring[(y + 1 + i) % WINDOW][q].as_slice());
            filter(&w, taps, out);
        }
        let [ma, mb, squares, product] = &moments;
        let mut row = Similarity { ssim: 0.0, contrast: 0.0 };
        for x in 0..valid {
            let s = c.similarity(Moments { a: ma[x], b: mb[x], squares: squares[x], product: product[x] }, shift);
            (row.ssim, row.contrast) = (row.ssim + s.ssim, row.contrast + s.contrast);
        }
        (sum, contrast) = (sum + row.ssim, contrast + row.contrast);
        rows += 1;
    }
    let windows = (rows * valid as u64) as f64;
    Similarity { ssim: sum / windows, contrast: contrast / windows }
}

/// Weighted sum of 11 rows. The weights are symmetric, so that pairs share a multiplication, and the result does not
/// depend on the direction in which the taps are listed.
fn filter(w: &[f64; WINDOW], taps: [&[f64]; WINDOW], out: &mut [f64]) {
    let taps = taps.map(|t| &t[..out.len()]);
    for (x, out) in out.iter_mut().enumerate() {
        let mut sum = w[WINDOW / 2] * taps[WINDOW / 2][x];
        for i in 0..WINDOW / 2 {
            sum += w[i] * (taps[i][x] + taps[WINDOW - 1 - i][x]);
        }
        *out = sum;
    }
}

/// Mean SSIM over the components of two boxes of one slice and the same number of components.
pub(super) fn slice(a: &View<'_>, b: &View<'_>, dynamic_range: f64) -> f64 {
    let (width, height, components) = (a.extent.x as usize, a.extent.y as usize, a.sample_type.components());
    let of = |c| ssim(&component(a, c), &component(b, c), width, height, dynamic_range);
    (0..components).map(of).sum::<f64>() / components as f64
}

/// One component of a box of one slice as f64, row by row.
fn component(view: &View<'_>, c: usize) -> Vec<f64> {
    let mut out = Vec::with_capacity(view.extent.x as usize * view.extent.y as usize);
    with_sample!(view.sample_type, T => for y in 0..view.extent.y {
        out.extend(view.row::<T>(y, 0).iter().map(|s| s.component(c)));
    });
    out
}
