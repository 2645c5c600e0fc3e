//! Trying again: what is worth it, and how long to wait.

use super::HttpOptions;
use crate::error::{Code, Error, Result};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// An attempt that brought at least so much is not counted: a long range over a bad line comes piece by piece.
const PROGRESS: usize = 64 << 10;

/// Longest sleep before it is looked whether the source was stopped.
const NAP: Duration = Duration::from_millis(20);

/// Why one request did not bring all that was wanted.
pub(super) enum Failure {
    /// Another attempt may succeed; the server may have said after which time, or the attempt was not a bad one.
    Passing(Error, Option<Duration>),
    /// It would fail again.
    Final(Error),
}

/// The attempts at one range.
pub(super) struct Attempts<'a> {
    options: &'a HttpOptions,
    stop: &'a AtomicBool,
    failed: u32,
    /// Spreads the waits of ranges that failed together.
    seed: u64,
}

impl<'a> Attempts<'a> {
    pub(super) fn new(options: &'a HttpOptions, stop: &'a AtomicBool, offset: u64) -> Self {
        Attempts { options, stop, failed: 0, seed: offset }
    }

    /// After an attempt that brought `progress` bytes: returns when the next may begin.
    ///
    /// # Errors
    /// The failure, where it is final or was the last one allowed.
    pub(super) fn after(&mut self, failure: Failure, progress: usize) -> Result<()> {
        let (error, wait) = match failure {
            Failure::Final(error) => return Err(error),
            Failure::Passing(error, wait) => (error, wait),
        };
        if progress >= PROGRESS {
            self.failed = 0;
        }
        if self.stop.load(Ordering::Relaxed) {
            return Err(stopped());
        }
        if self.failed == self.options.retries {
            let tries = self.failed + 1;
            let message = format!("{}; given up after {tries} attempts, try again later", error.message());
            return Err(match error.offset() {
                Some(offset) => Error::at(error.code(), offset, error.field().to_owned(), message),
                None => Error::new(error.code(), error.field().to_owned(), message),
            });
        }
        let wait = match wait {
            Some(asked) => asked,
            None => self.back_off(),
        };
        self.failed += 1;
        self.sleep(wait.min(self.options.backoff_max))
    }

    /// Twice as long after each failure, three quarters to five quarters of it.
    fn back_off(&mut self) -> Duration {
        self.seed = self.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(1);
        #[allow(clippy::cast_precision_loss, reason = "eight bits")]
        let spread = 0.75 + (self.seed >> 56) as f64 / 512.0;
        self.options.backoff.saturating_mul(1 << self.failed.min(16)).min(self.options.backoff_max).mul_f64(spread)
    }

    fn sleep(&self, wait: Duration) -> Result<()> {
        let end = Instant::now().checked_add(wait);
        while let Some(left) = end.and_then(|end| end.checked_duration_since(Instant::now())) {
            if self.stop.load(Ordering::Relaxed) {
                return Err(stopped());
            }
            std::thread::sleep(left.min(NAP));
        }
        Ok(())
    }
}

pub(super) fn stopped() -> Error {
    Error::new(Code::Source, "url", "the source was stopped; open it again to read on")
}
