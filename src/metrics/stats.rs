//! One-pass error sums of two boxes of the same type: what the encoder stores per brick and `compare` per slice.

use super::check_same_extent;
use crate::error::{Error, Result};
use crate::grid::View;
use crate::voxel::Sample;
use crate::with_sample;

/// Sums over the differences of two boxes `a` (reference) and `b` (decoded), component by component.
///
/// Two NaNs are equal, as are two infinities of one sign; a NaN or an infinity against anything else is an infinite
/// error. The integer types are summed exactly; every sum below 2^53 is exact in any order of merging.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorStats {
    /// Number of compared components (voxels × components).
    pub count: u64,
    /// Largest |a − b|.
    pub max_abs: f64,
    /// Sum of |a − b|.
    pub sum_abs: f64,
    /// Sum of (a − b)².
    pub sum_sq: f64,
    /// Smallest component of `b`; NaN is skipped, +∞ where there is none.
    pub min: f64,
    /// Largest component of `b`; NaN is skipped, −∞ where there is none.
    pub max: f64,
}

impl Default for ErrorStats {
    fn default() -> Self {
        let (min, max) = (f64::INFINITY, f64::NEG_INFINITY);
        ErrorStats { count: 0, max_abs: 0.0, sum_abs: 0.0, sum_sq: 0.0, min, max }
    }
}

impl ErrorStats {
    /// Adds the sums of another box. Merge in a fixed order where the last bits of float sums must not vary.
    pub fn merge(&mut self, other: &ErrorStats) {
        self.count += other.count;
        self.max_abs = self.max_abs.max(other.max_abs);
        self.sum_abs += other.sum_abs;
        self.sum_sq += other.sum_sq;
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
    }

    /// Adds one pair of values: the definition, of which the typed kernels are faster forms.
    fn add(&mut self, a: f64, b: f64) {
        let d = float_error(a, b);
        self.count += 1;
        self.max_abs = self.max_abs.max(d);
        self.sum_abs += d;
        self.sum_sq += d * d;
        self.min = self.min.min(b);
        self.max = self.max.max(b);
    }

    /// Mean of |a − b|; 0 for nothing at all.
    #[must_use]
    pub fn mean_abs(&self) -> f64 {
        self.sum_abs / self.count.max(1) as f64
    }

    /// Mean of (a − b)², per component (not per voxel); 0 for nothing at all.
    #[must_use]
    pub fn mse(&self) -> f64 {
        self.sum_sq / self.count.max(1) as f64
    }

    /// Square root of [`ErrorStats::mse`].
    #[must_use]
    pub fn rmse(&self) -> f64 {
        self.mse().sqrt()
    }

    /// Smallest and largest component of `b`, or `None` where all are NaN.
    #[must_use]
    pub fn range(&self) -> Option<(f64, f64)> {
        (self.min <= self.max).then_some((self.min, self.max))
    }
}

/// Error sums of two boxes of the same extent and sample type.
///
/// # Errors
/// `E_PARAM` where the extents or the types differ.
pub fn error_stats(a: &View<'_>, b: &View<'_>) -> Result<ErrorStats> {
    check_same_extent(a, b)?;
    if a.sample_type != b.sample_type {
        return Err(Error::param("dtype", format!("{} and {} samples differ in type", a.sample_type, b.sample_type)));
    }
    Ok(with_sample!(a.sample_type, T => typed::<T>(a, b)))
}

/// Error sums of two boxes whose types may differ, but not in their number of components.
pub(super) fn by_value(a: &View<'_>, b: &View<'_>) -> ErrorStats {
    if a.sample_type == b.sample_type {
        return with_sample!(a.sample_type, T => typed::<T>(a, b));
    }
    let mut s = ErrorStats::default();
    with_sample!(a.sample_type, A => with_sample!(b.sample_type, B => for z in 0..a.extent.z {
        for y in 0..a.extent.y {
            for (a, b) in a.row::<A>(y, z).iter().zip(b.row::<B>(y, z)) {
                for c in 0..A::TYPE.components() {
                    s.add(a.component(c), b.component(c));
                }
            }
        }
    }));
    s
}

/// Smallest and largest component of a box; NaN is skipped, `None` where nothing else is there.
#[must_use]
pub fn value_range(a: &View<'_>) -> Option<(f64, f64)> {
    let mut stats = ErrorStats::default();
    with_sample!(a.sample_type, T => {
        for z in 0..a.extent.z {
            for y in 0..a.extent.y {
                T::bounds(a.row(y, z), &mut stats);
            }
        }
    });
    stats.range()
}

fn typed<T: Accumulate>(a: &View<'_>, b: &View<'_>) -> ErrorStats {
    let mut stats = ErrorStats::default();
    for z in 0..a.extent.z {
        for y in 0..a.extent.y {
            T::accumulate(a.row(y, z), b.row(y, z), &mut stats);
        }
    }
    stats.count = a.extent.voxels() * a.sample_type.components() as u64;
    stats
}

/// Adds one row to the sums, all but the count.
trait Accumulate: Sample {
    fn accumulate(a: &[Self], b: &[Self], stats: &mut ErrorStats);

    /// Takes the bounds of one row into account; what becomes of the sums is not said.
    fn bounds(row: &[Self], stats: &mut ErrorStats) {
        Self::accumulate(row, row, stats);
    }
}

