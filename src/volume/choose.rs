//! Error control: tries every setting on every brick and takes the smallest that holds the bound, or the best within a rate.

use super::brick_encoder::{BrickEncoder, BrickStats};
use super::choose_keep::{Found, choose_keep, trial};
use super::options::{Bound, CodecChoice, EncodeOptions, Quality};
use super::slabs::{Source, Walk};
use crate::codec::{Codec, s3dc};
use crate::error::{Error, Result};
use crate::geometry::Extent;
use crate::metrics::psnr;
use crate::voxel::SampleType;

/// Index bits that are tried, fewest first.
const INDEX_BITS: [u8; 4] = [1, 2, 4, 8];
/// Block edges that are tried, largest first: of two settings with the same payload the coarser one is cheaper to read.
const BLOCK_EDGES: [u32; 5] = [32, 16, 8, 4, 2];

/// What [`choose`] has found.
pub(super) struct Choice {
    pub(super) codec: Codec,
    pub(super) brick_log2: u8,
    /// What to tell the user about it.
    pub(super) notes: Vec<String>,
}

/// Finds codec, parameters and brick size for a source. Explicit settings cost nothing; every other way reads the
/// source once more, and holds one slab of bricks meanwhile.
///
/// # Errors
/// `E_PARAM` for impossible settings, or a bound that S3Dc cannot meet where nothing else is allowed.
pub(super) fn choose(
    source: &mut Source<'_>,
    options: &EncodeOptions,
    progress: &mut dyn FnMut(u64),
) -> Result<Choice> {
    let t = source.sample_type();
    let raw = |notes| Ok(Choice { codec: Codec::Raw, brick_log2: options.brick_log2(Extent::cube(1))?, notes });
    if options.codec == CodecChoice::Raw {
        return match options.quality {
            Quality::Explicit { .. } | Quality::MaxError(_) | Quality::Psnr(_) => raw(Vec::new()),
            Quality::Rate(rate) => {
                Err(Error::param("rate", format!("raw takes what it takes, not {rate} bits; use s3dc or zerobit")))
            }
            Quality::Keep(_) => Err(Error::param("keep", "raw keeps everything; use --codec zerobit")),
        };
    }
    let auto = options.codec == CodecChoice::Auto;
    if t == SampleType::Rgb8 && auto && matches!(options.quality, Quality::Explicit { .. }) {
        return raw(vec!["rgb8 is stored as raw unless zerobit, a bound or a rate is asked for".into()]);
    }
    if options.codec == CodecChoice::Zerobit || (t == SampleType::Rgb8 && auto) {
        return match choose_keep(source, options, progress)? {
            Found::Choice(choice) if auto => lighter(source, options, *choice, progress),
            Found::Choice(choice) => Ok(*choice),
            Found::Missed(best) if auto => raw(vec![format!(
                "zerobit cannot reach {}{best}: stored without loss as raw",
                describe(options.quality)
            )]),
            Found::Missed(best) => Err(Error::param(
                name(options.quality),
                format!(
                    "zerobit cannot reach {}{best}; use a weaker bound, or --codec raw or auto",
                    describe(options.quality)
                ),
            )),
        };
    }
    if t == SampleType::Rgb8 {
        return Err(Error::param(
            "codec",
            "s3dc stores scalars, this volume is rgb8; use --codec zerobit, raw or auto",
        ));
    }
    let choice = match options.quality {
        Quality::Keep(_) => return Err(Error::param("keep", "only zerobit keeps a ratio; use --codec zerobit")),
        Quality::Explicit { index_bits, block } => {
            let params = s3dc::Params::new(index_bits, block, options.endpoints)?;
            Choice { codec: Codec::S3dc(params), brick_log2: options.brick_log2(block)?, notes: Vec::new() }
        }
        quality => match search(source, options, quality, progress)? {
            Some(choice) => choice,
            None if options.codec == CodecChoice::Auto => {
                return raw(vec![format!("s3dc cannot reach {}: stored without loss as raw", describe(quality))]);
            }
            None => {
                return Err(Error::param(
                    name(quality),
                    format!("s3dc cannot reach {}; use --codec auto or raw, or a weaker bound", describe(quality)),
                ));
            }
        },
    };
    if auto { lighter(source, options, choice, progress) } else { Ok(choice) }
}

/// The choice, or `raw` where that is no larger.
fn lighter(
    source: &mut Source<'_>,
    options: &EncodeOptions,
    choice: Choice,
    progress: &mut dyn FnMut(u64),
) -> Result<Choice> {
    let weighed = weigh(source, options, &choice, progress)?;
    if weighed.lossless > weighed.stored {
        return Ok(choice);
    }
    let note = format!(
        "raw is no larger ({} bytes without loss, {} with {}): stored as raw",
        weighed.lossless,
        weighed.stored,
        choice.codec.name()
    );
    Ok(Choice { codec: Codec::Raw, brick_log2: options.brick_log2(Extent::cube(1))?, notes: vec![note] })
}

