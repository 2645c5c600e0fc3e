//! zstd around bricks and sections: exactly one frame of known size (spec chapter 6).

use crate::error::{Code, Error, Result};
use crate::limits::MAX_ZSTD_WINDOW_LOG;
use std::cell::RefCell;
use std::ops::RangeInclusive;
use zstd::bulk::{Compressor, Decompressor};
use zstd::zstd_safe;

/// Level that the writer uses: the fastest one that halves real CT payloads.
const LEVEL: i32 = 3;

thread_local! {
    // A zstd context costs more to set up than a small brick costs to code.
    static COMPRESSOR: RefCell<Option<Compressor<'static>>> = const { RefCell::new(None) };
    static DECOMPRESSOR: RefCell<Option<Decompressor<'static>>> = const { RefCell::new(None) };
}

/// One frame with its content size, or `None` where it would not be smaller (spec: BRK-8).
///
/// # Errors
/// `E_LIMIT` where zstd cannot get its memory.
pub fn compress(bytes: &[u8]) -> Result<Option<Vec<u8>>> {
    let no_memory = |e: std::io::Error| Error::new(Code::Limit, "memory", format!("zstd cannot compress: {e}"));
    COMPRESSOR.with_borrow_mut(|slot| {
        if slot.is_none() {
            *slot = Some(Compressor::new(LEVEL).map_err(no_memory)?);
        }
        let Some(compressor) = slot else { unreachable!("set above") };
        let frame = compressor.compress(bytes).map_err(no_memory)?;
        Ok((frame.len() < bytes.len()).then_some(frame))
    })
}

/// Inflates a frame whose content has one of the lengths `lens`. `offset` and `field` say where the frame lies, for errors.
///
/// The frame must be one, whole, with content size, without dictionary, with a window of at most 8 MiB, and nothing
/// behind it (spec: BRK-9). All of that is checked before a byte is allocated, so that memory is bounded by
/// `lens` (spec: SAF-2).
///
/// # Errors
/// `E_ZSTD`; `E_LIMIT` where the memory cannot be had.
pub fn inflate(frame: &[u8], lens: RangeInclusive<u64>, offset: u64, field: &'static str) -> Result<Vec<u8>> {
    let bad =
        |what: String| Error::at(Code::Zstd, offset, field, format!("{what}; the payload is not a legal zstd frame"));
    let len = check_frame(frame, lens).map_err(bad)?;
    let too_large = || Error::at(Code::Limit, offset, field, format!("{len} bytes cannot be allocated"));
    let len = usize::try_from(len).map_err(|_| too_large())?;
    let mut out = Vec::new();
    out.try_reserve_exact(len).map_err(|_| too_large())?;
    let written = DECOMPRESSOR.with_borrow_mut(|slot| {
        if slot.is_none() {
            *slot = Some(Decompressor::new().map_err(|e| bad(e.to_string()))?);
        }
        let Some(decompressor) = slot else { unreachable!("set above") };
        decompressor.decompress_to_buffer(frame, &mut out).map_err(|e| bad(e.to_string()))
    })?;
    if written != len {
        return Err(bad(format!("{written} bytes decoded where {len} are due")));
    }
    Ok(out)
}

/// Length of a frame's content, checked as [`inflate`] does, without inflating it.
///
/// # Errors
/// `E_ZSTD`.
pub fn content_len(frame: &[u8], lens: RangeInclusive<u64>, offset: u64, field: &'static str) -> Result<u64> {
    check_frame(frame, lens)
        .map_err(|what| Error::at(Code::Zstd, offset, field, format!("{what}; the payload is not a legal zstd frame")))
}

