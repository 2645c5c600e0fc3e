//! Tests of the metrics against plain definitions.

mod compare;
mod ssim;
mod stats;

use crate::geometry::{Coord, Extent};
use crate::grid::Grid;
use crate::voxel::Sample;

/// A number that looks random, but is a fixed function of the place.
fn noise(c: Coord, seed: u64) -> u64 {
    let mut h = (u64::from(c[0]) | u64::from(c[1]) << 21 | u64::from(c[2]) << 42).wrapping_add(seed << 7);
    for _ in 0..3 {
        h = (h ^ h >> 31).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }
    h ^ h >> 29
}

/// A grid of noise, each number made a sample by `f`.
fn noisy<T: Sample>(extent: Extent, seed: u64, f: impl Fn(u64) -> T) -> Grid {
    Grid::from_fn(extent, |c| f(noise(c, seed))).unwrap()
}
