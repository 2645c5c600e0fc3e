//! Names of slices: which files of a folder are slices, in what order, and how slices to be written are called.

use super::image::Image;
use crate::convert::fault;
use crate::error::{Code, Error, Result};
use crate::limits;
use std::cmp::Ordering;
use std::fs;
use std::path::{Path, PathBuf};

/// Fewest digits of a slice's number in a folder.
const DIGITS: usize = 4;

/// Orders names as people do: numbers by value (`slice2` before `slice10`), letters whatever their case.
///
/// Names that differ only in leading zeros or case are put in the order of their bytes, so that the order is total.
pub(super) fn natural(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a, b);
    loop {
        let (Some(l), Some(r)) = (left.chars().next(), right.chars().next()) else {
            return left.len().cmp(&right.len()).then_with(|| a.cmp(b));
        };
        let order = if l.is_ascii_digit() && r.is_ascii_digit() {
            let (x, y) = (take_number(&mut left), take_number(&mut right));
            // Without leading zeros, the longer number is the larger one.
            x.len().cmp(&y.len()).then_with(|| x.cmp(y))
        } else {
            (left, right) = (&left[l.len_utf8()..], &right[r.len_utf8()..]);
            l.to_lowercase().cmp(r.to_lowercase())
        };
        if order != Ordering::Equal {
            return order;
        }
    }
}

/// Takes the digits at the front; leading zeros are left out of what is returned.
fn take_number<'a>(text: &mut &'a str) -> &'a str {
    let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let (number, rest) = text.split_at(end);
    *text = rest;
    number.trim_start_matches('0')
}

/// The images in a folder, in natural order. Hidden files, folders and files with other endings are left out.
pub(super) fn images(folder: &Path) -> Result<Vec<(PathBuf, Image)>> {
    natural_order(folder, Image::of_path)
}

/// The files of a folder that `of_path` has a word for, in natural order. Hidden files and folders are left out.
///
/// # Errors
/// `E_SOURCE` where the folder cannot be read, `E_LIMIT` above the cap of an axis.
pub(in crate::convert) fn natural_order<T>(
    folder: &Path,
    of_path: impl Fn(&Path) -> Option<T>,
) -> Result<Vec<(PathBuf, T)>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| fault::io(folder, e))? {
        let path = entry.map_err(|e| fault::io(folder, e))?.path();
        let hidden = path.file_name().is_some_and(|n| n.as_encoded_bytes().starts_with(b"."));
        if let (false, Some(word)) = (hidden || path.is_dir(), of_path(&path)) {
            found.push((path, word));
        }
    }
    limits::check("files", found.len() as u64, u64::from(limits::MAX_AXIS))
        .map_err(|e| fault::relabel(folder, "files", &e))?;
    let name = |path: &Path| path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    found.sort_by_cached_key(|(path, _)| Natural(name(path), path.clone()));
    Ok(found)
}

/// A name that sorts naturally; the path decides where names that are no UTF-8 look the same.
#[derive(PartialEq, Eq)]
struct Natural(String, PathBuf);

impl Ord for Natural {
    fn cmp(&self, other: &Self) -> Ordering {
        natural(&self.0, &other.0).then_with(|| self.1.cmp(&other.1))
    }
}

