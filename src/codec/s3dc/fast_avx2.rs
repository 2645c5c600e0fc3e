//! Decoding integers with AVX2. Its scalar twin is `decode`; the walk and the tables are those of `fast` and `fast_tables`.
//!
//! With `R = max − min`, a sample is `min + floor(R·idx/q + ½)`; q is odd, so `R·idx/q + ½` is at least `1/(2q)` away from
//! an integer unless it is one. What the kernels compute instead, each tested for every R and idx there is:
//! * `u8`, q ≤ 15: a rounding high multiplication, `(idx·2^s · b + 2^14) >> 15` with `b = round(R·2^(15−s)/q)`: the error
//!   `idx·½/2^(15−s)` stays below `1/(2q)`;
//! * q = 255: `n = R·idx + 127 < 65535`, and `floor(n/255) = (n + 1 + (n >> 8)) >> 8`;
//! * 16 bits: `R = q·w + r` per block, so that `rdiv(R·idx, q) = w·idx + floor((r·idx + (q−1)/2) / q)` stays in 16 bits;
//!   the division is a high multiplication by `ceil(2^16/q)` for q ≤ 15.
#![allow(unsafe_code, reason = "loads and stores of vectors, and calls of functions that need AVX2")]

use super::Scalar;
use super::fast::{CHUNK, Job, Kernel, Piece, drive};
use super::fast_avx2_float::{FloatBytes, FloatPalette};
use super::fast_rows::Rows;
use super::fast_tables::{BlockRow, Table};
use crate::codec::Stores;
use crate::voxel::SampleType;
use std::arch::x86_64::*;
use std::marker::PhantomData;

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
    let streamed = job.stores == Stores::Streaming;
    let Some(Piece { layout, .. }) = job.pieces.first() else { return };
    match (layout.sample_type(), layout.params().i_bits()) {
        (SampleType::U8, 1) => drive(|| Bytes::<1>::new(token), job),
        (SampleType::U8, 2) => drive(|| Bytes::<2>::new(token), job),
        (SampleType::U8, 4) => drive(|| Bytes::<4>::new(token), job),
        (SampleType::U8, _) => drive(|| Bytes::<8>::new(token), job),
        (SampleType::U16, 1) => drive(|| Words::<u16, 1>::new(token), job),
        (SampleType::U16, 2) => drive(|| Words::<u16, 2>::new(token), job),
        (SampleType::U16, 4) => drive(|| Words::<u16, 4>::new(token), job),
        (SampleType::U16, _) => drive(|| Words::<u16, 8>::new(token), job),
        (SampleType::I16, 1) => drive(|| Words::<i16, 1>::new(token), job),
        (SampleType::I16, 2) => drive(|| Words::<i16, 2>::new(token), job),
        (SampleType::I16, 4) => drive(|| Words::<i16, 4>::new(token), job),
        (SampleType::I16, _) => drive(|| Words::<i16, 8>::new(token), job),
        (SampleType::F32, 1) => drive(|| FloatPalette::<1>::new(token), job),
        (SampleType::F32, 2) => drive(|| FloatPalette::<2>::new(token), job),
        (SampleType::F32, 4) => drive(|| FloatPalette::<4>::new(token), job),
        (SampleType::F32, _) => drive(|| FloatBytes::new(token), job),
        (SampleType::Rgb8, _) => {} // refused before a job is made
    }
    if streamed {
        // Streaming stores become visible in order with what follows.
        // SAFETY: the token proves AVX2, and every machine with it has SSE.
        unsafe { _mm_sfence() }
    }
}

// The small functions below are inlined into the kernels, whatever the compiler thinks of it: a call per step would cost
// as much as the step. A function cannot both insist on that and declare a target feature; so they are handed the token
// as their proof instead.

/// Loads 32 bytes.
#[inline(always)]
pub fn load(_: Avx2, bytes: &[u8; 32]) -> __m256i {
    // SAFETY: the token proves AVX2; the reference covers 32 readable bytes; the load needs no alignment.
    unsafe { _mm256_loadu_si256(bytes.as_ptr().cast()) }
}

/// Loads 16 bytes.
#[inline(always)]
fn load_half(_: Avx2, bytes: &[u8; 16]) -> __m128i {
    // SAFETY: the token proves AVX2; the reference covers 16 readable bytes; the load needs no alignment.
    unsafe { _mm_loadu_si128(bytes.as_ptr().cast()) }
}

/// Loads 16 words.
#[inline(always)]
fn load_words(token: Avx2, words: &[u16; 16]) -> __m256i {
    load(token, bytemuck::cast_ref(words))
}

