//! How much zerobit has to keep: given, or the least that holds a bound, or the most that fits a rate.

use super::brick_encoder::{BrickEncoder, BrickStats};
use super::choose::{Choice, check, holds};
use super::options::{EncodeOptions, Quality};
use super::zerobit::Encoding;
use crate::codec::Codec;
use crate::codec::zerobit::{KEEP_ALL, Zerobit};
use crate::error::{Error, Result};
use crate::geometry::Extent;
use crate::grid::SlabReader;
use crate::voxel::SampleValue;
use std::ops::Range;

/// The ratio that a search tries first, in millionths.
const FIRST: u32 = 30_000;
/// A search ends where the ratio is known to one part in this many.
const PRECISION: u32 = 64;
/// Looks at the source that a search takes at most: trials of two looks each. Progress bars go by it.
pub(super) const MOST_LOOKS: u64 = 2 * 24;

/// What a search has found.
pub(super) enum Found {
    Choice(Box<Choice>),
    /// No ratio that was tried holds the bound; what the best of them reaches, in words.
    Missed(String),
}

/// Finds the ratio to keep.
///
/// # Errors
/// `E_PARAM` for impossible settings, and for rates that are too low for any ratio.
pub(super) fn choose_keep(
    reader: &mut dyn SlabReader,
    options: &EncodeOptions,
    null: SampleValue,
    progress: &mut dyn FnMut(u64),
) -> Result<Found> {
    let sample_type = reader.sample_type();
    let brick_log2 = options.brick_log2(Extent::cube(16))?;
    let codec = |keep| -> Result<Zerobit> {
        let params = options.zerobit.params(keep, options.selection.as_ref())?;
        Ok(Zerobit::new(options.zerobit.stream, params, null))
    };
    let choice = |keep| -> Result<Found> {
        let codec = Codec::Zerobit(codec(keep)?);
        codec.supports(sample_type)?;
        Ok(Found::Choice(Box::new(Choice { codec, brick_log2, notes: Vec::new() })))
    };
    let rate = match options.quality {
        Quality::Keep(keep) => return choice(keep),
        Quality::Explicit { .. } => {
            return Err(Error::param("keep", "zerobit takes a ratio of coefficients to keep, or a bound or rate"));
        }
        Quality::Rate(rate) => Some(rate),
        Quality::MaxError(_) | Quality::Psnr(_) => None,
    };
    check(options.quality)?;
    choice(FIRST)?; // the sample type, before hours are spent
    let lods = 0..if rate.is_some() { options.lod_count(reader.extent(), brick_log2)? } else { 1 };
    let voxels = reader.extent().voxels() as f64;
    let encoder =
        BrickEncoder { codec: Codec::Raw, zstd: false, non_finite: options.non_finite, null, weigh_lossless: false };
    // With more kept, a rate is at some ratio no longer held, a bound from some ratio on: either way there is one edge.
    let mut run = |keep: u32| -> Result<(bool, BrickStats)> {
        let stats = trial(reader, options, &codec(keep)?, &encoder, brick_log2, lods.clone(), progress)?;
        let held = match rate {
            Some(rate) => stats.payload as f64 * 8.0 / voxels > rate,
            None => holds(&stats, options.quality),
        };
        Ok((held, stats))
    };
    // More coefficients share 256 words: the error may grow again, so that the best is not always the last.
    let mut best = None;
    let off = |stats: &BrickStats| match options.quality {
        Quality::Psnr(_) => stats.error.rmse(),
        _ => stats.error.max_abs,
    };
    // `below` is on this side of the edge, `beyond` on that one.
    let (mut below, mut beyond) = (None, None);
    let mut keep = FIRST;
    let edge = loop {
        let (is_beyond, stats) = run(keep)?;
        if best.as_ref().is_none_or(|(_, best)| off(&stats) < off(best)) {
            best = Some((keep, stats));
        }
        if is_beyond {
            beyond = Some(keep);
        } else {
            below = Some(keep);
        }
        keep = match (below, beyond) {
            (Some(KEEP_ALL), None) => {
                if rate.is_some() {
                    break KEEP_ALL;
                }
                let (keep, stats) = best.expect("some have been tried");
                return Ok(Found::Missed(format!(
                    ": with {} % of the coefficients, the best, the largest error is {}, the root mean square {:.4}",
                    f64::from(keep) / 1e4,
                    stats.error.max_abs,
                    stats.error.rmse()
                )));
            }
            (Some(below), None) => below.saturating_mul(3).min(KEEP_ALL),
            (None, Some(0)) => break 0,
            (None, Some(beyond)) => {
                if beyond > 100 {
                    beyond / 4
                } else {
                    0
                }
            }
            (Some(below), Some(beyond)) if beyond - below <= 1 + beyond / PRECISION => {
                break if rate.is_some() { below } else { beyond };
            }
            (Some(below), Some(beyond)) => below + (beyond - below) / 2,
            (None, None) => unreachable!("one of them has just been set"),
        };
    };
    if let (Some(rate), None) = (rate, below) {
        let least = run(0)?.1.payload as f64 * 8.0 / voxels;
        let message = format!("{rate} bits per voxel are too few: this volume takes at least {least:.3}");
        return Err(Error::param("rate", message));
    }
    choice(edge)
}

/// Encodes some levels without writing them, and tells what came of it. Codebooks count as payload.
pub(super) fn trial(
    reader: &mut dyn SlabReader,
    options: &EncodeOptions,
    codec: &Zerobit,
    encoder: &BrickEncoder,
    brick_log2: u8,
    lods: Range<u8>,
    progress: &mut dyn FnMut(u64),
) -> Result<BrickStats> {
    let (region, selection) = (options.zerobit.codebook_region, options.selection.as_ref());
    let encoding = Encoding { codec, encoder, brick_log2, region, selection };
    let t = reader.sample_type();
    let mut total = BrickStats::default();
    let mut books = Vec::new();
    for lod in lods {
        let survey = encoding.survey(reader, lod, &mut |_| {})?;
        let cut = encoding.cut(reader, lod, &survey)?;
        encoding.level(reader, lod, cut, &mut books, &mut *progress, &mut |_, encoded| {
            let stats = encoded.stats();
            if lod == 0 {
                total.merge(stats);
            } else {
                total.payload += stats.payload;
                total.stored += stats.stored;
            }
            Ok(())
        })?;
    }
    let mut section = Vec::new();
    books.iter().for_each(|book| book.write_to(t, &mut section));
    total.payload += section.len() as u64;
    total.stored += section.len() as u64;
    Ok(total)
}
