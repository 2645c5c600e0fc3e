//! Namesake of `shaders/cut_plane.wgsl`.

use super::camera::{Ray, clip_ray, direction_of, origin_of};
use super::counter::Counter;
use super::raycast::{Way, behind};
use super::real::{Real, dot};
use super::{Frame, Volume, value};
use crate::gpu::Effect;

/// The colour of the cutting plane where a ray meets it: premultiplied red, green, blue, opacity. `volumes` are those that are seen,
/// each one volume or a volume at two time steps.
pub fn cut<R: Real>(frame: &Frame<R>, volumes: &[&[Volume<'_, R>]], ray: &Ray<R>, n: &mut impl Counter) -> [R; 4] {
    let zero = R::of(0.0);
    let origin = origin_of(ray, frame.base, frame.right_at, frame.up_at);
    let direction = direction_of(frame, ray, frame.forward, frame.right, frame.up);
    let [x, y, z, distance] = frame.plane;
    // Rays along the plane never meet it.
    let toward = dot([x, y, z], direction);
    if toward == zero {
        return [zero; 4];
    }
    let t = (distance - dot([x, y, z], origin)) / toward;
    let mut scene = [frame.nearest * ray.norm, R::of(3.0e38)];
    if frame.effects.has(Effect::ClipBox) {
        scene = clip_ray(origin, direction, frame.clip_lo, frame.clip_hi, scene);
    }
    let mut sum = [zero; 4];
    for v in volumes {
        let first = &v[0];
        let origin = origin_of(ray, first.base, first.right_at, first.up_at);
        let direction = direction_of(frame, ray, first.forward, first.right, first.up);
        let span = clip_ray(origin, direction, first.box_lo, first.box_hi, scene);
        if t >= span[0] && t < span[1] {
            n.count(|w| w.rays += 1);
            let p = Way { origin, direction, span }.at(t);
            sum = behind(sum, &first.points, value(frame, v, p, n), n);
        }
    }
    sum
}
