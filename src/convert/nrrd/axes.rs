//! Which axes of the array are x, y, z, which are time and channels, and whether a voxel is a number or a colour.

use super::fields;
use super::header::Header;
use super::times::is_time_list;
use crate::convert::fault;
use crate::convert::layout::{Layout, Role};
use crate::convert::stored::Kind;
use crate::error::Result;
use crate::voxel::SampleType;
use std::path::Path;

/// NRRD's own cap on dimensions.
const MAX_DIMENSION: usize = 16;

/// The array's shape, understood.
#[derive(Debug, PartialEq)]
pub(super) struct Axes {
    /// Type of a voxel.
    pub kind: Kind,
    /// Where each sample lies.
    pub layout: Layout,
    /// Array axes that are x, y, z; fewer where the array has fewer.
    pub domain: Vec<usize>,
    /// The array axis that is time.
    pub time: Option<usize>,
    /// Number of array axes.
    pub dimension: usize,
}

/// Kinds of axis whose elements belong to one voxel.
fn is_component(word: &str) -> bool {
    matches!(word, "complex" | "quaternion" | "vector" | "covariant-vector" | "normal" | "gradient" | "point")
        || ["-vector", "-color", "-gradient", "-normal"].iter().any(|ending| word.ends_with(ending))
        || word.contains("-matrix")
}

/// How many elements an axis of this kind has; `None`: any number.
pub(super) fn components(kind: &str) -> Option<u32> {
    let word = kind.to_ascii_lowercase();
    Some(match word.as_str() {
        "complex" | "2-vector" => 2,
        "quaternion" | "rgba-color" => 4,
        "rgb-color" | "hsv-color" | "xyz-color" | "2d-symmetric-matrix" => 3,
        "2d-masked-symmetric-matrix" | "2d-matrix" => 4,
        "2d-masked-matrix" => 5,
        "3d-symmetric-matrix" => 6,
        "3d-masked-symmetric-matrix" => 7,
        "3d-matrix" => 9,
        "3d-masked-matrix" => 10,
        _ => return word.split_once('-').and_then(|(number, _)| number.parse().ok()),
    })
}

fn is_rgb(kind: &str) -> bool {
    kind.eq_ignore_ascii_case("RGB-color") || kind.eq_ignore_ascii_case("3-color")
}

