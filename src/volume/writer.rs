//! Writing volumes brick by brick.

use super::At;
use super::brick_encoder::{BrickEncoder, BrickStats, EncodedBrick, non_finite_error};
use super::options::EncodeOptions;
use super::report::EncodeReport;
use super::zerobit;
use crate::codec::Codec;
use crate::codec::zerobit::Book;
use crate::container::{
    Achieved, BrickSink, CodecEntry, FileWriter, FinishOptions, LogWriter, NodeKind, Octree, VolumeDescriptor,
    check_meta, check_scene, scene_section,
};
use crate::error::{Code, Error, Result};
use crate::geometry::{Coord, Extent};
use crate::grid::View;
use crate::limits;
use crate::metrics::psnr;
use crate::time::Times;
use crate::voxel::{SampleType, SampleValue};
use std::io::{Seek, Write};

/// Shape of a volume that is to be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Voxels per axis.
    pub extent: Extent,
    /// Type of a voxel.
    pub sample_type: SampleType,
    /// Time steps, at least 1.
    pub time_steps: u32,
    /// Channels, at least 1.
    pub channels: u32,
}

impl Shape {
    /// One time step and one channel.
    #[must_use]
    pub const fn single(extent: Extent, sample_type: SampleType) -> Self {
        Shape { extent, sample_type, time_steps: 1, channels: 1 }
    }
}

/// Writes one volume. Bricks may come in any order; those that never come are EMPTY.
pub struct VolumeWriter<S: BrickSink> {
    file: S,
    descriptor: VolumeDescriptor,
    octree: Octree,
    encoder: BrickEncoder,
    meta: Option<String>,
    scene: Option<String>,
    times: Option<Times>,
    file_id: Option<[u8; 16]>,
    totals: Totals,
    books: Vec<Book>,
    /// Voxels of level 0 that are selected.
    selected: Option<u64>,
    /// Payload bytes since the last checkpoint.
    pending: u64,
}

/// Payload bytes that are at least written between two checkpoints: what a writer that is killed can lose of the index.
const CHECKPOINT_BYTES: u64 = 16 << 20;

#[derive(Default)]
struct Totals {
    finest: BrickStats,
    payload: u64,
    replaced: u64,
    kinds: [u64; 3],
}

impl<W: Write + Seek> VolumeWriter<FileWriter<W>> {
    /// Starts a volume in `out`, a head file whose bricks are all coded with `codec`.
    ///
    /// # Errors
    /// `E_PARAM`, `E_LIMIT` for shapes and options outside the format.
    pub fn create(out: W, shape: Shape, codec: Codec, brick_log2: u8, options: &EncodeOptions) -> Result<Self> {
        VolumeWriter::start(shape, codec, brick_log2, options, |descriptor, _| FileWriter::new(out, descriptor))
    }
}

impl<W: Write> VolumeWriter<LogWriter<W>> {
    /// Starts a volume in `out`, a log file (spec chapter 15): written front to back, so that `out` may be a pipe, and
    /// readable up to its last commit at any time; there is one every 16 MiB of payload, and four times the bytes of the
    /// index that each has to go through.
    ///
    /// # Errors
    /// As [`VolumeWriter::create`]; `E_SOURCE`, since it starts to write at once.
    pub fn create_log(out: W, shape: Shape, codec: Codec, brick_log2: u8, options: &EncodeOptions) -> Result<Self> {
        VolumeWriter::start(shape, codec, brick_log2, options, |descriptor, finish| {
            LogWriter::create(out, descriptor, finish)
        })
    }
}

impl<S: BrickSink> VolumeWriter<S> {
    /// Starts a volume in the file that `open` makes.
    pub(super) fn start(
        shape: Shape,
        codec: Codec,
        brick_log2: u8,
        options: &EncodeOptions,
        open: impl FnOnce(&VolumeDescriptor, &FinishOptions) -> Result<S>,
    ) -> Result<Self> {
        shape.extent.check()?;
        codec.supports(shape.sample_type)?;
        options.placement.check()?;
        if let Some(times) = &options.times {
            times.check(shape.time_steps)?;
        }
        let largest = shape.extent.min(Extent::cube(1 << brick_log2));
        let payload = *codec.payload_lens(shape.sample_type, largest).start();
        if payload > limits::MAX_BRICK_BYTES {
            let message =
                format!("a brick would take {payload} bytes, more than 64 MiB; use smaller bricks or larger blocks");
            return Err(Error::param("brick", message));
        }
        if let Some(meta) = &options.meta {
            // Now, not after hours of encoding.
            check_meta(meta.as_bytes(), 0).map_err(|e| Error::new(e.code(), "meta", e.message()))?;
        }
        if let Some(scene) = &options.scene {
            check_scene(scene.as_bytes(), 0).map_err(|e| Error::new(e.code(), "scene", e.message()))?;
        }
        let null = null_sample(shape.sample_type, options.null_value)?;
        let (id, stream_version, params) = codec.to_wire();
        let descriptor = VolumeDescriptor {
            dims: shape.extent,
            time_steps: shape.time_steps,
            channels: shape.channels,
            sample_type: shape.sample_type,
            lod_count: options.lod_count(shape.extent, brick_log2)?,
            brick_log2,
            downsample: options.downsample,
            codecs: vec![CodecEntry { id, stream_version, params }],
            placement: options.placement.clone(),
            null_value: VolumeDescriptor::null_field(null),
            value_map: options.value_map,
            source_range: (0.0, 0.0),
            achieved: None,
            payload_bytes: 0,
            replaced: 0,
        };
        let octree = Octree::new(&descriptor)?;
        let weigh_lossless = options.zstd && matches!(codec, Codec::S3dc(_));
        let encoder = BrickEncoder { codec, zstd: options.zstd, non_finite: options.non_finite, null, weigh_lossless };
        let known = FinishOptions {
            meta: options.meta.clone().map(String::into_bytes),
            times: options.times.clone(),
            file_id: options.file_id,
            extra: options.scene.clone().map(scene_section).into_iter().collect(),
            ..FinishOptions::default()
        };
        Ok(VolumeWriter {
            file: open(&descriptor, &known)?,
            descriptor,
            octree,
            encoder,
            meta: options.meta.clone(),
            scene: options.scene.clone(),
            times: options.times.clone(),
            file_id: options.file_id,
            totals: Totals::default(),
            books: Vec::new(),
            pending: 0,
            selected: options
                .selection
                .as_ref()
                .map(|s| s.voxels(0) * u64::from(shape.time_steps) * u64::from(shape.channels)),
        })
    }

