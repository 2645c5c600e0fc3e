//! Numbers of the mirror: f32 as the shaders have, f64 for the truth.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// A float type that the mirror computes in.
pub trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + Send
    + Sync
    + std::fmt::Debug
    + 'static
{
    /// Rounded to this type.
    fn of(v: f64) -> Self;
    /// Widened.
    fn to_f64(self) -> f64;
    /// The largest whole number that is not above.
    fn floor(self) -> Self;
    /// The smallest whole number that is not below.
    fn ceil(self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// e^self.
    fn exp(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// self^e.
    fn pow(self, e: Self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// The larger.
    fn max(self, other: Self) -> Self;
    /// The smaller.
    fn min(self, other: Self) -> Self;
}

macro_rules! real {
    ($t:ty) => {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_lossless,
            reason = "rounding to the type is what is meant"
        )]
        impl Real for $t {
            fn of(v: f64) -> Self {
                v as $t
            }
            fn to_f64(self) -> f64 {
                self as f64
            }
            fn floor(self) -> Self {
                <$t>::floor(self)
            }
            fn ceil(self) -> Self {
                <$t>::ceil(self)
            }
            fn sqrt(self) -> Self {
                <$t>::sqrt(self)
            }
            fn exp(self) -> Self {
                <$t>::exp(self)
            }
            fn ln(self) -> Self {
                <$t>::ln(self)
            }
            fn pow(self, e: Self) -> Self {
                <$t>::powf(self, e)
            }
            fn abs(self) -> Self {
                <$t>::abs(self)
            }
            fn max(self, other: Self) -> Self {
                <$t>::max(self, other)
            }
            fn min(self, other: Self) -> Self {
                <$t>::min(self, other)
            }
        }
    };
}

real!(f32);
real!(f64);

/// Three of them.
pub type V3<R> = [R; 3];

/// a + b.
pub fn add<R: Real>(a: V3<R>, b: V3<R>) -> V3<R> {
    std::array::from_fn(|i| a[i] + b[i])
}

/// s · a.
pub fn scale<R: Real>(s: R, a: V3<R>) -> V3<R> {
    a.map(|v| s * v)
}

/// a · b.
pub fn dot<R: Real>(a: V3<R>, b: V3<R>) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Rounded to this type, each.
pub fn vec<R: Real>(v: [f64; 3]) -> V3<R> {
    v.map(R::of)
}
