//! `vug decode`: a `.vug` file becomes a foreign volume, or a series of them.

mod decoded;

use crate::cli::args::Decode;
use crate::cli::open::{open_source, tell_unfinished};
use crate::cli::output::{Verdict, error_json, progress};
use crate::convert::{ExportInfo, Target};
use crate::error::{Code, Error, Result};
use crate::geometry::{Extent, Region};
use crate::grid::{Grid, SlabReader, dense_len};
use crate::limits::{self, Limits};
use crate::source::AtomicFile;
use crate::time::Times;
use crate::volume::{At, LostBrick, Volume};
use decoded::{Decoded, Part};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::fs;
use std::io::BufWriter;
use std::ops::Range;
use std::path::PathBuf;

pub(super) fn run(args: &Decode) -> Result<Verdict> {
    let source = open_source(&args.source)?;
    let volume = if args.salvage {
        Volume::open_salvage(source, Limits::default())?
    } else {
        Volume::open(source, Limits::default())?
    };
    tell_unfinished(&volume);
    let part = part(args, &volume)?;
    // Whatever is wrong with the target is found before anything is decoded.
    let series = (part.times.len() as u32, part.channels.len() as u32);
    let target = Target::of_series(&args.target, part.region.extent(), volume.info().sample_type, series)?;
    target.files().iter().try_for_each(|path| AtomicFile::check(path, args.force))?;
    let placement = volume.info().placement.moved(part.lod + part.steps, part.region.start);
    let meta: Option<Value> = match volume.meta() {
        Ok(text) => text.and_then(|t| serde_json::from_str(&t).ok()),
        Err(_) if args.salvage => None,
        Err(e) => return Err(e),
    };
    let times = match volume.times() {
        Ok(times) => times.and_then(|t| cut(&t, &part.times)),
        Err(_) if args.salvage => None,
        Err(e) => return Err(e),
    };
    let info = ExportInfo {
        placement: &placement,
        value_map: volume.info().value_map,
        times: times.as_ref(),
        header: meta.as_ref().and_then(|m| m.get("source")),
    };
    let bar = progress(args.common.quiet || args.common.json, "decoding");
    let mut decoded = Decoded::new(&volume, part, &bar);
    write(&target, args.force, &mut decoded, &info)?;
    bar.finish_and_clear();
    if decoded.found_by_leader > 0 {
        eprintln!("note: the index is damaged; {} bricks were found without it", decoded.found_by_leader);
    }
    report(args, &volume, &decoded);
    Ok(if decoded.lost.is_empty() { Verdict::Ok } else { Verdict::Bad })
}

/// What is to be decoded, all of which the file has.
fn part(args: &Decode, volume: &Volume) -> Result<Part> {
    let info = volume.info();
    let levels = volume.levels().len();
    let Some(extent) = volume.levels().nth(usize::from(args.level)) else {
        return Err(Error::param("level", format!("the file has levels 0 to {}, not {}", levels - 1, args.level)));
    };
    let steps = args.reduce.unwrap_or(0);
    let extent = extent.div_ceil(Extent::cube(1 << steps));
    let region = args.region.unwrap_or(Region::whole(extent));
    region.check(extent)?;
    Ok(Part {
        times: chosen("time", args.time.as_ref(), info.time_steps)?,
        channels: chosen("channel", args.channel.as_ref(), info.channels)?,
        lod: args.level,
        steps,
        region,
        salvage: args.salvage,
    })
}

/// The chosen ones of `count`, or all of them.
fn chosen(field: &'static str, range: Option<&Range<u32>>, count: u32) -> Result<Range<u32>> {
    match range {
        None => Ok(0..count),
        Some(range) if range.end <= count => Ok(range.clone()),
        Some(range) => {
            let message = format!("{}:{} is outside: the file has 0 to {}", range.start, range.end, count - 1);
            Err(Error::new(Code::Range, field, message))
        }
    }
}

/// The times of these steps.
fn cut(times: &Times, steps: &Range<u32>) -> Option<Times> {
    let steps = times.steps.get(steps.start as usize..steps.end as usize)?;
    Some(Times { unit: times.unit, steps: steps.to_vec() })
}

/// Most files that are held open until all are written; more of them are closed, which lets go of their locks.
const OPEN_FILES: usize = 16;

/// Writes all files before the first appears; the header of a pair appears last.
fn write(target: &Target, force: bool, source: &mut Decoded<'_>, info: &ExportInfo<'_>) -> Result<()> {
    // Images are packed in parallel, from the whole volume.
    let mut whole = None;
    if target.is_images() {
        let limit = Limits::default().result_bytes;
        limits::check("region", dense_len(source.extent(), source.sample_type())? as u64, limit)?;
        let grid = whole.insert(Grid::zeros(source.extent(), source.sample_type())?);
        source.read_slab(0..source.extent().z, grid.bytes_mut())?;
    }
    let new_folder = target.folder().filter(|folder| !folder.exists());
    if let Some(folder) = new_folder {
        fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
    }
    let one = |(index, path): (usize, &PathBuf), source: &mut dyn SlabReader| {
        let mut file = BufWriter::new(AtomicFile::create(path, force)?);
        target.write(index, &mut file, source, info)?;
        let mut file = file.into_inner().map_err(|e| Error::io(path.display(), e.into_error()))?;
        if target.files().len() > OPEN_FILES {
            file.park()?;
        }
        Ok(file)
    };
    let files: Result<Vec<AtomicFile>> = match &whole {
        Some(grid) => target.files().par_iter().enumerate().map(|file| one(file, &mut grid.view())).collect(),
        None => target.files().iter().enumerate().map(|file| one(file, source)).collect(),
    };
    let written = files.and_then(|files| files.into_iter().try_for_each(AtomicFile::commit));
    if let (Err(_), Some(folder)) = (&written, new_folder) {
        let _ = fs::remove_dir(folder); // only an empty one goes
    }
    written
}

fn report(args: &Decode, volume: &Volume, decoded: &Decoded<'_>) {
    let (extent, t, (steps, channels)) = (decoded.extent(), decoded.sample_type(), decoded.series());
    if args.common.json {
        let lost = |(at, l): &(At, LostBrick)| {
            json!({
                "time": at.time, "channel": at.channel,
                "brick": l.brick, "region": l.region.to_string(), "error": error_json(&l.error),
            })
        };
        let cost = volume.cost();
        println!(
            "{:#}",
            json!({
                "dims": extent.to_array(), "time_steps": steps, "channels": channels, "sample_type": t.name(),
                "level": args.level, "reduce": args.reduce.unwrap_or(0),
                "reads": cost.reads, "bytes_read": cost.bytes,
                "lost": decoded.lost.iter().map(lost).collect::<Vec<Value>>(),
            })
        );
        return;
    }
    if !args.common.quiet {
        println!("{} → {}", args.source.display(), args.target.display());
        println!("volume      {extent} {t} (x, y, z)");
        if (steps, channels) != (1, 1) {
            println!("series      {steps} time steps, {channels} channels");
        }
    }
    let single = volume.info().time_steps == 1 && volume.info().channels == 1;
    for (at, l) in &decoded.lost {
        let of = if single { String::new() } else { format!("time step {}, channel {}, ", at.time, at.channel) };
        eprintln!("lost: {of}brick {:?}, voxels {}: {}", l.brick, l.region, l.error);
    }
    if !decoded.lost.is_empty() {
        eprintln!("{} bricks are lost and hold the null value", decoded.lost.len());
    }
}
