//! From the samples of a unit block to exact coefficients (spec chapter 14, §12; §2.2 of the paper).
//!
//! Four cells that lie side by side along x are transformed at once, a *row of cells*: lanes are neighbours along x, so
//! that the steps along y and z need no shuffling. [`crate::haar`] defines the result.

use super::layout::{CELL_EDGE, UNIT_EDGE};
use super::params::Norm;
use crate::geometry::{Coord, Extent};
use crate::grid::View;
use std::ops::{Add, BitOr, Sub};

/// One component of a sample.
pub(super) trait Component: bytemuck::Pod {
    /// Holds numerators of coefficients.
    type Number: Number;
    /// Holds norms of coefficients: squares of up to three numerators, times 64.
    type Key: Copy + Ord + Default + Add<Output = Self::Key> + Into<u64> + TryFrom<u64> + Send;
    /// The sample as a number.
    fn number(self) -> Self::Number;
    /// The sample with this value, which is within its range.
    fn of(value: i32) -> Self;
    /// Square of a numerator, times `weight`.
    fn square(numerator: Self::Number, weight: u32) -> Self::Key;
}

/// A signed integer with room for sums of 64 samples.
pub(super) trait Number:
    Copy + Default + PartialEq + Into<i32> + Add<Output = Self> + Sub<Output = Self> + BitOr<Output = Self>
{
}
impl Number for i16 {}
impl Number for i32 {}

impl Component for u8 {
    // |numerator| ≤ 64 · 255.
    type Number = i16;
    type Key = u32;
    fn number(self) -> i16 {
        self.into()
    }
    fn of(value: i32) -> u8 {
        value as u8
    }
    #[inline(always)]
    fn square(numerator: i16, weight: u32) -> u32 {
        let wide = i32::from(numerator);
        (wide * wide) as u32 * weight
    }
}

macro_rules! wide_component {
    ($($t:ty)*) => {$(
        impl Component for $t {
            type Number = i32;
            type Key = u64;
            fn number(self) -> i32 {
                self.into()
            }
            fn of(value: i32) -> $t {
                value as $t
            }
            #[inline(always)]
            fn square(numerator: i32, weight: u32) -> u64 {
                let wide = i64::from(numerator);
                (wide * wide) as u64 * u64::from(weight)
            }
        }
    )*};
}
wide_component! { u16 i16 }

/// Coefficients side by side: of level 1 those of the eight 2³ groups along x, of level 0 two of each of four cells.
type Lanes<T> = [T; LANES];
const LANES: usize = 8;
/// Lanes that hold the level-0 coefficients of a row of cells; those of level 1 follow.
const LEVEL_0: usize = 4;
/// Lanes of a row of cells: 4 · 64 coefficients.
const ROWS: usize = 32;
/// Rows of cells in a unit block.
const CELL_ROWS: usize = 16;

/// Position p of the coefficient in lane `k` of row `r`, and its cell along x.
const fn place(r: usize, k: usize) -> (usize, usize) {
    if r < LEVEL_0 {
        return (2 * r + k / 4, k % 4);
    }
    let (part, j) = ((r - LEVEL_0) / 7, (r - LEVEL_0) % 7 + 1);
    (7 + 7 * (k % 2 + 2 * part) + j, k / 2)
}

/// Row of position p and its lane in cell 0; a lane of cell 1 is one further on level 0, two on level 1.
const fn row_and_lane(p: usize) -> (usize, usize) {
    if p < 8 {
        return (p / 2, p % 2 * 4);
    }
    let (part, j) = ((p - 8) / 7, (p - 8) % 7);
    (LEVEL_0 + 7 * (part / 2) + j, part % 2)
}

/// Coefficients of the cells of a unit block, as numerators (see [`crate::haar`]), the null value taken off the samples
/// first: a cell without coefficients is null.
pub(super) struct UnitCoefficients<S: Component, const C: usize> {
    numerators: Vec<[[Lanes<S::Number>; ROWS]; C]>,
    keys: Vec<[Lanes<S::Key>; ROWS]>,
    null: [S::Number; C],
    /// Bytes of a row of 16 voxels that are null.
    null_row: Vec<u8>,
    /// Cells that have a coefficient which is not 0.
    pub(super) present: u64,
    /// Coefficients that are not 0.
    pub(super) nonzero: u64,
}

/// A cell of a [`UnitCoefficients`].
#[derive(Clone, Copy)]
pub(super) struct CellCoefficients<'a, N, const C: usize> {
    rows: &'a [[Lanes<N>; ROWS]; C],
    /// Its number along x.
    x: usize,
}

