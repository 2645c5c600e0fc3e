//! Decoding `f32` with AVX2. Its scalar twin is `decode`.
//!
//! Up to 4 bits a block has at most 16 values: they are worked out once per block by the scalar formula, and a row picks
//! from these palettes with lane permutes. At 8 bits the formula itself is evaluated, in f64 and in the same order.
#![allow(unsafe_code, reason = "loads and stores of vectors, and calls of functions that need AVX2")]

use super::fast::{CHUNK, Kernel, Rows, STEP};
use super::fast_avx2::{Avx2, load, part, store};
use super::fast_tables::{BlockRow, Table};
use super::{Layout, Scalar};
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

    #[inline(always)]
    fn prepare(&mut self, layout: &Layout, payload: &[u8], x0: u32, voxels: usize, block_yz: [u32; 2]) -> bool {
        let blocks = BlockRow::new(layout, payload, x0, voxels, block_yz);
        self.edge = blocks.edge;
        let numbers = Table(std::array::from_fn(|b| b as u8));
        blocks.spread(&numbers, 1, &mut self.of);
        palettes::<I>(&blocks, &mut self.palettes)
    }

    #[inline(always)]
    fn rows(&self, rows: Rows<'_>) {
        let _ = self.token;
        // SAFETY: the token proves that the machine has AVX2.
        unsafe { self.rows_avx2(rows) }
    }
}

impl<const I: usize> FloatPalette<I> {
    #[target_feature(enable = "avx2")]
    fn rows_avx2(&self, rows: Rows<'_>) {
        match rows.stores {
            Stores::Cached => rows.for_each(|words, out| self.row::<false>(words, out)),
            Stores::Streaming => rows.for_each(|words, out| self.row::<true>(words, out)),
        }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn row<const STREAM: bool>(&self, words: &[u8], out: &mut [u8]) {
        let (whole, rest) = out.as_chunks_mut::<{ 4 * STEP }>();
        for (k, out) in whole.iter_mut().enumerate() {
            self.step::<STREAM>(&words[k * 4 * I..][..4 * I], k, out);
        }
        if !rest.is_empty() {
            let mut last = [0; STEP];
            let left = &words[whole.len() * 4 * I..];
            last[..left.len()].copy_from_slice(left);
            let mut buffer = [0; 4 * STEP];
            self.step::<false>(&last[..4 * I], whole.len(), &mut buffer);
            rest.copy_from_slice(&buffer[..rest.len()]);
        }
    }

    /// Voxels `32·k` to `32·k + 31` of the row.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn step<const STREAM: bool>(&self, words: &[u8], k: usize, out: &mut [u8; 4 * STEP]) {
        if self.edge % 4 != 0 {
            return self.step_any(words, k, out);
        }
        let of: &[u8; STEP] = part(&self.of.0, k);
        for (j, out) in out.as_chunks_mut::<32>().0.iter_mut().enumerate() {
            let bits = group::<I>(words, j);
            let shifts = _mm256_mullo_epi32(_mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7), _mm256_set1_epi32(I as i32));
            let idx = _mm256_srlv_epi32(_mm256_set1_epi32(bits), shifts); // the low I bits; what is above them differs
            let first = &self.palettes[usize::from(of[8 * j])];
            let v = if self.edge % 8 == 0 {
                pick::<I>(first, idx)
            } else {
                let second = &self.palettes[usize::from(of[8 * j + 4])];
                _mm256_blend_ps::<0xF0>(pick::<I>(first, idx), pick::<I>(second, idx))
            };
            store::<STREAM>(out, _mm256_castps_si256(v));
        }
    }

    /// Blocks of any edge, one lookup per voxel.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn step_any(&self, words: &[u8], k: usize, out: &mut [u8; 4 * STEP]) {
        let of: &[u8; STEP] = part(&self.of.0, k);
        let palettes: &[f32] = self.palettes.as_flattened();
        for (j, out) in out.as_chunks_mut::<32>().0.iter_mut().enumerate() {
            let bits = group::<I>(words, j).cast_unsigned();
            for (x, out) in out.as_chunks_mut::<4>().0.iter_mut().enumerate() {
                let idx = bits >> (x * I) & ((1 << I) - 1);
                *out = palettes[usize::from(of[8 * j + x]) * 16 + idx as usize].to_ne_bytes();
            }
        }
    }
}

/// The bits of 8 indices, lowest first.
#[inline(always)]
fn group<const I: usize>(words: &[u8], j: usize) -> i32 {
    match I {
        1 => i32::from(words[j]),
        2 => i32::from(u16::from_le_bytes(*part(words, j))),
        _ => i32::from_le_bytes(*part(words, j)),
    }
}

/// The palette's values at the low `I` bits of every lane.
#[inline]
#[target_feature(enable = "avx2")]
fn pick<const I: usize>(palette: &Palette, idx: __m256i) -> __m256 {
    let halves: &[[u8; 32]; 2] = bytemuck::cast_ref(palette);
    if I == 4 {
        // A permute looks at three bits; the fourth, moved to the sign, chooses the half.
        let low = _mm256_permutevar8x32_ps(_mm256_castsi256_ps(load(&halves[0])), idx);
        let high = _mm256_permutevar8x32_ps(_mm256_castsi256_ps(load(&halves[1])), idx);
        _mm256_blendv_ps(low, high, _mm256_castsi256_ps(_mm256_slli_epi32::<28>(idx)))
    } else {
        let idx = _mm256_and_si256(idx, _mm256_set1_epi32((1 << I) - 1));
        _mm256_permutevar8x32_ps(_mm256_castsi256_ps(load(&halves[0])), idx)
    }
}

/// Rows of `f32` with 8 index bits.
pub struct FloatBytes {
    min: Table<f64>,
    max: Table<f64>,
}

impl FloatBytes {
    /// Empty tables.
    pub fn new(_: Avx2) -> Self {
        FloatBytes { min: Table::default(), max: Table::default() }
    }
}

impl Kernel for FloatBytes {
    const BYTES: usize = 4;

    #[inline(always)]
    fn prepare(&mut self, layout: &Layout, payload: &[u8], x0: u32, voxels: usize, block_yz: [u32; 2]) -> bool {
        let blocks = BlockRow::new(layout, payload, x0, voxels, block_yz);
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

    /// Plain code: the compiler makes vectors of it, and never fuses multiplications with additions.
    #[inline(always)]
    fn rows(&self, rows: Rows<'_>) {
        rows.for_each(|words, out| {
            let ends = self.min.0.iter().zip(&self.max.0);
            for ((out, idx), (lo, hi)) in out.as_chunks_mut::<4>().0.iter_mut().zip(words).zip(ends) {
                let a = f64::from(*idx) / 255.0;
                *out = (((1.0 - a) * lo + a * hi) as f32).to_ne_bytes();
            }
        });
    }
}
