//! `vug append`: further time steps for a log.

use super::copy::add_report;
use crate::cli::args::{Append, NanArg};
use crate::cli::fetch;
use crate::cli::load::{check_import, import_options, is_vug};
use crate::cli::open::open_volume;
use crate::cli::output::{Verdict, bytes_text, progress};
use crate::convert::ImportOptions;
use crate::error::{Error, Result};
use crate::limits::Limits;
use crate::source::FileSource;
use crate::time::Times;
use crate::volume::{self, Appender, CopyReport, EncodeOptions, NonFinite, Volume};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

pub(super) fn run(args: &Append) -> Result<Verdict> {
    let sources: Vec<&Path> = args.sources.iter().map(PathBuf::as_path).collect();
    check_import(&sources, &args.import)?;
    let mut log = Appender::open(&args.file)?;
    let unfinished = log.unfinished_bytes();
    let bricks = log.unfinished_bricks()?;
    if bricks > 0 && !args.cut {
        let message = format!(
            "{bricks} finished bricks lie behind the last commit of {}, whose writer was stopped: save them first (`vug recover {0} SAVED`, then `vug pack --log SAVED LOG`), or cut them off (--cut)",
            args.file.display()
        );
        return Err(Error::param("log", message));
    }
    if unfinished > 0 && !args.common.quiet {
        eprintln!("note: {unfinished} bytes behind the last commit, which a killed writer left, are cut off");
    }
    if !args.time.is_empty() && args.time.len() < sources.len() {
        // Each source has a step at least: what does not fit is said before the first is appended.
        let message = format!("{} times for {} sources", args.time.len(), sources.len());
        return Err(Error::param("time", message));
    }
    let mut times = args.time.iter().copied();
    let mut reports = Vec::new();
    for source in sources {
        let (steps, own) = encoded(args, source, log.volume())?;
        let first = log.volume().info().time_steps;
        note_error(args, source, log.volume(), &steps);
        let new = new_times(log.volume(), steps.info().time_steps, &mut times, own)?;
        let bar = progress(args.common.quiet || args.common.json, "appending");
        let report = log.append(&steps, new, &mut |done, total| {
            bar.set_length(total);
            bar.set_position(done);
        })?;
        bar.finish_and_clear();
        reports.push(describe(args, source, first..log.volume().info().time_steps, &report));
    }
    if args.common.json {
        let steps = log.volume().info().time_steps;
        println!("{:#}", json!({ "time_steps": steps, "bytes": log.volume().file_len(), "appended": reports }));
    }
    Ok(Verdict::Ok)
}

/// Says where the new steps are further from their source than the file says of its own: parameters are kept, and with them no
/// bound on the error.
fn note_error(args: &Append, source: &Path, log: &Volume, steps: &Volume) {
    let largest = |volume: &Volume| volume.info().achieved.map(|a| a.max_error);
    if let Some((old, new)) = largest(log).zip(largest(steps))
        && new > old
        && !args.common.quiet
    {
        let (file, source) = (args.file.display(), source.display());
        eprintln!(
            "note: the largest error of {source} is {new}, that of {file} so far {old}: the codec's parameters are kept, \
             not a bound on the error"
        );
    }
}

fn describe(args: &Append, source: &Path, steps: std::ops::Range<u32>, report: &CopyReport) -> Value {
    if !args.common.json && !args.common.quiet {
        let (first, last) = (steps.start, steps.end - 1);
        println!("{} → {}, time step(s) {first} to {last}", source.display(), args.file.display());
        println!(
            "bricks      {} stored, {} constant, {} empty\nsize        {} more payload, {} in all",
            report.file.stored,
            report.file.constant,
            report.file.empty,
            bytes_text(report.file.stored_bytes),
            bytes_text(report.file.len)
        );
    }
    let mut json = json!({ "source": source.display().to_string(), "times": [steps.start, steps.end] });
    add_report(&mut json, report);
    json
}

/// The source as a volume that fits the log, and the times that it says its steps were taken at.
fn encoded(args: &Append, source: &Path, log: &Volume) -> Result<(Volume, Option<Times>)> {
    if is_vug(source)? {
        let steps = open_volume(source)?;
        let times = steps.times()?;
        return Ok((steps, times));
    }
    let options = import_options(source, &args.import)?;
    let options = ImportOptions { memory: args.memory / 2, temp_dir: Some(temp_dir(args)), ..options };
    let mut import = fetch::import(source, &options)?;
    if import.spooled > 0 && !args.common.quiet {
        eprintln!("note: {} of samples wait in a temporary file: memory has no room", bytes_text(import.spooled));
    }
    let d = log.info();
    let (extent, t) = (import.reader.extent(), import.reader.sample_type());
    let channels = import.reader.series().1;
    if (extent, t, channels) != (d.dims, d.sample_type, d.channels) {
        let message = format!(
            "{} has {extent} {t} and {channels} channel(s), but {} {} {} and {}; all steps of a series are alike",
            source.display(),
            args.file.display(),
            d.dims,
            d.sample_type,
            d.channels
        );
        return Err(Error::param("source", message));
    }
    let options = EncodeOptions {
        zstd: !args.no_zstd,
        non_finite: match args.nan {
            NanArg::Reject => NonFinite::Reject,
            NanArg::Null => NonFinite::Null,
        },
        // That of the source: where it is not the log's, appending says so.
        value_map: import.value_map,
        memory: args.memory,
        temp_dir: Some(temp_dir(args)),
        ..log.encode_options()?
    };
    let fail = |e| Error::io(temp_dir(args).display(), e);
    let file = tempfile::tempfile_in(temp_dir(args)).map_err(fail)?;
    let bar = progress(args.common.quiet || args.common.json, "encoding");
    volume::encode(&mut *import.reader, &file, &options, &mut |done, total| {
        bar.set_length(total);
        bar.set_position(done);
    })?;
    bar.finish_and_clear();
    Ok((Volume::open(FileSource::from_file(file, source)?, Limits::default())?, import.times))
}

fn temp_dir(args: &Append) -> PathBuf {
    let of_file = || args.file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_owned();
    args.temp_dir.clone().unwrap_or_else(of_file)
}

/// The times of `steps` new time steps: those given, else those of the source, else the log's interval goes on.
fn new_times(
    log: &Volume,
    steps: u32,
    given: &mut dyn Iterator<Item = f64>,
    own: Option<Times>,
) -> Result<Option<Times>> {
    let given: Vec<f64> = given.take(steps as usize).collect();
    let Some(old) = log.times()? else {
        let unasked = "the log has no times of its steps; leave --time out";
        return if given.is_empty() { Ok(None) } else { Err(Error::param("time", unasked)) };
    };
    let last = old.steps.last().copied().unwrap_or_default();
    let times = if given.len() as u64 == u64::from(steps) {
        given
    } else if !given.is_empty() {
        return Err(Error::param("time", format!("{} times given for {steps} new steps", given.len())));
    } else if let Some(own) = own.filter(|own| own.unit == old.unit && own.steps.first().is_some_and(|&t| t > last)) {
        own.steps
    } else if let Some(interval) = old.interval() {
        Times::regular(old.unit, last + interval, interval, steps).steps
    } else {
        let message = format!(
            "the log's steps are not at regular times: say when the new ones were taken, in {}",
            old.unit.name()
        );
        return Err(Error::param("time", message));
    };
    Ok(Some(Times { unit: old.unit, steps: times }))
}
