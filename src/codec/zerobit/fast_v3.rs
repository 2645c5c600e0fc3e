//! The fast decoders compiled for x86-64 machines with AVX2, BMI and POPCNT. Their twins are the portable ones.
#![allow(unsafe_code, reason = "calls of functions that need these instructions")]

use super::Zerobit;
use super::fast::{BrickReader, Parts, Portable, Sum};
use super::fast_avx2::{colour_rows, colour_sum};
use super::fast_cell::{Coded, Kernel, PortableGrey, ROW};
use super::fast_region::decode_with;
use super::tables::Tables;
use crate::codec::{BrickPart, Stores};
use crate::error::Result;
use crate::geometry::Coord;
use crate::grid::ViewMut;
use crate::voxel::{Sample, SampleType, same};
use std::arch::x86_64::{_mm_sfence, _mm256_loadu_si256, _mm256_stream_si256};

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
        match T::TYPE {
            SampleType::Rgb8 => same(reader.single_with::<[u8; 3]>(c, &VectorColour)),
            _ => reader.single_with(c, &Portable),
        }
    }
    // SAFETY: the token proves the instructions.
    unsafe { inner(reader, c) }
}

/// Voxels of several bricks.
pub(super) fn voxels<T: Sample>(_: V3, readers: &[BrickReader<'_>], coords: &[Coord], out: &mut [T]) {
    #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
    fn inner<T: Sample>(readers: &[BrickReader<'_>], coords: &[Coord], out: &mut [T]) {
        match T::TYPE {
            SampleType::Rgb8 => {
                let out: &mut [[u8; 3]] = bytemuck::cast_slice_mut(out);
                BrickReader::voxels_with(readers, coords, out, &VectorColour);
            }
            _ => BrickReader::voxels_with(readers, coords, out, &Portable),
        }
    }
    // SAFETY: the token proves the instructions.
    unsafe { inner(readers, coords, out) }
}

/// A cell of a brick.
#[inline(always)]
pub(super) fn cell<T: Sample>(_: V3, reader: &BrickReader<'_>, c: Coord, out: &mut [T; 64]) {
    #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
    fn inner<T: Sample>(reader: &BrickReader<'_>, c: Coord, out: &mut [T; 64]) {
        match T::TYPE {
            SampleType::Rgb8 => reader.cell_with(&VectorCells(reader.frame.tables, V3(())), c, out),
            t => reader.cell_with(&PortableGrey(reader.frame.tables, t), c, out),
        }
    }
    // SAFETY: the token proves the instructions.
    unsafe { inner(reader, c, out) }
}

/// A plane of a cell of a brick.
#[inline(always)]
pub(super) fn plane<T: Sample>(_: V3, reader: &BrickReader<'_>, axis: usize, c: Coord, out: &mut [T; 16]) {
    #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
    fn inner<T: Sample>(reader: &BrickReader<'_>, axis: usize, c: Coord, out: &mut [T; 16]) {
        match T::TYPE {
            SampleType::Rgb8 => reader.plane_with(&VectorCells(reader.frame.tables, V3(())), axis, c, out),
            t => reader.plane_with(&PortableGrey(reader.frame.tables, t), axis, c, out),
        }
    }
    // SAFETY: the token proves the instructions.
    unsafe { inner(reader, axis, c, out) }
}

/// Decodes parts of bricks that lie side by side.
pub(super) fn decode(_: V3, codec: &Zerobit, parts: &[BrickPart<'_>], dst: ViewMut<'_>, stores: Stores) -> Result<()> {
    #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
    fn inner(codec: &Zerobit, parts: &[BrickPart<'_>], dst: ViewMut<'_>, stores: Stores) -> Result<()> {
        let t = dst.sample_type;
        let copy = |to: &mut [u8], from: &[u8]| match stores {
            Stores::Cached => to.copy_from_slice(from),
            Stores::Streaming => stream(to, from),
        };
        if t == SampleType::Rgb8 {
            decode_with(codec, |tables| VectorCells(tables, V3(())), parts, dst, copy)
        } else {
            decode_with(codec, |tables| PortableGrey(tables, t), parts, dst, copy)
        }
    }
    // SAFETY: the token proves the instructions. Streaming stores become visible in order with what follows.
    unsafe {
        let done = inner(codec, parts, dst, stores);
        if stores == Stores::Streaming {
            _mm_sfence();
        }
        done
    }
}

/// Copies past the caches where the destination lies on a vector's boundary.
#[inline]
#[target_feature(enable = "avx2")]
fn stream(to: &mut [u8], from: &[u8]) {
    const STEP: usize = 32;
    if !to.as_ptr().addr().is_multiple_of(STEP) {
        return to.copy_from_slice(from);
    }
    let whole = to.len() / STEP * STEP;
    for (to, from) in to[..whole].chunks_exact_mut(STEP).zip(from.chunks_exact(STEP)) {
        // SAFETY: both are 32 bytes long; the destination is aligned, since it started so and moves by 32.
        unsafe { _mm256_stream_si256(to.as_mut_ptr().cast(), _mm256_loadu_si256(from.as_ptr().cast())) }
    }
    to[whole..].copy_from_slice(&from[whole..]);
}

/// Voxels of colours with AVX2; only functions that have the instructions make one.
struct VectorColour;

impl Sum<[u8; 3]> for VectorColour {
    #[inline(always)]
    fn sum(&self, tables: &Tables, parts: &Parts) -> [u8; 3] {
        // SAFETY: the functions that use it have been entered with the token.
        unsafe { colour_sum(tables, parts) }
    }
}

/// Cells of colours with AVX2.
#[derive(Clone, Copy)]
struct VectorCells<'a>(&'a Tables, #[allow(dead_code, reason = "proves the instructions")] V3);

impl Kernel for VectorCells<'_> {
    #[inline(always)]
    fn rows(&self, cell: &Coded<'_>, rows: u16, put: impl FnMut(usize, [u8; ROW])) {
        // SAFETY: the token proves the instructions.
        unsafe { colour_rows(cell, self.0, rows, put) }
    }
}
