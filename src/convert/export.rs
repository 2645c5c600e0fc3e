//! Volumes to foreign files. The caller opens the files, so that it decides how they come into being.

use super::stream::{CHANNELS_THEN_TIME, write_samples};
use super::{Format, fault, nifti, npy, nrrd, stack};
use crate::affine::{Placement, ValueMap};
use crate::error::{Error, Result};
use crate::geometry::Extent;
use crate::grid::{Grid, SlabReader};
use crate::time::Times;
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
    /// When the time steps of a series were taken. Raw and npy files cannot say it; NIfTI can where they are evenly apart.
    pub times: Option<&'a Times>,
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

    /// As [`Target::of_volume`], for a series of this many time steps and channels.
    ///
    /// # Errors
    /// As [`Target::of_volume`]; `E_UNSUPPORTED` for images, where there is more than one volume.
    pub fn of_series(path: &Path, extent: Extent, sample_type: SampleType, series: (u32, u32)) -> Result<Target> {
        let target = Target::of_volume(path, extent, sample_type)?;
        if series == (1, 1) || !target.is_images() {
            return Ok(target);
        }
        let (steps, channels) = series;
        let message = format!(
            "images hold one volume, not {steps} time steps and {channels} channels; choose one with --time and --channel, \
             or write NRRD, NIfTI, npy or raw"
        );
        Err(fault::unsupported(path, "format", message))
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

    /// Whether these are images, which take single planes and no series.
    #[must_use]
    pub fn is_images(&self) -> bool {
        matches!(self.layout, Layout::Slices(_) | Layout::Pages(_))
    }

    /// Writes file `index` of [`Target::files`] to `out`. Each call is complete in itself; buffering is the caller's.
    ///
    /// `source` is turned to each of its volumes in turn and read a few planes at a time, mostly once and in order. The
    /// header of a pair reads no samples.
    ///
    /// # Errors
    /// `E_SOURCE` where writing fails, `E_UNSUPPORTED` where the format cannot hold the volume; those of `source`.
    ///
    /// # Panics
    /// Where there is no such file.
    pub fn write<W: Write + Seek>(
        &self,
        index: usize,
        out: &mut W,
        source: &mut dyn SlabReader,
        info: &ExportInfo<'_>,
    ) -> Result<()> {
        let path = &self.files[index];
        let header = index + 1 == self.files.len();
        let written = match self.layout {
            Layout::Raw => write_samples(out, source, &CHANNELS_THEN_TIME),
            Layout::Npy => npy::write(out, source),
            Layout::Nrrd => nrrd::write_attached(out, source, info),
            Layout::NrrdPair if header => nrrd::write_header(out, source, info, &file_name(&self.files[0])?),
            Layout::NrrdPair => nrrd::write_data(out, source, info),
            Layout::Nifti | Layout::NiftiPair => {
                let part = match (self.layout, header) {
                    (Layout::Nifti, _) => nifti::Part::Whole,
                    (_, true) => nifti::Part::Header,
                    (_, false) => nifti::Part::Data,
                };
                nifti::write(out, source, info, part, self.gzip)
            }
            Layout::Slices(image) => stack::write(image, out, source, Some(index as u32)),
            Layout::Pages(image) => stack::write(image, out, source, None),
        };
        // What the source reported has its own words already.
        written.map_err(|e| e.downcast::<Error>().unwrap_or_else(|e| fault::io(path, e)))
    }
}

/// A file's name as text.
fn file_name(path: &Path) -> Result<String> {
    let name = path.file_name().and_then(|n| n.to_str());
    name.map(str::to_owned).ok_or_else(|| Error::param("path", format!("{} is not UTF-8", path.display())))
}

/// Writes a volume to the format of the file name's ending; existing files are replaced.
///
/// The files are written in place, one after the other. A program that must never leave a half-written file behind goes
/// through [`Target`] and brings its own way of creating them.
///
/// # Errors
/// As [`Target::of_volume`] and [`Target::write`].
pub fn export(path: &Path, grid: &Grid, info: &ExportInfo<'_>) -> Result<()> {
    export_series(path, &mut grid.view(), info)
}

/// As [`export`], for all time steps and channels of a series, a few planes at a time.
///
/// # Errors
/// As [`Target::of_series`] and [`Target::write`].
pub fn export_series(path: &Path, source: &mut dyn SlabReader, info: &ExportInfo<'_>) -> Result<()> {
    let target = Target::of_series(path, source.extent(), source.sample_type(), source.series())?;
    if let Some(folder) = target.folder() {
        fs::create_dir_all(folder).map_err(|e| fault::io(folder, e))?;
    }
    for (i, file) in target.files().iter().enumerate() {
        let mut out = BufWriter::new(File::create(file).map_err(|e| fault::io(file, e))?);
        target.write(i, &mut out, source, info)?;
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
        for (name, series, ok) in
            [("a.nrrd", (3, 1), true), ("a.tif", (1, 1), true), ("a.tif", (3, 1), false), ("a/", (1, 2), false)]
        {
            let target = Target::of_series(Path::new(name), Extent::cube(2), SampleType::U8, series);
            assert_eq!(target.is_ok(), ok, "{name} {series:?}");
            assert!(target.err().is_none_or(|e| e.message().contains("--time")));
        }
        for bad in ["a", "a.vug", "a.gz", "a.raw.gz", "a.png"] {
            assert!(Target::of_volume(Path::new(bad), Extent::cube(2), SampleType::U8).is_err(), "{bad}");
        }
    }
}
