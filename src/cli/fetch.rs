//! Foreign volumes at an address: copied to a temporary file, since their formats are read from files.

use super::open::open_source;
use crate::convert::{self, Format, Import, ImportOptions};
use crate::error::{Code, Error, Result};
use crate::geometry::Extent;
use crate::grid::{SlabReader, View};
use crate::source::ByteSource;
use crate::voxel::SampleType;
use std::fs::File;
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Bytes that are asked for at a time.
const PIECE_BYTES: u64 = 8 << 20;

/// The file name that an address ends with, by which its format is known; `None` for a path of this machine.
pub(super) fn name_in_url(path: &Path) -> Option<&Path> {
    let (scheme, rest) = path.to_str()?.split_once("://")?;
    let named = !scheme.is_empty() && scheme.bytes().all(|b| b.is_ascii_alphanumeric() || b"+-.".contains(&b));
    // What is behind it is for the server.
    let address = rest.split(['?', '#']).next().unwrap_or_default();
    named.then(|| Path::new(address.rsplit('/').next().unwrap_or_default()))
}

/// As [`convert::import`], for addresses as well.
///
/// # Errors
/// Those of [`convert::import`] and of the transport; `E_UNSUPPORTED` for a format of several files.
pub(super) fn import(path: &Path, options: &ImportOptions) -> Result<Import> {
    let Some(name) = name_in_url(path) else { return convert::import(path, options) };
    // Before anything is fetched. A name without an ending could be that of a folder here.
    if name.extension().is_none() || Format::of_path(name).is_none() {
        let message = format!(
            "{}: the address's last name has none of the endings that are understood: {}",
            name.display(),
            Format::ENDINGS
        );
        return Err(Error::new(Code::Unsupported, "format", message));
    }
    let lower = name.to_string_lossy().to_ascii_lowercase();
    let part = [".nhdr", ".hdr", ".hdr.gz", ".img", ".img.gz"].into_iter().find(|e| lower.ends_with(e));
    if let Some(ending) = part {
        let message =
            format!("{}: the format of {ending} has a second file; fetch both, or use .nrrd or .nii", name.display());
        return Err(Error::new(Code::Unsupported, "format", message));
    }
    let (folder, file) = copy(&*open_source(path)?, name, options.temp_dir.as_deref())?;
    let mut import = convert::import(&file, options)?;
    import.reader = Box::new(Fetched { reader: import.reader, _folder: folder });
    Ok(import)
}

/// Copies all of a source to a file of this name in a folder of its own, which goes when it is dropped.
fn copy(source: &dyn ByteSource, name: &Path, temp_dir: Option<&Path>) -> Result<(TempDir, PathBuf)> {
    let mut builder = tempfile::Builder::new();
    builder.prefix("vug-");
    let folder = temp_dir.map_or_else(|| builder.tempdir(), |dir| builder.tempdir_in(dir)).map_err(|e| {
        let dir = temp_dir.map_or_else(std::env::temp_dir, Path::to_owned);
        Error::io(dir.display(), e)
    })?;
    let path = folder.path().join(name);
    let failed = |e| Error::io(path.display(), e);
    let mut file = File::create_new(&path).map_err(failed)?;
    let mut piece = vec![0; PIECE_BYTES.min(source.len()) as usize];
    let mut at = 0;
    while at < source.len() {
        let n = (source.len() - at).min(PIECE_BYTES) as usize;
        source.read_at(at, &mut piece[..n])?;
        file.write_all(&piece[..n]).map_err(failed)?;
        at += n as u64;
    }
    drop(file);
    Ok((folder, path))
}

/// A reader that keeps the folder that its file lies in.
struct Fetched {
    reader: Box<dyn SlabReader>,
    _folder: TempDir,
}

impl SlabReader for Fetched {
    fn extent(&self) -> Extent {
        self.reader.extent()
    }
    fn sample_type(&self) -> SampleType {
        self.reader.sample_type()
    }
    fn read_slab(&mut self, z: Range<u32>, out: &mut [u8]) -> Result<()> {
        self.reader.read_slab(z, out)
    }
    fn read_rows(&mut self, z: Range<u32>, y: Range<u32>, out: &mut [u8]) -> Result<()> {
        self.reader.read_rows(z, y, out)
    }
    fn as_view(&self) -> Option<View<'_>> {
        self.reader.as_view()
    }
    fn series(&self) -> (u32, u32) {
        self.reader.series()
    }
    fn turn_to(&mut self, time: u32, channel: u32) -> Result<()> {
        self.reader.turn_to(time, channel)
    }
    fn is_sequential(&self) -> bool {
        self.reader.is_sequential()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::MemorySource;

    #[test]
    fn names_in_addresses() {
        for (path, name) in [
            ("http://host:80/a/b.nii.gz", Some("b.nii.gz")),
            ("https://host/b.raw?sign=a/b.nrrd#x", Some("b.raw")),
            ("s3://bucket/key.npy", Some("key.npy")),
            ("http://host/", Some("")),
            ("a/b.nrrd", None),
            ("a b://c.nrrd", None),
            ("://c.nrrd", None),
            ("C:\\a.nrrd", None),
        ] {
            assert_eq!(name_in_url(Path::new(path)), name.map(Path::new), "{path}");
        }
    }

    #[test]
    fn a_copy_lives_as_long_as_its_folder() {
        let bytes: Vec<u8> = (0..PIECE_BYTES + 3).map(|i| (i % 251) as u8).collect();
        let (folder, path) = copy(&MemorySource(bytes.clone()), Path::new("a.raw"), None).unwrap();
        assert!(std::fs::read(&path).unwrap() == bytes);
        drop(folder);
        assert!(!path.exists());
        let nowhere = copy(&MemorySource(bytes), Path::new("a.raw"), Some(Path::new("/no/such/folder")));
        assert!(nowhere.err().unwrap().message().contains("/no/such/folder"));
        for (url, word) in [
            ("http://host/a.nhdr", "second file"),
            ("http://host/", "endings"),
            ("http://host/..", "endings"),
            ("http://host/src", "endings"),
            ("http://host/a.txt", ".nrrd"),
        ] {
            let e = import(Path::new(url), &ImportOptions::default()).err().unwrap();
            assert!(e.code() == Code::Unsupported && e.message().contains(word), "{url}: {e}");
        }
    }
}
