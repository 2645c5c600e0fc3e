//! Namesake of `shaders/raycast.wgsl`.

use super::camera::{Ray, clip_ray, direction_of, origin_of};
use super::counter::Counter;
use super::gradient::world;
use super::opacity::correct;
use super::real::{Real, V3, add, scale};
use super::shade::shade;
use super::{Frame, Value, Volume, classify, grey, iso, skip, slope, value};
use crate::gpu::key::MAX_VOLUMES;
use crate::gpu::{Effect, Projection};

/// A ray in the index coordinates of a volume.
#[derive(Clone, Copy, Debug)]
pub struct Way<R> {
    /// Where t = 0.
    pub origin: V3<R>,
    /// For a world length of 1.
    pub direction: V3<R>,
    /// From where to where it is inside.
    pub span: [R; 2],
}

impl<R: Real> Way<R> {
    /// The place at t.
    pub fn at(&self, t: R) -> V3<R> {
        add(self.origin, scale(t, self.direction))
    }
}

/// Steps of a ray: from where, how many, and how long the last one is.
#[derive(Clone, Copy, Debug)]
pub struct Steps<R> {
    /// Where the first begins.
    pub start: R,
    /// How many.
    pub count: u32,
    /// Length of the last one, 0 to 1.
    pub tail: R,
}

impl<R: Real> Steps<R> {
    /// Length of step k, 0 to 1.
    pub fn part(&self, k: u32) -> R {
        if k == self.count - 1 { self.tail } else { R::of(1.0) }
    }
}