/// Stores 32 bytes.
#[inline(always)]
fn store(_: Avx2, out: &mut [u8; 32], v: __m256i) {
    // SAFETY: the token proves AVX2; the reference covers 32 writable bytes; the store needs no alignment.
    unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), v) }
}

/// A row of a destination that takes 32 bytes at a time.
pub struct Out<'a> {
    chunks: &'a mut [[u8; 32]],
    stream: bool,
}

impl<'a> Out<'a> {
    /// The row; stored around the caches where `stores` says so and it lies on a multiple of 32.
    #[inline(always)]
    pub fn new(row: &'a mut [u8], stores: Stores) -> Self {
        let stream = stores == Stores::Streaming && row.as_ptr().addr() % 32 == 0;
        Out { chunks: row.as_chunks_mut().0, stream }
    }

    /// Stores the `k`-th 32 bytes.
    #[inline(always)]
    pub fn put(&mut self, token: Avx2, k: usize, v: __m256i) {
        let chunk = &mut self.chunks[k];
        if self.stream {
            // SAFETY: the token proves AVX2; the reference covers 32 writable bytes, a multiple of 32 from the start of
            // the row, which lies on a multiple of 32.
            unsafe { _mm256_stream_si256(chunk.as_mut_ptr().cast(), v) }
        } else {
            store(token, chunk, v);
        }
    }
}

/// The 32 indices of `4·I` bytes of words, as bytes in order: words are little-endian, their bytes in order too.
#[inline(always)]
fn indices<const I: usize>(token: Avx2, words: &[u8]) -> __m256i {
    // SAFETY: the token proves AVX2.
    unsafe {
        match I {
            1 => {
                let bits = _mm256_set1_epi32(i32::from_le_bytes(*first(words)));
                let replicate = _mm256_setr_epi8(
                    0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3, 3,
                );
                let bit = _mm256_set1_epi64x(0x8040_2010_0804_0201_u64.cast_signed());
                let bytes = _mm256_and_si256(_mm256_shuffle_epi8(bits, replicate), bit);
                _mm256_and_si256(_mm256_cmpeq_epi8(bytes, bit), _mm256_set1_epi8(1))
            }
            2 => {
                let eight = _mm_cvtsi64_si128(i64::from_le_bytes(*first(words)));
                // Byte b of four indices becomes b | b<<6 | b<<12 | b<<18: index j then lies in the low bits of byte j.
                let b = _mm256_cvtepu8_epi32(eight);
                let b = _mm256_or_si256(b, _mm256_slli_epi32::<12>(b));
                let b = _mm256_or_si256(b, _mm256_slli_epi32::<6>(b));
                _mm256_and_si256(b, _mm256_set1_epi8(3))
            }
            4 => {
                let b = _mm256_cvtepu8_epi16(load_half(token, first(words)));
                _mm256_and_si256(_mm256_or_si256(b, _mm256_slli_epi16::<4>(b)), _mm256_set1_epi8(15))
            }
            _ => load(token, first(words)),
        }
    }
}

/// The first `N` bytes.
#[inline(always)]
pub fn first<const N: usize>(bytes: &[u8]) -> &[u8; N] {
    bytes.first_chunk().expect("a step has its words")
}

/// `floor(n / q)` of 16-bit lanes; n < 1100 for q ≤ 15, n < 65535 for q = 255.
#[inline(always)]
fn divide<const I: usize>(token: Avx2, n: __m256i) -> __m256i {
    // SAFETY: the token proves AVX2.
    unsafe {
        match I {
            1 => n,
            2 => _mm256_mulhi_epu16(n, _mm256_set1_epi16(21846)),
            4 => _mm256_mulhi_epu16(n, _mm256_set1_epi16(4370)),
            _ => _mm256_srli_epi16::<8>(divided_by_255_times_256(token, n)),
        }
    }
}

/// `floor(n / 255)` in the upper bytes of 16-bit lanes; the lower bytes are not 0.
#[inline(always)]
fn divided_by_255_times_256(_: Avx2, n: __m256i) -> __m256i {
    // SAFETY: the token proves AVX2.
    unsafe { _mm256_add_epi16(_mm256_add_epi16(n, _mm256_set1_epi16(1)), _mm256_srli_epi16::<8>(n)) }
}

