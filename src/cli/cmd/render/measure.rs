//! `--measure`: the price of each effect and what it buys, by leaving it out.

use super::run::Session;
use crate::cli::args::Render;
use crate::cli::output::number;
use crate::error::Result;
use crate::gpu::Effect;
use crate::metrics::image::RgbImage;
use crate::render::fidelity::PassTimes;
use crate::render::image::Image;
use serde_json::{Value, json};
use std::time::Instant;

/// Pictures of each kind; the median counts.
const RUNS: usize = 5;

/// A picture, and how long it took.
struct Taken {
    image: Image,
    ms: f64,
}

fn take(session: &mut Session) -> Result<Taken> {
    let view = session.view()?;
    // The first one makes pipelines and fills caches.
    let mut image = session.frame(&view)?;
    let mut ms = Vec::new();
    for _ in 0..RUNS {
        let start = Instant::now();
        image = session.frame(&view)?;
        ms.push(session.last_ms().unwrap_or_else(|| start.elapsed().as_secs_f64() * 1e3));
    }
    let median = PassTimes { name: String::new(), ms, by_device: false }.median();
    Ok(Taken { image, ms: median.unwrap_or(0.0) })
}

fn rgb(image: &Image, background: [f32; 3]) -> Result<RgbImage> {
    RgbImage::new(image.width, image.height, image.over(background))
}

/// Prints, or adds to `json`, a line for each effect of the scene.
pub(super) fn measure(args: &Render, session: &mut Session, json: &mut Value) -> Result<()> {
    let background = session.scene().background;
    let all = take(session)?;
    let effects: Vec<Effect> = session.scene().effects().iter().collect();
    let mut rows = Vec::new();
    for effect in effects {
        let mut other = session.without(effect)?;
        let taken = take(&mut other)?;
        let (a, b) = (rgb(&all.image, background)?, rgb(&taken.image, background)?);
        let ssim = crate::metrics::image::compare(&a, &b)?.ssim.mean;
        let max = all.image.max_difference(&taken.image)?;
        rows.push((effect, taken.ms, ssim, max));
    }
    if args.common.json {
        json["measured"] = json!({
            "ms": number(all.ms),
            "runs": RUNS,
            "without": rows.iter().map(|(effect, ms, ssim, max)| json!({
                "effect": effect.name(),
                "ms": number(*ms),
                "costs_ms": number(all.ms - ms),
                "ssim": number(*ssim),
                "max_difference": max,
            })).collect::<Vec<_>>(),
        });
        return Ok(());
    }
    println!("all effects {:.2} ms (median of {RUNS})", all.ms);
    println!("{:<18} {:>10} {:>10} {:>9} {:>9}", "without", "ms", "costs ms", "SSIM", "max");
    for (effect, ms, ssim, max) in rows {
        println!("{:<18} {ms:>10.2} {:>10.2} {ssim:>9.5} {max:>9.6}", effect.name(), all.ms - ms);
    }
    Ok(())
}
