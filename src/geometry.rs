//! Extents, regions, Morton order and checked voxel counts. Axis order is always x, y, z, with x fastest in memory.

use crate::error::{Code, Error, Result};
use crate::limits;
use std::fmt;

/// A voxel or brick position: x, y, z.
pub type Coord = [u32; 3];

/// Size of a box along x, y and z.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Extent {
    /// Voxels along x, the fastest axis.
    pub x: u32,
    /// Voxels along y.
    pub y: u32,
    /// Voxels along z, the slowest axis.
    pub z: u32,
}

impl Extent {
    /// An extent of `x`×`y`×`z`.
    #[must_use]
    pub const fn new(x: u32, y: u32, z: u32) -> Self {
        Extent { x, y, z }
    }

    /// A cube of edge `n`.
    #[must_use]
    pub const fn cube(n: u32) -> Self {
        Extent { x: n, y: n, z: n }
    }

    /// As x, y, z.
    #[must_use]
    pub const fn to_array(self) -> [u32; 3] {
        [self.x, self.y, self.z]
    }

    /// Number of voxels, or `None` where it overflows 64 bits.
    #[must_use]
    pub fn checked_voxels(self) -> Option<u64> {
        u64::from(self.x).checked_mul(u64::from(self.y))?.checked_mul(u64::from(self.z))
    }

    /// Number of voxels of an extent within the caps (`check` has been called).
    ///
    /// # Panics
    /// Where the count overflows 64 bits, which no checked extent does.
    #[must_use]
    pub fn voxels(self) -> u64 {
        self.checked_voxels().expect("an extent within the caps")
    }

    /// How many boxes of `block` cover this extent, per axis.
    #[must_use]
    pub const fn div_ceil(self, block: Extent) -> Extent {
        Extent { x: self.x.div_ceil(block.x), y: self.y.div_ceil(block.y), z: self.z.div_ceil(block.z) }
    }

    /// Extent of level of detail `lod`: each axis is halved `lod` times, rounding up.
    #[must_use]
    pub const fn at_lod(self, lod: u8) -> Extent {
        let d = 1u32 << lod;
        Extent { x: self.x.div_ceil(d), y: self.y.div_ceil(d), z: self.z.div_ceil(d) }
    }

    /// The smaller of both, per axis.
    #[must_use]
    pub fn min(self, other: Extent) -> Extent {
        Extent { x: self.x.min(other.x), y: self.y.min(other.y), z: self.z.min(other.z) }
    }

    /// Whether `c` lies inside.
    #[must_use]
    pub const fn contains(self, c: Coord) -> bool {
        c[0] < self.x && c[1] < self.y && c[2] < self.z
    }

    /// Linear index of `c`, x fastest.
    #[must_use]
    pub fn index(self, c: Coord) -> u64 {
        u64::from(c[0]) + u64::from(self.x) * (u64::from(c[1]) + u64::from(self.y) * u64::from(c[2]))
    }

    /// Checks the extent against the caps of the format.
    ///
    /// # Errors
    /// `E_PARAM` for a zero axis, `E_LIMIT` for an axis above 2^21 or more than 2^48 voxels.
    pub fn check(self) -> Result<()> {
        if self.x == 0 || self.y == 0 || self.z == 0 {
            return Err(Error::param("dims", format!("{self} has an empty axis; every axis needs at least one voxel")));
        }
        for axis in self.to_array() {
            limits::check("dims", u64::from(axis), u64::from(limits::MAX_AXIS))?;
        }
        let voxels = self.checked_voxels().ok_or_else(|| {
            Error::new(Code::Limit, "dims", format!("{self} overflows 64 bits; the cap is 2^48 voxels"))
        })?;
        limits::check("dims", voxels, limits::MAX_VOXELS)
    }
}

impl From<[u32; 3]> for Extent {
    fn from([x, y, z]: [u32; 3]) -> Self {
        Extent { x, y, z }
    }
}