/// Rows of `u8`.
pub struct Bytes<const I: usize> {
    token: Avx2,
    min: Table<u8>,
    /// The factor of the voxels with even x: b of the module's text, R for I = 8.
    even: Table<u16>,
    /// The same for odd x; unused where blocks have an even edge, since a pair of voxels is then of one block.
    odd: Table<u16>,
    paired: bool,
    block_min: Table<u8>,
    block_factor: Table<u16>,
}

impl<const I: usize> Bytes<I> {
    /// b = R·WHOLE + floor((R·PART + h) / q), which splits `2^(15−s)` as the 16-bit kernel splits R; s = 8, 7, 5.
    const WHOLE: i16 = [128, 85, 0, 68, 0, 0, 0, 1][I - 1];
    /// See `WHOLE`.
    const PART: i16 = [0, 1, 0, 4, 0, 0, 0, 0][I - 1];

    /// Empty tables.
    pub fn new(token: Avx2) -> Self {
        let words = Table::default;
        let (even, odd, block_factor) = (words(), words(), words());
        Bytes { token, min: Table::default(), even, odd, paired: true, block_min: Table::default(), block_factor }
    }

    /// Minimum of every voxel, factor of those with even and with odd x.
    pub fn tables(&self) -> (&[u8; CHUNK], &[u16; CHUNK], &[u16; CHUNK]) {
        (&self.min.0, &self.even.0, if self.paired { &self.even.0 } else { &self.odd.0 })
    }

    /// Blocks of edge 4, which have few rows to pay for their tables.
    #[inline(always)]
    fn prepare_4(&mut self, pairs: &[u8]) {
        let mins = self.min.0.as_chunks_mut::<32>().0.iter_mut();
        let evens = self.even.0.as_chunks_mut::<16>().0.iter_mut();
        for (pairs, (min, even)) in pairs.chunks(16).zip(mins.zip(evens)) {
            let eight = match pairs.first_chunk() {
                Some(eight) => *eight,
                None => {
                    let mut eight = [0; 16];
                    eight[..pairs.len()].copy_from_slice(pairs);
                    eight
                }
            };
            // SAFETY: the token proves AVX2.
            let (lows, factors) = unsafe {
                let lane = _mm256_setr_epi64x(0, 0, 0x0808_0808_0808_0808, 0x0808_0808_0808_0808);
                let bytes = _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 0, 0, 0, 2, 2, 2, 2, 4, 4, 4, 4, 6, 6, 6, 6));
                let words = _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, 0, 1, 2, 3, 2, 3, 4, 5, 4, 5, 6, 7, 6, 7));
                let p = _mm256_broadcastsi128_si256(load_half(self.token, &eight));
                // max − min, 0 where they are out of order
                let range = _mm256_and_si256(_mm256_subs_epu8(_mm256_srli_epi16::<8>(p), p), _mm256_set1_epi16(255));
                let factors = Self::factors(self.token, range);
                (
                    _mm256_shuffle_epi8(p, _mm256_add_epi8(bytes, lane)),
                    _mm256_shuffle_epi8(factors, _mm256_add_epi8(words, lane)),
                )
            };
            store(self.token, min, lows);
            store(self.token, bytemuck::cast_mut(even), factors);
        }
    }

    /// The factors of ranges in 16-bit lanes.
    #[inline(always)]
    fn factors(token: Avx2, range: __m256i) -> __m256i {
        // SAFETY: the token proves AVX2.
        unsafe {
            let whole = _mm256_mullo_epi16(range, _mm256_set1_epi16(Self::WHOLE));
            if Self::PART == 0 {
                return whole;
            }
            let h = _mm256_set1_epi16(((1 << I) - 2) / 2);
            let part = _mm256_add_epi16(_mm256_mullo_epi16(range, _mm256_set1_epi16(Self::PART)), h);
            _mm256_add_epi16(whole, divide::<I>(token, part))
        }
    }

    /// 32 voxels.
    #[inline(always)]
    fn step(token: Avx2, words: &[u8], min: __m256i, even: __m256i, odd: __m256i) -> __m256i {
        // Even and odd voxels in 16-bit lanes of their own; the two halves meet again without a shuffle.
        // SAFETY: the token proves AVX2.
        unsafe {
            let (e, o) = if I == 8 {
                let idx = load(token, first(words));
                let (lower, h) = (_mm256_set1_epi16(255), _mm256_set1_epi16(127));
                let e = _mm256_add_epi16(_mm256_mullo_epi16(even, _mm256_and_si256(idx, lower)), h);
                let o = _mm256_add_epi16(_mm256_mullo_epi16(odd, _mm256_srli_epi16::<8>(idx)), h);
                let upper = _mm256_set1_epi16(0xff00_u16.cast_signed());
                (divide::<I>(token, e), _mm256_and_si256(divided_by_255_times_256(token, o), upper))
            } else {
                let (e, o) = Self::shifted(token, words);
                (_mm256_mulhrs_epi16(e, even), _mm256_slli_epi16::<8>(_mm256_mulhrs_epi16(o, odd)))
            };
            _mm256_add_epi8(min, _mm256_or_si256(e, o))
        }
    }

    /// `idx·2^s` of the even and of the odd voxels.
    #[inline(always)]
    fn shifted(token: Avx2, words: &[u8]) -> (__m256i, __m256i) {
        // SAFETY: the token proves AVX2.
        unsafe {
            match I {
                1 => {
                    let idx = indices::<I>(token, words);
                    (_mm256_slli_epi16::<8>(idx), _mm256_and_si256(idx, _mm256_set1_epi16(0x100)))
                }
                2 => {
                    let (idx, low) = (indices::<I>(token, words), _mm256_set1_epi16(3 << 7));
                    let e = _mm256_and_si256(_mm256_slli_epi16::<7>(idx), low);
                    (e, _mm256_and_si256(_mm256_srli_epi16::<1>(idx), low))
                }
                _ => {
                    let b = _mm256_cvtepu8_epi16(load_half(token, first(words)));
                    let low = _mm256_set1_epi16(15 << 5);
                    let e = _mm256_and_si256(_mm256_slli_epi16::<5>(b), low);
                    (e, _mm256_and_si256(_mm256_slli_epi16::<1>(b), low))
                }
            }
        }
    }
}

