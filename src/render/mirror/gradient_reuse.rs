//! Namesake of `shaders/gradient_reuse.wgsl`: the 32 voxels that six trilinear samples need together, each word fetched once per
//! row, end points kept in a small table.

use super::counter::Counter;
use super::real::{Real, V3};
use super::sample::trilinear;
use super::source_s3dc::{block, index_of, pair, reconstruct, word, word_log2};
use super::{Value, Volume, grey};

/// End points of the blocks from that of the first voxel on, two along each axis.
struct Pairs {
    first: [u32; 3],
    pairs: [Option<[u32; 2]>; 8],
}

impl Pairs {
    fn kept<R: Real>(&mut self, v: &Volume<'_, R>, c: [u32; 3], n: &mut impl Counter) -> [u32; 2] {
        let block = block(v, c);
        let d: [u32; 3] = std::array::from_fn(|a| block[a].wrapping_sub(self.first[a]));
        if d.iter().any(|&d| d > 1) {
            return pair(v, block, n);
        }
        let slot = (d[0] + 2 * d[1] + 4 * d[2]) as usize;
        *self.pairs[slot].get_or_insert_with(|| pair(v, block, n))
    }
}

/// Voxels at x, in row (y, z); the outer two only where the row is long.
fn row<R: Real>(
    v: &Volume<'_, R>,
    kept: &mut Pairs,
    x: [u32; 4],
    [y, z]: [u32; 2],
    long: bool,
    n: &mut impl Counter,
) -> [R; 4] {
    let mut values = [R::of(0.0); 4];
    let mut held: Option<(u32, u32)> = None;
    let taken = if long { 0..4 } else { 1..3 };
    for i in taken {
        let at = x[i] >> word_log2(v);
        let bits = match held {
            Some((place, bits)) if place == at => bits,
            _ => word(v, [x[i], y, z], n),
        };
        held = Some((at, bits));
        values[i] = reconstruct(v, kept.kept(v, [x[i], y, z], n), index_of(v, bits, x[i]));
    }
    values
}

/// The gradient of the trilinear field.
pub fn gradient<R: Real>(v: &Volume<'_, R>, base: [i32; 3], f: V3<R>, n: &mut impl Counter) -> V3<R> {
    let [x, y, z]: [[u32; 4]; 3] =
        std::array::from_fn(|a| [-1, 0, 1, 2].map(|d| base[a].saturating_add(d).clamp(0, v.last[a]).cast_unsigned()));
    let mut kept = Pairs { first: block(v, [x[0], y[0], z[0]]), pairs: [None; 8] };
    // Rows by y and z, 0 to 3; corners of the 4×4 are never needed.
    let mut rows = [[[R::of(0.0); 4]; 4]; 4];
    let order = [(1, 1), (2, 1), (1, 2), (2, 2), (0, 1), (0, 2), (3, 1), (3, 2), (1, 0), (2, 0), (1, 3), (2, 3)];
    for (i, (j, k)) in order.into_iter().enumerate() {
        rows[j][k] = row(v, &mut kept, x, [y[j], z[k]], i < 4, n);
    }
    let tri = |x: usize, y: usize, z: usize| {
        grey(trilinear(std::array::from_fn(|i| Value::Scalar(rows[y + (i >> 1 & 1)][z + (i >> 2)][x + (i & 1)])), f))
    };
    let half = R::of(0.5);
    [half * (tri(2, 1, 1) - tri(0, 1, 1)), half * (tri(1, 2, 1) - tri(1, 0, 1)), half * (tri(1, 1, 2) - tri(1, 1, 0))]
}