/// Stored bytes of a choice and of its lossless rival.
fn weigh(
    source: &mut Source<'_>,
    options: &EncodeOptions,
    choice: &Choice,
    progress: &mut dyn FnMut(u64),
) -> Result<BrickStats> {
    let encoder = BrickEncoder {
        codec: choice.codec.clone(),
        zstd: options.zstd,
        non_finite: options.non_finite,
        null: source.null,
        weigh_lossless: true,
    };
    if let Codec::Zerobit(codec) = &choice.codec {
        return trial(source, options, codec, &encoder, choice.brick_log2, 0..1, progress);
    }
    let mut total = BrickStats::default();
    let work = |_, view: crate::grid::View<'_>| Ok((encoder.encode(view)?.stats, view.extent.voxels()));
    source.for_each_brick(&Walk::levels(choice.brick_log2, 0..1), work, |_, (stats, voxels)| {
        total.merge(&stats);
        progress(voxels);
        Ok(())
    })?;
    Ok(total)
}

/// The best setting for a bound or rate, or `None` where none meets it.
fn search(
    source: &mut Source<'_>,
    options: &EncodeOptions,
    quality: Quality,
    progress: &mut dyn FnMut(u64),
) -> Result<Option<Choice>> {
    check(quality)?;
    let brick_log2 = options.brick_log2(Extent::cube(1))?;
    let mut encoders = Vec::new();
    for edge in BLOCK_EDGES.into_iter().filter(|&edge| edge <= 1 << brick_log2) {
        for bits in INDEX_BITS {
            let params = s3dc::Params::new(bits, Extent::cube(edge), options.endpoints)?;
            encoders.push(BrickEncoder {
                codec: Codec::S3dc(params),
                zstd: false,
                non_finite: options.non_finite,
                null: source.null,
                weigh_lossless: false,
            });
        }
    }
    let mut totals = vec![BrickStats::default(); encoders.len()];
    let work = |_, view: crate::grid::View<'_>| {
        let stats: Result<Vec<BrickStats>> = encoders.iter().map(|e| Ok(e.encode(view)?.stats)).collect();
        Ok((stats?, view.extent.voxels()))
    };
    // Coarser levels take payload, too: what they cost counts, how good they are does not.
    let is_rate = matches!(quality, Quality::Rate(_));
    let levels = if is_rate { options.lod_count(source.extent(), brick_log2)? } else { 1 };
    source.for_each_brick(&Walk::levels(brick_log2, 0..levels), work, |place, (stats, voxels)| {
        for (total, stats) in totals.iter_mut().zip(&stats) {
            if place.at.lod == 0 {
                total.merge(stats);
            } else {
                total.payload += stats.payload;
            }
        }
        if place.at.lod == 0 {
            progress(voxels);
        }
        Ok(())
    })?;
    let voxels = source.voxels() as f64;
    let least = totals.iter().map(|s| s.payload).min().unwrap_or(0) as f64 * 8.0 / voxels;
    let best = match quality {
        Quality::Rate(rate) => totals
            .iter()
            .enumerate()
            .filter(|(_, s)| s.payload as f64 * 8.0 / voxels <= rate)
            .min_by(|(_, a), (_, b)| a.error.sum_sq.total_cmp(&b.error.sum_sq).then(a.payload.cmp(&b.payload))),
        _ => totals.iter().enumerate().filter(|(_, s)| holds(s, quality)).min_by_key(|(_, s)| s.payload),
    };
    if let (Quality::Rate(rate), None) = (quality, best) {
        return Err(Error::param(
            "rate",
            format!("{rate} bits per voxel are too few: this volume takes at least {least:.3}"),
        ));
    }
    Ok(best.map(|(i, _)| Choice { codec: encoders[i].codec.clone(), brick_log2, notes: Vec::new() }))
}

pub(super) fn holds(stats: &BrickStats, quality: Quality) -> bool {
    let range = stats.source.map_or(0.0, |(lo, hi)| hi - lo);
    match quality {
        Quality::MaxError(Bound::Absolute(bound)) => stats.error.max_abs <= bound,
        Quality::MaxError(Bound::Percent(percent)) => stats.error.max_abs <= percent / 100.0 * range,
        Quality::Psnr(db) => {
            stats.error.max_abs == 0.0 || psnr(range, stats.error.rmse()).is_some_and(|found| found >= db)
        }
        Quality::Rate(_) | Quality::Explicit { .. } | Quality::Keep(_) => unreachable!("not a bound on the error"),
    }
}

pub(super) fn check(quality: Quality) -> Result<()> {
    let (value, least) = match quality {
        Quality::MaxError(Bound::Absolute(v) | Bound::Percent(v)) | Quality::Psnr(v) => (v, 0.0),
        Quality::Rate(v) => (v, f64::MIN_POSITIVE),
        Quality::Explicit { .. } | Quality::Keep(_) => return Ok(()),
    };
    if value.is_finite() && value >= least {
        return Ok(());
    }
    Err(Error::param(name(quality), format!("{value} is not a positive number")))
}

fn name(quality: Quality) -> &'static str {
    match quality {
        Quality::MaxError(_) => "max-error",
        Quality::Psnr(_) => "psnr",
        Quality::Rate(_) => "rate",
        Quality::Explicit { .. } => "index-bits",
        Quality::Keep(_) => "keep",
    }
}

fn describe(quality: Quality) -> String {
    match quality {
        Quality::MaxError(Bound::Absolute(v)) => format!("a maximum error of {v}"),
        Quality::MaxError(Bound::Percent(v)) => format!("a maximum error of {v} % of the range"),
        Quality::Psnr(v) => format!("{v} dB"),
        Quality::Rate(v) => format!("{v} bits per voxel"),
        Quality::Explicit { index_bits, block } => format!("{index_bits} bits, blocks of {block}"),
        Quality::Keep(ppm) => format!("{} % of the coefficients", f64::from(ppm) / 1e4),
    }
}