/// Most elements for which a u32 holds a sum of squares of u8 differences: 255² · 2^15 < 2^31.
const CHUNK: usize = 1 << 15;

macro_rules! integer {
    // $t: sample, $d: its distance, $sq: type of a squared distance, $acc: accumulator of CHUNK of them
    ($($t:ty, $d:ty, $sq:ty, $acc:ty;)*) => {$(
        impl Accumulate for $t {
            fn accumulate(a: &[Self], b: &[Self], stats: &mut ErrorStats) {
                for (a, b) in a.chunks(CHUNK).zip(b.chunks(CHUNK)) {
                    let (mut sum, mut sq, mut top) = (0u32, <$acc>::MIN, <$d>::MIN);
                    let (mut min, mut max) = (<$t>::MAX, <$t>::MIN);
                    for (&a, &b) in a.iter().zip(b) {
                        let d = a.abs_diff(b);
                        top = top.max(d);
                        // Neither can overflow; checked additions would keep the loop from being vectorised.
                        sum = sum.wrapping_add(u32::from(d));
                        sq = sq.wrapping_add(<$acc>::from(<$sq>::from(d).wrapping_mul(<$sq>::from(d))));
                        min = min.min(b);
                        max = max.max(b);
                    }
                    stats.max_abs = stats.max_abs.max(f64::from(top));
                    stats.sum_abs += f64::from(sum);
                    stats.sum_sq += sq as f64;
                    stats.min = stats.min.min(f64::from(min));
                    stats.max = stats.max.max(f64::from(max));
                }
            }

            fn bounds(row: &[Self], stats: &mut ErrorStats) {
                let (mut min, mut max) = (<$t>::MAX, <$t>::MIN);
                for &v in row {
                    min = min.min(v);
                    max = max.max(v);
                }
                if min <= max {
                    stats.min = stats.min.min(f64::from(min));
                    stats.max = stats.max.max(f64::from(max));
                }
            }
        }
    )*};
}
integer! {
    u8, u8, u16, u32;
    u16, u16, u32, u64;
    i16, u16, u32, u64;
}

impl Accumulate for [u8; 3] {
    fn accumulate(a: &[Self], b: &[Self], stats: &mut ErrorStats) {
        u8::accumulate(a.as_flattened(), b.as_flattened(), stats);
    }

    fn bounds(row: &[Self], stats: &mut ErrorStats) {
        u8::bounds(row.as_flattened(), stats);
    }
}

/// |a − b| of two floats, where equal NaNs and infinities are no error and unequal ones an infinite one.
#[inline]
pub(super) fn float_error(a: f64, b: f64) -> f64 {
    let d = (a - b).abs();
    // Equal values first: ∞ − ∞ is NaN. What is then still NaN has one at one side only.
    if a == b || (a.is_nan() & b.is_nan()) {
        0.0
    } else if d.is_nan() {
        f64::INFINITY
    } else {
        d
    }
}

/// Independent sums, so that the compiler may use vector registers without changing the order of additions.
const LANES: usize = 8;

/// Sums over one row of floats, one per lane.
struct FloatSums {
    abs: [f64; LANES],
    sq: [f64; LANES],
    top: [f64; LANES],
    min: [f32; LANES],
    max: [f32; LANES],
}

impl FloatSums {
    #[inline(always)]
    fn of(a: &[f32], b: &[f32], error: impl Fn(f64, f64) -> f64) -> Self {
        let mut s = FloatSums {
            abs: [0.0; LANES],
            sq: [0.0; LANES],
            top: [0.0; LANES],
            min: [f32::INFINITY; LANES],
            max: [f32::NEG_INFINITY; LANES],
        };
        let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
        for (a, b) in a.iter().zip(b) {
            for i in 0..LANES {
                s.add(i, a[i], b[i], &error);
            }
        }
        for (i, (&a, &b)) in a_rest.iter().zip(b_rest).enumerate() {
            s.add(i, a, b, &error);
        }
        s
    }

    #[inline(always)]
    fn add(&mut self, i: usize, a: f32, b: f32, error: impl Fn(f64, f64) -> f64) {
        let d = error(f64::from(a), f64::from(b));
        self.abs[i] += d;
        self.sq[i] += d * d;
        // Written as selections, which skip NaN and compile to one instruction each.
        self.top[i] = if d > self.top[i] { d } else { self.top[i] };
        self.min[i] = if b < self.min[i] { b } else { self.min[i] };
        self.max[i] = if b > self.max[i] { b } else { self.max[i] };
    }
}

impl Accumulate for f32 {
    fn accumulate(a: &[Self], b: &[Self], stats: &mut ErrorStats) {
        let mut s = FloatSums::of(a, b, |a, b| (a - b).abs());
        // A NaN or an infinity anywhere in the row ends up in its sum: only then is the careful definition needed.
        if !s.abs.iter().sum::<f64>().is_finite() {
            s = FloatSums::of(a, b, float_error);
        }
        for i in 0..LANES {
            stats.max_abs = stats.max_abs.max(s.top[i]);
            stats.sum_abs += s.abs[i];
            stats.sum_sq += s.sq[i];
            stats.min = stats.min.min(f64::from(s.min[i]));
            stats.max = stats.max.max(f64::from(s.max[i]));
        }
    }
}