/// The colour of a ray: premultiplied red, green, blue, opacity. `volumes` are those that are seen, each one volume or a volume at
/// two time steps.
pub fn trace<R: Real>(frame: &Frame<R>, volumes: &[&[Volume<'_, R>]], ray: &Ray<R>, n: &mut impl Counter) -> [R; 4] {
    let far = R::of(3.0e38);
    let mut scene = [frame.nearest * ray.norm, far];
    if frame.effects.has(Effect::ClipBox) {
        let origin = origin_of(ray, frame.base, frame.right_at, frame.up_at);
        let direction = direction_of(frame, ray, frame.forward, frame.right, frame.up);
        scene = clip_ray(origin, direction, frame.clip_lo, frame.clip_hi, scene);
    }
    let mut all = [far, -far];
    let ways: Vec<Way<R>> = volumes
        .iter()
        .map(|v| {
            let v = &v[0];
            let origin = origin_of(ray, v.base, v.right_at, v.up_at);
            let direction = direction_of(frame, ray, v.forward, v.right, v.up);
            let span = clip_ray(origin, direction, v.box_lo, v.box_hi, scene);
            if span[0] < span[1] {
                all = [all[0].min(span[0]), all[1].max(span[1])];
            }
            Way { origin, direction, span }
        })
        .collect();
    if all[0] >= all[1] {
        return [R::of(0.0); 4];
    }
    n.count(|w| w.rays += 1);
    let steps = (all[1] - all[0]) / frame.step;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to the number of samples")]
    let count = steps.min(R::of(frame.samples.into())).ceil().to_f64() as u32;
    let tail = (steps - R::of(f64::from(count - 1))).min(R::of(1.0));
    let steps = Steps { start: all[0], count, tail };
    match frame.projection {
        Projection::Composite => composite(frame, volumes, ray, &steps, &ways, n),
        Projection::Maximum | Projection::Minimum => extreme(frame, volumes, &steps, &ways, n),
        Projection::Mean => mean(frame, volumes, &steps, &ways, n),
        Projection::Iso => iso::march(frame, volumes[0], ray, &steps, &ways[0], n),
    }
}

fn composite<R: Real>(
    frame: &Frame<R>,
    volumes: &[&[Volume<'_, R>]],
    ray: &Ray<R>,
    steps: &Steps<R>,
    ways: &[Way<R>],
    n: &mut impl Counter,
) -> [R; 4] {
    let mut sum = [R::of(0.0); 4];
    let mut k = 0;
    while k < steps.count {
        let part = steps.part(k);
        let t = steps.start + (R::of(k.into()) + R::of(0.5) * part) * frame.step;
        let mut hops = [k; MAX_VOLUMES];
        if frame.effects.has(Effect::EmptySkip) {
            for ((v, way), hop) in volumes.iter().zip(ways).zip(&mut hops) {
                *hop = skip::next(frame, &v[0], way.at(t), way.direction, k, n);
            }
            let next = hops[..volumes.len()].iter().fold(steps.count, |a, b| a.min(*b));
            if next > k {
                k = next;
                continue;
            }
        }
        for ((v, way), hop) in volumes.iter().zip(ways).zip(hops) {
            // What another volume shows here says nothing of this one, whose brick may not be in memory.
            if volumes.len() > 1 && (hop != k || t < way.span[0] || t >= way.span[1]) {
                continue;
            }
            let p = way.at(t);
            let c = classify(&v[0].points, value(frame, v, p, n));
            n.count(|w| w.lookups += 1);
            if c[3] > R::of(0.0) {
                let mut color = [c[0], c[1], c[2]];
                if frame.effects.has(Effect::GradientShading) {
                    n.count(|w| w.lit += 1);
                    let direction = direction_of(frame, ray, frame.forward, frame.right, frame.up);
                    color = shade(frame, color, world(&v[0], slope(frame, v, p, n)), direction);
                }
                let r = part * v[0].ratio;
                n.count(|w| w.corrections += u64::from(r != R::of(1.0)));
                let a = (R::of(1.0) - sum[3]) * correct(c[3], r);
                sum = [sum[0] + a * color[0], sum[1] + a * color[1], sum[2] + a * color[2], sum[3] + a];
            }
        }
        if frame.effects.has(Effect::EarlyOut) && sum[3] > frame.enough {
            break;
        }
        k += 1;
    }
    sum
}

/// The colour of `value` behind what there is.
pub(super) fn behind<R: Real>(
    sum: [R; 4],
    points: &[super::Point<R>],
    value: Value<R>,
    n: &mut impl Counter,
) -> [R; 4] {
    n.count(|w| w.lookups += 1);
    let c = classify(points, value);
    let rest = R::of(1.0) - sum[3];
    std::array::from_fn(|a| sum[a] + rest * if a == 3 { c[3] } else { c[3] * c[a] })
}

fn extreme<R: Real>(
    frame: &Frame<R>,
    volumes: &[&[Volume<'_, R>]],
    steps: &Steps<R>,
    ways: &[Way<R>],
    n: &mut impl Counter,
) -> [R; 4] {
    let mut sum = [R::of(0.0); 4];
    for (v, way) in volumes.iter().zip(ways) {
        let mut best: Option<Value<R>> = None;
        for k in 0..steps.count {
            let t = steps.start + (R::of(k.into()) + R::of(0.5) * steps.part(k)) * frame.step;
            if volumes.len() > 1 && (t < way.span[0] || t >= way.span[1]) {
                continue;
            }
            let now = value(frame, v, way.at(t), n);
            best = Some(match best {
                None => now,
                Some(b) if frame.projection == Projection::Maximum => b.zip(now, R::max),
                Some(b) => b.zip(now, R::min),
            });
        }
        if let Some(best) = best {
            sum = behind(sum, &v[0].points, best, n);
        }
    }
    sum
}

fn mean<R: Real>(
    frame: &Frame<R>,
    volumes: &[&[Volume<'_, R>]],
    steps: &Steps<R>,
    ways: &[Way<R>],
    n: &mut impl Counter,
) -> [R; 4] {
    let mut sum = [R::of(0.0); 4];
    for (v, way) in volumes.iter().zip(ways) {
        let mut length = R::of(0.0);
        let mut mean: Option<Value<R>> = None;
        for k in 0..steps.count {
            let part = steps.part(k);
            let t = steps.start + (R::of(k.into()) + R::of(0.5) * part) * frame.step;
            if volumes.len() > 1 && (t < way.span[0] || t >= way.span[1]) {
                continue;
            }
            let now = value(frame, v, way.at(t), n);
            length += part;
            let share = part / length;
            // Begins at 0 as the shader does.
            mean = Some(mean.unwrap_or_else(|| now.zip(now, |_, _| R::of(0.0))).zip(now, |m, v| m + (v - m) * share));
        }
        if let Some(mean) = mean {
            sum = behind(sum, &v[0].points, mean, n);
        }
    }
    sum
}

/// The value of a scalar volume at t, for iso-surfaces.
pub(super) fn grey_at<R: Real>(frame: &Frame<R>, v: &[Volume<'_, R>], way: &Way<R>, t: R, n: &mut impl Counter) -> R {
    grey(value(frame, v, way.at(t), n))
}
