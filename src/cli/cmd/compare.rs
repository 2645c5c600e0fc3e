//! `vug compare`: how far two volumes, or two pictures, are apart.

mod image;

use crate::cli::args::Compare;
use crate::cli::load::{Series, check_import, load_series};
use crate::cli::output::{Verdict, number, progress, psnr_text};
use crate::error::{Error, Result};
use crate::metrics::{Comparison, compare};
use crate::volume::Bound;
use serde_json::{Value, json};

pub(super) fn run(args: &Compare) -> Result<Verdict> {
    check_import(&[&args.a, &args.b], &args.import)?;
    if let Some((a, b)) = image::pictures(args)? {
        return image::run(args, &a, &b);
    }
    if args.diff.is_some() {
        let message = "difference pictures are made of two PNG files of 8 bits; for volumes use vug slice --against";
        return Err(Error::param("diff", message));
    }
    let bar = progress(args.common.quiet || args.common.json, "comparing");
    let a = load_series(&args.a, &args.import)?;
    let b = load_series(&args.b, &args.import)?;
    if a.series != b.series || a.series != (1, 1) && a.extent != b.extent {
        let text = |s: &Series| format!("{} × {} time steps × {} channels", s.extent, s.series.0, s.series.1);
        return Err(Error::param("dims", format!("{} against {}", text(&a), text(&b))));
    }
    // Slices are compared one by one, so that it does not matter that all volumes lie upon one another.
    let c = compare(&a.grid.view(), &b.grid.view())?;
    bar.finish_and_clear();
    let [x, y, plane] = c.max_error_at;
    let (volume, z) = (plane / a.extent.z, plane % a.extent.z);
    let (time, channel) = (volume / a.series.1, volume % a.series.1);
    let failed = failures(args, &c);
    if args.common.json {
        let mut json = comparison_json(&c, &failed);
        json["max_error_at"] = json!([x, y, z]);
        if a.series != (1, 1) {
            json["max_error_in"] = json!({ "time": time, "channel": channel });
        }
        println!("{json:#}");
    } else {
        println!("range       {} (max − min of {})", c.range, args.a.display());
        let of = match a.series {
            (1, 1) => String::new(),
            _ => format!(" of time step {time}, channel {channel}"),
        };
        println!("max error   {} at {x},{y},{z} (x,y,z){of}", c.max_error);
        println!("mean error  {:.6}", c.mean_error);
        println!("RMSE        {:.6}", c.rmse);
        println!("PSNR        {}", psnr_text(c.psnr, c.identical));
        println!(
            "SSIM        {:.6}{}",
            c.ssim,
            if c.ssim_global { " (slices smaller than 11: one window each)" } else { "" }
        );
    }
    for failure in &failed {
        eprintln!("over the bound: {failure}");
    }
    Ok(if failed.is_empty() { Verdict::Ok } else { Verdict::Bad })
}

fn failures(args: &Compare, c: &Comparison) -> Vec<String> {
    failures_of(args, c.range, c.max_error, c.psnr, c.identical)
}

/// What is over the bounds that were given.
fn failures_of(args: &Compare, range: f64, max_error: f64, psnr: Option<f64>, identical: bool) -> Vec<String> {
    let mut failed = Vec::new();
    if let Some(bound) = args.max_error {
        let limit = match bound {
            Bound::Absolute(v) => v,
            Bound::Percent(p) => p / 100.0 * range,
        };
        if max_error > limit {
            failed.push(format!("max error {max_error} > {limit}"));
        }
    }
    // No PSNR means an infinite one only where the volumes are identical.
    if let Some(least) = args.min_psnr.filter(|&least| !identical && psnr.is_none_or(|found| found < least)) {
        failed.push(format!("PSNR {} < {least} dB", psnr_text(psnr, false)));
    }
    failed
}

/// A comparison as JSON.
fn comparison_json(c: &Comparison, failed: &[String]) -> Value {
    json!({
        "range": number(c.range),
        "max_error": number(c.max_error),
        "max_error_at": c.max_error_at,
        "mean_error": number(c.mean_error),
        "rmse": number(c.rmse),
        "psnr": c.psnr.map(number),
        "ssim": number(c.ssim),
        "identical": c.identical,
        "failed": failed,
    })
}
