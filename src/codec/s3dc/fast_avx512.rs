//! Decoding at 4 index bits (floats: up to 4) with AVX-512: whole cache lines at a time. Scalar twin: `decode`.
//!
//! The arithmetic and the tables are those of `fast_avx2`, twice as wide. Floats pick from a palette of 16 values, which
//! is one register here and one permute per block.
#![allow(unsafe_code, reason = "loads and stores of vectors, and calls of functions that need AVX-512")]

use super::Scalar;
use super::fast::{CHUNK, Job, Kernel, Piece, STEP, drive};
use super::fast_avx2::{self, Avx2, Bytes, Words};
use super::fast_avx2_float::{NUMBERS, Palette, orderly};
use super::fast_rows::Rows;
use super::fast_tables::{BlockRow, Table};
use crate::codec::Stores;
use crate::voxel::SampleType;
use std::arch::x86_64::*;

/// Proof that this machine has AVX-512 F, BW, VL and VBMI.
#[derive(Clone, Copy)]
pub struct Avx512(Avx2);

impl Avx512 {
    /// The proof, if there is one.
    pub fn detect() -> Option<Avx512> {
        let has = std::arch::is_x86_feature_detected!("avx512f")
            && std::arch::is_x86_feature_detected!("avx512bw")
            && std::arch::is_x86_feature_detected!("avx512vl")
            && std::arch::is_x86_feature_detected!("avx512vbmi");
        if has { Avx2::detect().map(Avx512) } else { None }
    }
}

/// Decodes a job with AVX-512, and with AVX2 what gains nothing from it.
pub fn decode(token: Avx512, job: Job<'_>) {
    let streamed = job.stores == Stores::Streaming;
    let Some(Piece { layout, .. }) = job.pieces.first() else { return };
    match (layout.sample_type(), layout.params().i_bits()) {
        (SampleType::U8, 4) => drive(|| Wide(Bytes::<4>::new(token.0), token), job),
        (SampleType::U16, 4) => drive(|| Wide(Words::<u16, 4>::new(token.0), token), job),
        (SampleType::I16, 4) => drive(|| Wide(Words::<i16, 4>::new(token.0), token), job),
        (SampleType::F32, 1) => drive(|| Floats::<1>::new(token), job),
        (SampleType::F32, 2) => drive(|| Floats::<2>::new(token), job),
        (SampleType::F32, 4) => drive(|| Floats::<4>::new(token), job),
        _ => return fast_avx2::decode(token.0, job),
    }
    if streamed {
        // Streaming stores become visible in order with what follows.
        // SAFETY: the token proves AVX-512, and every machine with it has SSE.
        unsafe { _mm_sfence() }
    }
}

/// A row of a destination that takes 64 bytes at a time, and a part of them at its end.
struct Out<'a> {
    row: &'a mut [u8],
    stream: bool,
}

impl<'a> Out<'a> {
    /// The row; stored around the caches where `stores` says so and it lies on a multiple of 64.
    #[inline(always)]
    fn new(row: &'a mut [u8], stores: Stores) -> Self {
        let stream = stores == Stores::Streaming && row.as_ptr().addr() % 64 == 0;
        Out { row, stream }
    }

    /// Stores the `k`-th 64 bytes, or as many of them as the row has.
    #[inline(always)]
    fn put(&mut self, _: Avx512, k: usize, v: __m512i) {
        let Some(rest) = self.row.get_mut(64 * k..) else { return };
        match rest.first_chunk_mut::<64>() {
            // SAFETY: the token proves AVX-512; the reference covers 64 writable bytes, a multiple of 64 from the start
            // of the row, which lies on a multiple of 64.
            Some(line) if self.stream => unsafe { _mm512_stream_si512(line.as_mut_ptr().cast(), v) },
            // SAFETY: the token proves AVX-512; the reference covers 64 writable bytes; no alignment is needed.
            Some(line) => unsafe { _mm512_storeu_si512(line.as_mut_ptr().cast(), v) },
            // SAFETY: the token proves AVX-512 with BW; the mask selects the bytes that the slice has.
            None => unsafe { _mm512_mask_storeu_epi8(rest.as_mut_ptr().cast(), (1 << rest.len()) - 1, v) },
        }
    }
}

