//! The typed one-pass kernels against the definition in f64.

use super::noisy;
use crate::error::Code;
use crate::geometry::{Extent, Region};
use crate::grid::{Grid, View};
use crate::metrics::stats::{ErrorStats, error_stats, float_error, value_range};
use crate::voxel::{Sample, SampleType};
use crate::with_sample;

/// The definition: every component in f64, one after the other.
fn plain(a: &View<'_>, b: &View<'_>) -> ErrorStats {
    let mut s = ErrorStats::default();
    with_sample!(a.sample_type, T => for z in 0..a.extent.z {
        for y in 0..a.extent.y {
            for (a, b) in a.row::<T>(y, z).iter().zip(b.row::<T>(y, z)) {
                for c in 0..T::TYPE.components() {
                    let (a, b) = (a.component(c), b.component(c));
                    let d = float_error(a, b);
                    s.count += 1;
                    s.max_abs = s.max_abs.max(d);
                    s.sum_abs += d;
                    s.sum_sq += d * d;
                    s.min = s.min.min(b);
                    s.max = s.max.max(b);
                }
            }
        }
    });
    s
}

fn agree(a: &View<'_>, b: &View<'_>) {
    let (fast, plain) = (error_stats(a, b).unwrap(), plain(a, b));
    let close = |x: f64, y: f64| x == y || (x - y).abs() <= 1e-12 * x.abs().max(y.abs());
    assert!(close(fast.sum_abs, plain.sum_abs) && close(fast.sum_sq, plain.sum_sq), "{fast:?} {plain:?}");
    assert_eq!(
        (fast.count, fast.max_abs, fast.min, fast.max),
        (plain.count, plain.max_abs, plain.min, plain.max),
        "{} {}",
        a.sample_type,
        a.extent
    );
}

fn check<T: Sample>(f: impl Fn(u64) -> T + Copy) {
    for e in [Extent::cube(1), Extent::new(7, 5, 3), Extent::new(64, 2, 2), Extent::new(70_001, 1, 2)] {
        let (a, b) = (noisy(e, 1, f), noisy(e, 2, f));
        agree(&a.view(), &b.view());
        agree(&a.view(), &a.view());
        let part = Region { start: [e.x / 3, e.y / 3, e.z / 3], end: e.to_array() };
        agree(&a.view().sub(&part), &b.view().sub(&part));
    }
}

#[test]
fn kernels_agree_with_the_definition() {
    check(|h| h as u8);
    check(|h| h as u16);
    check(|h| h as i16);
    check(|h| [h as u8, (h >> 8) as u8, (h >> 16) as u8]);
    check(|h| (h as i32 as f32) * 1e-3);
    check(|h| match h % 9 {
        0 => f32::NAN,
        1 => f32::INFINITY,
        2 => f32::NEG_INFINITY,
        3 => f32::MIN_POSITIVE / 2.0,
        _ => h as f32,
    });
}

#[test] // the largest possible sums of one chunk fit their accumulators
fn extremes_do_not_overflow() {
    let e = Extent::new(200_000, 1, 1);
    let pair = |lo: Grid, hi: Grid| agree(&lo.view(), &hi.view());
    pair(noisy(e, 0, |_| 0u8), noisy(e, 0, |_| 255u8));
    pair(noisy(e, 0, |_| 0u16), noisy(e, 0, |_| u16::MAX));
    pair(noisy(e, 0, |_| i16::MIN), noisy(e, 0, |_| i16::MAX));
    pair(noisy(e, 0, |_| f32::MIN), noisy(e, 0, |_| f32::MAX));
}

#[test] // M-20: 4 Gpixel, against the exact sum in u128
fn long_sums_stay_exact() {
    let e = Extent::new(1 << 12, 1 << 4, 1);
    let (a, b) = (noisy(e, 3, |h| h as u16), noisy(e, 4, |h| h as u16));
    let part = error_stats(&a.view(), &b.view()).unwrap();
    let exact: u128 = a.samples::<u16>().iter().zip(b.samples::<u16>()).fold(0, |s, (&a, &b)| {
        let d = u128::from(a.abs_diff(b));
        s + d * d
    });
    let mut total = ErrorStats::default();
    for _ in 0..1 << 16 {
        total.merge(&part);
    }
    assert_eq!(total.count, 1 << 32);
    let exact = (exact << 16) as f64;
    assert!((total.sum_sq - exact).abs() <= 1e-10 * exact, "{} {exact}", total.sum_sq);
}

#[test]
fn nan_and_infinity() {
    assert_eq!(float_error(f64::NAN, f64::NAN), 0.0);
    assert_eq!(float_error(f64::NAN, 1.0), f64::INFINITY);
    assert_eq!(float_error(f64::INFINITY, f64::INFINITY), 0.0);
    assert_eq!(float_error(f64::INFINITY, f64::NEG_INFINITY), f64::INFINITY);
    let all_nan = noisy(Extent::cube(3), 0, |_| f32::NAN);
    assert_eq!(value_range(&all_nan.view()), None);
    assert_eq!(ErrorStats::default().mse(), 0.0);
}

#[test] // M-21
fn different_sizes_and_types_are_refused() {
    let a = Grid::zeros(Extent::new(4, 3, 2), SampleType::U8).unwrap();
    let b = Grid::zeros(Extent::new(4, 2, 3), SampleType::U8).unwrap();
    let c = Grid::zeros(Extent::new(4, 3, 2), SampleType::U16).unwrap();
    for other in [&b, &c] {
        assert_eq!(error_stats(&a.view(), &other.view()).unwrap_err().code(), Code::Param);
    }
    let message = error_stats(&a.view(), &b.view()).unwrap_err().to_string();
    assert!(message.contains("4×3×2") && message.contains("4×2×3"), "{message}");
}