impl<N: Number, const C: usize> CellCoefficients<'_, N, C> {
    /// Numerators of the coefficient at position `p`.
    #[inline]
    pub(super) fn numerator(&self, p: usize) -> [i32; C] {
        let (row, lane) = row_and_lane(p);
        let lane = lane + if p < 8 { self.x } else { 2 * self.x };
        std::array::from_fn(|c| self.rows[c][row][lane].into())
    }
}

impl<S: Component, const C: usize> UnitCoefficients<S, C> {
    /// Room for one unit block after the other.
    pub(super) fn new(null: [i32; C]) -> Self {
        let null = null.map(S::of);
        UnitCoefficients {
            numerators: vec![[[[S::Number::default(); LANES]; ROWS]; C]; CELL_ROWS],
            keys: vec![[[S::Key::default(); LANES]; ROWS]; CELL_ROWS],
            null: null.map(S::number),
            null_row: bytemuck::cast_slice::<S, u8>(&null).repeat(UNIT_EDGE as usize),
            present: 0,
            nonzero: 0,
        }
    }

    /// Cell `n`, which is present.
    pub(super) fn cell(&self, n: u32) -> CellCoefficients<'_, S::Number, C> {
        CellCoefficients { rows: &self.numerators[n as usize / 4], x: n as usize % 4 }
    }

    /// Norms that are not 0, in any order.
    pub(super) fn each_key(&self, mut visit: impl FnMut(S::Key)) {
        let zero = S::Key::default();
        for row in self.live_rows() {
            self.keys[row].as_flattened().iter().filter(|&&key| key != zero).for_each(|&key| visit(key));
        }
    }

    /// Calls `visit` with cell and position of each coefficient whose norm is at least `least`, which is not 0.
    pub(super) fn each_at_least(&self, least: S::Key, mut visit: impl FnMut(usize, usize)) {
        for row in self.live_rows() {
            for (r, lanes) in self.keys[row].iter().enumerate() {
                // Mostly none: this one test takes all lanes at once.
                if lanes.iter().fold(false, |any, &key| any | (key >= least)) {
                    for (k, _) in lanes.iter().enumerate().filter(|&(_, &key)| key >= least) {
                        let (p, x) = place(r, k);
                        visit(4 * row + x, p);
                    }
                }
            }
        }
    }

    /// Rows of cells in which a cell is present.
    fn live_rows(&self) -> impl Iterator<Item = usize> + use<S, C> {
        let present = self.present;
        (0..CELL_ROWS).filter(move |row| present >> (4 * row) & 0xF != 0)
    }

    /// Transforms unit block `unit` of a brick. Norms are left as they are.
    pub(super) fn load(&mut self, src: &View<'_>, unit: Coord) {
        (self.present, self.nonzero) = (0, 0);
        for row in 0..CELL_ROWS as u32 {
            let origin = [
                unit[0] * UNIT_EDGE,
                unit[1] * UNIT_EDGE + row % 4 * CELL_EDGE,
                unit[2] * UNIT_EDGE + row / 4 * CELL_EDGE,
            ];
            // Cells wholly outside: null, and not counted (spec: ZBT-27).
            if src.extent.contains(origin) {
                self.load_row(src, origin, row as usize);
            }
        }
    }

    fn load_row(&mut self, src: &View<'_>, origin: Coord, row: usize) {
        let voxel = size_of::<S>() * C;
        let len = self.null_row.len();
        let Extent { x: ex, y: ey, z: ez } = src.extent;
        let inside = (ex - origin[0]).min(UNIT_EDGE) as usize;
        let at = |y: u32, z: u32| {
            // Behind the end of the brick, its last samples again.
            let (y, z) = ((origin[1] + y).min(ey - 1), (origin[2] + z).min(ez - 1));
            let start = y as usize * src.row_pitch + z as usize * src.slice_pitch + origin[0] as usize * voxel;
            &src.bytes[start..start + inside * voxel]
        };
        let null_part = &self.null_row[..inside * voxel];
        if (0..4).all(|z| (0..4).all(|y| at(y, z) == null_part)) {
            return;
        }
        // Sums and differences of neighbours along x, by component, by y and z.
        let mut low = [[[S::Number::default(); LANES]; 16]; C];
        let mut high = low;
        let mut padded = [0u8; 16 * 8];
        for i in 0..16 {
            let mut bytes = at(i & 3, i >> 2);
            if inside < UNIT_EDGE as usize {
                let end = inside.next_multiple_of(CELL_EDGE as usize);
                padded[..len].copy_from_slice(&self.null_row);
                padded[..bytes.len()].copy_from_slice(bytes);
                for x in inside..end {
                    padded.copy_within((inside - 1) * voxel..inside * voxel, x * voxel);
                }
                bytes = &padded[..len];
            }
            for (k, pair) in bytes.chunks_exact(2 * voxel).enumerate() {
                let sample = |c: usize| {
                    let s: S = bytemuck::pod_read_unaligned(&pair[c * size_of::<S>()..][..size_of::<S>()]);
                    s.number()
                };
                for c in 0..C {
                    let (a, b) = (sample(c) - self.null[c], sample(C + c) - self.null[c]);
                    (low[c][i as usize][k], high[c][i as usize][k]) = (a + b, a - b);
                }
            }
        }
        for c in 0..C {
            transform(&low[c], &high[c], &mut self.numerators[row][c]);
        }
        let counts = count(&self.numerators[row]);
        for (level, counts) in counts.iter().enumerate() {
            for (k, &n) in counts.iter().enumerate().filter(|&(_, &n)| n > 0) {
                self.present |= 1 << (4 * row + place(level * LEVEL_0, k).1);
                self.nonzero += u64::from(n);
            }
        }
    }

    /// Makes norms that compare as the coefficients do: squares of numerators, those of level 1 scaled so that one unit is
    /// the same on both levels.
    pub(super) fn weigh(&mut self, norm: Norm) {
        // Level 1 counts in eighths, level 0 in sixty-fourths: squares differ by 64. A coefficient of level 0 reaches eight
        // times as many voxels, which leaves 8 where the error that it causes is asked for.
        let level_1 = match norm {
            Norm::Energy => 8,
            Norm::Plain => 64,
        };
        for row in self.live_rows() {
            let numerators = &self.numerators[row];
            for (r, keys) in self.keys[row].iter_mut().enumerate() {
                let weight = if r < LEVEL_0 { 1 } else { level_1 };
                *keys = std::array::from_fn(|k| {
                    (1..C).fold(S::square(numerators[0][r][k], weight), |sum, c| {
                        sum + S::square(numerators[c][r][k], weight)
                    })
                });
            }
        }
    }
}

