//! `vug pack`: a `.vug` file anew, with its head complete.

use super::copy::{self, Copy};
use crate::cli::args::Pack;
use crate::cli::output::Verdict;
use crate::error::Result;
use crate::volume::{BrickOrder, CopyOptions};

pub(super) fn run(args: &Pack) -> Result<Verdict> {
    let copy = Copy {
        source: &args.source,
        target: &args.target,
        options: CopyOptions { order: order(args.clustered), ..CopyOptions::default() },
        write: &args.write,
        common: &args.common,
        log: args.log,
        verb: "packing",
    };
    copy::run(&copy, |_| Vec::new())?;
    Ok(Verdict::Ok)
}

/// The order of bricks that was asked for.
pub(super) fn order(clustered: bool) -> BrickOrder {
    if clustered { BrickOrder::Clustered } else { BrickOrder::File }
}