/// What the word of a `kinds` field says of an axis; `None` where it says nothing.
pub(super) fn role_of(kind: &str) -> Option<Role> {
    match kind.to_ascii_lowercase().as_str() {
        // Which of them is decided by their order.
        "domain" | "space" => Some(Role::Space(0)),
        "time" => Some(Role::Time),
        "list" => Some(Role::Channel),
        word if is_component(word) => Some(Role::Channel),
        _ => None,
    }
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
/// Axes of time, lists, and values that belong to one voxel may lie anywhere among those of space. A list is one of
/// channels, unless the header says that it is one of time.
///
/// # Errors
/// `E_FOREIGN` for malformed fields; `E_UNSUPPORTED` for more than five axes, or where nothing says what they are.
pub(super) fn read(path: &Path, header: &Header, forced: Option<SampleType>) -> Result<Axes> {
    let type_text = header.get("type").ok_or_else(|| fault::foreign(path, "type", "the field is missing"))?;
    if type_text.eq_ignore_ascii_case("block") {
        return Err(fault::unsupported(path, "type", "blocks of bytes have no value per voxel"));
    }
    let mut kind = fields::kind_of(type_text)
        .ok_or_else(|| fault::foreign(path, "type", format!("{type_text:.40?} is not a type of NRRD")))?;
    let mut sizes = sizes(path, header)?;
    let dimension = sizes.len();
    let kinds: Option<Vec<&str>> = header.get("kinds").map(|k| k.split_whitespace().collect());
    if let Some(kinds) = kinds.as_ref().filter(|k| k.len() != dimension) {
        let message = format!("{} kinds are given for {dimension} axes", kinds.len());
        return Err(fault::foreign(path, "kinds", message));
    }
    let kind_at = |axis: usize| kinds.as_ref().map_or("", |k| k[axis]);
    let shape = sizes.iter().map(u64::to_string).collect::<Vec<_>>().join("×");
    let refuse = |what: &str| {
        let kinds = kinds.as_ref().map(|k| format!(" ({})", k.join(", "))).unwrap_or_default();
        Err(fault::unsupported(path, "sizes", format!("{shape}{kinds} of {type_text}: {what}")))
    };

    let placeless = placeless(header, dimension);
    let mut roles: Vec<Role> = (0..dimension)
        .map(|axis| match role_of(kind_at(axis)) {
            Some(Role::Channel) if kind_at(axis).eq_ignore_ascii_case("list") && is_time_list(header, axis) => {
                Role::Time
            }
            Some(role) => role,
            // An axis without a direction among others with one is not of space.
            None if placeless.get(axis) == Some(&true) => Role::Channel,
            None => Role::Space(0),
        })
        .collect();
    let colour = sizes[0] == 3 && kind == Kind::U8 && (is_rgb(kind_at(0)) || forced == Some(SampleType::Rgb8));
    if colour {
        (kind, roles[0], sizes[0]) = (Kind::Rgb8, Role::Nothing, 1);
    }
    for (role, size) in roles.iter_mut().zip(&sizes) {
        if *size == 1 && matches!(role, Role::Time | Role::Channel) {
            *role = Role::Nothing;
        }
    }
    let mut domain: Vec<usize> = (0..dimension).filter(|a| matches!(roles[*a], Role::Space(_))).collect();
    // Axes of one sample say nothing: trailing ones first, then leading ones.
    while domain.len() > 3 && domain.last().is_some_and(|a| sizes[*a] == 1) {
        roles[domain.pop().expect("more than three")] = Role::Nothing;
    }
    while domain.len() > 3 && domain.first().is_some_and(|a| sizes[*a] == 1) {
        roles[domain.remove(0)] = Role::Nothing;
    }
    if domain.len() == 4 && sizes[0] == 3 && kind == Kind::U8 && kinds.is_none() {
        return refuse("no \"kinds\" field says whether the first axis is a colour; use --dtype rgb8 if it is");
    }
    if domain.len() > 3 && kinds.is_none() {
        return refuse(
            "no \"kinds\" field says which axes are time or channels; add one, such as \"kinds: domain domain domain time\"",
        );
    }
    let of_role = |role: Role| roles.iter().filter(|r| **r == role).count();
    if domain.len() > 3 || of_role(Role::Time) > 1 || of_role(Role::Channel) > 1 {
        return refuse("light fields and other arrays of more than space, time and channels come in a later version");
    }
    if domain.is_empty() {
        return refuse("there is no axis of space; a kind such as \"domain\" marks one");
    }
    for (number, axis) in domain.iter().enumerate() {
        roles[*axis] = Role::Space(number);
    }
    let axes: Vec<(Role, u64)> = roles.iter().copied().zip(sizes.iter().copied()).collect();
    let layout = Layout::new(path, "sizes", &axes, kind)?;
    let time = roles.iter().position(|r| *r == Role::Time);
    Ok(Axes { kind, layout, domain, time, dimension })
}

/// Which axes `space directions` leaves out, where it leaves out some but not all.
fn placeless(header: &Header, dimension: usize) -> Vec<bool> {
    let vectors = header.get("spacedirections").and_then(fields::vectors).filter(|v| v.len() == dimension);
    let none: Vec<bool> = vectors.unwrap_or_default().iter().map(Option::is_none).collect();
    if none.contains(&false) { none } else { Vec::new() }
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
            assert!(a.layout.is_single() && a.layout.is_dense());
            (a.kind, a.layout.extent.to_array(), a.domain)
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
    fn shapes_that_are_series() {
        let ok = |t, s, k| {
            let Axes { kind, layout: l, domain, time, .. } = axes(t, s, k, None).unwrap();
            (kind, l.extent.to_array(), (l.time_steps, l.channels), (l.space[0], l.time, l.channel), domain, time)
        };
        let dense = [0, 1, 2];
        assert_eq!(
            ok("ushort", "4 5 6 7", "domain domain domain time"),
            (Kind::U16, [4, 5, 6], (7, 1), (1, 120, 0), dense.to_vec(), Some(3))
        );
        assert_eq!(
            ok("ushort", "4 5 7", "domain domain time"),
            (Kind::U16, [4, 5, 1], (7, 1), (1, 20, 0), vec![0, 1], Some(2))
        );
        assert_eq!(
            ok("short", "4 5 6 2", "space space space list"),
            (Kind::I16, [4, 5, 6], (1, 2), (1, 0, 120), dense.to_vec(), None)
        );
        assert_eq!(
            ok("float", "3 4 5 6", "vector domain domain domain"),
            (Kind::F32, [4, 5, 6], (1, 3), (3, 0, 1), vec![1, 2, 3], None)
        );
        // A colour of anything but three bytes, the fastest, is channels.
        assert_eq!(ok("float", "3 4 5 6", "RGB-color domain domain domain").2, (1, 3));
        assert_eq!(ok("uchar", "4 4 5 6", "RGBA-color domain domain domain").2, (1, 4));
        assert_eq!(ok("uchar", "4 5 6 3", "domain domain domain RGB-color").3, (1, 0, 120));
        assert_eq!(
            ok("uchar", "3 4 5 6 9", "RGB-color domain domain domain time"),
            (Kind::Rgb8, [4, 5, 6], (9, 1), (1, 120, 0), vec![1, 2, 3], Some(4))
        );
        assert_eq!(
            ok("short", "2 4 5 7 6", "3-vector domain domain time domain"),
            (Kind::I16, [4, 5, 6], (7, 2), (2, 40, 1), vec![1, 2, 4], Some(3))
        );
    }

    #[test]
    fn what_is_not_said_by_kinds() {
        let with = |kinds: &str, id: &str, value: &str| {
            let mut header = Header::default();
            let lines = [("type", "short"), ("dimension", "4"), ("sizes", "2 4 5 6"), ("kinds", kinds), (id, value)];
            for (id, value) in lines.iter().filter(|(_, v)| !v.is_empty()) {
                header.fields.push(Field { id: (*id).into(), name: (*id).into(), value: (*value).into() });
            }
            if id == "key" {
                header.key_values.push(("axis 0 index values".into(), value.into()));
            }
            read(Path::new("f.nrrd"), &header, None).map(|a| (a.layout.time_steps, a.layout.channels))
        };
        let list = "list domain domain domain";
        assert_eq!(with(list, "labels", "\"frame\" \"\" \"\" \"\"").unwrap(), (1, 2));
        assert_eq!(with(list, "labels", "\"time\" \"\" \"\" \"\"").unwrap(), (2, 1));
        assert_eq!(with(list, "units", "\"ms\" \"mm\" \"mm\" \"mm\"").unwrap(), (2, 1));
        assert_eq!(with(list, "key", "0 1.5").unwrap(), (2, 1));
        assert_eq!(with("", "spacedirections", "none (1,0,0) (0,1,0) (0,0,1)").unwrap(), (1, 2));
        let e = with("", "spacings", "1 1 1 1").unwrap_err();
        assert!(e.message().contains("kinds: domain domain domain time"), "{e}");
    }

    #[test]
    fn shapes_that_are_refused_by_name() {
        for (t, s, k, word) in [
            ("uchar", "3 4 5 9 9", "RGB-color domain domain list list", "light field"),
            ("uchar", "3 4 5 6 9 9", "RGB-color domain domain domain list list", "light field"),
            ("float", "3 4 5 6 9", "vector domain domain domain list", "light field"),
            ("short", "4 5 6 7", "domain domain domain domain", "light field"),
            ("short", "7", "time", "no axis of space"),
            ("uchar", "3", "RGB-color", "no axis of space"),
            ("uchar", "3 4 5 6", "", "--dtype rgb8"),
            ("short", "4 5 6 7", "", "kinds"),
            ("block", "4 5 6", "", "blocks"),
        ] {
            let e = axes(t, s, k, None).unwrap_err();
            assert!(e.code() == Code::Unsupported && e.message().contains(word), "{s} {k}: {e}");
        }
    }

    #[test]
    fn words_that_say_how_many() {
        for (word, n) in [("RGB-color", 3), ("3-gradient", 3), ("4-color", 4), ("3D-masked-symmetric-matrix", 7)] {
            assert_eq!(components(word), Some(n));
        }
        assert_eq!((components("vector"), components("list"), components("covariant-vector")), (None, None, None));
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
