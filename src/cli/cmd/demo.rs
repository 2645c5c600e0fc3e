//! `vug demo`: a synthetic volume, several settings, verified, measured, and pictured on one page.

use crate::affine::ValueMap;
use crate::cli::args::Demo;
use crate::cli::output::{Verdict, bytes_text, number, progress, psnr_text, write_file};
use crate::cli::phantom::{DEFAULT_EXTENT, phantom, placement};
use crate::cli::picture::{ColorMap, Picture, difference, legend, panels, scaled, slice, spacing_on_screen, stacked};
use crate::cli::report::{Report, Row};
use crate::codec::s3dc::Endpoints;
use crate::convert::{ExportInfo, Target};
use crate::error::{Error, Result};
use crate::geometry::{Extent, Region};
use crate::grid::{Grid, View};
use crate::limits::Limits;
use crate::metrics::{Comparison, compare, difference::class_histogram};
use crate::source::{AtomicFile, FileSource};
use crate::volume::{self, At, Axis, Bound, CodecChoice, EncodeOptions, EncodeReport, Quality, Volume, verify};
use crate::voxel::SampleType;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

/// The plane that is pictured, and the part of it that is enlarged (x, y, width, height).
const PLANE: u32 = 95;
const DETAIL: [u32; 4] = [104, 92, 48, 48];
/// Values that become black and white: those above are metal and the test plate's steps.
const WINDOW: (f64, f64) = (0.0, 2600.0);
const SOURCE: &str = "phantom.nrrd";

/// One way to encode.
struct Setting {
    /// Stem of its files.
    stem: &'static str,
    /// The same on the command line.
    arguments: &'static str,
    options: EncodeOptions,
}

fn settings() -> Vec<Setting> {
    let setting = |stem, arguments, codec, quality, endpoints| {
        let options = EncodeOptions { codec, quality, endpoints, placement: placement(), ..EncodeOptions::default() };
        Setting { stem, arguments, options }
    };
    let s3dc = |stem, arguments, index_bits, block, endpoints| {
        let quality = Quality::Explicit { index_bits, block: Extent::cube(block) };
        setting(stem, arguments, CodecChoice::S3dc, quality, endpoints)
    };
    use Endpoints::{Fitted, MinMax};
    let default = EncodeOptions::default().quality;
    vec![
        s3dc("1bit-4", "--index-bits 1", 1, 4, MinMax),
        s3dc("1bit-4-fitted", "--index-bits 1 --endpoints fitted", 1, 4, Fitted),
        s3dc("2bit-4", "--index-bits 2", 2, 4, MinMax),
        s3dc("2bit-4-fitted", "--index-bits 2 --endpoints fitted", 2, 4, Fitted),
        s3dc("4bit-16", "--index-bits 4 --block 16", 4, 16, MinMax),
        s3dc("4bit-4", "--index-bits 4 --block 4", 4, 4, MinMax),
        s3dc("4bit-4-fitted", "--index-bits 4 --endpoints fitted", 4, 4, Fitted),
        s3dc("8bit-8", "--index-bits 8 --block 8", 8, 8, MinMax),
        setting(
            "within-1-percent",
            "--max-error 1%",
            CodecChoice::Auto,
            Quality::MaxError(Bound::Percent(1.0)),
            MinMax,
        ),
        setting("lossless", "--codec raw", CodecChoice::Raw, default, MinMax),
    ]
}

/// A setting's results.
struct Outcome {
    report: EncodeReport,
    comparison: Comparison,
    row: Row,
}

