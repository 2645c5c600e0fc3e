//! The `vug` program: arguments, files in and out, tables and JSON. It uses nothing but the library's public API.

mod args;
mod cmd;
mod fetch;
mod load;
mod open;
mod output;
mod phantom;
mod picture;
mod report;

use clap::Parser;
use std::process::ExitCode;

/// Runs the program with the process's arguments.
///
/// Exit codes: 0 fine; 1 a result is over its bound, or bricks were lost; 2 wrong usage; 3 a file is unreadable or corrupt, or cannot be written.
#[must_use]
pub fn main() -> ExitCode {
    end_quietly_with_the_reader();
    let args = match args::Vug::try_parse() {
        Ok(args) => args,
        Err(error) => {
            if error.use_stderr() && std::env::args_os().any(|a| a == "--json") {
                let message = error.to_string();
                let error = crate::Error::param("arguments", message.trim_end());
                println!("{}", serde_json::json!({ "error": output::error_json(&error) }));
            }
            error.exit() // 2, or 0 after help and version
        }
    };
    let common = args.command.common().clone();
    let jobs = common.jobs.unwrap_or(0);
    // 0 threads means one per core.
    if let Err(e) = rayon::ThreadPoolBuilder::new().num_threads(jobs).build_global() {
        eprintln!("vug: cannot start {jobs} threads: {e}");
        return ExitCode::from(3);
    }
    match cmd::run(args.command) {
        Ok(verdict) => ExitCode::from(verdict as u8),
        Err(error) => {
            if common.json {
                println!("{}", serde_json::json!({ "error": output::error_json(&error) }));
            }
            eprintln!("vug: {error}");
            ExitCode::from(output::exit_code(&error))
        }
    }
}

/// Whoever reads our output may have had enough (`vug info FILE | head -1`): then there is nobody left to tell.
fn end_quietly_with_the_reader() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let text = panic.payload_as_str().unwrap_or_default();
        if text.starts_with("failed printing to stdout") && text.contains("Broken pipe") {
            std::process::exit(0);
        }
        usual(panic);
    }));
}
