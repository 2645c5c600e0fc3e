//! TIFF files, classic and big: one page each, or all slices as the pages of one file.
//!
//! Grey of 1 to 64 bit, integers and floats, and 8-bit RGB; uncompressed, LZW, deflate or PackBits, in strips or tiles.

use super::image::{Header, check_same, check_size, damaged, damaged_io, no_colours, opaque};
use crate::convert::stored::Kind;
use crate::convert::stream::pass;
use crate::convert::{fault, payload};
use crate::error::{Code, Error, Result};
use crate::geometry::Extent;
use crate::grid::{AlignedBytes, Grid, SlabReader};
use crate::limits::MAX_AXIS;
use crate::voxel::SampleType;
use std::fs::File;
use std::io::{self, BufReader, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use tiff::decoder::{Decoder, DecodingSampleType, Limits};
use tiff::encoder::{TiffEncoder, TiffKind, colortype};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError};

/// Most strips or tiles of a page, and the decoder's bytes for each of them.
const MAX_LIST: usize = 16 << 20;
const NUMBER_BYTES: usize = 32;

type Reader = Decoder<BufReader<File>>;

fn failed(path: &Path, error: TiffError) -> Error {
    match error {
        TiffError::IoError(e) => damaged_io(path, e),
        TiffError::UnsupportedError(e) => {
            fault::unsupported(path, "pixels", format!("{e}; save it uncompressed, as 8- or 16-bit grey or 8-bit RGB"))
        }
        TiffError::LimitsExceeded | TiffError::IntSizeError => {
            Error::new(Code::Limit, "pixels", format!("{}: the image needs too much memory", path.display()))
        }
        e => damaged(path, e),
    }
}

/// How the pixels that the decoder delivers become samples.
#[derive(Clone, Copy)]
enum Unpack {
    /// They are samples.
    Dense,
    /// So many bits each, rows starting at whole bytes.
    Bits(u8),
    /// Alpha of so many bytes behind each.
    Alpha(usize),
    /// Red, green and blue apart, so many bytes each.
    Planes(usize),
}

/// An open file at one of its pages.
struct Page {
    header: Header,
    unpack: Unpack,
    /// Bytes that the decoder delivers.
    delivered: u64,
}

fn open(path: &Path) -> Result<(Reader, u64)> {
    let (file, len) = payload::open(path)?;
    let decoder = Decoder::new(BufReader::new(file)).map_err(|e| failed(path, e))?;
    let longest = usize::try_from(len).unwrap_or(usize::MAX);
    let mut limits = Limits::default();
    // The decoder takes memory for lists by their declared length; pixels go into our own buffer.
    limits.decoding_buffer_size = (longest.min(MAX_LIST) + 128) * NUMBER_BYTES;
    limits.intermediate_buffer_size = longest;
    Ok((decoder.with_limits(limits), len))
}

/// Understands the page at which the decoder stands.
fn page(path: &Path, decoder: &mut Reader, file_bytes: u64) -> Result<Page> {
    let failed = |e| failed(path, e);
    let size = decoder.dimensions().map_err(failed)?;
    let color = decoder.colortype().map_err(failed)?;
    let (bits, samples) = (u64::from(color.bit_depth()), u64::from(color.num_samples()));
    check_size(path, file_bytes, size, bits * samples)?;
    // Tiles can be larger than the image; a row of them is held while it is cut.
    let (across, down) = decoder.chunk_dimensions();
    check_size(path, file_bytes.saturating_add(1 << 20), (across, down.min(size.1)), bits * samples)?;
    let layout = decoder.image_buffer_layout().map_err(failed)?;
    let (kind, unpack) = match color {
        ColorType::Gray(n @ (1 | 2 | 4)) => (Kind::U8, Unpack::Bits(n)),
        ColorType::Gray(8 | 16 | 32 | 64) => {
            let kind = layout.sample_type.and_then(kind_of);
            (kind.ok_or_else(|| no_colours(path, format!("{bits}-bit {:?}", layout.sample_format)))?, Unpack::Dense)
        }
        ColorType::Multiband { bit_depth: n @ (8 | 16), num_samples: 2 } if has_alpha(decoder) => {
            (if n == 8 { Kind::U8 } else { Kind::U16 }, Unpack::Alpha(usize::from(n / 8)))
        }
        ColorType::RGB(8) if layout.planes == 3 => (Kind::Rgb8, Unpack::Planes(layout.len)),
        ColorType::RGB(8) => (Kind::Rgb8, Unpack::Dense),
        ColorType::RGBA(8) => (Kind::Rgb8, Unpack::Alpha(1)),
        ColorType::RGB(n) | ColorType::RGBA(n) => return Err(no_colours(path, format!("{n}-bit colours"))),
        other => return Err(no_colours(path, format!("{other:?} pixels"))),
    };
    if layout.planes > 1 && !matches!(unpack, Unpack::Planes(_)) {
        return Err(no_colours(path, format!("{} planes", layout.planes)));
    }
    let header = Header { size, kind };
    let delivered = match unpack {
        Unpack::Dense | Unpack::Planes(_) => header.bytes(),
        Unpack::Bits(n) => u64::from(size.1) * (u64::from(size.0) * u64::from(n)).div_ceil(8),
        Unpack::Alpha(alpha) => header.bytes() / kind.bytes() as u64 * (kind.bytes() + alpha) as u64,
    };
    if delivered != layout.complete_len as u64 {
        let message = format!("its rows make {} bytes, not {delivered}", layout.complete_len);
        return Err(damaged(path, message));
    }
    Ok(Page { header, unpack, delivered })
}

