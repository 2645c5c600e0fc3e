//! Namesake of `shaders/source_raw.wgsl`.

use super::counter::Counter;
use super::real::Real;
use super::{Value, Volume};
use crate::voxel::SampleType;

/// A voxel of an uncompressed texture: one fetch.
pub fn voxel<R: Real>(v: &Volume<'_, R>, c: [u32; 3], n: &mut impl Counter) -> Value<R> {
    n.count(|w| w.raw_fetches += 1);
    let layout = &v.level.layout;
    let texel = v.level.texel(0, layout.texel(&layout.textures[0], c));
    match layout.store.sample() {
        SampleType::Rgb8 => Value::Colour([texel[0], texel[1], texel[2]].map(|v| R::of(v.into()))),
        t => Value::Scalar(scalar(t, texel[0])),
    }
}

/// The number that a texel's 32 bits stand for in a shader.
pub(super) fn scalar<R: Real>(t: SampleType, bits: u32) -> R {
    R::of(match t {
        SampleType::I16 => f64::from(bits.cast_signed()),
        SampleType::F32 => f64::from(f32::from_bits(bits)),
        _ => f64::from(bits),
    })
}
