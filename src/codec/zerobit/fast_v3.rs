//! The fast decoders compiled for x86-64 machines with AVX2, BMI and POPCNT. Their twins are the portable ones.
#![allow(unsafe_code, reason = "calls of functions that need these instructions, and the intrinsics that pack colours")]

use super::Zerobit;
use super::fast::BrickReader;
use super::fast_region::{Pack, decode_colour, decode_grey};
use crate::codec::BrickPart;
use crate::error::Result;
use crate::geometry::Coord;
use crate::grid::ViewMut;
use crate::voxel::{Sample, SampleType};
use std::arch::x86_64::*;

/// Proof that this machine has the instructions of x86-64-v3 that are used here.
#[derive(Clone, Copy, Debug)]
pub(super) struct V3(());

impl V3 {
    /// The proof, if there is one.
    #[inline]
    pub(super) fn detect() -> Option<V3> {
        use std::arch::is_x86_feature_detected as has;
        (has!("avx2") && has!("bmi1") && has!("bmi2") && has!("popcnt") && has!("lzcnt")).then_some(V3(()))
    }
}

/// One voxel of a brick.
#[inline(always)]
pub(super) fn voxel<T: Sample>(_: V3, reader: &BrickReader<'_>, c: Coord) -> T {
    #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
    fn inner<T: Sample>(reader: &BrickReader<'_>, c: Coord) -> T {
        reader.voxel_portable(c)
    }
    // SAFETY: the token proves the instructions.
    unsafe { inner(reader, c) }
}

/// Voxels of several bricks.
pub(super) fn voxels<T: Sample>(_: V3, readers: &[BrickReader<'_>], coords: &[Coord], out: &mut [T]) {
    #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
    fn inner<T: Sample>(readers: &[BrickReader<'_>], coords: &[Coord], out: &mut [T]) {
        BrickReader::voxels_portable(readers, coords, out);
    }
    // SAFETY: the token proves the instructions.
    unsafe { inner(readers, coords, out) }
}

/// A cell of a brick.
#[inline(always)]
pub(super) fn cell<T: Sample>(_: V3, reader: &BrickReader<'_>, c: Coord, out: &mut [T; 64]) {
    #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
    fn inner<T: Sample>(reader: &BrickReader<'_>, c: Coord, out: &mut [T; 64]) {
        reader.cell_portable(c, VectorColour(V3(())), out);
    }
    // SAFETY: the token proves the instructions.
    unsafe { inner(reader, c, out) }
}

/// A plane of a cell of a brick.
#[inline(always)]
pub(super) fn plane<T: Sample>(_: V3, reader: &BrickReader<'_>, axis: usize, c: Coord, out: &mut [T; 16]) {
    #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
    fn inner<T: Sample>(reader: &BrickReader<'_>, axis: usize, c: Coord, out: &mut [T; 16]) {
        reader.plane_portable(axis, c, VectorColour(V3(())), out);
    }
    // SAFETY: the token proves the instructions.
    unsafe { inner(reader, axis, c, out) }
}

/// Decodes a part of a brick.
pub(super) fn decode(_: V3, codec: &Zerobit, part: &BrickPart<'_>, dst: ViewMut<'_>) -> Result<()> {
    // SAFETY: the token proves the instructions.
    unsafe { if dst.sample_type == SampleType::Rgb8 { colour(codec, part, dst) } else { grey(codec, part, dst) } }
}

#[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
fn colour(codec: &Zerobit, part: &BrickPart<'_>, dst: ViewMut<'_>) -> Result<()> {
    decode_colour(codec, part, dst, VectorColour(V3(())))
}

#[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
fn grey(codec: &Zerobit, part: &BrickPart<'_>, dst: ViewMut<'_>) -> Result<()> {
    decode_grey(codec, part, dst)
}

/// Colours by a saturating pack and a byte shuffle.
#[derive(Clone, Copy)]
struct VectorColour(#[allow(dead_code, reason = "proves the instructions")] V3);

impl Pack<i16, 16> for VectorColour {
    #[inline(always)]
    fn pack(self, row: &[i16; 16]) -> [u8; 16] {
        // SAFETY: the token proves the instructions; both loads lie inside the row, the store inside `out`.
        unsafe {
            let low = _mm_loadu_si128(row.as_ptr().cast());
            let high = _mm_loadu_si128(row.as_ptr().add(8).cast());
            let bytes = _mm_packus_epi16(low, high);
            let order = _mm_setr_epi8(0, 1, 2, 4, 5, 6, 8, 9, 10, 12, 13, 14, -1, -1, -1, -1);
            let mut out = [0u8; 16];
            _mm_storeu_si128(out.as_mut_ptr().cast(), _mm_shuffle_epi8(bytes, order));
            out
        }
    }
}
