//! What a series is with further time steps behind it, and how these have to be encoded to fit.

use crate::codec::Codec;
use crate::codec::zerobit::Book;
use crate::container::{Achieved, FinishOptions, VolumeDescriptor};
use crate::error::{Code, Error, Result};
use crate::limits;
use crate::time::Times;
use crate::volume::Volume;
use crate::volume::options::{CodecChoice, EncodeOptions, Quality, ZerobitOptions};
use std::collections::BTreeMap;

/// What the log will say, and how what is copied has to be changed.
pub(super) struct Plan {
    /// The joined volume; its payload bytes are those of the log so far.
    pub(super) descriptor: VolumeDescriptor,
    pub(super) options: FinishOptions,
    /// Numbers of codebooks in the log by those in the steps.
    pub(super) books: Vec<u32>,
    pub(super) codecs: Vec<u8>,
}

/// Checks that `steps` fit behind `log`, and joins what both say.
///
/// # Errors
/// `E_PARAM` where they do not, `E_LIMIT`, those of damaged sections.
pub(super) fn fitting(log: &Volume, steps: &Volume, times: Option<Times>) -> Result<Plan> {
    check_same(log.info(), steps.info())?;
    let mut options = log.kept()?;
    options.times = joined_times(options.times.take(), times)?;
    let books = add_books(&mut options, log, steps)?;
    let mut descriptor = joined(log.info(), steps.info())?;
    let codecs = add_codecs(&mut descriptor, steps.info())?;
    descriptor.check()?;
    Ok(Plan { descriptor, options, books, codecs })
}

fn check_same(log: &VolumeDescriptor, steps: &VolumeDescriptor) -> Result<()> {
    let differ = |what: &'static str, a: String, b: String| {
        Err(Error::param(what, format!("the file has {a}, what is appended {b}; both must be the same")))
    };
    if log.dims != steps.dims {
        return differ("dims", format!("{} voxels", log.dims), format!("{}", steps.dims));
    }
    if log.sample_type != steps.sample_type {
        return differ("sample_type", log.sample_type.name().into(), steps.sample_type.name().into());
    }
    if log.channels != steps.channels {
        return differ("channels", format!("{} channels", log.channels), steps.channels.to_string());
    }
    if log.lod_count != steps.lod_count {
        return differ("levels", format!("{} levels", log.lod_count), steps.lod_count.to_string());
    }
    if log.lod_count > 1 && log.downsample != steps.downsample {
        return differ("downsample", log.downsample.name().into(), steps.downsample.name().into());
    }
    if log.brick_log2 != steps.brick_log2 {
        return differ("brick", format!("bricks of {}", 1 << log.brick_log2), format!("{}", 1 << steps.brick_log2));
    }
    if log.null_value != steps.null_value {
        let text = |d: &VolumeDescriptor| format!("null value {}", d.null_sample());
        return differ("null-value", text(log), text(steps));
    }
    if log.value_map != steps.value_map {
        let text = |d: &VolumeDescriptor| format!("scale {} and offset {}", d.value_map.scale, d.value_map.offset);
        return differ("value_map", text(log), text(steps));
    }
    Ok(())
}

/// The descriptor of both together; payload bytes and codecs are those of the log.
fn joined(log: &VolumeDescriptor, steps: &VolumeDescriptor) -> Result<VolumeDescriptor> {
    let Some(time_steps) = log.time_steps.checked_add(steps.time_steps) else {
        return Err(Error::new(Code::Limit, "time_steps", "the number of time steps overflows 32 bits"));
    };
    let achieved = log.achieved.zip(steps.achieved).map(|(a, b)| {
        // Voxels of a step are as many in both.
        let (n, m) = (f64::from(log.time_steps), f64::from(steps.time_steps));
        let mean = |a: f64, b: f64| (a * n + b * m) / (n + m);
        Achieved {
            max_error: a.max_error.max(b.max_error),
            rmse: mean(a.rmse * a.rmse, b.rmse * b.rmse).sqrt(),
            mean_error: mean(a.mean_error, b.mean_error),
        }
    });
    Ok(VolumeDescriptor {
        time_steps,
        source_range: (log.source_range.0.min(steps.source_range.0), log.source_range.1.max(steps.source_range.1)),
        achieved,
        replaced: log.replaced.saturating_add(steps.replaced),
        ..log.clone()
    })
}

