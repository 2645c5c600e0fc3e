//! Which level of detail a picture needs: one for a volume, from the size of a voxel on the screen (Marton et al. 2014, §3
//! and §5: of the point of the bounding sphere that is nearest to the camera).

use super::matrix::{add, length, middle, sub};
use super::{View, radius, spacing_ends};
use crate::affine::Placement;
use crate::error::{Error, Result};
use crate::geometry::Extent;
use crate::gpu::Lens;

/// A level, and how it was found.
#[derive(Clone, Debug, PartialEq)]
pub struct LodChoice {
    /// The level; 0 is the finest.
    pub lod: u8,
    /// Size of a pixel at the volume's nearest point, in world units; 0 where the camera is inside of its sphere.
    pub pixel: f64,
    /// Why this level, for people.
    pub reason: String,
}

/// The coarsest of `levels` levels whose voxels are no larger than `tolerance` pixels, seen from the nearest point of the
/// volume's bounding sphere; level 0 inside of it.
///
/// # Errors
/// `E_PARAM` for a tolerance that is no positive number, and those of [`Placement::check`].
pub fn level_for(view: &View, placement: &Placement, extent: Extent, levels: u8, tolerance: f64) -> Result<LodChoice> {
    placement.check()?;
    if !(tolerance.is_finite() && tolerance > 0.0) {
        return Err(Error::param("lod.pixels", format!("{tolerance} pixels; give a positive number")));
    }
    let to_middle = add(sub(view.center, middle(placement, extent)), view.from_center);
    // Lengths, never their squares: nothing overflows for a camera at 10³⁰⁰ (hard case R-04).
    let nearest = length(to_middle) - radius(placement, extent);
    let (pixel, seen) = match view.lens {
        Lens::Orthographic => (view.pixel, "everywhere (orthographic)".to_owned()),
        // NaN as well (hard case R-32).
        Lens::Perspective if nearest.is_nan() || nearest <= 0.0 => (0.0, String::new()),
        Lens::Perspective => (view.pixel * nearest, format!("at the nearest distance of {nearest:.6}")),
    };
    let voxel = spacing_ends(placement).0;
    let last = levels.saturating_sub(1);
    let level = (tolerance.log2() + pixel.log2() - voxel.log2()).floor();
    // Also −∞ and NaN: the finest.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    let lod = if level > 0.0 { level.min(f64::from(last)) as u8 } else { 0 };
    let reason = if pixel == 0.0 {
        "the camera is within the volume's sphere: the finest level".to_owned()
    } else {
        let voxels = pixel / voxel;
        let held = if level > f64::from(last) { ", and it is the coarsest there is" } else { "" };
        format!("a pixel covers {voxels:.3} voxels {seen}; level {lod} for {tolerance} pixel(s) a voxel{held}")
    };
    Ok(LodChoice { lod, pixel, reason })
}