/// Loads 64 bytes of a table.
#[inline(always)]
fn load<V: bytemuck::Pod, const N: usize>(_: Avx512, part: &[V; N]) -> __m512i {
    const { assert!(size_of::<V>() * N == 64, "a table is read by cache lines") };
    // SAFETY: the token proves AVX-512; the reference covers 64 readable bytes; no alignment is needed.
    unsafe { _mm512_loadu_si512(part.as_ptr().cast()) }
}

/// Integers, with the tables of the AVX2 kernel `K`.
struct Wide<K>(K, Avx512);

impl Kernel for Wide<Bytes<4>> {
    const BYTES: usize = 1;
    const I: usize = 4;

    fn prepare(&mut self, blocks: &BlockRow<'_>) -> bool {
        self.0.prepare(blocks)
    }

    fn rows(&self, rows: Rows<'_>, stores: Stores) {
        // SAFETY: the token proves that the machine has AVX-512.
        unsafe { self.rows_avx512(rows, stores) }
    }
}

impl Wide<Bytes<4>> {
    #[target_feature(enable = "avx512f,avx512bw,avx512vl")]
    fn rows_avx512(&self, rows: Rows<'_>, stores: Stores) {
        let (min, even, odd) = self.0.tables();
        let (min, even, odd) = (min.as_chunks::<64>().0, even.as_chunks::<32>().0, odd.as_chunks::<32>().0);
        let t = self.1;
        if rows.words_len() == 32 {
            // The usual brick has 64 voxels in a row: what belongs to its blocks stays in registers.
            let tables = (load(t, &min[0]), load(t, &even[0]), load(t, &odd[0]));
            for (words, out) in rows {
                Out::new(out, stores).put(t, 0, Self::step(t, words, tables.0, tables.1, tables.2));
            }
        } else {
            for (words, out) in rows {
                let mut out = Out::new(out, stores);
                for (k, words) in words.chunks(32).enumerate() {
                    let tables = (load(t, &min[k]), load(t, &even[k]), load(t, &odd[k]));
                    out.put(t, k, Self::step(t, words, tables.0, tables.1, tables.2));
                }
            }
        }
    }

    /// 64 voxels; 32 where there are no more words.
    #[inline(always)]
    fn step(_: Avx512, words: &[u8], min: __m512i, even: __m512i, odd: __m512i) -> __m512i {
        let b = match (words.first_chunk::<32>(), words.first_chunk::<16>()) {
            // SAFETY: the token proves AVX-512 with BW; the reference covers 32 readable bytes.
            (Some(words), _) => unsafe { _mm512_cvtepu8_epi16(_mm256_loadu_si256(words.as_ptr().cast())) },
            // SAFETY: as above, 16 bytes.
            (None, Some(words)) => unsafe {
                _mm512_castsi256_si512(_mm256_cvtepu8_epi16(_mm_loadu_si128(words.as_ptr().cast())))
            },
            (None, None) => return min,
        };
        // SAFETY: the token proves AVX-512 with BW.
        unsafe {
            let low = _mm512_set1_epi16(15 << 5);
            let e = _mm512_mulhrs_epi16(_mm512_and_si512(_mm512_slli_epi16::<5>(b), low), even);
            let o = _mm512_mulhrs_epi16(_mm512_and_si512(_mm512_slli_epi16::<1>(b), low), odd);
            _mm512_add_epi8(min, _mm512_or_si512(e, _mm512_slli_epi16::<8>(o)))
        }
    }
}

impl<T: Scalar + Into<i32>> Kernel for Wide<Words<T, 4>> {
    const BYTES: usize = 2;
    const I: usize = 4;

    fn prepare(&mut self, blocks: &BlockRow<'_>) -> bool {
        self.0.prepare(blocks)
    }

