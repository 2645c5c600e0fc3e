//! Where a volume lies in the world: affine, coordinate space, unit, and the meaning of values (spec chapter 4).

use crate::error::{Error, Result};
use crate::geometry::Coord;

macro_rules! wire_enum {
    ($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $variant:ident = $code:literal, $text:literal;)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
        #[repr(u8)]
        pub enum $name { $($(#[$vdoc])* $variant = $code,)* }

        impl $name {
            /// All values, in file order.
            pub const ALL: &'static [$name] = &[$($name::$variant,)*];

            /// The value of a file's number.
            #[must_use]
            pub fn from_wire(value: u8) -> Option<Self> {
                Self::ALL.iter().copied().find(|v| *v as u8 == value)
            }

            /// The name used in JSON.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $($name::$variant => $text,)* }
            }
        }
    };
}

wire_enum! {
    /// Which way the world axes point.
    Space {
        /// Not stated.
        #[default]
        Unknown = 0, "unknown";
        /// +x right, +y anterior, +z superior (NIfTI).
        Ras = 1, "RAS";
        /// +x left, +y posterior, +z superior (DICOM).
        Lps = 2, "LPS";
        /// +x left, +y anterior, +z superior.
        Las = 3, "LAS";
        /// The scanner's own axes.
        Scanner = 4, "scanner";
    }
}

wire_enum! {
    /// Unit of spacing and origin.
    Unit {
        /// Not stated.
        #[default]
        Unknown = 0, "unknown";
        /// 1 m.
        Metre = 1, "m";
        /// 10^-3 m.
        Millimetre = 2, "mm";
        /// 10^-6 m.
        Micrometre = 3, "um";
        /// 10^-9 m.
        Nanometre = 4, "nm";
        /// 10^-10 m.
        Angstrom = 5, "angstrom";
        /// 5.29177210903 × 10^-11 m.
        Bohr = 6, "bohr";
    }
}

/// How an integer voxel index becomes a world position: the *centre* of voxel (i, j, k) lies at `matrix · (i, j, k, 1)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// Three rows of four: world x, y, z from (i, j, k, 1).
    pub matrix: [[f64; 4]; 3],
    /// Which way the world axes point.
    pub space: Space,
    /// Unit of the matrix.
    pub unit: Unit,
    /// Whether the source said nothing about spacing (the matrix is then the identity's scale).
    pub spacing_unknown: bool,
}

impl Default for Placement {
    fn default() -> Self {
        Placement {
            matrix: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
            space: Space::Unknown,
            unit: Unit::Unknown,
            spacing_unknown: true,
        }
    }
}

impl Placement {
    /// Axis-parallel placement with this spacing and origin.
    #[must_use]
    pub fn from_spacing(spacing: [f64; 3], origin: [f64; 3]) -> Self {
        let mut p = Placement { spacing_unknown: false, ..Placement::default() };
        for a in 0..3 {
            p.matrix[a][a] = spacing[a];
            p.matrix[a][3] = origin[a];
        }
        p
    }

    /// Step of index axis `axis` in world coordinates.
    #[must_use]
    pub fn direction(&self, axis: usize) -> [f64; 3] {
        std::array::from_fn(|row| self.matrix[row][axis])
    }

    /// Distance of voxel centres along x, y, z, in [`Placement::unit`].
    #[must_use]
    pub fn spacing(&self) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let [x, y, z] = self.direction(axis);
            x.hypot(y).hypot(z)
        })
    }

    /// Position of the centre of voxel (0, 0, 0).
    #[must_use]
    pub fn origin(&self) -> [f64; 3] {
        self.direction(3)
    }

    /// Placement of a part of level `lod` that starts at voxel `start` of that level, or of one that is halved from a finer
    /// one: the centre of its first voxel, and the level's steps.
    #[must_use]
    pub fn moved(&self, lod: u8, start: Coord) -> Self {
        let mut moved = self.clone();
        let step = f64::from(1u32 << lod);
        for row in &mut moved.matrix {
            for (axis, first) in start.into_iter().enumerate() {
                // A voxel of level l covers 2^l voxels of level 0; its centre lies between theirs.
                row[3] += row[axis] * (f64::from(first) * step + (step - 1.0) / 2.0);
            }
            for v in &mut row[..3] {
                *v *= step;
            }
        }
        moved
    }

    /// Determinant of the 3×3 part: negative for a left-handed placement, 0 for a singular one.
    #[must_use]
    pub fn determinant(&self) -> f64 {
        let [a, b, c] = [self.direction(0), self.direction(1), self.direction(2)];
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    }

    /// Checks that every number is finite, every step a normal positive length, and the axes independent.
    ///
    /// A left-handed placement is legal (D-58); a spacing of 0, NaN or a subnormal is not (D-56).
    ///
    /// # Errors
    /// `E_PARAM`.
    pub fn check(&self) -> Result<()> {
        if self.matrix.iter().flatten().any(|v| !v.is_finite()) {
            return Err(Error::param(
                "affine",
                "a value is NaN or infinite; give finite spacing, direction and origin",
            ));
        }
        let spacing = self.spacing();
        if spacing.iter().any(|s| !s.is_normal()) {
            return Err(Error::param(
                "affine",
                format!("spacing {spacing:?} (x, y, z) is zero or not a normal number"),
            ));
        }
        // Compared on unit directions, so that tiny spacings are not mistaken for a singular matrix.
        let mut unit = self.clone();
        for row in &mut unit.matrix {
            for (v, s) in row.iter_mut().zip(spacing) {
                *v /= s;
            }
        }
        if unit.determinant().abs() < 1e-9 {
            return Err(Error::param("affine", "the axes are not independent (singular direction matrix)"));
        }
        Ok(())
    }
}

/// What the stored numbers mean: `value = stored · scale + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueMap {
    /// Factor; 1 where the source has none.
    pub scale: f64,
    /// Summand; 0 where the source has none.
    pub offset: f64,
}

impl Default for ValueMap {
    fn default() -> Self {
        ValueMap { scale: 1.0, offset: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test] // D-56, D-58
    fn degenerate_placements() {
        for bad in [0.0, f64::NAN, f64::INFINITY, 1e-310] {
            assert!(Placement::from_spacing([1.0, bad, 1.0], [0.0; 3]).check().is_err(), "{bad}");
        }
        let mut singular = Placement::from_spacing([1.0; 3], [0.0; 3]);
        singular.matrix[1] = singular.matrix[0];
        assert!(singular.check().is_err());
        let mut left_handed = Placement::from_spacing([1.0; 3], [0.0; 3]);
        left_handed.matrix[0][0] = -1.0;
        left_handed.check().unwrap();
        Placement::from_spacing([1e-6; 3], [1e9; 3]).check().unwrap();
    }

    #[test] // B-03: the centre of a coarse voxel lies between those of its children
    fn parts_and_levels_stay_where_they_are() {
        let p = Placement::from_spacing([2.0, 3.0, 4.0], [10.0, 20.0, 30.0]);
        assert_eq!(p.moved(0, [1, 2, 3]).origin(), [12.0, 26.0, 42.0]);
        assert_eq!(p.moved(1, [0, 0, 0]).origin(), [11.0, 21.5, 32.0]);
        assert_eq!(p.moved(1, [1, 0, 0]).origin(), [15.0, 21.5, 32.0]);
        assert_eq!(p.moved(1, [0, 0, 0]).spacing(), [4.0, 6.0, 8.0]);
    }
}
