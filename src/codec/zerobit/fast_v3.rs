//! The fast decoders compiled for x86-64 machines with AVX2, BMI and POPCNT. Their twins are the portable ones.
#![allow(unsafe_code, reason = "calls of functions that need these instructions")]

use super::Zerobit;
use super::fast::BrickReader;
use super::fast_avx2::colour_rows;
use super::fast_cell::{Coded, Kernel, PortableGrey, ROW};
use super::fast_region::decode_with;
use super::tables::Tables;
use crate::codec::BrickPart;
use crate::error::Result;
use crate::geometry::Coord;
use crate::grid::ViewMut;
use crate::voxel::{Sample, SampleType};

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
        match T::TYPE {
            SampleType::Rgb8 => reader.cell_with(&VectorColour(reader.tables, V3(())), c, out),
            t => reader.cell_with(&PortableGrey(reader.tables, t), c, out),
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
            SampleType::Rgb8 => reader.plane_with(&VectorColour(reader.tables, V3(())), axis, c, out),
            t => reader.plane_with(&PortableGrey(reader.tables, t), axis, c, out),
        }
    }
    // SAFETY: the token proves the instructions.
    unsafe { inner(reader, axis, c, out) }
}

/// Decodes a part of a brick.
pub(super) fn decode(_: V3, codec: &Zerobit, part: &BrickPart<'_>, dst: ViewMut<'_>) -> Result<()> {
    #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
    fn inner(codec: &Zerobit, tables: &Tables, part: &BrickPart<'_>, dst: ViewMut<'_>) {
        match dst.sample_type {
            SampleType::Rgb8 => decode_with(codec, VectorColour(tables, V3(())), part, dst),
            t => decode_with(codec, PortableGrey(tables, t), part, dst),
        }
    }
    let tables = &codec.book(part.payload)?.tables;
    // SAFETY: the token proves the instructions.
    unsafe { inner(codec, tables, part, dst) }
    Ok(())
}

/// Colours with AVX2.
#[derive(Clone, Copy)]
struct VectorColour<'a>(&'a Tables, #[allow(dead_code, reason = "proves the instructions")] V3);

impl Kernel for VectorColour<'_> {
    #[inline(always)]
    fn rows(&self, cell: &Coded<'_>, rows: u16, put: impl FnMut(usize, [u8; ROW])) {
        // SAFETY: the token proves the instructions.
        unsafe { colour_rows(cell, self.0, rows, put) }
    }
}
