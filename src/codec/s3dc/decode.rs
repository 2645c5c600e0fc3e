//! Plain scalar decoding: a transcription of the spec (chapter 8, §5), and the choice of a faster path.

use super::fast::{self, Isa, Job, Piece};
use super::{Layout, Params, Scalar, with_scalar};
use crate::codec::{BrickPart, Codec, Stores};
use crate::error::Result;
use crate::geometry::Region;
use crate::grid::ViewMut;
use crate::voxel::SampleType;

/// Decodes pieces by the fastest path of this machine. Lengths, regions and view have been checked.
pub fn decode(pieces: &[Piece<'_>], dst: ViewMut<'_>, stores: Stores) {
    if let Err(job) = fast::decode(Job { pieces, dst, stores }) {
        let mut dst = job.dst;
        for Piece { layout, payload, region, x } in pieces {
            decode_plain(layout, payload, region, dst.sub(&Region::at([*x, 0, 0], region.extent())));
        }
    }
}

/// Decodes on one instruction set, whatever the size: for tests and benches. `false` where the machine does not have it.
///
/// # Errors
/// As [`Codec::decode_run`].
#[doc(hidden)]
pub fn decode_on(
    isa: Isa,
    params: &Params,
    bricks: &[BrickPart<'_>],
    dst: ViewMut<'_>,
    stores: Stores,
) -> Result<bool> {
    Codec::S3dc(*params).check_run(bricks, &dst)?;
    let pieces = pieces(params, bricks, dst.sample_type);
    Ok(fast::decode_on(isa, Job { pieces: &pieces, dst, stores }).is_ok())
}

/// The pieces of bricks that lie side by side.
pub fn pieces<'a>(params: &Params, bricks: &[BrickPart<'a>], t: SampleType) -> Vec<Piece<'a>> {
    let mut at = 0;
    let piece = |b: &BrickPart<'a>| {
        let x = at;
        at += b.region.extent().x;
        Piece { layout: Layout::new(params, t, b.brick), payload: b.payload, region: b.region, x }
    };
    bricks.iter().map(piece).collect()
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
