//! Foreign files to volumes and back: raw, npy, NRRD, NIfTI, stacks of images (spec chapter 4 says what placement and value
//! map mean), series in time of them, and pipes of raw samples.
//!
//! Reading delivers samples slab by slab; packed files are unpacked whole, into memory or a temporary file. Everything
//! that a header states is checked against the caps and against the length of the data before memory is taken for it.
//! What a format can say and Vug cannot hold yet (light fields, NIfTI's complex numbers) is refused by name.

mod export;
mod fault;
mod inflate;
mod layout;
mod narrow;
mod nifti;
mod npy;
mod nrrd;
mod payload;
mod pipe;
mod raw;
mod series;
mod slabs;
mod spool;
mod stack;
mod stored;
mod stream;

pub use export::{ExportInfo, Target, export, export_series};
pub use stored::{Kind, Stored};

use crate::affine::{Placement, ValueMap};
use crate::error::Result;
use crate::geometry::Extent;
use crate::grid::SlabReader;
use crate::time::Times;
use crate::voxel::SampleType;
use std::path::{Path, PathBuf};

/// A foreign file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// Samples alone: `.raw`, `.bin`.
    Raw,
    /// NumPy array: `.npy`.
    Npy,
    /// `.nrrd`, or `.nhdr` with a data file beside it.
    Nrrd,
    /// NIfTI-1 or NIfTI-2: `.nii`, `.nii.gz`, or a pair of `.hdr` and `.img` (or `.img.gz`).
    Nifti,
    /// Images as slices: a folder of them, `.png`, `.tif`, `.tiff` (a page is a slice), `.jpg`, `.jpeg`.
    Stack,
}

impl Format {
    /// File name endings, for messages.
    pub const ENDINGS: &'static str =
        ".raw .bin .npy .nrrd .nhdr .nii .nii.gz .hdr .hdr.gz .img .img.gz .png .tif .tiff .jpg .jpeg";

    /// The format that a file name's ending stands for. A folder that exists is a stack of images, or of the format of the
    /// volumes in it; `-` (standard input) and pipes are raw.
    #[must_use]
    pub fn of_path(path: &Path) -> Option<Format> {
        if path.is_dir() {
            return Some(series::format_of(path).unwrap_or(Format::Stack));
        }
        Format::of_name(path).or_else(|| pipe::is_pipe(path).then_some(Format::Raw))
    }

    /// The format that a file name's ending stands for.
    fn of_name(path: &Path) -> Option<Format> {
        if stack::Image::of_path(path).is_some() {
            return Some(Format::Stack);
        }
        let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
        let ends = |endings: &[&str]| endings.iter().any(|e| name.ends_with(e));
        if ends(&[".raw", ".bin"]) {
            Some(Format::Raw)
        } else if ends(&[".npy"]) {
            Some(Format::Npy)
        } else if ends(&[".nrrd", ".nhdr"]) {
            Some(Format::Nrrd)
        } else if ends(&[".nii", ".nii.gz", ".hdr", ".hdr.gz", ".img", ".img.gz"]) {
            Some(Format::Nifti)
        } else {
            None
        }
    }

    /// The name used in messages and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Format::Raw => "raw",
            Format::Npy => "npy",
            Format::Nrrd => "NRRD",
            Format::Nifti => "NIfTI",
            Format::Stack => "image stack",
        }
    }
}

/// What the caller knows or wants beyond the file itself.
#[derive(Clone, Debug)]
pub struct ImportOptions {
    /// Voxels per axis (x, y, z; x fastest). Raw files need it, all others ignore it.
    pub shape: Option<Extent>,
    /// Type to deliver, whatever the file stores; `None` keeps the file's, or narrows exactly.
    pub dtype: Option<SampleType>,
    /// Time steps that a raw file or pipe holds one after the other; `None` is one. Others know their own.
    pub time_steps: Option<u32>,
    /// Channels that a raw file or pipe holds in each time step, one after the other; `None` is one.
    pub channels: Option<u32>,
    /// Type and byte order that a raw file stores; `None` means `dtype`, little endian. All others ignore it.
    pub raw_dtype: Option<Stored>,
    /// Most bytes that a packed file, or a slice of a stack, may unpack to.
    pub max_bytes: u64,
    /// Bytes of samples that may be held in memory; a packed file that unpacks to more goes to a temporary file.
    pub memory: u64,
    /// Where temporary files go; `None`: the system's folder for them. They have no name and vanish with the process.
    pub temp_dir: Option<PathBuf>,
}