/// Coefficients of a row of cells that are not 0, by level and lane.
fn count<N: Number, const C: usize>(numerators: &[[Lanes<N>; ROWS]; C]) -> [Lanes<u8>; 2] {
    let zero = N::default();
    let mut counts = [[0; LANES]; 2];
    for r in 0..ROWS {
        let counts = &mut counts[usize::from(r >= LEVEL_0)];
        for (k, count) in counts.iter_mut().enumerate() {
            *count += u8::from(numerators.iter().fold(zero, |all, of| all | of[r][k]) != zero);
        }
    }
    counts
}

/// Numerators of a row of cells from sums and differences along x; both by `y + 4·z`.
#[inline(always)]
fn transform<N: Number>(low: &[Lanes<N>; 16], high: &[Lanes<N>; 16], out: &mut [Lanes<N>; ROWS]) {
    let mut sums = [[N::default(); LANES]; 4];
    for (part, sum) in sums.iter_mut().enumerate() {
        let first = 2 * (part % 2) + 8 * (part / 2);
        let group = |from: &[Lanes<N>; 16]| across([from[first], from[first + 1], from[first + 4], from[first + 5]]);
        let ([total, low @ ..], high) = (group(low), group(high));
        *sum = total;
        let out = &mut out[LEVEL_0 + 7 * part..][..7];
        out[..3].copy_from_slice(&low);
        out[3..].copy_from_slice(&high);
    }
    // Pairs of groups along x, by cell.
    let pairs = |join: fn(N, N) -> N| sums.map(|s| std::array::from_fn::<N, 4, _>(|x| join(s[2 * x], s[2 * x + 1])));
    let (low, high) = (across(pairs(N::add)), across(pairs(N::sub)));
    for (r, [a, b]) in [[low[0], low[1]], [low[2], low[3]], [high[0], high[1]], [high[2], high[3]]].iter().enumerate() {
        out[r][..4].copy_from_slice(a);
        out[r][4..].copy_from_slice(b);
    }
}

/// Steps along y and z of four places `y + 2·z`: results by `2·hy + hz`.
#[inline(always)]
fn across<N: Number, const W: usize>([a, b, c, d]: [[N; W]; 4]) -> [[N; W]; 4] {
    let add = |a: [N; W], b: [N; W]| -> [N; W] { std::array::from_fn(|k| a[k] + b[k]) };
    let sub = |a: [N; W], b: [N; W]| -> [N; W] { std::array::from_fn(|k| a[k] - b[k]) };
    let (l0, h0, l1, h1) = (add(a, b), sub(a, b), add(c, d), sub(c, d));
    [add(l0, l1), sub(l0, l1), add(h0, h1), sub(h0, h1)]
}

#[cfg(test)]
mod tests;
