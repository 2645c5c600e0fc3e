//! `vug repack`: zstd around bricks, or none.

use super::copy::{self, Copy};
use super::pack::order;
use crate::cli::args::Repack;
use crate::cli::output::Verdict;
use crate::error::Result;
use crate::volume::{CopyOptions, ZstdPolicy};

pub(super) fn run(args: &Repack) -> Result<Verdict> {
    let zstd = if args.zstd { ZstdPolicy::Compress } else { ZstdPolicy::Inflate };
    let copy = Copy {
        source: &args.source,
        target: &args.target,
        options: CopyOptions { order: order(args.clustered), zstd, ..CopyOptions::default() },
        write: &args.write,
        common: &args.common,
        log: false,
        verb: "repacking",
    };
    copy::run(&copy, |_| Vec::new())?;
    Ok(Verdict::Ok)
}
