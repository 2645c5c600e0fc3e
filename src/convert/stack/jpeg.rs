//! JPEG files: 8-bit grey or colour, always lossy. Orientation tags are not heeded: rows are taken as they are stored.

use super::image::{Header, check_same, check_size, damaged, damaged_io, no_colours};
use crate::convert::stored::Kind;
use crate::convert::{fault, payload};
use crate::error::{Error, Result};
use crate::voxel::SampleType;
use std::fs::File;
use std::io::{self, BufReader, Write};
use std::path::Path;
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;
use zune_jpeg::zune_core::bytestream::ZByteIoError;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

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

/// Opens a file, its header checked.
fn open(path: &Path) -> Result<(JpegDecoder<BufReader<File>>, Header)> {
    let (file, len) = payload::open(path)?;
    // Strict: a file that ends early is an error, not an image with a grey rest.
    let longest = usize::from(u16::MAX);
    let options = DecoderOptions::default().set_strict_mode(true).set_max_width(longest).set_max_height(longest);
    let mut decoder = JpegDecoder::new_with_options(BufReader::new(file), options);
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
    open(path).map(|(_, header)| header)
}

pub(super) fn decode(path: &Path, expected: Header, out: &mut [u8]) -> Result<()> {
    let (mut decoder, header) = open(path)?;
    check_same(path, header, expected)?;
    decoder.decode_into(out).map_err(|e| failed(path, e))
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
