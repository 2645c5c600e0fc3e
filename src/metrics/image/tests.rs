//! Image metrics against plain definitions, and where they break.

use super::*;
use crate::metrics::{SSIM_WINDOW, bits_per_sample};

fn noise(i: usize, seed: u64) -> u64 {
    let mut h = (i as u64).wrapping_add(seed << 40).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    h = (h ^ h >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    h ^ h >> 32
}

/// A smooth picture with noise of the given amplitude.
fn image(width: u32, height: u32, seed: u64, amplitude: u64) -> RgbImage {
    let pixel = |i: usize| {
        let (x, y) = ((i as u32 % width) as f64, (i as u32 / width) as f64);
        std::array::from_fn(|c| {
            let smooth = 110.0 + 60.0 * (x / 9.0 + c as f64).sin() + 40.0 * (y / 13.0).cos();
            let n = noise(3 * i + c, seed) % (2 * amplitude + 1);
            (smooth + n as f64 - amplitude as f64).clamp(0.0, 255.0) as u8
        })
    };
    RgbImage::new(width, height, (0..(width * height) as usize).map(pixel).collect()).unwrap()
}

fn flat(width: u32, height: u32, color: [u8; 3]) -> RgbImage {
    RgbImage::new(width, height, vec![color; (width * height) as usize]).unwrap()
}

fn transposed(a: &RgbImage) -> RgbImage {
    let (w, h) = (a.width as usize, a.height as usize);
    RgbImage::new(a.height, a.width, (0..w * h).map(|i| a.pixels[(i % h) * w + i / h]).collect()).unwrap()
}

#[test] // hard case: M-10
fn equal_images_have_infinite_psnr_that_no_average_takes() {
    let a = image(40, 30, 1, 20);
    let c = compare(&a, &a).unwrap();
    assert!(c.identical() && c.psnr == f64::INFINITY && c.psnr_per_pixel == f64::INFINITY);
    assert_eq!((c.ssim.mean, c.ssim.geometric, c.ms_ssim.mean), (1.0, 1.0, 1.0));
    assert_eq!(c.classes, [1200, 0, 0, 0, 0]);
    let m = mean_psnr(&[30.0, f64::INFINITY, 40.0, f64::INFINITY]);
    assert_eq!(m, MeanPsnr { mean: Some(35.0), finite: 2, infinite: 2 });
    assert_eq!(mean_psnr(&[f64::INFINITY]), MeanPsnr { mean: None, finite: 0, infinite: 1 });
    assert_eq!(format!("{}", c.psnr), "inf");
}

#[test] // hard case: M-11
fn psnr_without_a_peak_is_an_error() {
    for peak in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(peak_psnr(peak, 1.0).unwrap_err().field(), "peak");
    }
    assert_eq!(peak_psnr(255.0, f64::NAN).unwrap_err().field(), "mse");
    assert!((peak_psnr(1e200, 1e100).unwrap() - 3000.0).abs() < 1e-9, "no square overflows");
}

#[test]
fn mse_per_channel_and_per_pixel() {
    let (a, b) = (flat(5, 4, [10, 20, 30]), flat(5, 4, [13, 20, 26]));
    let c = compare(&a, &b).unwrap();
    assert_eq!(c.errors, SquaredError { sum: 20 * 25, pixels: 20, max: 4 });
    assert_eq!((c.errors.mse(), c.errors.mse_per_pixel()), (25.0 / 3.0, 25.0));
    assert!((c.psnr - 10.0 * (65025.0 * 3.0 / 25.0f64).log10()).abs() < 1e-12);
    assert!((c.psnr - c.psnr_per_pixel - 4.771_212_547).abs() < 1e-8);
}

#[test] // hard cases: M-12, M-13
fn constant_images() {
    for (w, h) in [(20, 20), (4, 4)] {
        for v in [0, 1, 255] {
            let c = compare(&flat(w, h, [v; 3]), &flat(w, h, [v; 3])).unwrap();
            assert_eq!((c.ssim.channels, c.ms_ssim.channels), ([1.0; 3], [1.0; 3]));
        }
        let c = compare(&flat(w, h, [64, 0, 255]), &flat(w, h, [192, 255, 0])).unwrap();
        assert!(c.ssim.channels.iter().chain(&c.ms_ssim.channels).all(|s| s.is_finite() && *s < 1.0 && *s >= 0.0));
    }
}

