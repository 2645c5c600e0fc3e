//! The sweep: settings × samplers × steps, each pictured and compared.

use super::{Encoded, Setting, pareto};
use crate::error::{Code, Error, Result};
use crate::gpu::key::{Sampler, Source};
use crate::grid::Grid;
use crate::metrics::image::{ImageComparison, RgbImage, compare};
use crate::volume::{EncodeOptions, Volume};
use std::sync::Arc;

/// How a picture is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    /// What the samples are taken from.
    pub source: Source,
    /// How a value between voxels is found.
    pub sampler: Sampler,
    /// Distance of samples, in units of the smallest spacing.
    pub step: f64,
}

/// A picture, and how long it took.
#[derive(Clone, Debug, PartialEq)]
pub struct Taken {
    /// The picture over its background.
    pub image: RgbImage,
    /// Seconds of each frame; one at least.
    pub seconds: Vec<f64>,
    /// Texture fetches per sample, where they are known.
    pub fetches_per_sample: Option<f64>,
}

/// Whoever takes pictures. `E_UNSUPPORTED` and `E_LIMIT` (what a device cannot do, or does not hold) leave the shot out of the
/// sweep, with the reason; not so for the reference picture.
pub type Take<'a> = dyn FnMut(&Arc<Volume>, &Shot) -> Result<Taken> + 'a;

/// What is tried.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// What the volume is stored as.
    pub settings: Vec<Setting>,
    /// How values between voxels are found.
    pub samplers: Vec<Sampler>,
    /// Distances of samples, in units of the smallest spacing.
    pub steps: Vec<f64>,
    /// Distance of samples of the reference picture: uncompressed, linear.
    pub reference_step: f64,
}

/// One setting, sampler and step.
#[derive(Clone, Debug)]
pub struct Row {
    /// The volume as it was stored.
    pub encoded: Encoded,
    /// How the picture was taken.
    pub shot: Shot,
    /// Seconds of the frames: median, smallest, largest.
    pub seconds: [f64; 3],
    /// How many frames.
    pub frames: usize,
    /// Texture fetches per sample, where they are known.
    pub fetches_per_sample: Option<f64>,
    /// Against the reference picture.
    pub error: ImageComparison,
    /// Mean FLIP error, where FLIP is built in (feature `cli`) and takes images of this size.
    pub flip: Option<f64>,
    /// Whether no other row is both faster and closer (median time, MSE).
    pub pareto: bool,
    /// The picture.
    pub image: RgbImage,
}

impl Row {
    /// Setting, sampler and step, for people.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{}, {}, step {}", self.encoded.setting.name(), self.shot.sampler, self.shot.step)
    }

    /// The same for a file's name.
    #[must_use]
    pub fn stem(&self) -> String {
        format!("{}-{}-s{}", self.encoded.setting.stem(), self.shot.sampler, self.shot.step)
    }
}

/// What a sweep found.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The picture that all others were compared with.
    pub reference: RgbImage,
    /// How it was taken.
    pub reference_shot: Shot,
    /// In the order of settings, samplers, steps.
    pub rows: Vec<Row>,
    /// What could not be pictured, and why.
    pub left_out: Vec<(String, String)>,
}

impl Sweep {
    /// Checks that there is something to try, and that steps are lengths.
    ///
    /// # Errors
    /// `E_PARAM`.
    pub fn check(&self) -> Result<()> {
        for (field, empty) in [
            ("bits", self.settings.is_empty()),
            ("samplers", self.samplers.is_empty()),
            ("steps", self.steps.is_empty()),
        ] {
            if empty {
                return Err(Error::param(field, "nothing to try; give one at least"));
            }
        }
        let steps = self.steps.iter().chain([&self.reference_step]);
        match steps.copied().find(|s| !(*s > 0.0 && s.is_finite())) {
            Some(step) => Err(Error::param("steps", format!("{step} is no length; give one above 0"))),
            None => Ok(()),
        }
    }

