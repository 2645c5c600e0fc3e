//! Vectors of three, and placements forth and back. All in f64; nothing here squares a length (hard case R-04).

use crate::affine::Placement;
use crate::error::{Error, Result};
use crate::geometry::Extent;

pub(super) fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] + b[i])
}

pub(super) fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

pub(super) fn scaled(a: [f64; 3], s: f64) -> [f64; 3] {
    a.map(|v| v * s)
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Length without overflow.
pub(super) fn length(a: [f64; 3]) -> f64 {
    a[0].hypot(a[1]).hypot(a[2])
}

/// The vector of length 1; that of zeros stays.
pub(super) fn unit(a: [f64; 3]) -> [f64; 3] {
    // Two steps, so that neither tiny nor huge vectors lose anything.
    let largest = a.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    if largest == 0.0 || !largest.is_finite() {
        return a;
    }
    let a = a.map(|v| v / largest);
    let n = length(a);
    a.map(|v| v / n)
}

/// The inverse of the 3×3 part of a placement, rows of index steps per world unit.
///
/// # Errors
/// Those of [`Placement::check`].
pub fn inverse(placement: &Placement) -> Result<[[f64; 3]; 3]> {
    placement.check()?;
    let spacing = placement.spacing();
    // Of unit columns, so that a spacing ratio of a million loses nothing (hard case R-13).
    let columns: [[f64; 3]; 3] = std::array::from_fn(|a| scaled(placement.direction(a), 1.0 / spacing[a]));
    let [a, b, c] = columns;
    let det = dot(a, cross(b, c));
    let rows = [cross(b, c), cross(c, a), cross(a, b)];
    let inverse: [[f64; 3]; 3] = std::array::from_fn(|i| rows[i].map(|v| v / det / spacing[i]));
    if inverse.iter().flatten().any(|v| !v.is_finite()) {
        return Err(Error::param("affine", format!("spacing {spacing:?} cannot be inverted in 64-bit numbers")));
    }
    Ok(inverse)
}

/// A matrix times a vector.
#[must_use]
pub fn apply(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    m.map(|row| dot(row, v))
}

/// World position of the middle of the volume.
pub(super) fn middle(placement: &Placement, extent: Extent) -> [f64; 3] {
    let n = middle_index(extent);
    std::array::from_fn(|row| dot([0, 1, 2].map(|a| placement.matrix[row][a]), n) + placement.matrix[row][3])
}

/// From there to index coordinates of level 0, in world units: exact far from the origin.
#[must_use]
pub(in crate::render) fn from_middle(placement: &Placement, extent: Extent, index: [f64; 3]) -> [f64; 3] {
    let from = sub(index, middle_index(extent));
    (0..3).fold([0.0; 3], |at, a| add(at, scaled(placement.direction(a), from[a])))
}

/// The middle in index coordinates of level 0.
pub(super) fn middle_index(extent: Extent) -> [f64; 3] {
    extent.to_array().map(|n| (f64::from(n) - 1.0) / 2.0)
}

/// Index coordinates of level 0 as those of level `lod`: half-voxel offsets included.
#[must_use]
pub fn to_level(index: [f64; 3], lod: u8) -> [f64; 3] {
    let step = f64::from(1u32 << lod);
    index.map(|v| (v + 0.5) / step - 0.5)
}
