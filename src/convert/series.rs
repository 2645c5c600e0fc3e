//! A time series in several files, one for each step: a folder of volumes, or a name with `####` for the step's number.
//!
//! The headers of all files are read at once, so that what does not fit is found before anything is encoded; samples
//! are read file by file.

use super::layout::Layout;
use super::slabs::check_turn;
use super::{Format, Import, ImportOptions, Probe, fault, import_file, nifti, npy, nrrd, raw, stack};
use crate::error::{Error, Result};
use crate::geometry::Extent;
use crate::grid::{SlabReader, View};
use crate::voxel::SampleType;
use rayon::prelude::*;
use serde_json::json;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The format of the volumes in a folder; `None` where there are none, or images, or it cannot be read.
pub(super) fn format_of(folder: &Path) -> Option<Format> {
    files(folder).ok()?.first().map(|(_, format)| *format)
}

/// The files that are steps of the series at `path`; `None` where it is no series.
///
/// # Errors
/// `E_UNSUPPORTED` for files of several formats, `E_SOURCE` where a folder cannot be read.
pub(super) fn steps(path: &Path) -> Result<Option<Vec<PathBuf>>> {
    let found = if path.is_dir() {
        files(path)?
    } else if let Some((before, digits, after)) = pattern(path).filter(|_| !path.exists()) {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let matches = |name: &str| {
            let number = name.strip_prefix(before).and_then(|rest| rest.strip_suffix(after));
            number.is_some_and(|n| n.len() >= digits && n.bytes().all(|b| b.is_ascii_digit()))
        };
        let step = |p: &Path| p.file_name()?.to_str().filter(|n| matches(n)).and(Format::of_name(p));
        let found = stack::natural_order(folder, step)?;
        if found.is_empty() {
            return Err(fault::unsupported(path, "files", "no file has such a name, with digits in place of #"));
        }
        found
    } else {
        return Ok(None);
    };
    let Some((first, format)) = found.first().cloned() else { return Ok(None) };
    if let Some((other, _)) = found.iter().find(|(_, f)| *f != format) {
        let message = format!("{} beside {}: one series is of one format", name(other), name(&first));
        return Err(fault::unsupported(path, "files", message));
    }
    Ok(Some(found.into_iter().map(|(path, _)| path).collect()))
}

/// The volumes of a folder in natural order: headers where they have data files, and none where there are images.
fn files(folder: &Path) -> Result<Vec<(PathBuf, Format)>> {
    let mut found = stack::natural_order(folder, Format::of_name)?;
    if found.iter().any(|(_, format)| *format == Format::Stack) {
        return Ok(Vec::new());
    }
    let ends = |path: &Path, endings: &[&str]| {
        let name = name(path).to_ascii_lowercase();
        endings.iter().any(|e| name.ends_with(e))
    };
    for (header, data) in [
        (&[".nhdr"][..], &[".raw", ".bin", ".nii", ".nii.gz", ".img"][..]),
        (&[".hdr", ".hdr.gz"], &[".img", ".img.gz"]),
    ] {
        if found.iter().any(|(path, _)| ends(path, header)) {
            found.retain(|(path, _)| !ends(path, data));
        }
    }
    Ok(found)
}

/// What comes before and after the number's place in a name, and its least digits.
fn pattern(path: &Path) -> Option<(&str, usize, &str)> {
    let name = path.file_name()?.to_str()?;
    let (before, rest) = name.split_at(name.find('#')?);
    let after = rest.trim_start_matches('#');
    let series = Format::of_name(path).is_some_and(|f| f != Format::Stack) && !after.contains('#');
    series.then_some((before, rest.len() - after.len(), after))
}

fn name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// What the header of a file says of its samples.
fn probe(path: &Path, options: &ImportOptions) -> Result<Probe> {
    match Format::of_name(path) {
        Some(Format::Npy) => npy::probe(path, options),
        Some(Format::Nrrd) => nrrd::probe(path, options),
        Some(Format::Nifti) => nifti::probe(path),
        _ => raw::probe(path, options),
    }
}

/// Opens a series of files, each of which holds a volume, or the channels of one time step.
///
/// # Errors
/// Those of [`import_file`] for the first file, and the first header that is malformed; `E_UNSUPPORTED` naming two files
/// that do not fit together.
pub(super) fn import(path: &Path, paths: Vec<PathBuf>, options: &ImportOptions) -> Result<Import> {
    if options.time_steps.is_some_and(|t| t as usize != paths.len()) {
        let message = format!("{}: {} files are as many time steps; leave it out", path.display(), paths.len());
        return Err(Error::param("time-steps", message));
    }
    let options = ImportOptions { time_steps: None, ..options.clone() };
    let first = probe(&paths[0], &options)?;
    if first.layout.time_steps > 1 {
        let message = format!("{} holds a series of its own; encode it alone", name(&paths[0]));
        return Err(fault::unsupported(path, "files", message));
    }
    let steps = u32::try_from(paths.len()).unwrap_or(u32::MAX);
    let Layout { extent, channels, .. } = first.layout;
    Layout::series(path, "files", extent, (steps, channels), first.kind)?;
    let wrong = paths.par_iter().skip(1).find_map_first(|other| match probe(other, &options) {
        Ok(found) => differ(path, &paths[0], &first, other, &found),
        Err(e) => Some(e),
    });
    if let Some(error) = wrong {
        return Err(error);
    }
    let mut import = import_file(&paths[0], &options)?;
    import.times = None;
    if let Some(header) = import.header.as_object_mut() {
        header.insert("files".into(), json!(steps));
    }
    let target = import.reader.sample_type();
    let current = std::mem::replace(&mut import.reader, Box::new(Nothing));
    import.reader = Box::new(Files { paths, options, extent, channels, target, current, step: 0 });
    Ok(import)
}

