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

use super::fast::{Job, Kernel, Rows, STEP, drive};
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

/// `floor(n / q)` of 16-bit lanes; n < 1100 for q ≤ 15, n < 65535 for q = 255.
#[inline]
#[target_feature(enable = "avx2")]
fn divide<const I: usize>(n: __m256i) -> __m256i {
    match I {
        1 => n,
        2 => _mm256_mulhi_epu16(n, _mm256_set1_epi16(21846)),
        4 => _mm256_mulhi_epu16(n, _mm256_set1_epi16(4370)),
        _ => _mm256_srli_epi16::<8>(divided_by_255_times_256(n)),
    }
}

/// `floor(n / 255)` in the upper bytes of 16-bit lanes; the lower bytes are not 0.
#[inline]
#[target_feature(enable = "avx2")]
fn divided_by_255_times_256(n: __m256i) -> __m256i {
    _mm256_add_epi16(_mm256_add_epi16(n, _mm256_set1_epi16(1)), _mm256_srli_epi16::<8>(n))
}

/// Rows of `u8`.
struct Bytes<const I: usize> {
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
    /// s of the module's text: as much precision as fits.
    const S: u32 = [8, 7, 0, 5, 0, 0, 0, 0][I - 1];
    /// b = R·WHOLE + floor((R·PART + h) / q), which splits `2^(15−S)` as the 16-bit kernel splits R.
    const WHOLE: i16 = [128, 85, 0, 68, 0, 0, 0, 1][I - 1];
    /// See `WHOLE`.
    const PART: i16 = [0, 1, 0, 4, 0, 0, 0, 0][I - 1];

    fn new(token: Avx2) -> Self {
        let words = Table::default;
        let (even, odd, block_factor) = (words(), words(), words());
        Bytes { token, min: Table::default(), even, odd, paired: true, block_min: Table::default(), block_factor }
    }

    /// Blocks of edge 4, which have few rows to pay for their tables.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn prepare_4(&mut self, pairs: &[u8]) {
        let lane = _mm256_setr_epi64x(0, 0, 0x0808_0808_0808_0808, 0x0808_0808_0808_0808);
        let bytes = _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 0, 0, 0, 2, 2, 2, 2, 4, 4, 4, 4, 6, 6, 6, 6));
        let words = _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, 0, 1, 2, 3, 2, 3, 4, 5, 4, 5, 6, 7, 6, 7));
        let (bytes, words) = (_mm256_add_epi8(bytes, lane), _mm256_add_epi8(words, lane));
        let mins = self.min.0.as_chunks_mut::<32>().0.iter_mut();
        let evens = bytemuck::cast_slice_mut::<u16, [u8; 32]>(&mut self.even.0).iter_mut();
        for (pairs, (min, even)) in pairs.chunks(16).zip(mins.zip(evens)) {
            let p = match pairs.first_chunk() {
                Some(eight) => load_half(eight),
                None => {
                    let mut eight = [0; 16];
                    eight[..pairs.len()].copy_from_slice(pairs);
                    load_half(&eight)
                }
            };
            let p = _mm256_broadcastsi128_si256(p);
            store::<false>(min, _mm256_shuffle_epi8(p, bytes));
            // max − min, 0 where they are out of order
            let range = _mm256_and_si256(_mm256_subs_epu8(_mm256_srli_epi16::<8>(p), p), _mm256_set1_epi16(255));
            store::<false>(even, Self::factors(_mm256_shuffle_epi8(range, words)));
        }
    }

    /// The factors of ranges in 16-bit lanes.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn factors(range: __m256i) -> __m256i {
        let whole = _mm256_mullo_epi16(range, _mm256_set1_epi16(Self::WHOLE));
        if Self::PART == 0 {
            return whole;
        }
        let h = _mm256_set1_epi16(((1 << I) - 2) / 2);
        let part = _mm256_add_epi16(_mm256_mullo_epi16(range, _mm256_set1_epi16(Self::PART)), h);
        _mm256_add_epi16(whole, divide::<I>(part))
    }
}

impl<const I: usize> Kernel for Bytes<I> {
    const BYTES: usize = 1;

