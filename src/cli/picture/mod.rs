//! Slices as images: windows, colour maps, differences in classes, square pixels, PNG.
//!
//! Orientation, as in `vug slice --help`: z slices show x to the right and y **down**; y slices x right, z **up**;
//! x slices y right, z **up**. For a volume in LPS with z towards the head these are the radiologist's axial, coronal
//! and sagittal views.

mod colormap;
mod difference;
mod font;
mod scale;
mod slice;
#[cfg(test)]
mod tests;

pub(crate) use colormap::ColorMap;
pub(crate) use difference::{difference, legend};
pub(crate) use scale::{panels, scaled, stacked};
pub(crate) use slice::{slice, spacing_on_screen};

use crate::error::{Code, Error, Result};
use crate::metrics::image::RgbImage;

/// Most pixels of a picture: what a browser still shows.
const MAX_PIXELS: u64 = 1 << 28;

/// Red, green, blue.
pub(crate) type Rgb = [u8; 3];

/// An image of 8-bit RGB pixels, top row first.
#[derive(Clone, PartialEq, Eq)]
pub(crate) struct Picture {
    width: u32,
    height: u32,
    pixels: Vec<Rgb>,
}

impl From<RgbImage> for Picture {
    fn from(image: RgbImage) -> Self {
        Picture { width: image.width, height: image.height, pixels: image.pixels }
    }
}

impl Picture {
    /// A picture of one colour.
    ///
    /// # Errors
    /// `E_LIMIT` above 2^28 pixels.
    pub(crate) fn filled(width: u32, height: u32, color: Rgb) -> Result<Self> {
        let count = u64::from(width) * u64::from(height);
        let count = usize::try_from(count).ok().filter(|_| count <= MAX_PIXELS).ok_or_else(|| {
            let message = format!(
                "a picture of {width}×{height} pixels is too large; picture a smaller slice or a coarser level"
            );
            Error::new(Code::Limit, "picture", message)
        })?;
        Ok(Picture { width, height, pixels: vec![color; count] })
    }

    /// Width and height in pixels.
    pub(crate) fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Pixel in column x of row y.
    #[cfg(test)]
    fn at(&self, x: u32, y: u32) -> Rgb {
        self.pixels[self.index(x, y)]
    }

    fn set(&mut self, x: u32, y: u32, color: Rgb) {
        let i = self.index(x, y);
        self.pixels[i] = color;
    }

    fn index(&self, x: u32, y: u32) -> usize {
        assert!(x < self.width && y < self.height, "a pixel of the picture");
        y as usize * self.width as usize + x as usize
    }

    /// The part of `width`×`height` pixels at (x, y), or what of it lies inside.
    pub(crate) fn crop(&self, x: u32, y: u32, width: u32, height: u32) -> Result<Self> {
        let (x, y) = (x.min(self.width), y.min(self.height));
        let mut part = Picture::filled(width.min(self.width - x), height.min(self.height - y), [0; 3])?;
        for (dy, row) in part.pixels.chunks_exact_mut(part.width.max(1) as usize).enumerate() {
            let start = (y as usize + dy) * self.width as usize + x as usize;
            row.copy_from_slice(&self.pixels[start..start + row.len()]);
        }
        Ok(part)
    }

    /// As a PNG file; grey where every pixel is.
    ///
    /// # Errors
    /// `E_PARAM` for an empty picture.
    pub(crate) fn to_png(&self) -> Result<Vec<u8>> {
        if self.pixels.is_empty() {
            return Err(Error::param("picture", "it has no pixels"));
        }
        let grey = self.pixels.iter().all(|p| p[0] == p[1] && p[1] == p[2]);
        let mut out = Vec::new();
        let mut encoder = png::Encoder::new(&mut out, self.width, self.height);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_color(if grey { png::ColorType::Grayscale } else { png::ColorType::Rgb });
        let refused = |e: png::EncodingError| Error::param("picture", format!("PNG: {e}"));
        let mut writer = encoder.write_header().map_err(refused)?;
        if grey {
            let bytes: Vec<u8> = self.pixels.iter().map(|p| p[0]).collect();
            writer.write_image_data(&bytes).map_err(refused)?;
        } else {
            writer.write_image_data(self.pixels.as_flattened()).map_err(refused)?;
        }
        writer.finish().map_err(refused)?;
        Ok(out)
    }
}
