//! Volumes to foreign files. The caller opens the files, so that it decides how they come into being.

use super::{Format, fault, nifti, npy, nrrd, stack};
use crate::affine::{Placement, ValueMap};
use crate::error::{Error, Result};
use crate::geometry::Extent;
use crate::grid::Grid;
use crate::voxel::SampleType;
use std::fs::{self, File};
use std::io::{BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

/// What is known about a volume beyond its samples.
#[derive(Clone, Copy, Debug)]
pub struct ExportInfo<'a> {
    /// Where it lies in the world. Raw and npy files cannot say it.
    pub placement: &'a Placement,
    /// What its numbers mean. Raw and npy files cannot say it.
    pub value_map: ValueMap,
    /// The header object of an earlier [`super::import`]; what the format has a place for is put back.
    pub header: Option<&'a serde_json::Value>,
}

/// How a target is laid out in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layout {
    Raw,
    Npy,
    /// One `.nrrd` file, gzip.
    Nrrd,
    /// `.raw` and `.nhdr`.
    NrrdPair,
    /// One `.nii` file.
    Nifti,
    /// `.img` and `.hdr`.
    NiftiPair,
    /// An image for each slice.
    Slices(stack::Image),
    /// One image with a page for each slice.
    Pages(stack::Image),
}

/// Files to be written for one foreign volume.
///
/// `files()` lists them in the order in which they should appear: the header of a pair comes last, so that nobody finds a
/// header whose data are not there.
#[derive(Clone, Debug)]
pub struct Target {
    layout: Layout,
    gzip: bool,
    files: Vec<PathBuf>,
    folder: Option<PathBuf>,
}

impl Target {
    /// The target that a file name's ending stands for, for a volume of this size (x, y, z) and type.
    ///
    /// A folder, there or with a separator at its end, takes PNG slices `0000.png` and so on; in the name of an image,
    /// `####` is the slice's number, in four digits or as many as are needed.
    ///
    /// # Errors
    /// `E_UNSUPPORTED` for an unknown ending, and for images that cannot hold such slices; `E_PARAM` where a name cannot
    /// stand for all slices, or a folder holds other images; `E_SOURCE` where it cannot be read.
    pub fn of_volume(path: &Path, extent: Extent, sample_type: SampleType) -> Result<Target> {
        if let Some(named) = stack::named(path, extent.z)? {
            stack::check(path, named.image, extent, sample_type)?;
            let single = named.files.len() == 1;
            let layout = if single { Layout::Pages(named.image) } else { Layout::Slices(named.image) };
            return Ok(Target { layout, gzip: false, files: named.files, folder: Some(named.folder) });
        }
        Target::of_path(path)
    }

    /// As [`Target::of_volume`], for the formats that hold volumes of any size; a stack of images is none of them.
    ///
    /// # Errors
    /// `E_UNSUPPORTED` for any other ending.
    pub fn of_path(path: &Path) -> Result<Target> {
        let unknown = || {
            let message = format!("the name's ending is none of those that can be written: {}", Format::ENDINGS);
            fault::unsupported(path, "format", message)
        };
        let name = path.file_name().and_then(|n| n.to_str()).ok_or_else(unknown)?;
        let lower = name.to_ascii_lowercase();
        let gzip = lower.ends_with(".gz");
        let stem_len = lower.strip_suffix(".gz").unwrap_or(&lower).rfind('.').ok_or_else(unknown)?;
        let beside = |ending: &str| path.with_file_name(format!("{}{ending}", &name[..stem_len]));
        let (layout, files) = match (Format::of_path(path).ok_or_else(unknown)?, &lower[stem_len..]) {
            (Format::Raw, _) => (Layout::Raw, vec![path.to_owned()]),
            (Format::Npy, _) => (Layout::Npy, vec![path.to_owned()]),
            (Format::Nrrd, ".nhdr") => (Layout::NrrdPair, vec![beside(".raw"), path.to_owned()]),
            (Format::Nrrd, _) => (Layout::Nrrd, vec![path.to_owned()]),
            (Format::Nifti, ".nii" | ".nii.gz") => (Layout::Nifti, vec![path.to_owned()]),
            (Format::Nifti, ".hdr" | ".hdr.gz") => {
                (Layout::NiftiPair, vec![beside(if gzip { ".img.gz" } else { ".img" }), path.to_owned()])
            }
            (Format::Nifti, _) => {
                (Layout::NiftiPair, vec![path.to_owned(), beside(if gzip { ".hdr.gz" } else { ".hdr" })])
            }
            (Format::Stack, _) => return Err(unknown()),
        };
        Ok(Target { layout, gzip, files, folder: None })
    }

