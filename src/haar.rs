//! Owns the Haar transform of a 4³ cell over two levels, in exact integers (zerobit paper §2.2, Fig. 2 to 4).
//!
//! # Order
//!
//! Samples of a cell lie x fastest, then y, then z: `x + 4·y + 16·z`. Its 64 coefficients are numbered by their
//! *position* `p = 7·i + j`:
//!
//! | p | what | numerator | true value |
//! |---|---|---|---|
//! | 0 | average of the cell | S2, sum of 64 samples | S2 / 64 |
//! | 1 to 7 | details j = 1 to 7 of level 0 | S2, ± sum of 64 samples | S2 / 64 |
//! | 7·i + j | details j = 1 to 7 of level 1 in part i = 1 to 8 | S1, ± sum of 8 samples | S1 / 8 |
//!
//! Part `i` is the 2³ voxels at (2x, 2y, 2z) with `i − 1 = 4·z + 2·y + x`. Detail `j = 4·hx + 2·hy + hz` is high where
//! a letter of the paper's name is h; the letters stand for x, y, z. See [`sign`].
//!
//! Level 0 is made of exact sums, never of rounded averages, so nothing is lost before [`quantised`].
//!
//! Samples of 16 bits fit with room: numerators stay within 64 · 65 535, sums of the inverse within eight times that.

use std::ops::{Add, Sub};

/// Voxels, and coefficients, of a cell.
pub const CELL: usize = 64;

/// Numerators of the 64 coefficients of a cell of single samples.
#[must_use]
pub fn forward(cell: &[i32; CELL]) -> [i32; CELL] {
    let mut t = *cell;
    for stride in [16, 4, 1] {
        pairs(&mut t, stride);
    }
    // Each 2³ group of `t` now holds its sum at its corner, and the details beside it.
    let mut out = [0; CELL];
    let mut sums = [0; 8];
    for part in 0..8 {
        let corner = corner(part);
        sums[part] = t[corner];
        for j in 1..8 {
            out[7 * part + 7 + j] = t[corner + (j >> 2) + 4 * (j >> 1 & 1) + 16 * (j & 1)];
        }
    }
    out[..8].copy_from_slice(&forward_group(sums));
    out
}

/// Numerators of the 64 coefficients of a cell of vectors, each component by itself.
#[must_use]
pub fn forward_components<const C: usize>(cell: &[[i32; C]; CELL]) -> [[i32; C]; CELL] {
    let mut out = [[0; C]; CELL];
    for from in (0..C).step_by(4) {
        let here = 4.min(C - from);
        let mut sums = [Lanes([0; 4]); 8];
        for part in 0..8 {
            let corner = corner(part);
            let group = forward_group(std::array::from_fn(|sub| {
                let v = &cell[corner + (sub & 1) + 4 * (sub >> 1 & 1) + 16 * (sub >> 2)];
                Lanes(std::array::from_fn(|k| if k < here { v[from + k] } else { 0 }))
            }));
            sums[part] = group[0];
            for j in 1..8 {
                out[7 * part + 7 + j][from..from + here].copy_from_slice(&group[j].0[..here]);
            }
        }
        for (out, sum) in out.iter_mut().zip(forward_group(sums)) {
            out[from..from + here].copy_from_slice(&sum.0[..here]);
        }
    }
    out
}

/// Four components, which one instruction adds.
#[derive(Clone, Copy)]
struct Lanes([i32; 4]);

impl Add for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn add(self, other: Lanes) -> Lanes {
        Lanes(std::array::from_fn(|k| self.0[k] + other.0[k]))
    }
}

impl Sub for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn sub(self, other: Lanes) -> Lanes {
        Lanes(std::array::from_fn(|k| self.0[k] - other.0[k]))
    }
}

/// Where the 2³ voxels of a part (counted from 0) begin.
const fn corner(part: usize) -> usize {
    2 * (part & 1) + 8 * (part >> 1 & 1) + 32 * (part >> 2)
}

/// Replaces each pair of neighbours along the axis of `stride` by its sum and its difference.
#[inline(always)]
fn pairs(t: &mut [i32; CELL], stride: usize) {
    for start in (0..CELL).step_by(2 * stride) {
        for at in start..start + stride {
            let (a, b) = (t[at], t[at + stride]);
            t[at] = a + b;
            t[at + stride] = a - b;
        }
    }
}

