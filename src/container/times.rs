//! Section `TIME`: when the steps of a series were taken (spec chapter 3).
//!
//! | off | size | field |
//! |---|---|---|
//! | 0 | 1 | unit |
//! | 1 | 15 | zero |
//! | 16 | 8 each | time of each step, f64, ascending |

use super::wire;
use crate::error::{Code, Error, Result};
use crate::time::{TimeUnit, Times};

/// Bytes before the first time.
pub(super) const HEADER_BYTES: usize = 16;
/// Bytes of one time.
pub(super) const STEP_BYTES: usize = 8;

/// Bytes of the section (spec: SEC-18).
pub(super) fn write_to(times: &Times) -> Vec<u8> {
    let mut bytes = vec![0; HEADER_BYTES];
    bytes[0] = times.unit as u8;
    bytes.extend(times.steps.iter().flat_map(|t| t.to_le_bytes()));
    bytes
}

/// Reads the section, whose decoded bytes lie at `at`, for a volume of `time_steps` (spec: SEC-18).
///
/// # Errors
/// `E_TRUNCATED` and `E_SIZE` for a length that is not that of one time per step, `E_PARAM` for the unit, `E_RESERVED`,
/// `E_NONFINITE`, `E_ORDER`.
pub fn parse_times(bytes: &[u8], at: u64, time_steps: u32) -> Result<Times> {
    let Some((header, steps)) = bytes.split_at_checked(HEADER_BYTES) else {
        let end = at.saturating_add(bytes.len() as u64);
        return Err(Error::at(Code::Truncated, end, "TIME", "the section ends inside its first 16 bytes"));
    };
    let bad = |code, offset: u64, field, message: String| Err(Error::at(code, at + offset, field, message));
    let Some(unit) = TimeUnit::from_wire(header[0]) else {
        return bad(Code::Param, 0, "TIME.unit", format!("{} is not a unit of this version", header[0]));
    };
    wire::check_zero(&header[1..], at + 1, "TIME.reserved")?;
    if steps.len() as u64 != u64::from(time_steps) * STEP_BYTES as u64 {
        let message = format!("{} bytes of times for {time_steps} time steps", steps.len());
        return bad(Code::Size, 0, "TIME", message);
    }
    let mut times = Times { unit, steps: Vec::with_capacity(steps.len() / STEP_BYTES) };
    for (place, bytes) in (HEADER_BYTES as u64..).step_by(STEP_BYTES).zip(steps.as_chunks::<STEP_BYTES>().0) {
        let t = f64::from_le_bytes(*bytes);
        if !t.is_finite() {
            return bad(Code::NonFinite, place, "TIME.step", format!("the time is {t}"));
        }
        if let Some(last) = times.steps.last().filter(|&&last| t <= last) {
            return bad(Code::Order, place, "TIME.step", format!("{t} is not after {last}"));
        }
        times.steps.push(t);
    }
    Ok(times)
}