fn kind_of(stored: DecodingSampleType) -> Option<Kind> {
    Some(match stored {
        DecodingSampleType::U8 => Kind::U8,
        DecodingSampleType::U16 => Kind::U16,
        DecodingSampleType::U32 => Kind::U32,
        DecodingSampleType::U64 => Kind::U64,
        DecodingSampleType::I8 => Kind::I8,
        DecodingSampleType::I16 => Kind::I16,
        DecodingSampleType::I32 => Kind::I32,
        DecodingSampleType::I64 => Kind::I64,
        DecodingSampleType::F32 => Kind::F32,
        DecodingSampleType::F64 => Kind::F64,
        _ => return None,
    })
}

/// Whether the last sample of a pixel is its alpha.
fn has_alpha(decoder: &mut Reader) -> bool {
    let extra = decoder.find_tag(Tag::ExtraSamples).ok().flatten();
    extra.and_then(|v| v.into_u16_vec().ok()).is_some_and(|v| matches!(v[..], [1 | 2]))
}

/// Decodes the page at which the decoder stands.
fn decode_page(path: &Path, decoder: &mut Reader, page: &Page, out: &mut [u8]) -> Result<()> {
    if matches!(page.unpack, Unpack::Dense) {
        return decoder.read_image_bytes(out).map_err(|e| failed(path, e));
    }
    let len = usize::try_from(page.delivered).unwrap_or(usize::MAX);
    let mut pixels = AlignedBytes::zeroed(len)?;
    decoder.read_image_bytes(pixels.as_mut_slice()).map_err(|e| failed(path, e))?;
    let pixels = pixels.as_slice();
    let width = page.header.size.0;
    match page.unpack {
        Unpack::Dense => {}
        Unpack::Bits(bits) => {
            let row_bytes = (width as usize * usize::from(bits)).div_ceil(8);
            for (row, out) in pixels.chunks_exact(row_bytes).zip(out.chunks_exact_mut(width as usize)) {
                unpack_bits(row, bits, out);
            }
        }
        Unpack::Alpha(alpha) => opaque(path, width, pixels, page.header.kind.bytes(), alpha, out)?,
        Unpack::Planes(plane) => {
            for (i, out) in out.chunks_exact_mut(3).enumerate() {
                out.copy_from_slice(&[pixels[i], pixels[plane + i], pixels[2 * plane + i]]);
            }
        }
    }
    Ok(())
}

/// Values of 1, 2 or 4 bit, the first one in the high bits; white becomes 255.
fn unpack_bits(row: &[u8], bits: u8, out: &mut [u8]) {
    let (per_byte, mask) = (usize::from(8 / bits), (1u8 << bits) - 1);
    for (i, out) in out.iter_mut().enumerate() {
        let shift = 8 - bits * (i % per_byte + 1) as u8;
        *out = (row[i / per_byte] >> shift & mask) * (255 / mask);
    }
}

/// The header of a file that must have one page.
pub(super) fn header(path: &Path) -> Result<Header> {
    let (mut decoder, len) = open(path)?;
    let header = page(path, &mut decoder, len)?.header;
    if decoder.more_images() {
        let message = "a slice of a folder has one page, this file has several; name the file itself to read its pages";
        return Err(fault::unsupported(path, "pages", message));
    }
    Ok(header)
}

/// Decodes the first page.
pub(super) fn decode(path: &Path, expected: Header, out: &mut [u8]) -> Result<()> {
    let (mut decoder, len) = open(path)?;
    let page = page(path, &mut decoder, len)?;
    check_same(path, page.header, expected)?;
    decode_page(path, &mut decoder, &page, out)
}

/// The pages of one file, as slices.
pub(super) struct Pages {
    path: PathBuf,
    file_bytes: u64,
    /// Number of pages.
    pub count: u32,
    /// Decoders that nobody uses at the moment. They know where the pages are: a new one would have to walk to them.
    idle: Mutex<Vec<Reader>>,
}

