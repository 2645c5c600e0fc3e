//! Cells of colours with AVX-512: all 64 coefficients at once, without a branch. Its twin is `fast_cell`.
//!
//! Flags become a mask of 64 positions, indices are spread to their positions by it, words are looked up by byte permutes,
//! a component at a time, and both levels are undone by butterflies across lanes. What a cell holds does not change how long
//! that takes: nothing has to be guessed.
#![allow(unsafe_code, reason = "intrinsics; loads and stores of vectors")]

use super::fast_cell::{Coded, Maps, ROW};
use super::layout::bytes;
use super::tables::Tables;
use std::arch::x86_64::*;

/// 64 bytes on a cache line.
#[repr(align(64))]
struct Line<T>(T);

/// Group k of a component's vector is the node at (x, y, z) with k = 4x + 2y + z; it takes 8 lanes, lane j for detail j, the
/// first for its mean. Byte 8k + j comes from position 7i + j, i − 1 = 4z + 2y + x.
static TO_GROUPS: Line<[u8; 64]> = Line({
    let mut from = [0; 64];
    let mut lane = 0;
    while lane < 64 {
        let (k, j) = (lane / 8, lane % 8);
        let i = 1 + (k >> 2 & 1 | k & 2 | (k & 1) << 2);
        from[lane] = (7 * i + j) as u8;
        lane += 1;
    }
    from
});

/// Where the average of component c goes: lane 8c.
static AVERAGES: Line<[u16; 32]> = Line({
    let mut from = [3; 32];
    from[0] = 0;
    from[8] = 1;
    from[16] = 2;
    from
});

/// Where the means of nodes come from, by component and half (x of the node): lane 8c + k for group k.
static MEANS: Line<[[[u16; 32]; 2]; 3]> = Line({
    let mut from = [[[0; 32]; 2]; 3];
    let mut c = 0;
    while c < 3 {
        let mut k = 0;
        while k < 8 {
            from[c][k / 4][8 * (k % 4)] = (8 * c + k) as u16;
            k += 1;
        }
        c += 1;
    }
    from
});

/// First lanes of the groups of a half.
const FIRST_LANES: u32 = 0x0101_0101;

/// Bytes of rows 4z to 4z + 3, 16 for each: from red (0 to 63) and green (64 to 127), and from blue.
///
/// A component's byte of the voxel with node (nx, ny, nz) and place (x, y, z) in it is 16 (2 ny + nz) + 8 nx + 4x + 2y + z.
static TO_ROWS: Line<[[[u8; 64]; 2]; 4]> = Line({
    let mut from = [[[0; 64]; 2]; 4];
    let mut z = 0;
    while z < 4 {
        let mut at = 0;
        while at < 64 {
            let (y, byte) = (at / 16, at % 16);
            if byte < 12 {
                let (x, c) = (byte / 3, byte % 3);
                let v = 16 * (2 * (y / 2) + z / 2) + 8 * (x / 2) + 4 * (x % 2) + 2 * (y % 2) + z % 2;
                from[z][0][at] = (if c == 1 { 64 + v } else { v }) as u8;
                from[z][1][at] = v as u8;
            }
            at += 1;
        }
        z += 1;
    }
    from
});

/// Bytes of a row that are blue, in all four rows of a vector.
const BLUE: u64 = 0x0924_0924_0924_0924;

