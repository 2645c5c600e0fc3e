//! How much zerobit has to keep: given, or the least that holds a bound, or the most that fits a rate.

use super::brick_encoder::{BrickEncoder, BrickStats};
use super::choose::{Choice, check, holds};
use super::options::{EncodeOptions, Quality, ZerobitOptions};
use super::slabs::Source;
use super::zerobit::Encoding;
use crate::codec::Codec;
use crate::codec::zerobit::{KEEP_ALL, Threshold, Training, Zerobit};
use crate::error::{Error, Result};
use crate::geometry::Extent;
use crate::metrics::psnr;
use std::ops::Range;

/// Ratios that a search tries first, in millionths, until one lies beyond the edge.
const LADDER: [u32; 7] = [30_000, 90_000, 200_000, 300_000, 450_000, 700_000, KEEP_ALL];
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
    source: &mut Source<'_>,
    options: &EncodeOptions,
    progress: &mut dyn FnMut(u64),
) -> Result<Found> {
    let (sample_type, null) = (source.sample_type(), source.null);
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
    choice(LADDER[0])?; // the sample type, before hours are spent
    let lods = 0..if rate.is_some() { options.lod_count(source.extent(), brick_log2)? } else { 1 };
    let voxels = source.voxels() as f64;
    let encoder =
        BrickEncoder { codec: Codec::Raw, zstd: false, non_finite: options.non_finite, null, weigh_lossless: false };
    // More coefficients share 256 words, so that the error may grow again: what counts is the best of all that was tried.
    let mut tried: Vec<(u32, BrickStats)> = Vec::new();
    let within = |stats: &BrickStats, rate: f64| stats.payload as f64 * 8.0 / voxels <= rate;
    // Beyond the edge a bound is held, or a rate is passed.
    let mut is_beyond = |keep: u32| -> Result<bool> {
        let stats = trial(source, options, &codec(keep)?, &encoder, brick_log2, lods.clone(), progress)?;
        let beyond = rate.map_or_else(|| holds(&stats, options.quality), |rate| !within(&stats, rate));
        tried.push((keep, stats));
        Ok(beyond)
    };
    let (mut low, mut high) = (None, None);
    for keep in LADDER {
        if is_beyond(keep)? {
            high = Some(keep);
            break;
        }
        low = Some(keep);
    }
    while let (None, Some(keep @ 1..)) = (low, high) {
        let less = if keep > 100 { keep / 4 } else { 0 };
        *if is_beyond(less)? { &mut high } else { &mut low } = Some(less);
    }
    if let (Some(mut low), Some(mut high)) = (low, high) {
        while high - low > 1 + high / PRECISION {
            let middle = low + (high - low) / 2;
            *if is_beyond(middle)? { &mut high } else { &mut low } = middle;
        }
    }
    if let Some(rate) = rate {
        let best = tried
            .iter()
            .filter(|(_, stats)| within(stats, rate))
            .min_by(|(_, a), (_, b)| a.error.sum_sq.total_cmp(&b.error.sum_sq).then(a.payload.cmp(&b.payload)));
        let least = tried.iter().map(|(_, stats)| stats.payload).min().unwrap_or(0) as f64 * 8.0 / voxels;
        let too_few = format!("{rate} bits per voxel are too few: this volume takes at least {least:.3} with zerobit");
        return best.map_or(Err(Error::param("rate", too_few)), |(keep, _)| choice(*keep));
    }
    if let Some((keep, _)) = tried.iter().filter(|(_, stats)| holds(stats, options.quality)).min_by_key(|t| t.0) {
        return choice(*keep);
    }
    let off = |stats: &BrickStats| match options.quality {
        Quality::Psnr(_) => stats.error.rmse(),
        _ => stats.error.max_abs,
    };
    let best = tried.iter().min_by(|(_, a), (_, b)| off(a).total_cmp(&off(b)));
    let (keep, stats) = best.expect("the whole ladder has been tried");
    let range = stats.source.map_or(0.0, |(lo, hi)| hi - lo);
    Ok(Found::Missed(format!(
        ": of what was tried, {} % of the coefficients come closest, with a largest error of {} and {:.2} dB{}",
        f64::from(*keep) / 1e4,
        stats.error.max_abs,
        psnr(range, stats.error.rmse()).unwrap_or(f64::INFINITY),
        advice(&options.zerobit)
    )))
}

/// What may come closer still, as far as it has not been asked for.
fn advice(options: &ZerobitOptions) -> String {
    let more = [
        (options.threshold == Threshold::Adaptive, "--threshold global"),
        (options.training == Training::MedianCut, "--training refined"),
        (options.codebook_region.is_none(), "--codebook-region 1"),
    ];
    let more: Vec<&str> = more.into_iter().filter(|m| m.0).map(|m| m.1).collect();
    if more.is_empty() { String::new() } else { format!("; closer may come {}", more.join(" ")) }
}

/// Encodes some levels without writing them, and tells what came of it. Codebooks count as payload.
pub(super) fn trial(
    source: &mut Source<'_>,
    options: &EncodeOptions,
    codec: &Zerobit,
    encoder: &BrickEncoder,
    brick_log2: u8,
    lods: Range<u8>,
    progress: &mut dyn FnMut(u64),
) -> Result<BrickStats> {
    let (region, selection) = (options.zerobit.codebook_region, options.selection.as_ref());
    let encoding = Encoding { codec, encoder, brick_log2, region, selection };
    let mut total = BrickStats::default();
    let mut books = Vec::new();
    let surveys = encoding.survey(source, lods.clone(), &mut |_| {})?;
    let cuts = encoding.cuts(source, lods.clone(), &surveys)?;
    encoding.encode(source, lods, &cuts, &mut books, progress, &mut |_, place, encoded| {
        let stats = encoded.stats();
        if place.at.lod == 0 {
            total.merge(stats);
        } else {
            total.payload += stats.payload;
            total.stored += stats.stored;
        }
        Ok(())
    })?;
    let mut section = Vec::new();
    books.iter().for_each(|book| book.write_to(source.sample_type(), &mut section));
    total.payload += section.len() as u64;
    total.stored += section.len() as u64;
    Ok(total)
}
