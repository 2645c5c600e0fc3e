//! Namesakes of `shaders/sample_*.wgsl`: values between voxels.

use super::counter::Counter;
use super::real::{Real, V3};
use super::source_s3dc::{block, index_of, pair, reconstruct, word, word_log2};
use super::{Frame, Value, Volume, index, voxel};
use crate::gpu::Sampler;
use crate::gpu::level::Store;

/// The value at a place in index coordinates.
pub fn sample<R: Real>(frame: &Frame<R>, v: &Volume<'_, R>, p: V3<R>, n: &mut impl Counter) -> Value<R> {
    let base = base_of(frame.sampler, p);
    let f = match frame.sampler {
        Sampler::Nearest => [R::of(0.0); 3],
        _ => std::array::from_fn(|a| p[a] - p[a].floor()),
    };
    lerp(frame.sampler, v, base, f, n)
}

/// The voxel that a place is measured from.
pub fn base_of<R: Real>(sampler: Sampler, p: V3<R>) -> [i32; 3] {
    match sampler {
        Sampler::Nearest => p.map(|v| index((v + R::of(0.5)).floor())),
        _ => p.map(|v| index(v.floor())),
    }
}

/// The voxel at `base`, or trilinear between voxels `base` and `base + 1`; outside of the volume, the nearest inside.
pub fn lerp<R: Real>(sampler: Sampler, v: &Volume<'_, R>, base: [i32; 3], f: V3<R>, n: &mut impl Counter) -> Value<R> {
    n.count(|w| w.samples += 1);
    let at =
        |d: i32| -> [u32; 3] { std::array::from_fn(|a| base[a].saturating_add(d).clamp(0, v.last[a]).cast_unsigned()) };
    let (lo, hi) = (at(0), at(1));
    let corners = match (sampler, v.level.layout.store) {
        (Sampler::Nearest, _) => return voxel(v, lo, n),
        (Sampler::LinearOpt, Store::S3dc { .. }) => corners_once(v, lo, hi, n),
        _ => std::array::from_fn(|i| voxel(v, corner(lo, hi, i), n)),
    };
    trilinear(corners, f)
}

/// Corner i of a cell: bit 0 of i is x, bit 1 y, bit 2 z.
fn corner(lo: [u32; 3], hi: [u32; 3], i: usize) -> [u32; 3] {
    std::array::from_fn(|a| if i >> a & 1 == 1 { hi[a] } else { lo[a] })
}

/// Along x, then y, then z.
pub fn trilinear<R: Real>(v: [Value<R>; 8], f: V3<R>) -> Value<R> {
    let rows: [Value<R>; 4] = std::array::from_fn(|i| v[2 * i].mix(v[2 * i + 1], f[0]));
    let faces = [rows[0].mix(rows[1], f[1]), rows[2].mix(rows[3], f[1])];
    faces[0].mix(faces[1], f[2])
}

/// `sample_linear_opt`: the same corners with each index word and each pair of end points fetched once.
fn corners_once<R: Real>(v: &Volume<'_, R>, lo: [u32; 3], hi: [u32; 3], n: &mut impl Counter) -> [Value<R>; 8] {
    let log2 = word_log2(v);
    let rows: [[u32; 2]; 4] = std::array::from_fn(|i| [[lo[1], hi[1]][i & 1], [lo[2], hi[2]][i >> 1]]);
    let near = rows.map(|[y, z]| word(v, [lo[0], y, z], n));
    let far = if lo[0] >> log2 == hi[0] >> log2 { near } else { rows.map(|[y, z]| word(v, [hi[0], y, z], n)) };
    // Along which axes there is another block, seen from the first corner: tiles may put blocks anywhere.
    let first = block(v, lo);
    let d = (0..3).fold(0, |d, a| d | usize::from(block(v, corner(lo, hi, 1 << a)) != first) << a);
    let mut pairs = [[0; 2]; 8];
    let mut i = 0;
    loop {
        let m = pair(v, block(v, corner(lo, hi, i)), n);
        for (j, kept) in pairs.iter_mut().enumerate() {
            if j & d == i {
                *kept = m;
            }
        }
        if i == d {
            break;
        }
        i = ((i | !d) + 1) & d;
    }
    std::array::from_fn(|i| {
        let (words, x) = if i & 1 == 1 { (far, hi[0]) } else { (near, lo[0]) };
        Value::Scalar(reconstruct(v, pairs[i], index_of(v, words[i >> 1], x)))
    })
}
