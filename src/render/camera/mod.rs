//! Cameras: what a scene says of one, and where it then stands.

mod fit;
mod lod;
mod matrix;
#[cfg(test)]
mod tests;
mod view;

pub use lod::{LodChoice, level_for};
pub(super) use matrix::from_middle;
pub use matrix::{apply, inverse, to_level};
pub use view::{Rays, View};

use crate::affine::{Placement, Space};
use crate::error::{Code, Error, Result};
use crate::geometry::Extent;
use crate::gpu::Lens;
use matrix::{add, cross, length, scaled, sub, unit};
use serde::{Deserialize, Serialize};

/// Largest width and height of a picture, in pixels.
pub const MAX_SIDE: u32 = 1 << 14;

/// What a scene says of its camera. Where it stands follows from the volume, unless it is said.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraSpec {
    /// `perspective` or `orthographic`.
    #[serde(with = "super::scene::named")]
    pub lens: Lens,
    /// Perspective: angle between the upper and the lower edge of the picture, in degrees.
    pub fov: f64,
    /// Orthographic: height of the picture in world units; without it all of the volume is seen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height: Option<f64>,
    /// Degrees around the vertical axis: 0 looks from the front, 90 from the left side of whom is seen.
    pub azimuth: f64,
    /// Degrees above the horizon, −90 to 90.
    pub elevation: f64,
    /// Enlarges a picture in which all of the volume would be seen.
    pub zoom: f64,
    /// Where the camera stands, in world units; without it, as far away as all is seen that the transfer function shows.
    #[serde(deserialize_with = "super::scene::named::exact_or_none", skip_serializing_if = "Option::is_none")]
    pub eye: Option<[f64; 3]>,
    /// What it looks at, in world units; without it the middle of what is seen, or of the volume where `eye` or `height` is
    /// given.
    #[serde(deserialize_with = "super::scene::named::exact_or_none", skip_serializing_if = "Option::is_none")]
    pub target: Option<[f64; 3]>,
    /// What is up in the picture; without it the world's third axis.
    #[serde(deserialize_with = "super::scene::named::exact_or_none", skip_serializing_if = "Option::is_none")]
    pub up: Option<[f64; 3]>,
}

impl Default for CameraSpec {
    fn default() -> Self {
        CameraSpec {
            lens: Lens::Perspective,
            fov: 30.0,
            height: None,
            azimuth: 30.0,
            elevation: 15.0,
            zoom: 1.0,
            eye: None,
            target: None,
            up: None,
        }
    }
}

fn bad<T>(field: &'static str, message: impl Into<String>) -> Result<T> {
    Err(Error::param(field, message))
}

impl CameraSpec {
    /// Checks all that needs no volume, and the size of the picture in pixels.
    ///
    /// # Errors
    /// `E_PARAM` for angles, heights and factors outside of their ranges, NaN and infinities, and an empty picture;
    /// `E_LIMIT` for a picture above [`MAX_SIDE`].
    pub fn check(&self, size: [u32; 2]) -> Result<()> {
        let [w, h] = size;
        if w == 0 || h == 0 {
            return bad("size", format!("a picture of {w}×{h} pixels has none; give at least 1×1"));
        }
        if w > MAX_SIDE || h > MAX_SIDE {
            let message = format!("a picture of {w}×{h} pixels is too large; at most {MAX_SIDE} on each side");
            return Err(Error::new(Code::Limit, "size", message));
        }
        let positive = |v: f64| v.is_normal() && v > 0.0;
        if !(self.fov > 0.0 && self.fov < 180.0 && positive(self.fov)) {
            return bad("camera.fov", format!("{} degrees; it must lie between 0 and 180", self.fov));
        }
        if self.height.is_some_and(|h| !positive(h)) {
            return bad("camera.height", "the view's height must be a positive length");
        }
        if self.height.is_some() && self.lens == Lens::Perspective {
            return bad("camera.height", "it is for the orthographic lens; perspective has fov");
        }
        if !positive(self.zoom) {
            return bad("camera.zoom", format!("{} enlarges nothing; give a positive number", self.zoom));
        }
        if !self.azimuth.is_finite() || !(-90.0..=90.0).contains(&self.elevation) {
            return bad("camera.elevation", "angles must be numbers, the elevation one from −90 to 90 degrees");
        }
        for (field, given) in [("camera.eye", self.eye), ("camera.target", self.target), ("camera.up", self.up)] {
            if given.is_some_and(|v| v.iter().any(|c| !c.is_finite())) {
                return bad(field, "a coordinate is NaN or infinite");
            }
        }
        if self.up.is_some_and(|up| length(up) == 0.0) {
            return bad("camera.up", "it has no direction");
        }
        Ok(())
    }