/// Why two files are no steps of one series.
fn differ(path: &Path, a: &Path, at: &Probe, b: &Path, bt: &Probe) -> Option<Error> {
    let (what, text): (_, fn(&Probe) -> String) = if at.layout.text() != bt.layout.text() || at.kind != bt.kind {
        ("size and type", |p| format!("{} {}", p.layout.text(), p.kind))
    } else if at.value_map != bt.value_map {
        ("meaning of values", |p| format!("{} · value + {}", p.value_map.scale, p.value_map.offset))
    } else {
        return None;
    };
    let message = format!("{} is {}, {} is {}; a series is of one {what}", name(b), text(bt), name(a), text(at));
    Some(fault::unsupported(path, "files", message))
}

/// The files of a series, of which one is open.
struct Files {
    paths: Vec<PathBuf>,
    options: ImportOptions,
    extent: Extent,
    channels: u32,
    target: SampleType,
    current: Box<dyn SlabReader>,
    step: u32,
}

impl SlabReader for Files {
    fn extent(&self) -> Extent {
        self.extent
    }

    fn sample_type(&self) -> SampleType {
        self.target
    }

    fn read_slab(&mut self, z: Range<u32>, out: &mut [u8]) -> Result<()> {
        self.current.read_slab(z, out)
    }

    fn read_rows(&mut self, z: Range<u32>, y: Range<u32>, out: &mut [u8]) -> Result<()> {
        self.current.read_rows(z, y, out)
    }

    fn as_view(&self) -> Option<View<'_>> {
        self.current.as_view()
    }

    fn series(&self) -> (u32, u32) {
        (self.paths.len() as u32, self.channels)
    }

    fn turn_to(&mut self, time: u32, channel: u32) -> Result<()> {
        check_turn(self.series(), time, channel)?;
        if time != self.step {
            let path = &self.paths[time as usize];
            // What was read before is let go of first: both may fill the memory that was granted.
            self.current = Box::new(Nothing);
            self.step = u32::MAX;
            let import = import_file(path, &self.options)?;
            let (found, wanted) = (import.reader.sample_type(), self.target);
            if found != wanted || import.reader.extent() != self.extent || import.reader.series() != (1, self.channels)
            {
                let message = format!(
                    "{} {found} where the first file of the series is {} {wanted}; choose a type for all with --dtype",
                    import.reader.extent(),
                    self.extent
                );
                return Err(fault::unsupported(path, "dtype", message));
            }
            (self.current, self.step) = (import.reader, time);
        }
        self.current.turn_to(0, channel)
    }
}

/// Stands in where no file is open.
struct Nothing;

impl SlabReader for Nothing {
    fn extent(&self) -> Extent {
        Extent::cube(1)
    }

    fn sample_type(&self) -> SampleType {
        SampleType::U8
    }

    fn read_slab(&mut self, _: Range<u32>, _: &mut [u8]) -> Result<()> {
        Err(Error::new(crate::error::Code::Source, "files", "no file of the series is open: the last one failed"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(folder: &Path, names: &[&str]) {
        for name in names {
            std::fs::write(folder.join(name), "").unwrap();
        }
    }

    #[test]
    fn which_files_are_steps() {
        for (names, wanted) in [
            (&["t10.nrrd", "t2.nrrd", "notes.txt", ".t3.nrrd"][..], &["t2.nrrd", "t10.nrrd"][..]),
            (&["a.nhdr", "a.raw", "b.nhdr", "b.raw"], &["a.nhdr", "b.nhdr"]),
            (&["a.hdr", "a.img", "b.hdr.gz", "b.img.gz"], &["a.hdr", "b.hdr.gz"]),
            (&["1.raw", "2.raw"], &["1.raw", "2.raw"]),
            (&["1.raw", "2.png"], &[]),
            (&["1.txt"], &[]),
        ] {
            let temp = tempfile::tempdir().unwrap();
            named(temp.path(), names);
            let found = steps(temp.path()).unwrap().unwrap_or_default();
            assert_eq!(found.iter().map(|p| name(p)).collect::<Vec<_>>(), wanted, "{names:?}");
        }
        let temp = tempfile::tempdir().unwrap();
        named(temp.path(), &["a.raw", "b.npy"]);
        let e = steps(temp.path()).unwrap_err();
        assert!(e.message().contains("b.npy beside a.raw"), "{e}");
    }

    #[test]
    fn names_with_a_number() {
        let temp = tempfile::tempdir().unwrap();
        named(temp.path(), &["s_0010.raw", "s_0002.raw", "s_3.raw", "s_00x1.raw", "s_0002.raw.gz", "s_##.npy"]);
        let found = |pattern: &str| {
            let found = steps(&temp.path().join(pattern));
            found.map(|f| f.map(|f| f.iter().map(|p| name(p)).collect::<Vec<_>>()))
        };
        assert_eq!(found("s_####.raw").unwrap().unwrap(), ["s_0002.raw", "s_0010.raw"]);
        assert_eq!(found("s_#.raw").unwrap().unwrap(), ["s_0002.raw", "s_3.raw", "s_0010.raw"]);
        assert_eq!(found("s_##.npy").unwrap(), None, "a file of that very name");
        assert_eq!(found("s_0002.raw").unwrap(), None);
        assert_eq!((found("s_#_#.raw").unwrap(), found("s_#.png").unwrap()), (None, None));
        assert!(found("q_####.raw").unwrap_err().message().contains("digits"));
    }
}
