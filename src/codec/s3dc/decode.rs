//! Plain scalar decoding: a transcription of the spec (chapter 8, §5), and the choice of a faster path.

use super::{Layout, Scalar, with_scalar};
use crate::codec::Stores;
use crate::geometry::Region;
use crate::grid::ViewMut;

/// Decodes `region` by the fastest path of this machine. Lengths, region and view have been checked.
pub fn decode(layout: &Layout, payload: &[u8], region: &Region, dst: ViewMut<'_>, stores: Stores) {
    let _ = stores;
    decode_plain(layout, payload, region, dst);
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
