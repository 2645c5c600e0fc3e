//! SSIM against a direct evaluation of every window, and on the cases where a fast one goes wrong.

use super::{noise, noisy};
use crate::geometry::Extent;
use crate::metrics::{compare, ssim};

/// Every window by its definition: 121 weights, mean, then variance about the mean.
fn naive(a: &[f64], b: &[f64], width: usize, height: usize, l: f64) -> f64 {
    let (c1, c2) = ((0.01 * l).powi(2), (0.03 * l).powi(2));
    let mut w = [[0.0; 11]; 11];
    for (i, row) in w.iter_mut().enumerate() {
        for (j, v) in row.iter_mut().enumerate() {
            let (dy, dx) = (i as f64 - 5.0, j as f64 - 5.0);
            *v = (-(dx * dx + dy * dy) / 4.5).exp();
        }
    }
    let total: f64 = w.iter().flatten().sum();
    let mut sum = 0.0;
    for y in 0..=height - 11 {
        for x in 0..=width - 11 {
            let mean = |f: &dyn Fn(usize) -> f64| {
                (0..121).map(|i| w[i / 11][i % 11] / total * f((y + i / 11) * width + x + i % 11)).sum::<f64>()
            };
            let (ma, mb) = (mean(&|i| a[i]), mean(&|i| b[i]));
            let (va, vb) = (mean(&|i| (a[i] - ma).powi(2)), mean(&|i| (b[i] - mb).powi(2)));
            let cov = mean(&|i| (a[i] - ma) * (b[i] - mb));
            sum += (2.0 * ma * mb + c1) * (2.0 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
        }
    }
    sum / ((width - 10) * (height - 10)) as f64
}

fn image(width: usize, height: usize, seed: u64, f: impl Fn(u64) -> f64) -> Vec<f64> {
    (0..width * height).map(|i| f(noise([(i % width) as u32, (i / width) as u32, 0], seed))).collect()
}

fn unit(h: u64) -> f64 {
    (h >> 11) as f64 / (1u64 << 53) as f64
}

#[test]
fn agrees_with_the_definition() {
    for (w, h) in [(11, 11), (12, 11), (11, 30), (33, 27)] {
        let a = image(w, h, 1, |h| 255.0 * unit(h));
        let b: Vec<f64> = a.iter().zip(image(w, h, 2, unit)).map(|(a, n)| (a + 40.0 * n).round()).collect();
        let (fast, slow) = (ssim(&a, &b, w, h, 255.0), naive(&a, &b, w, h, 255.0));
        assert!((fast - slow).abs() < 1e-12, "{w}×{h}: {fast} {slow}");
        assert!(fast < 1.0 && fast > 0.5);
    }
}

#[test] // M-14
fn small_variance_on_a_large_offset() {
    let (w, h) = (24, 20);
    for (offset, scale) in [(65533.0, 1.0), (1e6, 1e-2), (3e8, 32.0)] {
        let a = image(w, h, 1, |h| offset + scale * (h % 3) as f64);
        let b = image(w, h, 2, |h| offset + scale * (h % 3) as f64);
        let l = 2.0 * scale;
        let (fast, slow) = (ssim(&a, &b, w, h, l), naive(&a, &b, w, h, l));
        assert!((fast - slow).abs() < 1e-6, "{offset}: {fast} {slow}");
        assert_eq!(ssim(&a, &a, w, h, l), 1.0);
    }
}

#[test] // M-12, M-13
fn constant_images() {
    for (w, h) in [(16, 16), (3, 3)] {
        let flat = |v: f64| vec![v; w * h];
        for l in [1.0, 255.0, 65535.0] {
            assert_eq!(ssim(&flat(l), &flat(l), w, h, l), 1.0);
            assert_eq!(ssim(&flat(0.0), &flat(0.0), w, h, l), 1.0);
            let s = ssim(&flat(0.25 * l), &flat(0.75 * l), w, h, l);
            assert!(s.is_finite() && s > 0.0 && s < 1.0, "{s}");
        }
    }
}

#[test] // M-15
fn opposed_images_are_negative() {
    let a = image(20, 20, 1, |h| unit(h) * 255.0);
    let b: Vec<f64> = a.iter().map(|v| 255.0 - v).collect();
    let s = ssim(&a, &b, 20, 20, 255.0);
    assert!((-1.0..-0.5).contains(&s), "{s}");
}

#[test] // M-16
fn small_slices_take_one_window_and_say_so() {
    for e in [Extent::new(10, 40, 2), Extent::new(40, 10, 2), Extent::cube(1)] {
        let (a, b) = (noisy(e, 1, |h| h as u8), noisy(e, 2, |h| h as u8));
        let c = compare(&a.view(), &b.view()).unwrap();
        assert!(c.ssim_global && c.ssim.is_finite() && c.ssim < 1.0, "{e} {}", c.ssim);
        assert_eq!(compare(&a.view(), &a.view()).unwrap().ssim, 1.0);
    }
    let e = Extent::new(11, 11, 1);
    assert!(!compare(&noisy(e, 1, |h| h as u8).view(), &noisy(e, 2, |h| h as u8).view()).unwrap().ssim_global);
    // By hand: means 1 and 2, variances 1 and 1, covariance 1, L = 2.
    let s = ssim(&[0.0, 2.0], &[1.0, 3.0], 2, 1, 2.0);
    let (c1, c2) = (0.0004, 0.0036);
    assert!((s - (4.0 + c1) * (2.0 + c2) / ((5.0 + c1) * (2.0 + c2))).abs() < 1e-15, "{s}");
}

#[test] // M-24
fn symmetric_and_invariant_under_transposition() {
    for (w, h) in [(30, 17), (9, 30)] {
        let (a, b) = (image(w, h, 1, |h| unit(h) * 4095.0), image(w, h, 2, |h| unit(h) * 4095.0));
        let turn = |v: &[f64]| -> Vec<f64> { (0..w * h).map(|i| v[(i % h) * w + i / h]).collect() };
        let s = ssim(&a, &b, w, h, 4095.0);
        assert!((s - ssim(&b, &a, w, h, 4095.0)).abs() < 1e-12);
        assert!((s - ssim(&turn(&a), &turn(&b), h, w, 4095.0)).abs() < 1e-12);
    }
}

#[test]
fn rgb_is_the_mean_of_its_components() {
    let e = Extent::new(14, 13, 1);
    let (a, b) = (noisy(e, 1, |h| [h as u8, 7, (h >> 9) as u8]), noisy(e, 2, |h| [h as u8, 7, (h >> 9) as u8]));
    let part = |g: &crate::Grid, c: usize| g.samples::<[u8; 3]>().iter().map(|s| f64::from(s[c])).collect::<Vec<_>>();
    let range = a.range().map(|(lo, hi)| hi - lo).unwrap();
    let mean = (0..3).map(|c| ssim(&part(&a, c), &part(&b, c), 14, 13, range)).sum::<f64>() / 3.0;
    assert!((compare(&a.view(), &b.view()).unwrap().ssim - mean).abs() < 1e-15);
}
