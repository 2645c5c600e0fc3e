//! Decoding integers with AVX2. Its scalar twin is `decode`; the walk and the tables are those of `fast` and `fast_tables`.
//!
//! With `R = max − min` and `h = (q−1)/2`, `rdiv(R·idx, q) = floor((R·idx + h) / q)`, since q is odd. A division by the
//! constant q is a multiplication: `floor(n/q) = (n·m) >> s` is exact in the ranges that occur (tested exhaustively):
//! q = 3: n ≤ 766, m = 21846, s = 16; q = 15: n ≤ 3832, m = 4370, s = 16; q = 255: n < 2^16, m = 32897, s = 23.
//! 16-bit samples split `R = q·a + r` per block, so that `rdiv(R·idx, q) = a·idx + rdiv(r·idx, q)` stays in 16 bits.
#![allow(unsafe_code, reason = "loads and stores of vectors, and calls of functions that need AVX2")]

use super::fast::{CHUNK, Job, Kernel, STEP, drive};
use super::fast_avx2_float::{FloatBytes, FloatPalette};
use super::fast_tables::{BlockRow, Table};
use super::{Layout, Scalar};
use crate::codec::Stores;
use crate::voxel::SampleType;
use std::arch::x86_64::*;

/// Proof that this machine has AVX2.
#[derive(Clone, Copy)]
pub struct Avx2(());

impl Avx2 {
    /// The proof, if there is one.
    pub fn detect() -> Option<Avx2> {
        std::arch::is_x86_feature_detected!("avx2").then_some(Avx2(()))
    }
}

/// Decodes a job with AVX2.
pub fn decode(token: Avx2, job: Job<'_>) {
    // SAFETY: the token proves that the machine has AVX2.
    unsafe { dispatch(token, job) }
}

#[target_feature(enable = "avx2")]
fn dispatch(token: Avx2, job: Job<'_>) {
    let streamed = job.stores == Stores::Streaming;
    match (job.layout.sample_type(), job.layout.params().i_bits()) {
        (SampleType::U8, 1) => drive(&mut Bytes::<1>::new(token), job),
        (SampleType::U8, 2) => drive(&mut Bytes::<2>::new(token), job),
        (SampleType::U8, 4) => drive(&mut Bytes::<4>::new(token), job),
        (SampleType::U8, _) => drive(&mut Bytes::<8>::new(token), job),
        (SampleType::U16, 1) => drive(&mut Words::<u16, 1>::new(token), job),
        (SampleType::U16, 2) => drive(&mut Words::<u16, 2>::new(token), job),
        (SampleType::U16, 4) => drive(&mut Words::<u16, 4>::new(token), job),
        (SampleType::U16, _) => drive(&mut Words::<u16, 8>::new(token), job),
        (SampleType::I16, 1) => drive(&mut Words::<i16, 1>::new(token), job),
        (SampleType::I16, 2) => drive(&mut Words::<i16, 2>::new(token), job),
        (SampleType::I16, 4) => drive(&mut Words::<i16, 4>::new(token), job),
        (SampleType::I16, _) => drive(&mut Words::<i16, 8>::new(token), job),
        (SampleType::F32, 1) => drive(&mut FloatPalette::<1>::new(token), job),
        (SampleType::F32, 2) => drive(&mut FloatPalette::<2>::new(token), job),
        (SampleType::F32, 4) => drive(&mut FloatPalette::<4>::new(token), job),
        (SampleType::F32, _) => drive(&mut FloatBytes::new(token), job),
        (SampleType::Rgb8, _) => {} // refused before a job is made
    }
    if streamed {
        _mm_sfence(); // streaming stores become visible in order with what follows
    }
}

/// Loads 32 bytes.
#[inline]
#[target_feature(enable = "avx2")]
pub fn load(bytes: &[u8; 32]) -> __m256i {
    // SAFETY: the reference covers 32 readable bytes; the load needs no alignment.
    unsafe { _mm256_loadu_si256(bytes.as_ptr().cast()) }
}