impl<const I: usize> Kernel for Bytes<I> {
    const BYTES: usize = 1;
    const I: usize = I;

    fn prepare(&mut self, blocks: &BlockRow<'_>) -> bool {
        // SAFETY: the token proves that the machine has AVX2.
        unsafe { self.prepare_avx2(blocks) }
        true
    }

    fn rows(&self, rows: Rows<'_>, stores: Stores) {
        // SAFETY: the token proves that the machine has AVX2.
        unsafe { self.rows_avx2(rows, stores) }
    }
}

impl<const I: usize> Bytes<I> {
    #[target_feature(enable = "avx2")]
    fn prepare_avx2(&mut self, blocks: &BlockRow<'_>) {
        self.paired = blocks.edge % 2 == 0 && blocks.before % 2 == 0;
        if (blocks.edge, blocks.before) == (4, 0) {
            return self.prepare_4(blocks.pairs);
        }
        let outs = self.block_min.0.iter_mut().zip(&mut self.block_factor.0);
        for ([lo, hi], (min, factor)) in blocks.pairs.as_chunks::<2>().0.iter().zip(outs) {
            *min = *lo;
            let (range, q) = (u16::from(hi.saturating_sub(*lo)), (1 << I) - 1);
            let (whole, part) = (Self::WHOLE.cast_unsigned(), Self::PART.cast_unsigned());
            *factor = range * whole + (range * part + (q - 1) / 2) / q;
        }
        blocks.spread(&self.block_min, 1, &mut self.min);
        if self.paired {
            blocks.spread(&self.block_factor, 2, &mut self.even);
        } else {
            let mut all = Table::default();
            blocks.spread(&self.block_factor, 1, &mut all);
            for ([e, o], (even, odd)) in all.0.as_chunks().0.iter().zip(self.even.0.iter_mut().zip(&mut self.odd.0)) {
                (*even, *odd) = (*e, *o);
            }
        }
    }

    #[target_feature(enable = "avx2")]
    fn rows_avx2(&self, rows: Rows<'_>, stores: Stores) {
        let t = self.token;
        let (min, even, odd) = self.tables();
        let (min, even, odd) = (min.as_chunks().0, even.as_chunks().0, odd.as_chunks().0);
        if rows.words_len() == 8 * I {
            // The usual brick has 64 voxels in a row: what belongs to its blocks stays in registers.
            let tables = [0, 1].map(|k| (load(t, &min[k]), load_words(t, &even[k]), load_words(t, &odd[k])));
            for (words, out) in rows {
                let mut out = Out::new(out, stores);
                for (k, (min, even, odd)) in tables.into_iter().enumerate() {
                    out.put(t, k, Self::step(t, &words[k * 4 * I..][..4 * I], min, even, odd));
                }
            }
        } else {
            for (words, out) in rows {
                let mut out = Out::new(out, stores);
                for (k, words) in words.chunks_exact(4 * I).enumerate() {
                    let tables = (load(t, &min[k]), load_words(t, &even[k]), load_words(t, &odd[k]));
                    out.put(t, k, Self::step(t, words, tables.0, tables.1, tables.2));
                }
            }
        }
    }
}

