//! Values of arguments.

use crate::error::{Error, Result};
use crate::geometry::{Extent, Region};
use std::ops::Range;

pub(super) fn numbers<T: std::str::FromStr>(s: &str, separator: char) -> Option<Vec<T>> {
    s.split(separator).map(|part| part.trim().parse().ok()).collect()
}

pub(super) fn parse_jobs(s: &str) -> Result<usize, String> {
    s.parse().ok().filter(|n| (1..=1024).contains(n)).ok_or_else(|| "wants a number from 1 to 1024".into())
}

pub(super) fn parse_extent(s: &str) -> Result<Extent> {
    match numbers::<u32>(s, ',').as_deref() {
        Some(&[x, y, z]) => Extent::new(x, y, z).check().map(|()| Extent::new(x, y, z)),
        _ => Err(Error::param("shape", format!("{s:?} is not X,Y,Z"))),
    }
}

pub(super) fn parse_bits(s: &str) -> Result<u8, String> {
    s.parse().ok().filter(|n| [1, 2, 4, 8].contains(n)).ok_or_else(|| "wants 1, 2, 4 or 8".into())
}

/// A number of levels; 0: as many as there are.
pub(super) fn parse_levels(s: &str) -> Result<u8, String> {
    match s {
        "auto" => Ok(0),
        n => {
            n.parse().ok().filter(|n| (1..=22).contains(n)).ok_or_else(|| "wants a number from 1 to 22, or auto".into())
        }
    }
}

/// A number of bytes, with K, M, G or T for powers of 1024.
pub(super) fn parse_bytes(s: &str) -> Result<u64, String> {
    let upper = s.trim().to_ascii_uppercase();
    let digits = upper.trim_end_matches("IB").trim_end_matches('B');
    let (number, shift) = match digits.char_indices().last() {
        Some((at, unit)) if "KMGT".contains(unit) => (&digits[..at], 10 * (1 + "KMGT".find(unit).unwrap_or(0))),
        _ => (digits, 0),
    };
    let bytes = number.trim().parse::<f64>().ok().map(|v| v * (1u64 << shift) as f64);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
    bytes.filter(|b| *b >= 1.0 && *b < 1e18).map(|b| b as u64).ok_or_else(|| "wants bytes, as 500M or 2G".into())
}

/// A ratio in millionths.
pub(super) fn parse_keep(s: &str) -> Result<u32, String> {
    let (number, unit) = s.strip_suffix('%').map_or((s, 1e6), |percent| (percent, 1e4));
    match number.trim().parse::<f64>() {
        Ok(v) if v >= 0.0 && v * unit <= 1e6 => Ok((v * unit).round() as u32),
        Ok(v) if v > 1.0 && v <= 100.0 && unit == 1e6 => Err(format!("{v} is a ratio above 1; is {v}% meant?")),
        _ => Err("wants a ratio from 0% to 100%, or from 0 to 1".into()),
    }
}

pub(super) fn parse_block(s: &str) -> Result<Extent, String> {
    let block = match numbers::<u32>(s, ',').as_deref() {
        Some(&[n]) => Extent::cube(n),
        Some(&[x, y, z]) => Extent::new(x, y, z),
        _ => return Err("wants N or X,Y,Z".into()),
    };
    if block.to_array().iter().all(|n| (1..=128).contains(n)) {
        return Ok(block);
    }
    Err("wants 1 to 128 voxels per axis".into())
}

pub(super) fn parse_region(s: &str) -> Result<Region, String> {
    let axes: Option<Vec<Vec<u32>>> = s.split(',').map(|axis| numbers(axis, ':')).collect();
    match axes.as_deref() {
        Some([x, y, z]) if [x, y, z].iter().all(|a| a.len() == 2) => {
            Ok(Region { start: [x[0], y[0], z[0]], end: [x[1], y[1], z[1]] })
        }
        _ => Err("wants X0:X1,Y0:Y1,Z0:Z1".into()),
    }
}

pub(super) fn parse_range(s: &str) -> Result<(f64, f64), String> {
    match numbers::<f64>(s, ',').as_deref() {
        Some(&[lo, hi]) if lo.is_finite() && hi.is_finite() && lo <= hi => Ok((lo, hi)),
        _ => Err("wants LO,HI with LO ≤ HI".into()),
    }
}

pub(super) fn parse_file_id(s: &str) -> Result<[u8; 16], String> {
    let digits = (s.len() == 32 && s.is_ascii()).then(|| u128::from_str_radix(s, 16).ok()).flatten();
    digits.map(u128::to_be_bytes).ok_or_else(|| "wants 32 hex digits".into())
}

