//! From a source of slabs to a file.

use super::At;
use super::choose::choose;
use super::options::{CodecChoice, EncodeOptions, Quality};
use super::slabs::for_each_brick;
use super::writer::{EncodeReport, Shape, VolumeWriter, null_sample};
use crate::error::{Error, Result};
use crate::grid::{SlabReader, View};
use std::io::{Seek, Write};

/// How far an encoder is: voxels done of voxels in all, counted over all passes.
pub type Progress<'a> = dyn FnMut(u64, u64) + 'a;

/// Encodes a volume into `out`, which is complete, but not synced, when this returns.
///
/// With explicit settings the source is read once, one slab of bricks at a time; a bound or rate reads it twice,
/// [`CodecChoice::Auto`] once more. Bytes do not depend on the number of threads.
///
/// ```
/// use vug::{Extent, Grid, volume::{self, EncodeOptions, At, Volume}, source::MemorySource};
/// let mut grid = Grid::from_fn(Extent::new(20, 30, 40), |[x, y, z]| (x + y + z) as u8)?;
/// let mut file = std::io::Cursor::new(Vec::new());
/// let report = volume::encode(&mut grid, &mut file, &EncodeOptions::default(), &mut |_, _| {})?;
/// let volume = Volume::open(MemorySource(file.into_inner()), Default::default())?;
/// let voxel = volume.voxel(At::default(), [1, 2, 3])?.component(0);
/// assert!((voxel - 6.0).abs() <= report.max_error);
/// # Ok::<(), vug::Error>(())
/// ```
///
/// # Errors
/// `E_PARAM`, `E_LIMIT` for what the format cannot hold, `E_NONFINITE` for NaN and infinities, those of the source and
/// of `out`.
pub fn encode<W: Write + Seek>(
    reader: &mut dyn SlabReader,
    out: W,
    options: &EncodeOptions,
    progress: &mut Progress<'_>,
) -> Result<EncodeReport> {
    let (extent, t) = (reader.extent(), reader.sample_type());
    extent.check()?;
    let null = null_sample(t, options.null_value)?;
    let looks = u64::from(!matches!(options.quality, Quality::Explicit { .. }) && options.codec != CodecChoice::Raw)
        + u64::from(options.codec == CodecChoice::Auto);
    let total = extent.voxels() * (looks + 1);
    let mut done = 0;
    let mut advance = |voxels| {
        done += voxels;
        progress(done, total);
    };
    let choice = choose(reader, options, null, &mut advance)?;
    let mut writer = VolumeWriter::create(out, Shape::single(extent, t), choice.codec, choice.brick_log2, options)?;
    for lod in 0..options.lod_count(extent, choice.brick_log2)? {
        let encoder = writer.encoder();
        let work = |_, view: View<'_>| Ok((encoder.encode(view)?, view.extent.voxels()));
        for_each_brick(reader, lod, choice.brick_log2, null, work, |brick, (encoded, voxels)| {
            if lod == 0 {
                advance(voxels);
            }
            writer.put(At::lod(lod), brick, encoded)
        })?;
    }
    progress(total, total);
    let (mut out, mut report) = writer.finish()?;
    out.flush().map_err(|e| Error::io("cannot write", e))?;
    report.notes = choice.notes;
    if let Some(lossless) = report.lossless_bytes.filter(|&l| l <= report.stored_bytes && report.stored_bytes > 0) {
        report.notes.push(format!(
            "raw would store the bricks without loss in {lossless} bytes, no more than these {}: use --codec raw or auto",
            report.stored_bytes
        ));
    }
    Ok(report)
}
