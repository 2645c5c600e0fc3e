//! Pictures of floats, as rays leave them.

use crate::error::{Error, Result};
use std::io::Write;

/// A picture: premultiplied red, green, blue and opacity, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Pixels of a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row after row.
    pub pixels: Vec<[f32; 4]>,
}

impl Image {
    /// Red, green and blue from 0 to 1 in front of `background`.
    pub fn colours(&self, background: [f32; 3]) -> impl Iterator<Item = [f32; 3]> + '_ {
        self.pixels.iter().map(move |p| std::array::from_fn(|c| p[c] + (1.0 - p[3]) * background[c]))
    }

    /// 8 bits a component, in front of `background`; rounded half up.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the range")]
    pub fn over(&self, background: [f32; 3]) -> Vec<[u8; 3]> {
        self.colours(background).map(|c| c.map(|v| (v.clamp(0.0, 1.0) * 255.0 + 0.5).floor() as u8)).collect()
    }

    /// The largest difference of a component of any pixel; infinite where one is NaN.
    ///
    /// # Errors
    /// `E_PARAM` for pictures of different sizes.
    pub fn max_difference(&self, other: &Image) -> Result<f32> {
        if (self.width, self.height) != (other.width, other.height) {
            return Err(Error::param("image", "the pictures have different sizes"));
        }
        let pairs = self.pixels.iter().flatten().zip(other.pixels.iter().flatten());
        Ok(pairs.fold(0.0, |m: f32, (a, b)| {
            let d = (a - b).abs();
            if d.is_nan() { f32::INFINITY } else { m.max(d) }
        }))
    }

    /// Writes a portable float map: three floats a pixel in front of `background`, little-endian, rows from the bottom.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_pfm(&self, out: &mut impl Write, background: [f32; 3]) -> std::io::Result<()> {
        write!(out, "PF\n{} {}\n-1.0\n", self.width, self.height)?;
        let all: Vec<[f32; 3]> = self.colours(background).collect();
        for row in all.chunks_exact(self.width as usize).rev() {
            for c in row.iter().flatten() {
                out.write_all(&c.to_le_bytes())?;
            }
        }
        Ok(())
    }
}
