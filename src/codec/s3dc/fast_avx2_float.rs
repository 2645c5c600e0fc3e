//! Decoding `f32` with AVX2. Its scalar twin is `decode`.
//!
//! Up to 4 bits a block has at most 16 values: they are worked out once per block by the scalar formula, and a row picks
//! from these palettes with lane permutes. At 8 bits the formula itself is evaluated, in f64 and in the same order.
#![allow(unsafe_code, reason = "loads and stores of vectors, and calls of functions that need AVX2")]

use super::Scalar;
use super::fast::{CHUNK, Kernel};
use super::fast_avx2::{Avx2, Out, first, load};
use super::fast_rows::Rows;
use super::fast_tables::{BlockRow, Table};
use crate::codec::Stores;
use std::arch::x86_64::*;

/// End points as the formula needs them: `max = min` where the pair is out of order. `None` where one is not finite.
#[inline(always)]
pub fn orderly(min: f32, max: f32) -> Option<(f64, f64)> {
    if !(min.is_finite() && max.is_finite()) {
        return None;
    }
    let (lo, hi) = (f64::from(min.stored()), f64::from(max.stored()));
    Some((lo, if hi > lo { hi } else { lo }))
}

/// The values of the indices of one block; unused entries are 0.
pub type Palette = [f32; 16];

/// Palettes of a row of blocks. The formula needs no special case: see V25 in the tests, and `orderly`.
#[inline(always)]
pub fn palettes<const I: usize>(blocks: &BlockRow<'_>, out: &mut [Palette; CHUNK]) -> bool {
    let q = ((1 << I) - 1) as f64;
    let a: [f64; 16] = std::array::from_fn(|idx| if idx < 1 << I { idx as f64 / q } else { 0.0 });
    let mut fine = true;
    blocks.for_each::<f32>(|b, min, max| {
        let (lo, hi) = orderly(min, max).unwrap_or_else(|| {
            fine = false;
            (0.0, 0.0)
        });
        for (value, a) in out[b][..1 << I].iter_mut().zip(a) {
            *value = ((1.0 - a) * lo + a * hi) as f32;
        }
    });
    fine
}

/// The numbers of the blocks of a row.
pub static NUMBERS: Table<u8> = Table({
    let (mut numbers, mut b) = ([0; CHUNK], 0);
    while b < CHUNK {
        numbers[b] = b as u8;
        b += 1;
    }
    numbers
});

/// Rows of `f32` with up to 4 index bits.
pub struct FloatPalette<const I: usize> {
    token: Avx2,
    palettes: Box<[Palette; CHUNK]>,
    /// Number of the palette of every voxel.
    of: Table<u8>,
    /// Block edge along x.
    edge: usize,
}

impl<const I: usize> FloatPalette<I> {
    /// Empty tables.
    pub fn new(token: Avx2) -> Self {
        FloatPalette { token, palettes: Box::new([[0.0; 16]; CHUNK]), of: Table::default(), edge: 0 }
    }
}

impl<const I: usize> Kernel for FloatPalette<I> {
    const BYTES: usize = 4;
    const I: usize = I;

    fn prepare(&mut self, blocks: &BlockRow<'_>) -> bool {
        // SAFETY: the token proves that the machine has AVX2.
        unsafe { self.prepare_avx2(blocks) }
    }

    fn rows(&self, rows: Rows<'_>, stores: Stores) {
        // SAFETY: the token proves that the machine has AVX2.
        unsafe { self.rows_avx2(rows, stores) }
    }
}

impl<const I: usize> FloatPalette<I> {
    #[target_feature(enable = "avx2")]
    fn prepare_avx2(&mut self, blocks: &BlockRow<'_>) -> bool {
        self.edge = blocks.edge;
        blocks.spread(&NUMBERS, 1, &mut self.of);
        palettes::<I>(blocks, &mut self.palettes)
    }

