//! Namesake of `shaders/iso.wgsl`.

use super::camera::{Ray, direction_of};
use super::counter::Counter;
use super::gradient::world;
use super::raycast::{Steps, Way, grey_at};
use super::real::Real;
use super::shade::shade;
use super::{Frame, Volume, classify, skip, slope, value};
use crate::gpu::Effect;

/// Halvings of the last step.
pub const HALVINGS: u32 = 8;

/// The first place along a ray where the value reaches the iso-surface's (hard case R-23).
pub fn march<R: Real>(
    frame: &Frame<R>,
    v: &[Volume<'_, R>],
    ray: &Ray<R>,
    steps: &Steps<R>,
    way: &Way<R>,
    n: &mut impl Counter,
) -> [R; 4] {
    // The first sample is where the ray enters: a surface that is cut open by the box has a lid.
    // What can be jumped over lies outside, and may not be in memory.
    let known =
        frame.effects.has(Effect::EmptySkip) && skip::next(frame, &v[0], way.at(steps.start), way.direction, 0, n) > 0;
    if !known && grey_at(frame, v, way, steps.start, n) >= frame.iso {
        return surface(frame, v, ray, way, steps.start, n);
    }
    let mut last = steps.start;
    let mut k = 0;
    while k < steps.count {
        let t = steps.start + (R::of(k.into()) + steps.part(k)) * frame.step;
        if frame.effects.has(Effect::EmptySkip) {
            let next = skip::next(frame, &v[0], way.at(t), way.direction, k, n);
            if next > k {
                k = next;
                last = steps.start + R::of(k.into()) * frame.step;
                continue;
            }
        }
        if grey_at(frame, v, way, t, n) >= frame.iso {
            let t = halve(frame, v, way, last, t, n);
            return surface(frame, v, ray, way, t, n);
        }
        last = t;
        k += 1;
    }
    [R::of(0.0); 4]
}

/// Where in (outer, inner] the surface lies: `outer` is outside, `inner` inside.
fn halve<R: Real>(frame: &Frame<R>, v: &[Volume<'_, R>], way: &Way<R>, outer: R, inner: R, n: &mut impl Counter) -> R {
    let (mut a, mut b) = (outer, inner);
    for _ in 0..HALVINGS {
        let middle = R::of(0.5) * (a + b);
        if grey_at(frame, v, way, middle, n) >= frame.iso {
            b = middle;
        } else {
            a = middle;
        }
    }
    b
}

fn surface<R: Real>(
    frame: &Frame<R>,
    v: &[Volume<'_, R>],
    ray: &Ray<R>,
    way: &Way<R>,
    t: R,
    n: &mut impl Counter,
) -> [R; 4] {
    let p = way.at(t);
    n.count(|w| w.lookups += 1);
    let c = classify(&v[0].points, value(frame, v, p, n));
    let mut color = [c[0], c[1], c[2]];
    if frame.effects.has(Effect::GradientShading) {
        n.count(|w| w.lit += 1);
        let direction = direction_of(frame, ray, frame.forward, frame.right, frame.up);
        color = shade(frame, color, world(&v[0], slope(frame, v, p, n)), direction);
    }
    [color[0], color[1], color[2], R::of(1.0)]
}