    fn rows(&self, rows: Rows<'_>, stores: Stores) {
        // SAFETY: the token proves that the machine has AVX-512.
        unsafe { self.rows_avx512(rows, stores) }
    }
}

impl<T: Scalar + Into<i32>> Wide<Words<T, 4>> {
    #[target_feature(enable = "avx512f,avx512bw,avx512vl")]
    fn rows_avx512(&self, rows: Rows<'_>, stores: Stores) {
        let (min, whole, part) = self.0.tables();
        let (min, whole, part) = (min.as_chunks::<32>().0, whole.as_chunks::<32>().0, part.as_chunks::<32>().0);
        let t = self.1;
        for (words, out) in rows {
            let mut out = Out::new(out, stores);
            for (k, words) in words.as_chunks::<16>().0.iter().enumerate() {
                // SAFETY: the reference covers 16 readable bytes; no alignment is needed.
                let b = _mm256_cvtepu8_epi16(unsafe { _mm_loadu_si128(words.as_ptr().cast()) });
                let idx = _mm256_and_si256(_mm256_or_si256(b, _mm256_slli_epi16::<4>(b)), _mm256_set1_epi8(15));
                let idx = _mm512_cvtepu8_epi16(idx);
                let v = _mm512_add_epi16(load(t, &min[k]), _mm512_mullo_epi16(load(t, &whole[k]), idx));
                let n = _mm512_add_epi16(_mm512_mullo_epi16(load(t, &part[k]), idx), _mm512_set1_epi16(7));
                out.put(t, k, _mm512_add_epi16(v, _mm512_mulhi_epu16(n, _mm512_set1_epi16(4370))));
            }
        }
    }
}

/// Rows of `f32` with up to 4 index bits.
struct Floats<const I: usize> {
    token: Avx512,
    palettes: Box<[Palette; CHUNK]>,
    /// Number of the palette of every voxel.
    of: Table<u8>,
    /// Block edge along x.
    edge: usize,
}

impl<const I: usize> Floats<I> {
    fn new(token: Avx512) -> Self {
        Floats { token, palettes: Box::new([[0.0; 16]; CHUNK]), of: Table::default(), edge: 0 }
    }
}

impl<const I: usize> Kernel for Floats<I> {
    const BYTES: usize = 4;
    const I: usize = I;

    fn prepare(&mut self, blocks: &BlockRow<'_>) -> bool {
        // SAFETY: the token proves that the machine has AVX-512.
        unsafe { self.prepare_avx512(blocks) }
    }

    fn rows(&self, rows: Rows<'_>, stores: Stores) {
        // SAFETY: the token proves that the machine has AVX-512.
        unsafe { self.rows_avx512(rows, stores) }
    }
}