    #[inline(always)]
    fn prepare(&mut self, layout: &Layout, payload: &[u8], x0: u32, voxels: usize, block_yz: [u32; 2]) -> bool {
        let blocks = BlockRow::new(layout, payload, x0, voxels, block_yz);
        self.paired = blocks.edge % 2 == 0 && blocks.before % 2 == 0;
        if (blocks.edge, blocks.before) == (4, 0) {
            let _ = self.token;
            // SAFETY: the token proves that the machine has AVX2.
            unsafe { self.prepare_4(blocks.pairs) };
            return true;
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
        true
    }

    #[inline(always)]
    fn rows(&self, rows: Rows<'_>) {
        let _ = self.token;
        // SAFETY: the token proves that the machine has AVX2.
        unsafe { self.rows_avx2(rows) }
    }
}

impl<const I: usize> Bytes<I> {
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
        let factor = |t: &Table<u16>| load(bytemuck::cast_ref::<[u16; 16], [u8; 32]>(part(&t.0, k)));
        let even = factor(&self.even);
        let odd = if self.paired { even } else { factor(&self.odd) };
        // Even and odd voxels in 16-bit lanes of their own; the two halves meet again without a shuffle.
        let (e, o) = if I == 8 {
            let idx = load(part(words, 0));
            let n = |factor, idx| _mm256_add_epi16(_mm256_mullo_epi16(factor, idx), _mm256_set1_epi16(127));
            let e = n(even, _mm256_and_si256(idx, _mm256_set1_epi16(255)));
            let o = n(odd, _mm256_srli_epi16::<8>(idx));
            let upper = _mm256_set1_epi16(0xff00_u16.cast_signed());
            (divide::<I>(e), _mm256_and_si256(divided_by_255_times_256(o), upper))
        } else {
            let (e, o) = Self::shifted(words);
            (_mm256_mulhrs_epi16(e, even), _mm256_slli_epi16::<8>(_mm256_mulhrs_epi16(o, odd)))
        };
        _mm256_add_epi8(min, _mm256_or_si256(e, o))
    }

    /// `idx << S` of the even and of the odd voxels.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn shifted(words: &[u8]) -> (__m256i, __m256i) {
        match I {
            1 => {
                let idx = indices::<I>(words);
                (_mm256_slli_epi16::<8>(idx), _mm256_and_si256(idx, _mm256_set1_epi16(0x100)))
            }
            2 => {
                let idx = indices::<I>(words);
                let low = _mm256_set1_epi16(3 << 7);
                (_mm256_and_si256(_mm256_slli_epi16::<7>(idx), low), _mm256_and_si256(_mm256_srli_epi16::<1>(idx), low))
            }
            _ => {
                let b = _mm256_cvtepu8_epi16(load_half(part(words, 0)));
                let low = _mm256_set1_epi16(15 << 5);
                (_mm256_and_si256(_mm256_slli_epi16::<5>(b), low), _mm256_and_si256(_mm256_slli_epi16::<1>(b), low))
            }
        }
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
    /// The same three per block.
    block: [Table<u16>; 3],
    _type: std::marker::PhantomData<T>,
}

impl<T, const I: usize> Words<T, I> {
    fn new(token: Avx2) -> Self {
        let table = Table::default;
        let block = std::array::from_fn(|_| Table::default());
        Words { token, min: table(), whole: table(), part: table(), block, _type: std::marker::PhantomData }
    }
}

impl<T: Scalar + Into<i32>, const I: usize> Kernel for Words<T, I> {
    const BYTES: usize = 2;

    #[inline(always)]
    fn prepare(&mut self, layout: &Layout, payload: &[u8], x0: u32, voxels: usize, block_yz: [u32; 2]) -> bool {
        let blocks = BlockRow::new(layout, payload, x0, voxels, block_yz);
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
        true
    }

    #[inline(always)]
    fn rows(&self, rows: Rows<'_>) {
        let _ = self.token;
        // SAFETY: the token proves that the machine has AVX2.
        unsafe { self.rows_avx2(rows) }
    }
}

impl<T, const I: usize> Words<T, I> {
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