/// Loads 16 bytes.
#[inline]
#[target_feature(enable = "avx2")]
fn load_half(bytes: &[u8; 16]) -> __m128i {
    // SAFETY: the reference covers 16 readable bytes; the load needs no alignment.
    unsafe { _mm_loadu_si128(bytes.as_ptr().cast()) }
}

/// Stores 32 bytes; `STREAM` goes around the caches and needs `out` on a multiple of 32.
#[inline]
#[target_feature(enable = "avx2")]
pub fn store<const STREAM: bool>(out: &mut [u8; 32], v: __m256i) {
    if STREAM && out.as_ptr().addr() % 32 == 0 {
        // SAFETY: the reference covers 32 writable bytes and lies on a multiple of 32.
        unsafe { _mm256_stream_si256(out.as_mut_ptr().cast(), v) }
    } else {
        // SAFETY: the reference covers 32 writable bytes; the store needs no alignment.
        unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), v) }
    }
}

/// Part `k` of `N` elements of a slice, as an array.
#[inline(always)]
pub fn part<V, const N: usize>(s: &[V], k: usize) -> &[V; N] {
    s[k * N..].first_chunk().expect("tables are as long as the longest row")
}

/// The 32 indices of `4·I` bytes of words, as bytes in order. On little-endian machines words are bytes in order too.
#[inline]
#[target_feature(enable = "avx2")]
fn indices<const I: usize>(words: &[u8]) -> __m256i {
    match I {
        1 => {
            let bits = _mm256_set1_epi32(i32::from_le_bytes(*part(words, 0)));
            let replicate = _mm256_setr_epi8(
                0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3, 3,
            );
            let bit = _mm256_set1_epi64x(0x8040_2010_0804_0201_u64.cast_signed());
            let bytes = _mm256_and_si256(_mm256_shuffle_epi8(bits, replicate), bit);
            _mm256_and_si256(_mm256_cmpeq_epi8(bytes, bit), _mm256_set1_epi8(1))
        }
        2 => {
            let eight = _mm_cvtsi64_si128(i64::from_le_bytes(*part(words, 0)));
            // Byte b of four indices becomes b | b<<6 | b<<12 | b<<18: index j then lies in the low bits of byte j.
            let b = _mm256_cvtepu8_epi32(eight);
            let b = _mm256_or_si256(b, _mm256_slli_epi32::<12>(b));
            let b = _mm256_or_si256(b, _mm256_slli_epi32::<6>(b));
            _mm256_and_si256(b, _mm256_set1_epi8(3))
        }
        4 => {
            let b = _mm256_cvtepu8_epi16(load_half(part(words, 0)));
            _mm256_and_si256(_mm256_or_si256(b, _mm256_slli_epi16::<4>(b)), _mm256_set1_epi8(15))
        }
        _ => load(part(words, 0)),
    }
}

/// `floor(n / q)` of 16-bit lanes; exact in the ranges that occur, see the module's text.
#[inline]
#[target_feature(enable = "avx2")]
fn divide<const I: usize>(n: __m256i) -> __m256i {
    match I {
        1 => n,
        2 => _mm256_mulhi_epu16(n, _mm256_set1_epi16(21846)),
        4 => _mm256_mulhi_epu16(n, _mm256_set1_epi16(4370)),
        _ => _mm256_srli_epi16::<7>(_mm256_mulhi_epu16(n, _mm256_set1_epi16(32897_u16.cast_signed()))),
    }
}

/// Rows of `u8`.
struct Bytes<const I: usize> {
    token: Avx2,
    min: Table<u8>,
    /// R of the voxels with even x, and h in the upper byte: one pair for multiply-and-add. (I = 8: R alone.)
    even: Table<u16>,
    /// The same for odd x.
    odd: Table<u16>,
}

impl<const I: usize> Bytes<I> {
    const H: u16 = if I == 8 { 0 } else { (((1 << I) - 2) / 2) << 8 };

