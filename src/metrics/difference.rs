//! Error as a fraction of the range, in five classes from "exact" to "bad", and where the largest error lies.

use super::stats::float_error;
use super::{check_comparable, check_same_extent};
use crate::error::Result;
use crate::geometry::Coord;
use crate::grid::View;
use crate::voxel::Sample;
use crate::with_sample;

/// How bad the error of a voxel is, as a fraction of the reference's range. Intervals are half open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ErrorClass {
    /// No error at all (dark blue).
    Exact = 0,
    /// Above 0 and below 5 % (blue).
    Small = 1,
    /// From 5 % to below 10 % (green).
    Medium = 2,
    /// From 10 % to below 15 % (yellow).
    Large = 3,
    /// 15 % and above (red).
    Bad = 4,
}

impl ErrorClass {
    /// All classes, best first.
    pub const ALL: [ErrorClass; 5] =
        [ErrorClass::Exact, ErrorClass::Small, ErrorClass::Medium, ErrorClass::Large, ErrorClass::Bad];

    /// The class of an absolute error. With a range of 0 every error is [`ErrorClass::Bad`], as is NaN.
    #[must_use]
    pub fn of(error: f64, range: f64) -> Self {
        // Compared as products of small whole numbers, so that exactly 5 % of an integer range is 5 %.
        if error == 0.0 {
            ErrorClass::Exact
        } else if range > 0.0 && error * 20.0 < range {
            ErrorClass::Small
        } else if range > 0.0 && error * 10.0 < range {
            ErrorClass::Medium
        } else if range > 0.0 && error * 20.0 < range * 3.0 {
            ErrorClass::Large
        } else {
            ErrorClass::Bad
        }
    }

    /// Colour of the class in difference images: dark blue, blue, green, yellow, red.
    #[must_use]
    pub const fn color(self) -> [u8; 3] {
        match self {
            ErrorClass::Exact => [14, 22, 70],
            ErrorClass::Small => [52, 112, 235],
            ErrorClass::Medium => [38, 170, 84],
            ErrorClass::Large => [250, 208, 32],
            ErrorClass::Bad => [222, 38, 44],
        }
    }

    /// What the class means, for legends.
    #[must_use]
    pub const fn label(self) -> &'static str {
        match self {
            ErrorClass::Exact => "exact",
            ErrorClass::Small => "below 5 %",
            ErrorClass::Medium => "5 to 10 %",
            ErrorClass::Large => "10 to 15 %",
            ErrorClass::Bad => "15 % and more",
        }
    }
}

/// The error of one voxel: the largest |a − b| of its components, NaN policy of [`super::ErrorStats`].
fn voxel_error<A: Sample, B: Sample>(a: A, b: B) -> f64 {
    (0..A::TYPE.components()).map(|c| float_error(a.component(c), b.component(c))).fold(0.0, f64::max)
}

/// Calls `f` with place and error of every voxel, x fastest.
fn for_each_error(a: &View<'_>, b: &View<'_>, mut f: impl FnMut(Coord, f64)) {
    with_sample!(a.sample_type, A => with_sample!(b.sample_type, B => for z in 0..a.extent.z {
        for y in 0..a.extent.y {
            let row = a.row::<A>(y, z).iter().zip(b.row::<B>(y, z));
            (0..).zip(row).for_each(|(x, (&a, &b))| f([x, y, z], voxel_error(a, b)));
        }
    }))
}

/// Number of voxels per [`ErrorClass`], best first.
///
/// # Errors
/// `E_PARAM` where the boxes cannot be compared, see [`super::compare`].
pub fn class_histogram(a: &View<'_>, b: &View<'_>, range: f64) -> Result<[u64; 5]> {
    let mut counts = [0; 5];
    for_each_class(a, b, range, |_, class| counts[class as usize] += 1)?;
    Ok(counts)
}

/// Calls `f` with the class of every voxel, x fastest.
///
/// # Errors
/// `E_PARAM` where the boxes cannot be compared, see [`super::compare`].
pub fn for_each_class(a: &View<'_>, b: &View<'_>, range: f64, mut f: impl FnMut(Coord, ErrorClass)) -> Result<()> {
    check_same_extent(a, b)?;
    check_comparable(a, b)?;
    for_each_error(a, b, |at, error| f(at, ErrorClass::of(error, range)));
    Ok(())
}

/// The first voxel (x fastest) with the largest error.
pub(super) fn place_of_largest(a: &View<'_>, b: &View<'_>) -> Coord {
    let (mut largest, mut place) = (0.0, [0; 3]);
    for_each_error(a, b, |at, error| {
        if error > largest {
            (largest, place) = (error, at);
        }
    });
    place
}
