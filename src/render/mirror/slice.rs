//! Namesake of `shaders/slice.wgsl`, and of the unit that blends slabs.

use super::camera::{Ray, clip_ray, direction_of, origin_of};
use super::counter::Counter;
use super::gradient::world;
use super::opacity::correct;
use super::raycast::Way;
use super::real::Real;
use super::shade::shade;
use super::{Frame, Volume, classify, slope, value};
use crate::gpu::Effect;

/// The colour of a pixel: its part of all slabs, blended from the front to the back. `frame.samples` is the number of slabs,
/// `frame.nearest` where the first begins.
pub fn slices<R: Real>(frame: &Frame<R>, volumes: &[&[Volume<'_, R>]], ray: &Ray<R>, n: &mut impl Counter) -> [R; 4] {
    let mut sum = [R::of(0.0); 4];
    for k in 0..frame.samples {
        let one = seen(frame, volumes, ray, k, n);
        let rest = R::of(1.0) - sum[3];
        sum = std::array::from_fn(|a| sum[a] + rest * one[a]);
    }
    sum
}

/// What slab k adds to a ray that nothing hides.
fn seen<R: Real>(frame: &Frame<R>, volumes: &[&[Volume<'_, R>]], ray: &Ray<R>, k: u32, n: &mut impl Counter) -> [R; 4] {
    let mut scene = [k, k + 1].map(|k| (frame.nearest + R::of(k.into()) * frame.step) * ray.norm);
    if frame.effects.has(Effect::ClipBox) {
        let origin = origin_of(ray, frame.base, frame.right_at, frame.up_at);
        let direction = direction_of(frame, ray, frame.forward, frame.right, frame.up);
        scene = clip_ray(origin, direction, frame.clip_lo, frame.clip_hi, scene);
    }
    let mut sum = [R::of(0.0); 4];
    for v in volumes {
        let first = &v[0];
        let origin = origin_of(ray, first.base, first.right_at, first.up_at);
        let direction = direction_of(frame, ray, first.forward, first.right, first.up);
        let span = clip_ray(origin, direction, first.box_lo, first.box_hi, scene);
        if span[0] < span[1] {
            let p = Way { origin, direction, span }.at(R::of(0.5) * (span[0] + span[1]));
            let c = classify(&first.points, value(frame, v, p, n));
            n.count(|w| w.lookups += 1);
            if c[3] > R::of(0.0) {
                let mut color = [c[0], c[1], c[2]];
                if frame.effects.has(Effect::GradientShading) {
                    n.count(|w| w.lit += 1);
                    let direction = direction_of(frame, ray, frame.forward, frame.right, frame.up);
                    color = shade(frame, color, world(first, slope(frame, v, p, n)), direction);
                }
                let r = (span[1] - span[0]) / frame.step * first.ratio;
                n.count(|w| w.corrections += u64::from(r != R::of(1.0)));
                let a = (R::of(1.0) - sum[3]) * correct(c[3], r);
                sum = [sum[0] + a * color[0], sum[1] + a * color[1], sum[2] + a * color[2], sum[3] + a];
            }
        }
    }
    sum
}
