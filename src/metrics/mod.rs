//! Numbers that say how far one volume is from another: maximum and mean error, RMSE, PSNR, SSIM.
//!
//! | number | definition |
//! |---|---|
//! | range | largest minus smallest component of A, the reference; the peak of PSNR and L of SSIM |
//! | max error, mean error | largest and mean of \|a − b\| over all components of all voxels |
//! | RMSE | root of the mean of (a − b)², divided by voxels × components |
//! | PSNR | 20·log10(range / RMSE) in dB |
//! | SSIM | mean over the z slices (and components) of the mean SSIM of each slice, see [`ssim`] |
//!
//! Everything is computed in f64 or exact integers, slice by slice, and the slices are added in order: the result does
//! not depend on the number of threads. Pictures have numbers of their own: [`image`].

pub mod difference;
pub mod image;
mod psnr;
mod rate;
mod ssim;
mod stats;

pub use difference::ErrorClass;
pub use psnr::{psnr, rmse_for_psnr};
pub use rate::bits_per_sample;
pub use ssim::{WINDOW as SSIM_WINDOW, ssim};
pub use stats::{ErrorStats, error_stats, value_range};

use crate::error::{Error, Result};
use crate::geometry::{Coord, Region};
use crate::grid::View;
use crate::voxel::SampleType;
use rayon::prelude::*;

/// What [`compare`] finds.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Largest minus smallest component of A; infinities count, NaN does not.
    pub range: f64,
    /// Largest |a − b|; infinite where a NaN meets a number.
    pub max_error: f64,
    /// The first voxel with the largest error (x fastest); (0, 0, 0) where A and B are equal.
    pub max_error_at: Coord,
    /// Mean of |a − b|.
    pub mean_error: f64,
    /// Root of the mean of (a − b)².
    pub rmse: f64,
    /// In dB; `None` where it is infinite (`identical`) or has no meaning (A is constant, or an error is infinite).
    pub psnr: Option<f64>,
    /// Whether no voxel differs. Two NaNs are equal, and so are +0 and −0.
    pub identical: bool,
    /// Mean over z slices and components of the mean SSIM of the slice; L = range, or 1 where the range is 0 or infinite.
    pub ssim: f64,
    /// Whether slices are smaller than the SSIM window, so that one window covered each whole slice.
    pub ssim_global: bool,
}

/// Sums of one slice.
struct Slice {
    errors: ErrorStats,
    ssim: f64,
}

/// Compares volume `b` with the reference `a`.
///
/// Different scalar types are compared by value. Runs on the threads of the current [rayon] pool.
///
/// # Errors
/// `E_PARAM` where the extents differ, or one volume is RGB and the other is not.
pub fn compare(a: &View<'_>, b: &View<'_>) -> Result<Comparison> {
    check_same_extent(a, b)?;
    check_comparable(a, b)?;
    let range = range_in_parallel(a).map_or(0.0, |(lo, hi)| hi - lo);
    let dynamic_range = if range > 0.0 && range.is_finite() { range } else { 1.0 };
    let slices: Vec<Slice> = (0..a.extent.z)
        .into_par_iter()
        .map(|z| {
            let (a, b) = (plane(a, z), plane(b, z));
            Slice { errors: stats::by_value(&a, &b), ssim: ssim::slice(&a, &b, dynamic_range) }
        })
        .collect();
    let (mut errors, mut worst, mut ssim_sum) = (ErrorStats::default(), 0, 0.0);
    for (z, slice) in (0..).zip(&slices) {
        if slice.errors.max_abs > errors.max_abs {
            worst = z;
        }
        errors.merge(&slice.errors);
        ssim_sum += slice.ssim;
    }
    let identical = errors.max_abs == 0.0;
    let [x, y, _] = if identical { [0; 3] } else { difference::place_of_largest(&plane(a, worst), &plane(b, worst)) };
    Ok(Comparison {
        range,
        max_error: errors.max_abs,
        max_error_at: [x, y, worst],
        mean_error: errors.mean_abs(),
        rmse: errors.rmse(),
        psnr: psnr(range, errors.rmse()),
        identical,
        ssim: ssim_sum / slices.len() as f64,
        ssim_global: ssim::is_global(a.extent.x as usize, a.extent.y as usize),
    })
}

/// Slice z as a box of its own.
fn plane<'a>(v: &View<'a>, z: u32) -> View<'a> {
    v.sub(&Region { start: [0, 0, z], end: [v.extent.x, v.extent.y, z + 1] })
}

/// [`value_range`] with all threads of the pool.
fn range_in_parallel(v: &View<'_>) -> Option<(f64, f64)> {
    let ranges = (0..v.extent.z).into_par_iter().filter_map(|z| value_range(&plane(v, z)));
    ranges.reduce_with(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// Checks that two boxes have the same size.
fn check_same_extent(a: &View<'_>, b: &View<'_>) -> Result<()> {
    if a.extent == b.extent {
        return Ok(());
    }
    let message = format!("{} and {} voxels (x, y, z) cannot be compared voxel by voxel", a.extent, b.extent);
    Err(Error::param("dims", message))
}

/// Checks that two types can be compared by value.
fn check_comparable(a: &View<'_>, b: &View<'_>) -> Result<()> {
    let rgb = |v: &View<'_>| v.sample_type == SampleType::Rgb8;
    if rgb(a) == rgb(b) {
        return Ok(());
    }
    Err(Error::param("dtype", format!("{} and {} samples cannot be compared", a.sample_type, b.sample_type)))
}

#[cfg(test)]
mod tests;