impl<const I: usize> Floats<I> {
    /// The palettes, by the formula as it is written: products, sum, one rounding.
    #[target_feature(enable = "avx512f,avx512bw,avx512vl")]
    fn prepare_avx512(&mut self, blocks: &BlockRow<'_>) -> bool {
        self.edge = blocks.edge;
        blocks.spread(&NUMBERS, 1, &mut self.of);
        let q = _mm512_set1_pd(((1 << I) - 1) as f64);
        let low = _mm512_setr_pd(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0);
        let a = [_mm512_div_pd(low, q), _mm512_div_pd(_mm512_add_pd(low, _mm512_set1_pd(8.0)), q)];
        let one = _mm512_set1_pd(1.0);
        let b = [_mm512_sub_pd(one, a[0]), _mm512_sub_pd(one, a[1])];
        let mut fine = true;
        for (pair, palette) in blocks.pairs.as_chunks::<8>().0.iter().zip(self.palettes.iter_mut()) {
            let Some((lo, hi)) = orderly(f32::from_le(pair), f32::from_le(&pair[4..])) else {
                fine = false;
                continue;
            };
            let (lo, hi) = (_mm512_set1_pd(lo), _mm512_set1_pd(hi));
            for (k, half) in palette.as_chunks_mut::<8>().0.iter_mut().enumerate().take(if I == 4 { 2 } else { 1 }) {
                let v = _mm512_cvtpd_ps(_mm512_add_pd(_mm512_mul_pd(b[k], lo), _mm512_mul_pd(a[k], hi)));
                // SAFETY: the reference covers 32 writable bytes; no alignment is needed.
                unsafe { _mm256_storeu_ps(half.as_mut_ptr(), v) }
            }
        }
        fine
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi")]
    fn rows_avx512(&self, rows: Rows<'_>, stores: Stores) {
        let (t, of) = (self.token, self.of.0.as_chunks::<16>().0);
        if self.edge == 4 {
            let palettes = self.palettes.as_chunks::<4>().0;
            for (words, out) in rows {
                let mut out = Out::new(out, stores);
                for ((k, words), [p0, p1, p2, p3]) in words.chunks_exact(2 * I).enumerate().zip(palettes) {
                    let idx = lanes::<I>(t, words);
                    let v = _mm512_permutexvar_epi32(idx, load(t, p0));
                    let v = _mm512_mask_permutexvar_epi32(v, 0x00F0, idx, load(t, p1));
                    let v = _mm512_mask_permutexvar_epi32(v, 0x0F00, idx, load(t, p2));
                    out.put(t, k, _mm512_mask_permutexvar_epi32(v, 0xF000, idx, load(t, p3)));
                }
            }
        } else if self.edge == 8 {
            let palettes = self.palettes.as_chunks::<2>().0;
            for (words, out) in rows {
                let mut out = Out::new(out, stores);
                for ((k, words), [p0, p1]) in words.chunks_exact(2 * I).enumerate().zip(palettes) {
                    let idx = lanes::<I>(t, words);
                    let v = _mm512_permutexvar_epi32(idx, load(t, p0));
                    out.put(t, k, _mm512_mask_permutexvar_epi32(v, 0xFF00, idx, load(t, p1)));
                }
            }
        } else if self.edge % 16 == 0 {
            for (words, out) in rows {
                let mut out = Out::new(out, stores);
                for ((k, words), of) in words.chunks_exact(2 * I).enumerate().zip(of) {
                    let palette = load(t, &self.palettes[usize::from(of[0])]);
                    out.put(t, k, _mm512_permutexvar_epi32(lanes::<I>(t, words), palette));
                }
            }
        } else {
            // Blocks of any edge, one lookup per voxel.
            for (words, out) in rows {
                let sixteens = words.chunks_exact(2 * I).zip(out.as_chunks_mut::<64>().0);
                for ((words, out), of) in sixteens.zip(of) {
                    let mut bits = group::<I>(words);
                    for (out, of) in out.as_chunks_mut::<4>().0.iter_mut().zip(of) {
                        *out = self.palettes[usize::from(*of)][(bits & ((1 << I) - 1)) as usize].to_ne_bytes();
                        bits >>= I;
                    }
                }
            }
        }
        const { assert!(STEP % 16 == 0, "a row is a number of sixteens") };
    }
}

/// The bits of sixteen indices, lowest first.
#[inline(always)]
fn group<const I: usize>(words: &[u8]) -> u64 {
    let mut bits = [0; 8];
    bits[..2 * I].copy_from_slice(&words[..2 * I]);
    u64::from_le_bytes(bits)
}

/// Sixteen indices in 32-bit lanes; at 4 bits with other bits above the fourth, which permutes ignore.
#[inline(always)]
fn lanes<const I: usize>(_: Avx512, words: &[u8]) -> __m512i {
    let bits = group::<I>(words).cast_signed();
    let offset = |lane: usize| ((2 * lane * I) as i64) | (((2 * lane + 1) * I) as i64) << 32;
    // SAFETY: the token proves AVX-512 with VBMI.
    unsafe {
        let offsets =
            _mm512_setr_epi64(offset(0), offset(1), offset(2), offset(3), offset(4), offset(5), offset(6), offset(7));
        let idx = _mm512_multishift_epi64_epi8(offsets, _mm512_set1_epi64(bits));
        if I == 4 { idx } else { _mm512_and_si512(idx, _mm512_set1_epi32((1 << I) - 1)) }
    }
}
