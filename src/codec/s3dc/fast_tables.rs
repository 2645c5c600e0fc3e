//! What the end points of a row of blocks contribute to every voxel of a row (safe code, compiled per instruction set).

use super::Layout;
use super::fast::CHUNK;
use super::scalar::Scalar;

/// Per-voxel values of one row, on a cache line of its own.
#[derive(Clone)]
#[repr(C, align(64))]
pub struct Table<V>(pub [V; CHUNK]);

impl<V: Copy + Default> Default for Table<V> {
    fn default() -> Self {
        Table([V::default(); CHUNK])
    }
}

/// The blocks that cover voxels x0 to x1 − 1 in a row of blocks.
pub struct BlockRow<'a> {
    /// Their stored pairs.
    pub pairs: &'a [u8],
    /// Number of blocks.
    pub count: usize,
    /// Voxels of the first block that lie before `x0`.
    pub before: usize,
    /// Block edge along x.
    pub edge: usize,
}

impl<'a> BlockRow<'a> {
    /// Finds the pairs of row (by, bz) in the payload.
    #[inline(always)]
    pub fn new(layout: &Layout, payload: &'a [u8], [x0, x1]: [u32; 2], [by, bz]: [u32; 2]) -> Self {
        let edge = layout.params().block().x;
        let first = x0 / edge;
        let last = (x1 - 1) / edge;
        let count = (last - first + 1) as usize;
        let at = layout.mmv_at([first, by, bz]);
        BlockRow {
            pairs: &payload[at..at + count * 2 * layout.sample_type().bytes()],
            count,
            before: (x0 - first * edge) as usize,
            edge: edge as usize,
        }
    }

    /// Calls `f(block, min, max)` for every pair as stored.
    #[inline(always)]
    pub fn for_each<T: Scalar>(&self, mut f: impl FnMut(usize, T, T)) {
        for (b, pair) in self.pairs.chunks_exact(2 * T::BYTES).enumerate().take(CHUNK) {
            f(b, T::from_le(pair), T::from_le(&pair[T::BYTES..]));
        }
    }

    /// Copies the value of every block to the voxels of the block; `scale` voxels share an entry of `out`.
    #[inline(always)]
    pub fn spread<V: Copy>(&self, values: &Table<V>, scale: usize, out: &mut Table<V>) {
        let (edge, before) = (self.edge / scale, self.before / scale);
        let values = &values.0[..self.count.min(CHUNK)];
        match (edge, before) {
            (1, 0) => out.0[..values.len()].copy_from_slice(values),
            (2, 0) => spread_by::<V, 2>(values, &mut out.0),
            (4, 0) => spread_by::<V, 4>(values, &mut out.0),
            (8, 0) => spread_by::<V, 8>(values, &mut out.0),
            _ => {
                let mut at = 0;
                let mut left = edge - before;
                for &v in values {
                    let end = (at + left).min(CHUNK);
                    out.0[at..end].fill(v);
                    (at, left) = (end, edge);
                }
            }
        }
    }
}

#[inline(always)]
fn spread_by<V: Copy, const N: usize>(values: &[V], out: &mut [V; CHUNK]) {
    for (chunk, &v) in out.as_chunks_mut::<N>().0.iter_mut().zip(values) {
        *chunk = [v; N];
    }
}
