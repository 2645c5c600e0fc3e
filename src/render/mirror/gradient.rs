//! Namesake of `shaders/gradient.wgsl`.

use super::counter::Counter;
use super::real::{Real, V3};
use super::{Frame, Volume, base_of, gradient_reuse, grey, lerp};
use crate::gpu::level::Store;
use crate::gpu::{Sampler, key::Gradient};

/// The gradient of the sampled field by central differences of one voxel, per voxel along x, y and z.
pub fn gradient<R: Real>(frame: &Frame<R>, v: &Volume<'_, R>, p: V3<R>, n: &mut impl Counter) -> V3<R> {
    n.count(|w| w.gradients += 1);
    let base = base_of(frame.sampler, p);
    let f: V3<R> = std::array::from_fn(|a| p[a] - R::of(base[a].into()));
    if let (Gradient::Reuse, Sampler::Linear | Sampler::LinearOpt, Store::S3dc { .. }) =
        (frame.gradient, frame.sampler, v.level.layout.store)
    {
        return gradient_reuse::gradient(v, base, f, n);
    }
    std::array::from_fn(|a| {
        let mut at = |d: i32| {
            let mut b = base;
            b[a] = b[a].saturating_add(d);
            grey(lerp(frame.sampler, v, b, f, n))
        };
        let (after, before) = (at(1), at(-1));
        R::of(0.5) * (after - before)
    })
}

/// A gradient in world units, along the axes of the world.
pub fn world<R: Real>(v: &Volume<'_, R>, g: V3<R>) -> V3<R> {
    std::array::from_fn(|a| g[0] * v.world_x[a] + g[1] * v.world_y[a] + g[2] * v.world_z[a])
}