    /// Encodes and writes brick `brick` (position in bricks): its samples, cropped to the volume.
    ///
    /// With zerobit every brick has thresholds and a codebook of its own, so that 4,096 bricks can be stored;
    /// [`encode`](super::encode) shares them.
    ///
    /// # Errors
    /// `E_RANGE`, `E_PARAM` where brick or samples do not fit the volume, `E_NONFINITE`, `E_SOURCE`.
    pub fn write_brick(&mut self, at: At, brick: Coord, samples: View<'_>) -> Result<()> {
        self.check_brick(at, brick)?;
        let wanted = self.octree.brick_extent(at.lod, brick);
        if samples.extent != wanted || samples.sample_type != self.descriptor.sample_type {
            let (e, t, own) = (samples.extent, samples.sample_type, self.descriptor.sample_type);
            let message = format!("{e} {t} given for brick {brick:?} of {wanted} {own} (x, y, z)");
            return Err(Error::param("samples", message));
        }
        let mut encoder = self.encoder();
        let mut book = None;
        if let Codec::Zerobit(codec) = &encoder.codec
            && encoder.constant(samples).is_none()
        {
            let number = self.books.len() as u64;
            if number >= limits::MAX_CODEBOOKS {
                let most = limits::MAX_CODEBOOKS;
                let message =
                    format!("more than {most} stored bricks, each with a codebook; use larger bricks, or `encode`");
                return Err(Error::new(Code::Limit, "codebooks", message));
            }
            let (codec, own) = zerobit::for_one_brick(codec, samples, self.books.len() as u32)?;
            (encoder.codec, book) = (Codec::Zerobit(codec), Some(own));
        }
        let encoded = encoder.encode(samples).map_err(|e| self.locate(e, samples, at, brick))?;
        self.books.extend(book);
        self.put(at, brick, encoded)
    }

    /// Tells of the codebooks that encoded bricks refer to, as far as there are any yet.
    pub(super) fn set_books(&mut self, books: &[Book]) {
        if self.books.len() != books.len() {
            self.books = books.to_vec();
        }
    }

    pub(super) fn encoder(&self) -> BrickEncoder {
        self.encoder.clone()
    }

    fn check_brick(&self, at: At, brick: Coord) -> Result<()> {
        let d = &self.descriptor;
        let known = at.time < d.time_steps && at.channel < d.channels && at.lod < d.lod_count;
        if known && self.octree.levels[usize::from(at.lod)].bricks.contains(brick) {
            return Ok(());
        }
        Err(Error::new(Code::Range, "brick", format!("{at:?} has no brick {brick:?} (x, y, z)")))
    }

    /// Gives a non-finite sample its position in the volume instead of in the brick.
    fn locate(&self, error: Error, samples: View<'_>, at: At, brick: Coord) -> Error {
        match crate::codec::first_non_finite(&samples) {
            Some(c) if error.code() == Code::NonFinite => {
                let origin = self.octree.brick_region(at.lod, brick).start;
                let value = samples.row::<f32>(c[1], c[2])[c[0] as usize];
                non_finite_error(value, std::array::from_fn(|a| origin[a] + c[a]))
            }
            _ => error,
        }
    }

