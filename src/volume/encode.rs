//! From a source of slabs to a file.

use super::choose::choose;
use super::options::{CodecChoice, EncodeOptions, Quality};
use super::report::EncodeReport;
use super::selection::Selected;
use super::slabs::{Place, Source, Walk};
use super::spool::Spooled;
use super::writer::{Shape, VolumeWriter, null_sample};
use super::zerobit::Encoding;
use crate::codec::Codec;
use crate::codec::zerobit::Book;
use crate::container::BrickSink;
use crate::error::{Error, Result};
use crate::grid::{SlabReader, View};
use crate::voxel::SampleType;
use std::io::{Seek, Write};

/// How far an encoder is: voxels done of voxels in all, counted over all passes.
pub type Progress<'a> = dyn FnMut(u64, u64) + 'a;

/// Encodes a volume into `out`, which is complete, but not synced, when this returns.
///
/// With explicit settings the source is read once, one slab of bricks at a time; a bound or rate reads it twice,
/// [`CodecChoice::Auto`] once more. Zerobit reads it three times (two or three more for a global threshold), and two
/// times more for each ratio that a search tries. Bytes do not depend on the number of threads.
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
    let start = |shape, codec, brick_log2| VolumeWriter::create(out, shape, codec, brick_log2, options);
    let (mut out, report) = run(reader, options, progress, start)?;
    out.flush().map_err(|e| Error::io("cannot write", e))?;
    Ok(report)
}

/// As [`encode`], into a log file: `out` is written front to back and may be a pipe or a socket. What was written before
/// the last commit can be read whatever happens to the writer (spec chapter 15).
///
/// # Errors
/// As [`encode`].
pub fn encode_log<W: Write>(
    reader: &mut dyn SlabReader,
    out: W,
    options: &EncodeOptions,
    progress: &mut Progress<'_>,
) -> Result<EncodeReport> {
    let start = |shape, codec, brick_log2| VolumeWriter::create_log(out, shape, codec, brick_log2, options);
    let (mut out, report) = run(reader, options, progress, start)?;
    out.flush().map_err(|e| Error::io("cannot write", e))?;
    Ok(report)
}

/// Encodes into the file that `start` begins, once shape and codec are known.
fn run<S: BrickSink>(
    reader: &mut dyn SlabReader,
    options: &EncodeOptions,
    progress: &mut Progress<'_>,
    start: impl FnOnce(Shape, Codec, u8) -> Result<VolumeWriter<S>>,
) -> Result<(S::Out, EncodeReport)> {
    let (extent, t) = (reader.extent(), reader.sample_type());
    extent.check()?;
    let (time_steps, channels) = reader.series();
    let null = null_sample(t, options.null_value)?;
    let mut notes = Vec::new();
    let mut spooled;
    let reader: &mut dyn SlabReader = if reader.is_sequential() && looks(options, t) > 0 {
        notes.push("the source comes once, but is looked at more than once: it went to a temporary file".to_owned());
        spooled = Spooled::new(reader, options.temp_dir.as_deref())?;
        &mut spooled
    } else {
        reader
    };
    let mut selected;
    let reader: &mut dyn SlabReader = match &options.selection {
        Some(selection) => {
            selected = Selected::new(reader, selection, null)?;
            &mut selected
        }
        None => reader,
    };
    let (memory, temp_dir) = (options.memory, options.temp_dir.clone());
    let mut source = Source { reader, null, downsample: options.downsample, memory, temp_dir, spooled: false };
    let total = source.voxels().saturating_mul(looks(options, t) + 1);
    let mut done = 0;
    let mut advance = |voxels| {
        // The number of looks of a search is an estimate.
        done = total.min(done + voxels);
        progress(done, total);
    };
    let choice = choose(&mut source, options, &mut advance)?;
    let shape = Shape { extent, sample_type: t, time_steps, channels };
    let mut writer = start(shape, choice.codec.clone(), choice.brick_log2)?;
    let levels = 0..options.lod_count(extent, choice.brick_log2)?;
    let encoder = writer.encoder();
    let mut books = Vec::new();
    if let Codec::Zerobit(codec) = &choice.codec {
        let (region, selection) = (options.zerobit.codebook_region, options.selection.as_ref());
        let encoding = Encoding { codec, encoder: &encoder, brick_log2: choice.brick_log2, region, selection };
        let surveys = encoding.survey(&mut source, levels.clone(), &mut advance)?;
        let cuts = encoding.cuts(&mut source, levels.clone(), &surveys)?;
        let mut put = |books: &[Book], place: Place, encoded| {
            writer.set_books(books);
            writer.put(place.at, place.brick, encoded)
        };
        encoding.encode(&mut source, levels, &cuts, &mut books, &mut advance, &mut put)?;
    } else {
        let work = |_, view: View<'_>| Ok((encoder.encode(view)?, view.extent.voxels()));
        source.for_each_brick(&Walk::levels(choice.brick_log2, levels), work, |place, (encoded, voxels)| {
            if place.at.lod == 0 {
                advance(voxels);
            }
            writer.put(place.at, place.brick, encoded)
        })?;
    }
    let spooled = source.spooled;
    progress(total, total);
    let (out, mut report) = writer.finish()?;
    if spooled {
        let megabytes = options.memory >> 20;
        notes.push(format!(
            "a slab of bricks takes more than the {megabytes} MiB of memory: it went to temporary files"
        ));
    }
    notes.extend(choice.notes);
    report.notes = notes;
    if let Some(lossless) = report.lossless_bytes.filter(|&l| l <= report.stored_bytes && report.stored_bytes > 0) {
        report.notes.push(format!(
            "raw would store the bricks without loss in {lossless} bytes, no more than these {}: use --codec raw or auto",
            report.stored_bytes
        ));
    }
    Ok((out, report))
}

/// Looks at the source before the last one, for progress bars.
fn looks(options: &EncodeOptions, t: SampleType) -> u64 {
    let auto = options.codec == CodecChoice::Auto;
    let searches = !matches!(options.quality, Quality::Explicit { .. } | Quality::Keep(_));
    let zerobit = options.codec == CodecChoice::Zerobit || (auto && searches && t == SampleType::Rgb8);
    let search = match searches && options.codec != CodecChoice::Raw {
        true if zerobit => super::choose_keep::MOST_LOOKS,
        search => u64::from(search),
    };
    search + u64::from(auto) + if zerobit { 2 } else { 0 }
}