impl fmt::Display for Extent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}×{}×{}", self.x, self.y, self.z)
    }
}

/// A half-open box: `start` inside, `end` outside, in voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Region {
    /// First voxel, per axis.
    pub start: Coord,
    /// One past the last voxel, per axis.
    pub end: Coord,
}

impl Region {
    /// The whole of an extent.
    #[must_use]
    pub const fn whole(e: Extent) -> Self {
        Region { start: [0; 3], end: e.to_array() }
    }

    /// A box of `extent` that starts at `start`.
    #[must_use]
    pub fn at(start: Coord, extent: Extent) -> Self {
        let e = extent.to_array();
        Region { start, end: std::array::from_fn(|a| start[a].saturating_add(e[a])) }
    }

    /// Size per axis; 0 where `end` does not lie behind `start`.
    #[must_use]
    pub fn extent(&self) -> Extent {
        Extent::from(std::array::from_fn(|a| self.end[a].saturating_sub(self.start[a])))
    }

    /// Whether it holds no voxel.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        (0..3).any(|a| self.end[a] <= self.start[a])
    }

    /// The common part (possibly empty).
    #[must_use]
    pub fn intersect(&self, other: &Region) -> Region {
        Region {
            start: std::array::from_fn(|a| self.start[a].max(other.start[a])),
            end: std::array::from_fn(|a| self.end[a].min(other.end[a])),
        }
    }

    /// Checks that the region is not empty and lies inside `within`.
    ///
    /// # Errors
    /// `E_RANGE`.
    pub fn check(&self, within: Extent) -> Result<()> {
        let e = within.to_array();
        if self.is_empty() || (0..3).any(|a| self.end[a] > e[a]) {
            return Err(Error::new(
                Code::Range,
                "region",
                format!("{self} is empty or not inside the volume of {within} voxels (x, y, z)"),
            ));
        }
        Ok(())
    }
}

impl fmt::Display for Region {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (s, e) = (self.start, self.end);
        write!(f, "{}:{},{}:{},{}:{}", s[0], e[0], s[1], e[1], s[2], e[2])
    }
}

/// Morton index of a position in an 8×8×8 page: bits z2 y2 x2 z1 y1 x1 z0 y0 x0.
#[must_use]
pub const fn morton8(c: Coord) -> usize {
    const fn spread(v: u32) -> usize {
        ((v & 1) | (v & 2) << 2 | (v & 4) << 4) as usize
    }
    spread(c[0]) | spread(c[1]) << 1 | spread(c[2]) << 2
}

/// Position of a Morton index below 512.
#[must_use]
pub const fn unmorton8(i: usize) -> Coord {
    const fn gather(i: usize) -> u32 {
        ((i & 1) | (i >> 2 & 2) | (i >> 4 & 4)) as u32
    }
    [gather(i), gather(i >> 1), gather(i >> 2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn morton_is_a_bijection_on_a_page() {
        for i in 0..512 {
            assert_eq!(morton8(unmorton8(i)), i);
        }
        assert_eq!(morton8([1, 0, 0]), 1);
        assert_eq!(morton8([0, 1, 0]), 2);
        assert_eq!(morton8([0, 0, 1]), 4);
    }

    #[test] // D-60, D-61: counts are checked in 64 bits before anything is allocated
    fn hostile_dims() {
        assert_eq!(Extent::cube(u32::MAX).checked_voxels(), None);
        assert_eq!(Extent::cube(u32::MAX).check().unwrap_err().code(), Code::Limit);
        assert_eq!(Extent::new(1 << 21, 1 << 21, 1 << 7).check().unwrap_err().code(), Code::Limit);
        assert_eq!(Extent::new(0, 1, 1).check().unwrap_err().code(), Code::Param);
        Extent::new(1 << 16, 1 << 16, 1 << 16).check().unwrap();
    }

    #[test]
    fn lod_extents_round_up() {
        assert_eq!(Extent::new(3, 1, 8).at_lod(1), Extent::new(2, 1, 4));
    }
}
