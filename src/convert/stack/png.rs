//! PNG files. Palettes and small grey values are expanded to 8 bit, white becoming 255.

use super::image::{Header, check_same, check_size, damaged, damaged_io, no_colours, opaque};
use crate::convert::payload;
use crate::convert::stored::Kind;
use crate::error::{Code, Error, Result};
use crate::grid::AlignedBytes;
use crate::voxel::SampleType;
use png::{BitDepth, ColorType, DecodeOptions, Decoder, DecodingError, Limits, Reader, Transformations};
use std::fs::File;
use std::io::{self, BufReader, Write};
use std::path::Path;

/// Bytes that a decoder may take besides the pixels: some rows of the widest image.
const WORK_BYTES: usize = 256 << 20;

fn failed(path: &Path, error: DecodingError) -> Error {
    match error {
        DecodingError::IoError(e) => damaged_io(path, e),
        DecodingError::LimitsExceeded => {
            Error::new(Code::Limit, "pixels", format!("{}: the image needs too much memory", path.display()))
        }
        e => damaged(path, e),
    }
}

/// Opens a file, its header checked; the alpha's bytes come with it.
fn open(path: &Path) -> Result<(Reader<BufReader<File>>, Header, usize)> {
    let (file, len) = payload::open(path)?;
    let mut options = DecodeOptions::default();
    options.set_ignore_adler32(false);
    let mut decoder = Decoder::new_with_options(BufReader::new(file), options);
    decoder.set_limits(Limits { bytes: WORK_BYTES });
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    decoder.set_transformations(Transformations::EXPAND);
    let info = decoder.read_header_info().map_err(|e| failed(path, e))?;
    let size = (info.width, info.height);
    check_size(path, len, size, info.color_type.samples() as u64 * info.bit_depth as u64)?;
    let reader = decoder.read_info().map_err(|e| failed(path, e))?;
    let (kind, alpha) = match reader.output_color_type() {
        (ColorType::Grayscale, BitDepth::Sixteen) => (Kind::U16, 0),
        (ColorType::GrayscaleAlpha, BitDepth::Sixteen) => (Kind::U16, 2),
        (ColorType::Rgb | ColorType::Rgba, BitDepth::Sixteen) => return Err(no_colours(path, "16-bit colours")),
        (ColorType::Grayscale, _) => (Kind::U8, 0),
        (ColorType::GrayscaleAlpha, _) => (Kind::U8, 1),
        (ColorType::Rgb | ColorType::Indexed, _) => (Kind::Rgb8, 0),
        (ColorType::Rgba, _) => (Kind::Rgb8, 1),
    };
    Ok((reader, Header { size, kind }, alpha))
}

pub(super) fn header(path: &Path) -> Result<Header> {
    open(path).map(|(_, header, _)| header)
}

pub(super) fn decode(path: &Path, expected: Header, out: &mut [u8]) -> Result<()> {
    let (mut reader, header, alpha) = open(path)?;
    check_same(path, header, expected)?;
    let mut frame = |buffer: &mut [u8]| {
        let info = reader.next_frame(buffer).map_err(|e| failed(path, e))?;
        // The first picture of an animation may be smaller than its canvas.
        if (info.width, info.height) == header.size { Ok(()) } else { Err(damaged(path, "its first frame is smaller")) }
    };
    if alpha == 0 {
        frame(out)?;
    } else {
        let color = header.kind.bytes();
        let mut pixels = AlignedBytes::zeroed(out.len() / color * (color + alpha))?;
        frame(pixels.as_mut_slice())?;
        opaque(path, header.size.0, pixels.as_slice(), color, alpha, out)?;
    }
    if header.kind == Kind::U16 && cfg!(target_endian = "little") {
        out.as_chunks_mut::<2>().0.iter_mut().for_each(|sample| sample.reverse());
    }
    Ok(())
}

/// Writes one image; `pixels` in this machine's byte order.
pub(super) fn encode(out: &mut dyn Write, size: (u32, u32), sample_type: SampleType, pixels: &[u8]) -> io::Result<()> {
    let mut encoder = png::Encoder::new(out, size.0, size.1);
    encoder.set_color(if sample_type == SampleType::Rgb8 { ColorType::Rgb } else { ColorType::Grayscale });
    encoder.set_depth(if sample_type == SampleType::U16 { BitDepth::Sixteen } else { BitDepth::Eight });
    let mut writer = encoder.write_header()?;
    if sample_type == SampleType::U16 && cfg!(target_endian = "little") {
        let mut swapped = pixels.to_vec();
        swapped.as_chunks_mut::<2>().0.iter_mut().for_each(|sample| sample.reverse());
        writer.write_image_data(&swapped)?;
    } else {
        writer.write_image_data(pixels)?;
    }
    Ok(writer.finish()?)
}