impl Default for ImportOptions {
    fn default() -> Self {
        ImportOptions {
            shape: None,
            time_steps: None,
            channels: None,
            dtype: None,
            raw_dtype: None,
            max_bytes: 64 << 30,
            memory: 1 << 30,
            temp_dir: None,
        }
    }
}

/// An opened foreign file.
pub struct Import {
    /// Its samples.
    pub reader: Box<dyn SlabReader>,
    /// Where it lies in the world.
    pub placement: Placement,
    /// When the time steps of a series were taken, where the file says.
    pub times: Option<Times>,
    /// Whether the file says that its numbers are labels, of which no mean may be taken.
    pub labels: bool,
    /// What its numbers mean. The samples are as stored: nothing has been applied.
    pub value_map: ValueMap,
    /// An object with `format`, the header's free text (which can name patients), and what [`export`] needs to put the
    /// header back.
    pub header: serde_json::Value,
    /// Its format.
    pub format: Format,
    /// Whether slabs come straight from a file or pipe, so that memory holds no more than one.
    pub streamed: bool,
    /// Bytes of samples that wait in a temporary file, because memory had no room for them.
    pub spooled: u64,
}

impl Import {
    /// Samples of which nothing else is known.
    fn plain(opened: payload::Opened, format: Format, header: serde_json::Value) -> Self {
        let payload::Opened { reader, streamed, spooled } = opened;
        let (placement, value_map) = (Placement::default(), ValueMap::default());
        Import { reader, placement, times: None, labels: false, value_map, header, format, streamed, spooled }
    }
}

/// What a header says of the samples of one file.
struct Probe {
    /// Their type.
    kind: Kind,
    /// Their number and order.
    layout: layout::Layout,
    /// What they mean.
    value_map: ValueMap,
}

/// Opens a foreign file by the ending of its name, a folder of images (slices of one volume) or of volumes (time steps), a
/// name with `####` for the number of a time step, or a pipe of raw samples: `-` is the standard input.
///
/// # Errors
/// `E_UNSUPPORTED` for an unknown ending and for valid files that Vug cannot represent, `E_FOREIGN` for malformed ones,
/// `E_SIZE` where a raw file's length is not that of its shape, `E_LIMIT` above a cap, `E_PARAM` where a raw file comes
/// without shape or type, `E_SOURCE` where the operating system fails. Each names the file and the header field.
pub fn import(path: &Path, options: &ImportOptions) -> Result<Import> {
    match series::steps(path)? {
        Some(files) => series::import(path, files, options),
        None => import_file(path, options),
    }
}

/// As [`import`], but for series of files.
fn import_file(path: &Path, options: &ImportOptions) -> Result<Import> {
    match Format::of_path(path) {
        Some(Format::Raw) => raw::import(path, options),
        Some(Format::Npy) => npy::import(path, options),
        Some(Format::Nrrd) => nrrd::import(path, options),
        Some(Format::Nifti) => nifti::import(path, options),
        Some(Format::Stack) => stack::import(path, options),
        None => Err(fault::unsupported(
            path,
            "format",
            format!(
                "the name's ending is none of those that are understood: {}; or name a folder of images or volumes",
                Format::ENDINGS
            ),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endings() {
        for (name, format) in [
            ("a.raw", Some(Format::Raw)),
            ("a.b.BIN", Some(Format::Raw)),
            ("a.npy", Some(Format::Npy)),
            ("dir.raw/a.nhdr", Some(Format::Nrrd)),
            ("a.NRRD", Some(Format::Nrrd)),
            ("a.nii.gz", Some(Format::Nifti)),
            ("a.img.gz", Some(Format::Nifti)),
            ("a.gz", None),
            ("s_####.TIFF", Some(Format::Stack)),
            ("a.jpeg", Some(Format::Stack)),
            ("src", Some(Format::Stack)),
            ("raw", None),
            ("-", Some(Format::Raw)),
            ("a.raw/", Some(Format::Raw)),
            ("", None),
        ] {
            assert_eq!(Format::of_path(Path::new(name)), format, "{name}");
        }
        let e = import(Path::new("a.gif"), &ImportOptions::default()).err().unwrap();
        assert!(e.message().contains("a.gif") && e.message().contains(".nrrd"), "{e}");
    }
}