    /// Writes an encoded brick.
    pub(super) fn put(&mut self, at: At, brick: Coord, encoded: EncodedBrick) -> Result<()> {
        self.check_brick(at, brick)?;
        let d = &self.descriptor;
        let tree = at.time * d.channels + at.channel;
        let EncodedBrick { node, payload, stats } = encoded;
        self.totals.payload += stats.payload;
        if at.lod == 0 {
            self.totals.replaced += stats.replaced;
            self.totals.finest.merge(&stats);
            self.totals.kinds[match node.kind {
                NodeKind::Stored => 0,
                NodeKind::Constant => 1,
                NodeKind::Empty => 2,
            }] += 1;
        }
        match node.kind {
            NodeKind::Stored => self.file.put_stored(tree, at.lod, brick, &node, &payload)?,
            NodeKind::Constant => self.file.put_constant(tree, at.lod, brick, &node)?,
            NodeKind::Empty => {}
        }
        self.pending += payload.len() as u64;
        if self.file.checkpoint_due(self.pending, CHECKPOINT_BYTES) { self.checkpoint() } else { Ok(()) }
    }

    /// Makes what has been written readable, where the layout can (spec chapter 15).
    fn checkpoint(&mut self) -> Result<()> {
        let (descriptor, options) = (self.described(), self.finish_options());
        self.pending = 0;
        self.file.checkpoint(&descriptor, &options)
    }

    /// The descriptor with what is known of the bricks so far, but for errors: they are known in the end.
    fn described(&self) -> VolumeDescriptor {
        VolumeDescriptor {
            source_range: self.totals.finest.source.unwrap_or_default(),
            payload_bytes: self.totals.payload,
            replaced: self.totals.replaced,
            ..self.descriptor.clone()
        }
    }

    fn finish_options(&self) -> FinishOptions {
        let mut section = Vec::new();
        self.books.iter().for_each(|book| book.write_to(self.descriptor.sample_type, &mut section));
        let codebooks = self.books.len() as u64;
        FinishOptions {
            codebooks: (codebooks > 0).then_some((section, codebooks)),
            meta: self.meta.clone().map(String::into_bytes),
            times: self.times.clone(),
            file_id: self.file_id,
            extra: self.scene.clone().map(scene_section).into_iter().collect(),
            ..FinishOptions::default()
        }
    }

    /// Writes what is left: index and head, or the last commit. The file is complete when this returns, but not yet synced.
    ///
    /// # Errors
    /// `E_SOURCE`; `E_LIMIT` where the metadata is too large.
    pub fn finish(self) -> Result<(S::Out, EncodeReport)> {
        let (mut d, options) = (self.described(), self.finish_options());
        let Totals { mut finest, mut payload, replaced, kinds } = self.totals;
        if let Some(selected) = self.selected {
            // The others are null in source and result: they must not make the mean look better.
            finest.error.count = selected * self.descriptor.sample_type.components() as u64;
        }
        let error = &finest.error;
        d.achieved = Some(Achieved { max_error: error.max_abs, rmse: error.rmse(), mean_error: error.mean_abs() });
        payload += options.codebooks.as_ref().map_or(0, |(section, _)| section.len() as u64);
        let codebooks = self.books.len() as u64;
        let (out, summary) = self.file.finish(&d, options)?;
        let voxels = d.dims.voxels() as f64 * f64::from(d.time_steps) * f64::from(d.channels);
        let original = voxels * d.sample_type.bytes() as f64;
        let (ratio_formula, s3dc, zerobit) = match &self.encoder.codec {
            Codec::Raw => (Some(1.0), None, None),
            Codec::S3dc(params) => {
                let bits = 8 * d.sample_type.bytes() as u32;
                (Some(crate::codec::s3dc::formula_ratio(d.dims, bits, params)), Some(*params), None)
            }
            Codec::Zerobit(codec) => (None, None, Some(*codec.params())),
        };
        let report = EncodeReport {
            codec: self.encoder.codec.name(),
            s3dc,
            zerobit,
            codebooks,
            selected: self.selected,
            max_error: error.max_abs,
            mean_error: error.mean_abs(),
            rmse: error.rmse(),
            psnr: psnr(d.source_range.1 - d.source_range.0, error.rmse()),
            source_range: d.source_range,
            ratio_formula,
            ratio_payload: original / payload as f64,
            ratio_file: original / summary.len as f64,
            bits_per_voxel: summary.len as f64 * 8.0 / voxels,
            bytes: summary.len,
            bricks: kinds,
            lossless_bytes: self.encoder.weigh_lossless.then_some(finest.lossless),
            stored_bytes: finest.stored,
            replaced,
            notes: Vec::new(),
        };
        Ok((out, report))
    }
}

/// The null value as a sample.
///
/// # Errors
/// `E_PARAM` where the type cannot hold it exactly, or it is not finite.
pub(super) fn null_sample(t: SampleType, value: f64) -> Result<SampleValue> {
    let sample = match t {
        SampleType::U8 => SampleValue::U8(value as u8),
        SampleType::U16 => SampleValue::U16(value as u16),
        SampleType::I16 => SampleValue::I16(value as i16),
        SampleType::F32 => SampleValue::F32(value as f32 + 0.0),
        SampleType::Rgb8 => SampleValue::Rgb8([value as u8; 3]),
    };
    if sample.component(0) == value && value.is_finite() {
        return Ok(sample);
    }
    Err(Error::param("null-value", format!("{value} is not a value that {t} holds exactly")))
}