impl Pages {
    /// Reads the headers of all pages, which must be the same.
    ///
    /// # Errors
    /// `E_UNSUPPORTED` for time steps and channels, or pages of several sizes or types.
    pub(super) fn open(path: &Path) -> Result<(Pages, Header)> {
        let (mut decoder, file_bytes) = open(path)?;
        let first = page(path, &mut decoder, file_bytes)?.header;
        let description = decoder.find_tag(Tag::ImageDescription).ok().flatten().and_then(|v| v.into_string().ok());
        let mut count = 1;
        while decoder.more_images() {
            decoder.next_image().map_err(|e| failed(path, e))?;
            let found = page(path, &mut decoder, file_bytes)?.header;
            if found != first {
                return Err(super::differ(path, &format!("page {}", count + 1), found, "page 1", first));
            }
            count += 1;
            if count > MAX_AXIS {
                return Err(fault::unsupported(
                    path,
                    "pages",
                    format!("more than {MAX_AXIS} pages are too many slices"),
                ));
            }
        }
        check_description(path, description.as_deref().unwrap_or_default(), count)?;
        let idle = Mutex::new(vec![decoder]);
        Ok((Pages { path: path.to_owned(), file_bytes, count, idle }, first))
    }

    /// Decodes page `index`.
    pub(super) fn decode(&self, index: u32, expected: Header, out: &mut [u8]) -> Result<()> {
        let path = &self.path;
        let idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut decoder = idle.map_or_else(|| open(path).map(|(decoder, _)| decoder), Ok)?;
        decoder.seek_to_image(index as usize).map_err(|e| failed(path, e))?;
        let page = page(path, &mut decoder, self.file_bytes)?;
        check_same(path, page.header, expected)?;
        decode_page(path, &mut decoder, &page, out)?;
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(decoder);
        Ok(())
    }
}

/// ImageJ and OME say in words that pages are channels or time steps, or that slices follow that are no pages.
fn check_description(path: &Path, text: &str, pages: u32) -> Result<()> {
    let number = |key: &str, end: char| -> Option<u32> {
        let rest = &text[text.find(key)? + key.len()..];
        rest.split(end).next()?.trim().parse().ok()
    };
    let refuse = |what: String| Err(fault::unsupported(path, "ImageDescription", what));
    let (image_j, ome) = (text.starts_with("ImageJ="), text.contains("<OME"));
    for (word, key, ome_key) in [("channels", "\nchannels=", " SizeC=\""), ("time steps", "\nframes=", " SizeT=\"")] {
        let count = if image_j { number(key, '\n') } else { number(ome_key, '"').filter(|_| ome) };
        // The channels of a colour are one page.
        if let Some(n) = count.filter(|&n| n > 1 && pages > 1 && pages.is_multiple_of(n)) {
            return refuse(format!("{pages} pages are {n} {word}; these come in a later version, save one of them"));
        }
    }
    match number("\nimages=", '\n').filter(|&n| image_j && n != pages) {
        Some(n) => refuse(format!("{n} slices are announced, but {pages} are pages; save it as a TIFF with all pages")),
        None => Ok(()),
    }
}

/// Writes planes as the pages of one uncompressed file; a big one where 4 GiB are not enough.
pub(super) fn encode<W: Write + Seek>(
    out: W,
    source: &mut dyn SlabReader,
    planes: std::ops::Range<u32>,
) -> io::Result<()> {
    let plane = Grid::zeros(Extent { z: 1, ..source.extent() }, source.sample_type()).map_err(pass)?;
    // Headers of pages and lists of strips are far below a sixteenth of the rest, or else below 256 MiB.
    let written = if plane.bytes().len() as u64 * planes.len() as u64 > 0xE000_0000 {
        TiffEncoder::new_big(out).and_then(|encoder| pages(encoder, source, plane, planes))
    } else {
        TiffEncoder::new(out).and_then(|encoder| pages(encoder, source, plane, planes))
    };
    written.map_err(|e| match e {
        TiffError::IoError(e) => e,
        e => io::Error::other(e),
    })
}

fn pages<W: Write + Seek, K: TiffKind>(
    mut encoder: TiffEncoder<W, K>,
    source: &mut dyn SlabReader,
    mut plane: Grid,
    planes: std::ops::Range<u32>,
) -> Result<(), TiffError> {
    let (w, h) = (plane.extent().x, plane.extent().y);
    for z in planes {
        source.read_slab(z..z + 1, plane.bytes_mut()).map_err(pass)?;
        match plane.sample_type() {
            SampleType::U8 => encoder.write_image::<colortype::Gray8>(w, h, plane.samples::<u8>())?,
            SampleType::U16 => encoder.write_image::<colortype::Gray16>(w, h, plane.samples::<u16>())?,
            SampleType::I16 => encoder.write_image::<colortype::GrayI16>(w, h, plane.samples::<i16>())?,
            SampleType::F32 => encoder.write_image::<colortype::Gray32Float>(w, h, plane.samples::<f32>())?,
            SampleType::Rgb8 => encoder.write_image::<colortype::RGB8>(w, h, plane.bytes())?,
        }
    }
    Ok(())
}
