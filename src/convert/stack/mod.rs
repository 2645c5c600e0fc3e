//! Stacks of images: a folder of PNG, TIFF or JPEG slices, or one file with one slice or (TIFF) a page for each.
//!
//! Slice z is file z in natural order (`slice2` before `slice10`); x goes to the right, y down from the top row. Nothing
//! says how far slices are apart, so spacing is unknown. Slices are decoded as they are asked for, in parallel.

mod image;
mod jpeg;
mod names;
mod png;
mod tiff;
mod write;

pub(super) use image::Image;
pub(super) use names::{named, natural_order};
pub(super) use write::{check, write};

use super::layout::Layout;
use super::payload::{Bytes, Payload};
use super::stored::Stored;
use super::{Format, Import, ImportOptions, fault};
use crate::error::{Code, Error, Result};
use crate::geometry::Extent;
use crate::grid::AlignedBytes;
use image::Header;
use rayon::prelude::*;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Where slices come from.
enum Slices {
    Files { image: Image, paths: Vec<PathBuf> },
    Pages(tiff::Pages),
}

/// The slices of a stack as bytes: rows of samples in this machine's byte order.
pub(super) struct Stack {
    slices: Slices,
    header: Header,
    /// Bytes of a slice.
    plane: usize,
    /// The last slice of which only a part was wanted.
    kept: Option<(u32, AlignedBytes)>,
}

/// Opens a folder of images, or a single image. The headers of all slices are read, no pixels.
pub(super) fn import(path: &Path, options: &ImportOptions) -> Result<Import> {
    let (slices, header) = if path.is_dir() {
        folder(path)?
    } else {
        match Image::of_path(path) {
            Some(Image::Tiff) => tiff::Pages::open(path).map(|(pages, header)| (Slices::Pages(pages), header))?,
            Some(image) => (Slices::Files { image, paths: vec![path.to_owned()] }, image.header(path)?),
            None => return Err(fault::unsupported(path, "format", "is no image")),
        }
    };
    let (image, count) = match &slices {
        Slices::Files { image, paths } => (*image, paths.len() as u32),
        Slices::Pages(pages) => (Image::Tiff, pages.count),
    };
    let kept = json!({ "format": "stack", "images": image.name(), "slices": count, "pixels": header.kind.name() });
    let extent = Extent::new(header.size.0, header.size.1, count);
    let layout = Layout::single(path, "size", extent, header.kind)?;
    let plane =
        usize::try_from(header.bytes()).ok().filter(|_| header.bytes() <= options.max_bytes).ok_or_else(|| {
            let message = format!("{}: a slice unpacks to {} bytes, more than allowed", path.display(), header.bytes());
            Error::new(Code::Limit, "size", message)
        })?;
    let stored = Stored { kind: header.kind, big_endian: cfg!(target_endian = "big") };
    let bytes = Bytes::Stack(Box::new(Stack { slices, header, plane, kept: None }));
    let opened = Payload { bytes, stored, layout }.open(path, options.dtype)?;
    Ok(Import::plain(opened, Format::Stack, kept))
}

/// The slices of a folder, which must be of one format, size and type.
fn folder(path: &Path) -> Result<(Slices, Header)> {
    let found = names::images(path)?;
    let Some((first, image)) = found.first().cloned() else {
        let message =
            "the folder holds no images (.png, .tif, .tiff, .jpg, .jpeg) and no volumes (.nrrd, .nii, .npy, .raw)";
        return Err(fault::unsupported(path, "slices", message));
    };
    if let Some((other, _)) = found.iter().find(|(_, i)| *i != image) {
        let message = format!("{} beside {}: one stack is of one format", name(other), name(&first));
        return Err(fault::foreign(path, "slices", message));
    }
    let header = image.header(&first)?;
    let wrong = found.par_iter().skip(1).find_map_first(|(slice, _)| match image.header(slice) {
        Ok(h) if h == header => None,
        Ok(h) => Some(differ(path, &name(slice), h, &name(&first), header)),
        Err(e) => Some(e),
    });
    let paths = found.into_iter().map(|(path, _)| path).collect();
    wrong.map_or(Ok((Slices::Files { image, paths }, header)), Err)
}

fn name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Two slices that do not fit together.
fn differ(path: &Path, a: &str, ah: Header, b: &str, bh: Header) -> Error {
    let text = |h: Header| format!("{}×{} {}", h.size.0, h.size.1, h.kind);
    let message = format!("{a} is {}, {b} is {}; slices have one size and type", text(ah), text(bh));
    fault::foreign(path, "slices", message)
}

impl Stack {
    fn decode(&self, z: u64, out: &mut [u8]) -> Result<()> {
        let z = u32::try_from(z).unwrap_or(u32::MAX);
        match &self.slices {
            Slices::Pages(pages) => pages.decode(z, self.header, out),
            Slices::Files { image, paths } => match paths.get(z as usize) {
                Some(path) => image.decode(path, self.header, out),
                None => Err(Error::new(Code::Range, "z", format!("slice {z} of {}", paths.len()))),
            },
        }
    }

    /// A part of slice `z`, from its byte `from` on. The whole slice is kept: the next part is likely wanted, too.
    fn decode_part(&mut self, z: u64, from: usize, out: &mut [u8]) -> Result<()> {
        let index = u32::try_from(z).unwrap_or(u32::MAX);
        let kept = match self.kept.take() {
            Some((at, bytes)) if at == index => bytes,
            _ => {
                let mut bytes = AlignedBytes::zeroed(self.plane)?;
                self.decode(z, bytes.as_mut_slice())?;
                bytes
            }
        };
        out.copy_from_slice(&kept.as_slice()[from..][..out.len()]);
        self.kept = Some((index, kept));
        Ok(())
    }

    /// Fills `out` from byte `offset` of all slices on; whole slices are decoded in parallel.
    ///
    /// # Errors
    /// The first slice's that cannot be decoded.
    pub(super) fn read_at(&mut self, offset: u64, mut out: &mut [u8]) -> Result<()> {
        let plane = self.plane as u64;
        let (mut z, from) = (offset / plane, (offset % plane) as usize);
        if from > 0 {
            let (part, rest) = out.split_at_mut((self.plane - from).min(out.len()));
            self.decode_part(z, from, part)?;
            (out, z) = (rest, z + 1);
        }
        let (whole, part) = out.split_at_mut(out.len() / self.plane * self.plane);
        let behind = z + (whole.len() / self.plane) as u64;
        let slices = whole.par_chunks_exact_mut(self.plane).enumerate();
        slices.map(|(i, out)| self.decode(z + i as u64, out)).find_map_first(Result::err).map_or(Ok(()), Err)?;
        if part.is_empty() { Ok(()) } else { self.decode_part(behind, 0, part) }
    }
}