    /// The shots of one setting. Fetches are reused only where several make a voxel; the texture unit filters only what
    /// is not compressed, or was decoded into a texture before.
    #[must_use]
    pub fn shots(&self, setting: &Setting) -> Vec<Shot> {
        let source = |sampler| match (setting, sampler) {
            (Setting::Raw, Sampler::LinearOpt) => None,
            (Setting::S3dc(_), Sampler::HwLinear) => Some(Source::Deferred),
            _ => Some(Source::Direct),
        };
        let sources = self.samplers.iter().filter_map(|&sampler| Some((source(sampler)?, sampler)));
        sources
            .flat_map(|(source, sampler)| self.steps.iter().map(move |&step| Shot { source, sampler, step }))
            .collect()
    }

    /// Pictures in all, the reference included.
    #[must_use]
    pub fn pictures(&self) -> usize {
        1 + self.settings.iter().map(|s| self.shots(s).len()).sum::<usize>()
    }
}

/// Encodes `grid` with every setting, takes all pictures, and compares them with the reference. `base` says where the
/// volume lies and what its numbers mean. `progress` is told pictures done and pictures in all.
///
/// # Errors
/// Those of [`Sweep::check`], of the encoder, and of `take`, but for those that leave a shot out.
pub fn sweep(
    grid: &mut Grid,
    base: &EncodeOptions,
    sweep: &Sweep,
    take: &mut Take<'_>,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Outcome> {
    sweep.check()?;
    let total = sweep.pictures();
    let mut done = 0;
    let mut advance = || {
        done += 1;
        progress(done, total);
    };
    let reference_shot = Shot { source: Source::Direct, sampler: Sampler::Linear, step: sweep.reference_step };
    let raw = Setting::Raw.encode(grid, base)?;
    let reference = take(&raw.1, &reference_shot)?.image;
    advance();
    let (mut rows, mut left_out) = (Vec::new(), Vec::new());
    for setting in &sweep.settings {
        // One encoded volume at a time: a large one has hundreds of megabytes.
        let (encoded, volume) = if *setting == Setting::Raw { raw.clone() } else { setting.encode(grid, base)? };
        for shot in sweep.shots(setting) {
            match take(&volume, &shot) {
                Ok(taken) => rows.push(row(&reference, encoded, shot, taken)?),
                Err(e) if matches!(e.code(), Code::Unsupported | Code::Limit) => {
                    let name = format!("{}, {}, step {}", setting.name(), shot.sampler, shot.step);
                    left_out.push((name, e.message().to_owned()));
                }
                Err(e) => return Err(e),
            }
            advance();
        }
    }
    let points: Vec<(f64, f64)> = rows.iter().map(|r: &Row| (r.seconds[0], r.error.errors.mse())).collect();
    rows.iter_mut().zip(pareto(&points)).for_each(|(row, on_front)| row.pareto = on_front);
    Ok(Outcome { reference, reference_shot, rows, left_out })
}

fn row(reference: &RgbImage, encoded: Encoded, shot: Shot, taken: Taken) -> Result<Row> {
    let mut seconds = taken.seconds;
    if seconds.is_empty() || seconds.iter().any(|s| !s.is_finite()) {
        return Err(Error::param("frames", "a picture without a time; take one frame at least"));
    }
    seconds.sort_by(f64::total_cmp);
    Ok(Row {
        encoded,
        shot,
        seconds: [seconds[seconds.len() / 2], seconds[0], seconds[seconds.len() - 1]],
        frames: seconds.len(),
        fetches_per_sample: taken.fetches_per_sample,
        error: compare(reference, &taken.image)?,
        flip: seen(reference, &taken.image)?,
        pareto: false,
        image: taken.image,
    })
}

#[cfg(feature = "cli")]
fn seen(a: &RgbImage, b: &RgbImage) -> Result<Option<f64>> {
    use crate::metrics::image::{FLIP_MAX_PIXELS, flip};
    if a.pixels.len() > FLIP_MAX_PIXELS { Ok(None) } else { flip(a, b).map(Some) }
}

#[cfg(not(feature = "cli"))]
fn seen(_: &RgbImage, _: &RgbImage) -> Result<Option<f64>> {
    Ok(None)
}
