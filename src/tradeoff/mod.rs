//! What accuracy costs in time: one volume, many settings, samplers and steps, each with its error and its milliseconds.
//!
//! Errors are those of pictures against a reference picture: the uncompressed volume, sampled linearly at the reference
//! step. The renderer is handed in, so that the same sweep runs on any adapter, and in tests on none.
//!
//! ```text
//! Sweep ─ sweep() ─→ Outcome { reference, rows, left_out } ─ csv(), json() ─→ text
//!                     └ paper::table_1() groups rows as Table 1 of S3Dc (2008) does
//! ```

mod concentration;
mod front;
pub mod paper;
mod setting;
mod sweep;
mod table;
#[cfg(test)]
mod tests;

pub use concentration::gradient_correlation;
pub use front::pareto;
pub use setting::{Encoded, Setting};
pub use sweep::{Outcome, Row, Shot, Sweep, Take, Taken, sweep};
pub use table::{COLUMNS, Cell, Column, csv, json};