#[test] // hard case: M-14
fn ssim_of_numbers_near_65535() {
    // One unit of noise on a large offset: E[x²] − E[x]² in one pass would lose every digit of it in f32.
    let of = |offset: f64, seed| (0..400).map(|i| offset + (noise(i, seed) % 2) as f64).collect::<Vec<_>>();
    let (near, far) = (|s| of(0.0, s), |s| of(65534.0, s));
    let s = |a: &[f64], b: &[f64]| super::super::ssim::similarity(a, b, 20, 20, 1.0).contrast;
    assert!((s(&near(1), &near(2)) - s(&far(1), &far(2))).abs() < 1e-9);
}

#[test] // hard cases: M-15, M-19
fn opposed_images_are_negative_and_have_no_geometric_mean() {
    let a = image(40, 40, 1, 80);
    let b = RgbImage::new(40, 40, a.pixels.iter().map(|p| [255 - p[0], p[1], p[2]]).collect()).unwrap();
    let c = compare(&a, &b).unwrap();
    assert!(c.ssim.channels[0] < -0.3 && c.ssim.channels[0] >= -1.0, "{:?}", c.ssim);
    assert!((c.ssim.mean - (c.ssim.channels[0] + 2.0) / 3.0).abs() < 1e-15);
    assert!(c.ssim.geometric == 0.0 && c.ssim.clamped);
    let zero = ChannelScores::of([0.5, 0.0, 0.5]);
    assert!(zero.geometric == 0.0 && !zero.clamped);
    assert!((ChannelScores::of([0.9, 0.8, 0.7]).geometric - 0.504f64.powf(1.0 / 3.0)).abs() < 1e-15);
}

#[test] // hard case: M-16
fn small_images_take_one_window() {
    for (w, h) in [(1, 1), (10, 40), (40, 10)] {
        let c = compare(&image(w, h, 1, 20), &image(w, h, 2, 20)).unwrap();
        assert!(c.ssim_global && c.ssim.mean.is_finite() && c.ms_ssim_scales == 1);
    }
    let c = compare(&image(11, 11, 1, 20), &image(11, 11, 2, 20)).unwrap();
    assert!(!c.ssim_global);
    assert_eq!(c.ms_ssim.channels.map(|s| s.max(0.0)), c.ssim.channels.map(|s| s.max(0.0)), "one scale is SSIM itself");
}

#[test] // hard case: M-17
fn scales_of_ms_ssim() {
    let sizes = [
        (176, 176, 5),
        (175, 176, 4),
        (400, 175, 4),
        (177, 301, 5),
        (88, 88, 4),
        (87, 99, 3),
        (22, 22, 2),
        (21, 21, 1),
    ];
    for (w, h, scales) in sizes {
        let (a, b) = (image(w, h, 1, 6), image(w, h, 2, 6));
        let plane = |i: &RgbImage| i.channel(1);
        let m = ms_ssim(&plane(&a), &plane(&b), w as usize, h as usize, 255.0);
        assert_eq!(m.scales, scales, "{w}×{h}");
        assert!(m.score > 0.8 && m.score < 1.0 && !m.clamped, "{w}×{h}: {}", m.score);
        assert!((m.score - by_definition(&plane(&a), &plane(&b), w as usize, h as usize, scales)).abs() < 1e-9);
    }
}

