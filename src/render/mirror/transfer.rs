//! Namesake of `shaders/transfer.wgsl`.

use super::Value;
use super::real::Real;

/// A control point, and the way to the next one.
#[derive(Clone, Copy, Debug)]
pub struct Point<R> {
    /// Red, green, blue, opacity of one reference length.
    pub color: [R; 4],
    /// The next point's less this one's.
    pub slope: [R; 4],
    /// In sample units.
    pub value: R,
    /// 1 / (the next value − this one); 0 where there is no way to go.
    pub per_value: R,
}

/// Colour and opacity of a value. The shader looks at each of a few points in turn, and finds the same one.
pub fn classify<R: Real>(points: &[Point<R>], value: Value<R>) -> [R; 4] {
    let v = grey(value);
    let mut i = 0;
    let mut s = points_top(points.len());
    while s > 0 {
        if i + s < points.len() && v >= points[i + s].value {
            i += s;
        }
        s >>= 1;
    }
    let p = &points[i];
    let t = ((v - p.value) * p.per_value).max(R::of(0.0)).min(R::of(1.0));
    let c: [R; 4] = std::array::from_fn(|a| p.color[a] + p.slope[a] * t);
    match value {
        Value::Colour(rgb) => [rgb[0] / R::of(255.0), rgb[1] / R::of(255.0), rgb[2] / R::of(255.0), c[3]],
        Value::Scalar(_) => c,
    }
}

/// The largest power of two below `points`; 0 for one point.
#[must_use]
pub const fn points_top(points: usize) -> usize {
    if points < 2 { 0 } else { 1 << (points - 1).ilog2() }
}

/// What the transfer function looks at: the value, or the largest component of a colour.
pub fn grey<R: Real>(value: Value<R>) -> R {
    match value {
        Value::Scalar(v) => v,
        Value::Colour(c) => c[0].max(c[1].max(c[2])),
    }
}
