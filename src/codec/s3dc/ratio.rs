//! Compression ratios and error bounds of the paper (§3.3 eq. 3 to 5, §3.4 eq. 6, §4.2), as functions.

use super::Params;
use crate::geometry::Extent;

/// Ratio of the volume to its end points and indices, block counts rounded up: what the paper's Table 1 prints.
// spec: S3D-25
///
/// `s_bits` is the number of bits of a sample.
#[must_use]
pub fn formula_ratio(volume: Extent, s_bits: u32, params: &Params) -> f64 {
    let voxels = volume.voxels() as f64;
    let blocks = volume.div_ceil(params.block()).voxels() as f64;
    voxels * f64::from(s_bits) / (blocks * 2.0 * f64::from(s_bits) + voxels * f64::from(params.i_bits()))
}

/// The closed form of eq. 5, which assumes that blocks divide the volume.
#[must_use]
pub fn closed_form_ratio(s_bits: u32, params: &Params) -> f64 {
    let block = params.block().voxels() as f64;
    (f64::from(params.i_bits()) / f64::from(s_bits) + 2.0 / block).recip()
}

/// Ratio that textures padded to powers of two would give (§4.2). Nothing padded is ever stored.
#[must_use]
pub fn padded_ratio(volume: Extent, s_bits: u32, params: &Params) -> f64 {
    let texture = |e: Extent| e.to_array().map(|v| f64::from(v.next_power_of_two())).iter().product::<f64>();
    let words = Extent::new(volume.x.div_ceil(16 / u32::from(params.i_bits())), volume.y, volume.z);
    let mmv = texture(volume.div_ceil(params.block())) * 2.0 * f64::from(s_bits);
    volume.voxels() as f64 * f64::from(s_bits) / (mmv + texture(words) * 16.0)
}

/// Maximum error of eq. 6 as printed, for samples of `s_bits` in 1..=16: an upper bound that integers never attain.
#[must_use]
pub const fn eq6_max_error(s_bits: u32, i_bits: u8) -> u32 {
    let (range, q) = ((1u32 << s_bits) - 1, (1u32 << i_bits) - 1);
    range.div_ceil(2 * q)
}

/// Most that an integer sample can be off in a block with `range = max − min` and end points min and max.
///
/// Half a step, and half a unit more for rounding a level, unless the levels are whole numbers.
#[must_use]
pub const fn integer_error_bound(range: u32, q: u32) -> u32 {
    // spec: S3D-22
    if range.is_multiple_of(q) { range / q / 2 } else { (range + q) / (2 * q) }
}
