//! `vug compare` of two pictures.

use super::failures_of;
use crate::cli::args::Compare;
use crate::cli::load::load;
use crate::cli::output::{Verdict, number, write_file};
use crate::cli::picture::{Picture, legend, stacked};
use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::metrics::ErrorClass;
use crate::metrics::image::{ChannelScores, ImageComparison, PEAK, RgbImage, compare, difference, flip};
use crate::voxel::SampleType;
use serde_json::{Value, json};
use std::path::Path;

/// The two pictures, where both files are PNG of 8 bits. Deeper ones are compared as volumes of one slice.
pub(super) fn pictures(args: &Compare) -> Result<Option<(RgbImage, RgbImage)>> {
    if !is_png(&args.a) || !is_png(&args.b) {
        return Ok(None);
    }
    let (a, b) = (load(&args.a, &args.import)?.grid, load(&args.b, &args.import)?.grid);
    Ok(of_grid(&a)?.zip(of_grid(&b)?))
}

fn is_png(path: &Path) -> bool {
    path.is_file() && path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"))
}

/// A grey picture is the coloured one with equal channels.
fn of_grid(grid: &Grid) -> Result<Option<RgbImage>> {
    let (e, bytes) = (grid.extent(), grid.bytes());
    let pixels = match grid.sample_type() {
        SampleType::U8 => bytes.iter().map(|&v| [v; 3]).collect(),
        SampleType::Rgb8 => bytes.as_chunks::<3>().0.to_vec(),
        _ => return Ok(None),
    };
    RgbImage::new(e.x, e.y, pixels).map(Some)
}

pub(super) fn run(args: &Compare, a: &RgbImage, b: &RgbImage) -> Result<Verdict> {
    let c = compare(a, b)?;
    let seen = flip(a, b)?;
    let failed =
        failures_of(args, PEAK, f64::from(c.errors.max), Some(c.psnr).filter(|v| v.is_finite()), c.identical());
    if let Some(path) = &args.diff {
        if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("png")) {
            return Err(Error::param("diff", format!("{} does not end in .png", path.display())));
        }
        let picture = Picture::from(difference(a, b)?);
        let picture = stacked(&[picture, legend(a.width)?], 0, [255; 3])?;
        write_file(path, args.force, &picture.to_png()?)?;
    }
    if args.common.json {
        println!("{:#}", to_json(a, &c, seen, &failed));
    } else {
        print(a, &c, seen);
    }
    failed.iter().for_each(|failure| eprintln!("over the bound: {failure}"));
    Ok(if failed.is_empty() { Verdict::Ok } else { Verdict::Bad })
}

fn print(a: &RgbImage, c: &ImageComparison, seen: f64) {
    println!("picture     {}×{} pixels, 8 bits, peak {PEAK}", a.width, a.height);
    println!("max error   {}", c.errors.max);
    println!("MSE         {:.6} per channel, {:.6} per pixel", c.errors.mse(), c.errors.mse_per_pixel());
    println!("PSNR        {:.2} dB ({:.2} dB with the MSE per pixel)", c.psnr, c.psnr_per_pixel);
    let scores = |name: &str, s: &ChannelScores, note: String| {
        let [r, g, b] = s.channels;
        let clamped = if s.clamped { " (a channel is negative)" } else { "" };
        println!(
            "{name:<11} {:.6} (R {r:.6} G {g:.6} B {b:.6}; geometric mean {:.6}{clamped}){note}",
            s.mean, s.geometric
        );
    };
    scores("SSIM", &c.ssim, if c.ssim_global { " smaller than 11 pixels: one window".into() } else { String::new() });
    let mut note =
        if c.ms_ssim_scales < 5 { format!(" {} scales of 5: small image", c.ms_ssim_scales) } else { String::new() };
    if c.ms_ssim_clamped {
        note += " a negative term was taken for 0";
    }
    scores("MS-SSIM", &c.ms_ssim, note);
    println!("FLIP        {seen:.6}");
    let all = a.pixels.len() as f64;
    let share =
        |class: ErrorClass| format!("{} {:.2} %", class.label(), c.classes[class as usize] as f64 / all * 100.0);
    println!("pixels      {}", ErrorClass::ALL.map(share).join(", "));
}

/// A score of three channels as JSON.
fn scores_json(s: &ChannelScores) -> Value {
    json!({ "channels": s.channels, "mean": s.mean, "geometric_mean": s.geometric, "negative_channel": s.clamped })
}

fn to_json(a: &RgbImage, c: &ImageComparison, seen: f64, failed: &[String]) -> Value {
    let (mut ssim, mut ms_ssim) = (scores_json(&c.ssim), scores_json(&c.ms_ssim));
    ssim["global"] = json!(c.ssim_global);
    ms_ssim["scales"] = json!(c.ms_ssim_scales);
    ms_ssim["clamped"] = json!(c.ms_ssim_clamped);
    json!({
        "kind": "image",
        "width": a.width,
        "height": a.height,
        "peak": PEAK,
        "max_error": c.errors.max,
        "mse_per_channel": c.errors.mse(),
        "mse_per_pixel": c.errors.mse_per_pixel(),
        "psnr": number(c.psnr),
        "psnr_per_pixel": number(c.psnr_per_pixel),
        "ssim": ssim,
        "ms_ssim": ms_ssim,
        "flip": seen,
        "classes": c.classes,
        "identical": c.identical(),
        "failed": failed,
    })
}