    /// All files of this target, in the order in which they should appear.
    #[must_use]
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// The folder of the slices, where the target is a stack of images. It has to be there before they are written.
    #[must_use]
    pub fn folder(&self) -> Option<&Path> {
        self.folder.as_deref().filter(|f| !f.as_os_str().is_empty())
    }

    /// Writes file `index` of [`Target::files`] to `out`. Each call is complete in itself; buffering is the caller's.
    ///
    /// # Errors
    /// `E_SOURCE` where writing fails, `E_UNSUPPORTED` where the format cannot hold the volume.
    ///
    /// # Panics
    /// Where there is no such file.
    pub fn write<W: Write + Seek>(&self, index: usize, out: &mut W, grid: &Grid, info: &ExportInfo<'_>) -> Result<()> {
        let path = &self.files[index];
        let header = index + 1 == self.files.len();
        let written = match self.layout {
            Layout::Raw => write_samples(out, grid),
            Layout::Npy => npy::write(out, grid),
            Layout::Nrrd => nrrd::write_attached(out, grid, info),
            Layout::NrrdPair if header => nrrd::write_header(out, grid, info, &file_name(&self.files[0])?),
            Layout::NrrdPair => write_samples(out, grid),
            Layout::Nifti | Layout::NiftiPair => {
                let part = match (self.layout, header) {
                    (Layout::Nifti, _) => nifti::Part::Whole,
                    (_, true) => nifti::Part::Header,
                    (_, false) => nifti::Part::Data,
                };
                nifti::write(out, grid, info, part, self.gzip)
            }
            Layout::Slices(image) => stack::write(image, out, grid, Some(index as u32)),
            Layout::Pages(image) => stack::write(image, out, grid, None),
        };
        written.map_err(|e| fault::io(path, e))
    }
}

/// A file's name as text.
fn file_name(path: &Path) -> Result<String> {
    let name = path.file_name().and_then(|n| n.to_str());
    name.map(str::to_owned).ok_or_else(|| Error::param("path", format!("{} is not UTF-8", path.display())))
}

/// All samples, little endian, x fastest.
pub(super) fn write_samples(out: &mut dyn Write, grid: &Grid) -> std::io::Result<()> {
    let size = if grid.sample_type().components() == 1 { grid.sample_type().bytes() } else { 1 };
    if cfg!(target_endian = "little") || size == 1 {
        return out.write_all(grid.bytes());
    }
    for chunk in grid.bytes().chunks(64 << 10) {
        let mut swapped = chunk.to_vec();
        swapped.chunks_exact_mut(size).for_each(<[u8]>::reverse);
        out.write_all(&swapped)?;
    }
    Ok(())
}

/// Writes a volume to the format of the file name's ending; existing files are replaced.
///
/// The files are written in place, one after the other. A program that must never leave a half-written file behind goes
/// through [`Target`] and brings its own way of creating them.
///
/// # Errors
/// As [`Target::of_volume`] and [`Target::write`].
pub fn export(path: &Path, grid: &Grid, info: &ExportInfo<'_>) -> Result<()> {
    let target = Target::of_volume(path, grid.extent(), grid.sample_type())?;
    if let Some(folder) = target.folder() {
        fs::create_dir_all(folder).map_err(|e| fault::io(folder, e))?;
    }
    for (i, file) in target.files().iter().enumerate() {
        let mut out = BufWriter::new(File::create(file).map_err(|e| fault::io(file, e))?);
        target.write(i, &mut out, grid, info)?;
        out.flush().map_err(|e| fault::io(file, e))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_a_target() {
        for (name, files) in [
            ("d/a.raw", vec!["d/a.raw"]),
            ("d/a.nrrd", vec!["d/a.nrrd"]),
            ("d/a.b.nhdr", vec!["d/a.b.raw", "d/a.b.nhdr"]),
            ("d/a.nii.gz", vec!["d/a.nii.gz"]),
            ("d/a.hdr", vec!["d/a.img", "d/a.hdr"]),
            ("d/a.img", vec!["d/a.img", "d/a.hdr"]),
            ("d/a.img.gz", vec!["d/a.img.gz", "d/a.hdr.gz"]),
            ("d/a.tif", vec!["d/a.tif"]),
            ("d/a_#.png", vec!["d/a_0.png", "d/a_1.png"]),
            ("none/", vec!["none/0000.png", "none/0001.png"]),
        ] {
            let target = Target::of_volume(Path::new(name), Extent::cube(2), SampleType::U8).unwrap();
            assert_eq!(target.files(), files.iter().map(PathBuf::from).collect::<Vec<_>>(), "{name}");
        }
        for bad in ["a", "a.vug", "a.gz", "a.raw.gz", "a.png"] {
            assert!(Target::of_volume(Path::new(bad), Extent::cube(2), SampleType::U8).is_err(), "{bad}");
        }
    }
}