    fn new(token: Avx2) -> Self {
        Bytes { token, min: Table::default(), even: Table::default(), odd: Table::default() }
    }
}

impl<const I: usize> Kernel for Bytes<I> {
    const BYTES: usize = 1;

    #[inline(always)]
    fn prepare(&mut self, layout: &Layout, payload: &[u8], x0: u32, voxels: usize, block_yz: [u32; 2]) -> bool {
        let blocks = BlockRow::new(layout, payload, x0, voxels, block_yz);
        let (mut min, mut range) = (Table([0u8; CHUNK]), Table([0u16; CHUNK]));
        blocks.for_each::<u8>(|b, lo, hi| {
            min.0[b] = lo;
            range.0[b] = u16::from(hi.saturating_sub(lo)) | Self::H;
        });
        blocks.spread(&min, 1, &mut self.min);
        if blocks.edge % 2 == 0 && blocks.before % 2 == 0 {
            blocks.spread(&range, 2, &mut self.even);
            self.odd.0 = self.even.0;
        } else {
            let mut all = Table([0u16; CHUNK]);
            blocks.spread(&range, 1, &mut all);
            for (k, [even, odd]) in all.0.as_chunks::<2>().0.iter().enumerate() {
                (self.even.0[k], self.odd.0[k]) = (*even, *odd);
            }
        }
        true
    }

    #[inline(always)]
    fn row(&self, words: &[u8], out: &mut [u8], stores: Stores) {
        let _ = self.token;
        // SAFETY: the token proves that the machine has AVX2.
        unsafe {
            match stores {
                Stores::Cached => self.row_avx2::<false>(words, out),
                Stores::Streaming => self.row_avx2::<true>(words, out),
            }
        }
    }
}

impl<const I: usize> Bytes<I> {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn row_avx2<const STREAM: bool>(&self, words: &[u8], out: &mut [u8]) {
        let (whole, rest) = out.as_chunks_mut::<STEP>();
        for (k, out) in whole.iter_mut().enumerate() {
            store::<STREAM>(out, self.step(&words[k * 4 * I..][..4 * I], k));
        }
        if !rest.is_empty() {
            let mut last = [0; STEP];
            let left = &words[whole.len() * 4 * I..];
            last[..left.len()].copy_from_slice(left);
            let mut buffer = [0; STEP];
            store::<false>(&mut buffer, self.step(&last[..4 * I], whole.len()));
            rest.copy_from_slice(&buffer[..rest.len()]);
        }
    }

    /// Voxels `32·k` to `32·k + 31` of the row.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn step(&self, words: &[u8], k: usize) -> __m256i {
        let min = load(part(&self.min.0, k));
        let range = |t: &Table<u16>| load(bytemuck::cast_ref::<[u16; 16], [u8; 32]>(part(&t.0, k)));
        let (even, odd) = (range(&self.even), range(&self.odd));
        // Even and odd voxels in 16-bit lanes of their own; the two halves meet again without a shuffle.
        let (e, o) = if I == 4 {
            let b = _mm256_cvtepu8_epi16(load_half(part(words, 0)));
            (_mm256_and_si256(b, _mm256_set1_epi16(15)), _mm256_srli_epi16::<4>(b))
        } else {
            let idx = indices::<I>(words);
            (_mm256_and_si256(idx, _mm256_set1_epi16(255)), _mm256_srli_epi16::<8>(idx))
        };
        let scaled = |range, idx| {
            if I == 8 {
                _mm256_add_epi16(_mm256_mullo_epi16(range, idx), _mm256_set1_epi16(127))
            } else {
                _mm256_maddubs_epi16(range, _mm256_or_si256(idx, _mm256_set1_epi16(0x100)))
            }
        };
        let (e, o) = (divide::<I>(scaled(even, e)), divide::<I>(scaled(odd, o)));
        _mm256_add_epi8(min, _mm256_or_si256(e, _mm256_slli_epi16::<8>(o)))
    }
}

