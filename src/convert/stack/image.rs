//! One image: its format, its size and type, its pixels.

use super::{jpeg, png, tiff};
use crate::convert::fault;
use crate::convert::stored::Kind;
use crate::error::{Code, Error, Result};
use crate::limits::MAX_AXIS;
use crate::voxel::SampleType;
use std::io;
use std::path::Path;

/// Most bytes that a byte of an image file can become. Deflate: 1032; LZW: about 1400; JPEG: a block of one bit for each
/// component, at most 1300.
const MAX_RATIO: u64 = 2048;

/// A format of images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::convert) enum Image {
    /// Lossless; 8 or 16 bit.
    Png,
    /// Lossless; every type.
    Tiff,
    /// Lossy; 8 bit.
    Jpeg,
}

/// What a file's header says of its image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Header {
    /// Pixels per row and column.
    pub size: (u32, u32),
    /// Type of a pixel, without transparency.
    pub kind: Kind,
}

impl Header {
    /// Bytes of all pixels.
    pub(super) fn bytes(&self) -> u64 {
        u64::from(self.size.0) * u64::from(self.size.1) * self.kind.bytes() as u64
    }
}

impl Image {
    /// The format that a file name's ending stands for.
    pub(in crate::convert) fn of_path(path: &Path) -> Option<Image> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "png" => Some(Image::Png),
            "tif" | "tiff" => Some(Image::Tiff),
            "jpg" | "jpeg" => Some(Image::Jpeg),
            _ => None,
        }
    }

    /// For messages.
    pub(in crate::convert) const fn name(self) -> &'static str {
        match self {
            Image::Png => "PNG",
            Image::Tiff => "TIFF",
            Image::Jpeg => "JPEG",
        }
    }

    /// Reads the header of a file with one image.
    pub(super) fn header(self, path: &Path) -> Result<Header> {
        match self {
            Image::Png => png::header(path),
            Image::Tiff => tiff::header(path),
            Image::Jpeg => jpeg::header(path),
        }
    }

    /// Decodes the one image of a file: rows from the top, in this machine's byte order.
    ///
    /// # Errors
    /// `E_FOREIGN` also where the header is no longer `expected`.
    pub(super) fn decode(self, path: &Path, expected: Header, out: &mut [u8]) -> Result<()> {
        match self {
            Image::Png => png::decode(path, expected, out),
            Image::Tiff => tiff::decode(path, expected, out),
            Image::Jpeg => jpeg::decode(path, expected, out),
        }
    }

    /// Whether images of this format can hold such samples.
    pub(in crate::convert) const fn holds(self, sample_type: SampleType) -> bool {
        match self {
            Image::Png => !matches!(sample_type, SampleType::I16 | SampleType::F32),
            Image::Tiff => true,
            Image::Jpeg => matches!(sample_type, SampleType::U8 | SampleType::Rgb8),
        }
    }
}

/// Checks a size that a header states against the caps and against what so long a file can hold.
///
/// # Errors
/// `E_FOREIGN` for no pixels, `E_LIMIT` for too many.
pub(super) fn check_size(path: &Path, file_bytes: u64, size: (u32, u32), bits_per_pixel: u64) -> Result<()> {
    let (width, height) = size;
    if width == 0 || height == 0 {
        return Err(fault::foreign(path, "size", format!("{width}×{height} pixels are none")));
    }
    let limit = |message| Err(Error::new(Code::Limit, "size", format!("{}: {message}", path.display())));
    if width > MAX_AXIS || height > MAX_AXIS {
        return limit(format!("{width}×{height} pixels are above the cap of {MAX_AXIS} along an axis"));
    }
    let bits = u64::from(width) * u64::from(height) * bits_per_pixel;
    if bits / 8 > file_bytes.saturating_mul(MAX_RATIO) {
        return limit(format!("{width}×{height} pixels are more than its {file_bytes} bytes can hold"));
    }
    Ok(())
}

/// The error of a header that is not what it was when the stack was opened.
pub(super) fn check_same(path: &Path, found: Header, expected: Header) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    Err(fault::foreign(path, "size", "the image was replaced by another one while it was read"))
}

/// An error of a decoder: bad data are its own, what the system says has an error number.
pub(super) fn damaged_io(path: &Path, error: io::Error) -> Error {
    if error.raw_os_error().is_some() { fault::io(path, error) } else { damaged(path, error) }
}

/// The image cannot be decoded (`E_FOREIGN`).
pub(super) fn damaged(path: &Path, what: impl std::fmt::Display) -> Error {
    fault::foreign(path, "pixels", format!("the image is damaged: {what}"))
}

/// Refuses what has no place in a volume.
pub(super) fn no_colours(path: &Path, what: impl std::fmt::Display) -> Error {
    fault::unsupported(path, "pixels", format!("{what} are not read; save the images as 8-bit RGB or as grey"))
}

/// Takes pixels with an alpha of `alpha` bytes behind `color` bytes; all must be opaque.
///
/// # Errors
/// `E_UNSUPPORTED` naming the first pixel that is not.
pub(super) fn opaque(path: &Path, width: u32, pixels: &[u8], color: usize, alpha: usize, out: &mut [u8]) -> Result<()> {
    let pairs = pixels.chunks_exact(color + alpha).zip(out.chunks_exact_mut(color));
    for (i, (pixel, out)) in pairs.enumerate() {
        if pixel[color..].iter().any(|&a| a != 0xFF) {
            let (x, y) = (i % width as usize, i / width as usize);
            let message = format!("pixel ({x}, {y}) is not opaque; flatten the images, a volume has no transparency");
            return Err(fault::unsupported(path, "alpha", message));
        }
        out.copy_from_slice(&pixel[..color]);
    }
    Ok(())
}
