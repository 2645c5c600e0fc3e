//! JPEG files: 8-bit grey or colour, always lossy. Orientation tags are not heeded: rows are taken as they are stored.

use super::image::{Header, check_same, check_size, damaged, damaged_io, no_colours};
use crate::convert::stored::Kind;
use crate::convert::{fault, payload};
use crate::error::{Error, Result};
use crate::limits;
use crate::voxel::SampleType;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;
use zune_jpeg::zune_core::bytestream::{ZByteIoError, ZByteReaderTrait, ZCursor};
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Longest file: many times the largest image.
const MAX_FILE_BYTES: u64 = 1 << 30;

/// Quality of what is written, of 100; colours at full resolution.
const QUALITY: u8 = 95;

fn failed(path: &Path, error: DecodeErrors) -> Error {
    match error {
        DecodeErrors::IoErrors(ZByteIoError::StdIoError(e)) => damaged_io(path, e),
        DecodeErrors::IoErrors(_) | DecodeErrors::ExhaustedData => damaged(path, "it ends too early"),
        DecodeErrors::Unsupported(scheme) => {
            fault::unsupported(path, "pixels", format!("{scheme:?}; save the image as baseline JPEG or PNG"))
        }
        e => damaged(path, e),
    }
}

/// Starts to decode a file of `len` bytes, its header checked.
fn start<R: ZByteReaderTrait>(path: &Path, reader: R, len: u64) -> Result<(JpegDecoder<R>, Header)> {
    // Strict: bad data are an error, not an image with a grey rest.
    let longest = usize::from(u16::MAX);
    let options = DecoderOptions::default().set_strict_mode(true).set_max_width(longest).set_max_height(longest);
    let mut decoder = JpegDecoder::new_with_options(reader, options);
    decoder.decode_headers().map_err(|e| failed(path, e))?;
    let info = decoder.info().ok_or_else(|| damaged(path, "it has no header"))?;
    let (kind, color) = match (info.components, decoder.input_colorspace()) {
        (1, _) => (Kind::U8, ColorSpace::Luma),
        (3, Some(ColorSpace::YCbCr | ColorSpace::RGB)) => (Kind::Rgb8, ColorSpace::RGB),
        (n, space) => return Err(no_colours(path, format!("{n} components ({space:?})"))),
    };
    decoder.set_options(options.jpeg_set_out_colorspace(color));
    let size = (u32::from(info.width), u32::from(info.height));
    check_size(path, len, size, 8 * kind.bytes() as u64)?;
    Ok((decoder, Header { size, kind }))
}

pub(super) fn header(path: &Path) -> Result<Header> {
    let (file, len) = payload::open(path)?;
    start(path, BufReader::new(file), len).map(|(_, header)| header)
}

pub(super) fn decode(path: &Path, expected: Header, out: &mut [u8]) -> Result<()> {
    let (mut file, len) = payload::open(path)?;
    limits::check("size", len, MAX_FILE_BYTES).map_err(|e| fault::relabel(path, "size", &e))?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(|e| fault::io(path, e))?;
    let (mut decoder, header) = start(path, ZCursor::new(&bytes), len)?;
    check_same(path, header, expected)?;
    if !has_end(&bytes) {
        return Err(damaged(path, "it ends too early"));
    }
    decoder.decode_into(out).map_err(|e| failed(path, e))
}

/// Whether the mark of the image's end follows its first scan. The decoder fills in what is missing, and says nothing.
fn has_end(bytes: &[u8]) -> bool {
    let mut at = 2;
    // Segments of the header: mark, length in 16 bits with itself counted.
    while let Some([0xFF, mark, high, low]) = bytes.get(at..at + 4) {
        match mark {
            0xFF => at += 1,
            0xDA => return bytes[at..].windows(2).rev().any(|pair| pair == [0xFF, 0xD9]),
            _ => at += 2 + usize::from(u16::from_be_bytes([*high, *low])),
        }
    }
    false
}

/// Writes one image of u8 or rgb8.
pub(super) fn encode(out: &mut dyn Write, size: (u16, u16), sample_type: SampleType, pixels: &[u8]) -> io::Result<()> {
    let color = match sample_type {
        SampleType::Rgb8 => jpeg_encoder::ColorType::Rgb,
        _ => jpeg_encoder::ColorType::Luma,
    };
    jpeg_encoder::Encoder::new(out, QUALITY).encode(pixels, size.0, size.1, color).map_err(|e| match e {
        jpeg_encoder::EncodingError::IoError(e) => e,
        e => io::Error::other(e),
    })
}