/// MS-SSIM by its definition: every window at every scale.
fn by_definition(a: &[f64], b: &[f64], w: usize, h: usize, scales: usize) -> f64 {
    let weights = &[0.0448, 0.2856, 0.3001, 0.2363, 0.1333][..scales];
    let sum: f64 = weights.iter().sum();
    let g: Vec<f64> = (0..11).map(|i| (-(i as f64 - 5.0).powi(2) / 4.5).exp()).collect();
    let g: Vec<f64> = g.iter().map(|v| v / g.iter().sum::<f64>()).collect();
    let (mut a, mut b, mut w, mut h, mut product) = (a.to_vec(), b.to_vec(), w, h, 1.0);
    for (scale, weight) in weights.iter().enumerate() {
        let (mut structure, mut whole) = (0.0, 0.0);
        for y in 0..=h - SSIM_WINDOW {
            for x in 0..=w - SSIM_WINDOW {
                let mut m = [0.0; 5];
                for j in 0..11 {
                    for i in 0..11 {
                        let (p, q, k) = (a[(y + j) * w + x + i], b[(y + j) * w + x + i], g[i] * g[j]);
                        m = [m[0] + k * p, m[1] + k * q, m[2] + k * p * p, m[3] + k * q * q, m[4] + k * p * q];
                    }
                }
                let (c1, c2) = (2.55f64.powi(2), 7.65f64.powi(2));
                let (va, vb, cov) = (m[2] - m[0] * m[0], m[3] - m[1] * m[1], m[4] - m[0] * m[1]);
                let cs = (2.0 * cov + c2) / (va + vb + c2);
                structure += cs;
                whole += cs * (2.0 * m[0] * m[1] + c1) / (m[0] * m[0] + m[1] * m[1] + c1);
            }
        }
        let term = if scale + 1 == scales { whole } else { structure };
        product *= (term / ((w - 10) * (h - 10)) as f64).powf(weight / sum);
        let half = |v: &[f64]| -> Vec<f64> {
            let at = |x: usize, y: usize| v[y * w + x];
            (0..(w / 2) * (h / 2))
                .map(|i| (2 * (i % (w / 2)), 2 * (i / (w / 2))))
                .map(|(x, y)| (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1)) / 4.0)
                .collect()
        };
        (a, b) = (half(&a), half(&b));
        (w, h) = (w / 2, h / 2);
    }
    product
}

#[test] // hard case: M-18
fn a_negative_term_of_ms_ssim_is_taken_for_zero() {
    let a = image(64, 64, 1, 100);
    let b = RgbImage::new(64, 64, a.pixels.iter().map(|p| p.map(|v| 255 - v)).collect()).unwrap();
    let c = compare(&a, &b).unwrap();
    assert!(c.ms_ssim_clamped && c.ms_ssim.channels == [0.0; 3]);
}

#[test] // hard case: M-20
fn four_gigapixels_are_summed_exactly() {
    let (a, b) = (flat(1 << 10, 1 << 10, [255; 3]), flat(1 << 10, 1 << 10, [0; 3]));
    let part = SquaredError::of(&a, &b);
    let mut total = SquaredError::default();
    (0..1 << 12).for_each(|_| total.merge(&part));
    assert_eq!((total.sum, total.pixels), ((3 * 65025) << 32, 1 << 32));
    assert_eq!((total.mse(), total.mse_per_pixel()), (65025.0, 195_075.0));
}

#[test] // hard case: M-21
fn images_that_cannot_be_compared() {
    let (a, b) = (flat(4, 6, [0; 3]), flat(6, 4, [0; 3]));
    for result in [compare(&a, &b).map(|_| ()), difference(&a, &b).map(|_| ()), class_histogram(&a, &b).map(|_| ())] {
        assert_eq!(result.unwrap_err().field(), "image");
    }
    assert!(RgbImage::new(4, 6, vec![[0; 3]; 23]).is_err() && RgbImage::new(0, 6, vec![]).is_err());
    assert!(RgbImage { width: 1 << 20, height: 1 << 20, pixels: vec![] }.check().is_err());
}

#[test] // hard case: M-22
fn classes_are_half_open() {
    use ErrorClass::{Bad, Exact, Large, Medium, Small};
    for (percent, class) in [(0, Exact), (5, Medium), (10, Large), (15, Bad)] {
        assert_eq!(ErrorClass::of(f64::from(percent) * 2.55, 255.0), class, "{percent} %");
    }
    let errors = [0, 1, 12, 13, 25, 26, 38, 39, 255];
    let expected = [Exact, Small, Small, Medium, Medium, Large, Large, Bad, Bad];
    let (a, b) = (flat(9, 1, [0; 3]), RgbImage::new(9, 1, errors.map(|e| [0, e, e / 2]).to_vec()).unwrap());
    assert_eq!(difference(&a, &b).unwrap().pixels, expected.map(ErrorClass::color));
    assert_eq!(class_histogram(&a, &b).unwrap(), [1, 2, 2, 2, 2]);
}

