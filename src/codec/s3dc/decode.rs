//! Plain scalar decoding: a transcription of the spec (chapter 8, §5), and the choice of a faster path.

use super::fast::{self, Isa, Job};
use super::{Layout, Params, Scalar, with_scalar};
use crate::codec::{Codec, Stores};
use crate::error::Result;
use crate::geometry::{Extent, Region};
use crate::grid::ViewMut;

/// Decodes `region` by the fastest path of this machine. Lengths, region and view have been checked.
pub fn decode(layout: &Layout, payload: &[u8], region: &Region, dst: ViewMut<'_>, stores: Stores) {
    if let Err(job) = fast::decode(Job { layout, payload, region, dst, stores }) {
        decode_plain(job.layout, job.payload, job.region, job.dst);
    }
}

/// Decodes on one instruction set, whatever the size: for tests and benches. `false` where the machine does not have it.
///
/// # Errors
/// As [`Codec::decode`](crate::codec::Codec::decode).
#[doc(hidden)]
pub fn decode_on(
    isa: Isa,
    params: &Params,
    payload: &[u8],
    brick: Extent,
    region: &Region,
    dst: ViewMut<'_>,
    stores: Stores,
) -> Result<bool> {
    Codec::S3dc(*params).check_decode(payload, brick, region, &dst)?;
    let layout = Layout::new(params, dst.sample_type, brick);
    Ok(fast::decode_on(isa, Job { layout: &layout, payload, region, dst, stores }).is_ok())
}

/// Decodes `region` voxel by voxel. Lengths, region and view have been checked.
pub fn decode_plain(layout: &Layout, payload: &[u8], region: &Region, dst: ViewMut<'_>) {
    with_scalar!(dst.sample_type, T => decode_plain_as::<T>(layout, payload, region, dst), else ());
}

fn decode_plain_as<T: Scalar>(layout: &Layout, payload: &[u8], region: &Region, dst: ViewMut<'_>) {
    let [x0, y0, z0] = region.start;
    let row_bytes = dst.extent.x as usize * T::BYTES;
    for z in z0..region.end[2] {
        for y in y0..region.end[1] {
            let start = (y - y0) as usize * dst.row_pitch + (z - z0) as usize * dst.slice_pitch;
            let row = &mut dst.bytes[start..start + row_bytes];
            for (x, sample) in (x0..).zip(row.chunks_exact_mut(T::BYTES)) {
                let value: T = layout.voxel(payload, [x, y, z]);
                sample.copy_from_slice(bytemuck::bytes_of(&value));
            }
        }
    }
}
