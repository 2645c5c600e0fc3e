//! End points by least squares (spec chapter 8, §6): for a small squared error instead of a bounded one.
//!
//! Per block, from a few starts: every sample takes the index nearest to it, then the two end points are solved for in the
//! least-squares sense, and so on while that helps (Lloyd's method on two parameters). Every pair that comes up is judged
//! by the squared error of the *decoded* samples, and the best one wins; minimum and maximum are the first of them, so
//! that the result is never worse. End points stay inside the block's range: nothing decodes to what the source never
//! reaches.
//!
//! Sums are kept in a fixed number of lanes and added up in a fixed order, so that the result does not depend on the
//! machine: the same code is compiled for wider vectors where there are some (`fast_encode`).

use super::Scalar;

/// Partial sums that are kept side by side: one vector of f32, two of f64.
const LANES: usize = 8;

/// A sample type that end points can be fitted to.
pub trait Fit: Scalar {
    /// Samples are copied to this type, in which all sums of a run of [`RUN`] samples are exact or as good as.
    type Real: Real;
    /// The sample as a real number.
    fn real(self) -> Self::Real;
    /// The nearest sample to a number inside the type's range.
    fn round(v: f64) -> Self;
    /// Decodes `v`, clamped to the end points, by the formulas of [`Scalar`]: index and decoded sample.
    fn code(v: Self::Real, with: &Coder<Self::Real>) -> (Self::Real, Self::Real);
}

/// f32 or f64.
pub trait Real: Copy + PartialOrd + Default + std::ops::Add<Output = Self> + std::ops::Mul<Output = Self> {
    /// 1.5·2^(bits of the significand − 1): adding and subtracting it rounds a small number to an integer.
    const MAGIC: Self;
    /// From f64.
    fn of(v: f64) -> Self;
    /// To f64.
    fn to(self) -> f64;
    /// `self − other`.
    fn minus(self, other: Self) -> Self;
    /// The nearest integer.
    #[inline(always)]
    fn nearest(self) -> Self {
        (self + Self::MAGIC).minus(Self::MAGIC)
    }
}

