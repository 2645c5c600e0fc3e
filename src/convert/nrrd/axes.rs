//! Which axes of the array are x, y, z, and whether a voxel is a number or a colour.

use super::fields;
use super::header::Header;
use crate::convert::stored::Kind;
use crate::convert::{fault, payload};
use crate::error::Result;
use crate::geometry::Extent;
use crate::voxel::SampleType;
use std::path::Path;

/// NRRD's own cap on dimensions.
const MAX_DIMENSION: usize = 16;

/// The array's shape, understood.
#[derive(Debug, PartialEq)]
pub(super) struct Axes {
    /// Type of a voxel.
    pub kind: Kind,
    /// Voxels per axis.
    pub extent: Extent,
    /// Array axes that are x, y, z; fewer where the array has fewer.
    pub domain: Vec<usize>,
    /// Number of array axes.
    pub dimension: usize,
}

/// Kinds of axis whose elements belong to one voxel.
fn is_component(kind: &str) -> bool {
    let word = kind.to_ascii_lowercase();
    matches!(word.as_str(), "complex" | "quaternion" | "vector" | "covariant-vector" | "normal" | "gradient")
        || word.ends_with("-vector")
        || word.ends_with("-color")
        || word.ends_with("-gradient")
        || word.ends_with("-normal")
        || word.contains("-matrix")
}

fn is_rgb(kind: &str) -> bool {
    kind.eq_ignore_ascii_case("RGB-color") || kind.eq_ignore_ascii_case("3-color")
}

/// Sizes of all axes.
fn sizes(path: &Path, header: &Header) -> Result<Vec<u64>> {
    let required = |id: &'static str| header.get(id).ok_or_else(|| fault::foreign(path, id, "the field is missing"));
    let dimension: usize = required("dimension")?
        .parse()
        .ok()
        .filter(|d| (1..=MAX_DIMENSION).contains(d))
        .ok_or_else(|| fault::foreign(path, "dimension", format!("is not a number from 1 to {MAX_DIMENSION}")))?;
    let text = required("sizes")?;
    let sizes: Vec<u64> = text
        .split_whitespace()
        .map(str::parse)
        .collect::<Result<_, _>>()
        .map_err(|_| fault::foreign(path, "sizes", format!("{text:.80?} are not numbers of samples")))?;
    if sizes.len() != dimension || sizes.contains(&0) {
        let message = format!("{text:.80?} are not {dimension} sizes of at least 1, as \"dimension\" says");
        return Err(fault::foreign(path, "sizes", message));
    }
    Ok(sizes)
}

/// Understands `type`, `dimension`, `sizes` and `kinds`.
///
/// # Errors
/// `E_FOREIGN` for malformed fields; `E_UNSUPPORTED` for time, vectors, light fields.
pub(super) fn read(path: &Path, header: &Header, forced: Option<SampleType>) -> Result<Axes> {
    let type_text = header.get("type").ok_or_else(|| fault::foreign(path, "type", "the field is missing"))?;
    if type_text.eq_ignore_ascii_case("block") {
        return Err(fault::unsupported(path, "type", "blocks of bytes have no value per voxel"));
    }
    let mut kind = fields::kind_of(type_text)
        .ok_or_else(|| fault::foreign(path, "type", format!("{type_text:.40?} is not a type of NRRD")))?;
    let sizes = sizes(path, header)?;
    let dimension = sizes.len();
    let kinds: Option<Vec<&str>> = header.get("kinds").map(|k| k.split_whitespace().collect());
    if let Some(kinds) = kinds.as_ref().filter(|k| k.len() != dimension) {
        let message = format!("{} kinds are given for {dimension} axes", kinds.len());
        return Err(fault::foreign(path, "kinds", message));
    }
    let kind_at = |axis: usize| kinds.as_ref().map_or("", |k| k[axis]);
    let refuse = |what: &str| {
        let kinds = kinds.as_ref().map(|k| format!(" ({})", k.join(", "))).unwrap_or_default();
        let sizes = sizes.iter().map(u64::to_string).collect::<Vec<_>>().join("×");
        let message = format!("{sizes}{kinds} of {type_text}: {what}");
        Err(fault::unsupported(path, "sizes", message))
    };

    let mut domain: Vec<usize> = (0..dimension).collect();
    let rgb = sizes[0] == 3 && kind == Kind::U8 && (is_rgb(kind_at(0)) || forced == Some(SampleType::Rgb8));
    if rgb {
        kind = Kind::Rgb8;
        domain.remove(0);
        if domain.is_empty() {
            return refuse("a colour without a volume");
        }
    } else if is_rgb(kind_at(0)) {
        return refuse("colours of other types than three uint8 come in a later version");
    } else if is_component(kind_at(0)) && sizes[0] > 1 {
        return refuse("several values per voxel (vectors, matrices, complex numbers) come in a later version");
    }
    // Axes of one sample say nothing: trailing ones first, then leading ones.
    while domain.len() > 3 && domain.last().is_some_and(|a| sizes[*a] == 1) {
        domain.pop();
    }
    while domain.len() > 3 && domain.first().is_some_and(|a| sizes[*a] == 1) {
        domain.remove(0);
    }
    if let Some(axis) = domain.iter().find(|a| is_component(kind_at(**a)) && sizes[**a] > 1) {
        return refuse(&format!("axis {axis} holds several values per voxel, which have to be the first axis"));
    }
    if domain.len() == 4 && sizes[0] == 3 && kind == Kind::U8 && kinds.is_none() {
        return refuse("no \"kinds\" field says whether the first axis is a colour; use --dtype rgb8 if it is");
    }
    if domain.len() > 3 {
        let of_kind = |kind: &str| domain.iter().filter(|a| kind_at(**a).eq_ignore_ascii_case(kind)).count();
        let what = if of_kind("time") > 0 {
            "time series come in a later version; extract one time step"
        } else if domain.len() > 4 || of_kind("list") > 1 {
            "light fields and other arrays of more than four axes come in a later version"
        } else {
            "four axes (time, channels) come in a later version; extract a 3D part"
        };
        return refuse(what);
    }
    if domain.iter().any(|a| kind_at(*a).eq_ignore_ascii_case("time") && sizes[*a] > 1) {
        return refuse("an axis of time is not one of space; time series come in a later version");
    }
    let spatial: Vec<u64> = domain.iter().map(|a| sizes[*a]).collect();
    let extent = payload::extent_of(path, "sizes", &spatial)?;
    payload::byte_len(path, "sizes", extent, kind)?;
    Ok(Axes { kind, extent, domain, dimension })
}

