//! A camera in its place, and its rays in the index coordinates of a volume.

use super::matrix::{add, apply, cross, dot, inverse, middle, middle_index, scaled, sub, to_level, unit};
use crate::affine::Placement;
use crate::error::Result;
use crate::geometry::Extent;
use crate::gpu::Lens;

/// A camera in the world. `right`, `up` and `forward` have length 1 and are orthogonal.
///
/// Pixel (x, y) of a picture of W×H pixels, rows from the top, lies on the film at
/// u = (x + ½ − W/2)·pixel, v = (H/2 − y − ½)·pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Perspective or orthographic.
    pub lens: Lens,
    /// Position in world units. Orthographic rays start in the plane through it.
    pub eye: [f64; 3],
    /// Direction of growing x in the picture.
    pub right: [f64; 3],
    /// Direction of falling y in the picture.
    pub up: [f64; 3],
    /// Viewing direction.
    pub forward: [f64; 3],
    /// Size of a pixel: world units at distance 1 (perspective), world units (orthographic).
    pub pixel: f64,
    /// Width and height of the picture, in pixels.
    pub size: [u32; 2],
    /// What it is placed by, in world units: what the camera looks at, or the middle of the volume.
    pub center: [f64; 3],
    /// From there to the eye: exact where the eye itself is rounded far from the origin.
    pub from_center: [f64; 3],
    /// From there to what is in the middle of the picture, and what the camera turns around.
    pub pivot: [f64; 3],
    /// The axis that a turntable turns around.
    pub axis: [f64; 3],
}

/// Rays of a view in index coordinates of one level of one volume (voxel i has its centre at i). Lengths along a ray are
/// world lengths.
///
/// Perspective: origin, direction (forward + u·right + v·up) / √(1 + u² + v²). Orthographic: origin + u·right + v·up,
/// direction forward.
#[derive(Clone, Debug, PartialEq)]
pub struct Rays {
    /// Perspective or orthographic.
    pub lens: Lens,
    /// The eye.
    pub origin: [f64; 3],
    /// Index steps per world unit along the viewing direction.
    pub forward: [f64; 3],
    /// Index steps per world unit of u.
    pub right: [f64; 3],
    /// Index steps per world unit of v.
    pub up: [f64; 3],
    /// As [`View::pixel`].
    pub pixel: f64,
    /// The point straight ahead of the eye at the distance of the volume's middle: rays through it and its plane keep their
    /// precision in f32 however far away the eye is.
    pub focus: [f64; 3],
    /// World length from the eye to `focus`; negative where the middle lies behind.
    pub depth: f64,
}

impl View {
    /// The view from another side: turned around its axis, which goes through its pivot, by `angle` radians.
    #[must_use]
    pub fn turned(&self, angle: f64) -> View {
        let turn = |v: [f64; 3]| {
            let (s, c) = angle.sin_cos();
            let k = self.axis;
            // Rodrigues' formula.
            add(add(scaled(v, c), scaled(cross(k, v), s)), scaled(k, dot(k, v) * (1.0 - c)))
        };
        let from_center = add(self.pivot, turn(sub(self.from_center, self.pivot)));
        View {
            eye: add(self.center, from_center),
            right: unit(turn(self.right)),
            up: unit(turn(self.up)),
            forward: unit(turn(self.forward)),
            from_center,
            ..self.clone()
        }
    }

    /// Film coordinates of the middle of pixel (x, y).
    #[must_use]
    pub fn film(&self, x: f64, y: f64) -> [f64; 2] {
        let [w, h] = self.size.map(f64::from);
        [(x + 0.5 - w / 2.0) * self.pixel, (h / 2.0 - y - 0.5) * self.pixel]
    }

    /// The rays in index coordinates of level `lod` of a volume of `extent` voxels at level 0.
    ///
    /// The eye is taken relative to the volume's middle before anything is rounded, so that an origin of 10⁹ with a spacing
    /// of 10⁻⁶ loses nothing that the file has not lost already (hard case D-57).
    ///
    /// # Errors
    /// Those of [`Placement::check`].
    pub fn rays_in(&self, placement: &Placement, extent: Extent, lod: u8) -> Result<Rays> {
        let inverse = inverse(placement)?;
        let step = f64::from(1u32 << lod);
        let turned = |v: [f64; 3]| apply(&inverse, v).map(|c| c / step);
        let middle_to_eye = add(sub(self.center, middle(placement, extent)), self.from_center);
        let at_middle = to_level(middle_index(extent), lod);
        // Straight ahead as far as the middle; what is left is sideways.
        let depth = -dot(middle_to_eye, self.forward);
        let sideways = add(middle_to_eye, scaled(self.forward, depth));
        Ok(Rays {
            lens: self.lens,
            origin: add(at_middle, turned(middle_to_eye)),
            forward: turned(self.forward),
            right: turned(self.right),
            up: turned(self.up),
            pixel: self.pixel,
            focus: add(at_middle, turned(sideways)),
            depth,
        })
    }
}

impl Rays {
    /// Origin and direction of the ray at film coordinates u, v: index coordinates, and index steps per world length.
    #[must_use]
    pub fn ray(&self, [u, v]: [f64; 2]) -> ([f64; 3], [f64; 3]) {
        let sideways = add(scaled(self.right, u), scaled(self.up, v));
        match self.lens {
            Lens::Perspective => {
                let n = 1.0_f64.hypot(u).hypot(v);
                (self.origin, scaled(add(self.forward, sideways), 1.0 / n))
            }
            Lens::Orthographic => (add(self.origin, sideways), self.forward),
        }
    }
}
