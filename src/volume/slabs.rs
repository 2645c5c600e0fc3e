//! Walking a source brick layer by brick layer, all levels in one pass: the one loop behind analysis and encoding.

use super::At;
use super::brick_encoder::non_finite_error;
use super::pass::Pass;
use crate::codec::first_non_finite;
use crate::container::Downsample;
use crate::error::{Code, Result};
use crate::geometry::{Coord, Extent, Region};
use crate::grid::{SlabReader, View, dense_len};
use crate::voxel::{SampleType, SampleValue};
use rayon::prelude::*;
use std::ops::Range;
use std::path::PathBuf;

/// Bricks that are worked on at a time, per thread, at most: few bound the payloads that wait to be written, many keep all
/// threads busy although bricks differ in what they cost.
const PER_THREAD: usize = 16;
/// Bytes of samples that are worked on at a time, per thread, at most. At least one brick.
const BYTES_PER_THREAD: u64 = 16 << 20;
/// Where memory is short: one part in this many for each thread.
const MEMORY_PART: u64 = 64;

/// What is encoded: a volume or a series, and how its levels are made.
pub(super) struct Source<'a> {
    pub(super) reader: &'a mut dyn SlabReader,
    pub(super) null: SampleValue,
    pub(super) downsample: Downsample,
    /// Bytes that slabs may take.
    pub(super) memory: u64,
    pub(super) temp_dir: Option<PathBuf>,
    /// Whether slabs had to go to temporary files.
    pub(super) spooled: bool,
}

/// A part of a walk.
#[derive(Clone, Debug)]
pub(super) struct Walk {
    pub(super) brick_log2: u8,
    /// Levels that are visited.
    pub(super) levels: Range<u8>,
    /// Layers of bricks along z that are visited; only where `levels` is a single one. `None`: all.
    pub(super) layers: Option<Range<u32>>,
}

impl Walk {
    /// All layers of some levels.
    pub(super) const fn levels(brick_log2: u8, levels: Range<u8>) -> Self {
        Walk { brick_log2, levels, layers: None }
    }
}

/// A brick that is visited.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) at: At,
    pub(super) brick: Coord,
}

impl Source<'_> {
    pub(super) fn extent(&self) -> Extent {
        self.reader.extent()
    }

    pub(super) fn sample_type(&self) -> SampleType {
        self.reader.sample_type()
    }

    /// Time steps × channels.
    pub(super) fn trees(&self) -> u32 {
        let (times, channels) = self.reader.series();
        times.saturating_mul(channels)
    }

    /// Voxels of level 0, of all time steps and channels.
    pub(super) fn voxels(&self) -> u64 {
        self.extent().voxels().saturating_mul(u64::from(self.trees()))
    }

    /// Runs `work` on every brick of the walk in parallel and `take` on the results, in order: by time step, channel and
    /// layer of level 0; in it z, y, x, x fastest; then the layers of coarser levels that are complete, finest first.
    /// The order does not depend on threads and memory.
    ///
    /// Holds one slab of bricks of each level (none of level 0, where the source lies in memory) and the results of a few
    /// bricks per thread; less where memory is short.
    ///
    /// # Errors
    /// The first error in brick order, whatever the number of threads; nothing is taken after it. `E_LIMIT` where not
    /// even a row of bricks fits in memory.
    pub(super) fn for_each_brick<R: Send>(
        &mut self,
        walk: &Walk,
        work: impl Fn(Place, View<'_>) -> Result<R> + Sync,
        mut take: impl FnMut(Place, R) -> Result<()>,
    ) -> Result<()> {
        let (times, channels) = self.reader.series();
        for time in 0..times {
            for channel in 0..channels {
                self.reader.turn_to(time, channel)?;
                let pass = Pass::new(self, walk, At { time, channel, lod: 0 })?;
                pass.run(self, walk, &work, &mut take)?;
            }
        }
        Ok(())
    }
}

/// How many bricks a thread works on at a time, where they hold this many bytes of samples each.
pub(super) fn bricks_per_thread(brick_bytes: usize, memory: u64) -> usize {
    let bytes = BYTES_PER_THREAD.min(memory / MEMORY_PART);
    usize::try_from(bytes / brick_bytes as u64).unwrap_or(usize::MAX).clamp(1, PER_THREAD)
}

/// Works on all bricks of `view`, which starts at row `start[0]` and plane `start[1]` of its level and at brick borders.
pub(super) fn bricks<R: Send>(
    at: At,
    edge: u32,
    memory: u64,
    view: &View<'_>,
    start: [u32; 2],
    work: &(impl Fn(Place, View<'_>) -> Result<R> + Sync),
    take: &mut impl FnMut(Place, R) -> Result<()>,
) -> Result<()> {
    let e = view.extent;
    let across = e.div_ceil(Extent::cube(edge));
    let brick_bytes = dense_len(Extent::cube(edge).min(e), view.sample_type)?;
    let local: Vec<[u32; 2]> = (0..across.y).flat_map(|y| (0..across.x).map(move |x| [x, y])).collect();
    let place = |[x, y]: [u32; 2]| Place { at, brick: [x, start[0] / edge + y, start[1] / edge] };
    for group in local.chunks(bricks_per_thread(brick_bytes, memory) * rayon::current_num_threads()) {
        let results: Vec<Result<R>> = group
            .par_iter()
            .with_max_len(1)
            .map(|&brick| {
                let region = Region::at([brick[0] * edge, brick[1] * edge, 0], Extent::cube(edge));
                work(place(brick), view.sub(&region.intersect(&Region::whole(e))))
            })
            .collect();
        for (&brick, result) in group.iter().zip(results) {
            let result = result.map_err(|error| match (error.code(), first_non_finite(view)) {
                // A brick knows neither where it lies, nor whether another one has an earlier sample of the kind.
                (Code::NonFinite, Some([x, y, z])) => {
                    non_finite_error(view.row::<f32>(y, z)[x as usize], [x, start[0] + y, start[1] + z])
                }
                _ => error,
            })?;
            take(place(brick), result)?;
        }
    }
    Ok(())
}