    /// Whether it frames what can be seen, because nothing says where it stands.
    #[must_use]
    pub fn is_auto(&self) -> bool {
        self.eye.is_none() && self.target.is_none() && self.height.is_none()
    }

    /// Where the camera stands for one volume: its placement, its voxels at level 0, and the picture's width and height in
    /// pixels.
    ///
    /// # Errors
    /// Those of [`CameraSpec::check`] and [`Placement::check`]; `E_PARAM` where the camera stands on what it looks at, or
    /// looks along its up.
    pub fn resolve(&self, placement: &Placement, extent: Extent, size: [u32; 2]) -> Result<View> {
        self.resolve_all(&[(placement, extent)], size)
    }

    /// As [`CameraSpec::resolve`], for several volumes: it looks at the middle of their common box.
    ///
    /// # Errors
    /// As [`CameraSpec::resolve`]; `E_PARAM` for no volume.
    pub fn resolve_all(&self, volumes: &[(&Placement, Extent)], size: [u32; 2]) -> Result<View> {
        self.resolve_seen(volumes, &[], size)
    }

    /// As [`CameraSpec::resolve_all`], but it frames these points of each volume, in world units from its middle, where
    /// nothing says where it stands. Of none, the volume's box.
    ///
    /// # Errors
    /// As [`CameraSpec::resolve_all`].
    pub fn resolve_seen(&self, volumes: &[(&Placement, Extent)], seen: &[&[[f64; 3]]], size: [u32; 2]) -> Result<View> {
        self.check(size)?;
        let Some((first, _)) = volumes.first() else { return bad("volume", "the scene has none") };
        for (placement, _) in volumes {
            placement.check()?;
        }
        let framed = if self.is_auto() { seen } else { &[] };
        let (middle, corners) = corners(volumes, framed);
        let center = self.target.unwrap_or(middle);
        let pivot = if self.is_auto() { box_middle(&corners) } else { [0.0; 3] };
        let (away, natural_up) = self.direction(first.space);
        let from_eye = self.eye.map(|eye| sub(eye, center));
        let forward = unit(scaled(from_eye.unwrap_or(away), -1.0));
        if !(from_eye.is_none_or(|v| length(v).is_finite() && length(v) > 0.0)) {
            let message = "the camera stands on what it looks at, or too far away to say in which direction";
            return bad("camera.eye", message);
        }
        let wanted_up = match (self.up, self.eye) {
            (Some(up), _) => unit(up),
            (None, None) => natural_up,
            // From straight above or below, what lies in front is up.
            (None, Some(_)) if length(cross(forward, [0.0, 0.0, 1.0])) < 1e-9 => front(first.space),
            (None, Some(_)) => [0.0, 0.0, 1.0],
        };
        let right = cross(forward, wanted_up);
        if length(right) < 1e-9 {
            return bad("camera.up", format!("the camera looks along its up, {wanted_up:?}; give another one"));
        }
        let right = unit(right);
        let up = cross(right, forward);
        // In a left-handed world the vector product points to the left.
        let right = if first.space == Space::Las { scaled(right, -1.0) } else { right };
        let axis = self.up.map_or([0.0, 0.0, 1.0], unit);
        let frame = [right, up, forward];
        let all: Vec<[f64; 3]> = corners.iter().map(|c| sub(add(*c, sub(middle, center)), pivot)).collect();
        let [w, h] = size.map(f64::from);
        let half = (self.fov.to_radians() / 2.0).tan();
        let from_center = from_eye.unwrap_or_else(|| {
            let distance = match self.lens {
                Lens::Perspective => fit::distance(&all, axis, frame, [half * w / h, half]),
                Lens::Orthographic => 2.0 * all.iter().map(|c| length(*c)).fold(0.0, f64::max),
            };
            add(pivot, scaled(away, distance / self.zoom))
        });
        let pixel = match (self.lens, self.height) {
            (Lens::Perspective, _) => 2.0 * half / h,
            (Lens::Orthographic, Some(height)) => height / self.zoom / h,
            (Lens::Orthographic, None) => fit::height(&all, axis, frame, w / h) / self.zoom / h,
        };
        let eye = self.eye.unwrap_or_else(|| add(center, from_center));
        Ok(View { lens: self.lens, eye, right, up, forward, pixel, size, center, from_center, pivot, axis })
    }

