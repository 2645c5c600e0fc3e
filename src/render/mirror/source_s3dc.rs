//! Namesake of `shaders/source_s3dc.wgsl` (S3Dc, §4.2).

use super::counter::Counter;
use super::real::Real;
use super::source_raw::scalar;
use super::{Value, Volume};
use crate::gpu::level::Store;
use crate::voxel::SampleType;

const MINMAX: usize = 0;
const INDEX: usize = 1;

/// A voxel: a word of indices and a pair of end points, two fetches.
pub fn voxel<R: Real>(v: &Volume<'_, R>, c: [u32; 3], n: &mut impl Counter) -> Value<R> {
    let (pair, word) = (pair(v, block(v, c), n), word(v, c, n));
    Value::Scalar(reconstruct(v, pair, index_of(v, word, c[0])))
}

/// The word that holds the index of voxel `c`.
pub fn word<R: Real>(v: &Volume<'_, R>, c: [u32; 3], n: &mut impl Counter) -> u32 {
    n.count(|w| w.index_fetches += 1);
    let layout = &v.level.layout;
    v.level.texel(INDEX, layout.texel(&layout.textures[INDEX], c))[0]
}

fn bits<R: Real>(v: &Volume<'_, R>) -> (SampleType, u32) {
    match v.level.layout.store {
        Store::S3dc { sample, index_bits, .. } => (sample, index_bits),
        _ => unreachable!("only levels of s3dc come here"),
    }
}

/// log2 of the indices in a word.
pub fn word_log2<R: Real>(v: &Volume<'_, R>) -> u32 {
    4 - bits(v).1.trailing_zeros()
}

/// The index of a voxel with this x in its word.
pub fn index_of<R: Real>(v: &Volume<'_, R>, word: u32, x: u32) -> u32 {
    let i = bits(v).1;
    word >> ((x & ((1 << word_log2(v)) - 1)) * i) & ((1 << i) - 1)
}

/// The texel with the end points of the block of voxel `c`.
pub fn block<R: Real>(v: &Volume<'_, R>, c: [u32; 3]) -> [u32; 3] {
    let layout = &v.level.layout;
    layout.texel(&layout.textures[MINMAX], c)
}

/// End points, as the 32 bits that a shader has of them.
pub fn pair<R: Real>(v: &Volume<'_, R>, block: [u32; 3], n: &mut impl Counter) -> [u32; 2] {
    n.count(|w| w.minmax_fetches += 1);
    let texel = v.level.texel(MINMAX, block);
    [texel[0], texel[1]]
}

/// Integers exactly (spec: S3D-10, S3D-12), floats in this type (spec: S3D-11; f32 on the GPU).
pub fn reconstruct<R: Real>(v: &Volume<'_, R>, pair: [u32; 2], index: u32) -> R {
    let (sample, i) = bits(v);
    let q = (1u32 << i) - 1;
    if sample == SampleType::F32 {
        let [min, max] = pair.map(|p| scalar::<R>(sample, p));
        let ordered = max > min; // false for NaN, too
        if !ordered || index == 0 {
            return min;
        }
        if index == q {
            return max;
        }
        let a = R::of(index.into()) / R::of(q.into());
        return (R::of(1.0) - a) * min + a * max;
    }
    let [min, max] = pair.map(u32::cast_signed);
    let range = (max - min).max(0).cast_unsigned();
    R::of(f64::from(min + ((2 * range * index + q) / (2 * q)).cast_signed()))
}
