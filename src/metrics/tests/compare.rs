//! `compare`, PSNR and the error classes on the awkward cases.

use super::noisy;
use crate::error::Code;
use crate::geometry::{Extent, Region};
use crate::grid::Grid;
use crate::metrics::{Comparison, ErrorClass, compare, difference, psnr, rmse_for_psnr};
use crate::voxel::{Sample, SampleType};

fn of(a: &Grid, b: &Grid) -> Comparison {
    compare(&a.view(), &b.view()).unwrap()
}

fn filled<T: Sample>(extent: Extent, value: T) -> Grid {
    Grid::from_fn(extent, |_| value).unwrap()
}

#[test] // M-10
fn identical_volumes() {
    let a = noisy(Extent::new(20, 15, 3), 1, |h| h as u16);
    let c = of(&a, &a);
    assert!(c.identical && c.psnr.is_none());
    assert_eq!((c.max_error, c.mean_error, c.rmse, c.ssim), (0.0, 0.0, 0.0, 1.0));
    assert_eq!(psnr(255.0, 0.0), None);
}

#[test] // M-11
fn constant_reference() {
    let e = Extent::new(16, 16, 2);
    let (a, b) = (filled(e, 7u8), filled(e, 9u8));
    let c = of(&a, &b);
    assert_eq!((c.range, c.psnr, c.identical, c.max_error, c.rmse), (0.0, None, false, 2.0, 2.0));
    assert!(c.ssim.is_finite() && c.ssim < 1.0);
    for (peak, rmse) in [(0.0, 2.0), (1.0, f64::NAN), (f64::NAN, 1.0), (1.0, f64::INFINITY), (f64::INFINITY, 1.0)] {
        assert_eq!(psnr(peak, rmse), None);
    }
    assert!(of(&a, &a).identical);
}

#[test]
fn hand_computed() {
    let e = Extent::new(2, 2, 1);
    let a = Grid::from_samples(e, &[0u8, 10, 20, 100]).unwrap();
    let b = Grid::from_samples(e, &[1u8, 10, 17, 100]).unwrap();
    let c = of(&a, &b);
    assert_eq!((c.range, c.max_error, c.mean_error, c.max_error_at), (100.0, 3.0, 1.0, [0, 1, 0]));
    assert!((c.rmse - 2.5f64.sqrt()).abs() < 1e-15);
    assert!((c.psnr.unwrap() - 10.0 * (1e4f64 / 2.5).log10()).abs() < 1e-12);
    assert!((rmse_for_psnr(100.0, c.psnr.unwrap()) - c.rmse).abs() < 1e-12);
}

#[test]
fn rgb_divides_by_components() {
    let e = Extent::new(1, 1, 2);
    let a = Grid::from_samples(e, &[[0u8, 0, 0], [255, 255, 255]]).unwrap();
    let b = Grid::from_samples(e, &[[3u8, 0, 0], [255, 255, 255]]).unwrap();
    let c = of(&a, &b);
    assert_eq!((c.mean_error, c.max_error_at), (0.5, [0; 3]));
    assert!((c.rmse - 1.5f64.sqrt()).abs() < 1e-15);
}

#[test] // M-21
fn sizes_and_kinds_must_match() {
    let a = Grid::zeros(Extent::new(4, 3, 2), SampleType::U8).unwrap();
    let b = Grid::zeros(Extent::new(3, 4, 2), SampleType::U8).unwrap();
    let rgb = Grid::zeros(Extent::new(4, 3, 2), SampleType::Rgb8).unwrap();
    for (other, names) in [(&b, ["4×3×2", "3×4×2"]), (&rgb, ["u8", "rgb8"])] {
        let error = compare(&a.view(), &other.view()).unwrap_err();
        assert_eq!(error.code(), Code::Param);
        assert!(names.iter().all(|n| error.message().contains(n)), "{error}");
    }
}