    /// Direction from the middle to the camera, and what is up from there: never the same.
    fn direction(&self, space: Space) -> ([f64; 3], [f64; 3]) {
        let front = front(space);
        // The left side of whom is seen from the front lies to the right in the picture.
        let left = cross([0.0, 0.0, 1.0], front);
        let left = if matches!(space, Space::Las) { scaled(left, -1.0) } else { left };
        let ((sa, ca), (se, ce)) = (self.azimuth.to_radians().sin_cos(), self.elevation.to_radians().sin_cos());
        let around = add(scaled(front, ca), scaled(left, sa));
        let away = add(scaled(around, ce), [0.0, 0.0, se]);
        (away, add(scaled(around, -se), [0.0, 0.0, ce]))
    }
}

/// Which way the front of a body looks: anterior.
fn front(space: Space) -> [f64; 3] {
    match space {
        Space::Ras | Space::Las => [0.0, 1.0, 0.0],
        // Where nothing is known the second axis points backward, as rows of most images do.
        Space::Lps | Space::Scanner | Space::Unknown => [0.0, -1.0, 0.0],
    }
}

/// Middle of the box around all volumes in world units, and points of each relative to it: those that are given, else its
/// corners.
///
/// Of one volume the middle is exactly where its own middle is computed to be, so that a camera can be placed relative to it
/// without loss (hard case D-57).
fn corners(volumes: &[(&Placement, Extent)], seen: &[&[[f64; 3]]]) -> ([f64; 3], Vec<[f64; 3]>) {
    let whole = |(p, e): (&Placement, Extent)| -> Vec<[f64; 3]> {
        let n = e.to_array().map(f64::from);
        let corner = |i: usize| std::array::from_fn(|a| if i >> a & 1 == 1 { n[a] - 0.5 } else { -0.5 });
        (0..8).map(|i| from_middle(p, e, corner(i))).collect()
    };
    let own = |i: usize| match seen.get(i) {
        Some(points) if !points.is_empty() => points.to_vec(),
        _ => whole(volumes[i]),
    };
    if let [(placement, extent)] = volumes {
        return (matrix::middle(placement, *extent), own(0));
    }
    let moved = |points: Vec<[f64; 3]>, by: [f64; 3]| points.into_iter().map(move |c| add(c, by));
    let middle_of = |i: usize| matrix::middle(volumes[i].0, volumes[i].1);
    let all: Vec<_> = (0..volumes.len()).flat_map(|i| moved(whole(volumes[i]), middle_of(i))).collect();
    let middle = box_middle(&all);
    let points = (0..volumes.len()).flat_map(|i| moved(own(i), sub(middle_of(i), middle)));
    (middle, points.collect())
}

/// Middle of the box around points.
fn box_middle(points: &[[f64; 3]]) -> [f64; 3] {
    let fold = |f: fn(f64, f64) -> f64, start: f64| -> [f64; 3] {
        std::array::from_fn(|a| points.iter().map(|c| c[a]).fold(start, f))
    };
    let (lo, hi) = (fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY));
    std::array::from_fn(|a| lo[a] + (hi[a] - lo[a]) / 2.0)
}

/// Radius of the sphere around all volumes, in world units.
pub(super) fn radius_of_all(volumes: &[(&Placement, Extent)]) -> f64 {
    corners(volumes, &[]).1.into_iter().map(length).fold(0.0, f64::max)
}

/// Half the diagonal of one volume's box, in world units.
#[must_use]
pub fn radius(placement: &Placement, extent: Extent) -> f64 {
    radius_of_all(&[(placement, extent)])
}

/// Largest and smallest spacing of level 0.
#[must_use]
pub fn spacing_ends(placement: &Placement) -> (f64, f64) {
    let s = placement.spacing();
    (s.into_iter().fold(0.0, f64::max), s.into_iter().fold(f64::INFINITY, f64::min))
}
