//! `vug demo`.
use crate::cli::args::Demo;
use crate::cli::output::Verdict;
use crate::error::Result;
pub(super) fn run(_: &Demo) -> Result<Verdict> {
    Ok(Verdict::Ok)
}
