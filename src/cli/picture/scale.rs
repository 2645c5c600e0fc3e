//! Pictures made larger, square-pixelled, or put together. Always the nearest pixel: a voxel stays a voxel.

use super::{Picture, Rgb};
use crate::error::{Code, Error, Result};

/// A picture whose pixels are `zoom` screen pixels along the finer axis, and in proportion along the other one, as the
/// pixel size `(width, height)` in world units wants it. `(1.0, 1.0)` leaves the aspect alone.
///
/// # Errors
/// `E_PARAM` for a size that is not positive and finite; `E_LIMIT` where the picture would be too large.
pub(crate) fn scaled(picture: &Picture, pixel: (f64, f64), zoom: u32) -> Result<Picture> {
    let (w, h) = pixel;
    if !(w > 0.0 && h > 0.0 && w.is_finite() && h.is_finite()) {
        return Err(Error::param("spacing", format!("a pixel of {w} by {h} cannot be drawn; draw voxels as squares")));
    }
    let edge = |pixels: u32, factor: f64| {
        let edge = (f64::from(pixels) * f64::from(zoom.max(1)) * factor).round().max(1.0);
        if edge <= f64::from(1u32 << 28) {
            return Ok(edge as u32);
        }
        Err(Error::new(Code::Limit, "spacing", format!("pixels of {w} by {h} make too large a picture")))
    };
    let (width, height) = (edge(picture.width, w / w.min(h))?, edge(picture.height, h / w.min(h))?);
    if (width, height) == picture.size() {
        return Ok(picture.clone());
    }
    let mut out = Picture::filled(width, height, [0; 3])?;
    // Pixel centres: output pixel i takes the input pixel in which its middle lies.
    let source = |i: u32, from: u32, to: u32| ((2 * u64::from(i) + 1) * u64::from(from) / (2 * u64::from(to))) as usize;
    let columns: Vec<usize> = (0..width).map(|x| source(x, picture.width, width)).collect();
    for (y, row) in (0..).zip(out.pixels.chunks_exact_mut(width as usize)) {
        let start = source(y, picture.height, height) * picture.width as usize;
        row.iter_mut().zip(&columns).for_each(|(pixel, x)| *pixel = picture.pixels[start + x]);
    }
    Ok(out)
}

/// Pictures side by side with `gap` pixels of `color` between them, aligned at the top.
///
/// # Errors
/// `E_LIMIT` where the result would be too large.
pub(crate) fn panels(pictures: &[Picture], gap: u32, color: Rgb) -> Result<Picture> {
    joined(pictures, gap, color, true)
}

/// Pictures below each other, aligned at the left.
///
/// # Errors
/// `E_LIMIT` where the result would be too large.
pub(crate) fn stacked(pictures: &[Picture], gap: u32, color: Rgb) -> Result<Picture> {
    joined(pictures, gap, color, false)
}

fn joined(pictures: &[Picture], gap: u32, color: Rgb, sideways: bool) -> Result<Picture> {
    let along = |p: &Picture| if sideways { p.width } else { p.height };
    let across = |p: &Picture| if sideways { p.height } else { p.width };
    let gaps = u64::from(gap) * (pictures.len() as u64).saturating_sub(1);
    let length = pictures.iter().map(|p| u64::from(along(p))).sum::<u64>() + gaps;
    let length = u32::try_from(length).unwrap_or(u32::MAX);
    let breadth = pictures.iter().map(across).max().unwrap_or(0);
    let mut out =
        if sideways { Picture::filled(length, breadth, color) } else { Picture::filled(breadth, length, color) }?;
    let mut at = 0;
    for p in pictures {
        let (x, y) = if sideways { (at, 0) } else { (0, at) };
        for row in 0..p.height {
            let (from, to) = (row as usize * p.width as usize, (y + row) as usize * out.width as usize + x as usize);
            out.pixels[to..to + p.width as usize].copy_from_slice(&p.pixels[from..from + p.width as usize]);
        }
        at += along(p) + gap;
    }
    Ok(out)
}
