//! Cells of colours with AVX2: four rows of a quarter at a time, in registers. Its twin is `fast_cell`.
//!
//! A row of four voxels is one vector of 16 lanes (three components and a spare one per voxel). A quarter of a cell, the
//! rows with the same y / 2 and z / 2, consists of two level-1 nodes, which follow each other in the stream.
#![allow(unsafe_code, reason = "intrinsics; loads and stores of vectors")]

use super::bits;
use super::fast::{self, Parts};
use super::fast_cell::{Coded, ROW};
use super::layout::bytes;
use super::tables::Tables;
use std::arch::x86_64::*;

/// Signs of detail j at place q = hy + 2·hz of (y, z), for the lanes of a row: the lower half has x = 0.
#[repr(align(32))]
struct Signs([[[i16; 16]; 4]; 8]);

static SIGNS: Signs = Signs({
    let mut signs = [[[1; 16]; 4]; 8];
    let mut j = 0;
    while j < 8 {
        let mut q = 0;
        while q < 4 {
            let odd = (j >> 1 & q & 1) ^ (j & q >> 1 & 1);
            let mut lane = 0;
            while lane < 16 {
                let x = if lane < 8 { 0 } else { j >> 2 & 1 };
                if odd ^ x == 1 {
                    signs[j][q][lane] = -1;
                }
                lane += 1;
            }
            q += 1;
        }
        j += 1;
    }
    signs
});

/// Decodes a cell and hands its rows (y, z), by their numbers y + 4z, to `put`, packed to bytes; what lies behind the
/// twelfth does not matter. Quarters without a row in `rows` are left out.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
pub(super) fn colour_rows(cell: &Coded<'_>, tables: &Tables, rows: u16, mut put: impl FnMut(usize, [u8; ROW])) {
    let average = cell.average.map_or([0; 4], |index| tables.average_lanes[usize::from(index)]);
    let mut quarters = [_mm256_set1_epi64x(i64::from_ne_bytes(bytemuck::cast(average))); 4];
    let mut at = cell.details;
    let mut indices = u64::from_le_bytes(bytes(cell.payload, at)); // at most seven
    let mut map = cell.level_0;
    at += map.count_ones() as usize;
    while map != 0 {
        let j = map.leading_zeros();
        map ^= bits::detail_bit(j);
        let word = detail(tables, indices as u8);
        indices >>= 8;
        let signs = &SIGNS.0[j as usize & 7];
        for (quarter, signs) in quarters.iter_mut().zip(signs) {
            // SAFETY: 16 lanes are 32 bytes, aligned to as many.
            let signs = unsafe { _mm256_load_si256(signs.as_ptr().cast()) };
            *quarter = _mm256_add_epi16(*quarter, _mm256_sign_epi16(word, signs));
        }
    }
    let mut maps = cell.maps;
    for (q, &quarter) in quarters.iter().enumerate() {
        // Rows y = 2 (q & 1) and z = 2 (q >> 1) on.
        let first = (q & 1) * 2 + (q >> 1) * 8;
        let pair = cell.nodes << (2 * q);
        let wanted = rows >> first & 0b11_0011 != 0;
        if pair & 0xC0 == 0 {
            if wanted {
                let packed = pack(quarter);
                for row in [0, 1, 4, 5] {
                    put(first + row, packed);
                }
            }
            continue;
        }
        let mut halves = [[_mm_setzero_si128(); 4]; 2];
        for (x, half) in halves.iter_mut().enumerate() {
            if pair << x & 0x80 == 0 {
                continue;
            }
            let mut map = maps.next(cell.payload, (2 * q + x + 1) as u32);
            let mut indices = u64::from_le_bytes(bytes(cell.payload, at));
            at += map.count_ones() as usize;
            while map != 0 {
                let j = map.leading_zeros();
                map ^= bits::detail_bit(j);
                let word = _mm256_castsi256_si128(detail(tables, indices as u8));
                indices >>= 8;
                let signs = &SIGNS.0[j as usize & 7];
                for (sum, signs) in half.iter_mut().zip(signs) {
                    // Two voxels: the middle of the signs, where x changes.
                    // SAFETY: lanes 4 to 11 lie inside the sixteen.
                    let signs = unsafe { _mm_loadu_si128(signs.as_ptr().add(4).cast()) };
                    *sum = _mm_add_epi16(*sum, _mm_sign_epi16(word, signs));
                }
            }
        }
        if wanted {
            for (i, row) in [0, 1, 4, 5].into_iter().enumerate() {
                let sums = _mm256_set_m128i(halves[1][i], halves[0][i]);
                put(first + row, pack(_mm256_add_epi16(quarter, sums)));
            }
        }
    }
}

/// Details of a level-0 node that are added without asking whether they are there.
const UNASKED: u32 = 3;

/// Multipliers by the codes of `fast::SIGNS`, in four lanes: not there, not there, added, subtracted.
static FACTORS: [[i16; 4]; 4] = [[0; 4], [0; 4], [1; 4], [-1; 4]];

/// A voxel: its average and the details of both nodes that it lies in, clamped.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
pub(super) fn colour_sum(tables: &Tables, parts: &Parts) -> [u8; 3] {
    let lanes = |word: [i16; 4]| _mm_cvtsi64_si128(i64::from_ne_bytes(bytemuck::cast(word)));
    let mut sum = parts.average.map_or(_mm_setzero_si128(), |index| lanes(tables.average_lanes[usize::from(index)]));
    let add = |sum: &mut __m128i, indices: u64, signs: u16, k: u32| {
        let word = lanes(tables.detail_lanes[(indices >> (8 * k) & 0xFF) as usize]);
        let factor = lanes(FACTORS[usize::from(signs >> (2 * k) & 3)]);
        *sum = _mm_add_epi16(*sum, _mm_sign_epi16(word, factor));
    };
    let signs = |(map, place, _): (u8, u32, u64)| fast::SIGNS[place as usize & 7][usize::from(map & 0x7F)];
    let [level_0, level_1] = parts.nodes;
    let code = signs(level_0);
    (0..UNASKED).for_each(|k| add(&mut sum, level_0.2, code, k));
    (UNASKED..u32::from(level_0.0).count_ones()).for_each(|k| add(&mut sum, level_0.2, code, k));
    if level_1.0 != 0 {
        let code = signs(level_1);
        (0..u32::from(level_1.0).count_ones()).for_each(|k| add(&mut sum, level_1.2, code, k));
    }
    let bytes = _mm_cvtsi128_si32(_mm_packus_epi16(sum, sum)).to_le_bytes();
    [bytes[0], bytes[1], bytes[2]]
}

/// A word of the detail codebook in all four voxels of a row.
#[inline]
#[target_feature(enable = "avx2")]
fn detail(tables: &Tables, index: u8) -> __m256i {
    _mm256_set1_epi64x(i64::from_ne_bytes(bytemuck::cast(tables.detail_lanes[usize::from(index)])))
}

/// Four voxels, clamped, as twelve bytes.
#[inline]
#[target_feature(enable = "avx2")]
fn pack(row: __m256i) -> [u8; ROW] {
    let bytes = _mm_packus_epi16(_mm256_castsi256_si128(row), _mm256_extracti128_si256::<1>(row));
    let order = _mm_setr_epi8(0, 1, 2, 4, 5, 6, 8, 9, 10, 12, 13, 14, -1, -1, -1, -1);
    let mut out = [0u8; ROW];
    // SAFETY: as many bytes as the vector has.
    unsafe { _mm_storeu_si128(out.as_mut_ptr().cast(), _mm_shuffle_epi8(bytes, order)) };
    out
}
