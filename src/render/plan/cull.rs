//! Culling by what a camera sees (Marton et al. 2014, §3): bricks beside the picture, behind the camera or outside of the clipping
//! box are not needed in memory.

use super::visible::BrickMask;
use super::{Plan, PlannedLevel};
use crate::error::Result;
use crate::geometry::Coord;
use crate::gpu::Lens;
use crate::render::camera::View;
use crate::render::scene::{ClipBox, Scene};

/// Voxels around a brick from which its values can be asked for: one by interpolation, one more by a gradient, and one for
/// rounding.
const REACH: f64 = 3.0;

impl Plan {
    /// Leaves out of memory what none of these views shows, and what the clipping box leaves out. Pictures from other sides
    /// would then lack bricks: of no views all sides are kept.
    ///
    /// Without the effect `tf_cull` all of it stays in memory, and [`PlannedLevel::in_view`] alone says what is shown.
    ///
    /// # Errors
    /// Those of placements.
    pub fn cull_to(&mut self, scene: &Scene, views: &[View]) -> Result<()> {
        for level in &mut self.levels {
            let films = views.iter().map(|view| Film::of(level, view)).collect::<Result<Vec<_>>>()?;
            let (clip, bricks) = (scene.clip, level.wanted.size());
            let shown = BrickMask::choose(bricks, |brick| {
                let corners = corners(level, brick);
                (level.wanted.has(brick) || level.visible.has(brick))
                    && (films.is_empty() || films.iter().any(|film| film.sees(&corners)))
                    && clip.is_none_or(|clip| overlaps(level, &corners, clip))
            });
            let both = |a: &BrickMask| BrickMask::choose(bricks, |brick| a.has(brick) && shown.has(brick));
            let in_view = both(&level.visible);
            if scene.tf_cull {
                level.wanted = both(&level.wanted);
            }
            level.in_view = in_view;
        }
        Ok(())
    }
}

/// Corners of a brick and what is within reach, in index coordinates of its level.
fn corners(level: &PlannedLevel, brick: Coord) -> [[f64; 3]; 8] {
    let edge = f64::from(1u32 << level.layout.brick_log2);
    std::array::from_fn(|i| {
        std::array::from_fn(|a| {
            let side = if i >> a & 1 == 1 { edge + REACH } else { -REACH };
            f64::from(brick[a]) * edge - 0.5 + side
        })
    })
}

/// Whether the box around the corners, in the world, touches the clipping box.
fn overlaps(level: &PlannedLevel, corners: &[[f64; 3]; 8], clip: ClipBox) -> bool {
    let m = level.placement.moved(level.at.lod, [0; 3]).matrix;
    (0..3).all(|row| {
        let at = corners.map(|c| m[row][0] * c[0] + m[row][1] * c[1] + m[row][2] * c[2] + m[row][3]);
        let (lo, hi) = at.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
        lo <= clip.max[row] && hi >= clip.min[row]
    })
}

/// Four sides and the front of what a camera sees, as planes in index coordinates: inside is ≥ 0.
struct Film {
    planes: Vec<([f64; 3], f64)>,
}

impl Film {
    fn of(level: &PlannedLevel, view: &View) -> Result<Film> {
        let rays = view.rays_in(&level.placement, level.extent, level.at.lod)?;
        let [w, h] = view.size.map(|n| f64::from(n) / 2.0 * view.pixel);
        let axes = [rays.right, rays.up, rays.forward];
        // Film coordinates and depth of an index position: rows of the inverse of the three axes.
        let [x, y, z] = axes;
        let det = dot(x, cross(y, z));
        let rows = [cross(y, z), cross(z, x), cross(x, y)].map(|row| row.map(|v| v / det));
        // From a point near the volume: nothing is lost where the eye is far away (hard case R-04).
        let [u, v, mut depth] = rows.map(|row| (row, -dot(row, rays.focus)));
        depth.1 += rays.depth;
        let sum = |a: ([f64; 3], f64), s: f64, b: ([f64; 3], f64), t: f64| {
            (std::array::from_fn(|i| s * a.0[i] + t * b.0[i]), s * a.1 + t * b.1)
        };
        let one = ([0.0; 3], 1.0);
        // Perspective: |u| ≤ w·depth. Orthographic: |u| ≤ w.
        let wide = if view.lens == Lens::Perspective { depth } else { one };
        let sides = [(u, w), (v, h)].into_iter().flat_map(|(a, most)| [1.0, -1.0].map(|s| sum(a, s, wide, most)));
        let mut planes: Vec<_> = sides.collect();
        planes.push(depth);
        Ok(Film { planes })
    }

    /// Whether the box can be seen: not all of it lies outside of one plane.
    fn sees(&self, corners: &[[f64; 3]; 8]) -> bool {
        self.planes.iter().all(|(n, d)| corners.iter().any(|c| dot(*n, *c) + d >= 0.0))
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