/// `A:B`, half open, or one number alone.
pub(super) fn parse_span<T>(s: &str) -> Result<Range<T>, String>
where
    T: std::str::FromStr + Copy + PartialOrd + Step,
{
    match numbers::<T>(s, ':').as_deref() {
        Some(&[one]) => Ok(one..one.next().ok_or("is too large")?),
        Some(&[a, b]) if a < b => Ok(a..b),
        _ => Err("wants A:B with A < B, or one number".into()),
    }
}

/// `WxH`, or one number for both.
#[cfg(feature = "gpu")]
pub(super) fn parse_size(s: &str) -> Result<[u32; 2], String> {
    match numbers::<u32>(&s.replace('×', "x"), 'x').as_deref() {
        Some(&[n]) => Ok([n, n]),
        Some(&[w, h]) => Ok([w, h]),
        _ => Err("wants WIDTHxHEIGHT in pixels".into()),
    }
}

/// Three numbers.
#[cfg(feature = "gpu")]
pub(super) fn parse_vector(s: &str) -> Result<[f64; 3], String> {
    numbers::<f64>(s, ',').and_then(|v| v.try_into().ok()).ok_or_else(|| "wants X,Y,Z".into())
}

/// A point and a direction.
#[cfg(feature = "gpu")]
pub(super) fn parse_plane(s: &str) -> Result<crate::render::scene::Plane, String> {
    let (point, normal) = s.split_once(':').ok_or("wants PX,PY,PZ:NX,NY,NZ")?;
    Ok(crate::render::scene::Plane { point: parse_vector(point)?, normal: parse_vector(normal)? })
}

/// A box in world units.
#[cfg(feature = "gpu")]
pub(super) fn parse_world_box(s: &str) -> Result<crate::render::scene::ClipBox, String> {
    let axes: Option<Vec<Vec<f64>>> = s.split(',').map(|axis| numbers(axis, ':')).collect();
    match axes.as_deref() {
        Some([x, y, z]) if [x, y, z].iter().all(|a| a.len() == 2) => {
            Ok(crate::render::scene::ClipBox { min: [x[0], y[0], z[0]], max: [x[1], y[1], z[1]] })
        }
        _ => Err("wants X0:X1,Y0:Y1,Z0:Z1".into()),
    }
}

/// A colour.
#[cfg(feature = "gpu")]
pub(super) fn parse_color(s: &str) -> Result<[f32; 3], String> {
    let hex = s.strip_prefix('#').filter(|h| h.len() == 6).and_then(|h| u32::from_str_radix(h, 16).ok());
    match (s, hex) {
        ("black", _) => Ok([0.0; 3]),
        ("white", _) => Ok([1.0; 3]),
        (_, Some(rgb)) => Ok([16, 8, 0].map(|shift| (rgb >> shift & 255) as f32 / 255.0)),
        _ => numbers::<f32>(s, ',')
            .and_then(|v| v.try_into().ok())
            .ok_or_else(|| "wants R,G,B from 0 to 1, #rrggbb, black or white".into()),
    }
}

/// Numbers that have a next one.
pub(super) trait Step: Sized {
    fn next(self) -> Option<Self>;
}

impl Step for u8 {
    fn next(self) -> Option<Self> {
        self.checked_add(1)
    }
}

impl Step for u32 {
    fn next(self) -> Option<Self> {
        self.checked_add(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(feature = "gpu")]
    #[test]
    fn sizes_places_and_colours() {
        assert_eq!((parse_size("640x480"), parse_size("64")), (Ok([640, 480]), Ok([64, 64])));
        assert!(parse_size("640x").is_err() && parse_size("-1x2").is_err() && parse_size("1x2x3").is_err());
        assert_eq!((parse_color("#ff0080"), parse_color("white")), (Ok([1.0, 0.0, 128.0 / 255.0]), Ok([1.0; 3])));
        assert!(parse_color("#ff00").is_err() && parse_color("1,2").is_err());
        let plane = parse_plane("1,2,-3:0,0,1").unwrap();
        assert_eq!((plane.point, plane.normal), ([1.0, 2.0, -3.0], [0.0, 0.0, 1.0]));
        assert!(parse_plane("1,2,3").is_err() && parse_world_box("0:1,2:3").is_err());
        assert_eq!(parse_world_box("0:1,-2:3,4:5.5").unwrap().max, [1.0, 3.0, 5.5]);
    }

    #[test]
    fn spans() {
        assert_eq!(parse_span::<u8>("3"), Ok(3..4));
        assert_eq!(parse_span::<u32>("3:5"), Ok(3..5));
        for bad in ["", "5:3", "3:3", "255", "1:2:3", "-1", "a"] {
            assert!(parse_span::<u8>(bad).is_err(), "{bad}");
        }
    }
}
