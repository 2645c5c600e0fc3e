//! Namesake of `shaders/camera.wgsl`.

use super::Frame;
use super::real::{Real, V3, add, scale};
use crate::gpu::Lens;

/// A pixel's place on the film, and the length of a step of 1 along the view direction, along its ray.
#[derive(Clone, Copy, Debug)]
pub struct Ray<R> {
    /// Film coordinates.
    pub film: [R; 2],
    /// Length.
    pub norm: R,
}

/// The ray of a pixel.
pub fn ray_of<R: Real>(frame: &Frame<R>, x: u32, y: u32) -> Ray<R> {
    let film = [frame.film[0] + R::of(x.into()) * frame.pixel, frame.film[1] - R::of(y.into()) * frame.pixel];
    let norm = match frame.lens {
        Lens::Perspective => (R::of(1.0) + film[0] * film[0] + film[1] * film[1]).sqrt(),
        Lens::Orthographic => R::of(1.0),
    };
    Ray { film, norm }
}

/// Where the ray starts: t = 0.
pub fn origin_of<R: Real>(ray: &Ray<R>, base: V3<R>, right_at: V3<R>, up_at: V3<R>) -> V3<R> {
    add(add(base, scale(ray.film[0], right_at)), scale(ray.film[1], up_at))
}

/// How far it goes for a world length of 1.
pub fn direction_of<R: Real>(frame: &Frame<R>, ray: &Ray<R>, forward: V3<R>, right: V3<R>, up: V3<R>) -> V3<R> {
    match frame.lens {
        Lens::Perspective => add(add(forward, scale(ray.film[0], right)), scale(ray.film[1], up)).map(|v| v / ray.norm),
        Lens::Orthographic => forward,
    }
}

/// The part of a ray inside a box, within `span`; empty where it starts behind its end. Half open: a ray along a face is inside at
/// the lower faces only.
pub fn clip_ray<R: Real>(origin: V3<R>, direction: V3<R>, lo: V3<R>, hi: V3<R>, within: [R; 2]) -> [R; 2] {
    let zero = R::of(0.0);
    let mut span = within;
    for a in 0..3 {
        let (o, d) = (origin[a], direction[a]);
        if d == zero {
            if o < lo[a] || o >= hi[a] {
                span = [R::of(1.0), zero];
            }
        } else {
            let (near, far) = if d > zero { (lo[a], hi[a]) } else { (hi[a], lo[a]) };
            span = [span[0].max((near - o) / d), span[1].min((far - o) / d)];
        }
    }
    span
}
