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

    #[test]
    fn spans() {
        assert_eq!(parse_span::<u8>("3"), Ok(3..4));
        assert_eq!(parse_span::<u32>("3:5"), Ok(3..5));
        for bad in ["", "5:3", "3:3", "255", "1:2:3", "-1", "a"] {
            assert!(parse_span::<u8>(bad).is_err(), "{bad}");
        }
    }
}