#[test] // hard case: M-23
fn nothing_has_no_bits_per_sample() {
    assert_eq!(bits_per_sample(10, 0).unwrap_err().field(), "samples");
    assert_eq!(bits_per_sample(10, 20).unwrap(), 4.0);
}

#[test] // hard case: M-24
fn symmetric_and_invariant_under_transposition() {
    let (a, b) = (image(97, 61, 1, 12), image(97, 61, 2, 12));
    let c = compare(&a, &b).unwrap();
    for other in [compare(&b, &a).unwrap(), compare(&transposed(&a), &transposed(&b)).unwrap()] {
        assert_eq!((c.errors, c.classes), (other.errors, other.classes));
        assert!((c.ssim.mean - other.ssim.mean).abs() < 1e-12);
        assert!((c.ms_ssim.mean - other.ms_ssim.mean).abs() < 1e-12);
    }
}

/// FLIP of two images of one colour each, in f64: no filter changes them and no edge is found, so that what is left is
/// the difference of the colours (Andersson et al. 2020, §4.1).
#[cfg(feature = "cli")]
fn flip_of_colors(a: [u8; 3], b: [u8; 3]) -> f64 {
    let linear = |v: u8| {
        let v = f64::from(v) / 255.0;
        if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    };
    let lab = |c: [u8; 3]| {
        let [r, g, b] = c.map(linear);
        let rows = [
            [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
            [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
            [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
        ];
        let f = rows.map(|row| {
            let v = (row[0] * r + row[1] * g + row[2] * b) / row.iter().sum::<f64>();
            let d: f64 = 6.0 / 29.0;
            if v > d.powi(3) { v.cbrt() } else { v / (3.0 * d * d) + 4.0 / 29.0 }
        });
        let l = 116.0 * f[1] - 16.0;
        [l, 0.01 * l * 500.0 * (f[0] - f[1]), 0.01 * l * 200.0 * (f[1] - f[2])]
    };
    let power = |a, b| {
        let ([l, p, q], [m, r, s]): ([f64; 3], [f64; 3]) = (lab(a), lab(b));
        ((l - m).abs() + (p - r).hypot(q - s)).powf(0.7)
    };
    let (most, d) = (power([0, 255, 0], [0, 0, 255]), power(a, b));
    let knee = 0.4 * most;
    if d < knee { d * 0.95 / knee } else { 0.95 + 0.05 * (d - knee) / (most - knee) }
}

#[cfg(feature = "cli")]
#[test]
fn flip_of_single_colours_is_the_formula() {
    let pairs = [
        ([0, 255, 0], [0, 0, 255]),
        ([0; 3], [255; 3]),
        ([40, 90, 160], [44, 88, 171]),
        ([200, 10, 10], [10, 10, 200]),
        ([128; 3], [129; 3]),
    ];
    for (a, b) in pairs {
        let (found, formula) = (flip(&flat(12, 9, a), &flat(12, 9, b)).unwrap(), flip_of_colors(a, b));
        assert!((found - formula).abs() < 2e-3, "{a:?} {b:?}: {found} {formula}");
    }
    assert!((flip(&flat(9, 9, [0, 255, 0]), &flat(9, 9, [0, 0, 255])).unwrap() - 1.0).abs() < 1e-5);
}

#[cfg(feature = "cli")]
#[test]
fn flip_is_zero_for_equal_images_the_same_every_time_and_grows() {
    let a = image(70, 50, 1, 3);
    assert_eq!(flip(&a, &a).unwrap(), 0.0);
    let near = flip(&a, &image(70, 50, 2, 3)).unwrap();
    assert!((0..3).all(|_| flip(&a, &image(70, 50, 2, 3)).unwrap() == near));
    assert!(near > 0.0 && near < flip(&a, &image(70, 50, 2, 40)).unwrap());
    assert_eq!(flip(&a, &flat(70, 51, [0; 3])).unwrap_err().field(), "image");
    let large = flat(FLIP_MAX_PIXELS as u32 + 1, 1, [0; 3]);
    assert_eq!(flip(&large, &large).unwrap_err().code(), Code::Limit);
}