/// Decodes a cell and hands all its rows (y, z), by their numbers y + 4z, to `put`, packed to bytes; what lies behind the
/// twelfth does not matter.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vbmi2,bmi1,bmi2,popcnt,lzcnt")]
pub(super) fn colour_rows(cell: &Coded<'_>, tables: &Tables, mut put: impl FnMut(usize, [u8; ROW])) {
    let flags = positions(cell);
    let stored = load(&bytes::<64>(cell.payload, cell.details));
    let indices = _mm512_maskz_expand_epi8(flags, stored);
    let upper = _mm512_movepi8_mask(indices);
    let words: [__m512i; 3] = std::array::from_fn(|c| {
        let table: &[[u8; 64]; 4] = &tables.detail_planes[c];
        let low = _mm512_permutex2var_epi8(load(&table[0]), indices, load(&table[1]));
        let high = _mm512_permutex2var_epi8(load(&table[2]), indices, load(&table[3]));
        _mm512_maskz_mov_epi8(flags, _mm512_mask_blend_epi8(upper, low, high))
    });

    // Level 0, a component per 128 bits: position 0 is not flagged, so that the average is added to nothing.
    let average = cell.average.map_or([0; 4], |index| tables.average_lanes[usize::from(index)]);
    let average = _mm512_castsi128_si512(_mm_cvtsi64_si128(i64::from_ne_bytes(bytemuck::cast(average))));
    let average = _mm512_permutexvar_epi16(load_words(&AVERAGES.0), average);
    let level_0 = |c: usize| _mm_cvtepi8_epi16(_mm512_castsi512_si128(words[c]));
    let details = _mm512_inserti32x4::<1>(_mm512_castsi128_si512(level_0(0)), level_0(1));
    let details = _mm512_inserti32x4::<2>(details, level_0(2));
    let means = undo(_mm512_add_epi16(average, details));

    // Level 1, a component at a time, in two halves; then clamped to bytes.
    let planes: [__m512i; 3] = std::array::from_fn(|c| {
        let groups = _mm512_permutexvar_epi8(load(&TO_GROUPS.0), words[c]);
        let half = |details: __m256i, x: usize| {
            let with_means = _mm512_mask_permutexvar_epi16(
                _mm512_cvtepi8_epi16(details),
                FIRST_LANES,
                load_words(&MEANS.0[c][x]),
                means,
            );
            undo(with_means)
        };
        let halves = [half(_mm512_castsi512_si256(groups), 0), half(_mm512_extracti64x4_epi64::<1>(groups), 1)];
        _mm512_packus_epi16(halves[0], halves[1])
    });
    for (z, [red_green, blue]) in TO_ROWS.0.iter().enumerate() {
        let rows = _mm512_permutex2var_epi8(planes[0], load(red_green), planes[1]);
        let rows = _mm512_mask_permutexvar_epi8(rows, BLUE, load(blue), planes[2]);
        let four = [
            _mm512_castsi512_si128(rows),
            _mm512_extracti32x4_epi32::<1>(rows),
            _mm512_extracti32x4_epi32::<2>(rows),
            _mm512_extracti32x4_epi32::<3>(rows),
        ];
        for (y, row) in four.into_iter().enumerate() {
            let mut out = [0; ROW];
            // SAFETY: as many bytes as the vector has.
            unsafe { _mm_storeu_si128(out.as_mut_ptr().cast(), row) };
            put(y + 4 * z, out);
        }
    }
}

/// The positions whose details are stored, bit p for p = 7i + j.
#[inline]
#[target_feature(enable = "bmi1,bmi2")]
fn positions(cell: &Coded<'_>) -> u64 {
    match cell.maps {
        Maps::Flags(flags) => flags & !1,
        Maps::Stored(at) => {
            // Each byte turned round: detail j of a map at bit j.
            let maps = u64::from_le_bytes(bytes(cell.payload, at)).swap_bytes().reverse_bits();
            let fields = _pext_u64(maps, 0xFEFE_FEFE_FEFE_FEFE);
            // Seven bits from 7i + 1 on for each node that has a map; node 1 is the highest bit of the zerobits.
            let nodes = _pdep_u64(u64::from(cell.nodes.reverse_bits()), 0x0204_0810_2040_8100) * 0x7F;
            _pdep_u64(fields, nodes) | u64::from(cell.level_0.reverse_bits())
        }
    }
}

/// Undoes the three letters of every group of eight lanes: lane 4hx + 2hy + hz becomes 4x + 2y + z.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn undo(v: __m512i) -> __m512i {
    // Of each pair, the first becomes the sum, the second the difference.
    let step = |v: __m512i, swapped: __m512i, seconds: u32| {
        _mm512_mask_sub_epi16(_mm512_add_epi16(v, swapped), seconds, swapped, v)
    };
    let v = step(v, _mm512_ror_epi32::<16>(v), 0xAAAA_AAAA);
    let v = step(v, _mm512_shuffle_epi32::<0xB1>(v), 0xCCCC_CCCC);
    step(v, _mm512_shuffle_epi32::<0x4E>(v), 0xF0F0_F0F0)
}

#[inline]
#[target_feature(enable = "avx512f")]
fn load(bytes: &[u8; 64]) -> __m512i {
    // SAFETY: as many bytes as the vector has.
    unsafe { _mm512_loadu_si512(bytes.as_ptr().cast()) }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn load_words(words: &[u16; 32]) -> __m512i {
    // SAFETY: as many bytes as the vector has.
    unsafe { _mm512_loadu_si512(words.as_ptr().cast()) }
}