#[cfg(test)]
mod tests {
    use super::super::header::Field;
    use super::*;
    use crate::error::Code;

    fn axes(type_name: &str, sizes: &str, kinds: &str, forced: Option<SampleType>) -> Result<Axes> {
        let mut header = Header::default();
        let dimension = sizes.split_whitespace().count().to_string();
        for (id, value) in [("type", type_name), ("dimension", &dimension), ("sizes", sizes), ("kinds", kinds)] {
            if !value.is_empty() {
                header.fields.push(Field { id: id.into(), name: id.into(), value: value.into() });
            }
        }
        read(Path::new("f.nrrd"), &header, forced)
    }

    #[test]
    fn shapes_that_are_volumes() {
        let ok = |t, s, k, forced| {
            let a = axes(t, s, k, forced).unwrap();
            (a.kind, a.extent.to_array(), a.domain)
        };
        assert_eq!(ok("short", "4 5 6", "", None), (Kind::I16, [4, 5, 6], vec![0, 1, 2]));
        assert_eq!(ok("short", "4", "domain", None), (Kind::I16, [4, 1, 1], vec![0]));
        assert_eq!(
            ok("uchar", "3 4 5 6", "RGB-color domain domain domain", None),
            (Kind::Rgb8, [4, 5, 6], vec![1, 2, 3])
        );
        assert_eq!(ok("uchar", "3 4 5", "3-color space space", None), (Kind::Rgb8, [4, 5, 1], vec![1, 2]));
        assert_eq!(ok("uchar", "3 4 5 6", "", Some(SampleType::Rgb8)).0, Kind::Rgb8);
        assert_eq!(ok("uchar", "3 4 5", "", None), (Kind::U8, [3, 4, 5], vec![0, 1, 2]));
        assert_eq!(ok("double", "1 1 1 1", "", None), (Kind::F64, [1, 1, 1], vec![0, 1, 2]));
        assert_eq!(ok("float", "1 4 5 6", "vector domain domain domain", None), (Kind::F32, [4, 5, 6], vec![1, 2, 3]));
    }

    #[test]
    fn shapes_that_are_refused_by_name() {
        for (t, s, k, word) in [
            ("float", "3 4 5 6", "vector domain domain domain", "vectors"),
            ("float", "3 4 5 6", "RGB-color domain domain domain", "colours"),
            ("ushort", "4 5 6 7", "domain domain domain time", "time"),
            ("ushort", "4 5 7", "domain domain time", "time"),
            ("uchar", "3 4 5 9 9", "RGB-color domain domain list list", "light field"),
            ("uchar", "3 4 5 6 9 9", "RGB-color domain domain domain list list", "light field"),
            ("short", "4 5 6 7", "domain domain domain list", "four axes"),
            ("uchar", "4 4 5 6", "RGBA-color domain domain domain", "several values"),
            ("uchar", "4 5 6 3", "domain domain domain 3-vector", "first axis"),
            ("uchar", "3 4 5 6", "", "--dtype rgb8"),
            ("block", "4 5 6", "", "blocks"),
        ] {
            let e = axes(t, s, k, None).unwrap_err();
            assert!(e.code() == Code::Unsupported && e.message().contains(word), "{s} {k}: {e}");
        }
    }

    #[test] // D-60, D-61
    fn hostile_sizes() {
        for (s, code) in [
            ("0 1 1", Code::Foreign),
            ("-1 1 1", Code::Foreign),
            ("4294967296 1 1", Code::Limit),
            ("4294967295 4294967295 4294967295", Code::Limit),
            ("2097152 2097152 2097152", Code::Limit),
            ("99999999999999999999 1 1", Code::Foreign),
        ] {
            assert_eq!(axes("double", s, "", None).unwrap_err().code(), code, "{s}");
        }
        assert!(axes("int", "1 1 1", "domain", None).is_err());
        assert!(axes("long", "1 1 1", "", None).is_err());
    }
}