/// Rows of `u16` or `i16`.
pub struct Words<T, const I: usize> {
    token: Avx2,
    min: Table<u16>,
    /// R div q.
    whole: Table<u16>,
    /// R mod q.
    part: Table<u16>,
    /// The same three per block.
    block: [Table<u16>; 3],
    _type: PhantomData<T>,
}

impl<T, const I: usize> Words<T, I> {
    /// Empty tables.
    pub fn new(token: Avx2) -> Self {
        let table = Table::default;
        let block = std::array::from_fn(|_| Table::default());
        Words { token, min: table(), whole: table(), part: table(), block, _type: PhantomData }
    }

    /// Minimum, R div q and R mod q of every voxel.
    pub fn tables(&self) -> (&[u16; CHUNK], &[u16; CHUNK], &[u16; CHUNK]) {
        (&self.min.0, &self.whole.0, &self.part.0)
    }

    /// 16 voxels, their indices in 16-bit lanes.
    #[inline(always)]
    fn step(token: Avx2, idx: __m256i, min: __m256i, whole: __m256i, part: __m256i) -> __m256i {
        // SAFETY: the token proves AVX2.
        unsafe {
            let v = _mm256_add_epi16(min, _mm256_mullo_epi16(whole, idx));
            if I == 1 {
                return v;
            }
            let h = _mm256_set1_epi16(((1 << I) - 2) / 2);
            let n = _mm256_add_epi16(_mm256_mullo_epi16(part, idx), h);
            _mm256_add_epi16(v, divide::<I>(token, n))
        }
    }

    /// Bytes in order, as 16-bit lanes.
    #[inline(always)]
    fn widen(_: Avx2, idx: __m256i) -> [__m256i; 2] {
        // SAFETY: the token proves AVX2.
        unsafe {
            let halves = [_mm256_castsi256_si128(idx), _mm256_extracti128_si256::<1>(idx)];
            [_mm256_cvtepu8_epi16(halves[0]), _mm256_cvtepu8_epi16(halves[1])]
        }
    }
}

impl<T: Scalar + Into<i32>, const I: usize> Kernel for Words<T, I> {
    const BYTES: usize = 2;
    const I: usize = I;

    fn prepare(&mut self, blocks: &BlockRow<'_>) -> bool {
        // SAFETY: the token proves that the machine has AVX2.
        unsafe { self.prepare_avx2(blocks) }
        true
    }

    fn rows(&self, rows: Rows<'_>, stores: Stores) {
        // SAFETY: the token proves that the machine has AVX2.
        unsafe { self.rows_avx2(rows, stores) }
    }
}

impl<T: Scalar + Into<i32>, const I: usize> Words<T, I> {
    #[target_feature(enable = "avx2")]
    fn prepare_avx2(&mut self, blocks: &BlockRow<'_>) {
        let q = (1u16 << I) - 1;
        let [min, whole, part] = &mut self.block;
        let outs = min.0.iter_mut().zip(whole.0.iter_mut().zip(&mut part.0));
        for (pair, (min, (whole, part))) in blocks.pairs.as_chunks::<4>().0.iter().zip(outs) {
            let (lo, hi): (i32, i32) = (T::from_le(pair).into(), T::from_le(&pair[2..]).into());
            let range = (hi - lo).max(0) as u16;
            (*min, *whole, *part) = (lo as u16, range / q, range % q);
        }
        blocks.spread(min, 1, &mut self.min);
        blocks.spread(whole, 1, &mut self.whole);
        blocks.spread(part, 1, &mut self.part);
    }

    #[target_feature(enable = "avx2")]
    fn rows_avx2(&self, rows: Rows<'_>, stores: Stores) {
        let t = self.token;
        let (min, whole, part) = self.tables();
        let (min, whole, part) = (min.as_chunks().0, whole.as_chunks().0, part.as_chunks().0);
        for (words, out) in rows {
            let mut out = Out::new(out, stores);
            for (k, words) in words.chunks_exact(4 * I).enumerate() {
                let [low, high] = Self::widen(t, indices::<I>(t, words));
                for (k, idx) in [(2 * k, low), (2 * k + 1, high)] {
                    let tables = (load_words(t, &min[k]), load_words(t, &whole[k]), load_words(t, &part[k]));
                    out.put(t, k, Self::step(t, idx, tables.0, tables.1, tables.2));
                }
            }
        }
    }
}