/// Checks form and declared size of a frame without inflating it, and returns the size.
fn check_frame(frame: &[u8], lens: RangeInclusive<u64>) -> std::result::Result<u64, String> {
    let descriptor = match frame {
        [0x28, 0xB5, 0x2F, 0xFD, descriptor, _, ..] => *descriptor,
        _ => return Err("no zstd frame starts here".into()),
    };
    if descriptor & 3 != 0 {
        return Err("the frame wants a dictionary".into());
    }
    if descriptor & 8 != 0 {
        return Err("a reserved bit of the frame is set".into());
    }
    let len = match zstd_safe::get_frame_content_size(frame) {
        Ok(Some(size)) if lens.contains(&size) => size,
        Ok(Some(size)) => {
            let (least, most) = (lens.start(), lens.end());
            let due = if least == most { least.to_string() } else { format!("{least} to {most}") };
            return Err(format!("the frame declares {size} bytes where {due} are due"));
        }
        Ok(None) => return Err("the frame does not declare its content size".into()),
        Err(_) => return Err("the frame header is damaged".into()),
    };
    // A single-segment frame has no window byte: its window is its content, whose size has just been checked.
    if descriptor & 0x20 == 0 {
        let window = frame[5];
        let (log, mantissa) = (10 + u32::from(window >> 3), window & 7);
        if log > MAX_ZSTD_WINDOW_LOG || (log == MAX_ZSTD_WINDOW_LOG && mantissa != 0) {
            return Err(format!("the frame wants a window above 2^{MAX_ZSTD_WINDOW_LOG} bytes"));
        }
    }
    match zstd_safe::find_frame_compressed_size(frame) {
        Ok(size) if size == frame.len() => Ok(len),
        Ok(size) => Err(format!("{} bytes follow the frame", frame.len() - size)),
        Err(_) => Err("the frame is cut off or damaged".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(bytes: &[u8]) -> Vec<u8> {
        compress(bytes).unwrap().expect("compressible")
    }

    #[test] // spec: BRK-8; C-06
    fn only_when_smaller() {
        assert!(compress(b"").unwrap().is_none());
        let noise: Vec<u8> = (0..200u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        assert!(compress(&noise).unwrap().is_none());
        assert_eq!(inflate(&frame(&[7; 1000]), 1000..=1000, 0, "f").unwrap(), [7; 1000]);
    }

    #[test] // spec: BRK-9; C-05
    fn every_other_form_is_refused() {
        let good = frame(&[7; 1000]);
        let refused = |bytes: &[u8], len| {
            let e = inflate(bytes, len..=len, 64, "brick.payload").unwrap_err();
            assert_eq!((e.code(), e.offset()), (Code::Zstd, Some(64)), "{e}");
        };
        refused(&good, 999);
        refused(&good, 1001);
        refused(&good, u64::MAX);
        refused(&[&good[..], &good[..]].concat(), 1000);
        refused(&[&good[..], &[0]].concat(), 1000);
        for end in 0..good.len() {
            refused(&good[..end], 1000);
        }
        let skippable = [0x50, 0x2A, 0x4D, 0x18, 4, 0, 0, 0, 1, 2, 3, 4];
        refused(&skippable, 0);
        refused(&[&skippable[..], &good[..]].concat(), 1000);
        // Streaming writers leave out the content size.
        let streamed = {
            let mut encoder = zstd::stream::Encoder::new(Vec::new(), 3).unwrap();
            std::io::Write::write_all(&mut encoder, &[7; 1000]).unwrap();
            encoder.finish().unwrap()
        };
        refused(&streamed, 1000);
        // A window of 16 MiB.
        let mut encoder = zstd::stream::Encoder::new(Vec::new(), 3).unwrap();
        encoder.window_log(24).unwrap();
        encoder.include_contentsize(true).unwrap();
        encoder.set_pledged_src_size(Some(40 << 20)).unwrap();
        std::io::copy(&mut std::io::Read::take(std::io::repeat(1), 40 << 20), &mut encoder).unwrap();
        refused(&encoder.finish().unwrap(), 40 << 20);
    }

    #[test] // C-05: no flip of a frame yields other bytes of the right length unnoticed *and* too much memory
    fn flips_never_panic() {
        let good = frame(&[7; 1000]);
        for i in 0..good.len() {
            for bit in 0..8 {
                let mut bad = good.clone();
                bad[i] ^= 1 << bit;
                let _ = inflate(&bad, 1000..=1000, 0, "f");
            }
        }
    }
}