pub(super) fn run(args: &Demo) -> Result<Verdict> {
    let dir = &args.dir;
    std::fs::create_dir_all(dir).map_err(|e| Error::io(dir.display(), e))?;
    let page = dir.join("index.html");
    if page.exists() && !args.force {
        let message = format!("{} exists; give another folder, or --force to overwrite it", page.display());
        return Err(Error::param("dir", message));
    }
    let settings = settings();
    let bar = progress(args.common.quiet || args.common.json, "demo");
    bar.set_length(settings.len() as u64 + 1);
    let mut grid = phantom(DEFAULT_EXTENT, SampleType::U16)?;
    write_source(&grid, dir, args.force)?;
    bar.inc(1);
    let mut outcomes = Vec::new();
    for setting in &settings {
        outcomes.push(measure(&mut grid, setting, dir, args.force)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let summary: Vec<Value> = settings.iter().zip(&outcomes).map(|(s, o)| outcome_json(s, o)).collect();
    if args.common.json {
        println!("{:#}", json!({ "page": page, "settings": summary }));
    } else if !args.common.quiet {
        println!("A synthetic head, {DEFAULT_EXTENT} voxels, u16, {}:", bytes_text(grid.bytes().len() as u64));
        println!(
            "{:<18} {:>12} {:>9} {:>10} {:>10} {:>8}",
            "setting", "bits/voxel", "ratio", "max error", "PSNR", "SSIM"
        );
        for (setting, o) in settings.iter().zip(&outcomes) {
            let (r, c) = (&o.report, &o.comparison);
            let psnr = if c.identical { "inf".into() } else { psnr_text(c.psnr, false) };
            println!(
                "{:<18} {:>12.3} {:>9.3} {:>10} {psnr:>10} {:>9.6}",
                setting.stem, r.bits_per_voxel, r.ratio_file, c.max_error, c.ssim
            );
        }
        println!("All files verified. Look at {}", page.display());
    }
    let html = describe(&grid, outcomes)?.to_html()?;
    write_file(&page, args.force, html.as_bytes())?;
    Ok(Verdict::Ok)
}

/// Writes the phantom where the printed command lines expect it.
fn write_source(grid: &Grid, dir: &Path, force: bool) -> Result<()> {
    let info = ExportInfo { placement: &placement(), value_map: ValueMap::default(), header: None };
    let target = Target::of_path(&dir.join(SOURCE))?;
    for (i, path) in target.files().iter().enumerate() {
        let mut file = AtomicFile::create(path, force)?;
        target.write(i, &mut file, grid, &info)?;
        file.commit()?;
    }
    Ok(())
}

/// Encodes to a file, verifies it, decodes it, and compares every voxel.
fn measure(grid: &mut Grid, setting: &Setting, dir: &Path, force: bool) -> Result<Outcome> {
    let path = dir.join(format!("{}.vug", setting.stem));
    let started = Instant::now();
    let mut file = AtomicFile::create(&path, force)?;
    let report = volume::encode(grid, &mut file, &setting.options, &mut |_, _| {})?;
    file.commit()?;
    let encode_s = started.elapsed().as_secs_f64();
    if let Some(error) = verify(&FileSource::open(&path)?, &Limits::default(), &mut |_, _| {}).errors.pop() {
        return Err(error); // a file that was just written: a full disk, or a defect of this program
    }
    let started = Instant::now();
    let decoded = Volume::open_path(&path)?.read(At::default())?;
    let decode_s = started.elapsed().as_secs_f64();
    let comparison = compare(&grid.view(), &decoded.view())?;

    let spread = comparison.range;
    let (a, b) = (plane(grid, Axis::Z, PLANE), plane(&decoded, Axis::Z, PLANE));
    let (before, after, error) = (picture(&a, Axis::Z)?, picture(&b, Axis::Z)?, difference(&a, &b, Axis::Z, spread)?);
    let three = scaled(&panels(&[before, after.clone(), error.clone()], 2, [255; 3])?, (1.0, 1.0), 2)?;
    let whole = stacked(&[three.clone(), scaled(&legend(three.size().0 / 2)?, (1.0, 1.0), 2)?], 0, [255; 3])?;
    write_file(&dir.join(format!("{}.png", setting.stem)), force, &whole.to_png()?)?;

    let (mut name, short, family) = names(&report);
    if let Quality::MaxError(_) = setting.options.quality {
        name = format!("{} → {name}", setting.arguments);
    }
    let row = Row {
        name,
        short,
        family,
        ratio_formula: report.ratio_formula.filter(|_| report.s3dc.is_some()),
        ratio_payload: report.ratio_payload,
        ratio_file: report.ratio_file,
        bits_per_voxel: report.bits_per_voxel,
        max_error: comparison.max_error,
        range: spread,
        rmse: comparison.rmse,
        psnr: comparison.psnr,
        ssim: comparison.ssim,
        encode_s,
        decode_s,
        classes: class_histogram(&grid.view(), &decoded.view(), spread)?,
        pictures: vec![(after.clone(), error.clone()), (detail(&after)?, detail(&error)?)],
        commands: commands(setting),
    };
    Ok(Outcome { report, comparison, row })
}

/// Names of what the encoder chose: in full, for the chart, and of its family.
fn names(report: &EncodeReport) -> (String, String, String) {
    let Some(p) = report.s3dc else {
        return ("raw + zstd, lossless".into(), "raw".into(), "raw".into());
    };
    let (bits, block, ends) = (p.i_bits(), p.block(), p.endpoints().name());
    let block = if block == Extent::cube(block.x) { format!("{}³", block.x) } else { block.to_string() };
    (format!("s3dc, {bits} bit, block {block}, {ends}"), format!("{bits} bit, {block}"), format!("s3dc {ends}"))
}

fn commands(Setting { stem, arguments, .. }: &Setting) -> Vec<String> {
    vec![
        format!(
            "vug encode {SOURCE} {stem}.vug {arguments} --force && vug verify {stem}.vug && vug compare {SOURCE} {stem}.vug"
        ),
        format!("vug slice {stem}.vug --axis z --index {PLANE} --against {SOURCE} -o {stem}-error.png --force"),
    ]
}

/// Plane `index` across `axis`, as a view.
fn plane(grid: &Grid, axis: Axis, index: u32) -> View<'_> {
    let mut region = Region::whole(grid.extent());
    (region.start[axis as usize], region.end[axis as usize]) = (index, index + 1);
    grid.view().sub(&region)
}

fn picture(plane: &View<'_>, axis: Axis) -> Result<Picture> {
    let picture = slice(plane, axis, WINDOW, &ColorMap::default())?;
    scaled(&picture, spacing_on_screen(axis, placement().spacing()), 1)
}

fn detail(picture: &Picture) -> Result<Picture> {
    let [x, y, width, height] = DETAIL;
    picture.crop(x, y, width, height)
}

/// All that the page shows.
fn describe(grid: &Grid, outcomes: Vec<Outcome>) -> Result<Report> {
    let of = |axis, index| picture(&plane(grid, axis, index), axis);
    let whole = of(Axis::Z, PLANE)?;
    let (lo, hi) = grid.range().unwrap_or_default();
    let [sx, sy, sz] = placement().spacing();
    Ok(Report {
        title: format!("Vug: one volume, {} settings", outcomes.len()),
        label: "synthetic phantom".into(),
        intro: "A head that was computed, not scanned; no patient was involved. It has what block compression finds hard: \
                bone and metal with hard edges, folded soft tissue of low contrast, a plate with line pairs, steps and a \
                ramp, grain, and a large background of exactly 0. Each setting below wrote a .vug file, which was verified, \
                read back, and compared voxel by voxel."
            .into(),
        facts: vec![
            ("volume".into(), format!("{} voxels (x, y, z), {}", grid.extent(), grid.sample_type())),
            ("values".into(), format!("{lo} … {hi}")),
            ("spacing".into(), format!("{sx} × {sy} × {sz} mm")),
            ("size".into(), bytes_text(grid.bytes().len() as u64)),
            ("threads".into(), rayon::current_num_threads().to_string()),
        ],
        gallery: vec![
            (format!("axial, z = {PLANE}"), whole.clone()),
            ("coronal, y = 110".into(), of(Axis::Y, 110)?),
            ("sagittal, x = 104".into(), of(Axis::X, 104)?),
        ],
        views: vec![(format!("z = {PLANE}"), whole.clone()), ("part of it".into(), detail(&whole)?)],
        rows: outcomes.into_iter().map(|o| o.row).collect(),
        commands: vec!["vug demo          # writes this page, the volume and the files that the lines above name".into()],
    })
}

fn outcome_json(setting: &Setting, o: &Outcome) -> Value {
    let (r, c) = (&o.report, &o.comparison);
    json!({
        "file": format!("{}.vug", setting.stem),
        "codec": o.row.name,
        "bytes": r.bytes,
        "bits_per_voxel": number(r.bits_per_voxel),
        "ratio": { "formula": r.ratio_formula.map(number), "payload": number(r.ratio_payload), "file": number(r.ratio_file) },
        "max_error": number(c.max_error),
        "rmse": number(c.rmse),
        "psnr": c.psnr.map(number),
        "identical": c.identical,
        "ssim": number(c.ssim),
    })
}