/// Sum (at 0) and details j = 1 to 7, not divided, of a 2³ group in the order `4·z + 2·y + x`.
#[inline(always)]
fn forward_group<T: Copy + Add<Output = T> + Sub<Output = T>>(v: [T; 8]) -> [T; 8] {
    let plane = |a: T, b: T, c: T, d: T| {
        let (l0, h0, l1, h1) = (a + b, a - b, c + d, c - d);
        [l0 + l1, l0 - l1, h0 + h1, h0 - h1]
    };
    let [near, far] = [plane(v[0], v[1], v[2], v[3]), plane(v[4], v[5], v[6], v[7])];
    std::array::from_fn(|j| if j & 1 == 0 { near[j >> 1] + far[j >> 1] } else { near[j >> 1] - far[j >> 1] })
}

/// The samples whose numerators [`forward`] gave, exactly.
///
/// Numerators that no cell has give samples rounded down; they must stay within 64 · 65 535.
#[must_use]
pub fn inverse(numerators: &[i32; CELL]) -> [i32; CELL] {
    // Eight times the sum of each part.
    let sums = inverse_group(std::array::from_fn(|j| numerators[j]));
    let mut cell = [0; CELL];
    for (part, sum) in sums.into_iter().enumerate() {
        let details = &numerators[7 * part + 7..];
        let samples = inverse_group(std::array::from_fn(|j| if j == 0 { sum >> 3 } else { details[j] }));
        let corner = corner(part);
        for (sub, sample) in samples.into_iter().enumerate() {
            cell[corner + (sub & 1) + 4 * (sub >> 1 & 1) + 16 * (sub >> 2)] = sample >> 3;
        }
    }
    cell
}

/// A 2³ group out of its average (at 0) and its details j = 1 to 7, in 24 additions and subtractions (§2.2).
///
/// The result is in the order `4·z + 2·y + x`. Sums are shared as in the paper: z is undone first, then y, then x.
#[inline]
#[must_use]
pub fn inverse_group<T: Copy + Add<Output = T> + Sub<Output = T>>(c: [T; 8]) -> [T; 8] {
    let [lll, llh, lhl, lhh, hll, hlh, hhl, hhh] = c;
    let half = |ll: T, lh: T, hl: T, hh: T| {
        let (l0, l1, h0, h1) = (ll + lh, ll - lh, hl + hh, hl - hh);
        [l0 + h0, l0 - h0, l1 + h1, l1 - h1]
    };
    let near = half(lll + llh, lhl + lhh, hll + hlh, hhl + hhh);
    let far = half(lll - llh, lhl - lhh, hll - hlh, hhl - hhh);
    let [[a, b, c, d], [e, f, g, h]] = [near, far];
    [a, b, c, d, e, f, g, h]
}

/// Sign, 1 or −1, of detail `j` (0: the average) at place `sub = 4·z + 2·y + x` of a 2³ group: −1 to the power of
/// `hx·x + hy·y + hz·z` (Fig. 2 and 3).
#[must_use]
pub const fn sign(j: usize, sub: usize) -> i32 {
    let (hx, hy, hz) = (j >> 2 & 1, j >> 1 & 1, j & 1);
    let (x, y, z) = (sub & 1, sub >> 1 & 1, sub >> 2 & 1);
    if (hx * x + hy * y + hz * z).is_multiple_of(2) { 1 } else { -1 }
}

/// `n / d` to the nearest whole number, halves up; `d` must be above 0.
#[must_use]
pub const fn rdiv(n: i64, d: i64) -> i64 {
    let rest = n.rem_euclid(d);
    n.div_euclid(d) + (rest >= d - rest) as i64
}

/// The coefficient at position `p` as a whole number, by [`rdiv`] with 64 or 8; not yet clamped to a range.
#[inline]
#[must_use]
pub const fn quantised(p: usize, numerator: i32) -> i32 {
    let shift = if p < 8 { 6 } else { 3 };
    (numerator + (1 << (shift - 1))) >> shift
}

#[cfg(test)]
mod tests;
