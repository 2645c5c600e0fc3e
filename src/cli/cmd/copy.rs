//! What `pack`, `repack` and `extract` share: bricks go from one file to another as they are.

use crate::cli::args::{Common, Write};
use crate::cli::open::open_source;
use crate::cli::output::{bytes_text, check_no_stdout, check_target, progress};
use crate::error::Result;
use crate::limits::Limits;
use crate::source::AtomicFile;
use crate::volume::{CopyOptions, CopyReport, Excerpt, Volume};
use serde_json::{Value, json};
use std::path::Path;

/// One copy: where from, where to, and what.
pub(super) struct Copy<'a> {
    pub(super) source: &'a Path,
    pub(super) target: &'a Path,
    pub(super) options: CopyOptions,
    pub(super) write: &'a Write,
    pub(super) common: &'a Common,
    /// Whether a log is written.
    pub(super) log: bool,
    /// What the bar says.
    pub(super) verb: &'static str,
}

/// Copies, and says what was copied; `notes` has remarks on the excerpt.
pub(super) fn run(copy: &Copy<'_>, notes: impl Fn(&Excerpt<'_>) -> Vec<String>) -> Result<()> {
    let volume = Volume::open(open_source(copy.source)?, Limits::default())?;
    let CopyOptions { levels, times, channels, region, .. } = &copy.options;
    let is_part = levels.is_some() || times.is_some() || channels.is_some() || region.is_some();
    // A file may be packed anew in its own place, as long as nothing is left out.
    if is_part || volume.head().unfinished() > 0 {
        check_target(copy.source, copy.target)?;
    } else {
        check_no_stdout(copy.target)?;
    }
    let excerpt = volume.excerpt(&CopyOptions { file_id: copy.write.file_id, ..copy.options.clone() })?;
    let mut notes = notes(&excerpt);
    let unfinished = volume.head().unfinished();
    if unfinished > 0 {
        notes.push(format!(
            "{unfinished} bytes behind the last commit, which a writer did not finish, are left out; `vug recover` saves what is whole of them"
        ));
    }
    let mut json = describe(&excerpt);
    let text = summary(&excerpt);
    let report = write(copy, excerpt)?;
    if copy.common.json {
        add_report(&mut json, &report);
        json["notes"] = json!(notes);
        println!("{json:#}");
    } else if !copy.common.quiet {
        println!("{} → {}", copy.source.display(), copy.target.display());
        print!("{text}{}", report_text(&report));
        notes.iter().for_each(|note| eprintln!("note: {note}"));
    }
    Ok(())
}

/// Copies a volume that is open, and says nothing but errors.
#[cfg(feature = "gpu")]
pub(super) fn run_quietly(copy: &Copy<'_>) -> Result<()> {
    let volume = Volume::open(open_source(copy.source)?, Limits::default())?;
    check_target(copy.source, copy.target)?;
    write(copy, volume.excerpt(&CopyOptions { file_id: copy.write.file_id, ..copy.options.clone() })?).map(|_| ())
}

/// Writes the target.
fn write(copy: &Copy<'_>, excerpt: Excerpt<'_>) -> Result<CopyReport> {
    let mut file = AtomicFile::create(copy.target, copy.write.force)?;
    let bar = progress(copy.common.quiet || copy.common.json, copy.verb);
    let mut advance = |done, total| {
        bar.set_length(total);
        bar.set_position(done);
    };
    let report = match copy.log {
        true => excerpt.write_log(&mut file, &mut advance)?.1,
        false => excerpt.write_head(&mut file, &mut advance)?.1,
    };
    file.commit()?;
    bar.finish_and_clear();
    Ok(report)
}

fn describe(excerpt: &Excerpt<'_>) -> Value {
    let d = excerpt.descriptor();
    let (levels, times, channels) = (excerpt.levels(), excerpt.times(), excerpt.channels());
    json!({
        "dims": d.dims.to_array(), "sample_type": d.sample_type.name(), "region": excerpt.region().to_string(),
        "levels": [levels.start, levels.end], "times": [times.start, times.end], "channels": [channels.start, channels.end],
    })
}

fn summary(excerpt: &Excerpt<'_>) -> String {
    let d = excerpt.descriptor();
    format!(
        "volume      {} {} (x, y, z), {} level(s), {} time step(s), {} channel(s)\n",
        d.dims, d.sample_type, d.lod_count, d.time_steps, d.channels
    )
}

pub(super) fn add_report(json: &mut Value, report: &CopyReport) {
    let file = &report.file;
    json["bytes"] = json!(file.len);
    json["bricks"] = json!({ "stored": file.stored, "constant": file.constant, "empty": file.empty });
    json["stored_bytes"] = json!(file.stored_bytes);
    json["payload_bytes"] = json!(report.payload_bytes);
    json["converted"] = json!(report.converted);
}

pub(super) fn report_text(report: &CopyReport) -> String {
    let file = &report.file;
    let (stored, constant, empty) = (file.stored, file.constant, file.empty);
    let payload = bytes_text(report.payload_bytes);
    format!(
        "bricks      {stored} stored, {constant} constant, {empty} empty\n\
         payloads    {} of {payload} before zstd; {} converted\n\
         size        {}\n",
        bytes_text(file.stored_bytes),
        report.converted,
        bytes_text(file.len)
    )
}