/// Adds the codebooks of `steps` that are not there yet; the number of each of its codebooks is then.
fn add_books(options: &mut FinishOptions, log: &Volume, steps: &Volume) -> Result<Vec<u32>> {
    let bytes_of = |volume: &Volume| -> Result<Vec<Vec<u8>>> {
        let t = volume.info().sample_type;
        let bytes = |book: &Book| {
            let mut bytes = Vec::new();
            book.write_to(t, &mut bytes);
            bytes
        };
        Ok(volume.codebooks()?.iter().map(bytes).collect())
    };
    let new = bytes_of(steps)?;
    if new.is_empty() {
        return Ok(Vec::new());
    }
    let mut known = BTreeMap::new();
    for (number, book) in (0u32..).zip(bytes_of(log)?) {
        known.entry(book).or_insert(number);
    }
    let (mut all, mut count) = options.codebooks.take().unwrap_or_default();
    let mut numbers = Vec::with_capacity(new.len());
    for book in new {
        let number = match known.get(&book) {
            Some(&number) => number,
            None => {
                let number = u32::try_from(count).ok().filter(|&n| u64::from(n) < limits::MAX_CODEBOOKS);
                let Some(number) = number else { return Err(too_many_books()) };
                all.extend(&book);
                count += 1;
                known.insert(book, number);
                number
            }
        };
        numbers.push(number);
    }
    options.codebooks = Some((all, count));
    Ok(numbers)
}

fn too_many_books() -> Error {
    let message = format!(
        "the file would have more than {} codebooks: each step whose codebooks differ brings its own. Begin another log \
         with this step (`vug pack --log`), or encode the steps with another codec",
        limits::MAX_CODEBOOKS
    );
    Error::new(Code::Limit, "codebooks", message)
}

/// Adds the codec entries of `steps` that are not there yet; where each of its entries is then.
fn add_codecs(descriptor: &mut VolumeDescriptor, steps: &VolumeDescriptor) -> Result<Vec<u8>> {
    let mut places = Vec::with_capacity(steps.codecs.len());
    for codec in &steps.codecs {
        let known = descriptor.codecs.iter().position(|c| c == codec);
        let at = known.unwrap_or(descriptor.codecs.len());
        if known.is_none() {
            descriptor.codecs.push(codec.clone());
        }
        limits::check("codec_count", at as u64 + 1, limits::MAX_CODECS as u64)?;
        places.push(u8::try_from(at).expect("at most 255 codecs"));
    }
    Ok(places)
}

fn joined_times(log: Option<Times>, new: Option<Times>) -> Result<Option<Times>> {
    match (log, new) {
        (None, None) => Ok(None),
        (Some(mut log), Some(new)) if log.unit == new.unit => {
            log.steps.extend(new.steps);
            Ok(Some(log))
        }
        (Some(log), Some(new)) => {
            let (a, b) = (log.unit.name(), new.unit.name());
            Err(Error::param("times", format!("the file's times are in {a}, those of the new steps in {b}")))
        }
        (Some(_), None) => {
            Err(Error::param("times", "the file says when its steps were taken: say it of the new ones, too"))
        }
        (None, Some(_)) => {
            Err(Error::param("times", "the file does not say when its steps were taken: leave times out"))
        }
    }
}

impl Volume {
    /// What an encoder has to be told so that its volume fits behind this one: see
    /// [`Appender::append`](super::Appender::append). The codec is that of the first entry of the codec table, with its
    /// parameters.
    ///
    /// # Errors
    /// `E_CODEC` where this version does not know it, `E_UNSUPPORTED` where it cannot be asked for.
    pub fn encode_options(&self) -> Result<EncodeOptions> {
        let d = self.info();
        let null = d.null_sample();
        let null_value = null.component(0);
        if (1..d.sample_type.components()).any(|c| null.component(c) != null_value) {
            let message =
                format!("the null value {null} is not the same in all components: encode the step by other means");
            return Err(Error::new(Code::Unsupported, "null-value", message));
        }
        let mut options = EncodeOptions {
            brick: Some(1 << d.brick_log2),
            levels: d.lod_count,
            downsample: d.downsample,
            null_value,
            placement: d.placement.clone(),
            value_map: d.value_map,
            ..EncodeOptions::default()
        };
        let Some(entry) = d.codecs.first() else { return Ok(options) };
        match Codec::from_wire(entry.id, entry.stream_version, &entry.params, null)? {
            Codec::Raw => options.codec = CodecChoice::Raw,
            Codec::S3dc(params) => {
                options.codec = CodecChoice::S3dc;
                options.quality = Quality::Explicit { index_bits: params.i_bits(), block: params.block() };
                options.endpoints = params.endpoints();
            }
            Codec::Zerobit(zerobit) => {
                let params = zerobit.params();
                options.codec = CodecChoice::Zerobit;
                options.quality = Quality::Keep(params.keep_ppm());
                options.zerobit = ZerobitOptions {
                    stream: zerobit.stream(),
                    threshold: params.threshold,
                    norm: params.norm,
                    training: params.training,
                    codebook_region: None,
                };
            }
        }
        Ok(options)
    }
}