    #[target_feature(enable = "avx2")]
    fn rows_avx2(&self, rows: Rows<'_>, stores: Stores) {
        let (t, of, palettes) = (self.token, self.of.0.as_chunks::<8>().0, &self.palettes);
        let eights = rows.words_len() / I;
        if self.edge % 8 == 0 {
            for (words, out) in rows {
                let mut out = Out::new(out, stores);
                for k in 0..eights {
                    let palette = &palettes[usize::from(of[k][0])];
                    out.put(t, k, pick::<I>(t, palette, lanes::<I>(t, words, k)));
                }
            }
        } else if self.edge == 4 {
            let palettes = palettes.as_chunks::<2>().0;
            for (words, out) in rows {
                let mut out = Out::new(out, stores);
                for (k, [left, right]) in palettes.iter().enumerate().take(eights) {
                    let idx = lanes::<I>(t, words, k);
                    let v = _mm256_blend_epi32::<0xF0>(pick::<I>(t, left, idx), pick::<I>(t, right, idx));
                    out.put(t, k, v);
                }
            }
        } else {
            // Blocks of any edge, one lookup per voxel.
            for (words, out) in rows {
                for (k, (out, of)) in out.as_chunks_mut::<32>().0.iter_mut().zip(of).enumerate() {
                    let mut bits = group::<I>(words, k);
                    for (out, of) in out.as_chunks_mut::<4>().0.iter_mut().zip(of) {
                        *out = palettes[usize::from(*of)][(bits & ((1 << I) - 1)) as usize].to_ne_bytes();
                        bits >>= I;
                    }
                }
            }
        }
    }
}

/// The bits of the `k`-th eight indices, lowest first.
#[inline(always)]
fn group<const I: usize>(words: &[u8], k: usize) -> u32 {
    match I {
        1 => u32::from(words[k]),
        2 => u32::from(u16::from_le_bytes(*first(&words[2 * k..]))),
        _ => u32::from_le_bytes(*first(&words[4 * k..])),
    }
}

/// The `k`-th eight indices in the low `I` bits of 32-bit lanes, with other bits above them.
#[inline(always)]
fn lanes<const I: usize>(_: Avx2, words: &[u8], k: usize) -> __m256i {
    let i = I as i32;
    // SAFETY: the token proves AVX2.
    unsafe {
        let shifts = _mm256_setr_epi32(0, i, 2 * i, 3 * i, 4 * i, 5 * i, 6 * i, 7 * i);
        _mm256_srlv_epi32(_mm256_set1_epi32(group::<I>(words, k).cast_signed()), shifts)
    }
}

/// The palette's values at the low `I` bits of every lane.
#[inline(always)]
fn pick<const I: usize>(token: Avx2, palette: &Palette, idx: __m256i) -> __m256i {
    let [low, high]: &[[u8; 32]; 2] = bytemuck::cast_ref(palette);
    // SAFETY: the token proves AVX2.
    unsafe {
        if I == 4 {
            // A permute looks at three bits; the fourth, moved to the sign, chooses the half.
            let low = _mm256_permutevar8x32_epi32(load(token, low), idx);
            let high = _mm256_permutevar8x32_epi32(load(token, high), idx);
            let sign = _mm256_castsi256_ps(_mm256_slli_epi32::<28>(idx));
            let v = _mm256_blendv_ps(_mm256_castsi256_ps(low), _mm256_castsi256_ps(high), sign);
            _mm256_castps_si256(v)
        } else {
            let idx = _mm256_and_si256(idx, _mm256_set1_epi32((1 << I) - 1));
            _mm256_permutevar8x32_epi32(load(token, low), idx)
        }
    }
}

/// Rows of `f32` with 8 index bits.
pub struct FloatBytes {
    _token: Avx2,
    min: Table<f64>,
    max: Table<f64>,
}

impl FloatBytes {
    /// Empty tables.
    pub fn new(token: Avx2) -> Self {
        FloatBytes { _token: token, min: Table::default(), max: Table::default() }
    }
}

impl Kernel for FloatBytes {
    const BYTES: usize = 4;
    const I: usize = 8;

    fn prepare(&mut self, blocks: &BlockRow<'_>) -> bool {
        let (mut min, mut max) = (Table([0f64; CHUNK]), Table([0f64; CHUNK]));
        let mut fine = true;
        blocks.for_each::<f32>(|b, lo, hi| {
            let pair = orderly(lo, hi);
            fine &= pair.is_some();
            (min.0[b], max.0[b]) = pair.unwrap_or_default();
        });
        blocks.spread(&min, 1, &mut self.min);
        blocks.spread(&max, 1, &mut self.max);
        fine
    }

    fn rows(&self, rows: Rows<'_>, _: Stores) {
        // SAFETY: the token proves that the machine has AVX2.
        unsafe { self.rows_avx2(rows) }
    }
}

impl FloatBytes {
    /// Plain code: the compiler makes vectors of it, and never fuses multiplications with additions.
    #[target_feature(enable = "avx2")]
    fn rows_avx2(&self, rows: Rows<'_>) {
        for (words, out) in rows {
            let ends = self.min.0.iter().zip(&self.max.0);
            for ((out, idx), (lo, hi)) in out.as_chunks_mut::<4>().0.iter_mut().zip(words).zip(ends) {
                let a = f64::from(*idx) / 255.0;
                *out = (((1.0 - a) * lo + a * hi) as f32).to_ne_bytes();
            }
        }
    }
}
