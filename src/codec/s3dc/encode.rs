//! Plain scalar encoding (spec chapter 8, §6): end points of every block, then the index of every voxel.

use super::{Layout, Params, Scalar, with_scalar};
use crate::codec::non_finite;
use crate::error::Result;
use crate::geometry::{Coord, Region};
use crate::grid::View;

/// Appends the payload of a brick. The view has been checked.
///
/// # Errors
/// `E_NONFINITE`.
pub fn encode(params: &Params, src: View<'_>, out: &mut Vec<u8>) -> Result<()> {
    let layout = Layout::new(params, src.sample_type, src.extent);
    with_scalar!(src.sample_type, T => encode_plain_as::<T>(&layout, src, out), else Ok(()))
}

fn encode_plain_as<T: Scalar>(layout: &Layout, src: View<'_>, out: &mut Vec<u8>) -> Result<()> {
    let base = out.len();
    let blocks = layout.blocks();
    for z in 0..blocks.z {
        for y in 0..blocks.y {
            for x in 0..blocks.x {
                let (min, max) = min_max::<T>(src, &block_region(layout, [x, y, z])).ok_or_else(non_finite)?;
                min.push_le(out);
                max.push_le(out);
            }
        }
    }
    out.resize(base + layout.payload_len(), 0); // spec: S3D-8
    let payload = &mut out[base..];
    let i = u32::from(layout.params().i_bits());
    for z in 0..src.extent.z {
        for y in 0..src.extent.y {
            let row_at = layout.row_at(y, z);
            for x in 0..src.extent.x {
                let (min, max) = layout.mmv_pair::<T>(payload, layout.block_of([x, y, z]));
                let idx = sample::<T>(&src, [x, y, z]).stored().index(min, max, layout.params().q());
                let n = layout.indices_per_word();
                let at = row_at + 2 * (x / n) as usize;
                let word = u16::from_le_bytes([payload[at], payload[at + 1]]) | (idx << (i * (x % n))) as u16;
                payload[at..at + 2].copy_from_slice(&word.to_le_bytes());
            }
        }
    }
    Ok(())
}

/// The voxels of a block that lie inside the brick. // spec: S3D-7
pub fn block_region(layout: &Layout, block: Coord) -> Region {
    let edge = layout.params().block().to_array();
    let start = std::array::from_fn(|a| block[a] * edge[a]);
    Region::at(start, layout.params().block()).intersect(&Region::whole(layout.brick()))
}

/// Sample at `c`, whatever its alignment.
#[inline]
pub fn sample<T: Scalar>(src: &View<'_>, c: Coord) -> T {
    let [x, y, z] = c.map(|v| v as usize);
    let at = x * T::BYTES + y * src.row_pitch + z * src.slice_pitch;
    bytemuck::pod_read_unaligned(&src.bytes[at..at + T::BYTES])
}

/// Smallest and largest sample of a box; `None` where one is not finite. // spec: S3D-13, S3D-14, S3D-17
fn min_max<T: Scalar>(src: View<'_>, region: &Region) -> Option<(T, T)> {
    let mut range: Option<(T, T)> = None;
    for z in region.start[2]..region.end[2] {
        for y in region.start[1]..region.end[1] {
            for x in region.start[0]..region.end[0] {
                let v = sample::<T>(&src, [x, y, z]).stored();
                if !v.is_storable() {
                    return None;
                }
                range =
                    Some(range.map_or((v, v), |(lo, hi)| (if v < lo { v } else { lo }, if v > hi { v } else { hi })));
            }
        }
    }
    range
}
