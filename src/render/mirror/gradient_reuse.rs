//! Namesake of `shaders/gradient_reuse.wgsl`: the 32 voxels that six trilinear samples need together, each word fetched once per
//! row, each pair of end points once.

use super::counter::Counter;
use super::real::{Real, V3};
use super::sample::trilinear;
use super::source_s3dc::{block, index_of, pair, reconstruct, word, word_log2};
use super::{Value, Volume, grey};
use crate::gpu::level::Store;

/// Rows by y and z, 0 to 3: four of four voxels along x, eight of the two in the middle. Corners of the 4×4 are never needed.
const ROWS: [[usize; 2]; 12] =
    [[1, 1], [2, 1], [1, 2], [2, 2], [0, 1], [0, 2], [3, 1], [3, 2], [1, 0], [2, 0], [1, 3], [2, 3]];
/// How many of them are long.
const LONG: usize = 4;

/// Voxels of row r.
const fn taken(r: usize) -> std::ops::Range<usize> {
    if r < LONG { 0..4 } else { 1..3 }
}

/// Blocks of three voxels or more: four voxels in a row lie in two of them at most.
fn few<R: Real>(v: &Volume<'_, R>) -> bool {
    let layout = &v.level.layout;
    match layout.store {
        Store::S3dc { block, .. } => layout.is_aligned(block) && block.iter().all(|&b| b > 2),
        _ => false,
    }
}

/// Indices of the voxels x in row (y, z).
fn row<R: Real>(
    v: &Volume<'_, R>,
    x: [u32; 4],
    [y, z]: [u32; 2],
    taken: std::ops::Range<usize>,
    n: &mut impl Counter,
) -> [u32; 4] {
    let mut indices = [0; 4];
    let mut held: Option<(u32, u32)> = None;
    for i in taken {
        let at = x[i] >> word_log2(v);
        let bits = match held {
            Some((place, bits)) if place == at => bits,
            _ => word(v, [x[i], y, z], n),
        };
        held = Some((at, bits));
        indices[i] = index_of(v, bits, x[i]);
    }
    indices
}

/// The gradient of the trilinear field.
pub fn gradient<R: Real>(v: &Volume<'_, R>, base: [i32; 3], f: V3<R>, n: &mut impl Counter) -> V3<R> {
    let [x, y, z]: [[u32; 4]; 3] =
        std::array::from_fn(|a| [-1, 0, 1, 2].map(|d| base[a].saturating_add(d).clamp(0, v.last[a]).cast_unsigned()));
    let mut rows = [[[R::of(0.0); 4]; 4]; 4];
    let indices: [[u32; 4]; 12] = std::array::from_fn(|r| row(v, x, [y[ROWS[r][0]], z[ROWS[r][1]]], taken(r), n));
    if few(v) {
        // Blocks along an axis: that of the first voxel, and perhaps another.
        let corner = |i: usize| block(v, std::array::from_fn(|a| [x, y, z][a][if i >> a & 1 == 1 { 3 } else { 0 }]));
        let other = |a: usize, j: usize| {
            let mut c = [x[0], y[0], z[0]];
            c[a] = [x, y, z][a][j];
            usize::from(block(v, c) != corner(0)) << a
        };
        let d = other(0, 3) | other(1, 3) | other(2, 3);
        let mut i = 0;
        loop {
            let m = pair(v, corner(i), n);
            for (r, [j, k]) in ROWS.into_iter().enumerate() {
                for t in taken(r).filter(|&t| other(0, t) | other(1, j) | other(2, k) == i) {
                    rows[j][k][t] = reconstruct(v, m, indices[r][t]);
                }
            }
            if i == d {
                break;
            }
            i = ((i | !d) + 1) & d;
        }
    } else {
        for (r, [j, k]) in ROWS.into_iter().enumerate() {
            for t in taken(r) {
                rows[j][k][t] = reconstruct(v, pair(v, block(v, [x[t], y[j], z[k]]), n), indices[r][t]);
            }
        }
    }
    let tri = |x: usize, y: usize, z: usize| {
        grey(trilinear(std::array::from_fn(|i| Value::Scalar(rows[y + (i >> 1 & 1)][z + (i >> 2)][x + (i & 1)])), f))
    };
    let half = R::of(0.5);
    [half * (tri(2, 1, 1) - tri(0, 1, 1)), half * (tri(1, 2, 1) - tri(1, 0, 1)), half * (tri(1, 1, 2) - tri(1, 1, 0))]
}
