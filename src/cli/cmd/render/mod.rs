//! `vug render`: pictures of volumes.

mod keep;
mod measure;
mod run;
mod scene;
mod write;

use crate::cli::args::Render;
use crate::cli::output::{Verdict, check_no_stdout, write_file};
use crate::error::{Error, Result};
use crate::render::fidelity;
use crate::render::scene::Scene;
use crate::source::AtomicFile;
use run::Session;
use serde_json::{Value, json};
use std::path::Path;
use write::Kind;

pub(super) fn run(args: &Render) -> Result<Verdict> {
    let frames = args.turntable.map(|n| args.frames.clone().unwrap_or(0..n));
    if let (Some(frames), Some(n)) = (&frames, args.turntable)
        && frames.end > n
    {
        return Err(Error::param("frames", format!("{}: the turntable has pictures 0 to {}", frames.end - 1, n - 1)));
    }
    let kind = match &args.output {
        Some(path) => Some((path.as_path(), write::kind(path, frames.as_ref().map(ExactSizeIterator::len))?)),
        None if args.measure || args.report.is_some() || args.turntable.is_some() => {
            return Err(Error::param("output", "--measure, --report and --turntable want a picture: name it with -o"));
        }
        None => None,
    };
    if args.report.is_some() && args.report == args.output {
        return Err(Error::param("report", "it would be written over the picture; give it another name"));
    }
    // Before hours of rendering.
    if let Some((path, kind)) = kind {
        check_no_stdout(path)?;
        for i in frames.clone().filter(|_| matches!(kind, Kind::Png | Kind::Pfm)).unwrap_or(0..1) {
            AtomicFile::check(write::numbered(path, i), args.force)?;
        }
    }
    if let Some(path) = &args.report {
        AtomicFile::check(path, args.force)?;
    }
    let opened = scene::open(args)?;
    let volumes: Vec<_> = opened.volumes.iter().map(|v| &**v).collect();
    let scene = opened.scene.resolve(&volumes, &opened.folder)?;
    keep::keep(args, &opened, &scene)?;
    let mut json = json!({});
    if kind.is_none() && !args.explain {
        return Ok(Verdict::Ok); // only something was kept
    }
    let mut session = Session::new(args, scene, opened.volumes.clone())?;
    if args.explain {
        explain(args, &session, &mut json)?;
    }
    if let Some((path, kind)) = kind {
        picture(args, &mut session, path, kind, frames.map_or(0, |f| f.start), &mut json)?;
    }
    if args.measure {
        measure::measure(args, &mut session, &mut json)?;
    }
    if args.common.json {
        println!("{json:#}");
    }
    Ok(Verdict::Ok)
}

fn explain(args: &Render, session: &Session, json: &mut Value) -> Result<()> {
    let plan = session.plan()?;
    if args.common.json {
        json["plan"] = plan.to_json();
        json["plan"]["device"] = json!(session.device().adapter);
    } else {
        println!("{:<11} {}", "device", session.device().adapter);
        print!("{}", plan.explain());
    }
    Ok(())
}

/// Renders and writes one picture, or those of a turntable.
fn picture(args: &Render, session: &mut Session, path: &Path, kind: Kind, first: u32, json: &mut Value) -> Result<()> {
    let background = session.scene().background;
    let (views, mut images) = (session.views(), Vec::new());
    let mut seen = false;
    for (i, view) in (first..).zip(&views) {
        let image = session.frame(view)?;
        seen |= image.pixels.iter().any(|p| p[3] > 0.0);
        match kind {
            Kind::Png | Kind::Pfm => {
                let name = write::numbered(path, i);
                write_file(&name, args.force, &write::encoded(&image, background, kind)?)?;
            }
            Kind::Gif | Kind::Apng => images.push(image),
        }
    }
    if !images.is_empty() {
        write_file(path, args.force, &write::animated(&images, background, kind)?)?;
    }
    session.finish();
    let plan = session.plan()?;
    let volumes = session.volumes();
    let report = fidelity::report(&plan, session.scene(), &volumes, session.device(), session.times(), session.bytes());
    if let Some(path) = &args.report {
        check_no_stdout(path)?;
        write_file(path, args.force, format!("{report:#}\n").as_bytes())?;
    }
    if args.common.json {
        json["output"] = json!(path.to_string_lossy());
        json["pictures"] = json!(views.len());
        json["report"] = report;
    } else if !args.common.quiet {
        println!("{}", path.display());
        print!("{}", summary(session.scene(), &report, views.len()));
        if !seen {
            eprintln!(
                "note: nothing is in view: look at the camera, the clipping box, and the values (vug info) under the transfer function or iso value"
            );
        }
        for note in session.notes() {
            eprintln!("note: {note}");
        }
    }
    Ok(())
}

fn summary(scene: &Scene, report: &Value, pictures: usize) -> String {
    let [w, h] = scene.size;
    let mut text = format!("picture     {w}×{h}, {}, {}", scene.sampler, scene.projection);
    if pictures > 1 {
        text += &format!(", {pictures} of them");
    }
    for level in report["levels"].as_array().into_iter().flatten() {
        let bound = level["error_bound"].as_f64().map_or("not known".into(), |v| format!("at most {v}"));
        text += &format!("\nlevel       {} of volume {}: values are off by {bound}", level["level"], level["volume"]);
        let filter = level["filter_error"].as_f64().unwrap_or(0.0);
        if filter > 0.0 {
            text += &format!(", {filter} of it by the texture unit's fractions of 8 bits");
        }
    }
    let missing = report["bytes"]["missing"].as_u64().unwrap_or(0);
    if missing > 0 {
        text += &format!("\nmissing     {missing} bytes that no commit has");
    }
    text += &format!("\ndevice      {}", report["device"]["adapter"].as_str().unwrap_or_default());
    for pass in report["passes"].as_array().into_iter().flatten() {
        let ms = pass["median_ms"].as_f64().map_or("not measured".into(), |ms| format!("{ms:.2} ms"));
        let clock = if pass["by_device"] == true { "device clock" } else { "wall clock" };
        text += &format!("\npass        {}: {ms} ({clock})", pass["name"].as_str().unwrap_or_default());
    }
    text + "\n"
}
