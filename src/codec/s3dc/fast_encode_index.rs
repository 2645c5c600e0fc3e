//! From samples to indices, per sample type: what `fast_encode` computes instead of the divisions of `scalar`.
//!
//! * `u8`, q ≤ 15: index = n / 2R with n = 2dq + R. With s = floor(65535 / (R(2q+1))), n·s fits 16 bits, and
//!   `n·s·ceil(2^27 / 2Rs) >> 27` is too large by less than n·s/2^27 < 2^-11, but n / 2R is 1/2R ≥ 1/510 below the next
//!   integer. Tested for every d and R.
//! * other integers: d·(q/R) + ½ + 2^-18 in floating point: integers or 1/2R > 2^-17 below one, and all roundings together
//!   stay below 2^-18 (f32 for q ≤ 15, where values stay below 16; f64 for q = 255).
//! * `f32`: the expression of `scalar`, to the letter.
#![allow(unsafe_code, reason = "conversions of numbers whose range is known")]

use super::fitted::Fit;

/// A sample type that is encoded by rows.
pub trait Kernel: Fit {
    /// No sample is below.
    const LOWEST: Self;
    /// No sample is above.
    const HIGHEST: Self;
    /// What turns samples into indices, by column.
    type Table;
    /// A table of that many columns.
    fn table(columns: usize) -> Self::Table;
    /// Sets `width` columns from `at` to the end points of a block.
    fn spread(table: &mut Self::Table, at: usize, width: usize, pair: (Self, Self), q: u32);
    /// Indices of a row.
    fn indices(table: &Self::Table, row: &[Self], out: &mut [u8], q: u32);
    /// Whether no sample is NaN or infinite.
    fn all_storable(row: &[Self]) -> bool;
    /// Little-endian bytes into `to`.
    fn write_le(self, to: &mut [u8]);
}

/// Floor of a number in 0..=256.
///
/// # Safety
/// `t` is finite and fits an i32.
#[inline(always)]
unsafe fn floor32(t: f32) -> u8 {
    // SAFETY: the caller's promise.
    unsafe { t.to_int_unchecked::<i32>() as u8 }
}

/// Floor of a number in 0..=256.
///
/// # Safety
/// `t` is finite and fits an i32.
#[inline(always)]
unsafe fn floor64(t: f64) -> i32 {
    // SAFETY: the caller's promise.
    unsafe { t.to_int_unchecked::<i32>() }
}

/// Columns of origin and factors: index = (sample − origin) · factor + ….
pub struct Scaled {
    low: Vec<f32>,
    high: Vec<f32>,
    scale32: Vec<f32>,
    scale: Vec<f64>,
}

impl Scaled {
    fn new(n: usize) -> Scaled {
        Scaled { low: vec![0.0; n], high: vec![0.0; n], scale32: vec![0.0; n], scale: vec![0.0; n] }
    }

    #[inline(always)]
    fn spread(&mut self, at: usize, width: usize, (low, high): (f32, f32), scale: f64) {
        self.low[at..at + width].fill(low);
        self.high[at..at + width].fill(high);
        self.scale32[at..at + width].fill(scale as f32);
        self.scale[at..at + width].fill(scale);
    }
}

/// 2^-18.
const TIE: f64 = 1.0 / 262_144.0;

/// Integers of up to 16 bits: exact in f32. Clamping keeps samples outside fitted end points in range.
#[inline(always)]
fn integer_indices<T: Copy + Into<f32>>(table: &Scaled, row: &[T], out: &mut [u8], q: u32) {
    let limits = table.low.iter().zip(&table.high);
    if q <= 15 {
        for ((to, &v), ((&low, &high), &scale)) in out.iter_mut().zip(row).zip(limits.zip(&table.scale32)) {
            let v: f32 = v.into();
            let v = if v < low { low } else { v };
            let v = if v > high { high } else { v };
            // SAFETY: low ≤ v ≤ high are finite, so that the number is at most q + 0.5 and the roundings.
            *to = unsafe { floor32((v - low) * scale + (0.5 + TIE as f32)) };
        }
    } else {
        for ((to, &v), ((&low, &high), &scale)) in out.iter_mut().zip(row).zip(limits.zip(&table.scale)) {
            let v: f32 = v.into();
            let v = if v < low { low } else { v };
            let v = if v > high { high } else { v };
            // SAFETY: as above.
            *to = unsafe { floor64(f64::from(v - low) * scale + (0.5 + TIE)) } as u8;
        }
    }
}

