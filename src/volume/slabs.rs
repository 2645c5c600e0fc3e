//! Walking a source brick layer by brick layer: the one loop behind analysis and encoding.

use super::brick_encoder::non_finite_error;
use super::lod::read_lod_slab;
use crate::codec::first_non_finite;
use crate::error::{Code, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::grid::{AlignedBytes, SlabReader, View, dense_len};
use crate::voxel::SampleValue;
use rayon::prelude::*;
use std::ops::Range;

/// Bricks that are worked on at a time, per thread: bounds the payloads that wait to be written.
const PER_THREAD: usize = 4;
/// Bytes of samples that are worked on at a time, per thread, where bricks are large. At least one brick.
const BYTES_PER_THREAD: usize = 16 << 20;

/// Runs `work` on every brick of level `lod` in parallel and `take` on the results, in order: z, y, x, x fastest.
///
/// Holds one slab of bricks (none, where the source lies in memory and `lod` is 0) and the results of a few bricks per
/// thread.
///
/// # Errors
/// The first error in brick order, whatever the number of threads; nothing is taken after it.
pub(super) fn for_each_brick<R: Send>(
    reader: &mut dyn SlabReader,
    lod: u8,
    brick_log2: u8,
    null: SampleValue,
    work: impl Fn(Coord, View<'_>) -> Result<R> + Sync,
    take: impl FnMut(Coord, R) -> Result<()>,
) -> Result<()> {
    for_each_brick_in(reader, lod, brick_log2, null, None, work, take)
}

/// As [`for_each_brick`], for these layers of bricks along z only; `None`: all.
pub(super) fn for_each_brick_in<R: Send>(
    reader: &mut dyn SlabReader,
    lod: u8,
    brick_log2: u8,
    null: SampleValue,
    layers: Option<Range<u32>>,
    work: impl Fn(Coord, View<'_>) -> Result<R> + Sync,
    mut take: impl FnMut(Coord, R) -> Result<()>,
) -> Result<()> {
    let t = reader.sample_type();
    let extent = reader.extent().at_lod(lod);
    let edge = 1u32 << brick_log2;
    let bricks = extent.div_ceil(Extent::cube(edge));
    let mut buffer = if lod == 0 && reader.as_view().is_some() {
        None
    } else {
        Some(AlignedBytes::zeroed(dense_len(Extent { z: edge.min(extent.z), ..extent }, t)?)?)
    };
    let brick_bytes = dense_len(Extent::cube(edge).min(extent), t)?;
    let per_thread = (BYTES_PER_THREAD / brick_bytes).clamp(1, PER_THREAD);
    for bz in layers.unwrap_or(0..bricks.z) {
        let z = bz * edge..((bz + 1) * edge).min(extent.z);
        let slab_extent = Extent { z: z.end - z.start, ..extent };
        let slab = match &mut buffer {
            None => {
                let region = Region { start: [0, 0, z.start], end: [extent.x, extent.y, z.end] };
                reader.as_view().expect("asked above").sub(&region)
            }
            Some(buffer) => {
                let bytes = &mut buffer.as_mut_slice()[..dense_len(slab_extent, t)?];
                read_lod_slab(reader, lod, z, null, bytes)?;
                View::dense(bytes, slab_extent, t)
            }
        };
        let layer: Vec<Coord> = (0..bricks.y).flat_map(|y| (0..bricks.x).map(move |x| [x, y, bz])).collect();
        for group in layer.chunks(per_thread * rayon::current_num_threads()) {
            let results: Vec<Result<R>> = group
                .par_iter()
                .map(|&brick| {
                    let start = [brick[0] * edge, brick[1] * edge, 0];
                    let region = Region::at(start, Extent::cube(edge)).intersect(&Region::whole(slab_extent));
                    work(brick, slab.sub(&region))
                })
                .collect();
            for (&brick, result) in group.iter().zip(results) {
                let result = result.map_err(|e| match (e.code(), first_non_finite(&slab)) {
                    // A brick knows neither where it lies, nor whether another one has an earlier sample of the kind.
                    (Code::NonFinite, Some([x, y, dz])) => {
                        non_finite_error(slab.row::<f32>(y, dz)[x as usize], [x, y, bz * edge + dz])
                    }
                    _ => e,
                })?;
                take(brick, result)?;
            }
        }
    }
    Ok(())
}
