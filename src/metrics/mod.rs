//! Numbers that say how far one volume is from another: maximum and mean error, RMSE, PSNR, SSIM.

mod stats;

pub use stats::{ErrorStats, error_stats, value_range};

use crate::error::{Error, Result};
use crate::grid::View;

/// Checks that two boxes have the same size.
fn check_same_extent(a: &View<'_>, b: &View<'_>) -> Result<()> {
    if a.extent == b.extent {
        return Ok(());
    }
    Err(Error::param(
        "dims",
        format!("{} and {} voxels (x, y, z) cannot be compared voxel by voxel", a.extent, b.extent),
    ))
}

#[cfg(test)]
mod tests;
