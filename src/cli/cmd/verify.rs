//! `vug verify`: every byte against the spec.

use crate::cli::args::Verify;
use crate::cli::open::open_source;
use crate::cli::output::{Verdict, error_json, progress};
use crate::error::Result;
use crate::limits::Limits;
use crate::volume::verify;
use serde_json::{Value, json};

pub(super) fn run(args: &Verify) -> Result<Verdict> {
    let source = open_source(&args.file)?;
    let bar = progress(args.common.quiet || args.common.json, "verifying");
    let report = verify(&source, &Limits::default(), &mut |done, total| {
        bar.set_length(total);
        bar.set_position(done);
    });
    bar.finish_and_clear();
    if args.common.json {
        let errors: Vec<Value> = report.errors.iter().map(error_json).collect();
        println!(
            "{:#}",
            json!({ "ok": report.is_ok(), "errors": errors, "bricks": report.bricks, "bytes": report.bytes })
        );
    } else if report.is_ok() {
        if !args.common.quiet {
            println!("{}: valid, {} bytes, {} stored bricks", args.file.display(), report.bytes, report.bricks);
        }
    } else {
        for error in &report.errors {
            println!("{error}");
        }
        eprintln!("{}: {} error(s)", args.file.display(), report.errors.len());
    }
    Ok(if report.is_ok() { Verdict::Ok } else { Verdict::Corrupt })
}
