//! From the samples of a unit block to exact coefficients (spec chapter 14, §12; §2.2 of the paper).

use super::layout::{CELL_EDGE, UNIT_EDGE};
use super::params::Norm;
use crate::geometry::{Coord, Extent};
use crate::grid::View;
use crate::haar;

/// One component of a sample.
pub(super) trait Component: bytemuck::Pod + Into<i32> {}
impl Component for u8 {}
impl Component for u16 {}
impl Component for i16 {}

/// Coefficients of the cells of a unit block, as numerators (see [`haar`]), the null value taken off the samples first:
/// a cell without coefficients is null.
pub(super) struct UnitCoefficients<const C: usize> {
    cells: Vec<[[i32; C]; 64]>,
    /// Norms by cell and position.
    keys: Vec<[u64; 64]>,
    /// Cells that have a coefficient which is not 0.
    pub(super) present: u64,
    /// Coefficients that are not 0.
    pub(super) nonzero: u64,
}

impl<const C: usize> UnitCoefficients<C> {
    pub(super) fn new() -> Self {
        UnitCoefficients { cells: vec![[[0; C]; 64]; 64], keys: vec![[0; 64]; 64], present: 0, nonzero: 0 }
    }

    /// Numerators of cell `n`; meaningful where it is present.
    pub(super) fn cell(&self, n: u32) -> &[[i32; C]; 64] {
        &self.cells[n as usize]
    }

    /// Norms of cell `n`; meaningful where it is present.
    pub(super) fn keys(&self, n: u32) -> &[u64; 64] {
        &self.keys[n as usize]
    }

    /// Numbers of the present cells, ascending.
    pub(super) fn present(&self) -> impl Iterator<Item = u32> + use<C> {
        let mut rest = self.present;
        std::iter::from_fn(move || {
            let n = (rest != 0).then(|| rest.trailing_zeros());
            rest &= rest.wrapping_sub(1);
            n
        })
    }

    /// Transforms unit block `unit` of a brick.
    pub(super) fn load<S: Component>(&mut self, src: &View<'_>, unit: Coord, null: [i32; C], norm: Norm) {
        (self.present, self.nonzero) = (0, 0);
        for n in 0..64 {
            let at = [n & 3, n >> 2 & 3, n >> 4];
            let origin: Coord = std::array::from_fn(|a| unit[a] * UNIT_EDGE + at[a] * CELL_EDGE);
            if !src.extent.contains(origin) {
                continue; // wholly outside: null, and not counted (spec: ZBT-27)
            }
            let cell = gather::<S, C>(src, origin, null);
            if cell.iter().all(|v| *v == [0; C]) {
                continue;
            }
            let numerators = haar::forward_components(&cell);
            let keys = &mut self.keys[n as usize];
            weigh(&numerators, norm, keys);
            self.nonzero += keys.iter().filter(|&&k| k != 0).count() as u64;
            self.cells[n as usize] = numerators;
            self.present |= 1 << n;
        }
    }
}

/// Norms that compare as the coefficients do: squares of numerators, those of level 1 scaled so that one unit is the same
/// on both levels.
fn weigh<const C: usize>(numerators: &[[i32; C]; 64], norm: Norm, keys: &mut [u64; 64]) {
    // Level 1 counts in eighths, level 0 in sixty-fourths: squares differ by 64. A coefficient of level 0 reaches eight
    // times as many voxels, which leaves 8 where the error that it causes is asked for.
    let level_1 = match norm {
        Norm::Energy => 8,
        Norm::Plain => 64,
    };
    for (p, (key, numerator)) in keys.iter_mut().zip(numerators).enumerate() {
        let square: u64 = if C == 3 {
            // Three components are of 8 bits: |numerator| ≤ 64 · 255.
            numerator.iter().map(|&s| (s * s) as u32).sum::<u32>().into()
        } else {
            numerator.iter().map(|&s| (i64::from(s) * i64::from(s)) as u64).sum()
        };
        *key = if p < 8 { square } else { level_1 * square };
    }
}

/// The 64 samples of a cell less the null value; behind the end of the brick, its last samples again.
#[inline]
fn gather<S: Component, const C: usize>(src: &View<'_>, origin: Coord, null: [i32; C]) -> [[i32; C]; 64] {
    let voxel = size_of::<S>() * C;
    let Extent { x: ex, y: ey, z: ez } = src.extent;
    let whole = origin[0] + CELL_EDGE <= ex;
    let mut out = [[0; C]; 64];
    for z in 0..4 {
        for y in 0..4 {
            let (sy, sz) = ((origin[1] + y).min(ey - 1), (origin[2] + z).min(ez - 1));
            let row = sy as usize * src.row_pitch + sz as usize * src.slice_pitch;
            let to = &mut out[(4 * y + 16 * z) as usize..][..4];
            let take = |bytes: &[u8]| -> [i32; C] {
                std::array::from_fn(|c| {
                    let s: S = bytemuck::pod_read_unaligned(&bytes[c * size_of::<S>()..][..size_of::<S>()]);
                    s.into() - null[c]
                })
            };
            if whole {
                let from = &src.bytes[row + origin[0] as usize * voxel..][..4 * voxel];
                for (to, from) in to.iter_mut().zip(from.chunks_exact(voxel)) {
                    *to = take(from);
                }
            } else {
                for (x, to) in (0..).zip(to) {
                    let at = row + (origin[0] + x).min(ex - 1) as usize * voxel;
                    *to = take(&src.bytes[at..at + voxel]);
                }
            }
        }
    }
    out
}
