//! `vug demo`: synthetic volumes, several settings, verified, measured, and pictured on one page.

#[cfg(feature = "gpu")]
mod rendered;
mod settings;

use crate::affine::ValueMap;
use crate::cli::args::Demo;
use crate::cli::output::{Verdict, bytes_text, number, progress, psnr_text, write_file};
use crate::cli::phantom::{DEFAULT_EXTENT, phantom, placement};
use crate::cli::picture::{ColorMap, Picture, difference, legend, panels, scaled, slice, spacing_on_screen, stacked};
use crate::cli::report::{Part, Report, Row};
use crate::codec::zerobit::{Threshold, Training};
use crate::convert::{ExportInfo, Target};
use crate::error::{Error, Result};
use crate::geometry::{Extent, Region};
use crate::grid::{Grid, View};
use crate::limits::Limits;
use crate::metrics::{Comparison, compare, difference::class_histogram};
use crate::source::{AtomicFile, FileSource};
use crate::volume::{self, At, Axis, EncodeReport, Quality, Volume, verify};
use serde_json::{Value, json};
use settings::{Setting, Subject, subjects};
use std::path::Path;
use std::time::Instant;

/// The plane that is pictured, and the part of it that is enlarged (x, y, width, height).
const PLANE: u32 = 95;
const DETAIL: [u32; 4] = [104, 92, 48, 48];
/// Values that become black and white: those above are metal and the test plate's steps.
const WINDOW: (f64, f64) = (0.0, 2600.0);

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
    let subjects = subjects();
    let bar = progress(args.common.quiet || args.common.json, "demo");
    #[cfg(feature = "gpu")]
    let pictures = rendered::PICTURES;
    #[cfg(not(feature = "gpu"))]
    let pictures = 0;
    bar.set_length(pictures + subjects.iter().map(|s| s.settings.len() as u64 + 1).sum::<u64>());
    let (mut parts, mut summary) = (Vec::new(), Vec::new());
    for subject in &subjects {
        let mut grid = phantom(DEFAULT_EXTENT, subject.sample_type)?;
        write_source(&grid, &dir.join(subject.source), args.force)?;
        bar.inc(1);
        let mut outcomes = Vec::new();
        for setting in &subject.settings {
            outcomes.push(measure(&mut grid, subject, setting, dir, args.force)?);
            bar.inc(1);
        }
        summary.extend(subject.settings.iter().zip(&outcomes).map(|(s, o)| outcome_json(subject, s, o)));
        if !args.common.json && !args.common.quiet {
            bar.suspend(|| print_table(subject, &grid, &outcomes));
        }
        parts.push(describe(subject, &grid, outcomes)?);
    }
    #[cfg(feature = "gpu")]
    let studio = rendered::Studio::open();
    #[cfg(feature = "gpu")]
    let sections = vec![studio.section(dir, args.force, &bar)?];
    bar.finish_and_clear();
    if args.common.json {
        #[cfg(feature = "gpu")]
        let json = json!({ "page": page, "adapter": studio.adapter(), "settings": summary });
        #[cfg(not(feature = "gpu"))]
        let json = json!({ "page": page, "settings": summary });
        println!("{json:#}");
    } else if !args.common.quiet {
        println!("All files verified. Look at {}", page.display());
    }
    let report = Report {
        title: format!("Vug: one head in grey and colour, {} settings", summary.len()),
        label: "synthetic phantom".into(),
        intro: "A head that was computed, not scanned; no patient was involved. Each setting below wrote a .vug file, which was \
                verified, read back, and compared voxel by voxel."
            .into(),
        parts,
        #[cfg(feature = "gpu")]
        sections,
        commands: vec!["vug demo          # writes this page, the volumes and the files that the lines above name".into()],
    };
    write_file(&page, args.force, report.to_html()?.as_bytes())?;
    Ok(Verdict::Ok)
}

