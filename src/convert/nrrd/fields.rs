//! Values of fields: types, encodings, number lists, vectors, quoted strings, spaces and units.

use crate::affine::{Space, Unit};
use crate::convert::stored::Kind;

/// Sample type of a `type` field, with all its aliases.
pub(super) fn kind_of(value: &str) -> Option<Kind> {
    Some(match value.to_ascii_lowercase().as_str() {
        "signed char" | "int8" | "int8_t" => Kind::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Kind::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Kind::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Kind::U16,
        "int" | "signed int" | "int32" | "int32_t" => Kind::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Kind::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Kind::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Kind::U64,
        "float" => Kind::F32,
        "double" => Kind::F64,
        _ => return None,
    })
}

/// The name that is written for a type.
pub(super) const fn type_name(kind: Kind) -> &'static str {
    match kind {
        Kind::U8 | Kind::Rgb8 => "uint8",
        Kind::I8 => "int8",
        Kind::U16 => "uint16",
        Kind::I16 => "int16",
        Kind::U32 => "uint32",
        Kind::I32 => "int32",
        Kind::U64 => "uint64",
        Kind::I64 => "int64",
        Kind::F32 => "float",
        Kind::F64 => "double",
    }
}

/// World axes that a `space` name stands for, and their number; `None` where NRRD knows no such name.
pub(super) fn space_of(value: &str) -> Option<(Space, usize)> {
    let name = value.to_ascii_lowercase();
    let (name, dims) = match name.strip_suffix("-time").or_else(|| name.strip_suffix('t').filter(|n| n.len() == 3)) {
        Some(spatial) => (spatial, 4),
        None => (name.as_str(), 3),
    };
    let space = match name {
        "right-anterior-superior" | "ras" => Space::Ras,
        "left-anterior-superior" | "las" => Space::Las,
        "left-posterior-superior" | "lps" => Space::Lps,
        "scanner-xyz" => Space::Scanner,
        "3d-right-handed" | "3d-left-handed" => Space::Unknown,
        _ => return None,
    };
    Some((space, dims))
}

/// The name that is written for a space.
pub(super) const fn space_name(space: Space) -> Option<&'static str> {
    match space {
        Space::Unknown => None,
        Space::Ras => Some("right-anterior-superior"),
        Space::Lps => Some("left-posterior-superior"),
        Space::Las => Some("left-anterior-superior"),
        Space::Scanner => Some("scanner-xyz"),
    }
}

/// A unit as people write it.
pub(super) fn unit_of(text: &str) -> Unit {
    // Case matters: Mm is not mm.
    match text.trim() {
        "m" | "meter" | "meters" | "metre" | "metres" => Unit::Metre,
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => Unit::Millimetre,
        "um" | "\u{b5}m" | "\u{3bc}m" | "micron" | "microns" | "micrometer" | "micrometers" | "micrometre"
        | "micrometres" => Unit::Micrometre,
        "nm" | "nanometer" | "nanometers" | "nanometre" | "nanometres" => Unit::Nanometre,
        "A" | "\u{c5}" | "\u{212b}" | "angstrom" | "angstroms" | "Angstrom" | "Angstroms" => Unit::Angstrom,
        "bohr" | "Bohr" | "a0" => Unit::Bohr,
        _ => Unit::Unknown,
    }
}

/// Numbers separated by blanks; `nan` and `inf` in any case.
pub(super) fn numbers(value: &str) -> Option<Vec<f64>> {
    value.split_whitespace().map(|t| t.parse().ok()).collect()
}

/// Strings in double quotes, separated by blanks. A bare word stands for itself.
pub(super) fn quoted(value: &str) -> Option<Vec<String>> {
    let mut rest = value.trim_start();
    let mut out = Vec::new();
    while !rest.is_empty() {
        let (text, tail) = match rest.strip_prefix('"') {
            Some(inner) => inner.split_once('"')?,
            None => rest.split_once(char::is_whitespace).unwrap_or((rest, "")),
        };
        out.push(text.to_owned());
        rest = tail.trim_start();
    }
    Some(out)
}

/// Vectors `(a,b,c)` or the word `none`, separated by blanks.
pub(super) fn vectors(value: &str) -> Option<Vec<Option<Vec<f64>>>> {
    let mut rest = value.trim_start();
    let mut out = Vec::new();
    while !rest.is_empty() {
        let tail = if let Some(inner) = rest.strip_prefix('(') {
            let (list, tail) = inner.split_once(')')?;
            out.push(Some(list.split(',').map(|t| t.trim().parse().ok()).collect::<Option<Vec<f64>>>()?));
            tail
        } else {
            out.push(None);
            rest.strip_prefix("none")?
        };
        rest = tail.trim_start();
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists() {
        assert_eq!(numbers("1 2.5  -3e2").unwrap(), [1.0, 2.5, -300.0]);
        assert!(numbers("nan NaN").unwrap().iter().all(|v| v.is_nan()));
        assert!(numbers("1 x").is_none());
        assert_eq!(quoted("\"mm\" \"\" \"a b\" cm").unwrap(), ["mm", "", "a b", "cm"]);
        assert!(quoted("\"mm").is_none());
        assert_eq!(
            vectors("none (1, 0,0) (0,-2.5e-1,0)").unwrap(),
            [None, Some(vec![1.0, 0.0, 0.0]), Some(vec![0.0, -0.25, 0.0])]
        );
        for bad in ["(1,2", "(1,x)", "nothing", "1,2"] {
            assert!(vectors(bad).is_none(), "{bad}");
        }
    }

    #[test]
    fn names() {
        for kind in Kind::ALL.into_iter().filter(|k| *k != Kind::Rgb8) {
            assert_eq!(kind_of(type_name(kind)), Some(kind));
        }
        for space in Space::ALL {
            if let Some(name) = space_name(*space) {
                assert_eq!(space_of(name), Some((*space, 3)));
                assert_eq!(space_of(&format!("{name}-time")), Some((*space, 4)));
            }
        }
        assert_eq!((space_of("LPS"), space_of("RAST")), (Some((Space::Lps, 3)), Some((Space::Ras, 4))));
        assert_eq!(space_of("right-up"), None);
        for unit in Unit::ALL {
            assert_eq!(unit_of(unit.name()), *unit);
        }
        assert_eq!(unit_of("Mm"), Unit::Unknown);
    }
}
