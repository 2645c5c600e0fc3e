//! One file per subcommand.

mod append;
mod codec_stats;
mod compare;
mod copy;
mod decode;
mod demo;
mod encode;
mod extract;
mod info;
mod pack;
mod recover;
#[cfg(feature = "gpu")]
mod render;
mod repack;
mod slice;
#[cfg(feature = "gpu")]
mod tradeoff;
mod verify;

use super::args::Command;
use super::output::Verdict;
use crate::error::Result;

/// Runs one command.
pub(super) fn run(command: Command) -> Result<Verdict> {
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::Encode(args) => encode::run(&args),
        Command::Decode(args) => decode::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Slice(args) => slice::run(&args),
        Command::Append(args) => append::run(&args),
        Command::Extract(args) => extract::run(&args),
        Command::Pack(args) => pack::run(&args),
        Command::Recover(args) => recover::run(&args),
        #[cfg(feature = "gpu")]
        Command::Render(args) => render::run(&args),
        Command::Repack(args) => repack::run(&args),
        #[cfg(feature = "gpu")]
        Command::Tradeoff(args) => tradeoff::run(&args),
    }
}
