//! The fast decoders compiled for x86-64 machines with AVX2, BMI and POPCNT. Their twins are the portable ones.
#![allow(unsafe_code, reason = "calls of functions that need these instructions")]

use super::Zerobit;
use super::fast::{BrickReader, Parts, Portable, Sum};
use super::fast_avx2::{colour_rows, colour_sum};
use super::fast_avx512::colour_rows as wide_rows;
use super::fast_cell::{Coded, Kernel, PortableGrey, ROW};
use super::fast_region::Isa;
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
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vbmi2,avx2,bmi1,bmi2,popcnt,lzcnt")]
    fn wide<T: Sample>(reader: &BrickReader<'_>, c: Coord, out: &mut [T; 64], token: V4) {
        reader.cell_with(&WideCells(reader.frame.tables, token), c, out);
    }
    if let Some(token) = reader.frame.v4.filter(|_| T::TYPE == SampleType::Rgb8) {
        // SAFETY: the token proves the instructions.
        return unsafe { wide(reader, c, out, token) };
    }
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
pub(super) fn decode(
    _: V3,
    codec: &Zerobit,
    parts: &[BrickPart<'_>],
    dst: ViewMut<'_>,
    stores: Stores,
    isa: Option<Isa>,
) -> Result<()> {
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
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vbmi2,avx2,bmi1,bmi2,popcnt,lzcnt")]
    fn wide(codec: &Zerobit, parts: &[BrickPart<'_>], dst: ViewMut<'_>, stores: Stores, token: V4) -> Result<()> {
        let copy = |to: &mut [u8], from: &[u8]| match stores {
            Stores::Cached => to.copy_from_slice(from),
            Stores::Streaming => stream(to, from),
        };
        decode_with(codec, |tables| WideCells(tables, token), parts, dst, copy)
    }
    // SAFETY: the tokens prove the instructions. Streaming stores become visible in order with what follows.
    unsafe {
        let done = match V4::detect() {
            Some(token) if isa != Some(Isa::Avx2) && dst.sample_type == SampleType::Rgb8 => {
                wide(codec, parts, dst, stores, token)
            }
            _ => inner(codec, parts, dst, stores),
        };
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

/// Proof that this machine has the instructions of AVX-512 that decode cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct V4(());

impl V4 {
    /// The proof, if there is one.
    #[inline]
    pub(super) fn detect() -> Option<V4> {
        use std::arch::is_x86_feature_detected as has;
        let bytes = has!("avx512vbmi") && has!("avx512vbmi2");
        (V3::detect().is_some() && has!("avx512f") && has!("avx512bw") && has!("avx512vl") && bytes).then_some(V4(()))
    }
}

/// Cells of colours with AVX-512.
#[derive(Clone, Copy)]
struct WideCells<'a>(&'a Tables, #[allow(dead_code, reason = "proves the instructions")] V4);

impl Kernel for WideCells<'_> {
    #[inline(always)]
    fn rows(&self, cell: &Coded<'_>, rows: u16, put: impl FnMut(usize, [u8; ROW])) {
        // A cell without level-1 details has four distinct rows: less work than all of it at once.
        // SAFETY: the token proves the instructions.
        unsafe { if cell.nodes == 0 { colour_rows(cell, self.0, rows, put) } else { wide_rows(cell, self.0, put) } }
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