impl PartialOrd for Natural {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The files of a stack of images that is to be written.
#[derive(Debug, PartialEq)]
pub(in crate::convert) struct Named {
    /// Their format.
    pub image: Image,
    /// One per slice, in order; a single one where it holds all slices as pages.
    pub files: Vec<PathBuf>,
    /// The folder that they lie in.
    pub folder: PathBuf,
}

/// What `path` asks for: a folder of slices (`slices/`), numbered slices (`slice_####.tif`), or a single file. `None`
/// where it names no images.
///
/// # Errors
/// `E_PARAM` where a name cannot stand for `depth` slices, or where slices of another volume lie in the folder.
pub(in crate::convert) fn named(path: &Path, depth: u32) -> Result<Option<Named>> {
    let asks_for_folder = path.as_os_str().to_string_lossy().ends_with(std::path::is_separator);
    if asks_for_folder || path.is_dir() {
        let files = numbered("", DIGITS, ".png", depth).map(|name| path.join(name)).collect();
        let named = Named { image: Image::Png, files, folder: path.to_owned() };
        return strangers(&named).map(|()| Some(named));
    }
    let Some(image) = Image::of_path(path) else { return Ok(None) };
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
    let Some(start) = name.find('#') else {
        if depth > 1 && image != Image::Tiff {
            let stem = name.rfind('.').map_or(name, |dot| &name[..dot]);
            let ending = &name[stem.len()..];
            let message = format!(
                "{}: a {} file holds one slice, the volume has {depth}; name a folder ({stem}/) or say where the number \
                 goes ({stem}_####{ending})",
                path.display(),
                image.name()
            );
            return Err(Error::param("target", message));
        }
        return Ok(Some(Named { image, files: vec![path.to_owned()], folder }));
    };
    let rest = name[start..].trim_start_matches('#');
    if rest.contains('#') {
        let message = format!("{}: the number can go to one place only (####)", path.display());
        return Err(Error::param("target", message));
    }
    let digits = name.len() - start - rest.len();
    let files = numbered(&name[..start], digits, rest, depth).map(|name| folder.join(name)).collect();
    Ok(Some(Named { image, files, folder }))
}

/// Names with the numbers 0 to `depth` − 1, all of them with the digits that the largest one needs, or more.
fn numbered<'a>(before: &'a str, digits: usize, after: &'a str, depth: u32) -> impl Iterator<Item = String> + 'a {
    let digits = digits.max(depth.saturating_sub(1).to_string().len());
    (0..depth).map(move |z| format!("{before}{z:0digits$}{after}"))
}

/// Refuses a folder with other images than those to be written: who reads it would take them for slices.
fn strangers(named: &Named) -> Result<()> {
    if !named.folder.is_dir() {
        return Ok(());
    }
    let ours: std::collections::HashSet<&PathBuf> = named.files.iter().collect();
    match images(&named.folder)?.into_iter().find(|(path, _)| !ours.contains(path)) {
        None => Ok(()),
        Some((other, _)) => Err(Error::new(
            Code::Param,
            "target",
            format!(
                "{} would be taken for a slice of this volume; remove it, or choose another folder",
                other.display()
            ),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn people_count_by_value() {
        let mut names =
            vec!["slice10.png", "slice2.png", "Slice1.png", "slice1.png", "slice002.png", "a", "slice-3", ""];
        names.sort_by(|a, b| natural(a, b));
        let order = ["", "a", "slice-3", "Slice1.png", "slice1.png", "slice002.png", "slice2.png", "slice10.png"];
        assert_eq!(names, order);
        assert_eq!(natural("a99999999999999999999999999999", "a100000000000000000000000000000"), Ordering::Less);
        assert_eq!(natural("x1y10", "x1y9"), Ordering::Greater);
    }

    proptest! {
        #[test]
        fn numbers_sort_by_value_however_they_are_padded(a: u32, b: u32, pad_a in 0usize..12, pad_b in 0usize..12) {
            let name = |v: u32, pad: usize| format!("s{v:0pad$}.tif");
            let order = natural(&name(a, pad_a), &name(b, pad_b));
            prop_assert!(a == b || order == a.cmp(&b));
        }

        #[test]
        fn the_order_is_total(a in "[a-cA-C0-2é.]{0,6}", b in "[a-cA-C0-2é.]{0,6}", c in "[a-cA-C0-2é.]{0,6}") {
            prop_assert_eq!(natural(&a, &b), natural(&b, &a).reverse());
            prop_assert_eq!(natural(&a, &b) == Ordering::Equal, a == b);
            if natural(&a, &b).is_le() && natural(&b, &c).is_le() {
                prop_assert!(natural(&a, &c).is_le());
            }
        }

        #[test]
        fn what_is_written_is_read_in_order(depth in 1u32..12_000, digits in 1usize..7) {
            let pattern = format!("out/s{}_a.tif", "#".repeat(digits));
            let named = named(Path::new(&pattern), depth).unwrap().unwrap();
            prop_assert_eq!(named.files.len(), depth as usize);
            let names: Vec<_> = named.files.iter().map(|f| f.file_name().unwrap().to_str().unwrap()).collect();
            prop_assert!(names.is_sorted_by(|a, b| natural(a, b).is_lt() && a.len() == b.len() && a < b));
        }
    }

    #[test]
    fn targets() {
        let files = |path: &str, depth| named(Path::new(path), depth).map(|n| n.map(|n| (n.image, n.files.len())));
        assert_eq!(files("a/s_##.png", 7).unwrap(), Some((Image::Png, 7)));
        assert_eq!(files("s.tif", 7).unwrap(), Some((Image::Tiff, 1)));
        assert_eq!(files("s.jpg", 1).unwrap(), Some((Image::Jpeg, 1)));
        assert_eq!(files("a#b.nrrd", 7).unwrap(), None);
        assert_eq!(files("no-such-folder/", 3).unwrap(), Some((Image::Png, 3)));
        let last = |path: &str, depth| named(Path::new(path), depth).unwrap().unwrap().files.pop().unwrap();
        assert_eq!(last("none/", 3), Path::new("none/0002.png"));
        assert_eq!(last("none/", 10_001), Path::new("none/10000.png"));
        assert_eq!(last("d#/x#.JPEG", 11), Path::new("d#/x10.JPEG"));
        for (bad, depth) in [("s.png", 2), ("s.jpg", 2), ("a#b#.png", 2)] {
            let e = named(Path::new(bad), depth).unwrap_err();
            assert!(e.code() == Code::Param && e.message().contains("####"), "{e}");
        }
    }
}
