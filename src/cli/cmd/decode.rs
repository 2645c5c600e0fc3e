//! `vug decode`: a `.vug` file becomes a foreign volume.

use crate::cli::args::Decode;
use crate::cli::open::open_source;
use crate::cli::output::{Verdict, error_json, progress};
use crate::convert::{ExportInfo, Target};
use crate::error::{Error, Result};
use crate::geometry::{Extent, Region};
use crate::grid::{Grid, dense_len};
use crate::limits::{self, Limits};
use crate::source::AtomicFile;
use crate::volume::{At, LostBrick, Volume};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::fs;
use std::io::BufWriter;
use std::path::PathBuf;

pub(super) fn run(args: &Decode) -> Result<Verdict> {
    let source = open_source(&args.source)?;
    let volume = if args.salvage {
        Volume::open_salvage(source, Limits::default())?
    } else {
        Volume::open(source, Limits::default())?
    };
    let at = At::lod(args.level);
    let levels = volume.levels().len();
    let Some(extent) = volume.levels().nth(usize::from(args.level)) else {
        return Err(Error::param("level", format!("the file has levels 0 to {}, not {}", levels - 1, args.level)));
    };
    let steps = args.reduce.unwrap_or(0);
    let extent = extent.div_ceil(Extent::cube(1 << steps));
    let region = args.region.unwrap_or(Region::whole(extent));
    region.check(extent)?;
    // Whatever is wrong with the target is found before anything is decoded.
    let target = Target::of_volume(&args.target, region.extent(), volume.info().sample_type)?;
    target.files().iter().try_for_each(|path| AtomicFile::check(path, args.force))?;
    let bar = progress(args.common.quiet || args.common.json, "decoding");
    let (grid, lost) = if args.salvage {
        let salvaged = volume.salvage(at, region)?;
        if salvaged.found_by_leader > 0 {
            eprintln!("note: the index is damaged; {} bricks were found without it", salvaged.found_by_leader);
        }
        (salvaged.grid, salvaged.lost)
    } else {
        let grid = if steps > 0 { volume.read_reduced(at, steps, region)? } else { decode(&volume, at, region, &bar)? };
        (grid, Vec::new())
    };
    bar.finish_and_clear();
    let placement = volume.info().placement.moved(args.level + steps, region.start);
    let meta: Option<Value> = match volume.meta() {
        Ok(text) => text.and_then(|t| serde_json::from_str(&t).ok()),
        Err(_) if args.salvage => None,
        Err(e) => return Err(e),
    };
    let info = ExportInfo {
        placement: &placement,
        value_map: volume.info().value_map,
        header: meta.as_ref().and_then(|m| m.get("source")),
    };
    write(&target, args.force, &grid, &info)?;
    report(args, &volume, &grid, &lost);
    Ok(if lost.is_empty() { Verdict::Ok } else { Verdict::Bad })
}

/// Most files that are held open until all are written; more of them are closed, which lets go of their locks.
const OPEN_FILES: usize = 16;

/// Writes all files before the first appears; the header of a pair appears last.
fn write(target: &Target, force: bool, grid: &Grid, info: &ExportInfo<'_>) -> Result<()> {
    let new_folder = target.folder().filter(|folder| !folder.exists());
    if let Some(folder) = new_folder {
        fs::create_dir_all(folder).map_err(|e| Error::io(folder.display(), e))?;
    }
    let one = |(index, path): (usize, &PathBuf)| {
        let mut file = BufWriter::new(AtomicFile::create(path, force)?);
        target.write(index, &mut file, grid, info)?;
        let mut file = file.into_inner().map_err(|e| Error::io(path.display(), e.into_error()))?;
        if target.files().len() > OPEN_FILES {
            file.park()?;
        }
        Ok(file)
    };
    let files: Result<Vec<AtomicFile>> = target.files().par_iter().enumerate().map(one).collect();
    let written = files.and_then(|files| files.into_iter().try_for_each(AtomicFile::commit));
    if let (Err(_), Some(folder)) = (&written, new_folder) {
        let _ = fs::remove_dir(folder); // only an empty one goes
    }
    written
}

/// Decodes a region in slabs, so that the bar moves.
fn decode(volume: &Volume, at: At, region: Region, bar: &indicatif::ProgressBar) -> Result<Grid> {
    let t = volume.info().sample_type;
    limits::check("region", dense_len(region.extent(), t)? as u64, Limits::default().result_bytes)?;
    let mut grid = Grid::zeros(region.extent(), volume.info().sample_type)?;
    bar.set_length(u64::from(region.extent().z));
    let step = 4 << volume.info().brick_log2;
    let mut rest = grid.view_mut();
    let mut z = region.start[2];
    while z < region.end[2] {
        let end = (z + step).min(region.end[2]);
        let (now, later) = rest.split_at_z(end - z);
        let part = Region { start: [region.start[0], region.start[1], z], end: [region.end[0], region.end[1], end] };
        volume.read_region_into(at, part, now)?;
        bar.inc(u64::from(end - z));
        (rest, z) = (later, end);
    }
    Ok(grid)
}

fn report(args: &Decode, volume: &Volume, grid: &Grid, lost: &[LostBrick]) {
    if args.common.json {
        let lost: Vec<Value> = lost
            .iter()
            .map(|l| json!({ "brick": l.brick, "region": l.region.to_string(), "error": error_json(&l.error) }))
            .collect();
        let cost = volume.cost();
        println!(
            "{:#}",
            json!({
                "dims": grid.extent().to_array(), "sample_type": grid.sample_type().name(), "level": args.level,
                "reduce": args.reduce.unwrap_or(0),
                "reads": cost.reads, "bytes_read": cost.bytes, "lost": lost,
            })
        );
        return;
    }
    if !args.common.quiet {
        println!("{} → {}", args.source.display(), args.target.display());
        println!("volume      {} {} (x, y, z)", grid.extent(), grid.sample_type());
    }
    for l in lost {
        eprintln!("lost: brick {:?}, voxels {}: {}", l.brick, l.region, l.error);
    }
    if !lost.is_empty() {
        eprintln!("{} bricks are lost and hold the null value", lost.len());
    }
}