fn print_table(subject: &Subject, grid: &Grid, outcomes: &[Outcome]) {
    let size = bytes_text(grid.bytes().len() as u64);
    println!("A synthetic head, {DEFAULT_EXTENT} voxels, {}, {size}:", subject.sample_type);
    println!("{:<18} {:>12} {:>9} {:>10} {:>10} {:>8}", "setting", "bits/voxel", "ratio", "max error", "PSNR", "SSIM");
    for (setting, o) in subject.settings.iter().zip(outcomes) {
        let (r, c) = (&o.report, &o.comparison);
        let psnr = if c.identical { "inf".into() } else { psnr_text(c.psnr, false) };
        println!(
            "{:<18} {:>12.3} {:>9.3} {:>10} {psnr:>10} {:>9.6}",
            setting.stem, r.bits_per_voxel, r.ratio_file, c.max_error, c.ssim
        );
    }
}

/// Writes the phantom where the printed command lines expect it.
fn write_source(grid: &Grid, path: &Path, force: bool) -> Result<()> {
    let info = ExportInfo { placement: &placement(), value_map: ValueMap::default(), times: None, header: None };
    let target = Target::of_path(path)?;
    for (i, path) in target.files().iter().enumerate() {
        let mut file = AtomicFile::create(path, force)?;
        target.write(i, &mut file, &mut grid.view(), &info)?;
        file.commit()?;
    }
    Ok(())
}

/// Encodes to a file, verifies it, decodes it, and compares every voxel.
fn measure(grid: &mut Grid, subject: &Subject, setting: &Setting, dir: &Path, force: bool) -> Result<Outcome> {
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
        commands: commands(subject, setting),
    };
    Ok(Outcome { report, comparison, row })
}

/// Names of what the encoder chose: in full, for the chart, and of its family.
fn names(report: &EncodeReport) -> (String, String, String) {
    if let Some(p) = report.zerobit {
        let kept = format!("{} %", f64::from(p.keep_ppm()) / 1e4);
        let mut family = String::from("zerobit");
        if p.threshold == Threshold::Global {
            family += " global";
        }
        if p.training == Training::Refined {
            family += " refined";
        }
        return (format!("{}, {kept} kept", family.replacen(' ', ", ", 2)), kept, family);
    }
    let Some(p) = report.s3dc else {
        return ("raw + zstd, lossless".into(), "raw".into(), "raw".into());
    };
    let (bits, block, ends) = (p.i_bits(), p.block(), p.endpoints().name());
    let block = if block == Extent::cube(block.x) { format!("{}³", block.x) } else { block.to_string() };
    (format!("s3dc, {bits} bit, block {block}, {ends}"), format!("{bits} bit, {block}"), format!("s3dc {ends}"))
}

fn commands(subject: &Subject, Setting { stem, arguments, .. }: &Setting) -> Vec<String> {
    let source = subject.source;
    vec![
        format!(
            "vug encode {source} {stem}.vug {arguments} --force && vug verify {stem}.vug && vug compare {source} {stem}.vug"
        ),
        format!("vug slice {stem}.vug --axis z --index {PLANE} --against {source} -o {stem}-error.png --force"),
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

/// All that the page shows of a volume.
fn describe(subject: &Subject, grid: &Grid, outcomes: Vec<Outcome>) -> Result<Part> {
    let of = |axis, index| picture(&plane(grid, axis, index), axis);
    let whole = of(Axis::Z, PLANE)?;
    let (lo, hi) = grid.range().unwrap_or_default();
    let [sx, sy, sz] = placement().spacing();
    Ok(Part {
        name: subject.name.into(),
        intro: subject.intro.into(),
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
        terms: subject.terms.iter().map(|&(term, text)| (term.into(), text.into())).collect(),
        rows: outcomes.into_iter().map(|o| o.row).collect(),
    })
}

fn outcome_json(subject: &Subject, setting: &Setting, o: &Outcome) -> Value {
    let (r, c) = (&o.report, &o.comparison);
    json!({
        "source": subject.source,
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
