//! Strict validation of a payload (spec chapter 8, §7): what a writer must have done and a reader need not look at.

use super::encode::block_region;
use super::{Layout, Scalar, with_scalar};
use crate::error::{Code, Error, Result};

/// Checks a payload of the right length, in the order of the chapter. Offsets are relative to the payload.
// spec: S3D-19
///
/// # Errors
/// `E_NONFINITE`, `E_MINMAX_ORDER`, `E_CANON`, `E_PADDING`.
pub fn check(layout: &Layout, payload: &[u8]) -> Result<()> {
    with_scalar!(layout.sample_type(), T => check_as::<T>(layout, payload), else Ok(()))
}

fn check_as<T: Scalar>(layout: &Layout, payload: &[u8]) -> Result<()> {
    // spec: S3D-8
    let pad = &payload[layout.mmv_bytes()..layout.iv_start()];
    if let Some(i) = pad.iter().position(|&b| b != 0) {
        return Err(Error::at(
            Code::Padding,
            (layout.mmv_bytes() + i) as u64,
            "s3dc.padding",
            "a byte between end points and indices is not 0",
        ));
    }
    let blocks = layout.blocks();
    for z in 0..blocks.z {
        for y in 0..blocks.y {
            for x in 0..blocks.x {
                check_block::<T>(layout, payload, [x, y, z])?;
            }
        }
    }
    check_spare_bits(layout, payload)
}

fn check_block<T: Scalar>(layout: &Layout, payload: &[u8], block: [u32; 3]) -> Result<()> {
    let at = layout.mmv_at(block);
    let fail = |code, message: String| Err(Error::at(code, at as u64, "s3dc.mmv", message));
    let pair = &payload[at..at + 2 * T::BYTES];
    let (min, max) = (T::from_le(pair), T::from_le(&pair[T::BYTES..]));
    let place = || format!("block {block:?} (x, y, z)");
    if !min.is_storable() || !max.is_storable() {
        return fail(Code::NonFinite, format!("{}: an end point is NaN or infinite", place())); // spec: S3D-14
    }
    if min > max {
        return fail(Code::MinmaxOrder, format!("{}: min {min:?} is above max {max:?}", place())); // spec: S3D-15
    }
    // spec: S3D-13
    if bytemuck::bytes_of(&min) != bytemuck::bytes_of(&min.stored())
        || bytemuck::bytes_of(&max) != bytemuck::bytes_of(&max.stored())
    {
        return fail(Code::Canon, format!("{}: an end point is -0.0; it must be stored as +0.0", place()));
    }
    if min == max {
        check_constant(layout, payload, block)?;
    }
    Ok(())
}

/// All indices of a block with equal end points are 0. // spec: S3D-16
fn check_constant(layout: &Layout, payload: &[u8], block: [u32; 3]) -> Result<()> {
    let region = block_region(layout, block);
    for z in region.start[2]..region.end[2] {
        for y in region.start[1]..region.end[1] {
            for x in region.start[0]..region.end[0] {
                if layout.index_at(payload, [x, y, z]) != 0 {
                    let at = layout.row_at(y, z) + 2 * (x / layout.indices_per_word()) as usize;
                    return Err(Error::at(
                        Code::Canon,
                        at as u64,
                        "s3dc.iv",
                        format!("voxel {:?} of a constant block has an index that is not 0", [x, y, z]),
                    ));
                }
            }
        }
    }
    Ok(())
}

/// The bits of the last word of a row that belong to no voxel are 0. // spec: S3D-9
fn check_spare_bits(layout: &Layout, payload: &[u8]) -> Result<()> {
    let used = layout.brick().x % layout.indices_per_word() * u32::from(layout.params().i_bits());
    if used == 0 {
        return Ok(());
    }
    for z in 0..layout.brick().z {
        for y in 0..layout.brick().y {
            let at = layout.row_at(y, z) + 2 * (layout.row_words() - 1);
            if u16::from_le_bytes([payload[at], payload[at + 1]]) >> used != 0 {
                return Err(Error::at(
                    Code::Padding,
                    at as u64,
                    "s3dc.iv",
                    format!("a bit behind the last index of row y {y}, z {z} is not 0"),
                ));
            }
        }
    }
    Ok(())
}