macro_rules! real {
    ($t:ty, $magic:expr) => {
        impl Real for $t {
            const MAGIC: Self = $magic;
            #[inline(always)]
            fn of(v: f64) -> Self {
                v as $t
            }
            #[inline(always)]
            fn to(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn minus(self, other: Self) -> Self {
                self - other
            }
        }
    };
}
real!(f32, 12_582_912.0);
real!(f64, 6_755_399_441_055_744.0);

/// What a pair of end points means for all samples of a block.
pub struct Coder<R> {
    lo: R,
    hi: R,
    q: R,
    /// q / (hi − lo), or 0.
    scale: R,
    /// (hi − lo) / q, its quotient formed last for integers.
    range: R,
    inverse_q: R,
    /// Decides ties of decoded integers upward.
    half_up: R,
}

impl<R: Real> Coder<R> {
    #[inline(always)]
    fn new<T: Fit<Real = R>>(lo: T, hi: T, q: u32) -> Self {
        let (l, h, q) = (lo.real().to(), hi.real().to(), f64::from(q));
        let scale = if h > l { q / (h - l) } else { 0.0 };
        Coder {
            lo: R::of(l),
            hi: R::of(h),
            q: R::of(q),
            scale: R::of(scale),
            range: R::of(h - l),
            inverse_q: R::of(1.0 / q),
            half_up: R::of(0.25 / q),
        }
    }
}

/// `v`, no less than `lo` and no more than `hi`.
#[inline(always)]
fn clamp<R: Real>(v: R, lo: R, hi: R) -> R {
    let v = if v < lo { lo } else { v };
    if v > hi { hi } else { v }
}

macro_rules! integer {
    ($($t:ty, $real:ty, $tie:expr);*) => {$(
        impl Fit for $t {
            type Real = $real;
            #[inline(always)]
            fn real(self) -> $real {
                <$real>::from(self)
            }
            #[inline(always)]
            fn round(v: f64) -> Self {
                (v + 0.5).floor() as $t
            }
            // Index and decoded sample are quotients with ½ added: 1/(2R) and 1/(2q) apart, or equal. A tie is moved up by
            // less than that and by more than all roundings (below 2^-14 for u8 in f32, 2^-30 for 16 bits in f64).
            #[inline(always)]
            fn code(v: $real, with: &Coder<$real>) -> ($real, $real) {
                let d = clamp(v, with.lo, with.hi) - with.lo;
                let index = (d * with.scale + $tie).nearest();
                let step = (index * with.range * with.inverse_q + with.half_up).nearest();
                (index, with.lo + step)
            }
        }
    )*};
}
integer!(u8, f32, 1.0 / 1024.0; u16, f64, 1.0 / 262_144.0; i16, f64, 1.0 / 262_144.0);

impl Fit for f32 {
    type Real = f64;
    #[inline(always)]
    fn real(self) -> f64 {
        f64::from(self)
    }
    #[inline(always)]
    fn round(v: f64) -> Self {
        (v as f32).stored()
    }
    // As Scalar::index and Scalar::reconstruct: the floor of t, which is not negative, and the same expression.
    #[inline(always)]
    fn code(v: f64, with: &Coder<f64>) -> (f64, f64) {
        let t = (clamp(v, with.lo, with.hi) - with.lo) * with.scale + 0.5;
        let near = t.nearest();
        let floor = if near > t { near - 1.0 } else { near };
        let index = if floor > with.q { with.q } else { floor };
        let a = index / with.q;
        (index, f64::from(((1.0 - a) * with.lo + a * with.hi) as f32))
    }
}

/// Samples that are summed up in lanes before they go to the totals: f32 lanes of u8 stay exact.
const RUN: usize = 512;

/// Sums over a block, with samples taken relative to the block's minimum.
#[derive(Default)]
struct Sums {
    indices: f64,
    squares: f64,
    samples: f64,
    products: f64,
    /// Squared error of the decoded samples.
    error: f64,
}

#[inline(always)]
fn total<R: Real>(lanes: &[R; LANES]) -> f64 {
    lanes.iter().fold(0.0, |sum, v| sum + v.to())
}

#[inline(always)]
fn sums<T: Fit>(block: &[T::Real], base: T::Real, coder: &Coder<T::Real>) -> Sums {
    let mut sums = Sums::default();
    for run in block.chunks(RUN) {
        let mut lanes = [[T::Real::default(); LANES]; 5];
        let mut add = |l: usize, v: T::Real| {
            let (index, decoded) = T::code(v, coder);
            let (sample, off) = (v.minus(base), v.minus(decoded));
            lanes[0][l] = lanes[0][l] + index;
            lanes[1][l] = lanes[1][l] + index * index;
            lanes[2][l] = lanes[2][l] + sample;
            lanes[3][l] = lanes[3][l] + sample * index;
            lanes[4][l] = lanes[4][l] + off * off;
        };
        let (whole, rest) = run.as_chunks::<LANES>();
        for samples in whole {
            for (l, &v) in samples.iter().enumerate() {
                add(l, v);
            }
        }
        for (l, &v) in rest.iter().enumerate() {
            add(l, v);
        }
        sums.indices += total(&lanes[0]);
        sums.squares += total(&lanes[1]);
        sums.samples += total(&lanes[2]);
        sums.products += total(&lanes[3]);
        sums.error += total(&lanes[4]);
    }
    sums
}

/// How much of the range the starts leave out at the lower and at the upper end.
fn starts(q: u32) -> [(f64, f64); 4] {
    match q {
        1 => [(0.0, 0.0), (0.25, 0.25), (0.0, 0.5), (0.5, 0.0)],
        3 => [(0.0, 0.0), (0.125, 0.125), (0.0, 0.35), (0.35, 0.0)],
        15 => [(0.0, 0.0), (0.03, 0.03), (0.0, 0.15), (0.15, 0.0)],
        _ => [(0.0, 0.0), (0.002, 0.002), (0.0, 0.01), (0.01, 0.0)],
    }
}

/// Rounds of assignment and solution per start.
const ROUNDS: usize = 4;

/// End points with a small squared error for the samples of a block, whose smallest and largest are `min` and `max`.
#[inline(always)]
pub fn fit<T: Fit>(block: &[T::Real], min: T, max: T, q: u32) -> (T, T) {
    // spec: S3D-16: a constant block stays one. Two samples need no fit either.
    if min >= max || block.len() <= 2 {
        return (min, max);
    }
    let (low, high) = (min.real().to(), max.real().to());
    let mut best = (f64::INFINITY, (min, max));
    let mut seen = [(min, max); ROUNDS * 4];
    let mut tried = 0;
    for (from_low, from_high) in starts(q) {
        let range = high - low;
        let mut pair = (T::round(low + from_low * range), T::round(high - from_high * range));
        for _ in 0..ROUNDS {
            if pair.0 > pair.1 || seen[..tried].contains(&pair) {
                break;
            }
            seen[tried] = pair;
            tried += 1;
            let sums = sums::<T>(block, min.real(), &Coder::new(pair.0, pair.1, q));
            if sums.error < best.0 {
                best = (sums.error, pair);
                if sums.error == 0.0 {
                    return pair;
                }
            }
            let Some((lo, hi)) = solve(block.len() as f64, &sums, f64::from(q)) else { break };
            let inside = |v: f64| T::round((low + v).clamp(low, high));
            pair = (inside(lo), inside(hi));
        }
    }
    best.1
}

/// End points of the line through (index, sample) with the least squares, relative to the block's minimum. `None` where
/// all indices are equal.
fn solve(n: f64, sums: &Sums, q: f64) -> Option<(f64, f64)> {
    let determinant = n * sums.squares - sums.indices * sums.indices;
    if determinant <= 0.0 {
        return None;
    }
    let step = (n * sums.products - sums.indices * sums.samples) / determinant;
    let lo = (sums.samples - step * sums.indices) / n;
    Some((lo, lo + step * q))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn agrees<T: Fit>(lo: T, hi: T, values: &[T]) {
        for q in [1, 3, 15, 255] {
            let coder = Coder::new(lo, hi, q);
            for &v in values {
                let (index, decoded) = T::code(v.real(), &coder);
                let expected = v.index(lo, hi, q);
                assert_eq!(index.to(), f64::from(expected), "{v:?} in {lo:?}..={hi:?}, q {q}");
                assert_eq!(decoded.to(), T::reconstruct(lo, hi, expected, q).real().to());
            }
        }
    }

    #[test] // every sample and every pair of end points of u8; spec: S3D-10, S3D-20
    fn bytes_are_coded_as_the_formulas_say() {
        let all: Vec<u8> = (0..=255).collect();
        for range in 0..=255u8 {
            agrees(0, range, &all);
            agrees(255 - range, 255, &all);
        }
    }

    #[test] // spec: S3D-10, S3D-20
    fn words_are_coded_as_the_formulas_say() {
        let all: Vec<u16> = (0..=u16::MAX).collect();
        for range in [1, 2, 3, 254, 255, 256, 4095, 32_766, 65_533, 65_534, 65_535] {
            agrees(0, range, &all);
            agrees(u16::MAX - range, u16::MAX, &all);
        }
        agrees(i16::MIN, i16::MAX, &(i16::MIN..=i16::MAX).collect::<Vec<_>>());
    }

    #[test] // spec: S3D-11, S3D-21
    fn floats_are_coded_as_the_formulas_say() {
        for (lo, hi) in [(-1.0, 2.0), (0.0, 15.0), (f32::MIN, f32::MAX), (1.0, 1.000_000_2), (0.0, 1e-45), (3.0, 3.0)] {
            let wide = f64::from(hi) - f64::from(lo);
            let values: Vec<f32> =
                (0..=30_000).map(|k| (f64::from(lo) + wide * f64::from(k) / 30_000.0) as f32).collect();
            agrees(lo, hi, &values);
            agrees(lo, hi, &[f32::MIN, f32::MAX, 0.0]);
        }
    }

    #[test]
    fn two_values_are_found_between_outliers() {
        let mut block = vec![10.0f32; 30];
        block.extend(vec![200.0; 30]);
        block.extend([0.0, 255.0]);
        assert_eq!(fit::<u8>(&block, 0, 255, 1), (10, 202));
    }
}