#[test]
fn different_scalar_types_compare_by_value() {
    let e = Extent::new(13, 12, 5);
    let a = noisy(e, 1, |h| h as u8);
    let same = Grid::from_fn(e, |c| f32::from(a.samples::<u8>()[e.index(c) as usize])).unwrap();
    let b = noisy(e, 2, |h| h as u8);
    let b_wide = Grid::from_fn(e, |c| i16::from(b.samples::<u8>()[e.index(c) as usize])).unwrap();
    assert!(of(&a, &same).identical);
    assert_eq!(of(&same, &b_wide), of(&a, &b));
}

#[test]
fn nan_against_a_number_is_an_infinite_error() {
    let e = Extent::new(12, 12, 2);
    let a = Grid::from_fn(e, |[x, y, _]| if x == y { f32::NAN } else { x as f32 }).unwrap();
    let mut b = Grid::from_samples(e, a.samples::<f32>()).unwrap();
    assert!(of(&a, &b).identical && of(&a, &b).ssim == 1.0);
    b.samples_mut::<f32>()[e.index([5, 5, 1]) as usize] = 0.0;
    let c = of(&a, &b);
    assert_eq!((c.max_error, c.max_error_at, c.psnr, c.identical), (f64::INFINITY, [5, 5, 1], None, false));
    assert!(c.ssim.is_finite() && c.range == 11.0);
    let nothing = filled(e, f32::NAN);
    assert!(of(&nothing, &nothing).identical && of(&nothing, &a).ssim.is_finite());
    let endless = filled(e, f32::INFINITY);
    assert!(of(&endless, &a).ssim.is_finite() && of(&endless, &endless).ssim == 1.0);
}

#[test]
fn threads_and_pitches_change_nothing() {
    let e = Extent::new(40, 33, 19);
    let (a, b) = (noisy(e, 1, |h| h as f32 * 1e-9), noisy(e, 2, |h| h as f32 * 1e-9));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| of(&a, &b))
    };
    assert_eq!(with(1), with(2));
    assert_eq!(with(1), with(5));
    let part = Region { start: [3, 4, 5], end: [30, 30, 19] };
    let dense = |g: &Grid| {
        Grid::from_fn(part.extent(), |[x, y, z]| g.samples::<f32>()[e.index([x + 3, y + 4, z + 5]) as usize]).unwrap()
    };
    let strided = compare(&a.view().sub(&part), &b.view().sub(&part)).unwrap();
    assert_eq!(strided, of(&dense(&a), &dense(&b)));
}

#[test] // M-22
fn class_boundaries_are_half_open() {
    use ErrorClass::{Bad, Exact, Large, Medium, Small};
    for range in [100.0, 255.0, 65535.0, 0.7, 1e-30, 1e30] {
        let of = |percent: f64| ErrorClass::of(range * percent / 100.0, range);
        assert_eq!([of(0.0), of(1e-9), of(4.999), of(5.001), of(9.999)], [Exact, Small, Small, Medium, Medium]);
        assert_eq!([of(10.001), of(14.999), of(15.001), of(400.0)], [Large, Large, Bad, Bad]);
    }
    let exactly = |error: f64| ErrorClass::of(error, 4000.0);
    assert_eq!([exactly(0.0), exactly(200.0), exactly(400.0), exactly(600.0)], [Exact, Medium, Large, Bad]);
    assert_eq!([exactly(199.0), exactly(399.0), exactly(599.0)], [Small, Medium, Large]);
    assert_eq!([ErrorClass::of(0.0, 0.0), ErrorClass::of(1.0, 0.0)], [Exact, Bad]);
    assert_eq!([ErrorClass::of(f64::INFINITY, 1.0), ErrorClass::of(f64::NAN, 1.0)], [Bad, Bad]);
}

#[test]
fn histogram_counts_voxels_by_their_worst_component() {
    let e = Extent::new(3, 1, 1);
    let a = filled(e, [100u8; 3]);
    let b = Grid::from_samples(e, &[[100u8; 3], [101, 100, 120], [100, 200, 100]]).unwrap();
    assert_eq!(difference::class_histogram(&a.view(), &b.view(), 255.0).unwrap(), [1, 0, 1, 0, 1]);
    let c = Grid::zeros(e, SampleType::U8).unwrap();
    assert!(difference::class_histogram(&a.view(), &c.view(), 255.0).is_err());
}
