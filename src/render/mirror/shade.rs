//! Namesake of `shaders/shade.wgsl`.

use super::Frame;
use super::real::{Real, V3, dot};

/// Light on a sample; without a gradient, its own colour (hard case R-12).
pub fn shade<R: Real>(frame: &Frame<R>, color: V3<R>, normal: V3<R>, direction: V3<R>) -> V3<R> {
    let zero = R::of(0.0);
    let one = R::of(1.0);
    let size = normal[0].abs().max(normal[1].abs().max(normal[2].abs()));
    let faces = size > zero; // false for NaN, too
    if !faces {
        return color;
    }
    let n = normal.map(|v| v / size);
    let facing = (dot(n, direction).abs() / dot(n, n).sqrt()).min(one);
    let light = frame.ambient + frame.diffuse * facing;
    let shine = frame.specular * facing.pow(frame.shininess);
    color.map(|c| (c * light + shine).min(one))
}