/// Rows of `u16` or `i16`.
struct Words<T, const I: usize> {
    token: Avx2,
    min: Table<u16>,
    /// R div q.
    whole: Table<u16>,
    /// R mod q.
    part: Table<u16>,
    _type: std::marker::PhantomData<T>,
}

impl<T, const I: usize> Words<T, I> {
    fn new(token: Avx2) -> Self {
        let table = Table::default;
        Words { token, min: table(), whole: table(), part: table(), _type: std::marker::PhantomData }
    }
}

impl<T: Scalar + Into<i32>, const I: usize> Kernel for Words<T, I> {
    const BYTES: usize = 2;

    #[inline(always)]
    fn prepare(&mut self, layout: &Layout, payload: &[u8], x0: u32, voxels: usize, block_yz: [u32; 2]) -> bool {
        let blocks = BlockRow::new(layout, payload, x0, voxels, block_yz);
        let q = (1u16 << I) - 1;
        let zero = || Table([0u16; CHUNK]);
        let (mut min, mut whole, mut part) = (zero(), zero(), zero());
        blocks.for_each::<T>(|b, lo, hi| {
            let (lo, hi): (i32, i32) = (lo.into(), hi.into());
            let range = (hi - lo).max(0) as u16;
            min.0[b] = lo as u16;
            (whole.0[b], part.0[b]) = (range / q, range % q);
        });
        blocks.spread(&min, 1, &mut self.min);
        blocks.spread(&whole, 1, &mut self.whole);
        blocks.spread(&part, 1, &mut self.part);
        true
    }

    #[inline(always)]
    fn row(&self, words: &[u8], out: &mut [u8], stores: Stores) {
        let _ = self.token;
        // SAFETY: the token proves that the machine has AVX2.
        unsafe {
            match stores {
                Stores::Cached => self.row_avx2::<false>(words, out),
                Stores::Streaming => self.row_avx2::<true>(words, out),
            }
        }
    }
}

impl<T, const I: usize> Words<T, I> {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn row_avx2<const STREAM: bool>(&self, words: &[u8], out: &mut [u8]) {
        let (whole, rest) = out.as_chunks_mut::<{ 2 * STEP }>();
        for (k, out) in whole.iter_mut().enumerate() {
            self.step::<STREAM>(&words[k * 4 * I..][..4 * I], k, out);
        }
        if !rest.is_empty() {
            let mut last = [0; STEP];
            let left = &words[whole.len() * 4 * I..];
            last[..left.len()].copy_from_slice(left);
            let mut buffer = [0; 2 * STEP];
            self.step::<false>(&last[..4 * I], whole.len(), &mut buffer);
            rest.copy_from_slice(&buffer[..rest.len()]);
        }
    }

    /// Voxels `32·k` to `32·k + 31` of the row.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn step<const STREAM: bool>(&self, words: &[u8], k: usize, out: &mut [u8; 2 * STEP]) {
        let idx = indices::<I>(words);
        let halves = [_mm256_castsi256_si128(idx), _mm256_extracti128_si256::<1>(idx)];
        for (j, (out, half)) in out.as_chunks_mut::<32>().0.iter_mut().zip(halves).enumerate() {
            let idx = _mm256_cvtepu8_epi16(half);
            let table = |t: &Table<u16>| load(bytemuck::cast_ref::<[u16; 16], [u8; 32]>(part(&t.0, 2 * k + j)));
            let v = _mm256_add_epi16(table(&self.min), _mm256_mullo_epi16(table(&self.whole), idx));
            let v = if I == 1 {
                v
            } else {
                let h = _mm256_set1_epi16(((1 << I) - 2) / 2);
                let n = _mm256_add_epi16(_mm256_mullo_epi16(table(&self.part), idx), h);
                _mm256_add_epi16(v, divide::<I>(n))
            };
            store::<STREAM>(out, v);
        }
    }
}