macro_rules! words {
    ($($t:ty),*) => {$(
        impl Kernel for $t {
            const LOWEST: Self = <$t>::MIN;
            const HIGHEST: Self = <$t>::MAX;
            type Table = Scaled;
            fn table(columns: usize) -> Scaled {
                Scaled::new(columns)
            }
            #[inline(always)]
            fn spread(table: &mut Scaled, at: usize, width: usize, (min, max): (Self, Self), q: u32) {
                let (low, high) = (f32::from(min), f32::from(max));
                let scale = if max > min { f64::from(q) / f64::from(high - low) } else { 0.0 };
                table.spread(at, width, (low, high), scale);
            }
            #[inline(always)]
            fn indices(table: &Scaled, row: &[Self], out: &mut [u8], q: u32) {
                integer_indices(table, row, out, q);
            }
            #[inline(always)]
            fn all_storable(_: &[Self]) -> bool {
                true
            }
            #[inline(always)]
            fn write_le(self, to: &mut [u8]) {
                to.copy_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}
words!(u16, i16);

/// Columns for bytes.
pub struct ByteTable {
    low: Vec<u8>,
    high: Vec<u8>,
    /// 2qs.
    factor: Vec<u16>,
    /// Rs.
    half: Vec<u16>,
    /// ceil(2^27 / 2Rs), 0 for R = 0.
    inverse: Vec<u16>,
    scaled: Scaled,
    of_range: Vec<[u16; 3]>,
}

fn of_range(range: u32, q: u32) -> [u16; 3] {
    if range == 0 {
        return [0; 3];
    }
    let s = 65_535 / (range * (2 * q + 1));
    [2 * q * s, range * s, (1u32 << 27).div_ceil(2 * range * s)].map(|v| v as u16)
}

impl Kernel for u8 {
    const LOWEST: Self = 0;
    const HIGHEST: Self = 255;
    type Table = ByteTable;
    fn table(n: usize) -> ByteTable {
        ByteTable {
            low: vec![0; n],
            high: vec![0; n],
            factor: vec![0; n],
            half: vec![0; n],
            inverse: vec![0; n],
            scaled: Scaled::new(n),
            of_range: Vec::new(),
        }
    }
    #[inline(always)]
    fn spread(table: &mut ByteTable, at: usize, width: usize, (min, max): (Self, Self), q: u32) {
        if q > 15 {
            let scale = if max > min { f64::from(q) / f64::from(max - min) } else { 0.0 };
            return table.scaled.spread(at, width, (f32::from(min), f32::from(max)), scale);
        }
        if table.of_range.is_empty() {
            table.of_range = (0..256).map(|range| of_range(range, q)).collect();
        }
        let [factor, half, inverse] = table.of_range[usize::from(max.saturating_sub(min))];
        table.low[at..at + width].fill(min);
        table.high[at..at + width].fill(max);
        table.factor[at..at + width].fill(factor);
        table.half[at..at + width].fill(half);
        table.inverse[at..at + width].fill(inverse);
    }
    #[inline(always)]
    fn indices(table: &ByteTable, row: &[u8], out: &mut [u8], q: u32) {
        if q > 15 {
            return integer_indices(&table.scaled, row, out, q);
        }
        let limits = table.low.iter().zip(&table.high);
        let factors = table.factor.iter().zip(&table.half).zip(&table.inverse);
        for (((to, &v), (&low, &high)), ((&factor, &half), &inverse)) in
            out.iter_mut().zip(row).zip(limits).zip(factors)
        {
            let d = v.min(high).saturating_sub(low);
            let n = u16::from(d).wrapping_mul(factor).wrapping_add(half);
            *to = (((u32::from(n) * u32::from(inverse)) >> 16) as u16 >> 11) as u8;
        }
    }
    #[inline(always)]
    fn all_storable(_: &[u8]) -> bool {
        true
    }
    #[inline(always)]
    fn write_le(self, to: &mut [u8]) {
        to[0] = self;
    }
}

impl Kernel for f32 {
    const LOWEST: Self = f32::NEG_INFINITY;
    const HIGHEST: Self = f32::INFINITY;
    type Table = Scaled;
    fn table(columns: usize) -> Scaled {
        Scaled::new(columns)
    }
    #[inline(always)]
    fn spread(table: &mut Scaled, at: usize, width: usize, (min, max): (Self, Self), q: u32) {
        let range = f64::from(max) - f64::from(min);
        table.spread(at, width, (min, max), if range > 0.0 { f64::from(q) / range } else { 0.0 });
    }
    // spec: S3D-21. Samples are finite and clamped, so that the sum lies in ½..=q + ½ but for roundings.
    #[inline(always)]
    fn indices(table: &Scaled, row: &[f32], out: &mut [u8], q: u32) {
        let limits = table.low.iter().zip(&table.high);
        for ((to, &v), ((&low, &high), &scale)) in out.iter_mut().zip(row).zip(limits.zip(&table.scale)) {
            let v = if v < low { low } else { v };
            let v = if v > high { high } else { v };
            // SAFETY: samples were found finite and are clamped to finite end points: the number is below q + 1.
            *to = unsafe { floor64((f64::from(v) - f64::from(low)) * scale + 0.5) }.min(q.cast_signed()) as u8;
        }
    }
    #[inline(always)]
    fn all_storable(row: &[f32]) -> bool {
        const EXPONENT: u32 = 0x7f80_0000;
        row.iter().fold(true, |ok, v| ok & (v.to_bits() & EXPONENT != EXPONENT))
    }
    #[inline(always)]
    fn write_le(self, to: &mut [u8]) {
        to.copy_from_slice(&self.to_le_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn agrees<T: Kernel>(min: T, max: T, row: &[T]) {
        for q in [1, 3, 15, 255] {
            let mut table = T::table(row.len());
            T::spread(&mut table, 0, row.len(), (min, max), q);
            let mut out = vec![0; row.len()];
            T::indices(&table, row, &mut out, q);
            for (&v, &index) in row.iter().zip(&out) {
                assert_eq!(u32::from(index), v.index(min, max, q), "{v:?} in {min:?}..={max:?}, q {q}");
            }
        }
    }

    #[test] // every range and every sample, also those outside the end points; spec: S3D-20
    fn bytes_take_the_exact_index() {
        let all: Vec<u8> = (0..=255).collect();
        for range in 0..=255u8 {
            agrees(0, range, &all);
            agrees(255 - range, 255, &all);
            agrees((255 - range) / 2, (255 - range) / 2 + range, &all);
        }
    }

    #[test] // spec: S3D-20
    fn words_take_the_exact_index() {
        let all: Vec<u16> = (0..=u16::MAX).collect();
        for range in (0..=u16::MAX).step_by(251).chain([1, 2, 3, 32_767, 32_768, 65_533, 65_534]) {
            agrees(0, range, &all);
        }
        agrees(i16::MIN, i16::MAX, &(i16::MIN..=i16::MAX).collect::<Vec<_>>());
    }

    #[test] // spec: S3D-21
    fn floats_take_the_exact_index() {
        for (lo, hi) in [(-1.0, 2.0), (0.0, 15.0), (f32::MIN, f32::MAX), (1.0, 1.000_000_2), (0.0, 1e-45), (3.0, 3.0)] {
            let wide = f64::from(hi) - f64::from(lo);
            let row: Vec<f32> = (0..=30_000).map(|k| (f64::from(lo) + wide * f64::from(k) / 30_000.0) as f32).collect();
            agrees(lo, hi, &row);
        }
    }
}
