//! Volumes to images.

use super::image::Image;
use super::{jpeg, png, tiff};
use crate::convert::fault;
use crate::convert::stream::pass;
use crate::error::Result;
use crate::geometry::Extent;
use crate::grid::{Grid, SlabReader};
use crate::voxel::SampleType;
use std::io::{self, Seek, Write};
use std::path::Path;

/// Whether slices of this volume can be written as such images; asked before anything is decoded.
///
/// # Errors
/// `E_UNSUPPORTED` naming a format that can.
pub(in crate::convert) fn check(path: &Path, image: Image, extent: Extent, sample_type: SampleType) -> Result<()> {
    if !image.holds(sample_type) {
        let message = match sample_type {
            SampleType::U16 => "PNG and TIFF do (slices/, slice_####.tif), as do NRRD and NIfTI",
            _ => "TIFF does (slice_####.tif), as do NRRD and NIfTI",
        };
        return Err(fault::unsupported(path, "format", format!("{} holds no {sample_type}; {message}", image.name())));
    }
    let longest = if image == Image::Jpeg { u32::from(u16::MAX) } else { i32::MAX as u32 };
    if extent.x > longest || extent.y > longest {
        let message = format!("{} holds no slices of {}×{} voxels", image.name(), extent.x, extent.y);
        return Err(fault::unsupported(path, "format", message));
    }
    Ok(())
}

/// Writes slice `z` as an image, or all slices as pages where `z` is `None`.
pub(in crate::convert) fn write<W: Write + Seek>(
    image: Image,
    out: &mut W,
    source: &mut dyn SlabReader,
    z: Option<u32>,
) -> io::Result<()> {
    let e = source.extent();
    let planes = z.map_or(0..e.z, |z| z..z + 1);
    if image == Image::Tiff {
        return tiff::encode(out, source, planes);
    }
    let mut plane = Grid::zeros(Extent { z: 1, ..e }, source.sample_type()).map_err(pass)?;
    source.read_slab(planes.start..planes.start + 1, plane.bytes_mut()).map_err(pass)?;
    match (image, u16::try_from(e.x), u16::try_from(e.y)) {
        (Image::Jpeg, Ok(x), Ok(y)) => jpeg::encode(out, (x, y), plane.sample_type(), plane.bytes()),
        _ => png::encode(out, (e.x, e.y), plane.sample_type(), plane.bytes()),
    }
}
