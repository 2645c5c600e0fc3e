//! Bits per sample.

use crate::error::{Error, Result};

/// Bits that each of `samples` takes of `bytes`.
///
/// # Errors
/// `E_PARAM` for no samples at all.
pub fn bits_per_sample(bytes: u64, samples: u64) -> Result<f64> {
    if samples == 0 {
        return Err(Error::param("samples", "nothing has no bits per sample"));
    }
    Ok(bytes as f64 * 8.0 / samples as f64)
}
