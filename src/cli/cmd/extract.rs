//! `vug extract`: a part of a `.vug` file, without coding it again.

use super::copy::{self, Copy};
use super::pack::order;
use crate::cli::args::Extract;
use crate::cli::output::Verdict;
use crate::error::Result;
use crate::volume::{CopyOptions, Excerpt};

pub(super) fn run(args: &Extract) -> Result<Verdict> {
    let copy = Copy {
        source: &args.source,
        target: &args.target,
        options: CopyOptions {
            levels: args.levels.clone(),
            times: args.times.clone(),
            channels: args.channels.clone(),
            region: args.region,
            order: order(args.clustered),
            ..CopyOptions::default()
        },
        write: &args.write,
        common: &args.common,
        log: false,
        verb: "extracting",
    };
    copy::run(&copy, |excerpt| notes(args, excerpt))?;
    Ok(Verdict::Ok)
}

/// What differs from what was asked for.
fn notes(args: &Extract, excerpt: &Excerpt<'_>) -> Vec<String> {
    let mut notes = Vec::new();
    let region = excerpt.region();
    if let Some(wanted) = args.region.filter(|r| *r != region) {
        notes.push(format!("the box {wanted} has grown to whole bricks: {region}"));
    }
    let (kept, all) = (excerpt.levels(), excerpt.level_count());
    if args.levels.is_none() && kept.end < all {
        let (first, last) = (kept.end, all - 1);
        notes.push(format!(
            "levels {first} to {last} are left out: their bricks do not fit the box. --levels 0:{all} keeps them, with a larger box"
        ));
    }
    notes
}
