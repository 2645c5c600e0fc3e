//! Codec `raw`: every sample as it is, little-endian, x fastest, then y, then z (spec chapter 7). Lossless.

use super::non_finite;
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::grid::{View, ViewMut};
use crate::voxel::{SampleType, SampleValue};

/// Number of the codec in the codec table.
pub const ID: u16 = 1;
/// Version of the payload's layout.
pub const STREAM_VERSION: u16 = 1;

/// Length of a payload in bytes. // spec: RAW-3
#[must_use]
pub(super) fn payload_len(t: SampleType, brick: Extent) -> u64 {
    brick.voxels().saturating_mul(t.bytes() as u64)
}

/// Appends the samples of `src`. The view has been checked.
pub(super) fn encode(src: View<'_>, out: &mut Vec<u8>) -> Result<()> {
    if super::first_non_finite(&src).is_some() {
        return Err(non_finite()); // spec: RAW-5
    }
    let row_bytes = src.extent.x as usize * src.sample_type.bytes();
    out.reserve(row_bytes * src.extent.y as usize * src.extent.z as usize);
    for z in 0..src.extent.z as usize {
        for y in 0..src.extent.y as usize {
            let start = y * src.row_pitch + z * src.slice_pitch;
            out.extend_from_slice(&src.bytes[start..start + row_bytes]);
            let at = out.len() - row_bytes;
            swap_if_big_endian(&mut out[at..], src.sample_type);
        }
    }
    Ok(())
}

/// Copies `region` of a brick, bit by bit. Lengths and region have been checked. // spec: RAW-6
pub(super) fn decode(payload: &[u8], brick: Extent, region: &Region, dst: ViewMut<'_>) {
    let size = dst.sample_type.bytes();
    let row_bytes = dst.extent.x as usize * size;
    let [x0, y0, z0] = region.start;
    for z in 0..dst.extent.z {
        for y in 0..dst.extent.y {
            let from = brick.index([x0, y0 + y, z0 + z]) as usize * size;
            let to = y as usize * dst.row_pitch + z as usize * dst.slice_pitch;
            let row = &mut dst.bytes[to..to + row_bytes];
            row.copy_from_slice(&payload[from..from + row_bytes]);
            swap_if_big_endian(row, dst.sample_type);
        }
    }
}

/// One voxel. Length and coordinate have been checked.
pub(super) fn voxel(payload: &[u8], t: SampleType, brick: Extent, c: Coord) -> SampleValue {
    let at = brick.index(c) as usize * t.bytes();
    let mut raw = [0; 4];
    raw[..t.bytes()].copy_from_slice(&payload[at..at + t.bytes()]);
    SampleValue::from_raw(t, u32::from_le_bytes(raw)).expect("bytes above the type's width are 0")
}

/// Strict validation; offsets are relative to the payload.
pub(super) fn check(payload: &[u8], t: SampleType) -> Result<()> {
    if t != SampleType::F32 {
        return Ok(());
    }
    let finite = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]).is_finite();
    match payload.chunks_exact(4).position(|b| !finite(b)) {
        // spec: RAW-5
        Some(i) => Err(Error::at(Code::NonFinite, i as u64 * 4, "raw.sample", "a stored sample is NaN or infinite")),
        None => Ok(()),
    }
}

/// Turns samples in the machine's order into little-endian ones, or back.
fn swap_if_big_endian(row: &mut [u8], t: SampleType) {
    let size = t.bytes() / t.components();
    if cfg!(target_endian = "big") && size > 1 {
        row.chunks_exact_mut(size).for_each(<[u8]>::reverse);
    }
}
